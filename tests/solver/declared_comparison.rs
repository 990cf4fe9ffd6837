//! Policies and rules of a declared problem compared by simulation, against exact enumeration of all paths.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use ballast::control::cache::Cache;
use ballast::control::error::TrainError;
use ballast::control::evaluation::declared_comparison::{Comparison, ComparisonReport};
use ballast::control::policy::declared::{DeclaredAdvisor, DeclaredPolicy};
use ballast::control::progress::Watch;
use serde_json::{Value, json};

use crate::declared::example;

/// The stock over two periods.
fn stock() -> Value {
    let mut request = example("stock");
    request["problem"]["horizon"] = json!(2);
    request["design"]["count"] = json!(40);
    request
}

fn advisor(request: &Value) -> Arc<DeclaredAdvisor> {
    let declared = serde_json::from_value(request.clone()).unwrap();
    let policy = DeclaredPolicy::train(&declared, &Watch::unwatched()).unwrap();
    Arc::new(policy.prepared(Cache::default()).unwrap())
}

fn compared(policies: &[Arc<DeclaredAdvisor>], request: &Value) -> Result<ComparisonReport, TrainError> {
    let request = serde_json::from_value(request.clone()).unwrap();
    let comparison = Comparison::new(request, policies.to_vec())?;
    let trained = comparison.trainings().map(|training| {
        let policy = DeclaredPolicy::new(training, training.run(&Watch::unwatched())?);
        Ok(Arc::new(policy.prepared(Cache::default())?))
    });
    comparison.run(trained.collect::<Result<_, TrainError>>()?, &Watch::unwatched())
}

fn history() -> &'static [f64] {
    static DEMANDS: LazyLock<Vec<f64>> =
        LazyLock::new(|| serde_json::from_value(example("stock")["problem"]["history"].clone()).unwrap());
    &DEMANDS
}

/// The stock's own formulas, written again.
fn period(stock: f64, order: f64, demand: f64) -> (f64, f64) {
    let left = (stock + order - demand).max(0.0);
    (left, 9.0 * demand.min(stock + order) - 5.0 * order - 0.5 * left)
}

/// Mean worth over all 49 pairs of demands, and the mean stock before the second.
fn enumerated(order: impl Fn(usize, f64, &[f64]) -> f64) -> (f64, f64) {
    let (mut worth, mut second, count) = (0.0, 0.0, history().len() as f64);
    for &first in history() {
        let (left, earned) = period(4.0, order(0, 4.0, &[]), first);
        second += left / count;
        let again = order(1, left, &[first]);
        for &demand in history() {
            let (end, more) = period(left, again, demand);
            worth += (earned + more + 3.0 * end) / (count * count);
        }
    }
    (worth, second)
}

#[test]
fn means_are_those_of_all_paths() {
    let policy = advisor(&stock());
    let request = json!({ "policies": { "robust": "a" }, "paths": 20_000,
        "rules": { "base": { "order": "max(25 - stock, 0)" }, "most": { "order": "100 + t" } } });
    let report = compared(std::slice::from_ref(&policy), &request).unwrap();
    let decide = |step: usize, stock: f64, seen: &[f64]| {
        let state = BTreeMap::from([("stock".to_owned(), stock)]);
        policy.decide(step + 1, Some(&state), seen).unwrap().actions["order"]
    };
    let expected = [
        ("robust", enumerated(decide)),
        ("base", enumerated(|_, stock, _| (25.0 - stock).max(0.0))),
        // An order beyond the bounds is the highest that there is.
        ("most", enumerated(|_, stock, _| 60.0 - stock)),
    ];
    assert_eq!(report.strategies.len(), 3);
    for (own, (name, (worth, second))) in report.strategies.iter().zip(&expected) {
        assert_eq!(own.strategy, *name);
        // Four standard errors of 20,000 paths; the interval has about two.
        let reach = 2.0 * (own.value.high - own.value.low) / 2.0;
        assert!((own.value.value - worth).abs() < reach, "{name}: {:?} and {worth}", own.value);
        assert!((own.periods[1].states["stock"] - second).abs() < 0.2, "{name}: {:?} and {second}", own.periods[1]);
        let first = expected[0].1.0;
        if let Some(apart) = own.difference {
            let reach = 2.0 * (apart.high - apart.low) / 2.0;
            assert!((apart.value - (worth - first)).abs() < reach, "{name}: {apart:?} and {}", worth - first);
        }
    }
    let robust = &report.strategies[0];
    assert!(robust.difference.is_none() && robust.robust_value.unwrap() < robust.value.high);
    assert!(robust.worst_twentieth.value < robust.value.value);
    assert_eq!(report, compared(&[policy], &request).unwrap(), "bit for bit");
}

