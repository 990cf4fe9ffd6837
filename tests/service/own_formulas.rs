//! Strategies that a user states in formulas: in a walk-forward of one asset and of several they are the shares that the
//! formula gives by hand, and on simulated paths those of a plain simulation.

use ballast::control::evaluation::paths::Evaluation;
use ballast::control::request::evaluation::EvaluationRequest;
use serde_json::{Value, json};

use crate::support::App;
use crate::support::values::number;

const MONTHS: usize = 72;

fn months(seed: usize) -> Vec<f64> {
    (0..MONTHS).map(|month| 0.004 + 0.002 * (((37 * month + 11 * seed) % 41) as f64 - 20.0)).collect()
}

async fn report(app: &App, path: &str, request: &Value) -> Value {
    let (status, queued) = app.post(path, request).await;
    assert_eq!(status, 202, "{queued}");
    let job = app.until(queued["job"].as_str().unwrap(), |job| job["finished_ms"].is_i64()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    app.get(job["report"].as_str().unwrap()).await.1
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn line<'a>(report: &'a Value, name: &str) -> (&'a Value, &'a Value) {
    let strategies = report["strategies"].as_array().unwrap();
    let place = strategies.iter().position(|one| one["strategy"] == name).unwrap();
    (&strategies[place], &report["periods"][place])
}

fn dates() -> Vec<String> {
    (0..MONTHS).map(|month| format!("{}-{:02}-28", 2000 + month / 12, 1 + month % 12)).collect()
}

/// A trend rule by a formula has the account of the shares that are found by hand, period by period.
#[tokio::test(flavor = "multi_thread")]
async fn a_formula_walks_as_the_shares_that_it_means() {
    let app = App::start().await;
    let risky = months(1);
    let simple: Vec<f64> = risky.iter().map(|z| z.exp() - 1.0).collect();
    let bank: Vec<f64> = (0..MONTHS).map(|month| 0.001 + 0.0005 * (month % 3) as f64).collect();
    let by_hand: Vec<f64> = (0..MONTHS)
        .map(|month| match month {
            0..12 => 0.0,
            _ if mean(&simple[month - 12..month]) > bank[month - 1] => 1.0,
            _ => (0.25 + 3.0 * simple[month - 1]).clamp(0.0, 1.0),
        })
        .collect();
    assert!(by_hand.contains(&1.0) && by_hand[12..].iter().any(|share| *share < 1.0));
    let request = json!({ "log_returns": risky, "rate": bank, "dates": dates(), "window": 24, "every": 12, "count": 10,
        "alpha": [0.5], "weights": { "By hand": by_hand, "Trend": "if(mean12 > bank, 1, 0.25 + 3*last)",
            "Late": "if(n >= 48, 0.5, 0)" } });
    let report = report(&app, "/backtest", &request).await;
    let ((trend, periods), (hand, expected)) = (line(&report, "Trend"), line(&report, "By hand"));
    let wealth = |periods: &Value| -> Vec<f64> { periods["wealth"].as_array().unwrap().iter().map(number).collect() };
    for (one, other) in wealth(periods).iter().zip(wealth(expected)) {
        assert!((one / other - 1.0).abs() < 1e-12, "{one} {other}");
    }
    assert_eq!((&trend["kind"], &hand["kind"]), (&json!("own"), &json!("own")));
    let late: Vec<f64> = line(&report, "Late").1["allocation"].as_array().unwrap().iter().map(number).collect();
    assert_eq!((late[23], late[24]), (0.0, 0.5));
}

/// With several assets one over the deviation is inverse volatility, and a formula that says 1 is equal shares.
#[tokio::test(flavor = "multi_thread")]
async fn a_formula_of_several_assets_gives_each_its_share() {
    let app = App::start().await;
    let (one, other) = (months(1), months(3));
    let rows: Vec<[f64; 2]> = one.iter().zip(&other).map(|(one, other)| [*one, 0.5 * other]).collect();
    let request = json!({ "assets": ["a", "b"], "log_returns": rows, "rate": 0.001, "dates": dates(), "windows": [24],
        "strategies": ["one_step"], "weights": { "One": "1", "Inverse": "1/deviation24", "Half": "0.25" } });
    let report = report(&app, "/backtest", &request).await;
    let wealth =
        |name: &str| -> Vec<f64> { line(&report, name).1["wealth"].as_array().unwrap().iter().map(number).collect() };
    let inverse =
        report["strategies"].as_array().unwrap().iter().find(|one| one["kind"] == "inverse_volatility").unwrap();
    for (own, known) in [("One", "Equal shares"), ("Inverse", inverse["strategy"].as_str().unwrap())] {
        for (one, other) in wealth(own).iter().zip(wealth(known)) {
            // Inverse volatility is by the deviations of log-returns, which differ in the third digit here.
            let reach = if own == "One" { 1e-12 } else { 5e-3 };
            assert!((one / other - 1.0).abs() < reach, "{own}: {one} {other}");
        }
    }
    let held = line(&report, "Half").1["allocations"]["b"].as_array().unwrap();
    assert!(held.iter().all(|share| number(share) == 0.25), "{held:?}");
}

/// On simulated paths a formula ends where a plain simulation of it ends, and one that is a constant ends as that mix.
#[tokio::test(flavor = "multi_thread")]
async fn a_formula_is_followed_on_simulated_paths() {
    let app = App::start().await;
    let history = &months(2)[..30];
    let request = json!({ "problem": { "horizon": 6, "rate_per_step": 0.002, "history": history, "initial_wealth": 50.0,
            "trading_cost": 0.002 }, "frameworks": [], "constant_mixes": [0.3], "paths": 200, "seed": 5,
        "weights": { "Constant": "0.3", "Trend": "if(mean3 > mean, 0.9, 0.1)" } });
    let found = report(&app, "/evaluate", &request).await;
    let strategies = found["strategies"].as_array().unwrap();
    let named = |name: &str| strategies.iter().find(|one| one["strategy"] == name).unwrap();
    assert_eq!(named("Constant")["wealth"], named("30 % in stocks")["wealth"]);
    assert_eq!((&named("Trend")["framework"], &named("Trend")["constant_mix"]), (&Value::Null, &Value::Null));
    // The same paths, followed by hand.
    let request: EvaluationRequest = serde_json::from_value(request).unwrap();
    let evaluation = Evaluation::new(request).unwrap();
    let ended = (0..200).map(|path| {
        let (mut wealth, mut held, mut seen) = (50.0, 0.0, history.to_vec());
        for z in evaluation.returns(0, path) {
            let simple: Vec<f64> = seen.iter().map(|z| z.exp() - 1.0).collect();
            let share = if mean(&simple[simple.len() - 3..]) > mean(&simple) { 0.9 } else { 0.1 };
            wealth *= 1.0 - 0.002 * f64::abs(share - held);
            let grown = (1.0 - share) * 1.002 + share * z.exp();
            held = share * z.exp() / grown;
            wealth *= grown;
            seen.push(z);
        }
        wealth
    });
    let expected = mean(&ended.collect::<Vec<f64>>());
    assert!((number(&named("Trend")["wealth"]["mean"]["value"]) / expected - 1.0).abs() < 1e-12, "{expected}");
}

/// Percent in place of a share, and a formula without a value where it decides, are refused by name, in a walk and on paths.
#[tokio::test(flavor = "multi_thread")]
async fn a_formula_in_percent_is_not_taken_for_all_of_wealth() {
    let app = App::start().await;
    let walk = |formula: &str| {
        json!({ "log_returns": months(1), "rate": 0.001, "dates": dates(), "window": 24, "every": 12, "count": 10,
            "alpha": [0.5], "weights": { "Mine": formula } })
    };
    let paths = |formula: &str| {
        json!({ "problem": { "horizon": 2, "history": months(2)[..30], "rate_per_step": 0.001 }, "frameworks": [], "paths": 10,
            "weights": { "Mine": formula } })
    };
    for (formula, rule) in [
        ("60", "as 0.6 for 60 %"),
        ("if(last > 0.01, 60, 0)", "min(1, …)"),
        ("mean60", "it has no value after"),
        ("wealth", "column 1"),
    ] {
        for (path, request) in [("/backtest", walk(formula)), ("/evaluate", paths(formula))] {
            let (status, answer) = app.post(path, &request).await;
            let (field, found) = (&answer["field"], answer["rule"].as_str().unwrap_or_default());
            assert!(status == 422 && field == "weights.Mine" && found.contains(rule), "{path} {formula}: {answer}");
        }
    }
}
