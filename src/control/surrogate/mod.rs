//! The regression behind the value and the action (paper, section 3.1): features of a state, the design, the fits.

pub mod accuracy;
pub mod counts;
pub mod design;
pub mod features;
pub mod fitting;
pub mod learning;
pub mod policy_target;
pub mod scaling;
pub mod stored;
pub mod target;
pub mod value_surrogate;
