//! Questions that record nothing: the advice of a session, advice without a session, hypotheses, and the surface of a
//! policy.

pub mod action;
pub mod advise;
pub mod advise_assets;
pub mod decide;
pub mod explain;
pub mod futures;
pub(super) mod hypotheses;
pub mod orders;
pub mod plan;
pub mod policy_map;
pub mod returns;
pub mod sleeve;
pub mod surface;
pub mod sweep;
pub mod what_if;
pub mod what_if_assets;
pub mod what_if_problem;
