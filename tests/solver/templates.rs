//! The declarations of `examples/problems`, each against a closed form or a solver of its own. `declared.rs` holds the cases of
//! `tests/data/general.json`.

use std::collections::BTreeMap;

use ballast::control::policy::advisor::AdviceMode;
use ballast::control::problem::state::State;
use ballast::control::request::learning::Learning;
use serde_json::{Value, json};

use crate::declared::{action, example, solved};
use crate::support::policies::advisor;

fn history(request: &Value) -> Vec<f64> {
    serde_json::from_value(request["problem"]["history"].clone()).unwrap()
}

/// With a known law the stock is filled up to a quantile of the demand: in the last period that of
/// `(price - cost)/(price - salvage + holding)`, and before it that of `(price - cost)/(price - cost + holding)`, because what is
/// left saves the cost of a new order.
#[test]
fn a_stock_is_filled_to_a_quantile() {
    let mut request = example("stock");
    request["problem"]["framework"] = json!("static");
    request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.0 });
    request["design"]["count"] = json!(300);
    let mut demands = history(&request);
    demands.sort_by(f64::total_cmp);
    let quantile = |level: f64| demands[(level * demands.len() as f64).ceil() as usize - 1];
    for (horizon, level) in [(1, quantile(4.0 / 6.5)), (2, quantile(4.0 / 4.5)), (4, quantile(4.0 / 4.5))] {
        request["problem"]["horizon"] = json!(horizon);
        let order = action(&solved(&request).unwrap());
        println!("{horizon}: {order} for {}", level - 4.0);
        assert!((order - (level - 4.0)).abs() < 0.05, "{horizon}: {order} for {}", level - 4.0);
    }
}

/// The paper's own problem, declared.
#[test]
fn a_declared_investor_is_the_investor() {
    for framework in ["static", "adaptive"] {
        let mut request = example("investor");
        request["problem"]["framework"] = json!(framework);
        let (declared, history) = (solved(&request).unwrap(), history(&request));
        let investor = advisor(json!({ "problem": {
            "history": history, "horizon": 3, "rate_per_step": 0.002, "framework": framework,
            "utility": { "kind": "power", "risk_aversion": 20.0 },
            "support": { "rule": "between", "min": -0.4, "max": 0.4 },
            "radius": { "rule": "root_n", "kappa": 0.01 } },
            "design": { "count": 300 } }));
        let state = State::new(&history, 100.0, Learning::default()).unwrap();
        let own = investor.advise(0, &state, AdviceMode::Resolve);
        let off = 1e4 * (declared.value / own.certainty_equivalent).ln();
        println!("{framework}: {off:+.4} bp, {} for {}", action(&declared), own.allocation);
        assert!(off.abs() < 0.05, "{framework}: {off} bp");
        assert!(
            (action(&declared) - own.allocation).abs() < 0.002,
            "{framework}: {} for {}",
            action(&declared),
            own.allocation
        );
    }
}

/// The premium that nested enumeration gives the same call in `examples/hedge.rs`, which prints it.
#[test]
fn a_hedge_costs_its_premium() {
    let (enumerated, held) = (4.026203, 0.5798);
    let worth = |calls: f64| {
        let mut request = example("hedge");
        request["problem"]["parameters"]["calls"] = json!(calls);
        solved(&request).unwrap()
    };
    let (with, without) = (worth(1.0), worth(0.0));
    let premium = (without.value - with.value) / 1.002_f64.powi(3);
    println!("{premium} for {enumerated}, {} for {held}", action(&with));
    // The value is kinked where a return of the record ends at the strike, and the surrogate rounds the kinks.
    assert!((premium / enumerated - 1.0).abs() < 3e-4, "{premium} for {enumerated}");
    assert!((action(&with) - held).abs() < 0.01, "{} for {held}", action(&with));
}

