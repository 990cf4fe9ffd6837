//! The composition of a fund: the share of the fund in each asset, for any share of wealth in the fund.

use super::AssetsSolution;
use crate::control::request::fund::CompositionRule;
use crate::numerics::transport::water_filling::inverse_volatility;

/// A total below this carries no information about its parts.
const LEAST_TOTAL: f64 = 1e-4;

impl CompositionRule {
    /// Returns the composition after the log-returns `rows`, date by date. `one_step` solves the one-step problem and
    /// is called only if the rule needs it.
    pub fn composition(&self, rows: &[Vec<f64>], one_step: impl FnOnce() -> AssetsSolution) -> Vec<f64> {
        match self {
            CompositionRule::OneStep => of(&one_step().allocation).unwrap_or_else(|| inverse_volatility(rows)),
            CompositionRule::Equal => {
                let assets = rows.first().map_or(0, Vec::len);
                vec![1.0 / assets as f64; assets]
            }
            CompositionRule::InverseVolatility => inverse_volatility(rows),
            CompositionRule::Given(shares) => {
                let whole: f64 = shares.iter().sum();
                shares.iter().map(|share| share / whole).collect()
            }
        }
    }
}

/// Returns the composition of an allocation; `None` if it holds next to nothing.
pub fn of(allocation: &[f64]) -> Option<Vec<f64>> {
    let total: f64 = allocation.iter().sum();
    (total >= LEAST_TOTAL).then(|| allocation.iter().map(|share| share / total).collect())
}

/// Returns the proposed composition if the policy values the law of its fund at least as much as that of the fund held;
/// otherwise the one held. `value` is the policy's value at the law of a fund's returns, given the fund.
///
/// This keeps the policy's promise at the fund held true for any rule of proposal, by induction over the steps. The
/// payoff depends on the returns through the fund held alone, and what follows is worth at least what keeping the fund
/// would be.
///
/// Both of the two values must be as high; a fund without values is never chosen.
pub fn accept_if_no_worse(held: Vec<f64>, proposed: Vec<f64>, value: impl Fn(&[f64]) -> Option<[f64; 2]>) -> Vec<f64> {
    let Some(new) = value(&proposed) else { return held };
    let is_as_high = value(&held).is_none_or(|old| new.iter().zip(old).all(|(new, old)| *new >= old));
    if is_as_high { proposed } else { held }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solution(allocation: &[f64]) -> AssetsSolution {
        AssetsSolution {
            allocation: allocation.to_vec(),
            value: 0.0,
            bound: 0.0,
            multiplier: 0.0,
            mean_moves: vec![0.0; allocation.len()],
            evaluations: 0,
        }
    }

    #[test]
    fn every_rule_gives_shares_that_sum_to_1() {
        // Deviations 0.02 and 0.04.
        let rows = vec![vec![0.03, -0.03], vec![-0.01, 0.05]];
        let never = || unreachable!("no other rule solves the one-step problem");
        assert_eq!(CompositionRule::Equal.composition(&rows, never), [0.5, 0.5]);
        let inverse = CompositionRule::InverseVolatility.composition(&rows, never);
        assert!((inverse[0] - 2.0 / 3.0).abs() < 1e-12 && (inverse[1] - 1.0 / 3.0).abs() < 1e-12, "{inverse:?}");
        assert_eq!(CompositionRule::Given(vec![0.9, 0.1]).composition(&rows, never), [0.9, 0.1]);
        assert_eq!(CompositionRule::OneStep.composition(&rows, || solution(&[0.125, 0.375])), [0.25, 0.75]);
        assert_eq!(CompositionRule::OneStep.composition(&rows, || solution(&[0.0, 0.0])), inverse);
    }

    #[test]
    fn a_composition_that_the_policy_values_less_is_not_taken() {
        let value = |fund: &[f64]| (fund[0] > 0.1).then_some([fund[0], 0.0]);
        assert_eq!(accept_if_no_worse(vec![0.5, 0.5], vec![0.4, 0.6], value), [0.5, 0.5]);
        assert_eq!(accept_if_no_worse(vec![0.5, 0.5], vec![0.6, 0.4], value), [0.6, 0.4]);
        assert_eq!(accept_if_no_worse(vec![0.5, 0.5], vec![0.5, 0.5], value), [0.5, 0.5]);
        assert_eq!(accept_if_no_worse(vec![0.0, 1.0], vec![0.05, 0.95], value), [0.0, 1.0]);
        assert_eq!(accept_if_no_worse(vec![0.0, 1.0], vec![0.2, 0.8], value), [0.2, 0.8]);
        // A proposal that is worth more but costs more to reach.
        let dear = |fund: &[f64]| Some([fund[0], fund[1]]);
        assert_eq!(accept_if_no_worse(vec![0.5, 0.5], vec![0.6, 0.4], dear), [0.5, 0.5]);
    }
}
