//! The handlers, one file for each resource. A handler translates and decides nothing.

pub(super) mod action;
pub(super) mod advise;
pub(super) mod audit;
pub(super) mod backtests;
pub(super) mod decide;
pub(super) mod evaluations;
pub(super) mod events;
pub(super) mod frontiers;
pub(super) mod futures;
pub(super) mod holder;
pub(super) mod jobs;
pub(super) mod labels;
pub(super) mod operations;
pub(super) mod overview;
pub(super) mod page;
pub(super) mod policies;
pub(super) mod reports;
pub(super) mod returns;
pub(super) mod sessions;
pub(super) mod what_if;
pub(super) mod wire;