/// With logarithmic utility of what is spent, the share spent depends on neither the law, the radius nor the learning: of b the
/// discount and n periods with the end, it is `(1 - b)/(1 - b^(n + 1))`.
#[test]
fn spending_has_its_closed_form() {
    for (framework, horizon, start, share) in [
        ("adaptive", 5, 4.6, json!({ "low": "0", "high": "1" })),
        ("static", 3, 0.0, json!({ "low": "0", "high": "1" })),
        ("plug_in", 2, -2.0, json!({ "values": [0, 0.5, 1] })),
    ] {
        let mut request = example("spending");
        let problem = &mut request["problem"];
        problem["framework"] = json!(framework);
        problem["horizon"] = json!(horizon);
        problem["states"]["log_wealth"]["start"] = json!(start);
        problem["actions"]["share"] = share;
        let advice = solved(&request).unwrap();
        let discount = 0.95_f64;
        let spent = (1.0 - discount) / (1.0 - discount.powi(horizon + 1));
        println!("{framework} over {horizon}: {:?} for {spent}", advice.actions);
        assert!((advice.actions["spent"] - spent).abs() < 1e-3, "{framework} over {horizon}: {advice:?} for {spent}");
    }
}

/// A seller of an inventory whose price moves by the noise and falls with each sale. The value is linear in the noise, so the
/// worst law of a fixed ball lowers the mean by the radius, and the rest is a quadratic program: with the drift d of the worst
/// law, slice t of n is `X/n + (t - (n - 1)/2) d / (2 k)`, the last at the end.
#[test]
fn a_liquidation_has_its_closed_form() {
    let (inventory, price, impact, horizon) = (12.0, 50.0, 0.4, 3);
    for radius in [0.0, 0.2] {
        let mut request = example("liquidation");
        request["design"]["count"] = json!(150);
        request["problem"]["radius"]["radius"] = json!(radius);
        let (advice, history) = (solved(&request).unwrap(), history(&request));
        let slices = f64::from(horizon) + 1.0;
        let drift = history.iter().sum::<f64>() / history.len() as f64 - radius;
        let slice = |t: f64| inventory / slices + (t - 0.5 * f64::from(horizon)) * drift / (2.0 * impact);
        let earned = |t: f64| slice(t) * (price + t * drift) - impact * slice(t).powi(2);
        let value: f64 = (0..=horizon).map(|t| earned(f64::from(t))).sum();
        println!("{radius}: {} for {value}, {} for {}", advice.value, action(&advice), slice(0.0));
        assert!((advice.value - value).abs() < 2e-3, "{radius}: {} for {value}", advice.value);
        let off = (action(&advice) - slice(0.0)).abs();
        assert!(off < 0.01 * inventory, "{radius}: {} for {}", action(&advice), slice(0.0));
    }
}

/// A linear state with quadratic costs. At radius 0 the value is `-(x'Px + c)`, with P by the Riccati recursion, and the noise,
/// whose mean is 0, adds its variance times the weight of the speed to c in each period.
#[test]
fn a_regulator_has_its_riccati_recursion() {
    let mut request = example("regulator");
    request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.0 });
    let (history, cost) = (history(&request), 0.5);
    let variance = history.iter().map(|gust| gust * gust).sum::<f64>() / history.len() as f64;
    assert!(history.iter().sum::<f64>().abs() < 1e-12);
    // P as [[a, b], [b, d]], the state after a period without a push as (x + v, v).
    let (mut weights, mut constant, mut gains) = ([1.0, 0.0, 1.0], 0.0, [0.0; 2]);
    for _ in 0..5 {
        let [a, b, d] = weights;
        constant += variance * d;
        // The push moves the speed, so P B = (b, d), and A'P B = (b, b + d).
        gains = [b / (cost + d), (b + d) / (cost + d)];
        weights = [
            1.0 + a - b * b / (cost + d),
            a + b - b * (b + d) / (cost + d),
            a + 2.0 * b + d - (b + d) * (b + d) / (cost + d),
        ];
    }
    for [position, speed] in [[3.0, -1.0], [-1.0, 0.5], [0.0, 0.0]] {
        for (name, start) in BTreeMap::from([("position", position), ("speed", speed)]) {
            request["problem"]["states"][name]["start"] = json!(start);
        }
        let advice = solved(&request).unwrap();
        let [a, b, d] = weights;
        let value = -(a * position * position + 2.0 * b * position * speed + d * speed * speed + constant);
        let push = -(gains[0] * position + gains[1] * speed);
        assert!(push.abs() < 3.0, "{push} is at a bound");
        println!("{position}, {speed}: {} for {value}, {} for {push}", advice.value, action(&advice));
        assert!((advice.value - value).abs() < 0.01 * value.abs(), "{} for {value}", advice.value);
        assert!((action(&advice) - push).abs() < 0.03, "{} for {push}", action(&advice));
    }
}
