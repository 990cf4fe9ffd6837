//! Limits on the composition of several assets: in a session, in advice, in a walk-forward and in a frontier.

use crate::support::values::{number, replaced};
use crate::support::{App, several_assets};
use ballast::control::cache::Cache;
use ballast::control::evaluation::assets::AssetsBacktest;
use ballast::control::evaluation::frontier::Frontier;
use ballast::control::progress::Watch;
use ballast::control::request::backtest_assets::AssetsBacktestRequest;
use ballast::control::request::frontier::FrontierRequest;
use serde_json::{Value, json};

/// Limits are kept up to this.
const KEPT: f64 = 1e-9;
const NAMES: [&str; 3] = ["stocks", "bonds", "gold"];
const TURNOVER: f64 = 0.15;

/// Stocks at most 0.4, something of gold, and a lower half of what pays interest.
fn limits() -> Value {
    json!({
        "each": { "max": 0.7 },
        "assets": { "stocks": { "max": 0.4 }, "gold": { "min": 0.05 } },
        "groups": [{ "name": "no interest", "assets": ["stocks", "gold"], "min": 0.35, "max": 0.6 }],
        "max_turnover": TURNOVER
    })
}

fn listed(value: &Value) -> [f64; 3] {
    NAMES.map(|name| number(&value[name]))
}

/// Returns the composition of shares of wealth after these log-returns.
fn composition(shares: [f64; 3], log_returns: [f64; 3]) -> [f64; 3] {
    let grown: Vec<f64> = shares.iter().zip(log_returns).map(|(share, z)| share * z.exp()).collect();
    let total: f64 = grown.iter().sum();
    [0, 1, 2].map(|asset| grown[asset] / total)
}

fn check(composition: [f64; 3]) {
    let [stocks, bonds, gold] = composition;
    let low = stocks + gold;
    assert!(stocks < 0.4 + KEPT && bonds < 0.7 + KEPT && gold > 0.05 - KEPT, "{composition:?}");
    assert!((0.35 - KEPT..0.6 + KEPT).contains(&low) && (low + bonds - 1.0).abs() < KEPT, "{composition:?}");
}

fn turnover(before: [f64; 3], after: [f64; 3]) -> f64 {
    before.iter().zip(after).map(|(before, after)| (after - before).abs()).sum()
}

