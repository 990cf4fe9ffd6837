//! How near an advice on several assets is to changing: were one date of its record left out, or seen again, the mean of one
//! asset another, the record longer.
//!
//! Each is the advice of another record for the same period and wealth, solved as the advice beside it is; the joint factor of all
//! funds, and that of a calibrated radius, are those of the record at hand.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::AssetsSolution;
use super::advice::AssetsAdvice;
use super::advising::step;
use crate::control::error::FieldError;
use crate::control::policy::caution::Caution;
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy::sensitivity::{LONGEST_RECORD, RESOLUTION, is_invested, is_other, parted, periods_more};
use crate::control::pool;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::learning::Learning;
use crate::control::request::rules::LOG_RETURN;
use crate::numerics::fund_bridges::fund_returns;
use crate::numerics::levelling::inverse_volatility;

/// Log-returns that all steps together may read: those of thirty years of months of twelve assets.
pub const MOST_READ: usize = 4_500_000;
/// Steps that halving takes for each asset, and for the length of the record.
const HALVINGS: [usize; 2] = [20, 16];

/// How near an advice on several assets is to changing.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsSensitivity {
    /// With one date of the record left out; null where no date may be: each asset must still vary over two dates.
    pub without_one: Option<OverDates>,
    /// With one date of the record seen once more.
    pub seen_again: OverDates,
    /// What each asset pays beyond the bank, and what it would have to, by its name.
    pub premium: BTreeMap<String, AssetPremium>,
    /// More dates, of the law of those seen, after which anything is held: the least number m at which the step with the radius
    /// times sqrt(n / (n + m)) holds something. 0 where something is held already; null where it is not within 10000 periods, or
    /// the radius rule is `fixed`.
    pub periods_more: Option<usize>,
    /// What it says against following the advice.
    #[serde(skip)]
    pub caution: Option<Caution>,
}

/// The range of an advice over the records that differ by one date.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct OverDates {
    /// Of the share of wealth in all assets together.
    pub total: Extremes,
    /// Of the share of wealth in each asset, by its name.
    pub allocation: BTreeMap<String, Extremes>,
}

/// The lowest and the highest of a share, each with the date that makes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Extremes {
    /// The lowest.
    pub lowest: ByDate,
    /// The highest.
    pub highest: ByDate,
}

/// A share of wealth, and the date of the record that makes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct ByDate {
    /// In the record, from 0.
    pub index: usize,
    /// The share of wealth.
    pub share: f64,
}

/// What an asset of the record pays beyond the bank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct AssetPremium {
    /// Mean log-return less `ln(1 + rate_per_step)`, a period.
    pub present: f64,
    /// The same where every return of this asset alone is shifted by the amount at which its share leaves 0, found by halving to
    /// 1e-6: above `present` where it is not held now, else below it. Null where no shift up to the distance between its lowest
    /// and its highest return does it.
    pub needed: Option<f64>,
}

/// An advice, and the ways to ask for what stands beside it.
struct Asked<'a> {
    problem: &'a AssetsProblem,
    solution: &'a AssetsSolution,
    /// The shares of wealth were the record another.
    of: &'a (dyn Fn(&[Vec<f64>]) -> Vec<f64> + Sync),
}

/// Checks that the sensitivity of an advice can be told at a bounded cost.
///
/// # Errors
/// Under the name `sensitivity`: too many dates, or too many returns to read.
pub fn check_cost(problem: &AssetsProblem) -> Result<(), FieldError> {
    let (dates, assets) = (problem.history.len(), problem.assets.len());
    let steps = 2 * dates + HALVINGS[0] * assets + HALVINGS[1];
    if dates > LONGEST_RECORD {
        let rule = format!("must be left out for a record of {dates} dates: it is told of at most {LONGEST_RECORD}");
        return Err(FieldError::new("sensitivity", true, rule));
    }
    let read = steps * dates * assets;
    if read > MOST_READ {
        let rule = format!("must be left out: it would read {read} log-returns, and {MOST_READ} are the most");
        return Err(FieldError::new("sensitivity", true, rule));
    }
    Ok(())
}

