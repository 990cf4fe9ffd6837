//! The words by which sessions and policies are found, each in a row of an index.
//!
//! A word is a run of letters and digits, in lower case. The words of a session or a policy are those of its name and
//! its tags, each also as it is typed on a keyboard without accents, and its identifier without the prefix, marked by a
//! character that no word has. A row is written and deleted with the thing it finds. A missing row would hide a session
//! from a search, and do nothing else.

use std::collections::BTreeSet;

use any_ascii::any_ascii;

use crate::store::engine::error::Failure;
use crate::store::engine::query::StoreConnection;
use crate::store::engine::statement::Statement;
use crate::store::tenants::quotas;
use crate::store::tenants::tenant::Tenant;

/// Bytes that a row of the index takes beside its word, about the same in either engine.
const ROW_BYTES: i64 = 64;

/// A thing that has words: a session or a policy of a tenant.
#[derive(Debug, Clone, Copy)]
pub(in crate::store) struct Worded<'a> {
    pub tenant: &'a Tenant,
    pub kind: Labelled,
    /// The sequence of its row in `sessions` or `policy_owners`.
    pub sequence: i64,
}

/// Returns the words of a text, each once.
pub(in crate::store) fn words(text: &str) -> BTreeSet<String> {
    let lower = text.to_lowercase();
    lower.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

/// Returns the words by which a text is found: its own, and those in Latin letters without accents.
pub(in crate::store) fn findable(text: &str) -> BTreeSet<String> {
    words(text).into_iter().chain(words(&any_ascii(text))).collect()
}

/// Returns the row's word for an identifier, or for its beginning: its digits behind a mark. A search of few letters,
/// which finds no identifier, need not pass over them all.
pub(in crate::store) fn identifying(identifier: &str) -> String {
    format!("#{}", identifier.rsplit_once('_').map_or(identifier, |(_, digits)| digits))
}

/// Encodes words for their column: a space before each, so that a substring search finds the beginning of a word.
pub(in crate::store) fn column(words: &BTreeSet<String>) -> String {
    words.iter().flat_map(|word| [" ", word]).collect()
}

/// Returns the bytes that words count as: their column, and a row for each, as in `check::TOTALS`.
pub(in crate::store) fn bytes(words: &BTreeSet<String>) -> i64 {
    words.iter().map(|word| 2 * (1 + quotas::length(word.as_bytes())) + ROW_BYTES).sum()
}

/// The kinds of things that have labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Labelled {
    Policy,
    Session,
}

impl Labelled {
    pub(in crate::store) fn as_str(self) -> &'static str {
        match self {
            Labelled::Policy => "policy",
            Labelled::Session => "session",
        }
    }
}

/// Adds the rows of these words.
pub(in crate::store) async fn add<'w>(
    connection: &mut StoreConnection<'_>,
    of: Worded<'_>,
    words: impl IntoIterator<Item = &'w str>,
) -> Result<(), Failure> {
    let mut insert = Statement::of("INSERT INTO words (tenant, kind, sequence, word) VALUES ");
    let mut separator = "";
    for word in words {
        let values = [of.tenant.as_str().into(), of.kind.as_str().into(), of.sequence.into(), word.into()];
        insert.and(&format!("{separator}(?, ?, ?, ?)"), values);
        separator = ", ";
    }
    if separator.is_empty() {
        return Ok(());
    }
    insert.and(" ON CONFLICT DO NOTHING", []);
    connection.execute(insert.query()).await.map(drop)
}

/// Removes the rows of these words.
pub(in crate::store) async fn remove<'w>(
    connection: &mut StoreConnection<'_>,
    of: Worded<'_>,
    words: impl IntoIterator<Item = &'w str>,
) -> Result<(), Failure> {
    let mut delete = Statement::of("DELETE FROM words");
    let values = [of.tenant.as_str().into(), of.kind.as_str().into(), of.sequence.into()];
    delete.and(" WHERE tenant = ? AND kind = ? AND sequence = ? AND word IN (", values);
    let mut separator = "";
    for word in words {
        delete.and(&format!("{separator}?"), [word.into()]);
        separator = ", ";
    }
    delete.and(")", []);
    if separator.is_empty() { Ok(()) } else { connection.execute(delete.query()).await.map(drop) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_runs_of_letters_and_digits_in_lower_case() {
        let found = |text: &str| words(text).into_iter().collect::<Vec<_>>();
        assert_eq!(found("US-Equity, \u{c9}t\u{c9} 2024/us"), ["2024", "equity", "us", "\u{e9}t\u{e9}"]);
        assert_eq!(found(" -'\u{2605}"), [""; 0]);
        let findable = |text: &str| findable(text).into_iter().collect::<Vec<_>>();
        assert_eq!(findable("M\u{fc}ller & Co"), ["co", "muller", "m\u{fc}ller"]);
        assert_eq!(findable("\u{141}\u{f3}d\u{17a} Jo\u{e3}o"), ["joao", "jo\u{e3}o", "lodz", "\u{142}\u{f3}d\u{17a}"]);
        // An accent that stands behind its letter as a character of its own.
        assert!(findable("mu\u{308}ller").contains(&"muller".to_owned()));
        assert_eq!(column(&words("b a")), " a b");
        assert_eq!(bytes(&words("b ab")), 2 * " ab b".len() as i64 + 2 * ROW_BYTES);
        assert_eq!([identifying("session_0a"), identifying("1b")], ["#0a", "#1b"]);
    }
}
