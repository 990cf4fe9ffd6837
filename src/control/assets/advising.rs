//! Turns a request about several assets into advice.

use super::advice::{AssetsAdvice, named, worst_means};
use super::{PortfolioStep, ReturnScenarios};
use crate::control::error::FieldError;
use crate::control::policy::caution::Caution;
use crate::control::policy::levels::{LevelsAdvised, WhyNothing};
use crate::control::policy::one_period::OnePeriod;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::annualised::premium;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::caution::{CautionLevel, CautionLevels};
use crate::control::request::fund::CompositionRule;
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::support::{LawExtent, Support};
use crate::control::uncertainty::joint::radius_factor;

/// Returns up to which the allocation at each level is also solved: a fraction of a second.
pub const SOLVED_BY_LEVEL: usize = 6000;

/// Returns the utility of the investor, relative to what the bank makes of their wealth.
pub fn utility(fund: &ProblemSpecification) -> RelativeUtility {
    RelativeUtility::new(fund.utility, fund.initial_wealth * (1.0 + fund.rate_per_step))
}

/// Builds the one-period step of `problem` from the returns `rows`, with a ball of this radius. `fund` is the completed
/// problem of the assets' fund.
pub fn step(problem: &AssetsProblem, fund: &ProblemSpecification, rows: &[Vec<f64>], radius: f64) -> PortfolioStep {
    step_above(floors(fund.support_rule(), rows), problem, fund, rows, radius)
}

/// Returns the log-return of each asset below which no move goes.
pub fn floors(support: Support, rows: &[Vec<f64>]) -> Vec<f64> {
    let of = |asset: usize| {
        let extent = || LawExtent::of(rows.iter().map(|row| row[asset]));
        support.around(extent).map_or(f64::NEG_INFINITY, |support| support.min)
    };
    (0..rows.first().map_or(0, Vec::len)).map(of).collect()
}

fn step_above(
    floors: Vec<f64>,
    problem: &AssetsProblem,
    fund: &ProblemSpecification,
    rows: &[Vec<f64>],
    radius: f64,
) -> PortfolioStep {
    let [lowest, highest] = fund.action_interval;
    PortfolioStep::new(
        ReturnScenarios { returns: rows, radius, floors },
        problem.ground_norm.at(rows, &problem.history),
        utility(fund),
        fund.rate_per_step,
        ActionInterval { lowest, highest },
    )
}

/// The ball around the law of several assets that holds for all of their funds at once.
#[derive(Debug, Clone, PartialEq)]
pub struct FundsBall {
    /// Factor on the radius of the fund of inverse volatilities.
    pub radius_factor: f64,
    /// In log-return, at the paper's caution.
    pub radius: f64,
    /// The shares of the radius at the levels of caution, if one of them is followed.
    pub levels: Option<Box<CautionLevels>>,
}

impl FundsBall {
    /// Returns the ball of `problem`, whose fund of inverse volatilities is `fund`. Cost: the joint factor under
    /// `bridge` and `calibrated`, and that of
    /// [`Specification::resolved`](crate::control::request::specification::Specification::resolved).
    ///
    /// # Errors
    /// The history of the fund breaks a rule, which a completed one does not.
    pub fn of(problem: &AssetsProblem, fund: &OnePeriod) -> Result<Self, FieldError> {
        let radius_factor = radius_factor(&problem.history, fund.problem().radius_rule(), fund.seed());
        let fund = fund.within(radius_factor).resolved();
        // A rule without levels has no share of its radius to act on.
        let whole = if fund.problem().takes_levels() { fund.at(CautionLevel::Paper) } else { fund };
        Ok(FundsBall { radius_factor, radius: whole.radius()?, levels: whole.problem().levels.clone() })
    }

    /// Returns the radius at a level, in log-return.
    pub fn radius_at(&self, level: CautionLevel) -> f64 {
        self.radius * level.share(self.levels.as_deref())
    }
}

impl AssetsAdvice {
    /// Returns the advice for `problem`, whose fund of inverse volatilities is `fund`, given these holdings as shares
    /// of wealth; and the reason if nothing is held. Cost: its levels of caution, if one is followed, and the joint
    /// factor under `bridge` and `calibrated`. Also [`PortfolioStep::solve_from`], twice if a return may fall below those
    /// seen, and once for each level of a short record.
    /// Checked by: `tests/service/advise.rs::several_assets_are_advised_by_name_as_solved_directly` and
    /// `the_crash_is_what_a_floor_at_the_lowest_return_takes_away`.
    ///
    /// # Errors
    /// The history of the fund breaks a rule, which a completed one does not.
    pub fn of(
        problem: &AssetsProblem,
        holdings: &[f64],
        fund: &OnePeriod,
    ) -> Result<(Self, Option<WhyNothing>), FieldError> {
        let (seen, names, cost) = (&problem.history, &problem.assets, problem.trading_cost);
        let rows = &problem.means.applied(seen);
        let ball = FundsBall::of(problem, fund)?;
        let fund = fund.problem();
        let radius = ball.radius_at(fund.caution_level().unwrap_or(CautionLevel::Paper));
        let bank = fund.initial_wealth * (1.0 + fund.rate_per_step);
        let compositions = problem.compositions(holdings);
        let within = |step: PortfolioStep| step.within(compositions.clone());
        let solution = within(step(problem, fund, rows, radius)).solve_from(holdings, cost, None);
        let total_of = |step: PortfolioStep| {
            within(step).solve_from(holdings, cost, Some(&solution)).allocation.iter().sum::<f64>()
        };
        let total_within = |radius: f64| total_of(step(problem, fund, rows, radius));
        let lowest = rows.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let crashes = floors(fund.support_rule(), rows).into_iter().any(|floor| floor < lowest);
        let seen_alone = || step_above(vec![lowest; names.len()], problem, fund, rows, radius);
        let is_short = rows.len() * names.len() <= SOLVED_BY_LEVEL;
        let level = |share: f64| is_short.then(|| total_within(share * ball.radius));
        let followed = fund.caution_level().zip(ball.levels.as_deref());
        let composition = CompositionRule::OneStep.composition(rows, || solution.clone());
        let composition = match &compositions {
            Some(compositions) => compositions.nearest(composition),
            None => composition,
        };
        let trade: Vec<f64> = solution.allocation.iter().zip(holdings).map(|(share, held)| share - held).collect();
        let advice = AssetsAdvice {
            allocation: named(names, &solution.allocation),
            trade: named(names, &trade),
            composition: named(names, &composition),
            total: solution.allocation.iter().sum(),
            without_crash: crashes.then(|| total_of(seen_alone())),
            certainty_equivalent: bank * solution.value.exp(),
            bound: bank * solution.bound.exp(),
            floor: bank * (1.0 - cost * holdings.iter().sum::<f64>()),
            radius,
            radius_factor: ball.radius_factor,
            sample_size: rows.len(),
            worst_means: worst_means(names, seen, rows, &solution),
            levels: followed.map(|(followed, found)| LevelsAdvised::of(found, followed, level)),
            caution: Caution::short_record(rows.len(), rows.len() as f64)
                .into_iter()
                .chain(solution.caution())
                .collect(),
        };
        let why_nothing = (advice.total <= 0.0).then(|| {
            let (premium_seen, standard_error) = premium(&fund.history, fund.rate_per_step);
            let at_half_the_caution = (fund.radius_rule().paths() > 0).then(|| total_within(0.5 * radius));
            WhyNothing { premium_seen, standard_error, premium_left: None, at_half_the_caution }
        });
        Ok((advice, why_nothing))
    }
}
