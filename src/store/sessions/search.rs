//! The sessions that match a search, and the rows that a list examines to find them.
//!
//! A search consists of words. Each must be the beginning of a word of the session's name or tags, or of its policy's
//! name or tags; or it is eight or more digits that begin the identifier of either. [`matches()`] is this condition, and
//! alone decides about a row. The index of [`crate::store::sessions::words`] selects the rows to test:
//!
//! - among the words of the search, the list uses the one that the fewest sessions have, counted in the index up to a
//!   bound, and beyond it among the newest and the oldest sessions;
//! - if they are many, it first tests the sessions next in the list, which suffices unless the matches were opened
//!   together long ago; then some that the index finds; then all of those.
//!
//! Cost: for a rare word, an index lookup for each session that has it; for a common word, [`WINDOW`] rows, and if
//! those are not enough, one pass over the rows of the index, for the beginning of a word over all that begin so. A pass
//! over the sessions of a word follows only if every word is common and few sessions have all. Checked by:
//! `tests/service/search.rs`, `tests/operation/lists.rs`.

use crate::store::engine::error::Failure;
use crate::store::engine::query::{Query, StoreRow, Value};
use crate::store::engine::statement::{Statement, TABLES};
use crate::store::sessions::words::{self, Labelled};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The number of sessions tested before more are.
const WINDOW: i64 = 500;
/// The sessions of a word are counted up to this bound.
const COUNTED: i64 = 10_000;
/// Words that reach the bound are compared among so many of the newest sessions and as many of the oldest.
const SAMPLED: i64 = 100;
/// The most policies that a word may belong to; beyond this it does not narrow the search.
const MOST_POLICIES: i64 = 100;
/// The most words of a search that are compared by how many sessions have them; the longest are used.
const MOST_WORDS: usize = 8;
/// The fewest characters that find an identifier; fewer are more likely the beginning of a word of a name.
const SHORTEST_IDENTIFIER: usize = 8;
/// Sorts above every character of a word.
const LAST: char = char::MAX;

/// The sessions that a statement examines.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Among {
    All,
    /// This many after the page before, in the order in which they were opened.
    Next(i64),
    /// Those that the index finds by a word; if bounded, this many after the page before.
    Of(IndexedWord, Option<i64>),
}

/// The beginning of a word, and the policies that the index finds by it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct IndexedWord {
    beginning: String,
    policies: Vec<String>,
}

/// The word of a search that the fewest sessions have, and how many do, up to a bound.
pub(super) struct Rarest {
    found: IndexedWord,
    count: i64,
}

/// The order in which sessions were opened, from the point where a page begins.
pub(super) struct OpeningSpan {
    pub start: i64,
    pub order: &'static str,
    pub beyond: char,
}

impl Store {
    /// Returns the word that the fewest sessions have, among those of a search and a tag; `None` if no word narrows the
    /// search.
    pub(super) async fn rarest(&self, tenant: &Tenant, search: &str, tag: &str) -> Result<Option<Rarest>, StoreError> {
        let mut sought = beginnings(search);
        sought.extend(words::words(tag));
        sought.sort_by_key(|word| std::cmp::Reverse(word.len()));
        sought.truncate(MOST_WORDS);
        if sought.is_empty() {
            return Ok(None);
        }
        let find = policies(tenant, &sought);
        let found = |rows: &[StoreRow]| found(&sought, rows);
        let narrowing = self.list("searching policies", find, found).await?;
        if narrowing.is_empty() {
            return Ok(None);
        }
        let of_each = |rows: &[StoreRow]| -> Result<Vec<i64>, Failure> {
            let Some(row) = rows.first() else { return Ok(Vec::new()) };
            (0..narrowing.len()).map(|place| row.get(&format!("word_{place}"))).collect()
        };
        let counts = self.list("counting words", counting(tenant, &narrowing), of_each).await?;
        let ranks = match narrowing.len() {
            2.. if counts.iter().all(|&count| count == COUNTED) => {
                self.list("sampling words", sampling(tenant, &narrowing), of_each).await?
            }
            _ => counts.clone(),
        };
        let ranked = narrowing.into_iter().zip(counts).zip(ranks);
        let rarest = ranked.min_by_key(|(_, rank)| *rank);
        Ok(rarest.map(|((found, count), _)| Rarest { found, count }))
    }
}

impl Rarest {
    /// Returns the sets of sessions to examine for a page in the order of opening, one after the other until the page
    /// is full.
    pub(super) fn windows(self) -> Vec<Among> {
        if self.count <= WINDOW {
            return vec![self.all()];
        }
        let first = [Among::Next(WINDOW), Among::Of(self.found.clone(), Some(WINDOW))];
        first.into_iter().chain([self.all()]).collect()
    }

