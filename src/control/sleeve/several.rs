//! The shares of several strategies.

use super::report::{GrowthInBothLaws, Refutation, SleeveGrowth, SleeveReport, StrategyShare};
use super::{PARTS_OF_KELLY, SLACK, fraction, growth, kelly, words};
use crate::control::assets::advice::{AssetsAdvice, WorstMean};
use crate::control::assets::advising::{SOLVED_BY_LEVEL, step};
use crate::control::error::FieldError;
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy::sensitivity::{MOST_PERIODS, least_count, parted};
use crate::control::request::assets::AssetsProblem;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::sleeve::RecordUnit;
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::support::Interval;

/// Largest shift of log-returns that is tried.
const FURTHEST: f64 = 1.0;

impl SleeveReport {
    /// Returns the answer for several strategies, whose fund of inverse volatilities is `fund`. Cost: as
    /// [`AssetsAdvice::of`], the search for the Kelly shares, and for a short record some fifty robust steps.
    /// Checked by: `tests/solver/sleeve.rs`.
    ///
    /// # Errors
    /// As [`AssetsAdvice::of`].
    pub fn of_several(problem: &AssetsProblem, fund: &OnePeriod, unit: RecordUnit) -> Result<Self, FieldError> {
        let (advice, _) = AssetsAdvice::of(problem, &vec![0.0; problem.assets.len()], fund)?;
        let (rate, dates) = (problem.rate_per_step, problem.history.len());
        let masses = vec![1.0 / dates as f64; dates];
        let column = |asset: usize| problem.history.iter().map(|row| row[asset].exp_m1() - rate).collect();
        let excess: Vec<Vec<f64>> = (0..problem.assets.len()).map(column).collect();
        let shares: Vec<f64> = problem.assets.iter().map(|name| advice.allocation[name]).collect();
        let kelly_shares = kelly(&excess, &masses, 1.0 + rate);
        let total = kelly_shares.as_ref().map(|shares| shares.iter().sum::<f64>());
        let of = |shares: &[f64]| growth(shares, &excess, &masses, 1.0 + rate);
        let worst = Some(advice.certainty_equivalent / problem.initial_wealth - 1.0);
        let growth = SleeveGrowth {
            bank: rate,
            share: GrowthInBothLaws { record: of(&shares), worst },
            kelly: kelly_shares.as_ref().map(|shares| GrowthInBothLaws { record: of(shares), worst: None }),
        };
        let strategy = |(at, name): (usize, &String)| {
            let kelly = kelly_shares.as_ref().map(|shares| shares[at]);
            let WorstMean { seen, believed, worst } = advice.worst_means[name];
            let mean = WorstMean { seen, believed, worst };
            (name.clone(), StrategyShare { share: shares[at], kelly, mean })
        };
        let is_short = dates * problem.assets.len() <= SOLVED_BY_LEVEL;
        let mut report = SleeveReport {
            sentences: Vec::new(),
            share: advice.total,
            kelly: total,
            fraction: fraction(advice.total, total),
            strategies: Some(problem.assets.iter().enumerate().map(strategy).collect()),
            growth,
            growth_a_year: problem.periods_per_year.map(|periods| growth.compounded(periods)),
            record: None,
            worst: None,
            refutation: is_short.then(|| refutation(problem, fund, &advice, total)),
            worst_case: None,
            radius: advice.radius,
            sample_size: advice.sample_size,
            warnings: fund.problem().warnings(),
            caution: advice.caution,
        };
        let [_, highest] = problem.action_interval;
        report.sentences = words::sentences(&report, unit, problem.periods_per_year, highest);
        Ok(report)
    }
}

fn refutation(problem: &AssetsProblem, fund: &OnePeriod, advice: &AssetsAdvice, kelly: Option<f64>) -> Refutation {
    let (fund, rows) = (fund.problem(), problem.means.applied(&problem.history));
    let compositions = problem.compositions(&vec![0.0; problem.assets.len()]);
    let total_of = |rows: &[Vec<f64>], radius: f64| {
        let step = step(problem, fund, rows, radius).within(compositions.clone());
        step.solve(None).allocation.iter().sum::<f64>()
    };
    let periods_until = |share: f64| {
        let size = advice.sample_size as f64;
        let radius = |more: usize| advice.radius * (size / (size + more as f64)).sqrt();
        match fund.radius_rule() {
            _ if advice.total > share => Some(0),
            RadiusRule::Fixed { .. } => None,
            _ => least_count(MOST_PERIODS, |more| total_of(&rows, radius(more)) > share),
        }
    };
    let [half, three_quarters] = PARTS_OF_KELLY.map(|part| match kelly {
        Some(kelly) if kelly > 0.0 => periods_until(part * kelly - SLACK),
        _ => None,
    });
    let is_given = |shift: f64| {
        let shifted: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|z| z + shift).collect()).collect();
        total_of(&shifted, advice.radius) > SLACK
    };
    let [down, up] = room(fund, &rows);
    let shift = match advice.total > SLACK {
        true => (!is_given(down)).then_some([down, 0.0]),
        false => is_given(up).then_some([0.0, up]),
    };
    Refutation {
        break_even_mean: None,
        break_even_shift: shift.map(|ends| parted(ends, is_given)[1].exp_m1()),
        until_any: periods_until(SLACK),
        until_half_kelly: half,
        until_three_quarters_kelly: three_quarters,
        losses_in_a_row: None,
        mean_loss: None,
    }
}

/// Returns the furthest shifts down and up that keep all log-returns in the support.
fn room(fund: &ProblemSpecification, rows: &[Vec<f64>]) -> [f64; 2] {
    let Some(Interval { min, max }) = fund.support_rule().given() else { return [-FURTHEST, FURTHEST] };
    let seen = || rows.iter().flatten().copied();
    [(min - seen().fold(max, f64::min)).max(-FURTHEST), (max - seen().fold(min, f64::max)).min(FURTHEST)]
}
