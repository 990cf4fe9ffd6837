//! The evaluation request: which strategies to compare, on which returns, from which histories.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::evaluation::names::{check_own_names, framework_name, mix_name};
use crate::control::problem::own_formula::{OwnFormula, ReturnSums};
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::centre::CentreSpecification;
use crate::control::request::completion::DEFAULT_COUNT_WEALTH_ALONE;
use crate::control::request::framework::Framework;
use crate::control::request::own_weights::{OwnFormulas, parsed};
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::rules::{self, within};
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{
    DesignSpecification, InitialLaws, ProblemSpecification, Specification, SurrogateSpecification, default_seed,
};

/// Allowed number of simulated paths of one history.
pub const PATHS: std::ops::RangeInclusive<usize> = 100..=100_000;
/// Allowed number of drawn histories.
pub const HISTORIES: std::ops::RangeInclusive<usize> = 2..=1000;
/// Allowed confidence of intervals, a probability.
pub const LEVEL: (f64, f64) = (0.5, 0.999);
/// Largest number of simulated steps of one strategy; each step keeps its advice.
const STEPS: usize = 5_000_000;
/// Largest number of constant allocations.
pub const MOST_MIXES: usize = 101;

/// A comparison of strategies on common simulated returns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationRequest {
    /// The problem, as in a training, but `framework` is left out. `law` is the true law that returns are drawn from;
    /// default: the design's sampling law. `caution` is `paper` and `support` is `none` by default.
    pub problem: ProblemSpecification,
    /// States that the surrogates are trained on, as in a training.
    #[serde(default)]
    pub design: DesignSpecification,
    /// Settings of the surrogates, as in a training.
    #[serde(default)]
    pub surrogate: SurrogateSpecification,
    /// Seed of all random draws. The same request and seed give the same report, except for its `costs`. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Frameworks to compare. Default: all six.
    #[serde(default = "defaults::frameworks")]
    pub frameworks: Vec<Framework>,
    /// Constant allocations to compare, as shares of wealth, at most 101; 0 is All in the bank. Default: 0 to 1 in
    /// steps of 0.1, up to the highest action.
    #[serde(default)]
    pub constant_mixes: Option<Vec<f64>>,
    /// Strategies of your own by name, at most 10: a formula for the share of wealth over the returns before each period,
    /// the history's and the path's, such as `if(mean12 > bank, 1, 0)`. Default: none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(value_type = std::collections::HashMap<String, String>)]
    pub weights: OwnFormulas,
    /// Trained policies to use, by framework. Policies for the other frameworks are trained inside the job.
    #[serde(default)]
    #[schema(value_type = std::collections::HashMap<String, String>)]
    pub policies: BTreeMap<Framework, String>,
    /// Number of simulated paths for each initial history, 100 to 100,000. Default 1000.
    #[serde(default = "defaults::paths")]
    pub paths: usize,
    /// Histories that paths start from. Default: `given`.
    #[serde(default)]
    pub histories: InitialHistories,
    /// Confidence of the intervals, 0.5 to 0.999. Default 0.95.
    #[serde(default = "defaults::level")]
    pub level: f64,
}

/// Histories that paths start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum InitialHistories {
    /// The problem's own history.
    #[default]
    Given,
    /// Histories drawn from the true law, each as long as the problem's own.
    Drawn {
        /// Number of histories, 2 to 1000.
        count: usize,
    },
}

pub(super) mod defaults {
    use super::Framework;

    pub fn frameworks() -> Vec<Framework> {
        use Framework::*;
        vec![Adaptive, Static, KnownLaw, PlugIn, ParametricStatic, ParametricAdaptive]
    }
    pub fn paths() -> usize {
        1000
    }
    pub fn level() -> f64 {
        0.95
    }
}

impl Bounded for EvaluationRequest {
    const BOUNDS: &'static [FieldBounds] = &[
        ("constant_mixes", ValueBounds::List(0, MOST_MIXES, &rules::SHARES)),
        ("paths", ValueBounds::count(&PATHS)),
        ("level", ValueBounds::number(LEVEL)),
    ];
}

impl Bounded for InitialHistories {
    const BOUNDS: &'static [FieldBounds] = &[("count", ValueBounds::count(&HISTORIES))];
}

