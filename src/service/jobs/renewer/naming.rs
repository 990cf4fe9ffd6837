//! Labels of the jobs and policies that are created automatically.

use jiff::Timestamp;

use crate::store::{LONGEST_NAME, Relabel};

/// Tag of policies that were trained automatically.
const TAG: &str = "renewed";

/// Returns the labels of the next policy: the name of its predecessor, and the month it was trained in.
pub(super) fn next_labels(parent: &str, now_ms: i64) -> Relabel {
    let month = Timestamp::from_millisecond(now_ms).map_or(String::new(), |now| now.strftime(" %b %Y").to_string());
    let stem = parent.split(" (renewed ").next().unwrap_or_default();
    let name = if stem.is_empty() {
        format!("Renewed{month}")
    } else {
        let when = format!(" (renewed{month})");
        let room = LONGEST_NAME - when.len();
        stem.chars().take(room).chain(when.chars()).collect()
    };
    Relabel { name: Some(name), notes: None, tags: Some(vec![TAG.to_owned()]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_policy_is_called_as_the_one_before_it_and_when_it_was_trained() {
        let november = 1_795_000_000_000;
        let name = |parent: &str| next_labels(parent, november).name.unwrap();
        assert_eq!(name("US equity, cautious"), "US equity, cautious (renewed Nov 2026)");
        assert_eq!(name("US equity, cautious (renewed Nov 2025)"), "US equity, cautious (renewed Nov 2026)");
        assert_eq!(name(""), "Renewed Nov 2026");
        assert_eq!(name(&"é".repeat(100)).chars().count(), 100);
        next_labels(&"é".repeat(100), november).check().unwrap();
    }
}
