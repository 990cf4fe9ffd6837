//! Turns the end of a search into a solution.

use super::interior::Interior;
use super::{AssetsSolution, LEAST_SHARE, PortfolioStep, ROUNDING, TOLERANCE};
use crate::control::problem::compositions::CompositionSet;

/// Returns the allocation of the nearest composition within limits, which a search leaves by what they give way. Shares
/// that are rounding are left out.
fn within(compositions: &CompositionSet, shares: &[f64]) -> Vec<f64> {
    let total: f64 = shares.iter().sum();
    if total < LEAST_SHARE {
        return vec![0.0; shares.len()];
    }
    let kept = |share: &f64| if *share < LEAST_SHARE * total { 0.0 } else { *share };
    let kept: Vec<f64> = shares.iter().map(kept).collect();
    let left: f64 = kept.iter().sum();
    let composition = compositions.nearest(kept.iter().map(|share| share / left).collect());
    composition.iter().map(|share| total * share).collect()
}

impl PortfolioStep {
    /// Returns the solution at the point of a search among this step's assets.
    pub(super) fn solution_from(&self, interior: &Interior<'_>, upper: f64, evaluations: usize) -> AssetsSolution {
        let (mut shares, price) = (interior.best.clone(), interior.best_price);
        if let Some(compositions) = &self.compositions {
            shares = within(compositions, &shares);
            let value = self.value_at(&shares, price);
            return self.solution_at(&shares, value, interior, upper, evaluations);
        }
        let total: f64 = shares.iter().sum();
        shares.iter_mut().filter(|share| **share < LEAST_SHARE).for_each(|share| *share = 0.0);
        let left: f64 = shares.iter().sum();
        if left > 0.0 {
            shares.iter_mut().for_each(|share| *share *= total / left);
        }
        let mut value = self.value_at(&shares, price);
        if value < interior.lower - TOLERANCE {
            (shares, value) = (interior.best.clone(), interior.lower);
        }
        self.solution_at(&shares, value, interior, upper, evaluations)
    }

    fn solution_at(
        &self,
        shares: &[f64],
        value: f64,
        interior: &Interior<'_>,
        upper: f64,
        evaluations: usize,
    ) -> AssetsSolution {
        AssetsSolution {
            allocation: interior.of_all(shares),
            value: self.utility.inverse(value - ROUNDING * value.abs()),
            bound: self.utility.inverse(upper.max(value)),
            multiplier: interior.best_price,
            mean_moves: interior.mean_moves(),
            evaluations,
        }
    }

    /// Leaves all in the bank if the search found nothing better and the bank is allowed, even if the search failed.
    /// Caps the bound at the best growth seen.
    pub(super) fn at_least_the_bank(&self, found: AssetsSolution) -> AssetsSolution {
        let most = self.most_growth();
        let bound = if found.bound < most && found.bound >= found.value { found.bound } else { most };
        if found.value >= 0.0 || self.total.lowest > 0.0 {
            return AssetsSolution { value: found.value.min(bound), bound, ..found };
        }
        let nothing = vec![0.0; self.assets];
        AssetsSolution { allocation: nothing.clone(), value: 0.0, bound: bound.max(0.0), mean_moves: nothing, ..found }
    }
}
