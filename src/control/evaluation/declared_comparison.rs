//! Policies of a declared problem and rules, simulated side by side on common noises.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use rand::RngExt;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::cache::Cache;
use crate::control::declared_training::DeclaredTraining;
use crate::control::error::{FieldError, TrainError};
use crate::control::estimate::{self, Footprint};
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::problem::controlled::Controlled;
use crate::control::problem::declared::{Declared, EarnedState, FormulaRule};
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::declared::DeclaredProblem;
use crate::control::request::declared_comparison::DeclaredComparison;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::{Clustered, Estimate};

/// Name and version of the report.
const FORMAT: &str = "ballast-comparison-1";
/// Share of the paths that count as the worst.
const WORST: f64 = 0.05;
/// Step of a mean, relative to its size, over which the slope of a certainty equivalent is taken.
const SLOPE_STEP: f64 = 1e-6;

/// Policies trained before, policies trained here, and rules, in this order; each in that of its names or frameworks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ComparisonReport {
    /// `ballast-comparison-1`.
    pub format: String,
    /// The request.
    pub request: DeclaredComparison,
    /// The declaration, of the first policy if the request has none.
    pub problem: DeclaredProblem,
    /// One for each policy and each rule.
    pub strategies: Vec<ComparedStrategy>,
}

/// A policy or a rule on all paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ComparedStrategy {
    /// Name in the request.
    pub strategy: String,
    /// True for a rule.
    pub is_rule: bool,
    /// Mean worth of a path; with a utility, the certainty equivalent of the amount at the end.
    pub value: Estimate,
    /// Value less that of the first policy, on the same paths. Null for that policy itself.
    pub difference: Option<Estimate>,
    /// Mean worth of the worst twentieth of the paths.
    pub worst_twentieth: Estimate,
    /// Worth against the worst law, as the first decision of a policy says it. Null for rules.
    pub robust_value: Option<f64>,
    /// Means over all paths, period by period.
    pub periods: Vec<ComparedPeriod>,
}

/// Means of a period over all paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ComparedPeriod {
    /// States before the noise, by name.
    pub states: BTreeMap<String, f64>,
    /// Actions by name.
    pub actions: BTreeMap<String, f64>,
}

/// A strategy.
enum Player {
    Policy(Arc<DeclaredAdvisor>),
    Rule(FormulaRule),
}

/// A state, and the noises that were seen on the way to it.
#[derive(Clone)]
struct Reached {
    state: EarnedState,
    /// In the unit of the solver.
    seen: Vec<f64>,
}

/// A comparison that is prepared.
pub struct Comparison {
    request: DeclaredComparison,
    declared: DeclaredProblem,
    problem: Declared,
    /// Policies trained before.
    policies: Vec<(String, Player)>,
    /// The policies to train first, in the order of their frameworks.
    trained: Vec<(String, DeclaredTraining)>,
    rules: Vec<(String, Player)>,
}

/// A strategy on all paths.
struct Simulated {
    worths: Vec<f64>,
    periods: Vec<ComparedPeriod>,
    robust_value: Option<f64>,
}

impl Comparison {
    /// Prepares a comparison with the policies of the request that were trained before, in the order of their names.
    ///
    /// # Errors
    /// A field that breaks its rule, a formula that cannot be read, policies of different problems.
    pub fn new(request: DeclaredComparison, policies: Vec<Arc<DeclaredAdvisor>>) -> Result<Self, FieldError> {
        let request = request.completed()?;
        let first = policies.first().map(|first| &first.policy().specification().problem);
        let declared = request.problem.as_ref().or(first).cloned();
        let declared = declared.ok_or_else(|| FieldError::new("policies", "{}", "must have one at least"))?;
        let problem = Declared::new(&declared)?;
        request.check_decisions(declared.horizon)?;
        for ((name, id), policy) in request.policies.iter().zip(&policies) {
            if !policy.policy().specification().problem.is_alike(&declared) {
                let of = if request.problem.is_some() { "`problem`" } else { "the problem of the first policy" };
                let rule = format!("must be of {of}, except for framework, radius and learning");
                return Err(FieldError::new(format!("policies.{name}"), id, rule));
            }
        }
        let mut trained = Vec::with_capacity(request.frameworks.len());
        if let Some(declared) = request.specification() {
            for framework in &request.frameworks {
                let training = DeclaredTraining::with(&declared.under(*framework), Cache::default())?;
                trained.push((framework.name().to_owned(), training));
            }
        }
        let rule = |(name, formulas): (&String, &BTreeMap<String, String>)| {
            Ok((name.clone(), Player::Rule(problem.rule(&format!("rules.{name}"), formulas)?)))
        };
        let rules: Vec<(String, Player)> = request.rules.iter().map(rule).collect::<Result<_, FieldError>>()?;
        let policies = request.policies.keys().cloned().zip(policies.into_iter().map(Player::Policy)).collect();
        Ok(Comparison { request, declared, problem, policies, trained, rules })
    }

