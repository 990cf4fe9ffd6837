//! A statement over sessions as a list shows them, composed of parts.

use std::fmt;

use crate::store::engine::query::{Query, Value, query};

/// The tables of a list: a session, its labels, the policy that advises it, and the last entry that changed it.
pub(in crate::store) const TABLES: &str = "FROM sessions
    LEFT JOIN labels ON labels.tenant = sessions.tenant AND labels.object = sessions.session
    LEFT JOIN renewals ON renewals.session = sessions.session
         AND renewals.number = (SELECT max(number) FROM renewals AS made WHERE made.session = sessions.session)
    LEFT JOIN policies ON policies.policy = coalesce(renewals.policy, sessions.policy)
    LEFT JOIN labels AS called ON called.tenant = sessions.tenant
         AND called.object = coalesce(renewals.policy, sessions.policy)
    LEFT JOIN entries AS last ON last.session = sessions.session
         AND last.entry = (SELECT entry FROM entries AS made WHERE made.session = sessions.session
                           AND kind <> 'renewal' ORDER BY entry DESC LIMIT 1)";
/// The answer column of an entry, prefixed with the table `$of`; NULL if it is not valid JSON.
macro_rules! answer {
    ($of:literal) => {
        concat!("CASE WHEN json_valid(", $of, "answer_json) THEN ", $of, "answer_json END")
    };
}
/// The number of periods observed, according to that entry.
macro_rules! observations {
    ($of:literal) => {
        concat!(
            "coalesce(CASE ",
            $of,
            "kind WHEN 'observation' THEN ",
            $of,
            "number ELSE CAST(json_extract(",
            answer!($of),
            ", '$.observed') AS BIGINT) END, 0)"
        )
    };
}

pub(in crate::store) const ANSWER: &str = answer!("last.");
pub(in crate::store) const HORIZON: &str = "coalesce(renewals.horizon, sessions.horizon)";
pub(in crate::store) const OBSERVATIONS: &str = observations!("last.");
/// True if the next policy of a session is to be trained. Until it exists the session continues, even past its horizon.
pub(in crate::store) const IS_WAITING: &str =
    concat!("(sessions.due IS NOT NULL AND sessions.due <= ", observations!("last."), ")");
/// The current wealth of a session; 0 of a declared problem, which has none.
pub(in crate::store) const WEALTH: &str = concat!(
    "coalesce(CAST(json_extract(",
    answer!("last."),
    ", '$.wealth') AS DOUBLE PRECISION), sessions.initial_wealth, 0.0)"
);
/// Selects sessions that are due for renewal, after the sequence $1, at most $2.
pub(in crate::store) const DUE: &str = concat!(
    "SELECT sequence, tenant, session FROM sessions WHERE due IS NOT NULL AND sequence > $1
     AND due <= (SELECT ",
    observations!(""),
    " FROM entries WHERE entries.session = sessions.session AND kind <> 'renewal' ORDER BY entry DESC LIMIT 1)
     ORDER BY sequence LIMIT $2"
);

/// A statement being composed: its text and its values.
pub(in crate::store) struct Statement {
    sql: String,
    values: Vec<Value>,
}

impl Statement {
    pub(in crate::store) fn of(sql: &str) -> Self {
        Statement { sql: sql.to_owned(), values: Vec::new() }
    }

    /// Adds a part in which each `?` stands for the next value.
    pub(in crate::store) fn and(&mut self, part: &str, values: impl IntoIterator<Item = Value>) {
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

    pub(in crate::store) fn query(self) -> Query {
        self.values.into_iter().fold(query(self.sql), Query::bind)
    }
}
