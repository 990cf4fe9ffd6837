//! The shares of strategies of a user's own, in a walk-forward and on simulated paths.

use crate::control::error::FieldError;
use crate::control::evaluation::account::{PathOutcome, shares_ended};
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::own_formula::{OwnFormula, ReturnSums};
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::own_weights::{OwnAssetsWeights, OwnShares, OwnWeights, field};
use crate::control::request::specification::ProblemSpecification;

/// A strategy of several assets by its name, with their shares date by date.
pub type NamedShares = (String, Vec<Vec<f64>>);

/// Returns each strategy of one asset with its shares in the periods from `first` on, given the log-returns and what the
/// bank paid in all.
///
/// # Errors
/// A formula without a value in one of them, or with percent in place of shares.
pub fn shares_of_one(
    weights: &OwnWeights,
    log_returns: &[f64],
    bank: impl Fn(usize) -> f64,
    first: usize,
) -> Result<Vec<(String, Vec<f64>)>, FieldError> {
    let sums = ReturnSums::of(log_returns.iter().copied());
    let shares = |(name, own): (&String, &OwnShares<f64>)| {
        let text = match own {
            OwnShares::Given(shares) => return Ok((name.clone(), shares[first..].to_vec())),
            OwnShares::Formula(text) => text,
        };
        let formula = OwnFormula::parse(&field(name), text)?;
        let wanted = |period: usize| formula.wanted(&sums, period, bank(period - 1));
        let wanted: Vec<f64> = (first..log_returns.len()).map(wanted).collect::<Result<_, FieldError>>()?;
        formula.check_fractions(wanted.iter().copied())?;
        Ok((name.clone(), wanted.into_iter().map(|share| share.clamp(0.0, 1.0)).collect()))
    };
    weights.iter().map(shares).collect()
}

/// Returns each strategy of several assets with its shares in all periods, those before `first` as 0 if they come from a
/// formula. Shares that add up to more than 1 are divided by their sum.
///
/// # Errors
/// A formula without a value in one of the periods from `first` on.
pub fn shares_of_assets(
    weights: &OwnAssetsWeights,
    rows: &AssetHistory,
    bank: &[f64],
    first: usize,
) -> Result<Vec<NamedShares>, FieldError> {
    let assets = rows.first().map_or(0, Vec::len);
    let sums: Vec<ReturnSums> = (0..assets).map(|asset| ReturnSums::of(rows.iter().map(|row| row[asset]))).collect();
    let shares = |(name, own): (&String, &OwnShares<Vec<f64>>)| {
        let text = match own {
            OwnShares::Given(shares) => return Ok((name.clone(), shares.clone())),
            OwnShares::Formula(text) => text,
        };
        if !rows.are_equal() {
            let rule = "must be shares by date: formulas need a return of every asset on every date";
            return Err(FieldError::new(field(name), text, rule));
        }
        let formula = OwnFormula::parse(&field(name), text)?;
        let at = |period: usize| {
            if period < first {
                return Ok(vec![0.0; assets]);
            }
            // Before they are divided, shares have no upper bound: only their ratios count.
            let share = |of_asset: &ReturnSums| formula.share(of_asset, period, bank[period - 1], f64::MAX);
            let shares: Vec<f64> = sums.iter().map(share).collect::<Result<_, FieldError>>()?;
            let total: f64 = shares.iter().sum();
            Ok(if total > 1.0 { shares.into_iter().map(|share| share / total).collect() } else { shares })
        };
        Ok((name.clone(), (0..rows.len()).map(at).collect::<Result<_, FieldError>>()?))
    };
    weights.iter().map(shares).collect()
}

/// Returns how each formula ends on a path after `history`, with the dynamics of its periods.
///
/// # Errors
/// A formula without a value on it.
pub fn ended_on_path(
    own: &[(String, OwnFormula)],
    problem: &ProblemSpecification,
    periods: &[Dynamics],
    history: &[f64],
    returns: &[f64],
) -> Result<Vec<PathOutcome>, FieldError> {
    if own.is_empty() {
        return Ok(Vec::new());
    }
    let sums = ReturnSums::of(history.iter().chain(returns).copied());
    let ended = |(_, formula): &(String, OwnFormula)| {
        let share =
            |step: usize| formula.share(&sums, history.len() + step, problem.rate_per_step, problem.action_interval[1]);
        let shares: Vec<f64> = (0..returns.len()).map(share).collect::<Result<_, FieldError>>()?;
        Ok(shares_ended(periods, problem.initial_wealth, shares.into_iter(), returns))
    };
    own.iter().map(ended).collect()
}
