//! Comparisons of strategies against exact expectations, against sessions, and against themselves.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::support::App;
use crate::support::patience::assert_within;
use ballast::control::error::TrainError;
use ballast::control::evaluation::names::framework_name;
use ballast::control::evaluation::paths::{Evaluation, Follower, Outcome, Outcomes};
use ballast::control::evaluation::report::{Costs, EvaluationReport};
use ballast::control::pool::TrainingPool;
use ballast::control::problem::utility::utility;
use ballast::control::progress::Watch;
use ballast::control::request::evaluation::EvaluationRequest;
use ballast::control::request::framework::Framework;
use ballast::numerics::statistics::summary::Estimate;
use reqwest::Method;
use serde_json::{Value, json};

/// The paper's problem with a history of 20 returns.
fn paper(rest: Value) -> Value {
    let history: Vec<f64> = (0..20).map(|k| 0.011 + 0.1 * f64::from(7 * k % 20 - 10) / 10.0).collect();
    let mut request = json!({
        "problem": { "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": history },
        "design": { "count": 20, "sampling_law": { "kind": "gaussian_mixture", "components": [
            { "weight": 0.4, "mean": 0.006, "variance": 0.016 }, { "weight": 0.6, "mean": 0.016, "variance": 0.00625 } ] } }
    });
    merge(&mut request, rest);
    request
}

fn merge(into: &mut Value, from: Value) {
    match (into, from) {
        (Value::Object(into), Value::Object(from)) => {
            from.into_iter().for_each(|(key, value)| merge(into.entry(key).or_insert(Value::Null), value));
        }
        (into, from) => *into = from,
    }
}

/// A comparison small enough for a test: four steps, tiny designs, few bridges.
fn small(rest: Value) -> Value {
    let mut request = paper(json!({ "problem": { "horizon": 4, "radius": { "rule": "bridge", "paths": 200 },
            "support": { "rule": "none" } }, "paths": 100 }));
    merge(&mut request, rest);
    request
}

const COSTS: Costs = Costs { training_seconds: 0.0, simulation_seconds: 0.0, resolve_seconds: None };

fn simulated(request: Value) -> (Evaluation, Vec<Follower>, Outcomes) {
    let evaluation = Evaluation::new(serde_json::from_value(request).unwrap()).unwrap();
    let watch = Watch::unwatched();
    let followers: Vec<_> = evaluation
        .request
        .frameworks
        .iter()
        .map(|&framework| evaluation.follower(framework, &watch).unwrap())
        .collect();
    let outcomes = evaluation.simulate(&followers, &watch, &|| 0.0).unwrap();
    (evaluation, followers, outcomes)
}

fn reported(request: Value) -> EvaluationReport {
    let (evaluation, followers, outcomes) = simulated(request);
    EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap()
}