    pub(in crate::store) fn all(self) -> Among {
        Among::Of(self.found, None)
    }
}

/// Returns the word beginnings to search for: the words, and the digits of an identifier.
fn beginnings(search: &str) -> Vec<String> {
    let lower = search.to_lowercase();
    let words = lower.split_whitespace().map(|word| word.strip_prefix("session_").unwrap_or(word));
    words.flat_map(words::words).collect()
}

/// Adds the condition that every word of the search matches the session.
pub(in crate::store) fn matches(statement: &mut Statement, search: &str) {
    let beginnings = beginnings(search);
    if beginnings.is_empty() {
        statement.and(" AND 1 = 0", []);
    }
    for word in beginnings {
        statement.and(" AND (", []);
        labelled(statement, &word);
        if word.len() >= SHORTEST_IDENTIFIER {
            let (session, policy) = (format!("session\\_{word}%"), format!("{word}%"));
            let identifiers = r" OR sessions.session LIKE ? ESCAPE '\'
                OR coalesce(renewals.policy, sessions.policy) LIKE ?";
            statement.and(identifiers, [session.into(), policy.into()]);
        }
        statement.and(")", []);
    }
}

/// Adds the condition that the name or a tag of the session or of its policy has a word that begins so.
fn labelled(statement: &mut Statement, word: &str) {
    let part = format!("% {word}%");
    statement.and("labels.words LIKE ? OR called.words LIKE ?", [part.as_str().into(), part.as_str().into()]);
}

impl Among {
    /// Adds the condition that a session is one of these.
    pub(super) fn narrow(
        &self,
        statement: &mut Statement,
        tenant: &Tenant,
        OpeningSpan { start, order, beyond }: OpeningSpan,
    ) {
        if let Among::All = self {
            statement.and(" WHERE sessions.tenant = ?", [tenant.as_str().into()]);
            return;
        }
        // Neither engine can use an index on an expression, so none replaces the index that narrows.
        statement.and(" WHERE sessions.tenant || '' = ? AND sessions.sequence IN (", [tenant.as_str().into()]);
        let next = |statement: &mut Statement, limit: i64| {
            let next = format!(" AND sequence {beyond} ? ORDER BY sequence {order} LIMIT ?");
            statement.and(&next, [start.into(), limit.into()]);
        };
        match self {
            Among::All => {}
            Among::Next(limit) => {
                statement.and("SELECT sequence FROM sessions WHERE tenant = ?", [tenant.as_str().into()]);
                next(statement, *limit);
            }
            Among::Of(found, None) => found.sequences(statement, tenant, &|_| ()),
            Among::Of(found, Some(limit)) => {
                statement.and("SELECT sequence FROM (", []);
                found.sequences(statement, tenant, &|statement| next(statement, *limit));
                statement.and(") AS found WHERE 1 = 1", []);
                next(statement, *limit);
            }
        }
        statement.and(")", []);
    }
}

impl IndexedWord {
    /// Adds the statement that selects the sessions that the index finds, including those that have since left a
    /// policy. `bounded` ends each of its parts: the word itself, whose sessions the index has in order; the words that
    /// it begins; the identifiers; and the policies.
    fn sequences(&self, statement: &mut Statement, tenant: &Tenant, bounded: &dyn Fn(&mut Statement)) {
        let of_word = |condition: &str, words: Vec<String>| -> (String, Vec<String>) {
            let select = format!("SELECT sequence FROM words WHERE tenant = ? AND kind = ? AND {condition}");
            let owner = [tenant.as_str(), Labelled::Session.as_str()].map(str::to_owned);
            (select, owner.into_iter().chain(words).collect())
        };
        let mut parts = vec![
            of_word("word = ?", vec![self.beginning.clone()]),
            of_word("word > ? AND word < ?", begun(self.beginning.clone())),
        ];
        if self.beginning.len() >= SHORTEST_IDENTIFIER {
            parts.push(of_word("word >= ? AND word < ?", begun(words::identifying(&self.beginning))));
        }
        if !self.policies.is_empty() {
            let marks = vec!["?"; self.policies.len()].join(", ");
            let held = || [tenant.as_str().to_owned()].into_iter().chain(self.policies.clone()).collect();
            let first = format!("SELECT sequence FROM sessions WHERE tenant || '' = ? AND policy IN ({marks})");
            let later = format!(
                "SELECT owned.sequence FROM renewals JOIN sessions AS owned ON owned.session = renewals.session
                 WHERE owned.tenant || '' = ? AND renewals.policy IN ({marks})"
            );
            parts.extend([(first, held()), (later, held())]);
        }
        for (place, (select, values)) in parts.into_iter().enumerate() {
            let union = if place == 0 { "" } else { " UNION ALL " };
            statement.and(&format!("{union}SELECT sequence FROM ({select}"), values.into_iter().map(Value::from));
            bounded(statement);
            statement.and(&format!(") AS part_{place}"), []);
        }
    }
}

