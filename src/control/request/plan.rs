//! The request for a plan.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::framework::Framework;
use super::rules::{WEALTH, wealth, whole, within};
use super::specification::{ProblemSpecification, Specification, default_seed};
use super::spending::{Spending, is_zero};
use crate::control::error::FieldError;

/// Allowed probabilities with which money is to last.
const CERTAINTY: (f64, f64) = (0.5, 0.999);
/// Allowed number of paths.
const PATHS: std::ops::RangeInclusive<usize> = 200..=20_000;
/// Largest number of periods of all paths: some tenths of a second.
const PATH_PERIODS: usize = 4_000_000;
/// Largest number of returns of all robust steps: some seconds.
const STEP_RETURNS: usize = 4_000_000;
/// The limit if each period is solved at many states.
const AIMED_STEP_RETURNS: usize = 400_000;
/// Allowed limits on a drawdown.
const DRAWDOWN_LIMIT: (f64, f64) = (0.01, 0.99);
/// Allowed drawdowns at the start.
const DRAWDOWN: (f64, f64) = (0.0, 0.99);

/// The aim of a plan.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlanAim {
    /// Spending in every period, and wealth at the horizon, by the utility of `problem.spending`.
    #[default]
    Spending,
    /// The `goal`: the plan spends `wanted` in every period, or nothing, and holds what makes the expected shortfall least
    /// in the worst case. The shortfall is what is missing of the goal at the horizon, and of `wanted` before.
    Goal,
}

/// A question about the years to come: how much to spend and what to hold in each period, and how likely it lasts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanQuestion<P = ProblemSpecification> {
    /// The problem as in a training, of one asset or several. Its horizon is that of the plan, and `spending` may be left
    /// out. The plan keeps to the ball of the record: `framework` is `static` or left out. Several assets are held in the
    /// composition that is best for one period, which is restored in each.
    pub problem: P,
    /// An amount wanted in every period, in money of now, 1e-6 to 1e15. Default: the first amount of the plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted: Option<f64>,
    /// Wealth wanted at the horizon, in money of now, 1e-6 to 1e15. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<f64>,
    /// An amount put in at the start of every period, in money of now, 1e-6 to 1e15, if the plan aims at a goal. `wanted` is
    /// then left out. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub saved: Option<f64>,
    /// The aim of the plan. Default `spending`. With `goal`, `problem.spending` says nothing but `inflation`, and
    /// `problem.utility` does not count.
    #[serde(default, skip_serializing_if = "PlanAim::is_spending")]
    pub aim: PlanAim,
    /// Limit on the drawdown, 0.01 to 0.99: no return of the support takes money that stays invested further below its
    /// highest value so far than this share. Spending is no loss. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawdown_limit: Option<f64>,
    /// The drawdown at the start, 0 to 0.99 and below the limit. Default 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drawdown: f64,
    /// Probability with which a sustainable amount lasts, 0.5 to 0.999. Default 0.9.
    #[serde(default = "default_certainty")]
    pub certainty: f64,
    /// Number of simulated paths, 200 to 20,000; times the horizon at most 4,000,000. Default 4000.
    #[serde(default = "default_paths")]
    pub paths: usize,
    /// Seed of the simulated bridges and paths. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl PlanAim {
    fn is_spending(&self) -> bool {
        *self == PlanAim::Spending
    }
}

fn default_certainty() -> f64 {
    0.9
}

fn default_paths() -> usize {
    4000
}

impl<P> Bounded for PlanQuestion<P> {
    const BOUNDS: &'static [FieldBounds] = &[
        ("wanted", ValueBounds::number(WEALTH)),
        ("goal", ValueBounds::number(WEALTH)),
        ("saved", ValueBounds::number(WEALTH)),
        ("drawdown_limit", ValueBounds::number(DRAWDOWN_LIMIT)),
        ("drawdown", ValueBounds::number(DRAWDOWN)),
        ("certainty", ValueBounds::number(CERTAINTY)),
        ("paths", ValueBounds::count(&PATHS)),
    ];
}

impl<P> PlanQuestion<P> {
    /// Creates the question about a problem, with the defaults for everything else.
    pub fn of(problem: P, seed: u64) -> Self {
        PlanQuestion {
            problem,
            wanted: None,
            goal: None,
            saved: None,
            aim: PlanAim::Spending,
            drawdown_limit: None,
            drawdown: 0.0,
            certainty: default_certainty(),
            paths: default_paths(),
            seed,
        }
    }