fn limited(mut request: Value) -> Value {
    request["problem"]["limits"] = limits();
    request
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_keeps_the_limits_of_its_fund() {
    let mut app = App::start().await;
    for composition_rule in ["one_step", "equal"] {
        let mut request = limited(several_assets(4));
        request["problem"]["composition"] = json!(composition_rule);
        app.train(&request).await;
        let policy = app.get(&format!("/policies/{}", app.policy)).await.1;
        let kept = &policy["specification"]["fund"]["limits"];
        assert_eq!(
            (&kept["assets"]["gold"], &kept["max_turnover"]),
            (&json!({ "min": 0.05, "max": 1.0 }), &json!(0.15))
        );
        app.open_with(json!({ "wealth": 1000.0, "holdings": { "stocks": 0.1, "bonds": 0.15, "gold": 0.05 } })).await;
        let mut held = composition([0.1, 0.15, 0.05], [0.0; 3]);
        for (period, z) in [[0.05, -0.01, 0.02], [-0.08, 0.01, 0.09], [0.02, 0.0, -0.06]].into_iter().enumerate() {
            let action = app.action().await.1;
            let chosen = listed(&action["composition"]);
            check(chosen);
            assert!(turnover(held, chosen) < TURNOVER + KEPT, "{held:?} {chosen:?}");
            let shares = listed(&action["allocation"]);
            assert!(shares.iter().sum::<f64>() > 0.01, "{action}");
            let returns = json!({ "stocks": z[0], "bonds": z[1], "gold": z[2] });
            let (status, observed) = app.report(period + 1, json!({ "log_returns": returns, "confirm": true })).await;
            assert_eq!(status, 200, "{observed}");
            held = composition(shares, z);
        }
        let action = app.action().await.1;
        app.restart().await;
        assert_eq!(app.action().await.1, action, "replayed");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn advice_keeps_the_limits_and_a_request_without_them_is_as_before() {
    let app = App::start().await;
    let without = json!({ "problem": several_assets(1)["problem"] });
    let mut with = limited(without.clone());
    let free = app.post("/advise", &without).await.1;
    let (status, advised) = app.post("/advise", &with).await;
    assert_eq!(status, 200, "{advised}");
    check(listed(&advised["composition"]));
    assert!(number(&advised["certainty_equivalent"]) <= number(&free["bound"]) + 1e-9, "{advised} {free}");
    assert!((number(&advised["bound"]) / number(&advised["certainty_equivalent"])).ln() < 1e-6, "{advised}");
    // Limits that allow everything, and limits of null.
    for everything in [json!({}), Value::Null] {
        let mut request = without.clone();
        request["problem"]["limits"] = everything;
        let advised = app.post("/advise", &request).await.1;
        let apart = number(&advised["certainty_equivalent"]) / number(&free["certainty_equivalent"]) - 1.0;
        assert!(apart.abs() < 1e-6, "{advised} {free}");
    }
    // Holdings far outside the limits come as near as the limits allow.
    with["holdings"] = json!({ "stocks": 0.9, "bonds": 0.0, "gold": 0.0 });
    let advised = app.post("/advise", &with).await.1;
    check(listed(&advised["composition"]));
    assert!((turnover([1.0, 0.0, 0.0], listed(&advised["composition"])) - 1.2).abs() < 1e-6, "{advised}");
}

#[tokio::test(flavor = "multi_thread")]
async fn limits_that_break_a_rule_are_refused_by_name() {
    let app = App::start().await;
    for (pointer, value, field) in [
        ("/assets/silver", json!({ "max": 0.2 }), "problem.limits.assets.silver"),
        ("/each", json!({ "max": 0.2 }), "problem.limits.groups[0].max"),
        ("/assets/bonds", json!({ "min": 0.96 }), "problem.limits.assets"),
        ("/max_turnover", json!(3.0), "problem.limits.max_turnover"),
        ("/groups", json!([{ "name": "all", "assets": NAMES, "max": 0.9 }]), "problem.limits.groups[0].max"),
    ] {
        let limits = replaced(limits(), pointer, value);
        for mut request in [several_assets(2), json!({ "problem": several_assets(1)["problem"] })] {
            request["problem"]["limits"] = limits.clone();
            let path = if request["design"].is_object() { "/train" } else { "/advise" };
            let (status, refused) = app.post(path, &request).await;
            assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{path} {pointer}: {refused}");
        }
    }
}

#[test]
fn every_strategy_of_a_walk_forward_keeps_the_limits() {
    let wave = |k: usize, speed: f64| (speed * k as f64).sin();
    let rows: Vec<[f64; 3]> = (0..40)
        .map(|k| [0.02 + 0.06 * wave(k, 2.3), 0.01 + 0.02 * wave(k, 1.7), 0.015 + 0.05 * wave(k, 2.9)])
        .collect();
    let dates: Vec<String> = (0..40).map(|k| format!("{}-{:02}", 2000 + k / 4, 3 * (k % 4) + 3)).collect();
    let request: AssetsBacktestRequest = serde_json::from_value(json!({ "assets": NAMES, "simple_returns": rows,
        "rate": 0.002, "dates": dates, "windows": [24], "every": 4, "alpha": 0.9, "limits": limits(),
        "strategies": ["policy", "one_step"], "horizon": 4, "count": 20 }))
    .unwrap();
    let walked = AssetsBacktest::from_request(&request).unwrap().run(&Watch::unwatched(), &|| ()).unwrap();
    let logs: Vec<[f64; 3]> = rows[24..].iter().map(|row| row.map(f64::ln_1p)).collect();
    let (mut checked, mut moved) = (0, 0.0_f64);
    for line in &walked.lines {
        let mut before = None;
        for (shares, z) in line.held.iter().zip(&logs) {
            let shares = [shares[0], shares[1], shares[2]];
            if shares.iter().sum::<f64>() < 1e-6 {
                before = None;
                continue;
            }
            let chosen = composition(shares, [0.0; 3]);
            check(chosen);
            if let Some(before) = before {
                assert!(turnover(before, chosen) < TURNOVER + KEPT, "{}: {before:?} {chosen:?}", line.name);
                moved = moved.max(turnover(before, chosen));
            }
            before = Some(composition(shares, *z));
            checked += 1;
        }
    }
    assert!(checked > 100 && moved > TURNOVER - 1e-4, "{checked} {moved}");
}

#[test]
fn a_frontier_takes_limits_but_no_turnover() {
    let rows: Vec<[f64; 2]> = (0..24)
        .map(|k| [0.015 + 0.05 * f64::from(k * 7 % 11 - 5) / 5.0, 0.01 + 0.04 * f64::from(k * 5 % 13 - 6) / 6.0])
        .collect();
    let request = |limits: Value| -> FrontierRequest {
        let problem = json!({ "assets": ["one", "two"], "history": rows, "rate_per_step": 0.002, "limits": limits });
        serde_json::from_value(json!({ "problem": problem, "resamples": 20, "scales": [0.0, 0.5] })).unwrap()
    };
    let run = |limits: Value| {
        let question = request(limits).question().unwrap();
        serde_json::to_value(Frontier::new(question, Cache::default()).run(&Watch::unwatched()).unwrap()).unwrap()
    };
    assert_ne!(run(json!({ "assets": { "one": { "max": 0.1 } } })), run(Value::Null));
    let refused = request(json!({ "max_turnover": 0.2 })).question().unwrap_err();
    assert_eq!(refused.field, "problem.limits.max_turnover");
}
