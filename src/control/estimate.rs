//! How much memory a job or a policy takes, before it is begun.
//!
//! Upper estimates from the sizes in a request alone. Every large thing of a training is in one of a few classes, and
//! the constants below are what one thing of each takes, found by counting what the allocator was asked for
//! (`tests/estimates.rs` holds the estimates to it).

use super::assets::advising::FACTOR_PATHS;
use super::bellman::problem::Problem;
use super::evaluation::assets::AssetsBacktest;
use super::evaluation::backtest::Backtest;
use super::policy::Policy;
use super::policy::prepared::{bytes_ready, factor_bytes, prepared_bytes};
use super::problem::holdings::{HOLDINGS, HOLDINGS_OF_ONE_LAW};
use super::request::completion::DEFAULT_COUNT;
use super::request::evaluation::EvaluationRequest;
use super::request::framework::Framework;
use super::request::frontier::FrontierQuestion;
use super::request::specification::Specification;
use super::surrogate::design::GUARDS;
use super::surrogate::learning::{CANDIDATES_PER_POINT, LAW_BYTES, together};
use super::surrogate::stored::Solution;
use crate::numerics::gp::GaussianProcess;
use crate::numerics::grown_bridges;

/// Bytes of a double.
const NUMBER: usize = 8;
/// Square matrices of the order of the design that stand at once while both surrogates are fitted side by side: the kernel,
/// its inverse, the room to invert in and to factor in, each twice.
const FIT_MATRICES: usize = 8;
/// A candidate or a guard, with features, scaled inputs and their headers, without the numbers.
const CANDIDATE_BYTES: usize = 160;
/// A number of a finished policy: itself, its digits as JSON, and the copies of those that the store is given.
const POLICY_NUMBER_BYTES: usize = 80;
/// Statistics over all paths that a thread holds beside those of the states that it measures together.
const STATISTICS: usize = 8;
/// Numbers a value of the history that a thread holds while it solves a robust step.
const STEP_NUMBERS: usize = 74;
/// Predictions a function beyond those, where trading costs: at eight trades, while a refined table is made beside the one before.
const TABLES: usize = 16;
const FUNCTIONS_WITHOUT_COST: usize = 2;
/// A simulated path: what a strategy came to, and a step as a framework lived it, with the copies that a report sorts.
const ENDED_BYTES: usize = 80;
const LIVED_BYTES: usize = 48;
const PATH_BYTES: usize = 256;
/// A period of a strategy's walk-forward: its decision and account, the series that are resampled, and the report with its
/// digits and the copies that the store is given.
const DECIDED_BYTES: usize = 1024;
/// A share of wealth in one of several assets: itself, that of the strategy's own mix, and the report with its digits and the
/// copies that the store is given.
const SHARE_BYTES: usize = 160;
/// Atoms of the law that records are drawn from, beside those of the record.
const RESAMPLED_VALUES: usize = 4096;
/// What any job takes.
const LEAST: usize = 8 << 20;

/// Bytes by the field of the request that asks for them.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    parts: Vec<Demand>,
}

#[derive(Debug, Clone, PartialEq)]
struct Demand {
    field: &'static str,
    value: usize,
    bytes: usize,
}

impl Footprint {
    /// That `field`, which holds `value`, asks for so many bytes.
    pub fn of(field: &'static str, value: usize, bytes: usize) -> Self {
        Footprint { parts: vec![Demand { field, value, bytes }] }
    }

    fn and(mut self, field: &'static str, value: usize, bytes: usize) -> Self {
        self.parts.push(Demand { field, value, bytes });
        self
    }

    /// Bytes in all.
    pub fn bytes(&self) -> usize {
        self.parts.iter().fold(0, |sum, part| sum.saturating_add(part.bytes))
    }

    fn most(&self) -> Option<&Demand> {
        self.parts.iter().max_by_key(|part| part.bytes)
    }

    /// The field that asks for most.
    pub fn field(&self) -> &'static str {
        self.most().map_or("", |part| part.field)
    }

    /// What that field holds.
    pub fn value(&self) -> usize {
        self.most().map_or(0, |part| part.value)
    }
}