    /// Returns the question about another problem.
    pub fn about<Q>(&self, problem: Q) -> PlanQuestion<Q> {
        let PlanQuestion { wanted, goal, saved, aim, drawdown_limit, drawdown, certainty, paths, seed, .. } = *self;
        PlanQuestion { problem, wanted, goal, saved, aim, drawdown_limit, drawdown, certainty, paths, seed }
    }

    /// Returns the spending of each period if the plan aims at a goal, less what is put in.
    pub fn spent_to_goal(&self) -> f64 {
        self.wanted.unwrap_or(0.0) - self.saved.unwrap_or(0.0)
    }

    /// Returns true if what is held depends on more than the period.
    pub fn is_aimed(&self) -> bool {
        self.aim == PlanAim::Goal || self.drawdown_limit.is_some()
    }

    /// Returns the limit on the number of returns times the horizon.
    fn most_step_returns(&self) -> usize {
        if self.is_aimed() { AIMED_STEP_RETURNS } else { STEP_RETURNS }
    }
}

impl PlanQuestion {
    /// Checks every rule, and returns the completed specification of the plan.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn specification(&self) -> Result<Specification, FieldError> {
        let mut problem = self.problem.clone();
        if ![Framework::Adaptive, Framework::Static].contains(&problem.framework) {
            let rule = "must be static or left out: a plan keeps to the ball of the record";
            return Err(FieldError::new("problem.framework", problem.framework.name(), rule));
        }
        problem.framework = Framework::Static;
        problem.spending.get_or_insert_default();
        for (field, amount) in [("wanted", self.wanted), ("goal", self.goal), ("saved", self.saved)] {
            amount.map_or(Ok(()), |amount| wealth(field, amount))?;
        }
        within("certainty", self.certainty, CERTAINTY.0, CERTAINTY.1)?;
        self.check_aim(problem.spending.as_deref(), problem.rate_per_step)?;
        whole("paths", self.paths, &PATHS)?;
        let (horizon, returns) = (problem.horizon, problem.history.len());
        let specification = Specification::of(problem, self.seed).completed()?;
        if self.paths * horizon > PATH_PERIODS {
            let rule =
                format!("must be at most {}: paths times horizon is at most {PATH_PERIODS}", PATH_PERIODS / horizon);
            return Err(FieldError::new("paths", self.paths, rule));
        }
        let most = self.most_step_returns();
        if returns * horizon > most {
            let rule = format!(
                "must hold at most {} returns: their number times the horizon is at most {most}",
                most / horizon
            );
            return Err(FieldError::new("problem.history", format!("{returns} values"), rule));
        }
        Ok(specification)
    }

    /// Checks the aim and the limit on the drawdown beside the rest.
    fn check_aim(&self, spending: Option<&Spending>, rate_per_step: f64) -> Result<(), FieldError> {
        let spending = spending.cloned().unwrap_or_default();
        if self.aim == PlanAim::Goal {
            if self.goal.is_none() {
                return Err(FieldError::new(
                    "aim",
                    "goal",
                    "must have a goal: give `goal`, the wealth wanted at the horizon",
                ));
            }
            if (Spending { inflation: spending.inflation, ..Spending::default() }) != spending {
                let rule = "must say nothing but `inflation` if `aim` is goal: what is spent is `wanted`";
                return Err(FieldError::new("problem.spending", "an object", rule));
            }
        }
        if let Some(saved) = self.saved {
            let refused = |rule: &str| Err(FieldError::new("saved", saved, rule));
            if self.aim != PlanAim::Goal {
                return refused("must be left out unless `aim` is goal");
            }
            if self.wanted.is_some() {
                return refused("must be left out if `wanted` is given: give the difference as one of them");
            }
        }
        let Some(limit) = self.drawdown_limit else {
            let rule = "must be left out, or 0, without `drawdown_limit`";
            let is_alone = self.drawdown != 0.0;
            return if is_alone { Err(FieldError::new("drawdown", self.drawdown, rule)) } else { Ok(()) };
        };
        within("drawdown_limit", limit, DRAWDOWN_LIMIT.0, DRAWDOWN_LIMIT.1)?;
        let refused = |rule: &str| Err(FieldError::new("drawdown_limit", limit, rule));
        if self.aim == PlanAim::Goal {
            return refused("must be left out if `aim` is goal: a plan keeps to one of them");
        }
        if spending.secures() {
            return refused("must be left out if an amount is secured: a plan keeps to one of them");
        }
        if rate_per_step < 0.0 {
            return refused("must be left out if `problem.rate_per_step` is negative: the bank itself would break it");
        }
        if !(0.0..limit).contains(&self.drawdown) {
            let rule = format!("must be at least 0 and below drawdown_limit = {limit}");
            return Err(FieldError::new("drawdown", self.drawdown, rule));
        }
        Ok(())
    }
}
