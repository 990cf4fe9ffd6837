//! The step with limits on the composition theta = a / sum a: the allocations allowed are the multiples of allowed
//! compositions whose sum is within the interval of the total.
//!
//! The search lets every limit give way a little, so that it has an interior even if limits leave none, and its end
//! becomes the nearest composition that keeps them (`outcome.rs`). The bound is that of the limits themselves: the
//! greatest rise of a tangent is a linear programme, and weak duality bounds it.

use super::interior::Interior;
use super::trading::Trading;
use super::{PortfolioStep, TOLERANCE};
use crate::control::problem::compositions::CompositionSet;
use crate::numerics::search::programme::{LinearBound, QuadraticProgramme};

/// By how much a search lets a limit on the composition give way: a loss of a millionth of a difference of slopes.
pub(super) const GIVES_WAY: f64 = 1e-6;

/// The greatest rise of a linear function less the cost of trading.
pub(super) struct GreatestRise {
    /// At least the greatest rise, and that up to rounding.
    pub bound: f64,
    /// The assets held there, if the composition is limited.
    pub support: Vec<usize>,
}

impl PortfolioStep {
    /// Restricts the step to allocations of these compositions. Checked by: `tests/solver/limits.rs`.
    #[must_use]
    pub fn within(self, compositions: Option<CompositionSet>) -> Self {
        PortfolioStep { compositions, ..self }
    }

    /// Returns true if an allocation keeps the limits.
    pub(super) fn allows(&self, allocation: &[f64]) -> bool {
        let Some(compositions) = &self.compositions else { return true };
        let total: f64 = allocation.iter().sum();
        let composition: Vec<f64> = allocation.iter().map(|share| share / total).collect();
        total <= 0.0 || compositions.keeps(&composition)
    }

    /// Returns the shares of a warm start, of the nearest composition within the limits.
    pub(super) fn allowed_near(&self, shares: &[f64]) -> Vec<f64> {
        let total: f64 = shares.iter().sum();
        match &self.compositions {
            Some(compositions) if total > 0.0 => {
                let composition: Vec<f64> = shares.iter().map(|share| share / total).collect();
                if compositions.excess(&composition) < GIVES_WAY {
                    return shares.to_vec();
                }
                compositions.nearest(composition).iter().map(|share| total * share).collect()
            }
            _ => shares.to_vec(),
        }
    }

    /// Returns the maximum of `slopes . b - price T(b)` over the allocations b allowed.
    pub(super) fn greatest_rise(&self, trading: &Trading, slopes: &[f64]) -> GreatestRise {
        let Some(compositions) = &self.compositions else {
            return GreatestRise { bound: trading.most(slopes, self.total), support: Vec::new() };
        };
        if !trading.holdings.is_empty() {
            return self.greatest_rise_of_trades(compositions, trading, slopes);
        }
        let greatest = compositions.greatest(slopes);
        let total = if greatest.bound > 0.0 { self.total.highest } else { self.total.lowest };
        let support = if total > 0.0 { CompositionSet::support(&greatest.composition) } else { Vec::new() };
        GreatestRise { bound: total * greatest.bound, support }
    }

    /// Solves the programme in shares b, moves w of a limited turnover, and trades u >= |b - h|.
    fn greatest_rise_of_trades(
        &self,
        compositions: &CompositionSet,
        trading: &Trading,
        slopes: &[f64],
    ) -> GreatestRise {
        let (assets, moves) = (self.assets, compositions.moves());
        let first_trade = assets + moves;
        let mut linear: Vec<f64> = slopes.iter().map(|slope| -slope).collect();
        linear.resize(first_trade, 0.0);
        linear.resize(first_trade + assets, trading.price);
        let all = |sign: f64| (0..assets).map(|asset| (asset, sign)).collect::<Vec<_>>();
        let mut bounds: Vec<LinearBound> = compositions
            .cone(0.0)
            .iter()
            .map(|direction| LinearBound {
                terms: direction.iter().enumerate().map(|(index, entry)| (index, -entry)).collect(),
                limit: 0.0,
            })
            .collect();
        bounds.push(LinearBound { terms: all(1.0), limit: self.total.highest });
        bounds.push(LinearBound { terms: all(-1.0), limit: -self.total.lowest });
        for (asset, held) in trading.holdings.iter().enumerate() {
            bounds.push(LinearBound { terms: vec![(asset, -1.0)], limit: 0.0 });
            for sign in [1.0, -1.0] {
                let terms = vec![(asset, sign), (first_trade + asset, -1.0)];
                bounds.push(LinearBound { terms, limit: sign * held });
            }
        }
        let intervals = vec![[0.0, self.total.highest]; assets].into_iter().chain(vec![[0.0, 2.0]; moves]);
        let trades = trading.holdings.iter().map(|held| [0.0, held + 1.0]);
        let intervals: Vec<[f64; 2]> = intervals.chain(trades).collect();
        let programme = QuadraticProgramme { quadratic: Vec::new(), linear, bounds, equations: Vec::new() };
        let solution = programme.solve();
        let support = CompositionSet::support(&solution.point[..assets]);
        GreatestRise { bound: -programme.least(&solution, &intervals), support }
    }
}

impl Interior<'_> {
    /// Returns the assets outside the search that the greatest rise of `slopes` within limits holds, if it is higher by
    /// more than the gap that is left among those searched, whose slopes are `gradient`. A bound is `base` and a rise.
    pub(super) fn entering_within(&self, whole: &GreatestRise, gradient: &[f64], base: f64) -> Vec<usize> {
        let outside: Vec<usize> = whole.support.iter().copied().filter(|asset| !self.held.contains(asset)).collect();
        if outside.is_empty() {
            return outside;
        }
        let among = self.step.greatest_rise(&self.step.trading, gradient).bound;
        let gap = (base + among - self.lower).max(TOLERANCE);
        if whole.bound - among > gap { outside } else { Vec::new() }
    }
}
