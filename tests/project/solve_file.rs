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

/// The files that the page of templates solves, with the answers that it shows.
fn templates(page: &str) -> Vec<(&str, &str)> {
    let sections = page.split("`cargo run --release -- solve ").skip(1);
    let shown = sections.map(|section| {
        let (file, rest) = section.split_once('`').unwrap();
        (file, rest.split("```text\n").nth(1).unwrap().split("```").next().unwrap())
    });
    shown.collect()
}

/// The answer on the page of templates is tested below.
#[test]
fn the_page_shows_the_example_and_its_answer() {
    let (page, templates_page) = (read("docs/declared.md"), read("docs/templates.md"));
    assert!(page.contains(&format!("```json\n{}```\n", read(EXAMPLE))), "the page shows another declaration");
    let (_, answer) = templates(&templates_page).into_iter().find(|(file, _)| *file == EXAMPLE).unwrap();
    assert!(page.contains(&format!("```text\n{answer}```\n")), "{answer}");
}

#[test]
fn the_page_of_templates_shows_what_each_answers() {
    let page = read("docs/templates.md");
    let shown = templates(&page);
    let folder = format!("{}/examples/problems", env!("CARGO_MANIFEST_DIR"));
    assert_eq!(shown.len(), fs::read_dir(folder).unwrap().count(), "a section for each file");
    for (file, expected) in shown {
        let answered = solve(&[file]);
        assert!(answered.status.success(), "{file}: {}", String::from_utf8_lossy(&answered.stderr));
        assert_eq!(String::from_utf8(answered.stdout).unwrap(), expected, "{file}");
    }
}

#[test]
fn the_answer_as_json_is_the_one_in_words() {
    let file = "examples/problems/regulator.json";
    let printed = String::from_utf8(solve(&[file]).stdout).unwrap();
    let answer: Value = serde_json::from_slice(&solve(&[file, "--json"]).stdout).unwrap();
    let push = answer["actions"]["push"].as_f64().unwrap();
    assert!(printed.starts_with(&format!("push: {}\n", (1e5 * push).round() / 1e5)), "{printed} for {push}");
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
