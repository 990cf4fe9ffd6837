//! `ballast solve` prints what its page shows, of the declaration that the page shows, and refuses what it says it refuses.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;

const EXAMPLE: &str = "examples/problems/stock.json";

fn solve(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).arg("solve").args(arguments).output().unwrap()
}

fn read(path: &str) -> String {
    fs::read_to_string(format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

#[test]
fn the_page_shows_the_example_and_its_answer() {
    let (page, declared) = (read("docs/declared.md"), read(EXAMPLE));
    assert!(page.contains(&format!("```json\n{declared}```\n")), "the page shows another declaration");
    let answered = solve(&[EXAMPLE]);
    let printed = String::from_utf8(answered.stdout).unwrap();
    assert!(answered.status.success() && page.contains(&format!("```text\n{printed}```\n")), "{printed}");
    let json = solve(&[EXAMPLE, "--json"]).stdout;
    let answer: Value = serde_json::from_slice(&json).unwrap();
    let order = answer["actions"]["order"].as_f64().unwrap();
    assert!(printed.starts_with(&format!("order: {}\n", (1e4 * order).round() / 1e4)), "{printed} for {order}");
}

#[test]
fn the_page_of_templates_shows_what_each_answers() {
    let page = read("docs/templates.md");
    let shown: Vec<(&str, &str)> = page
        .split("`cargo run --release -- solve ")
        .skip(1)
        .map(|part| {
            let (file, rest) = part.split_once('`').unwrap();
            (file, rest.split("```text\n").nth(1).unwrap().split("```").next().unwrap())
        })
        .collect();
    let folder = format!("{}/examples/problems", env!("CARGO_MANIFEST_DIR"));
    assert_eq!(shown.len(), fs::read_dir(folder).unwrap().count(), "a section for each file");
    for (file, expected) in shown {
        let answered = solve(&[file]);
        assert!(answered.status.success(), "{file}: {}", String::from_utf8_lossy(&answered.stderr));
        assert_eq!(String::from_utf8(answered.stdout).unwrap(), expected, "{file}");
    }
}

#[test]
fn a_fault_of_the_file_names_the_field() {
    let page = read("docs/declared.md");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("problem.json");
    for (from, to) in
        [("\"max(stock + order - demand, 0)\"", "\"stock + order - demand\""), ("cost*order", "cost*ordr")]
    {
        fs::write(&file, read(EXAMPLE).replacen(from, to, 1)).unwrap();
        let refused = solve(&[file.to_str().unwrap()]);
        let fault = String::from_utf8(refused.stderr).unwrap();
        assert!(!refused.status.success() && page.contains(fault.trim_end()), "{fault}");
    }
    fs::write(&file, read(EXAMPLE).replacen("\"price\": 9,", "\"price\": 9, \"price\": 90,", 1)).unwrap();
    let fault = String::from_utf8(solve(&[file.to_str().unwrap()]).stderr).unwrap();
    assert!(fault.contains("`price` stands twice at line 6"), "{fault}");
    fs::write(&file, read(EXAMPLE).replacen("\"end\"", "\"ending\"", 1)).unwrap();
    let fault = String::from_utf8(solve(&[file.to_str().unwrap()]).stderr).unwrap();
    assert!(fault.contains("unknown field `ending`") && fault.contains("line 9"), "{fault}");
    fs::write(&file, read(EXAMPLE).replacen("\"horizon\": 12", "\"horizon\": 9000000000000000000", 1)).unwrap();
    let fault = String::from_utf8(solve(&[file.to_str().unwrap()]).stderr).unwrap();
    assert!(fault.contains("problem.horizon is 9000000000000000000: must lie in [1, 520]"), "{fault}");
    let absent = String::from_utf8(solve(&["no such file"]).stderr).unwrap();
    assert!(absent.contains("no such file: "), "{absent}");
}
