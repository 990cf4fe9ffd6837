//! How much of the capital the record of a strategy supports. The Kelly share takes the record as the truth; the robust
//! step of one period under log utility doubts it, and answers with a part of that share.

mod kelly;
pub mod report;
mod several;
mod words;

pub use self::kelly::{growth, kelly};
use self::report::{GrowthInBothLaws, Refutation, ReturnMoments, SleeveGrowth, SleeveReport};
use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy::sensitivity::{cautions, least_count};
use crate::control::policy::worst_case::WorstCase;
use crate::control::request::annualised::compounded;
use crate::control::request::sleeve::RecordUnit;

/// Parts of the Kelly share that more returns may support.
const PARTS_OF_KELLY: [f64; 2] = [0.5, 0.75];
/// Slack of a part of the Kelly share: ten times the tolerance of the search for the share.
const SLACK: f64 = 1e-6;
/// Most losses in a row that are tried.
const MOST_LOSSES: usize = 60;

impl SleeveReport {
    /// Returns the answer for the investor of one strategy, whose utility is logarithmic. Cost: the levels of caution if one is
    /// followed, and some eighty robust steps.
    /// Checked by: `tests/solver/sleeve.rs`.
    ///
    /// # Errors
    /// As [`OnePeriod::advise`].
    pub fn of(investor: &OnePeriod, unit: RecordUnit) -> Result<Self, FieldError> {
        let (advice, worst_case) = investor.advise(0.0)?;
        let (problem, law) = (investor.problem(), investor.law()?);
        let bank = 1.0 + problem.rate_per_step;
        let masses: Vec<f64> = law.weights().iter().map(|weight| weight / law.total_weight()).collect();
        let simple = |log_returns: &[f64]| -> Vec<f64> { log_returns.iter().map(|z| z.exp_m1()).collect() };
        let excess = |simple: &[f64]| vec![simple.iter().map(|x| x - problem.rate_per_step).collect::<Vec<f64>>()];
        let seen = simple(law.atoms());
        let kelly_share = kelly(&excess(&seen), &masses, bank).map(|shares| shares[0]);
        let (moved, moved_masses) = moved(&worst_case);
        let moved = simple(&moved);
        let is_given = advice.allocation > 0.0 && !worst_case.transport.is_empty();
        let of = |share: f64| GrowthInBothLaws {
            record: growth(&[share], &excess(&seen), &masses, bank),
            worst: is_given.then(|| growth(&[share], &excess(&moved), &moved_masses, bank)),
        };
        // The value of the step is the growth of its own share.
        let own = advice.certainty_equivalent / problem.initial_wealth - 1.0;
        let growth = SleeveGrowth {
            bank: problem.rate_per_step,
            share: GrowthInBothLaws { worst: Some(own), ..of(advice.allocation) },
            kelly: kelly_share.map(of),
        };
        let mut report = SleeveReport {
            sentences: Vec::new(),
            share: advice.allocation,
            kelly: kelly_share,
            fraction: fraction(advice.allocation, kelly_share),
            strategies: None,
            growth,
            growth_a_year: problem.periods_per_year.map(|periods| growth.compounded(periods)),
            record: Some(ReturnMoments::of(&seen, &masses)),
            worst: is_given.then(|| ReturnMoments::of(&moved, &moved_masses)),
            refutation: Some(refutation(investor, &advice, kelly_share)?),
            radius: advice.radius,
            sample_size: advice.sample_size,
            caution: cautions(&advice, None),
            warnings: problem.warnings(),
            worst_case: Some(worst_case),
        };
        let [_, highest] = problem.action_interval;
        report.sentences = words::sentences(&report, unit, problem.periods_per_year, highest);
        Ok(report)
    }
}

/// Returns the part of the Kelly share.
fn fraction(share: f64, kelly: Option<f64>) -> Option<f64> {
    kelly.filter(|kelly| *kelly > 0.0).map(|kelly| share / kelly)
}

/// Returns the log-returns of a worst law, and their masses.
fn moved(worst_case: &WorstCase) -> (Vec<f64>, Vec<f64>) {
    worst_case.transport.iter().map(|mass| (mass.moved_to, mass.mass)).unzip()
}

fn refutation(investor: &OnePeriod, advice: &Advice, kelly: Option<f64>) -> Result<Refutation, FieldError> {
    let (problem, premium) = (investor.problem(), investor.premium(advice)?);
    let until = |part: f64| match kelly {
        Some(kelly) if kelly > 0.0 => investor.periods_until(advice, part * kelly - SLACK),
        _ => Ok(None),
    };
    let [half, three_quarters] = PARTS_OF_KELLY.map(until);
    let factor = |needed: f64| (1.0 + problem.rate_per_step + needed) / (1.0 + problem.rate_per_step + premium.present);
    let losses: Vec<f64> = problem.history.iter().copied().filter(|z| *z < 0.0).collect();
    let mean_loss = losses.iter().map(|z| z.exp_m1()).sum::<f64>() / losses.len() as f64;
    let in_a_row = match advice.allocation > 0.0 && !losses.is_empty() {
        true => {
            let is_zero = |count: usize| investor.after(mean_loss.ln_1p(), count).is_ok_and(|share| share <= SLACK);
            least_count(MOST_LOSSES, is_zero)
        }
        false => None,
    };
    Ok(Refutation {
        break_even_mean: premium.needed.map(|needed| needed + problem.rate_per_step),
        break_even_shift: premium.needed.map(|needed| factor(needed) - 1.0),
        until_any: premium.periods_more,
        until_half_kelly: half?,
        until_three_quarters_kelly: three_quarters?,
        losses_in_a_row: in_a_row,
        mean_loss: in_a_row.map(|_| mean_loss),
    })
}

impl ReturnMoments {
    fn of(returns: &[f64], masses: &[f64]) -> Self {
        let expectation =
            |of: &dyn Fn(f64) -> f64| returns.iter().zip(masses).map(|(x, mass)| mass * of(*x)).sum::<f64>();
        let mean = expectation(&|x| x);
        ReturnMoments { mean, standard_deviation: expectation(&|x| (x - mean).powi(2)).sqrt() }
    }
}

impl SleeveGrowth {
    /// Returns the growth over so many periods.
    fn compounded(&self, periods: f64) -> Self {
        let of = |growth: f64| compounded(growth, periods);
        let both =
            |growth: GrowthInBothLaws| GrowthInBothLaws { record: of(growth.record), worst: growth.worst.map(of) };
        SleeveGrowth { bank: of(self.bank), share: both(self.share), kelly: self.kelly.map(both) }
    }
}