/// The sizes that a training's memory follows from.
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
    /// Of a completed specification.
    fn of(specification: &Specification) -> Self {
        let problem = &specification.problem;
        let (horizon, history) = (problem.horizon, problem.history.len());
        let single = !problem.framework.learns() && !problem.depends_on_wealth();
        let count = if single { 1 } else { specification.design.count.unwrap_or(DEFAULT_COUNT) };
        let framed = Problem::new(specification);
        let paths = problem.radius_rule().paths();
        let bridges = framed.sets.heaviest(history, horizon);
        let holdings = framed.holdings(if single { HOLDINGS_OF_ONE_LAW } else { HOLDINGS });
        let functions = holdings.count() + framed.dynamics(0).sides().len();
        let inputs = framed.selection.names().len();
        let atoms = framed.centring.atom_count(history + horizon);
        Sizes { horizon, history, atoms, count, inputs, functions, paths, bridges }
    }

    fn factor(&self) -> usize {
        GaussianProcess::bytes_of(self.count, self.inputs)
    }

    /// Bytes of the finished policy and its documents.
    fn policy(&self) -> usize {
        product(&[self.horizon, self.count, self.inputs + self.functions, POLICY_NUMBER_BYTES])
    }

    /// Bytes of the policy made ready to advise.
    fn prepared(&self) -> usize {
        bytes_ready(self.horizon, self.horizon.saturating_mul(self.count), self.inputs, self.functions)
    }

    /// Bytes while the surrogates of one step are fitted.
    fn fit(&self) -> usize {
        let candidate = 2 * self.inputs * NUMBER + CANDIDATE_BYTES;
        let candidates = product(&[CANDIDATES_PER_POINT * self.count + GUARDS, candidate]);
        product(&[FIT_MATRICES, self.count, self.count, NUMBER]).saturating_add(candidates)
    }

    /// Bytes that threads hold while they solve robust steps.
    fn solving(&self, threads: usize) -> usize {
        let tabulated = TABLES * self.functions.saturating_sub(FUNCTIONS_WITHOUT_COST);
        let solved = product(&[threads, self.atoms, (STEP_NUMBERS + tabulated) * NUMBER]);
        solved.saturating_add(product(&[threads, self.history + self.horizon, self.together(), LAW_BYTES]))
    }

    fn statistics(&self, threads: usize) -> usize {
        let statistics = product(&[threads, self.paths, STATISTICS + self.together(), NUMBER]);
        statistics.saturating_add(product(&[threads, grown_bridges::table_bytes(self.history, self.horizon)]))
    }

    /// States of a design that a thread measures together.
    fn together(&self) -> usize {
        together(self.history + self.horizon, self.paths).min(CANDIDATES_PER_POINT * self.count)
    }
}

/// What a training of a completed specification takes on so many threads.
pub fn training(specification: &Specification, threads: usize) -> Footprint {
    let sizes = Sizes::of(specification);
    let solving = sizes.solving(threads).saturating_add(LEAST);
    Footprint::of("design.count", sizes.count, sizes.fit())
        .and("problem.horizon", sizes.horizon, sizes.policy())
        .and("problem.radius.paths", sizes.paths, training_keeps(&sizes).saturating_add(sizes.statistics(threads)))
        .and("problem.history", sizes.history, solving)
}

/// Bytes of the cache that such a training should have: the bridges of a sample size and of the next, each at most half.
pub fn kept_by_training(specification: &Specification) -> usize {
    training_keeps(&Sizes::of(specification))
}

fn training_keeps(sizes: &Sizes) -> usize {
    sizes.bridges.saturating_mul(4)
}

/// What of a policy trained from a completed specification must be kept ready to advise by it.
pub fn advising(specification: &Specification) -> [Footprint; 3] {
    let sizes = Sizes::of(specification);
    [
        Footprint::of("design.count", sizes.count, sizes.factor()),
        Footprint::of("problem.radius.paths", sizes.paths, sizes.bridges),
        Footprint::of("problem.horizon", sizes.horizon, sizes.prepared()),
    ]
}

/// The same of a policy as it is, with the policy itself.
pub fn advising_by(policy: &Policy) -> [Footprint; 3] {
    let problem = &policy.specification().problem;
    let sizes = Sizes::of(policy.specification());
    let design = |solution: &Solution| match solution {
        Solution::Single(_) => (1, 0),
        Solution::Surrogates(stored) => (stored.count(), factor_bytes(stored)),
    };
    let designs = policy.steps().iter().map(|step| design(&step.solution));
    let (points, factor) = designs.max_by_key(|(_, bytes)| *bytes).unwrap_or_default();
    [
        Footprint::of("steps", points, factor),
        Footprint::of("specification.problem.radius.paths", sizes.paths, sizes.bridges),
        Footprint::of("specification.problem.horizon", problem.horizon, prepared_bytes(policy)),
    ]
}

