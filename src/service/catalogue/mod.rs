//! The things that a tenant owns: policies, labels, the overview of sessions, and the calendar of their reports.

pub mod calendar;
pub mod labels;
pub mod overview;
pub mod policies;