/// Returns a word of the index, and a text above all words that begin with it.
fn begun(word: String) -> Vec<String> {
    let end = format!("{word}{LAST}");
    vec![word, end]
}

/// Selects the policies that the index finds by each of these beginnings, up to one more than the limit.
fn policies(tenant: &Tenant, sought: &[String]) -> Query {
    let mut statement = Statement::of("");
    for (place, word) in sought.iter().enumerate() {
        let union = if place == 0 { "" } else { " UNION ALL " };
        let found = format!(
            "{union}SELECT CAST({place} AS BIGINT) AS place, policy FROM (SELECT policy_owners.policy FROM words
             JOIN policy_owners ON policy_owners.sequence = words.sequence"
        );
        statement.and(&found, []);
        let range = " WHERE words.tenant = ? AND words.kind = ? AND (words.word >= ? AND words.word < ?";
        let owned = [tenant.as_str(), Labelled::Policy.as_str()].map(str::to_owned);
        statement.and(range, owned.into_iter().chain(begun(word.clone())).map(Value::from));
        if word.len() >= SHORTEST_IDENTIFIER {
            let identifiers = begun(words::identifying(word)).into_iter().map(Value::from);
            statement.and(" OR words.word >= ? AND words.word < ?", identifiers);
        }
        statement.and(")", []);
        statement.and(&format!(" LIMIT ?) AS found_{place}"), [(MOST_POLICIES + 1).into()]);
    }
    statement.query()
}

/// Returns the beginnings that narrow the search, each with its policies.
fn found(sought: &[String], rows: &[StoreRow]) -> Result<Vec<IndexedWord>, Failure> {
    let mut found: Vec<_> =
        sought.iter().map(|word| IndexedWord { beginning: word.clone(), policies: Vec::new() }).collect();
    for row in rows {
        let place = row.length("place")?;
        found[place].policies.push(row.get("policy")?);
    }
    found.retain(|found| found.policies.len() <= MOST_POLICIES as usize);
    Ok(found)
}

/// Counts the sessions that the index finds by each of these, up to a bound.
fn counting(tenant: &Tenant, narrowing: &[IndexedWord]) -> Query {
    let mut statement = Statement::of("SELECT");
    for (place, found) in narrowing.iter().enumerate() {
        statement.and(if place == 0 { " (" } else { ", (" }, []);
        statement.and("SELECT count(*) FROM (SELECT 1 AS one FROM (", []);
        found.sequences(&mut statement, tenant, &|_| ());
        statement.and(&format!(") AS each_word LIMIT ?) AS counted) AS word_{place}"), [COUNTED.into()]);
    }
    statement.query()
}

/// Counts the newest and the oldest sessions that each of these finds.
fn sampling(tenant: &Tenant, narrowing: &[IndexedWord]) -> Query {
    let mut statement = Statement::of("SELECT");
    for (place, found) in narrowing.iter().enumerate() {
        let comma = if place == 0 { "" } else { "," };
        statement.and(&format!("{comma} coalesce(sum(CASE WHEN "), []);
        labelled(&mut statement, &found.beginning);
        statement.and(&format!(" THEN 1 ELSE 0 END), 0) AS word_{place}"), []);
    }
    statement.and(
        &format!(" {TABLES} WHERE sessions.tenant || '' = ? AND sessions.sequence IN ("),
        [tenant.as_str().into()],
    );
    for (name, order) in [("SELECT sequence FROM (", "DESC"), (" UNION ALL SELECT sequence FROM (", "ASC")] {
        let end = format!(
            "{name}SELECT sequence FROM sessions WHERE tenant = ? ORDER BY sequence {order} LIMIT ?) AS end_{order}"
        );
        statement.and(&end, [tenant.as_str().into(), SAMPLED.into()]);
    }
    statement.and(")", []);
    statement.query()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_is_for_beginnings_of_words_and_of_identifiers() {
        assert_eq!(beginnings("us-Equity gr"), ["equity", "us", "gr"]);
        assert_eq!(beginnings("session_0A1b"), ["0a1b"]);
        assert!(beginnings(" '%_").is_empty());
    }
}
