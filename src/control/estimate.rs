//! The memory that a job or a policy takes, estimated before it begins.
//!
//! Upper estimates from the sizes in a request alone. Every large object of a training is in one of a few classes; the
//! constants below are the bytes of one of each, found by counting allocator requests. Checked by: `tests/estimates.rs`.

pub mod declared;
mod footprint;

pub use self::footprint::Footprint;
use super::bellman::problem::Problem;
use super::evaluation::assets::AssetsBacktest;
use super::evaluation::backtest::Backtest;
use super::policy::Policy;
use super::policy::prepared_step::{bytes_ready, largest_design, prepared_bytes};
use super::problem::holdings::{HOLDINGS, HOLDINGS_OF_ONE_LAW};
use super::request::completion::DEFAULT_COUNT;
use super::request::evaluation::EvaluationRequest;
use super::request::framework::Framework;
use super::request::frontier::FrontierQuestion;
use super::request::specification::Specification;
use super::surrogate::counts::CANDIDATES_PER_POINT;
use super::surrogate::design::GUARDS;
use super::surrogate::learning::{LAW_BYTES, together};
use super::uncertainty::joint::joint_bytes;
use crate::numerics::bridge::grown;
use crate::numerics::gp::GaussianProcess;

/// Bytes of a double.
const NUMBER: usize = 8;
/// Square matrices of the order of the design that exist at once while both surrogates are fitted side by side: the
/// kernel, which becomes its factor, and the workspace to factor it, each twice.
const FIT_MATRICES: usize = 4;
/// Bytes of a candidate or a guard, with features, scaled inputs and their headers, without the numbers.
const CANDIDATE_BYTES: usize = 160;
/// Bytes of a number of a finished policy: itself, its digits as JSON, and the copies of those for the store.
const POLICY_NUMBER_BYTES: usize = 80;
/// Statistics over all paths that a thread holds in addition to those of the states that it measures together.
const STATISTICS: usize = 8;
/// Numbers for each value of the history that a thread holds while it solves a robust step.
const STEP_NUMBERS: usize = 74;
/// Predictions for each function beyond the first two, if trading costs: at eight trades, while a refined table is
/// built next to the last one.
const TABLES: usize = 16;
const FUNCTIONS_WITHOUT_COST: usize = 2;
/// Bytes of a simulated path: the outcome of a strategy, a step of a framework, and the copies that a report sorts.
const ENDED_BYTES: usize = 80;
const LIVED_BYTES: usize = 48;
const PATH_BYTES: usize = 256;
/// Bytes of a period of a strategy's walk-forward: its decision and account, the series that are resampled, and the
/// report with its digits and the copies for the store.
const DECIDED_BYTES: usize = 1024;
/// Bytes of a share of wealth in one of several assets: itself, that of the strategy's own mix, and the report with its
/// digits and the copies for the store.
const SHARE_BYTES: usize = 160;
/// Atoms of the law from which records are drawn, in addition to those of the record.
const RESAMPLED_VALUES: usize = 4096;
/// Least bytes of any job.
const LEAST: usize = 8 << 20;

/// The sizes that determine the memory of a training.
struct Sizes {
    horizon: usize,
    history: usize,
    /// Atoms of the largest centre.
    atoms: usize,
    count: usize,
    inputs: usize,
    /// Functions that the surrogates of a step predict.
    functions: usize,
    paths: usize,
    /// Bytes of the largest bridges.
    bridges: usize,
}

impl Sizes {
    /// Computes the sizes of a completed specification.
    fn of(specification: &Specification) -> Self {
        let problem = &specification.problem;
        let (horizon, history) = (problem.horizon, problem.history.len());
        let single = !problem.framework.learns() && !problem.depends_on_wealth();
        let count = if single { 1 } else { specification.design.count.unwrap_or(DEFAULT_COUNT) };
        let framed = Problem::new(specification);
        let paths = problem.radius_rule().paths();
        let bridges = framed.laws.radii.heaviest(history, horizon);
        let holdings = framed.holdings(if single { HOLDINGS_OF_ONE_LAW } else { HOLDINGS });
        let functions = holdings.count() + framed.dynamics(0).sides().len();
        let inputs = framed.selection.names().len();
        let atoms = framed.laws.centring.atom_count(history + horizon);
        Sizes { horizon, history, atoms, count, inputs, functions, paths, bridges }
    }

