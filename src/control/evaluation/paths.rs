//! Strategies compared on common random numbers.
//!
//! Path p of history h has the same returns under every strategy: the stream ("evaluate-path", h, p) of the seed. The
//! drawn histories are the streams ("evaluate-history", h, 0). Strategies act through the same calls as live sessions.
//! For any number of threads, outcomes are collected in the order of histories and paths.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::control::cache::Cache;
use crate::control::error::{FieldError, TrainError};
use crate::control::evaluation::account::{PathOutcome, mix_ended};
use crate::control::evaluation::own::ended_on_path;
use crate::control::policy::advice::AdviceSource;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::own_formula::OwnFormula;
use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::evaluation::{EvaluationRequest, InitialHistories};
use crate::control::request::framework::Framework;
use crate::control::request::own_weights::parsed;
use crate::control::request::rules;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::Specification;
use crate::control::training::Training;
use crate::control::uncertainty::centre::{Centring, record};
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::law_distance::{LawDistance, Placed, distance_of_samples};
use crate::numerics::machine::streams::stream;

/// Progress is reported about this often.
const REPORTS: usize = 100;

/// A prepared comparison: the completed request, the true law, the initial histories.
pub struct Evaluation {
    /// The completed request.
    pub request: EvaluationRequest,
    /// The log-returns that each group of paths starts from.
    pub histories: Vec<Vec<f64>>,
    /// The user's own strategies by name.
    pub own: Vec<(String, OwnFormula)>,
    law: ContinuousLaw,
    kept: Cache,
}

/// One step of a framework on one path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lived {
    /// Share of wealth held in the risky asset.
    pub allocation: f64,
    /// Radius of the uncertainty set, in the unit of an advice's radius.
    pub radius: f64,
    /// Distance from the centre of its ball to the true law.
    pub distance: f64,
    /// Distance from the centre of its ball to that of the path's first ball.
    pub moved: f64,
    /// True if the advice was solved anew.
    pub resolved: bool,
}

/// One path: the result of every strategy, and every step of every framework, framework by framework.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Results strategy by strategy: frameworks, constant mixes, and the user's own.
    pub ended: Vec<PathOutcome>,
    /// Steps of each framework, one framework after another.
    pub lived: Vec<Lived>,
}

/// The starting point of all paths of one history.
#[derive(Debug, Clone, PartialEq)]
pub struct HistoryStart {
    /// The bridge quantile there, if the radius rule uses bridges.
    pub quantile: Option<f64>,
    /// Radius of the first framework with a ball, in log-return; 0 if there is none.
    pub radius: f64,
    /// Certainty equivalent of each framework's first advice.
    pub promised: Vec<f64>,
}

/// Everything simulated: `outcomes` holds the paths of the first history, then those of the second, and so on.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcomes {
    /// Starting points, history by history.
    pub starts: Vec<HistoryStart>,
    /// Outcomes path by path, history by history.
    pub outcomes: Vec<Outcome>,
    /// Seconds spent on re-solved steps; all else is the same for the same request.
    pub resolve_seconds: f64,
}

/// A framework and, if all histories share one, its policy.
pub struct Follower {
    /// The framework it follows.
    pub framework: Framework,
    /// The shared policy; none if each history has its own.
    pub advisor: Option<Advisor>,
}

impl Evaluation {
    /// Completes and checks the request, and draws the histories.
    ///
    /// # Errors
    /// A field that breaks its rule.
    pub fn new(request: EvaluationRequest) -> Result<Self, FieldError> {
        let request = request.completed()?;
        let law = true_law(&request);
        let histories = match request.histories {
            InitialHistories::Given => vec![request.problem.history.clone()],
            InitialHistories::Drawn { count } => (0..count).map(|index| drawn_history(&request, &law, index)).collect(),
        };
        Ok(Evaluation { own: parsed(&request.weights)?, request, histories, law, kept: Cache::default() })
    }

    /// Uses the cache `kept`.
    pub fn keeping(self, kept: Cache) -> Self {
        Evaluation { kept, ..self }
    }

    /// As [`Self::new`], but starts from these histories instead of drawing them.
    ///
    /// # Errors
    /// A field or a history that breaks its rule.
    pub fn starting_at(mut request: EvaluationRequest, histories: Vec<Vec<f64>>) -> Result<Self, FieldError> {
        request.histories = InitialHistories::Drawn { count: histories.len() };
        let request = request.completed()?;
        for (index, history) in histories.iter().enumerate() {
            rules::history(&format!("histories[{index}]"), history, request.problem.learning)?;
            if history.len() != request.problem.history.len() {
                let value = format!("{} values", history.len());
                let rule = "must be as long as problem.history";
                return Err(FieldError::new(format!("histories[{index}]"), value, rule));
            }
        }
        let (own, law) = (parsed(&request.weights)?, true_law(&request));
        Ok(Evaluation { own, law, request, histories, kept: Cache::default() })
    }