impl AssetsSensitivity {
    /// Of the advice that `solution` is, whose fund of inverse volatilities is `investor`'s. Cost: two steps for each date, some 20
    /// for each asset and 16 more, near the solution, on the rayon pool this is called from.
    ///
    /// Checked by: `tests/advise.rs::how_near_advice_on_several_assets_is_to_changing_is_that_of_other_records`.
    pub fn of(problem: &AssetsProblem, investor: &OnePeriod, advice: &AssetsAdvice, solution: &AssetsSolution) -> Self {
        let (fund, knowing) = (investor.problem(), investor.knowing_its_factor());
        let within =
            |rows: &[Vec<f64>], radius: f64| step(problem, fund, rows, radius).solve(Some(solution)).allocation;
        let of = |rows: &[Vec<f64>]| {
            let own = knowing.radius_of(&fund_returns(rows, &inverse_volatility(rows)));
            within(rows, advice.radius_factor * own)
        };
        let asked = Asked { problem, solution, of: &of };
        let rows = &problem.history;
        let without = |index: usize| [&rows[..index], &rows[index + 1..]].concat();
        let may_lack = |index: &usize| varies(&without(*index), problem.assets.len());
        let without_one = asked.over((0..rows.len()).filter(may_lack).collect(), &without);
        let again = |index: usize| [&rows[..], &rows[index..=index]].concat();
        let seen_again = asked.over((0..rows.len()).collect(), &again).unwrap_or_else(|| asked.as_it_is());
        let premium = pool::map((0..problem.assets.len()).collect(), |asset| asked.premium(asset));
        let size = |more: usize| (rows.len() + more) as f64;
        let total_within = |radius: f64| within(rows, radius).iter().sum::<f64>();
        let [lowest, highest] = problem.action_interval;
        let caution = without_one.as_ref().and_then(|found| {
            let Extremes { lowest: low, highest: high } = found.total;
            let other = [low, high].into_iter().find(|one| is_other(one.share, advice.total, highest - lowest))?;
            Some(Caution::one_date(other.index, other.share, advice.total))
        });
        AssetsSensitivity {
            without_one,
            seen_again,
            premium: problem.assets.iter().cloned().zip(premium).collect(),
            periods_more: periods_more(fund.radius_rule(), (advice.total, advice.radius), size, total_within),
            caution,
        }
    }
}

/// Whether the returns of all assets vary, over two dates at least.
fn varies(rows: &[Vec<f64>], assets: usize) -> bool {
    let column = |asset: usize| rows.iter().map(|row| row[asset]).collect::<Vec<f64>>();
    rows.len() > 1 && (0..assets).all(|asset| Learning::Equal {}.check_deviation("", &column(asset)).is_ok())
}

impl Asked<'_> {
    /// The range over the records that `record` makes of the dates.
    fn over(&self, dates: Vec<usize>, record: &(dyn Fn(usize) -> Vec<Vec<f64>> + Sync)) -> Option<OverDates> {
        let found = pool::map(dates, |index| (index, (self.of)(&record(index))));
        let extremes = |share: &dyn Fn(&[f64]) -> f64| {
            let all = || found.iter().map(move |(index, shares)| ByDate { index: *index, share: share(shares) });
            let lowest = all().reduce(|one, other| if other.share < one.share { other } else { one })?;
            let highest = all().reduce(|one, other| if other.share > one.share { other } else { one })?;
            Some(Extremes { lowest, highest })
        };
        let of_asset =
            |(asset, name): (usize, &String)| Some((name.clone(), extremes(&|shares: &[f64]| shares[asset])?));
        Some(OverDates {
            total: extremes(&|shares: &[f64]| shares.iter().sum::<f64>())?,
            allocation: self.problem.assets.iter().enumerate().map(of_asset).collect::<Option<_>>()?,
        })
    }

    fn as_it_is(&self) -> OverDates {
        let same = |share: f64| {
            let at = ByDate { index: 0, share };
            Extremes { lowest: at, highest: at }
        };
        let shares = &self.solution.allocation;
        let named = self.problem.assets.iter().cloned().zip(shares.iter().map(|share| same(*share)));
        OverDates { total: same(shares.iter().sum()), allocation: named.collect() }
    }

    fn premium(&self, asset: usize) -> AssetPremium {
        let column = || self.problem.history.iter().map(move |row| row[asset]);
        let (lowest, highest) = (column().fold(f64::INFINITY, f64::min), column().fold(f64::NEG_INFINITY, f64::max));
        let mean = column().sum::<f64>() / self.problem.history.len() as f64;
        let present = mean - self.problem.rate_per_step.ln_1p();
        let is_held = |shift: f64| {
            let mut rows = self.problem.history.clone();
            rows.iter_mut().for_each(|row| row[asset] += shift);
            is_invested((self.of)(&rows)[asset])
        };
        let least = self.problem.support.map_or(-LOG_RETURN, |support| support.min);
        let far = match is_invested(self.solution.allocation[asset]) {
            true => (lowest - highest).max(least - lowest),
            false => (highest - lowest).min(LOG_RETURN - highest),
        };
        let ends = [far.min(0.0), far.max(0.0)];
        let parts = far.abs() > RESOLUTION && is_held(ends[1]) && !is_held(ends[0]);
        AssetPremium { present, needed: parts.then(|| present + parted(ends, &is_held)[1]) }
    }
}