    fn factor(&self) -> usize {
        GaussianProcess::bytes_of(self.count, self.inputs)
    }

    /// Returns the bytes of the finished policy and its documents.
    fn policy(&self) -> usize {
        product(&[self.horizon, self.count, self.inputs + self.functions, POLICY_NUMBER_BYTES])
    }

    /// Returns the bytes of the policy prepared to advise.
    fn prepared(&self) -> usize {
        bytes_ready(self.horizon, self.horizon.saturating_mul(self.count), self.inputs, self.functions)
    }

    /// Returns the bytes while the surrogates of one step are fitted.
    fn fit(&self) -> usize {
        let candidate = 2 * self.inputs * NUMBER + CANDIDATE_BYTES;
        let candidates = product(&[CANDIDATES_PER_POINT * self.count + GUARDS, candidate]);
        product(&[FIT_MATRICES, self.count, self.count, NUMBER]).saturating_add(candidates)
    }

    /// Returns the bytes that threads hold while they solve robust steps.
    fn solving(&self, threads: usize) -> usize {
        let tabulated = TABLES * self.functions.saturating_sub(FUNCTIONS_WITHOUT_COST);
        let solved = product(&[threads, self.atoms, (STEP_NUMBERS + tabulated) * NUMBER]);
        solved.saturating_add(product(&[threads, self.history + self.horizon, self.together(), LAW_BYTES]))
    }

    fn statistics(&self, threads: usize) -> usize {
        let statistics = product(&[threads, self.paths, STATISTICS + self.together(), NUMBER]);
        statistics.saturating_add(product(&[threads, grown::table_bytes(self.history, self.horizon)]))
    }

    /// Returns how many states of a design a thread measures together.
    fn together(&self) -> usize {
        together(self.history + self.horizon, self.paths).min(CANDIDATES_PER_POINT * self.count)
    }
}

/// Returns the footprint of a training of a completed specification on so many threads.
pub fn training(specification: &Specification, threads: usize) -> Footprint {
    let sizes = Sizes::of(specification);
    let fund = specification.fund.as_ref().map_or(0, |fund| joint_bytes(fund.history.len()));
    footprint(&sizes, sizes.solving(threads).saturating_add(LEAST).saturating_add(fund), threads)
}

/// Returns the footprint of a training of these sizes, of which `solving` bytes grow with the history.
fn footprint(sizes: &Sizes, solving: usize, threads: usize) -> Footprint {
    Footprint::of("design.count", sizes.count, sizes.fit())
        .and("problem.horizon", sizes.horizon, sizes.policy())
        .and("problem.radius.paths", sizes.paths, training_keeps(sizes).saturating_add(sizes.statistics(threads)))
        .and("problem.history", sizes.history, solving)
}

/// Returns the bytes of the cache for such a training: the bridges of a sample size and of the next, each at most half.
pub fn kept_by_training(specification: &Specification) -> usize {
    training_keeps(&Sizes::of(specification))
}

fn training_keeps(sizes: &Sizes) -> usize {
    sizes.bridges.saturating_mul(4)
}

/// Returns the footprints of the data that must stay in memory to advise by a policy trained from a completed
/// specification.
pub fn advising(specification: &Specification) -> [Footprint; 3] {
    advising_of(&Sizes::of(specification))
}

fn advising_of(sizes: &Sizes) -> [Footprint; 3] {
    [
        Footprint::of("design.count", sizes.count, sizes.factor()),
        Footprint::of("problem.radius.paths", sizes.paths, sizes.bridges),
        Footprint::of("problem.horizon", sizes.horizon, sizes.prepared()),
    ]
}

