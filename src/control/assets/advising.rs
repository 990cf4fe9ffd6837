//! From a question about several assets to the advice.

use super::advice::{AssetsAdvice, named, worst_means};
use super::{AssetsLaw, AssetsStep};
use crate::control::policy::caution::Caution;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::fund::CompositionRule;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::fund_bridges::FundBridges;

/// Paths of the joint factor: its standard error is then a hundredth of it.
const FACTOR_PATHS: usize = 1000;

/// Of the radius of all funds at once over that of one; 1 where there is one, and under rules that look at the sample size alone.
pub fn radius_factor(problem: &AssetsProblem, fund: &ProblemSpecification, seed: u64) -> f64 {
    match fund.radius_rule() {
        RadiusRule::Bridge { alpha, .. } | RadiusRule::Calibrated { alpha, .. } if problem.assets.len() > 1 => {
            FundBridges::simulate(&problem.history, FACTOR_PATHS, seed).joint_factor(alpha).value
        }
        _ => 1.0,
    }
}

/// The utility of the investor, relative to what the bank makes of his wealth.
pub fn utility(fund: &ProblemSpecification) -> RelativeUtility {
    RelativeUtility::new(fund.utility, fund.initial_wealth * (1.0 + fund.rate_per_step))
}

/// The step of `problem`, whose fund has the completed problem `fund`, had `rows` been seen, in a ball of this radius.
pub fn step(problem: &AssetsProblem, fund: &ProblemSpecification, rows: &[Vec<f64>], radius: f64) -> AssetsStep {
    step_above(floor(problem), problem, fund, rows, radius)
}

/// What no log-return is moved below.
fn floor(problem: &AssetsProblem) -> f64 {
    problem.support.map_or(f64::NEG_INFINITY, |support| support.min)
}

fn step_above(
    floor: f64,
    problem: &AssetsProblem,
    fund: &ProblemSpecification,
    rows: &[Vec<f64>],
    radius: f64,
) -> AssetsStep {
    let [lowest, highest] = fund.action_interval;
    AssetsStep::new(
        AssetsLaw { returns: rows, radius, floor },
        problem.ground_norm.at(rows),
        utility(fund),
        fund.rate_per_step,
        ActionInterval { lowest, highest },
    )
}

impl AssetsAdvice {
    /// The step of `problem`, whose fund of inverse volatilities has the completed problem `fund` and the radius `of_fund`, with the
    /// seed of its simulations.
    /// Cost: that of [`AssetsStep::solve`], twice where a return may fall below those seen, and of the joint factor under `bridge`
    /// and `calibrated`.
    /// Checked by: `tests/service/advise.rs::several_assets_are_advised_by_name_as_solved_directly` and
    /// `the_crash_is_what_a_floor_at_the_lowest_return_takes_away`.
    pub fn of(problem: &AssetsProblem, fund: &ProblemSpecification, of_fund: f64, seed: u64) -> Self {
        let rows = &problem.history;
        let radius_factor = radius_factor(problem, fund, seed);
        let radius = radius_factor * of_fund;
        let bank = fund.initial_wealth * (1.0 + fund.rate_per_step);
        let solution = step(problem, fund, rows, radius).solve(None);
        let lowest = rows.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let without_crash = (floor(problem) < lowest)
            .then(|| step_above(lowest, problem, fund, rows, radius).solve(Some(&solution)).allocation.iter().sum());
        let composition = CompositionRule::OneStep.composition(rows, || solution.clone());
        AssetsAdvice {
            allocation: named(&problem.assets, &solution.allocation),
            composition: named(&problem.assets, &composition),
            total: solution.allocation.iter().sum(),
            without_crash,
            certainty_equivalent: bank * solution.value.exp(),
            bound: bank * solution.bound.exp(),
            floor: bank,
            radius,
            radius_factor,
            sample_size: rows.len(),
            worst_means: worst_means(&problem.assets, rows, &solution),
            caution: Caution::short_record(rows.len(), rows.len() as f64)
                .into_iter()
                .chain(solution.caution())
                .collect(),
        }
    }
}
