//! The two engines, and what a statement is for both: its values and rows, its schema, its errors. Nothing here knows a
//! subject; the subjects beside it write the statements.

pub(super) mod codec;
pub(super) mod error;
pub(super) mod migrations;
pub(super) mod postgres;
pub(super) mod query;
pub(super) mod sqlite;
pub(super) mod statement;
