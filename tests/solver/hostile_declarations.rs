//! Hostile declarations: each is refused with its field and rule, or solved to finite numbers.

use ballast::control::error::TrainError;
use ballast::control::policy::declared::Decided;
use serde_json::{Value, json};

use crate::declared::{example, solved};

fn formulas() -> Vec<String> {
    let plain = [
        "1/0",
        "0/0",
        "1/(stock - 4)",
        "1/t",
        "ln(-1)",
        "ln(0)",
        "ln(stock)",
        "sqrt(-stock - 1)",
        "(-8)^0.5",
        "(-1)^stock",
        "exp(exp(exp(exp(stock))))",
        "10^10^10",
        "t^T^t^T",
        "2^1024",
        "1e308",
        "-1e308",
        "1e308*1e308",
        "1e15*stock",
        "1e-320",
        "1e400",
        "exp(800)",
        "exp(-800)",
        "stock^1e6",
        "stock^-1e6",
        "if(stock, 1/0, 1)",
        "if(0/0, 1, 2)",
        "if(t > 1, 1e15, -1e15)",
        "if(stock > 4, 100, -100)",
        "if(stock == 4, 1e9, 0)",
        "stock*0",
        "stock - stock",
        "-stock",
        "1e15 - 1e15 + stock",
        "",
        "  ",
        "💥",
        "stоck",
        "stock\u{0}",
        "ｓtock",
        "sin(stock)",
        "stock stock",
        "stock 4",
        "max()",
        "max(1)",
        "if(1, 2)",
        "abs(1, 2)",
        "ln",
        "min(stock, 1, 2, 3, t, T)",
        "stock = 1",
        "1..2",
        "1e",
        "0x10",
        "NaN",
        "inf",
        "\"text\"",
        "stock;t",
        "(",
        ")",
        "()",
        "stock[0]",
        "stock < 1 < 2",
        "!stock",
        "1 == 1 == 1",
        "--stock",
        "+stock",
        "stock^^2",
        "1,2",
    ];
    let mut all: Vec<String> = plain.map(str::to_owned).into();
    all.extend([40, 70, 900, 500_000].map(|deep| format!("{}1{}", "(".repeat(deep), ")".repeat(deep))));
    all.extend([50, 1_500, 1_000_000].map(|minus| format!("{}1", "-".repeat(minus))));
    all.extend([900, 1_000_000].map(|terms| format!("{}0", "t+".repeat(terms))));
    all.push(format!("{}1", "2^".repeat(900)));
    all.push("max(1,".repeat(300) + "1" + &")".repeat(300));
    all.push("n".repeat(1_999));
    all
}

/// Declarations whose structure is hostile, not a formula.
fn structures() -> Vec<(&'static str, Value)> {
    let state = |low: f64, high: f64| json!({ "start": low, "low": low, "high": high });
    let many: serde_json::Map<String, Value> = (0..7).map(|index| (format!("s{index}"), state(0.0, 1.0))).collect();
    let range = json!({ "low": "0", "high": "1" });
    let values: Vec<f64> = (0..65).map(f64::from).collect();
    vec![
        ("/states", json!({})),
        ("/states", json!(many)),
        ("/states/stock", state(0.0, 0.0)),
        ("/states/stock", state(1e12, 1e12 + 1e-3)),
        ("/states/stock", state(-1e300, 1e300)),
        ("/states/stock", json!({ "start": 4, "low": 60, "high": 0 })),
        ("/states/💥", state(0.0, 1.0)),
        ("/states/", state(0.0, 1.0)),
        ("/states/stock order", state(0.0, 1.0)),
        ("/actions", json!({})),
        ("/actions", json!({ "a": range, "b": range, "c": range, "d": range })),
        ("/actions", json!({ "a": { "values": values[..8] }, "b": { "values": values[..9] } })),
        ("/actions/order", json!({ "values": values })),
        ("/actions/order", json!({ "values": [] })),
        ("/noise", json!({ "name": "demand", "low": 0, "high": 1e300 })),
        ("/noise", json!({ "name": "demand", "low": 0, "high": 0 })),
        ("/noise", json!({ "name": "order", "low": 0, "high": 40 })),
        ("/noise", json!({ "name": "n".repeat(100_000), "low": 0, "high": 40 })),
        ("/history", json!([1e308, -1e308])),
        ("/history", json!([7.0])),
        ("/horizon", json!(1_000)),
        ("/horizon", json!(u32::MAX)),
        ("/discount", json!(0.0)),
        ("/discount", json!(1e-300)),
        ("/parameters/cost", json!(1e308)),
        ("/parameters/cost", json!(-1e12)),
        ("/utility", json!({ "kind": "power", "risk_aversion": 1e300, "of": "stock" })),
        ("/radius", json!({ "rule": "fixed", "radius": 1e308 })),
    ]
}

/// Asserts that a declaration is refused by a rule of its own, or solved.
fn holds(request: &Value, named: &str) {
    match solved(request) {
        Ok(Decided { actions, value, worst_law, .. }) => {
            assert!(value.is_finite() && actions.values().all(|action| action.is_finite()), "{named}: {value}");
            assert!((worst_law.iter().map(|moved| moved.share).sum::<f64>() - 1.0).abs() < 1e-6, "{named}");
        }
        Err(TrainError::Specification(fault)) => {
            assert!(fault.field.starts_with("problem.") && !fault.rule.is_empty(), "{named}: {fault:?}");
        }
        Err(other) => panic!("{named}: {other:?}"),
    }
}

#[test]
fn hostile_declarations_are_refused_or_solved() {
    let mut request = example("stock");
    request["design"]["count"] = json!(10);
    request["problem"]["horizon"] = json!(2);
    let mut tried = 0;
    let mut with = |place: &str, value: Value| {
        let mut hostile = request.clone();
        let (parent, name) = place.rsplit_once('/').unwrap();
        let named = format!("{place} {}", value.to_string().chars().take(80).collect::<String>());
        hostile["problem"].pointer_mut(parent).unwrap()[name] = value;
        holds(&hostile, &named);
        tried += 1;
    };
    for formula in formulas() {
        for place in ["/reward", "/end", "/next/stock", "/actions/order/low", "/actions/order/high"] {
            with(place, json!(formula));
        }
    }
    structures().into_iter().for_each(|(place, value)| with(place, value));
    assert!(tried > 400, "{tried}");
}
