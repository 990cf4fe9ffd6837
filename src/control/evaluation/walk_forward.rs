//! Walk-forward: every `every` periods a policy is trained on the window of returns before, and followed until the next
//! training.
//!
//! Decisions and accounts are separate: under power and log utility no band depends on wealth, and hardly on the
//! holding. The blocks of periods between trainings can therefore be decided in parallel, and wealth is computed
//! afterwards ([`crate::control::evaluation::account`]).

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::policy::advice::{Advice, AdviceSource};
use crate::control::policy::advisor::Advisor;
use crate::control::pool;
use crate::control::problem::actions::Band;
use crate::control::progress::Watch;
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::framework::Framework;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::{
    DesignSpecification, ProblemSpecification, Specification, SurrogateSpecification, UtilitySpecification,
};
use crate::control::request::support::Support;
use crate::control::training::{LawSummaryCache, Training};

/// Returns of one actual period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActualPeriod {
    /// Log-return of the risky asset.
    pub log_return: f64,
    /// Simple return of the bank.
    pub bank_return: f64,
}

/// A way to choose allocations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strategy {
    /// A policy with a ball that learns.
    Adaptive {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// An adaptive policy trained as if trading were free.
    CostBlind {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// A policy with a ball frozen at the window.
    Static {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// A policy that learns the centre of the balls and takes it as true.
    PlugIn,
    /// A constant mix.
    Mix {
        /// Share of wealth in the risky asset.
        share: f64,
    },
}

/// The decision for one period, with its radius and source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The no-trade region: holdings in it are kept as they are.
    pub band: Band,
    /// Radius of the ball at that time; 0 if there is none.
    pub radius: f64,
    /// Source of the advice; none if nothing was trained.
    pub source: Option<AdviceSource>,
}

/// The choices that all trainings share.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkForward {
    /// Periods of history that each policy is trained on.
    pub window: usize,
    /// Periods for which a policy is followed until the next is trained, at most the horizon.
    pub every: usize,
    /// Periods that a policy looks ahead.
    pub horizon: usize,
    /// Multiple of the radius of every ball.
    pub scale: f64,
    /// Share of every radius that is used.
    pub caution: CautionLevel,
    /// The log-returns that the adversary may use.
    pub support: Support,
    /// Centre of the balls, and the law that plug-in takes as true.
    pub centre: CentreSpecification,
    /// Relative risk aversion: log utility at 1, power utility above.
    pub risk_aversion: f64,
    /// Cost that policies assume, as a share of each trade.
    pub trading_cost: f64,
    /// Design points per step.
    pub count: usize,
    /// Seed of every training.
    pub seed: u64,
}

impl Strategy {
    /// Returns true if the strategy follows a policy.
    pub fn is_trained(self) -> bool {
        self.framework().is_some()
    }

    fn framework(self) -> Option<(Framework, f64)> {
        match self {
            Strategy::Adaptive { alpha } | Strategy::CostBlind { alpha } => Some((Framework::Adaptive, alpha)),
            Strategy::Static { alpha } => Some((Framework::Static, alpha)),
            // Its radius is zero under every rule.
            Strategy::PlugIn => Some((Framework::PlugIn, 0.1)),
            Strategy::Mix { .. } => None,
        }
    }
}

/// Work shared by the trainings of one block of periods; no bit of a decision depends on it.
pub struct SharedWork {
    kept: Cache,
    measured: Arc<LawSummaryCache>,
}

impl SharedWork {
    /// Prepares the shared work, with the cache `kept`.
    pub fn of(strategies: &[Strategy], kept: Cache) -> Self {
        let mut alphas: Vec<f64> = Vec::new();
        for strategy in strategies {
            if let Some((Framework::Adaptive, alpha)) = strategy.framework()
                && !alphas.contains(&alpha)
            {
                alphas.push(alpha);
            }
        }
        SharedWork { kept, measured: Arc::new(LawSummaryCache::at(alphas)) }
    }
}

impl WalkForward {
    /// Returns the utility of terminal wealth, also used for yearly wealth in the figures.
    pub fn utility(&self) -> UtilitySpecification {
        UtilitySpecification::relative(self.risk_aversion)
    }

    /// Returns the number of blocks of periods, one per training; the last may be cut short.
    pub fn stretches(&self, periods: usize) -> usize {
        periods.saturating_sub(self.window).div_ceil(self.every)
    }