    /// Returns the trainings that come before the simulation, in the order of their frameworks.
    pub fn trainings(&self) -> impl Iterator<Item = &DeclaredTraining> {
        self.trained.iter().map(|(_, training)| training)
    }

    /// Returns the number of steps of all trainings, and one for the simulation.
    pub fn step_count(&self) -> usize {
        self.trained.len() * (self.declared.horizon - 1) + 1
    }

    /// Returns the request.
    pub fn request(&self) -> &DeclaredComparison {
        &self.request
    }

    /// Returns the memory that the simulation takes.
    pub fn footprint(&self) -> Footprint {
        let bytes = |(_, player): &(String, Player)| match player {
            Player::Policy(advisor) => advisor.bytes(),
            Player::Rule(_) => 0,
        };
        let policies = self.policies.iter().map(bytes).sum();
        let strategies = self.policies.len() + self.trained.len() + self.rules.len();
        let trainings: Vec<&DeclaredTraining> = self.trainings().collect();
        estimate::declared::comparison(self.request.paths, strategies, self.declared.horizon, policies, &trainings)
    }

    /// Simulates every strategy on the current rayon pool, given the policies of the trainings in their order. Noises are
    /// drawn from the history, each value as likely as any other. Streams: ("compared", step, path). Cost: a robust step for each policy at each
    /// state that differs from all others. Checked by: `tests/solver/declared_comparison.rs`.
    ///
    /// # Errors
    /// A state that leaves its range, a formula without a value; [`TrainError::Stopped`] soon after the stop signal.
    pub fn run(&self, trained: Vec<Arc<DeclaredAdvisor>>, watch: &Watch) -> Result<ComparisonReport, TrainError> {
        let trained: Vec<(String, Player)> =
            self.trained.iter().map(|(name, _)| name.clone()).zip(trained.into_iter().map(Player::Policy)).collect();
        let players: Vec<&(String, Player)> = self.policies.iter().chain(&trained).chain(&self.rules).collect();
        let (paths, horizon, history) = (self.request.paths, self.declared.horizon, &self.declared.history);
        let drawn = |step: usize, path: usize| {
            history[stream(self.request.seed, "compared", step, path).random_range(0..history.len())]
        };
        let noises = (0..horizon).map(|step| (0..paths).map(|path| drawn(step, path)).collect());
        let noises: Vec<Vec<f64>> = noises.collect();
        let simulated = players.iter().enumerate().map(|(place, player)| {
            let progress = |at: StepProgress| {
                let (done, all) = (place * at.total + at.done, players.len() * at.total);
                (watch.progress)(StepProgress { done, total: all, ..at });
            };
            self.simulated(player, &noises, &Watch { progress: &progress, ..*watch })
        });
        let simulated = simulated.collect::<Result<Vec<Simulated>, TrainError>>()?;
        let statistics = Clustered::new(1, paths, self.request.level);
        let compared = |(place, own): (usize, &Simulated)| ComparedStrategy {
            strategy: players[place].0.clone(),
            is_rule: matches!(players[place].1, Player::Rule(_)),
            value: self.value(statistics, &own.worths),
            difference: (place > 0).then(|| self.difference(statistics, &own.worths, &simulated[0].worths)),
            worst_twentieth: statistics.lowest(&own.worths, WORST),
            robust_value: own.robust_value,
            periods: own.periods.clone(),
        };
        Ok(ComparisonReport {
            format: FORMAT.to_owned(),
            request: self.request.clone(),
            problem: self.declared.clone(),
            strategies: simulated.iter().enumerate().map(compared).collect(),
        })
    }

    /// Follows a strategy through all paths, period by period.
    fn simulated(
        &self,
        (name, player): &(String, Player),
        noises: &[Vec<f64>],
        watch: &Watch,
    ) -> Result<Simulated, TrainError> {
        // A state that leaves its range is the fault of this strategy.
        let problem = self.problem.afresh();
        let start = Reached { state: problem.start(), seen: Vec::new() };
        let mut reached = vec![start; self.request.paths];
        let horizon = noises.len();
        let mut periods = Vec::with_capacity(horizon);
        for (step, noises) in noises.iter().enumerate() {
            let (done, total) = (step * self.request.paths, horizon * self.request.paths);
            (watch.progress)(StepProgress { step: 0, phase: Phase::Simulating, done, total });
            let actions = player.actions(&problem, step, &reached, watch)?;
            periods.push(self.means(&reached, &actions));
            for ((at, actions), noise) in reached.iter_mut().zip(&actions).zip(noises) {
                let scaled = problem.checked_noise("noises", *noise)?;
                at.state = problem.next(step, &at.state, actions, scaled);
                at.seen.push(scaled);
            }
            if let Some(fault) = problem.fault() {
                let field = match player {
                    Player::Rule(_) => format!("rules.{name}"),
                    Player::Policy(_) if self.request.policies.contains_key(name) => format!("policies.{name}"),
                    Player::Policy(_) => "frameworks".to_owned(),
                };
                return Err(leaving(&field, name, fault).into());
            }
        }
        let worths = reached.iter().map(|at| problem.baseline(horizon, &at.state)).collect();
        let robust_value = match player {
            Player::Policy(advisor) => Some(advisor.decide(1, None, &[])?.value),
            Player::Rule(_) => None,
        };
        Ok(Simulated { worths, periods, robust_value })
    }

