//! The estimates that jobs are admitted by, against what the allocator was asked for. One test, for the count is of the
//! whole process.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use ballast::control::assets::advising::FundsBall;
use ballast::control::cache::Cache;
use ballast::control::error::TrainError;
use ballast::control::estimate;
use ballast::control::evaluation::assets::report::AssetsBacktestReport;
use ballast::control::evaluation::assets::rules::AssetsStrategy;
use ballast::control::evaluation::assets::{AssetsBacktest, AssetsDecisions};
use ballast::control::evaluation::backtest::Backtest;
use ballast::control::evaluation::backtest_report::BacktestReport;
use ballast::control::evaluation::frontier::Frontier;
use ballast::control::evaluation::paths::Evaluation;
use ballast::control::evaluation::report::{Costs, EvaluationReport};
use ballast::control::evaluation::walk_forward::{ActualPeriod, Decision, SharedWork};
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::pool::{self, TrainingPool};
use ballast::control::problem::actions::Band;
use ballast::control::progress::{StepProgress, Watch};
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::evaluation::EvaluationRequest;
use ballast::control::request::frontier::FrontierRequest;
use ballast::control::request::specification::Specification;
use ballast::control::training::Training;
use serde_json::{Value, json};

/// An estimate may be this many times what is taken. More would refuse what fits; less leaves no room for what the
/// sizes in a request do not tell, as how long a search goes on.
const GENEROSITY: f64 = 4.0;
/// Bytes that every job is granted whatever it asks: small jobs may be as generous as they like.
const GRANTED: usize = 16 << 20;
const THREADS: usize = 2;

/// Counts bytes in use, and the most since it was last asked.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call is the system allocator's own; only sizes are added up beside it.
#[expect(unsafe_code, reason = "an allocator is unsafe by its trait")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(now, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The most bytes in use during `work`, beyond those before it.
fn most_bytes<R>(work: impl FnOnce() -> R) -> (usize, R) {
    let before = NOW.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let result = work();
    (MOST.load(Ordering::Relaxed).saturating_sub(before), result)
}

fn history(length: usize) -> Vec<f64> {
    (0..length).map(|k| 0.004 + 0.03 * ((k * 7919 % 1013) as f64 / 506.5 - 1.0)).collect()
}

