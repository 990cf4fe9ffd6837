//! `docs/threat-model.md` promises nothing that no test holds.

use std::fs;
use std::path::Path;

#[test]
fn every_test_the_threat_model_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let document = fs::read_to_string(root.join("docs/threat-model.md")).unwrap();
    let rows: Vec<&str> = document.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    assert!(rows.len() >= 16, "{rows:?}");
    for row in rows {
        let named: Vec<&str> = row.split('`').filter(|code| code.contains("::")).collect();
        assert!(!named.is_empty(), "no test holds: {row}");
        for name in named {
            let (file, test) = name.split_once("::").unwrap();
            let source = fs::read_to_string(root.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
            let at = source.find(&format!("fn {test}(")).unwrap_or_else(|| panic!("there is no {name}"));
            // Marked as a test, or run by those that are: over a folder and over a database.
            let is_marked = source[..at].trim_end().trim_end_matches("async").trim_end().ends_with(']');
            assert!(is_marked || source.matches(test).count() > 1, "{name} is not a test");
        }
    }
}
