//! Walk-forward of a declared problem: every `every` periods a policy is trained on the window of noises before, from the
//! states reached, and followed until the next training.
//!
//! A session that renews itself does the same, with the same bits (`tests/service/declared_sessions.rs`).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::declared_comparison::leaving;
use crate::control::cache::Cache;
use crate::control::declared_training::DeclaredTraining;
use crate::control::error::{FieldError, TrainError};
use crate::control::estimate::{self, Footprint};
use crate::control::policy::declared::{DeclaredAdvisor, DeclaredPolicy};
use crate::control::pool;
use crate::control::problem::declared::{Declared, EarnedState, FormulaRule};
use crate::control::progress::Watch;
use crate::control::request::declared::DeclaredSpecification;
use crate::control::request::declared_backtest::DeclaredBacktest;
use crate::control::request::framework::Framework;
use crate::control::request::warnings::Warning;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::block_bootstrap::circular_blocks;
use crate::numerics::statistics::summary::{Estimate, quantile};

/// Name and version of the report.
const FORMAT: &str = "ballast-declared-walk-1";
/// Resamples of the periods.
const RESAMPLES: usize = 2000;

/// Policies and rules that lived the same record, policies first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DeclaredWalkReport {
    /// `ballast-declared-walk-1`.
    pub format: String,
    /// The request, with every default filled in.
    pub request: DeclaredBacktest,
    /// One for each framework and each rule.
    pub strategies: Vec<WalkedStrategy>,
}

/// A policy, trained again and again, or a rule, on the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WalkedStrategy {
    /// Name of the framework, or of the rule in the request.
    pub strategy: String,
    /// True for a rule.
    pub is_rule: bool,
    /// Sum of the rewards, discounted to the first period lived.
    pub earned: f64,
    /// Worth of the last states by `end`, or their amount by the utility, not discounted.
    pub left: f64,
    /// Mean gain of a period: its reward, and how much more the states are worth after it, by `end` or as the amount of the
    /// utility. The interval is of resamples of the periods in blocks of `every`.
    pub gain: Estimate,
    /// Gain less that of the first strategy, in the same periods. Null for that strategy itself.
    pub difference: Option<Estimate>,
    /// The periods that the strategy went through, in order.
    pub periods: Vec<WalkedPeriod>,
}

/// A period that a strategy lived.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WalkedPeriod {
    /// States before the noise, by name.
    pub states: BTreeMap<String, f64>,
    /// Actions by name.
    pub actions: BTreeMap<String, f64>,
    /// The noise of the record.
    pub noise: f64,
    /// Earnings of the period by `reward`.
    pub reward: f64,
    /// Radius of the ball of the decision, in the unit of the noise. Null for rules.
    pub radius: Option<f64>,
}

/// The periods from one training of a strategy to the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WalkedStretch {
    periods: Vec<WalkedPeriod>,
    /// The states after the last period.
    states: BTreeMap<String, f64>,
}

/// A walk-forward that is prepared.
pub struct DeclaredWalk {
    request: DeclaredBacktest,
    specification: DeclaredSpecification,
    /// Moves states.
    problem: Declared,
    /// The training of each framework on the first window.
    first: Vec<DeclaredTraining>,
    window: usize,
    every: usize,
    strategies: Vec<(String, Walker)>,
}

/// A strategy.
enum Walker {
    Framework(Framework),
    Rule(FormulaRule),
}

/// Who decides until the next training.
enum Decider<'a> {
    Policy(Box<DeclaredAdvisor>),
    Rule(&'a FormulaRule),
}

impl DeclaredWalk {
    /// Checks and completes a request, and reads its formulas.
    ///
    /// # Errors
    /// A field that breaks its rule, a formula that cannot be read, a window whose noises are all equal.
    pub fn new(request: DeclaredBacktest) -> Result<Self, FieldError> {
        let request = request.completed()?;
        let (window, every) = (request.window.unwrap_or_default(), request.every.unwrap_or_default());
        let specification = request.specification();
        let record = &specification.problem.history;
        let problem = Declared::new(&specification.problem)?;
        for start in (0..record.len() - window).step_by(every) {
            let known = &record[start..start + window];
            if known.iter().all(|noise| *noise == known[0]) {
                let rule = "must have two different values at least in every window";
                let found = format!("{} alone in the {window} from number {} on", known[0], start + 1);
                return Err(FieldError::new("problem.history", found, rule));
            }
        }
        let first = specification.next(record[..window].iter().copied(), None, BTreeMap::new());
        let frameworks = request.frameworks.iter();
        let trainings = frameworks.clone().map(|of| DeclaredTraining::with(&first.under(*of), Cache::default()));
        let trainings = trainings.collect::<Result<Vec<_>, FieldError>>()?;
        let policies = frameworks.map(|of| Ok((of.name().to_owned(), Walker::Framework(*of))));
        let rules = request.rules.iter().map(|(name, formulas)| {
            Ok((name.clone(), Walker::Rule(problem.rule(&format!("rules.{name}"), formulas)?)))
        });
        let strategies = policies.chain(rules).collect::<Result<_, FieldError>>()?;
        Ok(DeclaredWalk { request, specification, problem, first: trainings, window, every, strategies })
    }

