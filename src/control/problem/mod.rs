//! The controlled problem (paper, section 2 and the head of section 3): state, dynamics, actions, utility, return laws.

pub mod actions;
pub mod compositions;
pub mod controlled;
pub mod declared;
pub mod drawdown;
pub mod dynamics;
pub mod goal;
pub mod holdings;
pub mod investor;
pub mod own_formula;
pub mod sampling_law;
pub mod spending;
pub mod state;
pub mod utility;
