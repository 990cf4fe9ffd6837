//! The specification of the policy that follows another, for one asset or several.

use crate::control::error::FieldError;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::specification::Specification;
use crate::control::request::support::Interval;

impl Specification {
    /// Returns the specification of the policy that follows after `elapsed` periods: the same, with the returns `record`,
    /// date after date and NaN before an asset's first, and the last observed `rate`. If the problem depends on wealth or secures spending, present wealth replaces initial
    /// wealth and the design interval is scaled with it. With spending the horizon comes nearer, and otherwise not.
    /// Renewals of sessions and walk-forwards of several assets call it.
    ///
    /// # Errors
    /// The record breaks a rule.
    pub fn next(&self, record: &[f64], rate: Option<f64>, wealth: f64, elapsed: usize) -> Result<Self, FieldError> {
        let mut next = self.clone();
        let problem = &mut next.problem;
        problem.rate_per_step = rate.unwrap_or(problem.rate_per_step);
        let secures = problem.spending.as_ref().is_some_and(|spending| spending.secures());
        if let Some(spending) = &mut problem.spending {
            **spending = spending.after(elapsed);
            problem.horizon = problem.horizon.saturating_sub(elapsed).max(1);
        }
        if problem.depends_on_wealth() || secures {
            let factor = wealth / problem.initial_wealth;
            problem.initial_wealth = wealth;
            let moved = |Interval { min, max }| Interval { min: min * factor, max: max * factor };
            next.design.wealth = next.design.wealth.map(moved);
        }
        let Some(fund) = &self.fund else {
            next.problem.history = record.to_vec();
            return Ok(next);
        };
        let rows = record.chunks_exact(fund.assets.len()).map(<[f64]>::to_vec).collect();
        match AssetsProblem::of(&next, AssetHistory::marked(rows)) {
            Some(problem) => problem.training(next.design, next.surrogate, next.seed),
            None => Ok(next),
        }
    }
}