    /// Returns the completed request.
    pub fn request(&self) -> &DeclaredBacktest {
        &self.request
    }

    /// Returns the first training of each framework, none of which is longer or larger than these.
    pub fn trainings(&self) -> &[DeclaredTraining] {
        &self.first
    }

    /// Returns the formulas that jump, which may be mistakes.
    pub fn warnings(&self) -> Vec<Warning> {
        self.first.first().map(DeclaredTraining::warnings).unwrap_or_default()
    }

    /// Returns the number of stretches of all strategies, each from one training to the next.
    pub fn step_count(&self) -> usize {
        self.strategies.len() * self.stretches()
    }

    /// Returns the memory that it takes on so many threads.
    pub fn footprint(&self, threads: usize) -> Footprint {
        estimate::declared::walk(&self.first, self.strategies.len() * self.lived().len(), threads)
    }

    fn stretches(&self) -> usize {
        self.lived().len().div_ceil(self.every)
    }

    /// Returns the noises that are lived.
    fn lived(&self) -> &[f64] {
        &self.specification.problem.history[self.window..]
    }

    /// Lives the record with every strategy on the current rayon pool. `stretch` returns one of the
    /// [`Self::step_count`] stretches by its number: as it was found before, or by calling what it is given. Trainings use
    /// `kept` as the cache of recomputable results.
    ///
    /// # Errors
    /// A training that fails, a state that leaves its range, a formula without a value, and the errors of `stretch`.
    pub fn run<E: From<TrainError> + Send>(
        &self,
        kept: &Cache,
        watch: &Watch,
        stretch: impl Fn(usize, &dyn Fn() -> Result<WalkedStretch, TrainError>) -> Result<WalkedStretch, E> + Sync,
    ) -> Result<DeclaredWalkReport, E> {
        let lived = |place: usize| {
            let mut states = self.problem.states_by_name(&self.problem.start());
            let mut periods = Vec::with_capacity(self.lived().len());
            for number in 0..self.stretches() {
                let found =
                    stretch(place * self.stretches() + number, &|| self.stretch(place, number, &states, kept, watch))?;
                states = found.states;
                periods.extend(found.periods);
            }
            Ok((periods, states))
        };
        let lived: Vec<_> =
            pool::map((0..self.strategies.len()).collect(), lived).into_iter().collect::<Result<_, E>>()?;
        Ok(self.report(lived).map_err(TrainError::from)?)
    }

    /// Lives the periods of a strategy from one training to the next.
    fn stretch(
        &self,
        place: usize,
        number: usize,
        states: &BTreeMap<String, f64>,
        kept: &Cache,
        watch: &Watch,
    ) -> Result<WalkedStretch, TrainError> {
        let record = &self.specification.problem.history;
        let from = self.window + number * self.every;
        let (known, noises) = (&record[..from], &record[from..record.len().min(from + self.every)]);
        let (name, walker) = &self.strategies[place];
        let decider = match walker {
            Walker::Rule(rule) => Decider::Rule(rule),
            Walker::Framework(framework) => {
                let next = self.specification.next(known.iter().copied(), Some(self.window), states.clone());
                let training = DeclaredTraining::with(&next.under(*framework), kept.clone())?;
                let steps = training.run(watch)?;
                let policy = DeclaredPolicy::new(&training, steps);
                Decider::Policy(Box::new(policy.prepared(kept.clone())?))
            }
        };
        let field = match walker {
            Walker::Rule(_) => format!("rules.{name}"),
            Walker::Framework(_) => "frameworks".to_owned(),
        };
        let (mut state, mut seen) = (self.problem.state("state", states)?, Vec::with_capacity(noises.len()));
        let mut periods = Vec::with_capacity(noises.len());
        for (step, noise) in noises.iter().enumerate() {
            watch.go_on()?;
            let scaled = self.problem.scaled(*noise);
            let (actions, radius) = decider.decide(&self.problem, step, &state, &seen)?;
            let (values, reward) = self.problem.passed(step, &state, &actions, scaled);
            let no_number = |fault: FieldError| {
                FieldError::new(&field, name, format!("must have rewards that are numbers, but {fault}"))
            };
            periods.push(WalkedPeriod {
                states: self.problem.states_by_name(&state),
                actions: self.problem.actions_by_name(&actions),
                noise: *noise,
                reward: reward.map_err(no_number)?,
                radius,
            });
            state = EarnedState { values: values.map_err(|fault| leaving(&field, name, &fault))?, earned: 0.0 };
            seen.push(scaled);
        }
        Ok(WalkedStretch { periods, states: self.problem.states_by_name(&state) })
    }

