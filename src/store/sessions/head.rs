//! The head of a session, which shows if the session has changed.

/// How many entries a session has, and the seal of its last row.
///
/// Rows are only appended, and a seal covers the time its row was made. Equal heads therefore mean equal sessions, even
/// if the database was restored from a copy and then continued differently.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Number of entries.
    pub entries: usize,
    pub(in crate::store) seal: Vec<u8>,
}