/// E[U] of all-stock: log wealth is a sum of ten draws, so normal given how many came from the first component.
fn all_stock_expectation() -> f64 {
    let choose = |k: i32| (1..=k).map(|i| f64::from(11 - i) / f64::from(i)).product::<f64>();
    let given = |k: i32| {
        let (first, second) = (f64::from(k), f64::from(10 - k));
        let mean = 0.006 * first + 0.016 * second;
        let deviation = (0.016 * first + 0.00625 * second).sqrt();
        // The trapezoidal rule on [-8, 8] is exact to rounding.
        let node = |j: i32| {
            let x = f64::from(j) / 8.0;
            (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt() / 8.0
                * -(-0.01 * 100.0 * (mean + deviation * x).exp()).exp_m1()
                / 0.01
        };
        choose(k) * 0.4_f64.powi(k) * 0.6_f64.powi(10 - k) * (-64..=64).map(node).sum::<f64>()
    };
    (0..=10).map(given).sum()
}

const ALL_STOCK: f64 = 67.356_594_358_220_6;

#[test]
fn constant_mixes_have_their_exact_expectations() {
    let request = json!({ "frameworks": [], "constant_mixes": [0.0, 0.5, 1.0], "paths": 50_000, "level": 0.999 });
    let report = reported(paper(request)).in_utility();
    let bank = report.strategy("All in the bank").unwrap();
    // All-bank ends at 100 * 1.002^10 whatever happens.
    assert!((bank.utility.mean.value - 63.947_03).abs() < 5e-6, "{:?}", bank.utility.mean);
    assert!(bank.utility.variance.value < 1e-20 && bank.utility.max - bank.utility.min < 1e-10);
    assert!((bank.certainty_equivalent.value - 100.0 * 1.002_f64.powi(10)).abs() < 1e-9);
    let stock = report.strategy("All in stocks").unwrap();
    let exact = all_stock_expectation();
    // By Gauss-Hermite quadrature in numpy.
    assert!((exact - ALL_STOCK).abs() < 1e-9, "{exact}");
    let mean = stock.utility.mean;
    assert!(mean.low < exact && exact < mean.high, "{exact} outside {mean:?}");
    // By other code as well, to two digits.
    let half = report.strategy("50 % in stocks").unwrap().utility.mean;
    assert!(half.low < 66.225 && 66.215 < half.high, "{half:?}");
    // The certainty equivalent of the mean.
    let certain = -(-0.01 * mean.value).ln_1p() / 0.01;
    assert!((stock.certainty_equivalent.value / certain - 1.0).abs() < 1e-12);
}

/// The chance that a sum of ten draws of the mixture is negative, by the normal law given how many came from the first component.
fn all_stock_loss() -> f64 {
    let choose = |k: i32| (1..=k).map(|i| f64::from(11 - i) / f64::from(i)).product::<f64>();
    // Phi(-x) by the trapezoidal rule over [x, x + 10].
    let tail = |x: f64| {
        let density = |y: f64| (-0.5 * y * y).exp() / std::f64::consts::TAU.sqrt();
        let inner: f64 = (1..2000).map(|node| density(x + f64::from(node) / 200.0)).sum();
        (inner + 0.5 * density(x)) / 200.0
    };
    let given = |k: i32| {
        let (first, second) = (f64::from(k), f64::from(10 - k));
        tail((0.006 * first + 0.016 * second) / (0.016 * first + 0.00625 * second).sqrt())
    };
    (0..=10).map(|k| choose(k) * 0.4_f64.powi(k) * 0.6_f64.powi(10 - k) * given(k)).sum()
}

#[test]
fn losses_and_falls_are_those_of_the_paths() {
    let request = || paper(json!({ "frameworks": [], "constant_mixes": [0.0, 1.0], "paths": 4000, "level": 0.999 }));
    let (evaluation, _, outcomes) = simulated(request());
    let wealth = reported(request()).strategy("All in stocks").unwrap().wealth.clone();
    let exact = all_stock_loss();
    assert!((0.2..0.5).contains(&exact), "{exact}");
    assert!(wealth.chance_of_loss.low < exact && exact < wealth.chance_of_loss.high, "{exact} outside {wealth:?}");
    // Every fall from one time to a later one.
    let fall = |path: usize| {
        let returns = evaluation.returns(0, path);
        let sums: Vec<f64> = (0..=returns.len()).map(|until| returns[..until].iter().sum()).collect();
        let falls = (0..sums.len())
            .flat_map(|from| sums[from..].iter().map(|to| 1.0 - (to - sums[from]).exp()).collect::<Vec<f64>>());
        falls.fold(0.0, f64::max)
    };
    let falls: Vec<f64> = (0..4000).map(fall).collect();
    assert!(falls.iter().zip(&outcomes.outcomes).all(|(fall, outcome)| (fall - outcome.ended[1].fall).abs() < 1e-12));
    assert!((wealth.max_drawdown.value - falls.iter().sum::<f64>() / 4000.0).abs() < 1e-12);
    let mut ends: Vec<f64> = outcomes.outcomes.iter().map(|outcome| outcome.ended[1].wealth).collect();
    ends.sort_by(f64::total_cmp);
    assert!((wealth.worst_twentieth.value - ends[..200].iter().sum::<f64>() / 200.0).abs() < 1e-9, "{wealth:?}");
    assert!(wealth.min == ends[0] && wealth.max == ends[3999] && wealth.quantile_20.value > ends[799]);
    assert!(outcomes.outcomes.iter().all(|outcome| outcome.ended[0].fall == 0.0));
}

/// The known law's value by other code: more than all-stock, because a wealthy investor holds back.
#[test]
fn the_known_law_promises_its_value_and_keeps_it() {
    let request = json!({ "frameworks": ["known_law"], "constant_mixes": [1.0], "paths": 4000, "level": 0.999,
        "design": { "count": 100 } });
    let report = reported(paper(request)).in_utility();
    let promised = 100.0 * -(-0.01 * report.histories[0].promised[0]).exp_m1();
    assert!((promised - 67.3600).abs() < 1e-3, "{promised}");
    let mean = report.strategies[0].utility.mean;
    assert!(mean.low < promised && promised < mean.high, "{promised} outside {mean:?}");
}

/// Terminal wealth is counted in bins of its own, and what ends as the bank does by itself: a quantile lies where its share of the
/// paths is, be it at a point.
#[test]
fn wealth_is_counted_in_its_own_bins_and_at_the_bank() {
    let cautious = json!({ "problem": { "radius": { "scale": 0.7 } }, "paths": 400 });
    let report = reported(small(cautious));
    let edges = &report.wealth_edges;
    assert!(edges.len() == 41 && edges.is_sorted() && (report.floor - 100.0 * 1.002_f64.powi(4)).abs() < 1e-9);
    let mut points = 0;
    for strategy in &report.strategies {
        let wealth = &strategy.wealth;
        let (counts, at_bank) = (&wealth.histogram, wealth.at_bank);
        assert_eq!(counts.iter().sum::<usize>() + at_bank, 400, "{}", strategy.strategy);
        assert!(edges[0] <= wealth.min && wealth.max <= edges[40], "{}", strategy.strategy);
        let [low, high] = [wealth.quantile_20.value, wealth.quantile_90.value];
        // Bins that end below a quantile hold no more than its share, and those up to it no less.
        for (quantile, share) in [(low, 0.2), (high, 0.9)] {
            let up_to = |most: f64| {
                edges[1..].iter().zip(counts).filter(|(edge, _)| **edge <= most).map(|(_, count)| count).sum::<usize>()
            };
            let width = edges[1] - edges[0];
            let banked = |is_below: bool| if is_below { at_bank } else { 0 };
            let below = up_to(quantile) + banked(report.floor < quantile - width);
            let through = up_to(quantile + width) + banked(report.floor <= quantile + width);
            assert!(below <= (share * 400.0) as usize + 1, "{}: {below} below {quantile}", strategy.strategy);
            assert!(through + 1 >= (share * 400.0) as usize, "{}: {through} to {quantile}", strategy.strategy);
        }
        if high - low < 1e-9 * report.floor {
            assert!(at_bank >= 280, "{}: {at_bank} at the bank, between {low} and {high}", strategy.strategy);
            points += usize::from(at_bank < 400);
        }
    }
    assert!(points > 0, "no strategy is mostly, and not always, in the bank");
    assert_eq!(report.strategy("All in the bank").unwrap().wealth.at_bank, 400);
}

#[test]
fn the_own_mix_is_what_a_constant_mix_of_the_average_allocation_earns() {
    let costly = json!({ "trading_cost": 0.01 });
    let request = |mixes: Vec<f64>| {
        small(json!({ "frameworks": ["plug_in"], "constant_mixes": mixes, "paths": 400, "problem": costly }))
    };
    let (_, _, outcomes) = simulated(request(vec![]));
    let held = outcomes.outcomes.iter().flat_map(|outcome| &outcome.lived).map(|lived| lived.allocation);
    let average = held.sum::<f64>() / (4.0 * 400.0);
    let report = reported(request(vec![average]));
    let own = report.strategies[0].own_mix.unwrap();
    assert!((own.allocation - average).abs() < 1e-12 && report.strategies[1].own_mix.is_none());
    // The mix was asked for by name here, and is compared with the framework as its reference.
    let apart = report.strategies[1].difference.as_ref().unwrap().certainty_equivalent;
    for (found, expected) in
        [(own.beyond.value, -apart.value), (own.beyond.low, -apart.high), (own.beyond.high, -apart.low)]
    {
        assert!((found - expected).abs() < 1e-9, "{own:?} {apart:?}");
    }
    assert!(
        report.sentences.len() == 1 && report.sentences[0].contains("“Trusts the record” differs by"),
        "{:?}",
        report.sentences
    );
}

/// Risk aversion 10 at wealth 1 and at a hundred million: the same figures, where U itself keeps three digits of 1/9.
#[test]
fn utilities_keep_their_digits_at_any_wealth() {
    let found = [1.0, 1e8].map(|wealth| {
        let utility = json!({ "kind": "power", "risk_aversion": 10.0 });
        let problem = json!({ "utility": utility, "initial_wealth": wealth });
        let request =
            small(json!({ "frameworks": [], "constant_mixes": [0.2, 0.8], "paths": 200, "problem": problem }));
        let (evaluation, followers, outcomes) = simulated(request);
        let report = EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap();
        let [mean, apart] =
            [report.strategies[1].utility.mean, report.strategies[1].difference.clone().unwrap().utility];
        assert!(report.strategies[1].histogram.iter().filter(|count| **count > 0).count() > 5, "{report:?}");
        [mean.value, report.strategies[1].utility.variance.value, apart.low, apart.high]
    });
    for (one, other) in found[0].iter().zip(found[1]) {
        assert!((one / other - 1.0).abs() < 1e-9 && *one != 0.0, "{found:?}");
    }
}

#[test]
fn differences_are_paired() {
    let (evaluation, followers, outcomes) =
        simulated(small(json!({ "frameworks": ["plug_in"], "constant_mixes": [0.4, 0.5], "paths": 400 })));
    let report = EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap().in_utility();
    assert_eq!((report.reference.as_str(), report.strategies[0].difference.is_none()), ("Trusts the record", true));
    let kind = evaluation.request.problem.utility;
    let apart = |outcome: &Outcome| utility(kind, outcome.ended[1].wealth) - utility(kind, outcome.ended[0].wealth);
    let mean = outcomes.outcomes.iter().map(apart).sum::<f64>() / 400.0;
    let (found, own) = (report.strategies[1].difference.as_ref().unwrap(), &report.strategies[1]);
    assert!((found.utility.value - mean).abs() < 1e-12);
    let reference = &report.strategies[0];
    let certain = own.certainty_equivalent.value - reference.certainty_equivalent.value;
    assert!((found.certainty_equivalent.value - certain).abs() < 1e-9);
    // To first order a utility counts as wealth by e^(l CE) for exponential utility, each at its own strategy's mean.
    let slopes = [reference, own].map(|strategy| (0.01 * strategy.certainty_equivalent.value).exp());
    let linear = |outcome: &Outcome| {
        slopes[1] * utility(kind, outcome.ended[1].wealth) - slopes[0] * utility(kind, outcome.ended[0].wealth)
    };
    let deviation = |of: &dyn Fn(&Outcome) -> f64| {
        let values: Vec<f64> = outcomes.outcomes.iter().map(of).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>().sqrt()
    };
    let width = |estimate: Estimate| estimate.high - estimate.low;
    let (wide, expected) =
        (width(found.certainty_equivalent) / width(found.utility), deviation(&linear) / deviation(&apart));
    assert!((wide / expected - 1.0).abs() < 1e-6, "{wide} {expected}");
    // Two mixes that are close lose and win together: the pair is far narrower than either.
    let close = json!({ "frameworks": [], "constant_mixes": [0.4, 0.5], "paths": 400 });
    let close = reported(small(close)).strategies[1].clone();
    let (pair, alone) = (close.difference.unwrap().utility, close.utility.mean);
    assert!(pair.high - pair.low < 0.5 * (alone.high - alone.low), "{pair:?} {alone:?}");
}

/// A known part of 100 paths of four periods holds nothing, and a known part is solved anew, another for each framework.
#[test]
fn what_was_lived_is_told_period_by_period() {
    let (evaluation, followers, mut outcomes) = simulated(small(json!({ "frameworks": ["adaptive", "plug_in"] })));
    for (path, outcome) in outcomes.outcomes.iter_mut().enumerate() {
        for (position, lived) in outcome.lived.iter_mut().enumerate() {
            let (framework, step) = (position / 4, position % 4);
            lived.allocation = if path < 10 * (framework + 1) + 20 * step { 0.0 } else { 0.5 };
            lived.resolved = step == 0 && path < 40 * (framework + 1);
        }
    }
    let report = EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap();
    for (strategy, banked) in report.strategies.iter().zip([[0.1, 0.3, 0.5, 0.7], [0.2, 0.4, 0.6, 0.8]]) {
        let periods = strategy.periods.as_ref().unwrap();
        assert_eq!(periods.iter().map(|period| period.all_bank_share).collect::<Vec<_>>(), banked);
        assert_eq!(periods.iter().map(|period| period.period).collect::<Vec<_>>(), [1, 2, 3, 4]);
        // Twenty returns were known before the first.
        assert_eq!(periods.iter().map(|period| period.sample_size).collect::<Vec<_>>(), [20, 21, 22, 23]);
        for (period, banked) in periods.iter().zip(banked) {
            assert!((period.allocation.mean - 0.5 * (1.0 - banked)).abs() < 1e-12, "{period:?}");
        }
    }
    assert_eq!([0, 1].map(|index| report.strategies[index].resolved_share), [Some(0.1), Some(0.2)]);
}

#[test]
fn threads_change_nothing() {
    let request = small(json!({ "histories": { "kind": "drawn", "count": 3 }, "constant_mixes": [0.3] }));
    let on = |threads| TrainingPool::new(threads).unwrap().install(|| reported(request.clone()));
    let once = on(1);
    assert_eq!(once.strategies.len(), 7);
    for threads in [2, 4] {
        assert!(on(threads) == once, "{threads} threads");
    }
}

#[test]
fn a_simulated_path_is_the_advisor_s_own() {
    let (evaluation, followers, outcomes) = simulated(small(json!({ "constant_mixes": [] })));
    for (path, outcome) in outcomes.outcomes.iter().enumerate() {
        for (index, follower) in followers.iter().enumerate() {
            let advisor = follower.advisor.as_ref().unwrap();
            let start = advisor.initial_state(None, None).unwrap();
            let returns = evaluation.returns(0, path);
            let mut walk = advisor.walk(start, &returns);
            let advices: Vec<_> = walk.by_ref().collect();
            let end = walk.state;
            assert_eq!(outcome.ended[index].wealth, end.wealth);
            let lived = &outcome.lived[4 * index..4 * (index + 1)];
            assert!(lived.iter().zip(&advices).all(|(lived, advice)| lived.allocation == advice.allocation));
        }
    }
}

#[test]
fn a_ball_holds_the_true_law_where_it_is_wide_enough() {
    let covered = |radius: f64| {
        let mut request = small(json!({ "frameworks": ["adaptive", "static"] }));
        request["problem"]["radius"] = json!({ "rule": "fixed", "radius": radius });
        let report = reported(request);
        let coverage = |name: &str| report.strategy(name).unwrap().coverage.clone().unwrap();
        (coverage("Cautious, learns"), coverage("Cautious, fixed"))
    };
    let (adaptive, fixed) = covered(1.0);
    assert_eq!((adaptive.by_sample_size.len(), fixed.by_sample_size.len()), (4, 1));
    assert!(adaptive.by_sample_size.iter().all(|at| at.covered.value == 1.0) && adaptive.ever_left.value == 0.0);
    let (adaptive, fixed) = covered(1e-6);
    assert!(adaptive.by_sample_size.iter().all(|at| at.covered.value == 0.0) && fixed.ever_left.value == 1.0);
}

/// Returns the distance of the laws of two records: between the sorted records, each value repeated until both have the same
/// length.
fn apart(one: &[f64], other: &[f64]) -> f64 {
    let repeated = |record: &[f64], times: usize| {
        let mut all: Vec<f64> = record.iter().flat_map(|value| std::iter::repeat_n(*value, times)).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let pairs = repeated(one, other.len()).into_iter().zip(repeated(other, one.len()));
    pairs.map(|(one, other)| (one - other).abs()).sum::<f64>() / (one.len() * other.len()) as f64
}

#[test]
fn the_share_inside_the_first_ball_is_what_sorted_returns_give() {
    let kappa = 0.5;
    let mut request = small(json!({ "frameworks": ["adaptive", "static"], "constant_mixes": [] }));
    request["problem"]["radius"] = json!({ "rule": "root_n", "kappa": kappa });
    let (evaluation, followers, outcomes) = simulated(request);
    let report = EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap();
    let coverage = |index: usize| report.strategies[index].coverage.clone().unwrap().by_sample_size;
    assert_eq!(coverage(1).iter().map(|at| at.inside_first.value).collect::<Vec<f64>>(), [1.0]);
    let history = &evaluation.histories[0];
    let mut shares = Vec::new();
    for (step, at) in coverage(0).iter().enumerate() {
        let is_inside = |path: &usize| {
            let learned = [history.as_slice(), &evaluation.returns(0, *path)[..step]].concat();
            let radius = |record: &[f64]| kappa / (record.len() as f64).sqrt();
            apart(history, &learned) + radius(&learned) <= radius(history) + 1e-12
        };
        let expected = (0..100).filter(is_inside).count() as f64 / 100.0;
        // Both are the same count of a hundred paths.
        assert!((at.inside_first.value - expected).abs() < 1e-12, "{step}: {at:?} {expected}");
        shares.push(expected);
    }
    assert!(shares[0] == 1.0 && shares[1..].iter().any(|share| (0.05..0.95).contains(share)), "{shares:?}");
    let named = report.sentences.iter().filter(|sentence| sentence.contains("inside the first ball")).count();
    assert_eq!(named, 1, "{:?}", report.sentences);
}

/// Measured for the project by other code: 82 % at n = 20, where alpha promises 90 %.
#[test]
fn the_bridge_ball_covers_the_paper_s_law_less_often_than_it_promises() {
    let request = json!({
        "problem": { "horizon": 1 }, "frameworks": ["adaptive"], "constant_mixes": [],
        "histories": { "kind": "drawn", "count": 500 }, "paths": 100, "level": 0.999,
        "design": { "count": 10 } });
    let report = reported(paper(request)).in_utility();
    let coverage = report.strategies[0].coverage.clone().unwrap();
    let covered = coverage.by_sample_size[0].covered;
    assert!((coverage.target.unwrap() - 0.9).abs() < 1e-12 && covered.high < 0.9, "{covered:?}");
    assert!(covered.low < 0.82 && 0.82 < covered.high, "{covered:?}");
    // Mean Q at n = 20, by other code, to its digits.
    let quantiles: Vec<f64> = report.histories.iter().map(|history| history.quantile.unwrap()).collect();
    let mean = quantiles.iter().sum::<f64>() / 500.0;
    let variance = quantiles.iter().map(|quantile| (quantile - mean).powi(2)).sum::<f64>() / 500.0;
    assert!((mean - 0.1725).abs() < 4.0 * (variance / 500.0).sqrt() + 5e-5, "{mean}");
}

#[test]
fn every_framework_takes_part_whatever_its_default_radius_rule() {
    use ballast::control::request::specification::Specification;
    let names = ["adaptive", "static", "known_law", "plug_in", "parametric_static", "parametric_adaptive"];
    let rest = json!({ "frameworks": names, "constant_mixes": [0.0], "histories": { "kind": "drawn", "count": 2 } });
    let mut request = small(rest);
    request["problem"].as_object_mut().unwrap().remove("radius");
    let (evaluation, followers, outcomes) = simulated(request);
    let report = EvaluationReport::new(&evaluation, &followers, &outcomes, COSTS).unwrap();
    for (strategy, name) in report.strategies.iter().zip(names) {
        assert_eq!(strategy.framework.map(Framework::name), Some(name));
        assert_eq!(Some(strategy.strategy.as_str()), strategy.framework.map(framework_name));
        // A Wasserstein ball is what coverage speaks of, and a set frozen at its history has a policy for each.
        assert_eq!(strategy.coverage.is_some(), ["adaptive", "static"].contains(&name), "{name}");
        assert_eq!(strategy.policy.is_none(), ["static", "parametric_static"].contains(&name), "{name}");
        let mean = strategy.utility.mean;
        assert!(mean.low <= mean.value && mean.value <= mean.high, "{name} {mean:?}");
    }
    // What a training stores is what the request asks for, defaults filled in.
    for framework in [followers[0].framework, followers[2].framework] {
        let trained: Specification = evaluation.request.specification(framework, None).completed().unwrap();
        assert_eq!(evaluation.request.accepts(framework, &trained), Ok(()));
    }
}

#[test]
fn the_stop_signal_ends_a_simulation() {
    let (evaluation, followers, _) = simulated(small(json!({})));
    let watch = Watch { stop: &AtomicBool::new(true), progress: &|_| {} };
    assert_eq!(evaluation.simulate(&followers, &watch, &|| 0.0), Err(TrainError::Stopped));
}

/// Returns the report of an evaluation by the service.
async fn evaluated(app: &App, request: &Value) -> Value {
    let (status, job) = app.post("/evaluate", request).await;
    assert_eq!((status.as_u16(), &job["kind"], &job["report"]), (202, &json!("evaluate"), &Value::Null), "{job}");
    let done = app.until(job["job"].as_str().unwrap(), |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    assert_eq!(done["progress"]["steps_done"], done["progress"]["steps_total"]);
    app.get(done["report"].as_str().unwrap()).await.1
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_over_http_equals_one_in_process_and_its_sessions() {
    let mut app = App::start().await;
    let mut report = evaluated(&app, &small(json!({}))).await;
    let here = reported(small(json!({})));
    assert_eq!(report["costs"]["training_seconds"].as_f64().map(|seconds| seconds > 0.0), Some(true));
    report["costs"] = serde_json::to_value(COSTS).unwrap();
    assert!(report == serde_json::to_value(&here).unwrap(), "the reports differ");

    // A policy trained by itself is the one trained inside; a session of it lives the first path.
    let mut training = small(json!({}));
    training.as_object_mut().unwrap().remove("paths");
    app.train(&training).await;
    assert_eq!(report["strategies"][0]["policy"], json!(app.policy));
    let (evaluation, _, outcomes) = simulated(small(json!({})));
    app.open().await;
    let mut wealth = Value::Null;
    for (period, log_return) in evaluation.returns(0, 0).into_iter().enumerate() {
        wealth = app.observe(period + 1, log_return).await.1["wealth"].clone();
    }
    assert_eq!(wealth.as_f64(), Some(outcomes.outcomes[0].ended[0].wealth));

    let given = json!({ "policies": { "adaptive": app.policy }, "frameworks": ["adaptive"] });
    let with_policy = evaluated(&app, &small(given)).await;
    assert_eq!(with_policy["strategies"][0], report["strategies"][0]);
    let (status, problem) = app.get(&format!("/jobs/{}/report", "job_none")).await;
    assert_eq!(status, 404, "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_is_cancelled_within_a_second_in_every_stage() {
    let app = App::start().await;
    let long = [
        ("solving", json!({ "problem": { "radius": { "paths": 20_000 } } })),
        ("simulating", json!({ "paths": 50_000 })),
    ];
    for (phase, larger) in long {
        let (_, job) = app.post("/evaluate", &small(larger)).await;
        let job = job["job"].as_str().unwrap().to_owned();
        let running = app.until(&job, |job| job["progress"]["phase"] == phase).await;
        assert_eq!(running["progress"]["steps_total"], 25);
        let started = Instant::now();
        assert_eq!(app.cancel(&job).await, 202);
        app.until(&job, |job| job["state"] == "cancelled").await;
        assert_within(Duration::from_secs(1), started, phase);
        assert_eq!(app.get(&format!("/jobs/{job}/report")).await.0, 404);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evaluation_survives_a_restart() {
    let mut app = App::start().await;
    let request = small(json!({ "problem": { "horizon": 12 }, "constant_mixes": [] }));
    let (_, job) = app.post("/evaluate", &request).await;
    let job = job["job"].as_str().unwrap().to_owned();
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(14)).await;
    app.restart().await;
    let done = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    let mut report = app.get(done["report"].as_str().unwrap()).await.1;
    report["costs"] = serde_json::to_value(COSTS).unwrap();
    assert!(report == serde_json::to_value(reported(request)).unwrap(), "the reports differ");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_makes_one_evaluation() {
    let app = App::start().await;
    let send = |paths: usize| {
        let request = app.client.post(format!("{}/evaluate", app.url)).header("Idempotency-Key", "k");
        async move { crate::support::read(request.json(&small(json!({ "paths": paths }))).send().await.unwrap()).await }
    };
    let (first, again, other) = (send(100).await, send(100).await, send(101).await);
    assert_eq!((first.0.as_u16(), &first.1["job"]), (202, &again.1["job"]));
    assert_eq!((other.0.as_u16(), &other.1["type"]), (409, &json!("/problems/idempotency-conflict")));
    let location = first.1["job"].as_str().unwrap();
    assert_eq!(app.send(Method::POST, &format!("/jobs/{location}/cancel"), None).await.0, 202);
}

#[test]
fn a_relative_risk_aversion_and_the_absolute_one_it_stands_for_are_one_evaluation() {
    let completed = |utility: Value| {
        let mut request = small(json!({ "problem": { "initial_wealth": 250.0 } }));
        request["problem"]["utility"] = utility;
        serde_json::from_value::<EvaluationRequest>(request).unwrap().completed().unwrap()
    };
    assert_eq!(
        completed(json!({ "kind": "exponential", "risk_aversion_relative": 3 })),
        completed(json!({ "kind": "exponential", "risk_aversion": 3.0 / 250.0 }))
    );
}
