//! Advice without a policy or a session is that of a policy for one period, to the last bit.

use crate::support::App;
use serde_json::{Value, json};

const HISTORY: [f64; 8] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037];

fn problems() -> Vec<Value> {
    let power = || json!({ "kind": "power", "risk_aversion": 12.0 });
    vec![
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": power(), "radius": { "rule": "bridge", "alpha": 0.5, "paths": 500, "scale": 0.3 } }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": { "kind": "exponential", "risk_aversion": 0.05 },
            "radius": { "rule": "root_n", "kappa": 0.01 }, "trading_cost": 0.004, "contributions": -3.0 }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "framework": "static", "utility": { "kind": "log" }, "action_interval": [0.0, 0.7],
            "radius": { "rule": "fixed", "radius": 0.003 } }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "framework": "parametric_static", "utility": power(),
            "radius": { "rule": "chi_square", "alpha": 0.9 } }),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn it_is_what_a_policy_for_one_period_advises_to_the_last_bit() {
    let mut app = App::start().await;
    let mut held = 0;
    for problem in problems() {
        let (status, advised) =
            app.post("/advise", &json!({ "problem": problem, "wealth": 80.0, "holding": 0.25 })).await;
        assert_eq!(status, 200, "{advised}");
        let mut trained = problem.clone();
        (trained["horizon"], trained["initial_wealth"]) = (json!(1), json!(80.0));
        app.train(&json!({ "problem": trained, "design": { "count": 20 } })).await;
        app.open_with(json!({ "holding": 0.25 })).await;
        let (_, action) = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await;
        let fields =
            ["allocation", "band", "trade", "certainty_equivalent", "floor", "radius", "contribution", "worst_case"];
        for field in fields.into_iter().chain(["holding", "sample_size", "source"]) {
            assert_eq!(advised[field], action[field], "{field} of {problem}");
        }
        held += usize::from(advised["allocation"].as_f64().unwrap() > 0.0);
        assert_eq!(advised["source"], "resolved");
        // The horizon may be said, and nothing else.
        let mut with_horizon = problem.clone();
        with_horizon["horizon"] = json!(1);
        assert_eq!(
            app.post("/advise", &json!({ "problem": with_horizon, "wealth": 80.0, "holding": 0.25 })).await.1,
            advised
        );
    }
    assert!(held >= 3, "{held} of the investors hold anything");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_may_read_may_ask() {
    let mut app = App::start().await;
    let key = app.key("north", "read").await;
    app.restart().await;
    let question = json!({ "problem": { "rate_per_step": 0.002, "history": HISTORY } });
    for (held, expected) in [(key.as_str(), 200), ("", 401)] {
        app.hold(held);
        assert_eq!(app.post("/advise", &question).await.0, expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_advised_is_refused_by_field_and_nothing_is_stored() {
    let app = App::start().await;
    let ask = |change: Value, problem: Value| {
        let mut question = json!({ "problem": { "rate_per_step": 0.002, "history": HISTORY } });
        question["problem"].as_object_mut().unwrap().extend(problem.as_object().unwrap().clone());
        question.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        question
    };
    for (question, field) in [
        (ask(json!({ "wealth": 0.0 }), json!({})), "wealth"),
        (ask(json!({ "holding": 1.5 }), json!({})), "holding"),
        (ask(json!({ "seed": -1 }), json!({})), "seed"),
        (ask(json!({}), json!({ "horizon": 12 })), "problem.horizon"),
        (ask(json!({}), json!({ "history": [0.1] })), "problem.history"),
        (ask(json!({}), json!({ "rate_per_step": "a tenth" })), "problem.rate_per_step"),
        (ask(json!({ "wealth": 10.0 }), json!({ "contributions": -40.0 })), "problem.initial_wealth"),
        (json!({ "problem": { "history": HISTORY } }), "problem.rate_per_step"),
        (json!({ "problem": 3 }), "problem"),
        (json!({}), "problem"),
    ] {
        let (status, problem) = app.post("/advise", &question).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{question} {problem}");
    }
    // Of two values of one field neither is meant.
    let twice = r#"{"problem": {"history": [0.1, -0.1], "rate_per_step": 0.001, "rate_per_step": 0.002}}"#;
    let request = app.client.post(format!("{}/advise", app.url)).header("content-type", "application/json").body(twice);
    let (status, problem) = crate::support::read(request.send().await.unwrap()).await;
    let refused = (status.as_u16(), &problem["field"], &problem["rule"]);
    assert_eq!(refused, (422, &json!("problem"), &json!("duplicate field `rate_per_step`")));
    assert_eq!(app.post("/advise", &ask(json!({}), json!({}))).await.0, 200);
    let (_, jobs) = app.get("/jobs").await;
    let (_, policies) = app.get("/policies").await;
    assert_eq!((&jobs["jobs"], &policies["policies"]), (&json!([]), &json!([])));
}

/// The ratio of wealth to the wealth at the start is what such an investor cares for, in whatever money both are counted.
#[tokio::test(flavor = "multi_thread")]
async fn a_relative_risk_aversion_is_of_the_wealth_at_the_start() {
    let mut app = App::start().await;
    let problem = |utility: Value| {
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": utility, "radius": { "rule": "fixed", "radius": 0.003 },
        "support": { "rule": "none" } })
    };
    let relative = || problem(json!({ "kind": "exponential", "risk_aversion_relative": 5 }));
    let absolute = |risk_aversion: f64| problem(json!({ "kind": "exponential", "risk_aversion": risk_aversion }));
    let mut found = Vec::new();
    for wealth in [100.0, 1e5, 1e15] {
        let ask = |problem: Value| json!({ "problem": problem, "wealth": wealth });
        let advised = app.post("/advise", &ask(relative())).await;
        assert_eq!(advised, app.post("/advise", &ask(absolute(5.0 / wealth))).await, "to the last bit");
        found.push((
            advised.1["allocation"].as_f64().unwrap(),
            advised.1["certainty_equivalent"].as_f64().unwrap() / wealth,
        ));
    }
    assert!((0.1..0.9).contains(&found[0].0), "{found:?}");
    for (allocation, worth) in &found {
        // Nearer actions are one to the search, and its optimum is flat.
        assert!((allocation - found[0].0).abs() < 1e-6 && (worth - found[0].1).abs() < 1e-12, "{found:?}");
    }
    // A policy is named by its bytes, which hold the absolute one.
    let train = |mut problem: Value| {
        problem["horizon"] = json!(2);
        json!({ "problem": problem, "design": { "count": 20 } })
    };
    app.train(&train(relative())).await;
    let policy = app.policy.clone();
    app.train(&train(absolute(0.05))).await;
    assert_eq!(app.policy, policy);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_answer_to_a_problem_says_what_may_be_a_mistake_and_its_rates_a_year() {
    let mut app = App::start().await;
    let problem = json!({ "rate_per_step": 0.03, "periods_per_year": 12, "history": HISTORY, "horizon": 1 });
    let warned = |answer: &Value| -> Vec<Value> {
        answer["warnings"].as_array().unwrap().iter().map(|warning| warning["code"].clone()).collect()
    };
    let (_, advised) = app.post("/advise", &json!({ "problem": problem })).await;
    let (status, evaluated) = app.post("/evaluate", &json!({ "problem": problem, "frameworks": [] })).await;
    assert_eq!(status, 202, "{evaluated}");
    let request = json!({ "problem": problem, "design": { "count": 20 } });
    let (_, accepted) = app.post("/train", &request).await;
    app.train(&request).await;
    let (_, detail) = app.get(&format!("/policies/{}", app.policy)).await;
    for answer in [&advised, &evaluated, &accepted, &detail] {
        assert_eq!(warned(answer), ["rate_high", "rate_above_record"], "{answer}");
        assert_eq!(answer["warnings"][0]["field"], "problem.rate_per_step");
    }
    for answer in [&advised, &detail] {
        // 1.03^12 by hand, to four digits.
        assert!((answer["annualised"]["rate"].as_f64().unwrap() - 0.4258).abs() < 5e-5, "{answer}");
    }
    let usual = json!({ "problem": { "rate_per_step": 0.002, "history": HISTORY } });
    let (_, advised) = app.post("/advise", &usual).await;
    assert_eq!((warned(&advised), advised.get("annualised")), (vec![], None));
}

/// Every direct solution whose radius may be asked for, through HTTP: values within 0.02 of a hundredth of a percent, allocations
/// within 0.005 or where the value is flat.
#[tokio::test(flavor = "multi_thread")]
async fn several_assets_are_advised_by_name_as_solved_directly() {
    const BP: f64 = 1e-4;
    let app = App::start().await;
    let oracle: Value = serde_json::from_str(include_str!("../data/assets.json")).unwrap();
    let mut held = 0;
    for case in oracle["cases"].as_array().unwrap() {
        let width = case["returns"][0].as_array().unwrap().len();
        // Names whose order is not that of the columns.
        let names: Vec<String> = (0..width).map(|asset| format!("asset {}", width - asset)).collect();
        let (kind, risk_aversion) = (&case["utility"], &case["risk_aversion"]);
        let utility = match kind.as_str().unwrap() {
            "log" => json!({ "kind": "log" }),
            _ => json!({ "kind": kind, "risk_aversion": risk_aversion }),
        };
        let mut problem = json!({ "assets": names, "ground_norm": case["norm"], "history": case["returns"], "utility": utility,
            "rate_per_step": case["rate_per_step"], "radius": { "rule": "fixed", "radius": case["radius"] } });
        problem["support"] = match case["floor"].is_null() {
            true => json!({ "rule": "none" }),
            false => json!({ "rule": "between", "min": case["floor"], "max": 5.0 }),
        };
        let (status, advised) = app.post("/advise", &json!({ "problem": problem, "wealth": case["wealth"] })).await;
        assert_eq!(status, 200, "{advised}");
        let number = |field: &str| advised[field].as_f64().unwrap();
        let expected = case["log_certainty_equivalent_over_bank"].as_f64().unwrap();
        let gains = ["certainty_equivalent", "bound"].map(|field| (number(field) / number("floor")).ln());
        assert!((gains[0] - expected).abs() < 0.02 * BP, "{case} {advised}");
        assert!((0.0..0.01 * BP).contains(&(gains[1] - gains[0])), "{case} {advised}");
        let shares: Vec<f64> = names.iter().map(|name| advised["allocation"][name].as_f64().unwrap()).collect();
        let apart = |(asset, share): (usize, &f64)| (share - case["allocation"][asset].as_f64().unwrap()).abs();
        // Two of the cases are flat between assets that are alike.
        held += usize::from(shares.iter().enumerate().map(apart).fold(0.0, f64::max) < 0.005);
        let total = number("total");
        assert!((shares.iter().sum::<f64>() - total).abs() < 1e-12, "{advised}");
        for name in &names {
            let [seen, worst] = ["seen", "worst"].map(|mean| advised["worst_means"][name][mean].as_f64().unwrap());
            assert!(worst <= seen, "{advised}");
            let [share, part] = ["allocation", "composition"].map(|field| advised[field][name].as_f64().unwrap());
            assert!(total < 1e-4 || (share - part * total).abs() < 1e-9, "{advised}");
        }
        assert_eq!(advised["caution"][0]["code"], "short_record");
    }
    assert!(held >= 22, "{held} of 26");
}

/// Everything sold costs what is held; what is held is kept where a trade would not pay for itself; and a risk aversion given as a
/// number is that of the utility it stands for.
#[tokio::test(flavor = "multi_thread")]
async fn holdings_and_a_trading_cost_of_several_assets_are_known() {
    let app = App::start().await;
    let row = |month: u32| [0.9, 1.7].map(|pace| 0.012 + 0.03 * (pace * f64::from(month)).sin());
    let rows: Vec<[f64; 2]> = (0..60).map(row).collect();
    let problem = json!({ "assets": ["a", "b"], "history": rows, "rate_per_step": 0.002, "trading_cost": 0.01, "risk_aversion": 5.0 });
    let advise = async |holdings: Value| {
        let request = json!({ "problem": problem, "wealth": 1000.0, "holdings": holdings });
        let (status, advised) = app.post("/advise", &request).await;
        assert_eq!(status, 200, "{advised}");
        advised
    };
    let from_bank = advise(json!({ "a": 0.0, "b": 0.0 })).await;
    let held = json!({ "a": 0.3, "b": 0.5 });
    let from_held = advise(held.clone()).await;
    let number = |value: &Value| value.as_f64().unwrap();
    assert!((number(&from_held["floor"]) - 1002.0 * (1.0 - 0.01 * 0.8)).abs() < 1e-9, "{from_held}");
    assert_eq!(from_bank["floor"], 1002.0);
    for name in ["a", "b"] {
        let [share, trade] = ["allocation", "trade"].map(|field| number(&from_held[field][name]));
        assert!((share - trade - number(&held[name])).abs() < 1e-12, "{from_held}");
    }
    // Where he ends, he would stay.
    let again = advise(from_held["allocation"].clone()).await;
    assert_eq!(again["allocation"], from_held["allocation"], "{again}");
    assert_ne!(from_held["allocation"], from_bank["allocation"]);
    let mut spelled = problem.clone();
    spelled["risk_aversion"] = Value::Null;
    spelled["utility"] = json!({ "kind": "power", "risk_aversion": 5.0 });
    let (_, other) = app.post("/advise", &json!({ "problem": spelled, "wealth": 1000.0, "holdings": held })).await;
    assert_eq!(other, from_held);

    for (name, value, field) in [
        ("holdings", json!({ "a": 0.5 }), "holdings.b"),
        ("holdings", json!({ "a": 0.5, "b": 0.6 }), "holdings"),
        ("holdings", json!({ "a": 0.5, "b": 0.1, "c": 0.1 }), "holdings.c"),
        ("holdings", json!({ "a": -0.1, "b": 0.1 }), "holdings.a"),
    ] {
        let mut request = json!({ "problem": problem });
        request[name] = value;
        let (status, refused) = app.post("/advise", &request).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{refused}");
    }
    for (name, value, field) in [
        ("utility", json!({ "kind": "exponential", "risk_aversion_relative": 3.0 }), "problem.trading_cost"),
        ("utility", json!({ "kind": "log" }), "problem.risk_aversion"),
        ("risk_aversion", json!(0.5), "problem.risk_aversion"),
        ("trading_cost", json!(0.2), "problem.trading_cost"),
    ] {
        let mut problem = problem.clone();
        problem[name] = value;
        if field == "problem.trading_cost" {
            problem["risk_aversion"] = Value::Null;
        }
        let (status, refused) = app.post("/advise", &json!({ "problem": problem })).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{refused}");
    }
}

/// The share without a crash is the advice under a floor at the lowest return seen, asked for by itself; and the
/// crash is most of what keeps power utility from a record that pays.
#[tokio::test(flavor = "multi_thread")]
async fn the_crash_is_what_a_floor_at_the_lowest_return_takes_away() {
    let app = App::start().await;
    let rows: Vec<[f64; 2]> = HISTORY.iter().zip(HISTORY.iter().rev()).map(|(left, right)| [*left, *right]).collect();
    let lowest = HISTORY.iter().copied().fold(f64::INFINITY, f64::min);
    let mut loss = 0.0_f64;
    for norm in ["scaled_one", "sup"] {
        let mut problem = json!({ "assets": ["left", "right"], "ground_norm": norm, "history": rows, "rate_per_step": 0.0,
            "utility": { "kind": "power", "risk_aversion": 3.0 }, "radius": { "rule": "fixed", "radius": 0.004 },
            "support": { "rule": "none" } });
        let (status, advised) = app.post("/advise", &json!({ "problem": problem })).await;
        assert_eq!(status, 200, "{advised}");
        problem["support"] = json!({ "rule": "between", "min": lowest, "max": 5.0 });
        let floored = app.post("/advise", &json!({ "problem": problem })).await.1;
        assert_eq!(floored["without_crash"], Value::Null, "{floored}");
        let number = |of: &Value, field: &str| of[field].as_f64().unwrap();
        let without = number(&advised, "without_crash");
        // Both searches end within their bounds, which a flat optimum lets lie apart.
        assert!((without - number(&floored, "total")).abs() < 0.005, "{advised} {floored}");
        loss = loss.max(without - number(&advised, "total"));
    }
    assert!(loss > 0.05, "{loss}");
}

/// Columns that are one asset are advised as that asset, and the radius of all funds is that of the fund of inverse volatilities
/// times the factor.
#[tokio::test(flavor = "multi_thread")]
async fn several_assets_that_are_one_are_advised_as_one() {
    let app = App::start().await;
    for radius in [json!({ "rule": "fixed", "radius": 0.002 }), json!({ "rule": "bridge", "alpha": 0.5, "scale": 0.2 })]
    {
        let one = json!({ "history": HISTORY, "rate_per_step": 0.002, "radius": radius });
        let twice: Vec<[f64; 2]> = HISTORY.iter().map(|z| [*z, *z]).collect();
        for norm in ["scaled_one", "sup"] {
            let several = json!({ "assets": ["left", "right"], "ground_norm": norm, "history": twice, "rate_per_step": 0.002,
                "radius": radius });
            let single = app.post("/advise", &json!({ "problem": one })).await.1;
            let (status, advised) = app.post("/advise", &json!({ "problem": several })).await;
            assert_eq!(status, 200, "{advised}");
            let number = |of: &Value, field: &str| of[field].as_f64().unwrap();
            // All funds are one fund, whose returns are rounded once more.
            assert!((number(&advised, "radius_factor") - 1.0).abs() < 1e-9, "{advised}");
            for (field, within) in [("radius", 1e-9), ("floor", 1e-12), ("certainty_equivalent", 2e-6)] {
                let apart = number(&advised, field) / number(&single, field) - 1.0;
                assert!(apart.abs() < within, "{field}: {advised} {single}");
            }
            assert!((number(&advised, "total") - number(&single, "allocation")).abs() < 0.005, "{advised} {single}");
            assert!(number(&single, "allocation") > 0.05, "{single}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_with_several_assets_is_named() {
    let app = App::start().await;
    let history: Vec<[f64; 2]> = HISTORY.iter().map(|z| [*z, 0.5 * z * z]).collect();
    let good = json!({ "assets": ["stocks", "bonds"], "history": history, "rate_per_step": 0.002 });
    let (status, advised) = app.post("/advise", &json!({ "problem": good })).await;
    assert_eq!(status, 200, "{advised}");
    // Two assets lie further apart than one.
    assert!(advised["radius_factor"].as_f64().unwrap() > 1.0, "{advised}");
    let with = |change: &dyn Fn(&mut Value)| {
        let mut problem = good.clone();
        change(&mut problem);
        json!({ "problem": problem })
    };
    let cases: Vec<(Value, &str)> = vec![
        (with(&|p| p["assets"] = json!(["stocks"])), "problem.assets"),
        (with(&|p| p["means"] = json!({ "kind": "shrunk", "intensity": 1.5 })), "problem.means.intensity"),
        (
            with(&|p| {
                p["means"] = json!({ "kind": "bayes_stein" });
                p["support"] = json!({ "rule": "between", "min": -0.9, "max": 0.9 });
            }),
            "problem.means.kind",
        ),
        (with(&|p| p["assets"] = json!(["stocks", "stocks"])), "problem.assets[1]"),
        (with(&|p| p["assets"] = json!(["stocks", ""])), "problem.assets[1]"),
        (with(&|p| p["history"][3] = json!([0.01])), "problem.history[3]"),
        (with(&|p| p["history"][3] = json!([0.01, 9.0])), "problem.history[3][1]"),
        (with(&|p| p["history"] = json!([[0.01, 0.02]])), "problem.history"),
        (with(&|p| p["history"] = json!([[0.01, 0.02], [0.03, 0.02]])), "problem.history, bonds"),
        (with(&|p| p["support"] = json!({ "rule": "between", "min": -1.0, "max": 0.0 })), "problem.history[0][0]"),
        (with(&|p| p["support"] = json!({ "rule": "between", "min": -29.0, "max": 5.0 })), "problem.support.min"),
        (with(&|p| p["ground_norm"] = json!("two")), "problem.ground_norm"),
        (with(&|p| p["rate_per_step"] = json!(-2.0)), "problem.rate_per_step"),
        (with(&|p| p["radius"] = json!({ "rule": "chi_square", "alpha": 0.5 })), "problem.radius.rule"),
        (with(&|p| p["radius"] = json!({ "rule": "joint" })), "problem.radius.rule"),
        (with(&|p| p["radius"] = json!({ "rule": "concentration" })), "problem.radius.rule"),
        (with(&|p| p["utility"] = json!({ "kind": "power", "risk_aversion": 0.5 })), "problem.utility.risk_aversion"),
        (json!({ "problem": good, "wealth": -1.0 }), "wealth"),
    ];
    for (question, field) in cases {
        let (status, refused) = app.post("/advise", &question).await;
        assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some(field)), "{question}: {refused}");
    }
    for (field, value) in [("trading_cost", json!(0.2)), ("horizon", json!(2)), ("contributions", json!(1.0))] {
        let (status, refused) = app.post("/advise", &with(&|problem| problem[field] = value.clone())).await;
        let named = format!("problem.{field}");
        assert_eq!((status.as_u16(), refused["field"].as_str()), (422, Some(named.as_str())), "{refused}");
    }
}

/// Returns the log certainty equivalent of power utility 5 over equally likely rows, less the cost of the trade.
fn worth_after_trade(rows: &[[f64; 3]], shares: [f64; 3], held: [f64; 3], cost: f64) -> f64 {
    let bank = 1.002 * (1.0 - shares.iter().sum::<f64>());
    let growth = |row: &[f64; 3]| bank + row.iter().zip(shares).map(|(z, share)| share * z.exp()).sum::<f64>();
    let mean = rows.iter().map(|row| growth(row).powi(-4)).sum::<f64>() / rows.len() as f64;
    let traded: f64 = shares.iter().zip(held).map(|(share, held)| (share - held).abs()).sum();
    -0.25 * mean.ln() + (1.0 - cost * traded).ln()
}

/// Without an adversary the value of every allocation has a formula. No point of a grid over three assets is worth more than
/// what is advised, from holdings that are best kept, partly traded, and traded all the way.
#[tokio::test(flavor = "multi_thread")]
async fn no_allocation_on_a_grid_is_worth_more_after_its_trade_than_the_advice() {
    const POINTS: usize = 50;
    let app = App::start().await;
    let row = |month: u32| [0.9, 1.7, 2.3].map(|pace| 0.008 + 0.05 * (pace * f64::from(month)).sin());
    let rows: Vec<[f64; 3]> = (0..48).map(row).collect();
    let mut turnovers = Vec::new();
    for cost in [0.0005, 0.005, 0.03] {
        let problem = json!({ "assets": ["a", "b", "c"], "history": rows, "rate_per_step": 0.002, "trading_cost": cost,
            "risk_aversion": 5.0, "radius": { "rule": "fixed", "radius": 0.0 } });
        for held in [[0.0, 0.0, 0.0], [0.5, 0.2, 0.1], [0.1, 0.1, 0.8], [0.3, 0.3, 0.3]] {
            let holdings = json!({ "a": held[0], "b": held[1], "c": held[2] });
            let (status, advised) = app.post("/advise", &json!({ "problem": problem, "holdings": holdings })).await;
            assert_eq!(status, 200, "{advised}");
            let shares = ["a", "b", "c"].map(|name| advised["allocation"][name].as_f64().unwrap());
            let best = worth_after_trade(&rows, shares, held, cost);
            let certain = advised["certainty_equivalent"].as_f64().unwrap() / 100.2;
            assert!((certain.ln() + 1.002_f64.ln() - best).abs() < 1e-8, "{advised}: {best}");
            let part = |points: usize| points as f64 / POINTS as f64;
            for a in 0..=POINTS {
                for b in 0..=POINTS - a {
                    for c in 0..=POINTS - a - b {
                        let other = [part(a), part(b), part(c)];
                        let worth = worth_after_trade(&rows, other, held, cost);
                        assert!(
                            worth < best + 1e-7,
                            "{cost} {held:?}: {other:?} is worth {worth}, not {best}: {advised}"
                        );
                    }
                }
            }
            turnovers.push(shares.iter().zip(held).map(|(share, held)| (share - held).abs()).sum::<f64>());
        }
    }
    assert!(turnovers.contains(&0.0) && turnovers.iter().any(|turnover| *turnover > 0.3), "{turnovers:?}");
}
