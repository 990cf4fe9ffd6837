//! Floor 1: the paper, a file a section.

pub mod account;
pub mod advisor;
pub mod backward;
pub mod bellman;
pub mod comparison;
pub mod context;
pub mod design;
pub mod error;
pub mod evaluate;
pub mod evaluation;
pub mod evaluation_report;
pub mod features;
pub mod fitting;
pub mod gain_field;
pub mod limits;
pub mod parametric;
pub mod policy;
pub mod pool;
pub mod specification;
pub mod state;
pub mod surrogate;
pub mod uncertainty;
pub mod utility;
pub mod walk_forward;
pub mod what_if;
pub mod worst_case;
