//! The entries of a session: reports, corrections and renewals, how each is decided, recorded, replayed and shown.
//! Nothing here answers a question that records nothing; those live in [`crate::service::advice`].

pub mod account;
pub(super) mod acknowledged;
pub(super) mod advice_events;
pub mod answer;
pub(super) mod answering;
pub(super) mod assets_report;
pub mod change;
pub(super) mod corrections;
pub(super) mod days;
pub mod declared_history;
pub mod doubts;
pub mod drift;
pub mod history;
pub mod moving;
pub mod notes;
pub mod periods;
pub(super) mod record;
pub(super) mod recording;
pub(super) mod renewal;
pub mod report;
pub mod reports;
pub mod session_document;