/// Returns the memory that advice by a policy takes, including the policy itself.
pub fn advising_by(policy: &Policy) -> [Footprint; 3] {
    let problem = &policy.specification().problem;
    let sizes = Sizes::of(policy.specification());
    let (points, factor) = largest_design(policy.steps());
    [
        Footprint::of("steps", points, factor),
        Footprint::of("specification.problem.radius.paths", sizes.paths, sizes.bridges),
        Footprint::of("specification.problem.horizon", problem.horizon, prepared_bytes(policy)),
    ]
}

/// Returns the footprint of an evaluation of a completed request on so many threads.
pub fn evaluation(request: &EvaluationRequest, threads: usize) -> Footprint {
    let trainings = request.frameworks.iter().filter_map(|&framework| {
        let specification = request.specification(framework, None).completed().ok()?;
        Some((framework, Sizes::of(&specification), training(&specification, threads)))
    });
    let trainings: Vec<(Framework, Sizes, Footprint)> = trainings.collect();
    let most = trainings.iter().map(|(.., estimate)| estimate).max_by_key(|estimate| estimate.bytes());
    // Policies frozen at a history are trained on every thread at once.
    let at_once = |framework: Framework| if request.one_policy_for_all(framework) { 1 } else { threads };
    let policies = trainings.iter().map(|(framework, sizes, _)| sizes.policy().saturating_mul(at_once(*framework)));
    let strategies = request.frameworks.len() + request.mixes().len() + request.weights.len();
    let lived = product(&[request.problem.horizon, request.frameworks.len(), LIVED_BYTES]);
    let outcomes = product(&[request.history_count(), request.paths, strategies * ENDED_BYTES + lived + PATH_BYTES]);
    let (field, value) = trainings.first().map_or(("frameworks", 0), |(_, sizes, _)| ("design.count", sizes.count));
    most.cloned()
        .unwrap_or_else(|| Footprint::of("paths", request.paths, LEAST))
        .and(field, value, policies.fold(kept_by_evaluation(request), usize::saturating_add))
        .and("paths", request.paths, outcomes)
}

/// Returns the bytes of the cache for such an evaluation: every path asks for the factors of all steps in turn.
pub fn kept_by_evaluation(request: &EvaluationRequest) -> usize {
    let followed = request.frameworks.iter().filter_map(|&framework| {
        let sizes = Sizes::of(&request.specification(framework, None).completed().ok()?);
        let sizes_asked_for = if framework.learns() { sizes.horizon + 1 } else { 1 };
        Some((product(&[sizes.horizon, sizes.factor()]), product(&[sizes_asked_for, sizes.bridges])))
    });
    // Bridges are the same for all frameworks that learn.
    let (factors, bridges) = followed
        .fold((0usize, 0usize), |(factors, bridges), (more, own)| (factors.saturating_add(more), bridges.max(own)));
    // Twice the sum, because an entry may take at most half of the cache.
    factors.saturating_add(bridges).saturating_mul(2)
}

/// Returns the footprint of a frontier on so many threads: the bridges of its record, and for each thread a record of
/// its own with its step.
pub fn frontier(question: &FrontierQuestion, threads: usize) -> Footprint {
    let sizes = Sizes::of(&question.fund);
    let values = product(&[question.assets.history.len(), question.assets.assets.len()]);
    let records = product(&[threads + 1, values.saturating_add(RESAMPLED_VALUES), STEP_NUMBERS, NUMBER]);
    let statistics = product(&[threads, sizes.paths, STATISTICS, NUMBER]);
    Footprint::of("problem.history", question.assets.history.len(), records.saturating_add(LEAST)).and(
        "problem.radius.paths",
        sizes.paths,
        kept_by_frontier(question).saturating_add(statistics),
    )
}

/// Returns the bytes of the cache for a frontier: the bridges of its record, at most half.
pub fn kept_by_frontier(question: &FrontierQuestion) -> usize {
    Sizes::of(&question.fund).bridges.saturating_mul(2)
}