fn specification(horizon: usize, length: usize, paths: usize, count: usize) -> Specification {
    let rule = match paths {
        0 => json!({ "rule": "root_n", "kappa": 0.05 }),
        paths => json!({ "rule": "bridge", "alpha": 0.1, "paths": paths }),
    };
    let problem = json!({ "horizon": horizon, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": history(length), "radius": rule });
    let value = json!({ "problem": problem, "design": { "count": count } });
    serde_json::from_value::<Specification>(value).unwrap().completed().unwrap()
}

fn holds(what: &str, estimated: usize, peak: usize) {
    println!("{what}: estimated {:.1} MB, peak {:.1} MB", estimated as f64 / 1e6, peak as f64 / 1e6);
    assert!(peak <= estimated, "{what}: {peak} bytes at the peak, {estimated} estimated");
    let generous = GENEROSITY * peak as f64 + GRANTED as f64;
    assert!(estimated as f64 <= generous, "{what}: {estimated} bytes estimated, {peak} at the peak");
}

#[test]
fn estimates_cover_what_is_taken_and_not_much_more() {
    let pool = TrainingPool::new(THREADS).unwrap();
    let stop = AtomicBool::new(false);
    let watch = Watch { stop: &stop, progress: &|_| {} };
    for (what, specification) in [
        ("the design", specification(2, 12, 0, 900)),
        ("the paths", specification(2, 60, 20_000, 40)),
        ("the history", specification(2, 6000, 200, 40)),
        ("the horizon", specification(60, 12, 0, 80)),
    ] {
        let (peak, policy) = most_bytes(|| {
            let kept = Cache::new(estimate::kept_by_training(&specification));
            let policy = pool.install(|| Training::with(&specification, kept).unwrap().run(&watch).unwrap());
            // As a worker stores it.
            let json = policy.to_json().unwrap();
            let copies = [json.clone(), json];
            drop(copies);
            policy
        });
        holds(what, estimate::training(&specification, THREADS).bytes(), peak);
        prepared(what, policy);
    }
    for (what, request) in [
        ("many paths", json!({ "frameworks": ["static"], "paths": 20_000 })),
        ("frameworks", json!({ "frameworks": ["adaptive", "plug_in"], "paths": 100 })),
    ] {
        let request = evaluation(request);
        let (peak, _) = most_bytes(|| {
            let kept = Cache::new(estimate::kept_by_evaluation(&request));
            let evaluation = Evaluation::new(request.clone()).unwrap().keeping(kept);
            pool.install(|| {
                let followers: Vec<_> = evaluation
                    .request
                    .frameworks
                    .iter()
                    .map(|&framework| evaluation.follower(framework, &watch).unwrap())
                    .collect();
                let outcomes = evaluation.simulate(&followers, &watch, &|| 0.0).unwrap();
                let costs = Costs::new(0.0, 0.0, &outcomes);
                serde_json::to_string(&EvaluationReport::new(&evaluation, &followers, &outcomes, costs).unwrap())
                    .unwrap()
            })
        });
        holds(what, estimate::evaluation(&request, THREADS).bytes(), peak);
    }
    walk_forwards(&pool);
    walks_of_assets(&pool);
    frontiers();
}

/// The memory of frontiers: a long record of many assets, and many bridges. Every drawn record takes much the same, so that one is
/// enough.
fn frontiers() {
    let assets: Vec<String> = (0..30).map(|asset| format!("asset {asset}")).collect();
    let row = |date: usize| (0..30).map(|asset| 0.004 + 0.03 * ((date * (7 + asset) * 7919) as f64).sin()).collect();
    let question = |dates: usize, paths: usize| {
        let rows: Vec<Vec<f64>> = (0..dates).map(row).collect();
        let problem = json!({ "assets": assets, "rate_per_step": 0.002, "history": rows,
            "utility": { "kind": "power", "risk_aversion": 3.0 }, "radius": { "rule": "bridge", "paths": paths },
            "support": { "rule": "none" } });
        let request = json!({ "problem": problem, "scales": [0.3], "resamples": 20 });
        serde_json::from_value::<FrontierRequest>(request).unwrap().question().unwrap()
    };
    for (what, question) in [("a long record", question(1500, 100)), ("bridges of a record", question(24, 20_000))] {
        // On one thread, the record at hand counts most beside the drawn ones.
        let estimated = estimate::frontier(&question, 1).bytes();
        let kept = Cache::new(estimate::kept_by_frontier(&question));
        let stop = AtomicBool::new(false);
        let progress = |progress: StepProgress| stop.store(progress.done > 0, Ordering::Relaxed);
        let watch = Watch { stop: &stop, progress: &progress };
        let pool = TrainingPool::new(1).unwrap();
        let (peak, ended) = most_bytes(|| {
            let frontier = Frontier::new(question, kept);
            pool.install(|| frontier.run(&watch))
        });
        assert_eq!(ended.err(), Some(TrainError::Stopped), "{what}");
        holds(what, estimated, peak);
    }
}

/// The memory of walk-forwards of several assets: the bridges and steps of a long window, and the books of a long record.
fn walks_of_assets(pool: &TrainingPool) {
    let request_with = |assets: usize, dates: usize, window: usize, rest: Value| {
        let row = |date: usize| -> Vec<f64> {
            (0..assets).map(|asset| 0.004 + 0.03 * ((date * (7 + asset) * 7919) as f64).sin()).collect()
        };
        let names: Vec<String> = (0..assets).map(|asset| format!("asset {asset}")).collect();
        let date = |year: usize| format!("{:04}-{:02}", 1800 + year / 12, year % 12 + 1);
        let mut request = json!({ "assets": names, "log_returns": (0..dates).map(row).collect::<Vec<_>>(), "rate": 0.002,
            "dates": (0..dates).map(date).collect::<Vec<_>>(), "windows": [window], "support": { "rule": "none" } });
        rest.as_object().unwrap().iter().for_each(|(name, value)| request[name] = value.clone());
        AssetsBacktest::from_request(&serde_json::from_value(request).unwrap()).unwrap()
    };
    let request = |assets: usize, dates: usize, window: usize| request_with(assets, dates, window, json!({}));
    let watch = Watch::unwatched();
    let backtest = request(30, 1912, 1900);
    let estimated = estimate::backtest_of_assets(&backtest, "log_returns", THREADS).bytes();
    let (peak, _) = most_bytes(|| {
        let balls = pool.install(|| backtest.balls(&watch, &|| {})).unwrap();
        // Within the whole radius, where the adversary has most ways.
        let whole = |strategy: &AssetsStrategy| strategy.rule.caution() == Some(CautionLevel::Paper);
        let strategies: Vec<AssetsStrategy> = backtest.strategies().into_iter().filter(whole).take(THREADS).collect();
        pool.install(|| pool::map(strategies, |strategy| backtest.decide(strategy, &balls, &watch, &|| {}).unwrap()))
    });
    holds("a long window", estimated, peak);
    let backtest = request(20, 4000, 24);
    let estimated = estimate::backtest_of_assets(&backtest, "log_returns", THREADS).bytes();
    let (strategies, lived) = (backtest.strategies().len(), backtest.lived().len());
    let (peak, _) = most_bytes(|| {
        let share = |period: usize| (0..20).map(|asset| 0.003 * (period + asset) as f64 % 0.05).collect();
        let held = vec![AssetsDecisions::Shares((0..lived).map(share).collect()); strategies];
        let ball = FundsBall { radius_factor: 1.0, radius: 0.0123456789, levels: None };
        let balls = [vec![ball; lived]];
        serde_json::to_string(&AssetsBacktestReport::new(&backtest.walked(&balls, held))).unwrap()
    });
    holds("a record of several assets", estimated, peak);
    let trained = json!({ "strategies": ["policy"], "every": 2, "count": 700 });
    let backtest = request_with(6, 48, 36, trained);
    let estimated = estimate::backtest_of_assets(&backtest, "log_returns", THREADS).bytes();
    let kept = Cache::new(estimate::kept_by_backtest_of_assets(&backtest, THREADS));
    let (peak, _) = most_bytes(|| {
        let walk = backtest.fund_walks().remove(0);
        pool.install(|| walk.tenure(walk.first, None, (&watch, kept)).unwrap())
    });
    holds("a policy of several assets", estimated, peak);
}

/// The memory of walk-forwards: the trainings of a stretch side by side, and the books of a long record.
fn walk_forwards(pool: &TrainingPool) {
    let request = |length: usize, count: usize, every: usize| {
        let request = json!({ "log_returns": history(length), "rate": 0.001, "periods_per_year": 4, "window": 24,
            "count": count, "every": every, "alpha": [0.5] });
        Backtest::new(serde_json::from_value(request).unwrap()).unwrap()
    };
    let backtest = request(30, 700, 6);
    let (peak, _) = most_bytes(|| {
        let strategies = backtest.plain_strategies();
        let common = SharedWork::of(&strategies, Cache::new(estimate::kept_by_backtest(&backtest, THREADS)));
        let watch = Watch::unwatched();
        let decide =
            |strategy| backtest.walk.decide_stretch(strategy, &backtest.periods, 0, &common, (&watch, &|| {})).unwrap();
        pool.install(|| pool::map(strategies, decide))
    });
    holds("a stretch", estimate::backtest(&backtest, THREADS).bytes(), peak);
    let backtest = request(4000, 10, 60);
    let estimated = estimate::backtest(&backtest, THREADS).bytes();
    let (peak, _) = most_bytes(|| {
        let held = |period: &ActualPeriod| {
            let share = (40.0 * period.log_return).abs().min(1.0);
            Decision { band: Band::of(&[share]), radius: 0.1 * share, source: None }
        };
        let held: Vec<Decision> = backtest.lived().iter().map(held).collect();
        let decisions = vec![held; backtest.strategies.len()];
        serde_json::to_string(&BacktestReport::new(&backtest.walked(decisions))).unwrap()
    });
    holds("a record", estimated, peak);
}

fn evaluation(mut request: Value) -> EvaluationRequest {
    request["problem"] = json!({ "horizon": 5, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": history(40), "radius": { "rule": "bridge", "paths": 2000 } });
    request["design"] = json!({ "count": 300 });
    serde_json::from_value::<EvaluationRequest>(request).unwrap().completed().unwrap()
}

/// The memory of a prepared policy, and of a factor.
fn prepared(what: &str, policy: Policy) {
    let [factor, bridges, numbers] = estimate::advising_by(&policy).map(|part| part.bytes());
    // Those of the sample size and of the next.
    let weighed = factor + 2 * bridges + numbers;
    let last = policy.specification().problem.horizon - 1;
    let before = NOW.load(Ordering::Relaxed);
    let advisor = Advisor::with(policy, Cache::new(2 * weighed));
    let state = advisor.initial_state(None, None).unwrap();
    advisor.prepare(last, &state);
    let kept = NOW.load(Ordering::Relaxed).saturating_sub(before);
    let unit = 1 << 20;
    assert!(kept <= weighed + weighed / 4 + unit, "{what}: {kept} bytes kept, {weighed} weighed");
}