/// Intervals of 90 % hold the truth in about 90 % of simulations: of 60, in 45 to 60 (a chance of 1 in 1000 otherwise).
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let policy = advisor(&stock());
    let base = enumerated(|_, stock, _| (25.0 - stock).max(0.0)).0;
    let less = enumerated(|_, stock, _| (18.0 - stock).max(0.0)).0;
    let (mut of_value, mut of_difference) = (0, 0);
    for seed in 1..=60 {
        let request = json!({ "policies": { "robust": "a" }, "paths": 100, "seed": seed, "level": 0.9,
            "rules": { "base": { "order": "max(25 - stock, 0)" }, "less": { "order": "max(18 - stock, 0)" } } });
        let report = compared(std::slice::from_ref(&policy), &request).unwrap();
        let find = |name: &str| report.strategies.iter().find(|own| own.strategy == name).unwrap();
        let holds = |low: f64, high: f64, truth: f64| usize::from(low <= truth && truth <= high);
        let (value, less_value) = (find("base").value, find("less").value);
        of_value += holds(value.low, value.high, base);
        of_difference += holds(less_value.low, less_value.high, less);
    }
    assert!((45..=60).contains(&of_value) && (45..=60).contains(&of_difference), "{of_value} {of_difference}");
}

/// With a utility, a value is the certainty equivalent of the amount at the end.
#[test]
fn a_utility_is_counted_in_certainty_equivalents() {
    let mut request = example("investor");
    request["problem"]["horizon"] = json!(1);
    let policy = advisor(&request);
    let problem = &request["problem"];
    let (aversion, kind) = (problem["utility"]["risk_aversion"].as_f64().unwrap(), problem["utility"]["kind"].clone());
    assert_eq!(kind, "power");
    let report = compared(
        &[policy],
        &json!({ "policies": { "a": "a" }, "paths": 50_000, "rules": { "half": { "share": "0.5" }, "none": { "share": "0" } } }),
    )
    .unwrap();
    let history: Vec<f64> = serde_json::from_value(problem["history"].clone()).unwrap();
    let rate = problem["parameters"]["rate"].as_f64().unwrap();
    let wealth = problem["states"]["wealth"]["start"].as_f64().unwrap();
    let certain = |share: f64| {
        let end = |z: &f64| wealth * ((1.0 - share) * (1.0 + rate) + share * z.exp());
        let mean = history.iter().map(|z| end(z).powf(1.0 - aversion)).sum::<f64>() / history.len() as f64;
        mean.powf(1.0 / (1.0 - aversion))
    };
    for (name, share) in [("half", 0.5), ("none", 0.0)] {
        let found = report.strategies.iter().find(|own| own.strategy == name).unwrap();
        let reach = (found.value.high - found.value.low).max(1e-9 * wealth);
        assert!((found.value.value - certain(share)).abs() < reach, "{name}: {:?} {}", found.value, certain(share));
        let apart = found.difference.unwrap();
        let expected = found.value.value - report.strategies[0].value.value;
        assert!((apart.value - expected).abs() < 1e-9 * wealth, "{apart:?} {expected}");
    }
}

/// Several frameworks inside one comparison are the policies that a training of each would give. Whoever knows the law of the
/// record orders as the enumeration of all orders does.
#[test]
fn frameworks_are_trained_inside_a_comparison() {
    let request = stock();
    let shared = json!({ "paths": 2000, "rules": { "base": { "order": "max(25 - stock, 0)" } } });
    let mut inside = shared.clone();
    inside["problem"] = request["problem"].clone();
    inside["design"] = request["design"].clone();
    inside["frameworks"] = json!(["static", "adaptive", "plug_in", "known_law"]);
    let inside = compared(&[], &inside).unwrap();
    let names: Vec<&str> = inside.strategies.iter().map(|own| own.strategy.as_str()).collect();
    assert_eq!(names, ["static", "adaptive", "plug_in", "known_law", "base"]);
    let trained = ["adaptive", "plug_in", "static"].map(|framework| {
        let mut own = request.clone();
        own["problem"]["framework"] = json!(framework);
        advisor(&own)
    });
    let mut before = shared;
    before["policies"] = json!({ "adaptive": "1", "plug_in": "2", "static": "3" });
    let before = compared(&trained, &before).unwrap();
    let find = |report: &ComparisonReport, name: &str| {
        report.strategies.iter().find(|own| own.strategy == name).unwrap().clone()
    };
    for name in ["adaptive", "plug_in", "static"] {
        let (inside, before) = (find(&inside, name), find(&before, name));
        assert_eq!((inside.value, inside.periods), (before.value, before.periods), "{name}, bit for bit");
        assert_eq!(inside.robust_value, before.robust_value, "{name}");
    }
    let best = (0..=560).map(|order| 0.1 * f64::from(order));
    let best = best.max_by(|one, other| known(*one).0.total_cmp(&known(*other).0)).unwrap();
    let found = find(&inside, "known_law");
    assert!((found.periods[0].actions["order"] - best).abs() < 0.1, "{:?} and {best}", found.periods[0]);
    // The surrogate of 40 states rounds the kinks of the second period, and 2,000 paths have their own mean.
    let reach = found.value.high - found.value.low;
    assert!((found.value.value - known(best).0).abs() < reach, "{:?} and {:?}", found.value, known(best));
    assert!((found.robust_value.unwrap() - known(best).0).abs() < 0.005 * known(best).0, "{found:?}");
}

