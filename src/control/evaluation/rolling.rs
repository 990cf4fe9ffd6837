//! Walk-forward: every so many periods a policy is trained on the window of returns before, and lived by until the next one.
//!
//! Decisions and accounts are apart: under power and log utility no band depends on wealth, and hardly on what is held, so the
//! stretches between trainings can be decided side by side, and what wealth became is counted afterwards ([`crate::control::evaluation::account`]).

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::control::error::TrainError;
use crate::control::kept::Kept;
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
use crate::control::training::{Summaries, Training};

/// One period of the real world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Period {
    /// Of the risky asset.
    pub log_return: f64,
    /// Simple return of the bank.
    pub bank_return: f64,
}

/// How allocations are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strategy {
    /// A ball that learns, at this miscoverage.
    Adaptive {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// The same, trained as if trading were free.
    CostBlind {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// A ball frozen at the window.
    Static {
        /// Miscoverage of its ball.
        alpha: f64,
    },
    /// The centre of the balls, learned and taken as true.
    PlugIn,
    /// The same share always.
    Mix {
        /// Share of wealth in the risky asset.
        share: f64,
    },
}

/// What was decided for one period, and why.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The holdings that are kept as they are.
    pub band: Band,
    /// Radius of the ball then; 0 where there is none.
    pub radius: f64,
    /// Absent where nothing was trained.
    pub source: Option<AdviceSource>,
}

/// The choices that all trainings share.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkForward {
    /// Periods of history that each policy is trained on.
    pub window: usize,
    /// Periods that a policy is lived by, until the next is trained: at most the horizon.
    pub every: usize,
    /// Periods that a policy looks ahead.
    pub horizon: usize,
    /// Multiple of the radius of every ball.
    pub scale: f64,
    /// Share of every radius that is acted on.
    pub caution: CautionLevel,
    /// What the adversary may use.
    pub support: Support,
    /// Of the balls, and the law that plug-in takes as true.
    pub centre: CentreSpecification,
    /// Relative risk aversion: log utility at 1, power utility above.
    pub risk_aversion: f64,
    /// That policies reckon with, of what is traded.
    pub trading_cost: f64,
    /// Design points a step.
    pub count: usize,
    /// Of every training.
    pub seed: u64,
}

impl Strategy {
    /// Whether it follows a policy.
    pub fn is_trained(self) -> bool {
        self.framework().is_some()
    }

    fn framework(self) -> Option<(Framework, f64)> {
        match self {
            Strategy::Adaptive { alpha } | Strategy::CostBlind { alpha } => Some((Framework::Adaptive, alpha)),
            Strategy::Static { alpha } => Some((Framework::Static, alpha)),
            // Its radius is zero whatever the rule says.
            Strategy::PlugIn => Some((Framework::PlugIn, 0.1)),
            Strategy::Mix { .. } => None,
        }
    }
}

/// What the trainings of one stretch have in common; no bit of what is decided depends on it.
pub struct Common {
    kept: Kept,
    measured: Arc<Summaries>,
}

impl Common {
    /// With what can be made again in `kept`.
    pub fn of(strategies: &[Strategy], kept: Kept) -> Self {
        let mut alphas: Vec<f64> = Vec::new();
        for strategy in strategies {
            if let Some((Framework::Adaptive, alpha)) = strategy.framework()
                && !alphas.contains(&alpha)
            {
                alphas.push(alpha);
            }
        }
        Common { kept, measured: Arc::new(Summaries::at(alphas)) }
    }
}

impl WalkForward {
    /// Of terminal wealth, and of a year's in the figures.
    pub fn utility(&self) -> UtilitySpecification {
        UtilitySpecification::relative(self.risk_aversion)
    }

    /// From one training to the next, how often; the last may be cut short.
    pub fn stretches(&self, periods: usize) -> usize {
        periods.saturating_sub(self.window).div_ceil(self.every)
    }

    /// Trainings that [`Self::decide`] takes: one a strategy that needs it and a stretch.
    pub fn trainings(&self, strategies: &[Strategy], periods: &[Period]) -> usize {
        self.stretches(periods.len()) * strategies.iter().filter(|strategy| strategy.is_trained()).count()
    }

    /// Steps of all these trainings.
    pub fn steps(&self, strategies: &[Strategy], periods: &[Period]) -> usize {
        self.trainings(strategies, periods) * self.horizon
    }

    /// The training request of one stretch from the periods before it. The bank is taken to go on paying what it paid last.
    pub fn specification(&self, framework: Framework, alpha: f64, past: &[Period]) -> Specification {
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

    /// What each strategy holds through every period after the first window, on the current pool of threads.
    /// The last stretch may be cut short. `solved` is called after every step of a training, of which there are
    /// [`Self::steps`].
    ///
    /// # Errors
    /// Returns or choices that break a rule of the specification; a training that fails; the stop signal.
    pub fn decide(
        &self,
        strategies: &[Strategy],
        periods: &[Period],
        watch: &Watch,
        solved: &(dyn Fn() + Sync),
    ) -> Result<Vec<Vec<Decision>>, TrainError> {
        let decided = |stretch: usize| -> Result<Vec<Vec<Decision>>, TrainError> {
            let common = Common::of(strategies, Kept::default());
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

    /// What one strategy holds from a training to the next; `common` is of its stretch, and `solved` is called after every
    /// step of the training.
    ///
    /// # Errors
    /// As [`Self::decide`].
    pub fn decide_stretch(
        &self,
        strategy: Strategy,
        periods: &[Period],
        stretch: usize,
        common: &Common,
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
        // A level has another share of the radius at each miscoverage, so that nothing is measured in common.
        let measured = if self.caution.is_found() { Arc::default() } else { common.measured.clone() };
        let training = Training::among(&specification, common.kept.clone(), measured)?;
        let policy = training.run_by_steps(watch, solved)?;
        let advisor = Advisor::with(policy, common.kept.clone());
        let returns: Vec<f64> = lived.iter().map(|period| period.log_return).collect();
        let decided = |Advice { band, radius, source, .. }| Decision { band, radius, source: Some(source) };
        Ok(advisor.walk(advisor.initial_state(None, None)?, &returns).map(decided).collect())
    }
}