/// What an evaluation of a completed request takes on so many threads.
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
    let paths = request.history_count().saturating_mul(request.paths);
    let strategies = request.frameworks.len() + request.mixes().len();
    let lived = product(&[request.problem.horizon, request.frameworks.len(), LIVED_BYTES]);
    let outcomes = product(&[paths, strategies * ENDED_BYTES + lived + PATH_BYTES]);
    most.cloned()
        .unwrap_or_else(|| Footprint::of("paths", request.paths, LEAST))
        .and("frameworks", request.frameworks.len(), policies.fold(kept_by_evaluation(request), usize::saturating_add))
        .and("paths", request.paths, outcomes)
}

/// Bytes of the cache that such an evaluation should have: every path asks for the factors of all steps in turn.
pub fn kept_by_evaluation(request: &EvaluationRequest) -> usize {
    let followed = request.frameworks.iter().filter_map(|&framework| {
        let sizes = Sizes::of(&request.specification(framework, None).completed().ok()?);
        let sizes_asked_for = if framework.learns() { sizes.horizon + 1 } else { 1 };
        Some((product(&[sizes.horizon, sizes.factor()]), product(&[sizes_asked_for, sizes.bridges])))
    });
    // Bridges are the same for all frameworks that learn.
    let (factors, bridges) = followed
        .fold((0usize, 0usize), |(factors, bridges), (more, own)| (factors.saturating_add(more), bridges.max(own)));
    // Room for any of them to be half of all.
    factors.saturating_add(bridges).saturating_mul(2)
}

/// What a frontier takes on so many threads: the bridges of its record, and a record of its own with its step for each thread.
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

/// Bytes of the cache that a frontier should have: the bridges of its record, at most half.
pub fn kept_by_frontier(question: &FrontierQuestion) -> usize {
    Sizes::of(&question.fund).bridges.saturating_mul(2)
}

/// What a walk-forward takes on so many threads.
pub fn backtest(backtest: &Backtest, threads: usize) -> Footprint {
    let (field, returns) = backtest.request.returns();
    // Beside the strategies stands a constant mix.
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

/// What a walk-forward of several assets, whose returns stand in `field`, takes on so many threads: the books and the report, and
/// for each thread a record with its bridges and its step.
pub fn backtest_of_assets(backtest: &AssetsBacktest, field: &'static str, threads: usize) -> Footprint {
    let periods = backtest.record.rows.len();
    let strategies = backtest.strategies().len();
    let held = product(&[backtest.shares(), SHARE_BYTES]);
    let books = product(&[backtest.lived().len(), strategies, DECIDED_BYTES]);
    let known = backtest.choices.windows.iter().map(|window| window.unwrap_or(periods)).max().unwrap_or_default();
    let steps = product(&[threads, known, backtest.record.assets.len(), STEP_NUMBERS, NUMBER]);
    let bridges = product(&[threads, known, FACTOR_PATHS, NUMBER]);
    let record = held.saturating_add(books).saturating_add(LEAST);
    Footprint::of(field, periods, record).and("windows", backtest.choices.windows.len(), steps.saturating_add(bridges))
}

/// Bytes of the cache that such a walk-forward should have.
pub fn kept_by_backtest(backtest: &Backtest, threads: usize) -> usize {
    let bridges = heaviest(backtest).map_or(0, |sizes| training_keeps(&sizes));
    bridges.saturating_mul(at_once(backtest, threads))
}

/// The sizes of the training that takes most, which learns and knows the cost.
fn heaviest(backtest: &Backtest) -> Option<Sizes> {
    let past = backtest.periods.get(..backtest.walk.window)?;
    let specification = backtest.walk.specification(Framework::Adaptive, *backtest.request.alpha.first()?, past);
    Some(Sizes::of(&specification.completed().ok()?))
}

/// Trainings of a stretch that run side by side.
fn at_once(backtest: &Backtest, threads: usize) -> usize {
    let trained = backtest.strategies.iter().filter(|(_, strategy)| strategy.is_trained()).count();
    threads.min(trained).max(1)
}

fn product(factors: &[usize]) -> usize {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}