/// The worth of a first order under the law of the record, if the second is the best of even ones, and the mean second stock.
fn known(first: f64) -> (f64, f64) {
    let second = |stock: f64| {
        let worth = |order: f64| {
            let of = |demand: &f64| {
                let (left, earned) = period(stock, order, *demand);
                earned + 3.0 * left
            };
            history().iter().map(of).sum::<f64>()
        };
        let orders = (0..=600).map(|order| 0.1 * f64::from(order)).filter(|order| stock + order <= 60.0);
        orders.max_by(|one, other| worth(*one).total_cmp(&worth(*other))).unwrap_or(0.0)
    };
    enumerated(|step, stock, _| if step == 0 { first } else { second(stock) })
}

#[test]
fn wrong_comparisons_are_refused() {
    let policy = advisor(&stock());
    let mut other = stock();
    other["problem"]["parameters"]["price"] = json!(10);
    let other = advisor(&other);
    let mut less_cautious = stock();
    less_cautious["problem"]["radius"]["scale"] = json!(0.1);
    let less_cautious = advisor(&less_cautious);
    let problem = stock()["problem"].clone();
    let mut no_horizon = problem.clone();
    no_horizon["horizon"] = json!(0);
    let two = json!({ "policies": { "a": "x", "b": "y" }, "paths": 100 });
    assert!(compared(&[policy.clone(), less_cautious], &two).is_ok());
    for (policies, change, field) in [
        (vec![policy.clone(), other], json!({ "policies": { "a": "x", "b": "y" } }), "policies.b"),
        (vec![policy.clone()], json!({ "rules": { "r": {} } }), "rules.r.order"),
        (vec![policy.clone()], json!({ "rules": { "r": { "order": "1", "buy": "2" } } }), "rules.r.buy"),
        (vec![policy.clone()], json!({ "rules": { "r": { "order": "demand" } } }), "rules.r.order"),
        (vec![policy.clone()], json!({ "rules": { "r": { "order": "ln(stock - 100)" } } }), "rules.r.order"),
        (vec![policy.clone()], json!({ "rules": { "r": { "order": "1/(stock - 4)" } } }), "rules.r.order"),
        (vec![policy.clone()], json!({ "rules": { "r": { "order": "-1e308*1e308" } } }), "rules.r.order"),
        (vec![policy.clone()], json!({ "rules": { "a": { "order": "1" } } }), "rules.a"),
        (vec![policy.clone()], json!({ "paths": 99 }), "paths"),
        (vec![policy.clone()], json!({ "paths": 100_000, "level": 0.4 }), "level"),
        (vec![], json!({ "policies": {} }), "policies"),
        (vec![policy.clone()], json!({ "frameworks": ["static"] }), "frameworks"),
        (vec![policy.clone()], json!({ "design": { "count": 40 } }), "design"),
        (vec![policy.clone()], json!({ "problem": problem, "frameworks": ["static", "static"] }), "frameworks[1]"),
        (vec![policy.clone()], json!({ "problem": problem, "frameworks": ["parametric_static"] }), "frameworks[0]"),
        (
            vec![policy.clone()],
            json!({ "problem": problem, "rules": { "adaptive": { "order": "1" } } }),
            "rules.adaptive",
        ),
        (vec![policy.clone()], json!({ "problem": problem, "policies": { "adaptive": "x" } }), "policies.adaptive"),
        (vec![policy.clone()], json!({ "problem": { "price": 10 } }), "policies.a"),
        (vec![policy.clone()], json!({ "problem": no_horizon }), "problem.horizon"),
    ] {
        let mut request = json!({ "policies": { "a": "x" }, "paths": 100 });
        for (name, value) in change.as_object().unwrap() {
            request[name] = value.clone();
        }
        if request["problem"] == json!({ "price": 10 }) {
            request["problem"] = problem.clone();
            request["problem"]["parameters"]["price"] = json!(10);
        }
        match compared(&policies, &request) {
            Err(TrainError::Specification(fault)) => assert_eq!(fault.field, field, "{request}: {fault}"),
            other => panic!("{request}: {other:?}"),
        }
    }
}
