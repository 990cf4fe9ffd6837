//! Work on a whole folder or database: backup, check, repair and relocation.

pub(super) mod backup;
pub(super) mod check;
pub(super) mod relocation;
pub(super) mod repair;
