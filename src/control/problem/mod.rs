//! The controlled problem (paper, section 2 and the head of section 3): state, dynamics, actions, utility, return laws.

pub mod actions;
pub mod controlled;
pub mod declared;
pub mod dynamics;
pub mod holdings;
pub mod investor;
pub mod sampling_law;
pub mod state;
pub mod utility;
