//! Questions that record nothing: the advice of a session, advice without a session, and hypotheses.

pub mod action;
pub mod advise;
pub mod advise_assets;
pub mod explain;
pub mod returns;
pub mod what_if;
pub mod what_if_assets;
