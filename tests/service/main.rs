//! The service over HTTP and its store, in this process and with the real binary.

#[macro_use]
extern crate ballast_test_support as support;

mod account;
mod advise;
mod asset_changes;
mod asset_periods;
mod audit;
mod backtest;
mod backup;
mod bad_input;
mod clocks;
mod damage;
mod decide;
mod declared_sessions;
mod doubts;
mod encryption;
mod files;
mod frontier;
mod fund_renewal;
mod funds;
mod futures;
mod keys;
mod labels;
mod lives;
mod no_stale_law;
mod overview;
mod quotas;
mod relocation;
mod renewal;
mod reports;
mod returns;
mod search;
mod sessions;
mod solve_turns;
mod store;
mod store_model;
mod surface;
mod traces;
mod turns;
mod what_if;