impl EvaluationRequest {
    /// Fills the defaults that depend on other fields and checks every rule, including those of every training that it
    /// needs.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn completed(mut self) -> Result<Self, FieldError> {
        if self.problem.framework != Framework::Adaptive {
            let value = self.problem.framework.name();
            return Err(FieldError::new(
                "problem.framework",
                value,
                "must be left out: list the frameworks in `frameworks`",
            ));
        }
        self.problem.check_without_spending("an evaluation compares terminal wealth; a plan compares spending")?;
        if let CentreSpecification::Conditional { .. } = self.problem.centre {
            let rule =
                "must be another centre: the returns of a path are drawn from one law, whatever came before them";
            return Err(FieldError::new("problem.centre.kind", self.problem.centre.name(), rule));
        }
        self.problem = self.problem.as_in_the_paper();
        let sampling_law = self.design.sampling_law.get_or_insert(SamplingLaw::Bootstrap {}).clone();
        self.problem.law.get_or_insert(sampling_law);
        let completed = self.specification(Framework::KnownLaw, None).completed()?.problem;
        (self.problem.contributions, self.problem.utility) = (completed.contributions, completed.utility);
        self.problem.risk_aversion = None;
        self.check_frameworks()?;
        self.complete_mixes()?;
        self.check_own()?;
        if self.frameworks.is_empty() && self.mixes().is_empty() && self.weights.is_empty() {
            return Err(FieldError::new("frameworks", "[]", "must name a framework if there are no constant_mixes"));
        }
        self.check_sizes()?;
        Ok(self)
    }

    fn check_frameworks(&self) -> Result<(), FieldError> {
        for (index, framework) in self.frameworks.iter().enumerate() {
            if self.frameworks[..index].contains(framework) {
                let field = format!("frameworks[{index}]");
                return Err(FieldError::new(field, framework.name(), "must not be named twice"));
            }
            self.specification(*framework, None).completed()?;
        }
        for (framework, policy) in &self.policies {
            let refused = |rule: &str| Err(FieldError::new(format!("policies.{}", framework.name()), policy, rule));
            if !self.frameworks.contains(framework) {
                return refused("must belong to a framework that `frameworks` lists");
            }
            if !self.one_policy_for_all(*framework) {
                return refused(
                    "must be left out if histories are drawn: this framework trains a policy for each history",
                );
            }
        }
        Ok(())
    }

    /// Checks that the user's own strategies have names of their own, and a share of wealth after the history.
    fn check_own(&self) -> Result<(), FieldError> {
        let frameworks = self.frameworks.iter().map(|framework| framework_name(*framework).to_owned());
        check_own_names(self.weights.keys(), frameworks.chain(self.mixes().iter().map(|mix| mix_name(*mix))))?;
        let history = &self.problem.history;
        let sums = ReturnSums::of(history.iter().copied());
        let wanted = |own: &OwnFormula, known| own.wanted(&sums, known, self.problem.rate_per_step);
        parsed(&self.weights)?.iter().try_for_each(|(_, own)| {
            wanted(own, history.len())?;
            // A formula has no value while there are fewer returns than it looks back.
            own.check_fractions((0..=history.len()).filter_map(|known| wanted(own, known).ok()))
        })
    }

    fn complete_mixes(&mut self) -> Result<(), FieldError> {
        let highest = self.problem.action_interval[1];
        let tenths = || (0..=10).map(|tenth| f64::from(tenth) / 10.0).filter(|mix| *mix <= highest).collect();
        let mixes: &Vec<f64> = self.constant_mixes.get_or_insert_with(tenths);
        if mixes.len() > MOST_MIXES {
            let value = format!("{} values", mixes.len());
            return Err(FieldError::new(
                "constant_mixes",
                value,
                format!("must hold at most {MOST_MIXES} allocations"),
            ));
        }
        for (index, mix) in mixes.iter().enumerate() {
            let field = format!("constant_mixes[{index}]");
            within(&field, *mix, 0.0, highest)?;
            if mixes[..index].contains(mix) {
                return Err(FieldError::new(field, mix, "must not be named twice"));
            }
        }
        Ok(())
    }

    fn check_sizes(&self) -> Result<(), FieldError> {
        rules::whole("paths", self.paths, &PATHS)?;
        if let InitialHistories::Drawn { count } = self.histories {
            rules::whole("histories.count", count, &HISTORIES)?;
        }
        if self.history_count().saturating_mul(self.paths).saturating_mul(self.problem.horizon) > STEPS {
            let rule =
                format!("must be smaller: multiplied by histories.count and problem.horizon it may be at most {STEPS}");
            return Err(FieldError::new("paths", self.paths, rule));
        }
        within("level", self.level, LEVEL.0, LEVEL.1)
    }

    /// Returns the number of initial histories.
    pub fn history_count(&self) -> usize {
        match self.histories {
            InitialHistories::Given => 1,
            InitialHistories::Drawn { count } => count,
        }
    }

    /// Returns the constant allocations; none before completion.
    pub fn mixes(&self) -> &[f64] {
        self.constant_mixes.as_deref().unwrap_or_default()
    }

    /// Returns true if a single policy serves every initial history. A framework frozen at its history needs a policy
    /// for each.
    pub fn one_policy_for_all(&self, framework: Framework) -> bool {
        self.histories == InitialHistories::Given || !framework.is_frozen()
    }

    /// Returns the frameworks that are trained once, before the simulation.
    pub fn trainings(&self) -> impl Iterator<Item = Framework> {
        let trained =
            |framework: &Framework| self.one_policy_for_all(*framework) && !self.policies.contains_key(framework);
        self.frameworks.iter().copied().filter(trained)
    }

    /// Returns the number of steps of the job: every backward step of every training, and the simulation.
    pub fn step_count(&self) -> usize {
        self.trainings().count() * self.problem.horizon + 1
    }

    /// Returns the training of a framework. If the framework is frozen at another history than the problem's, `history`
    /// is that one.
    pub fn specification(&self, framework: Framework, history: Option<&[f64]>) -> Specification {
        let mut problem = ProblemSpecification { framework, ..self.problem.clone() };
        let mut design = self.design.clone();
        if framework != Framework::KnownLaw {
            problem.law = None;
        }
        if framework.is_parametric() || framework == Framework::KnownLaw {
            problem.centre = CentreSpecification::default();
        }
        if framework.is_parametric() {
            // The confidence region has the same level.
            problem.radius = self.problem.radius_rule().alpha().map(|alpha| RadiusRule::ChiSquare { alpha });
            problem.support = None;
        }
        if !framework.has_ball() {
            problem.caution = None;
        }
        if !framework.learns() {
            // One input needs no more points: this is the paper's count for a state that is wealth alone.
            design.count = design.count.map(|count| count.min(DEFAULT_COUNT_WEALTH_ALONE));
        }
        if let Some(history) = history {
            problem.history = history.to_vec();
        }
        if self.histories != InitialHistories::Given && framework.learns() {
            design.initial_laws = InitialLaws::Resampled;
        }
        Specification { problem, fund: None, design, surrogate: self.surrogate.clone(), seed: self.seed }
    }

    /// Checks that a policy trained from `found` may replace the training of `framework`.
    ///
    /// # Errors
    /// The first part of the problem that differs, under `policies.<framework>`.
    pub fn accepts(&self, framework: Framework, found: &Specification) -> Result<(), FieldError> {
        let mut wanted = self.specification(framework, None).completed()?.problem;
        wanted.periods_per_year = found.problem.periods_per_year;
        wanted.levels.clone_from(&found.problem.levels);
        if let (Some(RadiusRule::Bridge { correction, .. }), RadiusRule::Bridge { correction: found, .. }) =
            (&mut wanted.radius, found.problem.radius_rule())
        {
            *correction = found;
        }
        if !framework.is_frozen() {
            wanted.history.clone_from(&found.problem.history);
        }
        let field = format!("policies.{}", framework.name());
        let parts = |problem: &ProblemSpecification| {
            serde_json::to_value(problem)
                .map_err(|error| FieldError::new(&field, "a policy", format!("must be JSON: {error}")))
        };
        let (wanted, found) = (parts(&wanted)?, parts(&found.problem)?);
        let keys = wanted.as_object().into_iter().chain(found.as_object()).flat_map(|parts| parts.keys());
        for key in keys {
            if wanted.get(key) != found.get(key) {
                let shown = found.get(key).map_or("absent".into(), |value| format!("{value:.60}"));
                let rule = format!("must have been trained for this problem.{key}");
                return Err(FieldError::new(field, format!("trained for problem.{key} {shown}"), rule));
            }
        }
        Ok(())
    }
}