    fn report(&self, lived: Vec<(Vec<WalkedPeriod>, BTreeMap<String, f64>)>) -> Result<DeclaredWalkReport, FieldError> {
        let gains: Vec<Vec<f64>> = lived.iter().map(|lived| self.gains(lived)).collect::<Result<_, FieldError>>()?;
        let apart = |own: &Vec<f64>| own.iter().zip(&gains[0]).map(|(own, first)| own - first).collect();
        let differences: Vec<Vec<f64>> = gains.iter().map(apart).collect();
        let [of_gains, of_differences] = [&gains, &differences].map(|series| self.means(series));
        let strategies = self.strategies.iter().zip(lived).enumerate().map(|(place, ((name, walker), lived))| {
            let (periods, states) = lived;
            let discounted = |(index, period): (usize, &WalkedPeriod)| self.problem.discounted(index) * period.reward;
            Ok(WalkedStrategy {
                strategy: name.clone(),
                is_rule: matches!(walker, Walker::Rule(_)),
                earned: periods.iter().enumerate().map(discounted).sum(),
                left: self.problem.end_worth(&self.problem.state("state", &states)?),
                gain: of_gains[place],
                difference: (place > 0).then(|| of_differences[place]),
                periods,
            })
        });
        let strategies = strategies.collect::<Result<_, FieldError>>()?;
        Ok(DeclaredWalkReport { format: FORMAT.to_owned(), request: self.request.clone(), strategies })
    }

    /// Returns the gain of each period.
    fn gains(&self, (periods, last): &(Vec<WalkedPeriod>, BTreeMap<String, f64>)) -> Result<Vec<f64>, FieldError> {
        let worth = |states: &BTreeMap<String, f64>| Ok(self.problem.end_worth(&self.problem.state("state", states)?));
        let states = periods.iter().map(|period| &period.states).chain([last]);
        let worths = states.map(worth).collect::<Result<Vec<f64>, FieldError>>()?;
        Ok(periods.iter().zip(worths.windows(2)).map(|(period, worth)| period.reward + worth[1] - worth[0]).collect())
    }

    /// Returns the mean of each series with its interval: the mean less the quantiles of what resamples have more, which are
    /// common to all series. Streams: ("walked", 0, draw).
    fn means(&self, series: &[Vec<f64>]) -> Vec<Estimate> {
        let (periods, seed) = (self.lived().len(), self.request.seed);
        let mean = |of: &mut dyn Iterator<Item = f64>| of.sum::<f64>() / periods as f64;
        let mut resampled = vec![Vec::with_capacity(RESAMPLES); series.len()];
        for draw in 0..RESAMPLES {
            let drawn = circular_blocks(periods, self.every, &mut stream(seed, "walked", 0, draw));
            for (means, values) in resampled.iter_mut().zip(series) {
                means.push(mean(&mut drawn.iter().map(|index| values[*index])));
            }
        }
        let beyond = 0.5 * (1.0 - self.request.level);
        let estimate = |(values, resampled): (&Vec<f64>, &Vec<f64>)| {
            let value = mean(&mut values.iter().copied());
            let end = |share: f64| 2.0 * value - quantile(resampled, share);
            Estimate { value, low: end(1.0 - beyond), high: end(beyond) }
        };
        series.iter().zip(&resampled).map(estimate).collect()
    }
}

impl Decider<'_> {
    /// Returns the actions at a state, and the radius if there is one.
    fn decide(
        &self,
        problem: &Declared,
        step: usize,
        state: &EarnedState,
        seen: &[f64],
    ) -> Result<(Vec<f64>, Option<f64>), FieldError> {
        match self {
            Decider::Rule(rule) => Ok((problem.ruled(rule, step, state)?, None)),
            Decider::Policy(advisor) => {
                let decided = advisor.advise(step, state, seen, 1.0)?;
                Ok((decided.actions.into_values().collect(), Some(decided.radius)))
            }
        }
    }
}