    /// Returns a framework with its policy, trained on the current pool, or without one if each history has its own.
    ///
    /// # Errors
    /// As [`Training::solve_step`].
    pub fn follower(&self, framework: Framework, watch: &Watch) -> Result<Follower, TrainError> {
        let advisor = match self.request.one_policy_for_all(framework) {
            true => Some(self.trained(&self.request.specification(framework, None), watch)?),
            false => None,
        };
        Ok(Follower { framework, advisor })
    }

    fn trained(&self, specification: &Specification, watch: &Watch) -> Result<Advisor, TrainError> {
        let policy = Training::with(specification, self.kept.clone())?.run(watch)?;
        Ok(Advisor::with(policy, self.kept.clone()))
    }

    /// Draws the returns of a path.
    pub fn returns(&self, history: usize, path: usize) -> Vec<f64> {
        let problem = &self.request.problem;
        let mut generator = stream(self.request.seed, "evaluate-path", history, path);
        (0..problem.horizon).map(|_| admissible(self.law.draw(&mut generator), problem)).collect()
    }

    /// Simulates every strategy on every path, on the current pool. `followers` are in the order of the request's
    /// frameworks; `clock` returns seconds.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal; any error from training a frozen framework.
    pub fn simulate(
        &self,
        followers: &[Follower],
        watch: &Watch,
        clock: &(dyn Fn() -> f64 + Sync),
    ) -> Result<Outcomes, TrainError> {
        let problem = &self.request.problem;
        let first = problem.history.len();
        let centring = Centring::of(problem);
        let sizes = (first..first + problem.horizon).filter(|_| centring.is_empirical());
        let distances = LawDistance::new(self.law.clone(), problem.learning.retention(), sizes);
        let (periods, done) = (Dynamics::of(&self.request.problem), AtomicUsize::new(0));
        let simulator = Simulator { evaluation: self, followers, watch, clock, periods, centring, distances, done };
        let found: Result<Vec<_>, TrainError> =
            (0..self.histories.len()).into_par_iter().map(|history| simulator.history(history)).collect();
        let mut all = Outcomes { starts: Vec::new(), outcomes: Vec::new(), resolve_seconds: 0.0 };
        for (start, outcomes) in found? {
            all.starts.push(start);
            for (outcome, seconds) in outcomes {
                all.resolve_seconds += seconds;
                all.outcomes.push(outcome);
            }
        }
        Ok(all)
    }
}

fn true_law(request: &EvaluationRequest) -> ContinuousLaw {
    let law = request.problem.law.as_ref().unwrap_or(&SamplingLaw::Bootstrap {});
    continuous_law(law, &request.problem)
}

/// Draws history `index` from the true law of a completed request.
pub fn drawn_history(request: &EvaluationRequest, law: &ContinuousLaw, index: usize) -> Vec<f64> {
    let mut generator = stream(request.seed, "evaluate-history", index, 0);
    request.problem.history.iter().map(|_| admissible(law.draw(&mut generator), &request.problem)).collect()
}

/// The inputs of a simulation.
struct Simulator<'a> {
    evaluation: &'a Evaluation,
    followers: &'a [Follower],
    watch: &'a Watch<'a>,
    clock: &'a (dyn Fn() -> f64 + Sync),
    periods: Vec<Dynamics>,
    centring: Centring,
    distances: LawDistance,
    done: AtomicUsize,
}

/// The paths of one history, with the seconds that each spent on re-solved steps.
type Paths = Vec<(Outcome, f64)>;

