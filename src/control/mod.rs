//! Floor 1: the paper.

pub mod bellman;
pub mod error;
pub mod estimate;
pub mod evaluation;
pub mod kept;
pub mod policy;
pub mod pool;
pub mod problem;
pub mod progress;
pub mod request;
pub mod solved_step;
pub mod surrogate;
pub mod training;
pub mod uncertainty;

pub use evaluation::{paths as evaluate, report as evaluation_report};
pub use policy::{what_if, worst_case};
pub use problem::{state, utility};
pub use request::{framework, rules, specification};

pub mod advisor {
    pub use super::policy::advice::{Advice, AdviceSource, Uncertainty};
    pub use super::policy::advisor::{AdviceMode, Advisor};
}

pub mod backward {
    pub use super::progress::{Phase, StepProgress, Watch};
    pub use super::solved_step::StepSolution;
    pub use super::training::Training;
}