/// Returns the footprint of a walk-forward on so many threads.
pub fn backtest(backtest: &Backtest, threads: usize) -> Footprint {
    let (field, returns) = backtest.request.returns();
    // A constant mix is added to the strategies.
    let decided = product(&[returns.len(), backtest.strategies.len() + 1, DECIDED_BYTES]);
    let record = Footprint::of(field, returns.len(), decided.saturating_add(LEAST));
    let Some(sizes) = heaviest(backtest) else { return record };
    let at_once = at_once(backtest, threads);
    let policies = product(&[at_once, sizes.policy().saturating_add(sizes.prepared())]);
    let bridges = training_keeps(&sizes).saturating_mul(at_once).saturating_add(sizes.statistics(threads));
    record.and("count", sizes.count, product(&[at_once, sizes.fit()])).and("horizon", sizes.horizon, policies).and(
        "window",
        sizes.history,
        bridges.saturating_add(sizes.solving(threads)),
    )
}

/// Returns the footprint of a walk-forward of several assets, whose returns are in `field`, on so many threads: the
/// accounts and the report, and for each thread a record with its bridges and its step.
pub fn backtest_of_assets(backtest: &AssetsBacktest, field: &'static str, threads: usize) -> Footprint {
    let periods = backtest.record.rows.len();
    let strategies = backtest.strategies().len();
    let held = product(&[backtest.shares(), SHARE_BYTES]);
    let books = product(&[backtest.lived().len(), strategies, DECIDED_BYTES]);
    let known = backtest.choices.windows.iter().map(|window| window.unwrap_or(periods)).max().unwrap_or_default();
    let steps = product(&[threads, known, backtest.record.assets.len(), STEP_NUMBERS, NUMBER]);
    let bridges = product(&[threads, joint_bytes(known)]);
    let record = held.saturating_add(books).saturating_add(LEAST);
    let solved = Footprint::of(field, periods, record).and(
        "windows",
        backtest.choices.windows.len(),
        steps.saturating_add(bridges),
    );
    let Some((sizes, at_once)) = heaviest_of_assets(backtest, threads) else { return solved };
    let policies = product(&[at_once, sizes.policy().saturating_add(sizes.prepared())]);
    let kept = training_keeps(&sizes).saturating_mul(at_once).saturating_add(sizes.statistics(threads));
    solved.and("count", sizes.count, product(&[at_once, sizes.fit()])).and("horizon", sizes.horizon, policies).and(
        "every",
        backtest.choices.every,
        kept.saturating_add(sizes.solving(threads)),
    )
}

/// Returns the bytes of the cache for such a walk-forward.
pub fn kept_by_backtest_of_assets(backtest: &AssetsBacktest, threads: usize) -> usize {
    heaviest_of_assets(backtest, threads).map_or(0, |(sizes, at_once)| training_keeps(&sizes).saturating_mul(at_once))
}

/// Returns the sizes of the last policy of the longest window, and how many are trained side by side.
fn heaviest_of_assets(backtest: &AssetsBacktest, threads: usize) -> Option<(Sizes, usize)> {
    let walks = backtest.fund_walks();
    let longest = walks.iter().max_by_key(|walk| walk.window.unwrap_or(usize::MAX))?;
    Some((Sizes::of(&longest.last_of_fund()?), threads.min(walks.len())))
}

/// Returns the bytes of the cache for such a walk-forward.
pub fn kept_by_backtest(backtest: &Backtest, threads: usize) -> usize {
    let bridges = heaviest(backtest).map_or(0, |sizes| training_keeps(&sizes));
    bridges.saturating_mul(at_once(backtest, threads))
}

/// Returns the sizes of the most expensive training, which learns and knows the cost.
fn heaviest(backtest: &Backtest) -> Option<Sizes> {
    let past = backtest.periods.get(..backtest.walk.window)?;
    let specification = backtest.walk.specification(Framework::Adaptive, *backtest.request.alpha.first()?, past);
    Some(Sizes::of(&specification.completed().ok()?))
}

/// Returns how many trainings of one policy tenure run side by side.
fn at_once(backtest: &Backtest, threads: usize) -> usize {
    let trained = backtest.strategies.iter().filter(|(_, strategy)| strategy.is_trained()).count();
    threads.min(trained).max(1)
}

fn product(factors: &[usize]) -> usize {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}
