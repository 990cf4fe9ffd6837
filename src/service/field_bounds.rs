//! The bounds of the fields of requests about sessions and of advice without one. Their checkers use the same constants.

use super::sessions::opening::SessionStart;
use crate::control::request::assets::{MOST_ASSETS, NAME_LENGTH};
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::radius_rules::{FIXED_RADIUS, RADIUS_SCALE};
use crate::control::request::rules::{HISTORY_LENGTH, HORIZON, LOG_RETURNS, RATE, SHARES, SIMPLE_RETURNS, WEALTH};
use crate::returns::MOST_BYTES;
use crate::service::advice::advise::Advise;
use crate::service::advice::advise_assets::AdviseAssets;
use crate::service::advice::decide::Decide;
use crate::service::advice::orders::{AMOUNT, COST, LOT, OrdersQuestion};
use crate::service::advice::policy_map::{InputRange, MOST_RANGES, VALUES};
use crate::service::advice::returns::ReadReturns;
use crate::service::advice::sweep::{POINTS, SweepRange};
use crate::service::advice::what_if::WhatIf;
use crate::service::entries::report::{
    Correct, END_PRICE, LONGEST_REASON, MOST_CORRECTIONS, Observe, PRICE, REPORTED_RETURN, Report,
};
use crate::service::entries::reports::REPORTS;
use crate::service::sessions::asset_change::LENGTH;
use crate::service::sessions::plan::{MOST_RENEWALS, Renew, Renewing};

/// The bounds of a list of reports.
pub const LISTED_REPORTS: ValueBounds = ValueBounds::list(&REPORTS, &ValueBounds::Any);
const WEALTHS: ValueBounds = ValueBounds::number(WEALTH);
const PRICES: ValueBounds = ValueBounds::number(PRICE);
const END_PRICES: ValueBounds = ValueBounds::number(END_PRICE);
const REPORTED_RETURNS: ValueBounds = ValueBounds::number(REPORTED_RETURN);
const FROM_ONE: ValueBounds = ValueBounds::CountFrom(1);
/// The bounds of a name that may not be empty.
const GIVEN: ValueBounds = ValueBounds::Text(1, usize::MAX);

impl Bounded for SessionStart {
    const BOUNDS: &'static [FieldBounds] =
        &[("policy", GIVEN), ("holdings", ValueBounds::ByAsset(&SHARES)), ("wealth", WEALTHS), ("holding", SHARES)];
}

impl Bounded for Report {
    const BOUNDS: &'static [FieldBounds] = &[
        ("log_return", LOG_RETURNS),
        ("simple_return", REPORTED_RETURNS),
        ("price", END_PRICES),
        ("previous_price", PRICES),
        ("rate", ValueBounds::number(RATE)),
        ("flow", ValueBounds::Number(-WEALTH.1, WEALTH.1)),
        ("spent", ValueBounds::Number(0.0, WEALTH.1)),
        ("log_returns", ValueBounds::ByAsset(&LOG_RETURNS)),
        ("simple_returns", ValueBounds::ByAsset(&REPORTED_RETURNS)),
        ("prices", ValueBounds::ByAsset(&END_PRICES)),
        ("previous_prices", ValueBounds::ByAsset(&PRICES)),
        ("executed_allocation", SHARES),
        ("executed_allocations", ValueBounds::ByAsset(&SHARES)),
        ("wealth", WEALTHS),
    ];
}

/// Besides those of [`Report`].
impl Bounded for Observe {
    const BOUNDS: &'static [FieldBounds] = &[("session", GIVEN), ("period", FROM_ONE)];
}

/// Besides those of [`Report`].
impl Bounded for Correct {
    const BOUNDS: &'static [FieldBounds] = &[
        ("correction", ValueBounds::Count(1, MOST_CORRECTIONS)),
        ("period", FROM_ONE),
        ("reason", ValueBounds::Text(1, LONGEST_REASON)),
    ];
}

impl Bounded for Renew {
    const BOUNDS: &'static [FieldBounds] = &[
        ("renewal", ValueBounds::Count(1, MOST_RENEWALS)),
        ("policy", GIVEN),
        ("window", ValueBounds::count(&HISTORY_LENGTH)),
        ("records", ValueBounds::ByAsset(&ValueBounds::list(&LENGTH, &LOG_RETURNS))),
        ("leaving", ValueBounds::List(0, MOST_ASSETS, &ValueBounds::text(&NAME_LENGTH))),
    ];
}

impl Bounded for Renewing {
    const BOUNDS: &'static [FieldBounds] = &[("every", FROM_ONE), ("window", ValueBounds::count(&HISTORY_LENGTH))];
}

impl Bounded for WhatIf {
    const BOUNDS: &'static [FieldBounds] = &[
        ("session", GIVEN),
        ("wealth", WEALTHS),
        ("holding", SHARES),
        ("radius_scale", ValueBounds::number(RADIUS_SCALE)),
        ("radius", ValueBounds::number(FIXED_RADIUS)),
        ("log_return", LOG_RETURNS),
        ("simple_return", SIMPLE_RETURNS),
        ("holdings", ValueBounds::ByAsset(&SHARES)),
        ("log_returns", ValueBounds::ByAsset(&LOG_RETURNS)),
        ("simple_returns", ValueBounds::ByAsset(&REPORTED_RETURNS)),
        ("prices", ValueBounds::ByAsset(&END_PRICES)),
        ("previous_prices", ValueBounds::ByAsset(&PRICES)),
    ];
}

impl Bounded for OrdersQuestion {
    const BOUNDS: &'static [FieldBounds] = &[
        ("session", GIVEN),
        ("prices", ValueBounds::ByAsset(&PRICES)),
        ("units", ValueBounds::ByAsset(&ValueBounds::number(AMOUNT))),
        ("cash", ValueBounds::number(AMOUNT)),
        ("lots", ValueBounds::ByAsset(&ValueBounds::number(LOT))),
        ("smallest", ValueBounds::number(AMOUNT)),
        ("trading_cost", ValueBounds::number(COST)),
    ];
}

impl Bounded for SweepRange {
    const BOUNDS: &'static [FieldBounds] = &[("points", ValueBounds::count(&POINTS))];
}

impl Bounded for Advise {
    const BOUNDS: &'static [FieldBounds] = &[("wealth", WEALTHS), ("holding", SHARES)];
}

impl Bounded for AdviseAssets {
    const BOUNDS: &'static [FieldBounds] = &[("wealth", WEALTHS), ("holdings", ValueBounds::ByAsset(&SHARES))];
}

impl Bounded for Decide {
    const BOUNDS: &'static [FieldBounds] = &[
        ("policy", GIVEN),
        ("period", ValueBounds::count(&HORIZON)),
        ("noises", ValueBounds::List(0, *HORIZON.end() - 1, &ValueBounds::Any)),
        ("across", ValueBounds::List(0, MOST_RANGES, &ValueBounds::Any)),
    ];
}

impl Bounded for InputRange {
    const BOUNDS: &'static [FieldBounds] = &[("points", ValueBounds::count(&VALUES))];
}

impl Bounded for ReadReturns {
    const BOUNDS: &'static [FieldBounds] = &[("text", ValueBounds::Text(0, MOST_BYTES))];
}
