//! Problems declared in formulas: against independent references and brute force, and what is refused.

use std::fs;

use ballast::control::cache::Cache;
use ballast::control::declared_training::DeclaredTraining;
use ballast::control::error::TrainError;
use ballast::control::policy::declared::Decided;
use ballast::control::pool::TrainingPool;
use ballast::control::progress::Watch;
use ballast::control::request::declared::DeclaredSpecification;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use serde::Deserialize;
use serde_json::{Map, Value, json};

pub fn example(name: &str) -> Value {
    let path = format!("{}/examples/problems/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

pub fn solved(request: &Value) -> Result<Decided, TrainError> {
    let declared: DeclaredSpecification = serde_json::from_value(request.clone()).unwrap();
    Decided::first(&declared, &Watch::unwatched())
}

/// The only action, or the first by name.
pub fn action(advice: &Decided) -> f64 {
    advice.actions.values().copied().next().unwrap()
}

/// A case of `tests/data/general.json`, which was computed elsewhere by exact nested enumeration.
#[derive(Deserialize)]
struct Case {
    problem: String,
    parameters: Map<String, Value>,
    state: Map<String, Value>,
    history: Vec<f64>,
    support: [f64; 2],
    radius_times_sqrt_sample_size: f64,
    horizon: usize,
    framework: String,
    value: f64,
    action: f64,
}

impl Case {
    /// The declaration of the example with the case's numbers.
    fn request(&self) -> Value {
        let mut request = example(&self.problem);
        let problem = &mut request["problem"];
        problem["parameters"] = json!(self.parameters);
        let states = match self.problem.as_str() {
            "store" => vec![("stored", "x"), ("price", "q")],
            "stock" => vec![("stock", "x")],
            _ => vec![("wealth", "x")],
        };
        for (state, given) in states {
            problem["states"][state]["start"] = self.state[given].clone();
        }
        problem["noise"]["low"] = json!(self.support[0]);
        problem["noise"]["high"] = json!(self.support[1]);
        problem["history"] = json!(self.history);
        problem["horizon"] = json!(self.horizon);
        problem["framework"] = json!(self.framework);
        problem["radius"] = json!({ "rule": "root_n", "kappa": self.radius_times_sqrt_sample_size });
        request
    }
}

#[test]
fn declared_problems_agree_with_independent_references() {
    let data: Value = serde_json::from_str(include_str!("../data/general.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_value(data["cases"].clone()).unwrap();
    assert_eq!(cases.len(), 18);
    for case in cases {
        let mut request = case.request();
        request["design"]["count"] = json!(if case.problem == "store" { 300 } else { 1000 });
        let advice = solved(&request).unwrap();
        // The scale needs few digits.
        request["design"]["count"] = json!(50);
        request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.0 });
        let scale = (solved(&request).unwrap().value - case.value).abs().max(1.0);
        let named = format!("{} over {}, {}", case.problem, case.horizon, case.framework);
        let error = advice.value - case.value;
        println!("{named}: {error:+.5} of {scale:.3}, action {:.4} for {:.4}", action(&advice), case.action);
        // The worth of a goal is kinked where the goal is sure. With the law among its inputs the surrogate rounds the kink.
        let allowed =
            if case.problem == "goal" && case.horizon > 1 && case.framework == "adaptive" { 1e-2 } else { 2e-3 };
        assert!(error.abs() < allowed * scale, "{named}: {} for {}", advice.value, case.value);
        let range = match case.problem.as_str() {
            "stock" => 56.0,
            "store" => 10.0,
            _ => 1.0,
        };
        let off = (action(&advice) - case.action).abs();
        assert!(off < 0.01 * range, "{named}: action {} for {}", action(&advice), case.action);
        let shares: f64 = advice.worst_law.iter().map(|moved| moved.share).sum();
        assert!((shares - 1.0).abs() < 1e-6, "{named}: {shares}");
    }
}

/// With a cost of ordering at all the worth has two peaks; brute force over even orders agrees.
#[test]
fn a_fixed_cost_is_solved_globally() {
    for (stock, fixed) in [(4.0, 30.0), (14.0, 30.0), (14.0, 5.0), (20.0, 0.0)] {
        let mut request = example("stock");
        let problem = &mut request["problem"];
        problem["states"]["stock"]["start"] = json!(stock);
        problem["parameters"]["fixed"] = json!(fixed);
        let reward = format!("{} - if(order > 0, fixed, 0)", problem["reward"].as_str().unwrap());
        problem["reward"] = json!(reward);
        problem["horizon"] = json!(1);
        problem["radius"] = json!({ "rule": "fixed", "radius": 0.0 });
        let history: Vec<f64> = serde_json::from_value(problem["history"].clone()).unwrap();
        let advice = solved(&request).unwrap();
        let worth = |order: f64| {
            let of = |demand: &f64| {
                let left = (stock + order - demand).max(0.0);
                9.0 * (stock + order).min(*demand) - 5.0 * order - 0.5 * left + 3.0 * left
            };
            history.iter().map(of).sum::<f64>() / history.len() as f64 - if order > 0.0 { fixed } else { 0.0 }
        };
        let best = (0..=56_000).map(|index| worth(1e-3 * f64::from(index))).fold(f64::NEG_INFINITY, f64::max);
        // An even order is at most half a thousandth from the best, which changes the worth by at most 5 for each.
        assert!((advice.value - best).abs() < 3e-3, "{stock}, {fixed}: {} for {best}", advice.value);
        let peaks: &[&str] = if fixed > 0.0 { &["order"] } else { &[] };
        assert_eq!(advice.several_peaks, peaks, "{stock}, {fixed}");
    }
}

/// Sums of three bells over two actions, each a fifth to a half of the interval wide: a grid of 101 by 101 is beaten or met in all
/// but a few, since a search from two places may miss the highest peak.
#[test]
fn the_highest_of_random_peaks_is_found_but_for_a_few() {
    let (problems, mut missed) = (60, 0);
    for number in 0..problems {
        let mut generator = stream(20_261_129, "peaks", 0, number);
        let mut up_to = |most: u32| f64::from(generator.random_range(0..=most)) / 1000.0;
        let bells: Vec<[f64; 4]> =
            (0..3).map(|_| [0.3 + up_to(700), up_to(1000), up_to(1000), 0.2 + up_to(300)]).collect();
        let bell =
            |[height, a, b, width]: &[f64; 4]| format!("{height}*exp(-((a - {a})^2 + (b - {b})^2)/{})", width * width);
        let reward = bells.iter().map(bell).collect::<Vec<_>>().join(" + ");
        let one = json!({ "low": "0", "high": "1" });
        let advice = solved(&json!({ "problem": {
            "states": { "still": { "start": 0, "low": -1, "high": 1 } }, "actions": { "a": one, "b": one },
            "noise": { "name": "gust", "low": 0, "high": 1 }, "next": { "still": "still" }, "reward": reward, "horizon": 1,
            "history": [0.2, 0.4], "framework": "static", "radius": { "rule": "fixed", "radius": 0.0 } } }))
        .unwrap();
        let worth = |at: [f64; 2]| -> f64 {
            let of = |[height, a, b, width]: &[f64; 4]| {
                height * (-((at[0] - a).powi(2) + (at[1] - b).powi(2)) / (width * width)).exp()
            };
            bells.iter().map(of).sum()
        };
        let grid = (0..=100).flat_map(|a| (0..=100).map(move |b| [0.01 * f64::from(a), 0.01 * f64::from(b)]));
        let best = grid.map(worth).fold(f64::NEG_INFINITY, f64::max);
        missed += usize::from(worth([advice.actions["a"], advice.actions["b"]]) < best - 1e-6);
    }
    println!("{missed} of {problems} missed");
    assert!(missed <= 3, "{missed} of {problems} missed");
}

/// Orders in packs, over two periods: enumeration agrees.
#[test]
fn finite_actions_are_the_best_of_all() {
    let mut request = example("stock");
    let (packs, demands) = ([0.0, 24.0, 8.0, 16.0], [9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7]);
    let problem = &mut request["problem"];
    problem["actions"]["order"] = json!({ "values": packs });
    problem["next"]["stock"] = json!("min(max(stock + order - demand, 0), capacity)");
    problem["horizon"] = json!(2);
    problem["framework"] = json!("static");
    problem["radius"] = json!({ "rule": "fixed", "radius": 0.0 });
    request["design"]["count"] = json!(300);
    fn worth(stock: f64, left: usize, packs: &[f64], demands: &[f64]) -> (f64, f64) {
        if left == 0 {
            return (3.0 * stock, 0.0);
        }
        let of = |order: f64| {
            let after = |demand: &f64| {
                let rest = (stock + order - demand).max(0.0);
                let earned = 9.0 * (stock + order).min(*demand) - 5.0 * order - 0.5 * rest;
                earned + worth(rest.min(60.0), left - 1, packs, demands).0
            };
            (demands.iter().map(after).sum::<f64>() / demands.len() as f64, order)
        };
        packs.iter().map(|order| of(*order)).max_by(|left, right| left.0.total_cmp(&right.0)).unwrap()
    }
    for stock in [0.0, 4.0, 13.0, 25.0, 60.0] {
        request["problem"]["states"]["stock"]["start"] = json!(stock);
        let (advice, best) = (solved(&request).unwrap(), worth(stock, 2, &packs, &demands));
        println!("{stock}: {} for {}, {} for {}", advice.value, best.0, action(&advice), best.1);
        // The worth of the last period is kinked between the packs, and ranges over some hundreds.
        assert!((advice.value - best.0).abs() < 0.5, "{stock}: {} for {}", advice.value, best.0);
        assert_eq!(action(&advice), best.1, "{stock}");
    }
}

/// Three actions in one period, of which two meet in a ridge that no search along one of them climbs.
#[test]
fn several_actions_are_searched_together() {
    let gusts = [0.1, 0.2, 0.45, 0.65];
    for (reward, best) in [
        // The best are 1.3/2, 0.7/2 and the mean gust.
        ("-(a - b - 0.3)^2 - (a + b - 1)^2 - (c - gust)^2", [0.65, 0.35, 0.35]),
        ("-abs(a - b) - 0.3*abs(a + b - 1.2) - (c - gust)^2", [0.6, 0.6, 0.35]),
        // The lower peak is at 0.2.
        (
            "max(0.9 - 8*abs(a - 0.2) - abs(b - 0.9), 1 - 9*abs(a - 0.8) - abs(b - 0.1)) - (c - gust)^2",
            [0.8, 0.1, 0.35],
        ),
    ] {
        let request = json!({ "problem": {
            "states": { "still": { "start": 0, "low": -1, "high": 1 } },
            "actions": { "a": { "low": "0", "high": "1" }, "b": { "low": "0", "high": "1" }, "c": { "low": "0", "high": "1" } },
            "noise": { "name": "gust", "low": 0, "high": 1 },
            "next": { "still": "still" }, "reward": reward, "horizon": 1, "history": gusts, "framework": "static",
            "radius": { "rule": "fixed", "radius": 0.0 } } });
        let advice = solved(&request).unwrap();
        println!("{reward}: {:?} for {best:?}", advice.actions);
        for (found, expected) in advice.actions.values().zip(best) {
            assert!((found - expected).abs() < 1e-3, "{reward}: {:?} for {best:?}", advice.actions);
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let mut request = example("store");
    request["design"]["count"] = json!(20);
    let on = |threads| TrainingPool::new(threads).unwrap().install(|| solved(&request).unwrap());
    assert_eq!(on(1), on(3));
}

#[test]
fn a_problem_that_earns_nothing_is_refused() {
    let mut request = example("stock");
    for field in ["reward", "end"] {
        request["problem"].as_object_mut().unwrap().remove(field);
    }
    let refused = solved(&request).unwrap_err().to_string();
    assert!(refused.contains("problem.end") && refused.contains("must be given without a reward"), "{refused}");
}

#[test]
fn what_breaks_a_rule_is_refused_with_its_field_and_column() {
    let long = "1+".repeat(1_500) + "1";
    let deep = format!("{}1{}", "(".repeat(80), ")".repeat(80));
    let cases: Vec<(&str, Value, &str, &str)> = vec![
        (
            "/reward",
            json!("price*min(stock + order, demand) - cost*ordr"),
            "problem.reward",
            "column 41: `ordr` is no name",
        ),
        ("/reward", json!(long), "problem.reward", "column 2001"),
        ("/reward", json!(deep), "problem.reward", "column 66: is more than 64"),
        ("/reward", json!("1/(stock - stock)"), "problem.reward", "is inf"),
        ("/reward", json!("ln(stock - 100)"), "problem.reward", "has no value at stock = "),
        ("/reward", json!("exp(exp(exp(order)))"), "problem.reward", "beyond 1e15"),
        ("/reward", json!("stock = 3"), "problem.reward", "column 7: `=` has no meaning"),
        ("/end", json!("salvage*stock*order"), "problem.end", "`order` is no name"),
        ("/next/stock", json!("stock + order - demand"), "problem.next.stock", "must stay from 0 to 60"),
        ("/next", json!({}), "problem.next.stock", "must be given for each state"),
        ("/next/other", json!("1"), "problem.next.other", "must be the name of a state"),
        ("/actions/order/high", json!("capacity - demand"), "problem.actions.order.high", "`demand` is no name"),
        ("/actions/order/low", json!("70"), "problem.actions.order.high", "must not be below `low`"),
        ("/actions", json!({}), "problem.actions", "must have 1 to 3"),
        ("/actions/order", json!({ "low": "0" }), "problem.actions.order", "must have `low` and `high`, or `values`"),
        (
            "/actions/order",
            json!({ "low": "0", "high": "1", "values": [0] }),
            "problem.actions.order",
            "must have `low` and `high`, or `values`",
        ),
        ("/actions/order", json!({ "values": [] }), "problem.actions.order.values", "must have 1 to 64 numbers"),
        ("/actions/order", json!({ "values": [1, 0, 1] }), "problem.actions.order.values[2]", "must be there once"),
        ("/actions/order", json!({ "values": [1e13] }), "problem.actions.order.values[0]", "must be a number from"),
        ("/parameters/demand", json!(1), "problem.parameters", "must not be a name of problem.noise.name too"),
        ("/parameters/min", json!(1), "problem.parameters", "must not be the name of a function"),
        ("/parameters/T", json!(1), "problem.parameters", "must not be a name of the horizon too"),
        ("/parameters/a b", json!(1), "problem.parameters", "must be a letter and then"),
        ("/parameters/price", json!(1e300), "problem.parameters.price", "must be a number from"),
        ("/states/stock/start", json!(61), "problem.states.stock.start", "must be from `low`, 0, to `high`, 60"),
        ("/states/stock/high", json!(0), "problem.states.stock.high", "must be above `low`"),
        ("/noise/high", json!(20), "problem.history[1]", "must be from `noise.low`, 0, to `noise.high`, 20"),
        ("/noise/low", json!(-1e308), "problem.noise.low", "must be a number from"),
        ("/discount", json!(1.5), "problem.discount", "must be above 0 and at most 1"),
        ("/utility", json!({ "kind": "log", "of": "stock" }), "problem.end", "must be absent with a utility"),
        ("/framework", json!("known_law"), "problem.framework", "must be adaptive, static or plug_in"),
        ("/horizon", json!(0), "problem.horizon", ""),
        ("/horizon", json!(100_000), "problem.horizon", ""),
        ("/horizon", json!(1_000_000_000_000_000_u64), "problem.horizon", "must lie in [1, 520]"),
        ("/history", json!([5, 5, 5]), "problem.history", "must have two different values"),
        ("/history", json!([]), "problem.history", "must have two different values"),
        (
            "/radius",
            json!({ "rule": "root_n", "kappa": 5000.0 }),
            "problem.radius.kappa",
            "must be a number in [0, 4000]",
        ),
        (
            "/radius",
            json!({ "rule": "fixed", "radius": 500.0 }),
            "problem.radius.radius",
            "must be a number in [0, 400]",
        ),
        ("/radius", json!({ "rule": "chi_square" }), "problem.radius.rule", "must be bridge"),
        ("/radius", json!({ "rule": "root_n", "kappa": -1.0 }), "problem.radius.kappa", ""),
    ];
    for (place, value, field, rule) in cases {
        let mut request = example("stock");
        request["design"] = json!({ "count": 10 });
        let (parent, name) = place.rsplit_once('/').unwrap();
        request["problem"].pointer_mut(parent).unwrap()[name] = value;
        match solved(&request) {
            Err(TrainError::Specification(error)) => {
                assert_eq!(error.field, field, "{place}: {error:?}");
                assert!(error.rule.contains(rule), "{place}: {error:?}");
            }
            other => panic!("{place}: {other:?}"),
        }
    }
}

#[test]
fn a_formula_that_jumps_is_warned_of() {
    let warned = |request: &Value| -> Vec<(String, String)> {
        let declared: DeclaredSpecification = serde_json::from_value(request.clone()).unwrap();
        let read = DeclaredTraining::with(&declared, Cache::default()).unwrap();
        read.warnings().into_iter().map(|warning| (warning.field.into_owned(), warning.message)).collect()
    };
    for name in ["stock", "store", "goal", "hedge", "spending", "liquidation", "regulator", "investor"] {
        assert_eq!(warned(&example(name)), [], "{name} is continuous");
    }
    // A fixed cost jumps with the order alone, over which every value is tried.
    for (field, formula, jumps) in [
        ("reward", "if(order > 0, 3, 0) + stock", false),
        ("reward", "if(demand > 20, 3, 0) + stock", true),
        ("reward", "if(stock > 10, 5, stock)", true),
        ("reward", "if(stock > 10, 10, stock)", false),
        ("reward", "(stock >= 10)*(stock - 10) + exp(-stock) + abs(demand - 3) + sqrt(stock)", false),
        ("reward", "stock^0.5 + (stock - 10)^3/100 + ln(1 + demand)", false),
        ("reward", "if(t > 5, 100, 0)", false),
        ("end", "if(stock > 10, 50, 0)", true),
        ("end", "max(stock, 10)", false),
    ] {
        let mut request = example("stock");
        request["problem"][field] = json!(formula);
        let found = warned(&request);
        assert_eq!(found.len(), usize::from(jumps), "{formula}: {found:?}");
        assert!(found.iter().all(|(named, _)| *named == format!("problem.{field}")), "{found:?}");
    }
    let mut request = example("stock");
    request["problem"]["reward"] = json!("if(stock > 10, 5, 1) - order");
    let (_, message) = &warned(&request)[0];
    assert!(message.contains("problem.reward jumps from") && message.contains("stock = 10"), "{message}");
}
