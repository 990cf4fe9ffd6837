//! The head of a session: what tells whether it is still what it was.

/// How many entries a session has, and the seal of its last row.
///
/// Rows are only appended, and a seal covers the time its row was made: equal heads mean equal sessions, even where the
/// database was restored from a copy and went on differently.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Number of entries.
    pub entries: usize,
    pub(super) seal: Vec<u8>,
}
