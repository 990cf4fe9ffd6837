//! A trained policy: the document, and how it answers.

pub mod advice;
pub mod advisor;
pub mod caution;
pub mod declared;
mod document;
pub mod futures;
pub mod levels;
pub mod one_period;
pub mod prepared_step;
pub mod sensitivity;
pub mod surface;
pub mod surface_states;
pub mod walk;
pub mod what_if;
pub mod worst_case;

pub use document::{Policy, content_hash, periods_per_year};
