//! A statement over sessions as a list shows them, put together from parts.

use std::fmt;

use super::query::{Query, Value, query};

/// The tables of a list: a session, its labels, the policy that advises it, and the last entry that moved it.
pub(super) const TABLES: &str = "FROM sessions
    LEFT JOIN labels ON labels.tenant = sessions.tenant AND labels.object = sessions.session
    LEFT JOIN renewals ON renewals.session = sessions.session
         AND renewals.number = (SELECT max(number) FROM renewals AS made WHERE made.session = sessions.session)
    LEFT JOIN policies ON policies.policy = coalesce(renewals.policy, sessions.policy)
    LEFT JOIN labels AS called ON called.tenant = sessions.tenant
         AND called.object = coalesce(renewals.policy, sessions.policy)
    LEFT JOIN entries AS last ON last.session = sessions.session
         AND last.entry = (SELECT entry FROM entries AS made WHERE made.session = sessions.session
                           AND kind <> 'renewal' ORDER BY entry DESC LIMIT 1)";
/// The answer of the last entry, unless it is damaged so that it cannot be read.
pub(super) const ANSWER: &str = "CASE WHEN json_valid(last.answer_json) THEN last.answer_json END";
pub(super) const HORIZON: &str = "coalesce(renewals.horizon, sessions.horizon)";
/// Periods observed, as the last entry that moved the session says.
pub(super) const OBSERVATIONS: &str = "coalesce(CASE last.kind WHEN 'observation' THEN last.number
    ELSE CAST(json_extract(CASE WHEN json_valid(last.answer_json) THEN last.answer_json END, '$.observed') AS BIGINT) END, 0)";
/// Whether the next policy of a session is to be trained. Until it is there the session goes on, past its horizon too.
pub(super) const IS_WAITING: &str = "(sessions.due IS NOT NULL AND sessions.due <=
    coalesce(CASE last.kind WHEN 'observation' THEN last.number
    ELSE CAST(json_extract(CASE WHEN json_valid(last.answer_json) THEN last.answer_json END, '$.observed') AS BIGINT) END, 0))";

/// A statement under way: its text and its values.
pub(super) struct Statement {
    sql: String,
    values: Vec<Value>,
}

impl Statement {
    pub(super) fn of(sql: &str) -> Self {
        Statement { sql: sql.to_owned(), values: Vec::new() }
    }

    /// Adds a part whose `?` stand for the values, in their order.
    pub(super) fn and<const N: usize>(&mut self, part: &str, values: [Value; N]) {
        let mut values = values.into_iter();
        for (index, piece) in part.split('?').enumerate() {
            if index > 0 {
                self.values.extend(values.next());
                self.write(format_args!("${}", self.values.len()));
            }
            self.sql.push_str(piece);
        }
    }

    fn write(&mut self, text: fmt::Arguments<'_>) {
        self.sql += &text.to_string();
    }

    pub(super) fn query(self) -> Query {
        self.values.into_iter().fold(query(self.sql), Query::bind)
    }
}