    /// Returns the number of trainings in [`Self::decide`]: one per trained strategy and block of periods.
    pub fn trainings(&self, strategies: &[Strategy], periods: &[ActualPeriod]) -> usize {
        self.stretches(periods.len()) * strategies.iter().filter(|strategy| strategy.is_trained()).count()
    }

    /// Returns the number of steps of all these trainings.
    pub fn steps(&self, strategies: &[Strategy], periods: &[ActualPeriod]) -> usize {
        self.trainings(strategies, periods) * self.horizon
    }

    /// Returns the training request of one block from the periods before it. The bank is assumed to keep paying its
    /// last rate.
    pub fn specification(&self, framework: Framework, alpha: f64, past: &[ActualPeriod]) -> Specification {
        Specification {
            problem: ProblemSpecification {
                framework,
                horizon: self.horizon,
                trading_cost: self.trading_cost,
                utility: self.utility(),
                centre: self.centre.clone(),
                radius: Some(RadiusRule::scaled_bridge(alpha, self.scale)),
                caution: framework.has_ball().then_some(self.caution),
                support: Some(self.support),
                ..ProblemSpecification::of(
                    past.iter().map(|period| period.log_return).collect(),
                    past.last().map_or(0.0, |last| last.bank_return),
                )
            },
            fund: None,
            design: DesignSpecification { count: Some(self.count), ..DesignSpecification::default() },
            surrogate: SurrogateSpecification::default(),
            seed: self.seed,
        }
    }

    /// Decides what each strategy holds in every period after the first window, on the current pool of threads. The
    /// last block of periods may be cut short. `solved` is called after each of the [`Self::steps`] of the trainings.
    ///
    /// # Errors
    /// Returns or choices that break a rule of the specification; a training that fails; the stop signal.
    pub fn decide(
        &self,
        strategies: &[Strategy],
        periods: &[ActualPeriod],
        watch: &Watch,
        solved: &(dyn Fn() + Sync),
    ) -> Result<Vec<Vec<Decision>>, TrainError> {
        let decided = |stretch: usize| -> Result<Vec<Vec<Decision>>, TrainError> {
            let common = SharedWork::of(strategies, Cache::default());
            let decided =
                |strategy: Strategy| self.decide_stretch(strategy, periods, stretch, &common, (watch, solved));
            pool::map(strategies.to_vec(), decided).into_iter().collect()
        };
        let stretches = (0..self.stretches(periods.len())).collect();
        let mut decisions: Vec<Vec<Decision>> = vec![Vec::new(); strategies.len()];
        for found in pool::map(stretches, decided) {
            decisions.iter_mut().zip(found?).for_each(|(all, stretch)| all.extend(stretch));
        }
        Ok(decisions)
    }

    /// Decides what one strategy holds from one training to the next. `common` belongs to this block of periods, and
    /// `solved` is called after every step of the training.
    ///
    /// # Errors
    /// As [`Self::decide`].
    pub fn decide_stretch(
        &self,
        strategy: Strategy,
        periods: &[ActualPeriod],
        stretch: usize,
        common: &SharedWork,
        (watch, solved): (&Watch, &(dyn Fn() + Sync)),
    ) -> Result<Vec<Decision>, TrainError> {
        let start = self.window + stretch * self.every;
        let lived = &periods[start..periods.len().min(start + self.every)];
        let Some((framework, alpha)) = strategy.framework() else {
            let Strategy::Mix { share } = strategy else { return Ok(Vec::new()) };
            return Ok(vec![Decision { band: Band::of(&[share]), radius: 0.0, source: None }; lived.len()]);
        };
        let mut specification = self.specification(framework, alpha, &periods[start - self.window..start]);
        if matches!(strategy, Strategy::CostBlind { .. }) {
            specification.problem.trading_cost = 0.0;
        }
        // A level uses a different share of the radius at each miscoverage, so no measurement can be shared.
        let measured = if self.caution.is_found() { Arc::default() } else { common.measured.clone() };
        let training = Training::among(&specification, common.kept.clone(), measured)?;
        let policy = training.run_by_steps(watch, solved)?;
        let advisor = Advisor::with(policy, common.kept.clone());
        let returns: Vec<f64> = lived.iter().map(|period| period.log_return).collect();
        let decided = |Advice { band, radius, source, .. }| Decision { band, radius, source: Some(source) };
        Ok(advisor.walk(advisor.initial_state(None, None)?, &returns).map(decided).collect())
    }
}
