//! The table of `src/control/mod.rs` leads from the paper to the code and to its tests: every entry of it exists.

use std::fs;
use std::path::Path;

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of the table, cell by cell, code spans without their marks.
fn rows() -> Vec<Vec<String>> {
    let head = read("src/control/mod.rs");
    let rows = head.lines().filter_map(|line| line.strip_prefix("//! | ")).skip(1);
    let cells = |row: &str| row.trim_end_matches(" |").split(" | ").map(|cell| cell.replace('`', "")).collect();
    rows.map(cells).collect()
}

#[test]
fn every_entry_of_the_table_exists() {
    let rows = rows();
    assert!(rows.len() >= 20, "{} rows", rows.len());
    for row in rows {
        let [symbol, name, _, file, test] = row.as_slice() else { panic!("five cells a row: {row:?}") };
        let code = read(&format!("src/{file}"));
        let is_defined =
            ["fn", "struct", "enum", "trait"].iter().any(|kind| code.contains(&format!("pub {kind} {name}")));
        assert!(is_defined || code.contains(&format!("fn {name}(")), "{symbol}: {file} defines no {name}");
        let (test_file, test_name) =
            test.split_once("::").unwrap_or_else(|| panic!("{symbol}: {test} is no file::test"));
        assert!(read(test_file).contains(&format!("fn {test_name}(")), "{symbol}: there is no test {test}");
    }
}

#[test]
fn equations_are_cited_as_printed() {
    // Labels of the paper's source, which nobody sees in print.
    let labels = ["(max", "(bellman)", "(nar)", "(clt)", "(f_map)"];
    let folders = ["src/control", "src/numerics"].map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
    let mut open: Vec<_> = folders.into();
    let mut files = 0;
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        files += 1;
        let text = fs::read_to_string(&path).unwrap();
        let cited = text.lines().filter(|line| line.trim_start().starts_with("//"));
        let found: Vec<&str> = cited.filter(|line| labels.iter().any(|label| line.contains(label))).collect();
        assert!(found.is_empty(), "{}: {found:?}", path.display());
    }
    assert!(files > 50, "{files} files read");
}