    fn means(&self, reached: &[Reached], actions: &[Vec<f64>]) -> ComparedPeriod {
        let mean = |of: &dyn Fn(usize) -> f64| (0..reached.len()).map(of).sum::<f64>() / reached.len() as f64;
        let (states, named) = (self.problem.states_named(), self.problem.actions_named());
        let of_states = states
            .iter()
            .enumerate()
            .map(|(place, name)| (name.clone(), mean(&|path| reached[path].state.values[place])));
        let of_actions =
            named.iter().enumerate().map(|(place, name)| (name.clone(), mean(&|path| actions[path][place])));
        ComparedPeriod { states: of_states.collect(), actions: of_actions.collect() }
    }

    /// Returns the utility of each worth, relative to the start.
    fn utilities(&self, worths: &[f64]) -> Vec<f64> {
        worths.iter().map(|worth| self.problem.utility(*worth, self.from())).collect()
    }

    /// Returns the amount to which worths are compared.
    fn from(&self) -> f64 {
        self.problem.baseline(0, &self.problem.start())
    }

    fn certain(&self, utility: f64) -> f64 {
        self.problem.certainty_equivalent(utility, self.from())
    }

    fn value(&self, statistics: Clustered, worths: &[f64]) -> Estimate {
        statistics.mean(&self.utilities(worths)).mapped(|utility| self.certain(utility))
    }

    /// Returns the difference of two values by the delta method: each utility is weighted by the slope of the certainty
    /// equivalent at its own mean.
    fn difference(&self, statistics: Clustered, own: &[f64], other: &[f64]) -> Estimate {
        let [own, other] = [own, other].map(|worths| self.utilities(worths));
        let [mean, other_mean] = [&own, &other].map(|utilities| statistics.mean(utilities).value);
        let slope = |mean: f64| {
            let reach = SLOPE_STEP * mean.abs().max(SLOPE_STEP);
            (self.certain(mean + reach) - self.certain(mean - reach)) / (2.0 * reach)
        };
        let (weight, other_weight) = (slope(mean), slope(other_mean));
        let apart = own.iter().zip(&other).map(|(own, other)| weight * own - other_weight * other);
        let found = statistics.mean(&apart.collect::<Vec<f64>>());
        let value = self.certain(mean) - self.certain(other_mean);
        Estimate { value, low: value + found.low - found.value, high: value + found.high - found.value }
    }
}

/// Returns the fault of a strategy, named in a field, that leads a state out of its range.
pub(super) fn leaving(field: &str, name: &str, fault: &FieldError) -> FieldError {
    FieldError::new(field, name, format!("must not lead out of a range, but {fault}"))
}

impl Player {
    /// Returns the actions of a step at every state.
    fn actions(
        &self,
        problem: &Declared,
        step: usize,
        reached: &[Reached],
        watch: &Watch,
    ) -> Result<Vec<Vec<f64>>, TrainError> {
        let advisor = match self {
            Player::Policy(advisor) => advisor,
            Player::Rule(rule) => {
                let ruled = reached.iter().map(|at| problem.ruled(rule, step, &at.state));
                return Ok(ruled.collect::<Result<_, FieldError>>()?);
            }
        };
        // Paths that are at one state have one decision.
        let (mut places, mut different) = (HashMap::new(), Vec::new());
        let place = |at: &Reached| {
            *places.entry(at.key(advisor)).or_insert_with(|| {
                different.push(at.clone());
                different.len() - 1
            })
        };
        let places: Vec<usize> = reached.iter().map(place).collect();
        let decide = |at: &Reached| {
            watch.go_on()?;
            Ok(advisor.solved(problem, step, &at.state, &at.seen)?.actions)
        };
        let decided: Vec<Vec<f64>> = different.par_iter().map(decide).collect::<Result<_, TrainError>>()?;
        Ok(places.into_iter().map(|place| decided[place].clone()).collect())
    }
}

impl Reached {
    /// Returns the bits of all that a decision depends on.
    fn key(&self, advisor: &DeclaredAdvisor) -> Vec<u64> {
        let seen: &[f64] = if advisor.specification().problem.framework.learns() { &self.seen } else { &[] };
        self.state.values.iter().chain(seen).map(|value| value.to_bits()).collect()
    }
}
