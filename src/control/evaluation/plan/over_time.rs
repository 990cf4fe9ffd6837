//! The periods of a plan, its states, and the fan of its paths.

use super::Plan;
use super::by_state::DescribedBy;
use super::course::{ReturnPaths, SpendingCourse, SpendingRule};
use super::periods::PeriodPlan;
use super::report::{FanPeriod, PeriodByState, PlanFan, PlanStateNumber, PlannedPeriod, PlannedStates};
use crate::control::policy::futures::World;
use crate::numerics::search::chebyshev::even;
use crate::numerics::statistics::summary::interpolated_quantile;

/// Shares of paths below the quantiles of a fan.
const SHARES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Largest number of times of a fan.
const TIMES: usize = 61;

impl Plan {
    /// Returns what is spent and held in each period; nothing if it depends on more.
    pub(super) fn planned(&self) -> Vec<PlannedPeriod> {
        if self.own.described != DescribedBy::Period {
            return Vec::new();
        }
        let planned = |(index, planned): (usize, &PeriodPlan)| PlannedPeriod {
            period: index + 1,
            spent: planned.spent.at(0.0),
            held: planned.held.at(0.0),
            reserve: self.own.reserves.get(index).map(|[_, reserve]| *reserve),
        };
        self.own.periods.iter().enumerate().map(planned).collect()
    }

    /// Returns what is spent and held by the state of the plan, if it has one.
    pub(super) fn states(&self) -> Option<PlannedStates> {
        let described_by = match self.own.described {
            DescribedBy::Period => return None,
            DescribedBy::Funds => PlanStateNumber::Funded,
            DescribedBy::Unit => PlanStateNumber::OfPeak,
        };
        let by_state = |&time: &usize| {
            let PeriodPlan { spent, held, .. } = self.own.periods.get(time)?;
            Some(PeriodByState {
                period: time + 1,
                states: held.states.clone(),
                spent: (!self.has_goal()).then(|| spent.shares.clone()),
                held: held.shares.clone(),
            })
        };
        Some(PlannedStates { described_by, periods: self.times().iter().filter_map(by_state).collect() })
    }

    /// Returns the times of the fan.
    fn times(&self) -> Vec<usize> {
        let horizon = self.problem.horizon;
        even(0.0, horizon as f64, TIMES.min(horizon + 1)).into_iter().map(|time| time.round() as usize).collect()
    }

    /// Returns quantiles of the paths of the plan.
    pub(super) fn fan(&self, paths: &ReturnPaths, plan: &SpendingRule) -> PlanFan {
        let problem = &self.problem;
        let times = self.times();
        let of = |world| {
            let seen = |course: &SpendingCourse| -> Vec<[f64; 2]> {
                times
                    .iter()
                    .map(|&time| [course.wealth[time], course.spent.get(time).copied().unwrap_or_default()])
                    .collect()
            };
            let courses = paths.follow((world, 1.0), plan, problem.initial_wealth, seen);
            let quantiles = |place: usize, of: usize| {
                let mut values: Vec<f64> = courses.iter().map(|course| course[place][of]).collect();
                values.sort_unstable_by(f64::total_cmp);
                SHARES.map(|share| interpolated_quantile(&values, share))
            };
            let at = |(place, &after): (usize, &usize)| FanPeriod {
                after,
                wealth: quantiles(place, 0),
                spending: (after < problem.horizon).then(|| quantiles(place, 1)),
            };
            times.iter().enumerate().map(at).collect()
        };
        PlanFan { shares: SHARES, record: of(World::Record), worst: of(World::Worst) }
    }
}