impl Simulator<'_> {
    fn history(&self, index: usize) -> Result<(HistoryStart, Paths), TrainError> {
        let history = self.evaluation.histories[index].as_slice();
        let own = self.own_advisors(history)?;
        let advisors: Vec<&Advisor> = self
            .followers
            .iter()
            .zip(&own)
            .filter_map(|(follower, own)| follower.advisor.as_ref().or(own.as_ref()))
            .collect();
        let assumed = self.centring.assumed().iter().map(|&(atom, weight)| self.distances.place(atom, weight));
        let mut sample: Vec<Placed> = assumed.collect();
        let seen = record(history, &self.evaluation.request.problem);
        seen.into_iter().for_each(|value| self.learn(&mut sample, value));
        let paths = 0..self.evaluation.request.paths;
        let outcomes: Result<Paths, TrainError> =
            paths.into_par_iter().map(|path| self.path(index, path, &advisors, &sample)).collect();
        Ok((start(&advisors, history)?, outcomes?))
    }

    /// Trains the policies of the frameworks that are frozen at this history.
    fn own_advisors(&self, history: &[f64]) -> Result<Vec<Option<Advisor>>, TrainError> {
        let silent = Watch { stop: self.watch.stop, progress: &|_| {} };
        let own = |follower: &Follower| {
            if follower.advisor.is_some() {
                return Ok(None);
            }
            let specification = self.evaluation.request.specification(follower.framework, Some(history));
            self.evaluation.trained(&specification, &silent).map(Some)
        };
        self.followers.iter().map(own).collect()
    }

    fn path(
        &self,
        history: usize,
        path: usize,
        advisors: &[&Advisor],
        sample: &[Placed],
    ) -> Result<(Outcome, f64), TrainError> {
        self.watch.go_on()?;
        let problem = &self.evaluation.request.problem;
        let returns = self.evaluation.returns(history, path);
        let distances = self.distances_along(sample, &returns);
        let mut outcome = Outcome { ended: Vec::new(), lived: Vec::with_capacity(advisors.len() * returns.len()) };
        let mut seconds = 0.0;
        for advisor in advisors {
            let ended = self.follow(advisor, history, &returns, &distances, &mut outcome.lived, &mut seconds)?;
            outcome.ended.push(ended);
        }
        for &mix in self.evaluation.request.mixes() {
            outcome.ended.push(mix_ended(&self.periods, problem.initial_wealth, mix, &returns));
        }
        let Evaluation { own, histories, .. } = self.evaluation;
        outcome.ended.extend(ended_on_path(own, problem, &self.periods, &histories[history], &returns)?);
        self.report_path();
        Ok((outcome, seconds))
    }

    /// Adds a return to the sample from which the centre's distance is computed.
    fn learn(&self, sample: &mut Vec<Placed>, log_return: f64) {
        let spread = self.centring.spread(log_return).map(|(atom, mass)| self.distances.place(atom, mass));
        self.distances.learn(sample, spread);
    }

    /// Returns the distances of the centre to the true law and to the first centre, before each return.
    fn distances_along(&self, first: &[Placed], returns: &[f64]) -> Vec<[f64; 2]> {
        let mut sample = first.to_vec();
        let before = |&log_return: &f64| {
            let distances = [self.distances.distance(&sample), distance_of_samples(first, &sample)];
            self.learn(&mut sample, log_return);
            distances
        };
        returns.iter().map(before).collect()
    }

    /// Simulates one framework on a path and returns its result.
    fn follow(
        &self,
        advisor: &Advisor,
        history: usize,
        returns: &[f64],
        distances: &[[f64; 2]],
        lived: &mut Vec<Lived>,
        seconds: &mut f64,
    ) -> Result<PathOutcome, TrainError> {
        let start = advisor.initial_state(Some(&self.evaluation.histories[history]), None)?;
        let moves = advisor.specification().problem.framework.learns();
        let mut walk = advisor.walk(start, returns);
        let mut ended = PathOutcome::at(walk.state.wealth);
        for (step, dynamics) in self.periods.iter().enumerate().take(returns.len()) {
            self.watch.go_on()?;
            let started = (self.clock)();
            let Some(advice) = walk.next() else { break };
            let resolved = advice.source != AdviceSource::PolicySurrogate;
            if resolved {
                *seconds += (self.clock)() - started;
            }
            let [distance, moved] = distances[if moves { step } else { 0 }];
            lived.push(Lived { allocation: advice.allocation, radius: advice.radius, distance, moved, resolved });
            ended = ended.after(walk.state.wealth, dynamics.contribution);
        }
        Ok(ended)
    }

    fn report_path(&self) {
        let total = self.evaluation.histories.len() * self.evaluation.request.paths;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if done.is_multiple_of((total / REPORTS).max(1)) || done == total {
            (self.watch.progress)(StepProgress { step: 0, phase: Phase::Simulating, done, total });
        }
    }
}

/// Returns the quantile and radius of the first framework with a ball at a history, and the certainty equivalents
/// promised there.
fn start(advisors: &[&Advisor], history: &[f64]) -> Result<HistoryStart, TrainError> {
    let mut start = HistoryStart { quantile: None, radius: 0.0, promised: Vec::with_capacity(advisors.len()) };
    for advisor in advisors {
        let state = advisor.initial_state(Some(history), None)?;
        start.promised.push(advisor.advise(0, &state, AdviceMode::Surrogate).certainty_equivalent);
        let uncertainty = advisor.uncertainty(&state);
        if start.radius <= 0.0 {
            (start.quantile, start.radius) = (uncertainty.quantile, uncertainty.radius);
        }
    }
    Ok(start)
}
