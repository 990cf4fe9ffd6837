//! Several assets in a session: composition first, then the policy of their fund.

use crate::support::values::number;
use crate::support::{App, ROWS, several_assets as request};
use ballast::control::assets::fund::Fund;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::dynamics::Dynamics;
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::progress::Watch;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::fund::{CompositionRule, FundSpecification};
use ballast::control::request::learning::Learning;
use ballast::control::request::means::MeansRule;
use ballast::control::request::specification::{InitialLaws, Specification};
use ballast::control::training::Training;
use ballast::numerics::bridge::funds::fund_returns;
use ballast::numerics::transport::water_filling::inverse_volatility;
use reqwest::StatusCode;
use serde_json::{Value, json};

over_either_store!(
    a_session_of_several_assets_is_lived_by_their_names,
    what_several_assets_report_is_put_right_and_renewed,
    a_session_of_several_assets_is_renewed_by_itself,
    a_fund_that_does_not_vary_is_not_taken,
    shrunk_means_are_lived_as_the_library_has_them,
    money_rates_dates_and_gaps_of_several_assets_give_the_wealth_of_the_formula,
    a_policy_of_several_assets_goes_out_and_comes_in_as_it_was,
);

fn trained(request: &Value) -> Advisor {
    let part = |name: &str| request.get(name).cloned().unwrap_or_else(|| json!({}));
    let problem: AssetsProblem = serde_json::from_value(part("problem")).unwrap();
    let design = serde_json::from_value(part("design")).unwrap();
    let specification = problem.training(design, serde_json::from_value(json!({})).unwrap(), 1).unwrap();
    Advisor::new(Training::new(&specification).unwrap().run(&Watch::unwatched()).unwrap())
}

fn rows() -> Vec<Vec<f64>> {
    ROWS.iter().map(|row| row.to_vec()).collect()
}

/// In the order of the assets.
fn listed(value: &Value) -> Vec<f64> {
    ["stocks", "bonds", "gold"].map(|name| number(&value[name])).to_vec()
}

/// Trains at half-shrunk means, lives two periods and a restart, and renews onto the policy of the means as seen: each
/// advice is that of a fund with the means of its policy.
async fn shrunk_means_are_lived_as_the_library_has_them(mut app: App) {
    let shrinks = |means: Value| {
        let mut request = request(3);
        request["problem"]["means"] = means;
        request
    };
    let half = shrinks(json!({ "kind": "shrunk", "intensity": 0.5 }));
    app.train(&half).await;
    app.open_with(json!({ "wealth": 1000.0 })).await;
    let advised = |advisor: &Advisor, means: MeansRule| {
        let mut fund = Fund::at(rows().into(), means, vec![0.0; 3]);
        let state = fund.renew(rows().into(), Learning::default(), 1000.0, 0.0);
        let (state, solution) = fund.compose(advisor, advisor.specification().fund.as_deref().unwrap(), 0, &state);
        (advisor.advise(0, &state, AdviceMode::Surrogate).allocation, solution.unwrap().allocation)
    };
    let (advisor, means) = (trained(&half), MeansRule::Shrunk { intensity: 0.5 });
    let (total, one_step) = advised(&advisor, means);
    let action = app.action().await.1;
    assert_eq!((number(&action["total"]), listed(&action["one_step"]["allocation"])), (total, one_step.clone()));
    let (plain, plainly) = advised(&advisor, MeansRule::default());
    assert!(plain != total && plainly != one_step, "shrinking changes the advice");
    let worst = &action["one_step"]["worst_means"]["stocks"];
    let column: Vec<f64> = rows().iter().map(|row| row[0]).collect();
    assert!((number(&worst["seen"]) - sum(&column) / column.len() as f64).abs() < 1e-15, "{worst}");
    assert!(number(&worst["believed"]) > number(&worst["worst"]), "{worst}");

    for period in 1..=2 {
        let report = json!({ "log_returns": { "stocks": 0.02, "bonds": -0.005, "gold": 0.03 } });
        let (status, observed) = app.report(period, report).await;
        assert_eq!(status, 200, "{observed}");
    }
    let action = app.action().await.1;
    app.restart().await;
    assert_eq!(app.action().await.1, action);
    app.train(&shrinks(json!({ "kind": "sample" }))).await;
    let renewal = json!({ "renewal": 1, "policy": app.policy });
    let (status, renewed) = app.post(&format!("/sessions/{}/renewals", app.session), &renewal).await;
    assert_eq!(status, 200, "{renewed}");
    let action = app.action().await.1;
    assert!(action["one_step"]["worst_means"]["stocks"].get("believed").is_none(), "{action}");
    app.restart().await;
    assert_eq!(app.action().await.1, action);
}

fn sum(values: &[f64]) -> f64 {
    values.iter().sum()
}

async fn a_session_of_several_assets_is_lived_by_their_names(mut app: App) {
    app.train(&request(4)).await;
    app.open_with(json!({ "wealth": 1000.0, "holdings": { "stocks": 0.2, "bonds": 0.1, "gold": 0.0 } })).await;

    // The library's own.
    let advisor = trained(&request(4));
    let policy = app.get(&format!("/policies/{}", app.policy)).await.1;
    let of: &FundSpecification = advisor.specification().fund.as_deref().unwrap();
    let factor = of.radius_factor.unwrap();
    assert_eq!(number(&policy["specification"]["fund"]["radius_factor"]), factor);
    assert!(factor > 1.0);
    let mut fund = Fund::at(rows().into(), MeansRule::default(), vec![0.2, 0.1, 0.0]);
    let start = State::new(&fund.returns(), 1000.0, Learning::default()).unwrap().with_holding(0.3).unwrap();
    let (state, _) = fund.compose(&advisor, of, 0, &start);
    let expected = advisor.advise(0, &state, AdviceMode::Surrogate);
    let (status, action) = app.action().await;
    assert_eq!(status, 200, "{action}");
    assert!(expected.allocation > 0.05 && expected.allocation < 1.0, "{expected:?}");
    assert_eq!(number(&action["total"]), expected.allocation);
    assert_eq!(listed(&action["composition"]), fund.composition);
    assert_eq!(number(&action["certainty_equivalent"]), expected.certainty_equivalent);
    let allocation = listed(&action["allocation"]);
    assert!((sum(&allocation) - expected.allocation).abs() < 1e-12 && (sum(&fund.composition) - 1.0).abs() < 1e-12);
    let traded: Vec<f64> = allocation.iter().zip([0.2, 0.1, 0.0]).map(|(share, held)| share - held).collect();
    assert_eq!(listed(&action["trade"]), traded);
    // The proposal is that of one period at 1000.
    let one_step = &action["one_step"];
    let proposed = listed(&one_step["allocation"]);
    assert!(number(&one_step["bound"]) >= number(&one_step["certainty_equivalent"]));
    assert!(number(&one_step["certainty_equivalent"]) >= 1001.0, "{one_step}");
    let parts: Vec<f64> = proposed.iter().map(|share| share / sum(&proposed)).collect();
    assert!(parts.iter().zip(&fund.composition).all(|(a, b)| (a - b).abs() < 1e-12), "{parts:?}");
    app.restart().await;
    assert_eq!(app.action().await.1, action, "replayed before its first period");

    // A period: what each asset made of what was advised.
    let z: [f64; 3] = [0.02, -0.005, 0.03];
    let (status, observed) =
        app.report(1, json!({ "log_returns": { "stocks": z[0], "bonds": z[1], "gold": z[2] } })).await;
    assert_eq!(status, 200, "{observed}");
    let grown: Vec<f64> = allocation.iter().zip(z).map(|(share, z)| share * z.exp()).collect();
    let growth = (1.0 - sum(&allocation)) * 1.001 + sum(&grown);
    assert!((number(&observed["wealth"]) / (1000.0 * growth) - 1.0).abs() < 1e-12, "{observed}");
    let held = listed(&observed["assets"]["holdings"]);
    assert!(held.iter().zip(&grown).all(|(held, grown)| (held - grown / growth).abs() < 1e-12), "{held:?}");
    assert_eq!(listed(&observed["assets"]["executed_allocations"]), allocation);
    assert_eq!(observed["sample_size"], 11);

    // Again the same answer, and by prices what returns say.
    let again = app.report(1, json!({ "log_returns": { "stocks": z[0], "bonds": z[1], "gold": z[2] } })).await;
    assert_eq!(again, (StatusCode::OK, observed));
    let (status, second) = app
        .report(
            2,
            json!({ "prices": { "stocks": 103.0, "bonds": 99.0, "gold": 50.0 },
                    "previous_prices": { "stocks": 100.0, "bonds": 100.0, "gold": 50.0 },
                    "executed_allocations": { "stocks": 0.5, "bonds": 0.25, "gold": 0.0 } }),
        )
        .await;
    assert_eq!(status, 200, "{second}");
    let growth_of_second = 0.25 * 1.001 + 0.5 * 1.03 + 0.25 * 0.99;
    assert!((number(&second["wealth"]) / (1000.0 * growth * growth_of_second) - 1.0).abs() < 1e-12, "{second}");
    assert!((number(&second["assets"]["log_returns"]["stocks"]) - 1.03_f64.ln()).abs() < 1e-15);

    // The next prices follow on those reported, and replayed from its entries it is the same.
    let (status, third) = app.report(3, json!({ "prices": { "stocks": 106.09, "bonds": 99.0, "gold": 51.0 } })).await;
    assert_eq!(status, 200, "{third}");
    assert!((number(&third["assets"]["log_returns"]["stocks"]) - 1.03_f64.ln()).abs() < 1e-12);
    let before = app.action().await;
    app.restart().await;
    assert_eq!(app.action().await, before);
    let explained = app.get(&format!("/action?session={}&explain=worst_case", app.session)).await.1;
    assert!(explained["worst_case"]["sentence"].is_string(), "{explained}");
    let (status, fourth) =
        app.report(4, json!({ "prices": { "stocks": 109.2727, "bonds": 99.0, "gold": 51.0 } })).await;
    assert_eq!(status, 200, "{fourth}");
    assert!((number(&fourth["assets"]["log_returns"]["stocks"]) - 1.03_f64.ln()).abs() < 1e-12);
    assert_eq!(fourth["completed"], true);
    // What was told at the end is what a replay says.
    let detail = |value: Value| json!([value["wealth"], value["holding"], value["assets"]["composition"]]);
    let (path, expected) = (
        format!("/sessions/{}", app.session),
        json!([fourth["wealth"], fourth["holding"], fourth["assets"]["composition"]]),
    );
    assert_eq!(detail(app.get(&path).await.1), expected);
    app.restart().await;
    assert_eq!(detail(app.get(&path).await.1), expected);
    let history = app.get(&format!("/sessions/{}/history", app.session)).await.1;
    assert_eq!(history["history"], json!(ROWS));
    assert_eq!(history["assets"], json!(["stocks", "bonds", "gold"]));
    assert_eq!(history["observations"][2]["assets"], third["assets"]);
}

async fn what_several_assets_report_is_put_right_and_renewed(mut app: App) {
    app.train(&request(2)).await;
    let first = app.policy.clone();
    let report = |stocks: f64| json!({ "log_returns": { "stocks": stocks, "bonds": 0.004, "gold": -0.01 } });
    // One that was told right at once, and one put right.
    app.open().await;
    let right = app.session.clone();
    app.report(1, report(0.03)).await;
    let expected = app.action().await.1;
    app.open().await;
    let mut slip = report(0.13);
    slip["confirm"] = json!(true);
    app.report(1, slip).await;
    let mut correction = report(0.03);
    (correction["correction"], correction["period"]) = (json!(1), json!(1));
    correction["reason"] = json!("a slip");
    let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
    assert_eq!(status, 200, "{corrected}");
    assert!(corrected["assets"]["composition"]["gold"].is_number(), "{corrected}");
    let (status, now) = app.action().await;
    assert_eq!(status, 200, "{now}");
    // The composition that was held when it was put right may be another: of the same law the same is proposed.
    for field in ["total", "radius", "certainty_equivalent"] {
        let (left, right) = (number(&now[field]), number(&expected[field]));
        assert!((left / right - 1.0).abs() < 1e-4, "{field}: {left} {right}");
    }
    let before = app.action().await;
    app.restart().await;
    assert_eq!(app.action().await, before);
    let history = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(history.0, 200, "{}", history.1);
    let first_now = &history.1["observations"][0]["now"];
    assert!(first_now["wealth"].is_number());
    assert_eq!(first_now["assets"], report(0.03), "{first_now}");

    // On by a policy that was trained on what was seen by then; by none of other assets.
    app.session = right;
    app.report(2, report(-0.02)).await;
    assert_eq!(app.action().await.0, 409);
    let mut next = request(2);
    let mut longer: Vec<Vec<f64>> = rows();
    longer.extend([vec![0.03, 0.004, -0.01], vec![-0.02, 0.004, -0.01]]);
    next["problem"]["history"] = json!(longer[2..]);
    app.train(&next).await;
    let (path, onto) = (format!("/sessions/{}/renewals", app.session), app.policy.clone());
    let (status, renewed) = app.post(&path, &json!({ "renewal": 1, "policy": onto, "window": 10 })).await;
    assert_eq!(status, 200, "{renewed}");
    assert_eq!(renewed["sample_size"], 10);
    let before = app.action().await;
    assert_eq!(before.0, 200, "{}", before.1);
    app.restart().await;
    assert_eq!(app.action().await, before);
    app.train(&crate::support::specification(2)).await;
    let (status, refused) = app.post(&path, &json!({ "renewal": 2, "policy": app.policy })).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("policy")), "{refused}");
    assert_ne!(first, onto);
}

async fn a_session_of_several_assets_is_renewed_by_itself(mut app: App) {
    app.train(&request(2)).await;
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    let (status, observed) =
        app.report(1, json!({ "simple_returns": { "stocks": 0.01, "bonds": 0.002, "gold": 0.0 } })).await;
    assert_eq!(status, 200, "{observed}");
    let renewed = crate::support::patience::until("a renewal", async || {
        let session = app.get(&format!("/sessions/{}", app.session)).await.1;
        (session["renewals"] == 1).then_some(session)
    });
    let renewed = renewed.await;
    assert_ne!(renewed["policy"], json!(app.policy));
    let policy = app.get(&format!("/policies/{}", renewed["policy"].as_str().unwrap())).await.1;
    let specification = &policy["specification"];
    assert_eq!(specification["fund"]["history"].as_array().unwrap().len(), 11);
    // The scale asked for, times the factor of the longer record.
    let factor = number(&specification["fund"]["radius_factor"]);
    assert!((number(&specification["problem"]["radius"]["scale"]) / (0.2 * factor) - 1.0).abs() < 1e-12);
    assert_eq!(app.action().await.0, 200);
}

/// The periods of an account: `x' = x (1 - c sum_i |a_i - h_i|) ((1 - sum_i a_i)(1 + r) + sum_i a_i e^(z_i)) + C`.
async fn money_rates_dates_and_gaps_of_several_assets_give_the_wealth_of_the_formula(mut app: App) {
    const COST: f64 = 0.002;
    let mut training = request(4);
    training["problem"]["trading_cost"] = json!(COST);
    training["problem"]["contributions"] = json!([10.0, -5.0, 20.0, 0.0]);
    app.train(&training).await;
    app.open_with(json!({ "wealth": 1000.0, "holdings": { "stocks": 0.2, "bonds": 0.1, "gold": 0.0 } })).await;
    let (mut wealth, mut held) = (1000.0, vec![0.2, 0.1, 0.0]);
    let executed = json!({ "stocks": 0.3, "bonds": 0.2, "gold": 0.1 });
    let rows = [[0.03, 0.004, -0.01], [0.0; 3], [0.02_f64, -0.005, 0.05].map(f64::ln_1p), [-0.04, 0.002, 0.01]];
    let named = |values: [f64; 3]| json!({ "stocks": values[0], "bonds": values[1], "gold": values[2] });
    // The report, what the bank paid, what was added, and how many dates have been seen by then.
    let periods = [
        (json!({ "log_returns": named(rows[0]), "date": "2024-01-31", "rate": 0.004 }), 0.004, 10.0, 11),
        (json!({ "missing": true, "date": "2024-02-29", "flow": -30.0 }), 0.001, -30.0, 11),
        (
            json!({ "simple_returns": named([0.02, -0.005, 0.05]), "executed_allocations": executed, "flow": 0.0,
                "rate": -0.0005, "date": "2024-03-29" }),
            -0.0005,
            0.0,
            12,
        ),
        (json!({ "log_returns": named(rows[3]), "date": "2024-04-30", "flow": 100.0 }), 0.001, 100.0, 13),
    ];
    for (index, ((report, rate, flow, seen), row)) in periods.iter().zip(rows).enumerate() {
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        let shares = listed(report.get("executed_allocations").unwrap_or(&action["allocation"]));
        assert!(sum(&shares) > 0.0, "{action}");
        let traded: f64 = shares.iter().zip(&held).map(|(share, held)| f64::abs(share - held)).sum();
        let grown: Vec<f64> = shares.iter().zip(row).map(|(share, z)| share * z.exp()).collect();
        let left = wealth * (1.0 - COST * traded);
        let expected = left * ((1.0 - sum(&shares)) * (1.0 + rate) + sum(&grown)) + flow;
        let (status, observed) = app.report(index + 1, report.clone()).await;
        assert_eq!(status, 200, "{observed}");
        assert!((number(&observed["wealth"]) / expected - 1.0).abs() < 1e-12, "{report}: {observed} {expected}");
        held = grown.iter().map(|grown| left * grown / expected).collect();
        let holdings = listed(&observed["assets"]["holdings"]);
        assert!(
            holdings.iter().zip(&held).all(|(holding, held)| (holding - held).abs() < 1e-12),
            "{observed} {held:?}"
        );
        assert_eq!((&observed["sample_size"], &observed["date"]), (&json!(seen), &report["date"]), "{observed}");
        assert_eq!(observed["assets"]["log_returns"].is_null(), report["missing"] == true, "{observed}");
        wealth = number(&observed["wealth"]);
        if index < 3 {
            let late = json!({ "missing": true, "date": report["date"] });
            let (status, refused) = app.report(index + 2, late).await;
            assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("date")), "{refused}");
            let before = app.action().await;
            app.restart().await;
            assert_eq!(app.action().await, before);
        }
    }
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!(number(&session["wealth"]), wealth);
}

/// Another service takes the document as the same policy and advises by it as the first does; a document of another fund is refused.
async fn a_policy_of_several_assets_goes_out_and_comes_in_as_it_was(mut app: App) {
    app.train(&request(2)).await;
    app.open().await;
    let document: Value = serde_json::from_slice(&app.export().await).unwrap();
    let mut other = App::start().await;
    let (status, imported) = other.post("/policies/import", &document).await;
    assert_eq!((status.as_u16(), &imported["policy"]), (201, &json!(app.policy)), "the hash of its content");
    other.policy.clone_from(&app.policy);
    assert_eq!(other.export().await, app.export().await);
    other.open().await;
    let report = json!({ "log_returns": { "stocks": 0.02, "bonds": -0.005, "gold": 0.03 } });
    for period in 1..=2 {
        let [(_, mut here), (_, mut there)] = [app.action().await, other.action().await];
        assert!(number(&here["total"]) > 0.0, "{here}");
        [&mut here, &mut there].into_iter().for_each(|action| action["session"] = Value::Null);
        assert_eq!(here, there);
        assert_eq!(app.report(period, report.clone()).await.0, 200);
        assert_eq!(other.report(period, report.clone()).await.0, 200);
    }
    let mut forged = document;
    for (factor, field) in [(json!(0.5), "fund.radius_factor"), (Value::Null, "specification.fund.radius_factor")] {
        forged["specification"]["fund"]["radius_factor"] = factor;
        let (status, refused) = other.post("/policies/import", &forged).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{refused}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_of_several_assets_is_named() {
    let mut app = App::start().await;
    app.train(&request(2)).await;
    app.open().await;
    let all = |value: f64| json!({ "stocks": value, "bonds": 0.0, "gold": 0.0 });
    for (report, field) in [
        (json!({ "log_return": 0.01 }), "log_return"),
        (json!({}), "log_returns"),
        (json!({ "log_returns": { "stocks": 0.01, "bonds": 0.0 } }), "log_returns.gold"),
        (json!({ "log_returns": { "stocks": 0.01, "bonds": 0.0, "gold": 0.0, "oil": 0.1 } }), "log_returns.oil"),
        (json!({ "log_returns": all(9.0) }), "log_returns.stocks"),
        (json!({ "simple_returns": all(-1.1) }), "simple_returns.stocks"),
        (json!({ "prices": { "stocks": 1.0, "bonds": 1.0, "gold": 1.0 } }), "previous_prices"),
        (json!({ "previous_prices": all(1.0), "log_returns": all(0.0) }), "previous_prices"),
        (json!({ "log_returns": all(0.0), "simple_returns": all(0.0) }), "log_returns"),
        (json!({ "log_returns": all(0.0), "executed_allocations": all(1.1) }), "executed_allocations.stocks"),
        (
            json!({ "log_returns": all(0.0), "executed_allocations": { "stocks": 0.6, "bonds": 0.6, "gold": 0.0 } }),
            "executed_allocations",
        ),
    ] {
        let (status, problem) = app.report(1, report.clone()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{report}: {problem}");
    }
    // 0.9 is far from a record whose deviation is 0.03.
    let (status, slip) = app.report(1, json!({ "simple_returns": all(0.9) })).await;
    assert_eq!((status.as_u16(), &slip["field"]), (409, &json!("simple_returns.stocks")), "{slip}");
    let (status, refused) = app.get(&format!("/action?session={}&sensitivity=true", app.session)).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("sensitivity")), "{refused}");
    let open = |start: Value| {
        let mut start = start;
        start["policy"] = json!(app.policy);
        start
    };
    for (start, field) in [
        (json!({ "history": [0.1, 0.2, 0.3] }), "history"),
        (json!({ "history": [[0.1, 0.2], [0.0, 0.1]] }), "history[0]"),
        (json!({ "holding": 0.3 }), "holding"),
        (json!({ "holdings": { "stocks": 0.3 } }), "holdings.bonds"),
    ] {
        let (status, problem) = app.post("/sessions", &open(start.clone())).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{start}: {problem}");
    }
    let with = |field: &str, value: Value| {
        let mut request = request(2);
        request["problem"][field] = value;
        request
    };
    for (request, field) in [
        (with("composition", json!({ "given": [0.5, 0.5] })), "problem.composition.given"),
        (with("composition", json!({ "given": [0.5, 0.6, 0.1] })), "problem.composition.given"),
        (with("assets", json!(["a", "a", "b"])), "problem.assets[1]"),
        (with("composition", json!("best")), "problem.composition"),
        (with("ground_norm", json!("two")), "problem.ground_norm"),
        (with("trading_cost", json!(0.2)), "problem.trading_cost"),
        (with("horizon", json!(0)), "problem.horizon"),
        (with("framework", json!("static_robust")), "problem.framework"),
    ] {
        let (status, problem) = app.post("/train", &request).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{request}: {problem}");
    }
    // A completed specification with its fund is a request as well.
    let policy = app.get(&format!("/policies/{}", app.policy)).await.1;
    let wrong = |place: &str, value: Value| {
        let mut specification = policy["specification"].clone();
        *specification["fund"].pointer_mut(place).unwrap() = value;
        specification
    };
    for (request, field) in [
        (wrong("/radius_factor", json!(0.5)), "fund.radius_factor"),
        (wrong("/assets", json!(["stocks", "bonds"])), "fund.history[0]"),
        (wrong("/composition", json!({ "given": [1.0] })), "fund.composition.given"),
        (wrong("/ground_norm", json!("two")), "fund.ground_norm"),
        (wrong("/history/0/0", json!(0.5)), "problem.history[0]"),
    ] {
        let (status, problem) = app.post("/train", &request).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }
    // A session of one asset takes nothing of several.
    app.train(&crate::support::specification(2)).await;
    app.open().await;
    let (status, problem) = app.report(1, json!({ "log_returns": { "stocks": 0.1 } })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("log_returns")), "{problem}");
}

/// If all columns are one asset, the fund is that asset: its factor is 1, and its policy the policy of one asset whose
/// laws start resampled.
#[test]
fn identical_columns_are_one_asset() {
    let (one, mut several) = (ROWS.map(|row| row[0]), request(3));
    several["problem"]["history"] = json!(one.map(|z| [z, z, z]));
    let fund = trained(&several);
    assert!((fund.specification().fund.as_ref().unwrap().radius_factor.unwrap() - 1.0).abs() < 1e-8);
    let mut single = several.clone();
    single["problem"].as_object_mut().unwrap().remove("assets");
    single["problem"]["history"] = json!(one);
    single["design"]["initial_laws"] = json!("resampled");
    let asset = crate::support::policies::advisor(single);
    let rows: Vec<Vec<f64>> = one.iter().map(|&z| vec![z; 3]).collect();
    let mut held = Fund::at(rows.into(), MeansRule::default(), vec![0.0; 3]);
    let state = State::new(&held.returns(), 100.0, Learning::default()).unwrap();
    let of = fund.specification().fund.clone().unwrap();
    let (state, _) = held.compose(&fund, &of, 0, &state);
    let start = asset.initial_state(None, None).unwrap();
    for mode in [AdviceMode::Surrogate, AdviceMode::Resolve] {
        let (left, right) = (fund.advise(0, &state, mode), asset.advise(0, &start, mode));
        // Returns differ by rounding, and with them where searches end: by 0.005 basis points of value at most.
        assert!((left.allocation - right.allocation).abs() < 1e-5, "{left:?} {right:?}");
        assert!((left.certainty_equivalent / right.certainty_equivalent - 1.0).abs() < 5e-7, "{left:?} {right:?}");
    }
}

/// Trading costs a share of all that is bought and sold, and a composition that gains less than the way there costs is not taken.
#[test]
fn what_is_traded_within_the_fund_is_paid_for() {
    let costly = |cost: f64| {
        let mut request = request(3);
        request["problem"]["trading_cost"] = json!(cost);
        trained(&request)
    };
    let (advisor, dear) = (costly(1e-6), costly(0.1));
    let of = advisor.specification().fund.as_deref().unwrap();
    let state = |fund: &Fund| State::new(&fund.returns(), 100.0, Learning::default()).unwrap();
    let mut held = Fund::at(rows().into(), MeansRule::default(), vec![0.0; 3]);
    let even = held.composition.clone();
    held.compose(&advisor, of, 0, &state(&held));
    assert_ne!(held.composition, even);
    let mut stayed = Fund::at(rows().into(), MeansRule::default(), even.iter().map(|share| 0.5 * share).collect());
    let start = state(&stayed).with_holding(0.5).unwrap();
    stayed.compose(&dear, dear.specification().fund.as_deref().unwrap(), 0, &start);
    assert_eq!(stayed.composition, even);

    // From a half in stocks to a half in bonds all of it is sold and bought: of 100 there are 99.8 left at 0.2 %.
    let stocks = Fund::at(rows().into(), MeansRule::default(), vec![0.5, 0.0, 0.0]);
    let executed = [0.0, 0.5, 0.0];
    let dynamics = Dynamics::plain(0.0, 0.002);
    let realised = PeriodOutcome { traded: Some(stocks.traded(&executed)), ..PeriodOutcome::of(0.5, 0.0) };
    let start = State { holding: 0.5, ..state(&stocks) };
    assert!((start.next_state(dynamics, &realised).wealth - 99.8).abs() < 1e-12);
}

/// Returns the coming log-return where the adversary puts it for the fund held; its date is drawn.
fn adversarial(name: &str, returns: &[f64], drawn: usize, radius: f64) -> f64 {
    let lowest = (0..returns.len()).min_by(|&a, &b| returns[a].total_cmp(&returns[b])).unwrap();
    match name {
        // Every date moves by the radius, or the worst by all of it.
        "all" => -radius,
        "worst" if drawn == lowest => -radius * returns.len() as f64,
        _ => 0.0,
    }
}

/// How a composition is taken before the period after a step, and the state of its fund.
type Choice<'a> = dyn Fn(&mut Fund, &FundSpecification, usize, &State) -> State + 'a;

/// Mean of `(wealth / bank)^-2` over every path from a step on, for who lets `choose` take the composition of each period, under a
/// law that lies in the ball of the fund he holds: 12 dates, then 13, then 14 are equally likely, which makes 2,184 paths.
fn mean_power(
    (advisor, of, adversary): (&Advisor, &FundSpecification, &str),
    choose: &Choice<'_>,
    step: usize,
    held: &Fund,
    before: &State,
) -> f64 {
    let problem = &advisor.specification().problem;
    if step == problem.horizon {
        let bank = problem.initial_wealth * (1.0 + problem.rate_per_step).powi(problem.horizon as i32);
        return (before.wealth / bank).powi(-2);
    }
    let mut fund = held.clone();
    let state = choose(&mut fund, of, step, before);
    let advice = advisor.advise(step, &state, AdviceMode::Surrogate);
    let executed: Vec<f64> = fund.composition.iter().map(|share| share * advice.allocation).collect();
    let returns = fund.returns();
    let after = |drawn: usize| {
        let shock = adversarial(adversary, &returns, drawn, advice.radius);
        let row: Vec<f64> = fund.rows[drawn].iter().map(|z| z + shock).collect();
        let realised = PeriodOutcome::of(advice.allocation, fund.log_return(&executed, &row));
        let next = state.next_state(Dynamics::plain(problem.rate_per_step, 0.0), &realised);
        let mut learned = fund.clone();
        learned.passed(&executed, &row, Some(row.clone()), next.holding);
        mean_power((advisor, of, adversary), choose, step + 1, &learned, &next)
    };
    (0..returns.len()).map(after).sum::<f64>() / returns.len() as f64
}

/// Whatever proposes the composition, who takes only what the policy values as much is left with at least what it promises at the
/// fund held first, under any law in the ball. Who takes a fund that it values less is not.
#[test]
fn the_promise_at_the_fund_held_is_kept_and_broken_without_the_guard() {
    // Two good assets, and one whose fall is sure.
    let rows: Vec<Vec<f64>> = (0..12)
        .map(|k| {
            let wave = f64::from(k * 5 % 12) / 12.0 - 0.5;
            vec![0.03 + 0.08 * wave, 0.025 - 0.05 * wave, -0.03 + 0.02 * f64::from(k % 3)]
        })
        .collect();
    let mut request = request(3);
    request["problem"]["history"] = json!(rows);
    request["design"]["count"] = json!(60);
    let advisor = trained(&request);
    let rule = |composition: CompositionRule| FundSpecification {
        composition,
        ..advisor.specification().fund.as_deref().unwrap().clone()
    };
    let mut start = Fund::at(rows.into(), MeansRule::default(), vec![0.0; 3]);
    start.composition = vec![0.5, 0.5, 0.0];
    let state = State::new(&start.returns(), 100.0, Learning::default()).unwrap();
    let promise = advisor.advise(0, &state, AdviceMode::Resolve);
    let promised = (promise.certainty_equivalent / promise.floor).ln();
    assert!(promised > 0.01, "{promise:?}");
    let guarded =
        |fund: &mut Fund, of: &FundSpecification, step: usize, state: &State| fund.compose(&advisor, of, step, state).0;
    let proposals = [
        CompositionRule::OneStep,
        CompositionRule::Equal,
        CompositionRule::InverseVolatility,
        CompositionRule::Given(vec![0.0, 0.0, 1.0]),
    ];
    // Log certainty equivalent over the bank of power utility 3.
    let worth = |composition: CompositionRule, adversary: &str, choose: &Choice<'_>| {
        let of = rule(composition);
        -0.5 * mean_power((&advisor, &of, adversary), choose, 0, &start, &state).ln()
    };
    // The surrogate of so small a design is off by less than a hundredth of what it promises.
    let kept = 0.99 * promised;
    for composition in proposals {
        for adversary in ["none", "all", "worst"] {
            let value = worth(composition.clone(), adversary, &guarded);
            assert!(value > kept, "{composition:?} {adversary}: {value} {promised}");
        }
    }
    let unguarded = |fund: &mut Fund, of: &FundSpecification, _: usize, state: &State| {
        let CompositionRule::Given(shares) = &of.composition else { unreachable!("a given one") };
        fund.composition = shares.clone();
        State { law: Learning::default().law(&fund.returns()), ..state.clone() }
    };
    let value = worth(CompositionRule::Given(vec![0.0, 0.0, 1.0]), "none", &unguarded);
    assert!(value < 0.5 * promised, "{value} {promised}");
}

/// A policy for several assets goes out and comes back, and one that contradicts its assets does not.
#[test]
fn a_policy_of_a_fund_is_what_its_assets_give() {
    let advisor = trained(&request(2));
    let specification = advisor.specification();
    let fund = specification.fund.as_deref().unwrap();
    assert_eq!(specification.clone().completed().unwrap(), *specification);
    let returns = fund_returns(&rows(), &inverse_volatility(&fund.history));
    assert_eq!(specification.problem.history, returns);
    let refused = |change: &dyn Fn(&mut Specification)| {
        let mut other = specification.clone();
        change(&mut other);
        other.completed().unwrap_err().field
    };
    assert_eq!(refused(&|other| other.problem.history[3] += 0.001), "problem.history[3]");
    assert_eq!(refused(&|other| other.design.initial_laws = InitialLaws::Given), "design.initial_laws");
    assert_eq!(refused(&|other| other.fund.as_mut().unwrap().radius_factor = Some(0.5)), "fund.radius_factor");
    assert_eq!(refused(&|other| other.problem.learning = Learning::Decay { half_life: 9.0 }), "problem.learning");
    let with = |value: f64| {
        let mut rows = rows();
        rows[0][0] = value;
        move |other: &mut Specification| other.fund.as_mut().unwrap().history = rows.clone().into()
    };
    assert_eq!(refused(&with(9.0)), "fund.history[0][0]");
}

/// Two assets that hedge each other: their fund in equal parts does not vary, and is no law to be learned from.
async fn a_fund_that_does_not_vary_is_not_taken(mut app: App) {
    let mut request = request(2);
    let rows: Vec<[f64; 2]> = [0.01, -0.02, 0.03, 0.005, -0.012].map(|x: f64| [x.ln_1p(), (-x).ln_1p()]).to_vec();
    request["problem"]["assets"] = json!(["long", "short"]);
    request["problem"]["history"] = json!(rows);
    request["problem"]["rate_per_step"] = json!(-0.001);
    request["problem"]["composition"] = json!("equal");
    app.train(&request).await;
    app.open().await;
    let before = app.action().await;
    assert_eq!(before.0, 200, "{}", before.1);
    assert_ne!(before.1["composition"], json!({ "long": 0.5, "short": 0.5 }));
    app.restart().await;
    assert_eq!(app.action().await, before);
}

/// The fields of an answer to `/action`, taken from an answer of `/what-if`.
#[track_caller]
fn assert_same_action(what_if: &Value, action: &Value) {
    let fields =
        action.as_object().unwrap().iter().filter(|(field, _)| !["caution", "session"].contains(&field.as_str()));
    for (field, value) in fields {
        assert_eq!(&what_if[field], value, "{field}: {what_if} {action}");
    }
}

async fn what_if(app: &App, session: &str, mut supposed: Value) -> Value {
    supposed["session"] = json!(session);
    let (status, answer) = app.post("/what-if", &supposed).await;
    assert_eq!(status, 200, "{answer}");
    answer
}

/// Supposed is what a report would lead to, and what a start would: a twin session that really has it is told the same.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_supposed_of_several_assets_is_what_a_twin_is_told() {
    let mut app = App::start().await;
    let mut costly = request(4);
    costly["problem"]["trading_cost"] = json!(0.002);
    costly["problem"]["utility"] = json!({ "kind": "exponential", "risk_aversion": 0.02 });
    costly["design"]["wealth"] = json!({ "min": 80.0, "max": 120.0 });
    app.train(&costly).await;
    app.open().await;
    let session = app.session.clone();
    let facts = async || {
        let path = format!("/sessions/{session}");
        (
            app.get(&path).await,
            app.get(&format!("{path}/history")).await,
            app.get(&format!("/action?session={session}")).await,
        )
    };
    let before = facts().await;
    assert!(number(&before.2.1["total"]) > 0.01, "the test shows nothing: {}", before.2.1);
    assert_same_action(&what_if(&app, &session, json!({})).await, &before.2.1);

    let holdings = json!({ "stocks": 0.1, "bonds": 0.6, "gold": 0.2 });
    let start = json!({ "wealth": 110.0, "holdings": holdings });
    let returns = [
        json!({ "log_returns": { "stocks": 0.031, "bonds": -0.004, "gold": 0.012 } }),
        json!({ "simple_returns": { "stocks": -0.06, "bonds": 0.01, "gold": 0.03 } }),
        json!({ "prices": { "stocks": 104.0, "bonds": 99.5, "gold": 51.0 },
            "previous_prices": { "stocks": 100.0, "bonds": 100.0, "gold": 50.0 } }),
    ];
    let with = |given: &Value, more: &Value| {
        let mut both = given.clone();
        more.as_object().unwrap().iter().for_each(|(field, value)| both[field] = value.clone());
        both
    };
    let (mut supposed, mut nows) = (Vec::new(), Vec::new());
    nows.push(what_if(&app, &session, start.clone()).await);
    for report in &returns {
        supposed.push(what_if(&app, &session, report.clone()).await);
        nows.push(what_if(&app, &session, with(&start, report)).await);
    }
    let wide = what_if(&app, &session, json!({ "radius_scale": 3.0, "explain": "worst_case" })).await;
    let sweep = json!({ "sweep": { "radius_scale": { "from": 0.0, "to": 3.0, "points": 4 } } });
    let swept = what_if(&app, &session, sweep).await;
    assert_eq!(facts().await, before, "a what-if changed something");

    for (report, supposed) in returns.iter().zip(&supposed) {
        app.open().await;
        let (status, observed) = app.report(1, report.clone()).await;
        assert_eq!(status, 200, "{observed}");
        assert_same_action(supposed, &app.action().await.1);
        assert_eq!((&supposed["wealth"], &supposed["period"]), (&observed["wealth"], &json!(2)));
        assert_eq!(supposed["log_returns"], observed["assets"]["log_returns"]);
    }
    app.open_with(start.clone()).await;
    assert_same_action(&nows[0], &app.action().await.1);
    assert_ne!(nows[0]["trade"], before.2.1["trade"]);
    for (report, supposed) in returns.iter().zip(&nows[1..]) {
        app.open_with(start.clone()).await;
        app.report(1, report.clone()).await;
        assert_same_action(supposed, &app.action().await.1);
    }
    // Another radius moves the total alone.
    assert_eq!((&wide["composition"], &wide["source"]), (&before.2.1["composition"], &json!("resolved_other_radius")));
    assert!(number(&wide["total"]) < number(&before.2.1["total"]) && wide["worst_case"]["sentence"].is_string());
    let points = swept["points"].as_array().unwrap();
    assert_eq!((points.len(), &points[3]["allocation"]), (4, &wide["allocation"]));
    assert!(
        points[3].get("worst_case").is_none() && points[3]["worst_law"]["share_moved"].is_number(),
        "{}",
        points[3]
    );

    // What was held before the last choice is known after a correction and after a replay.
    app.session.clone_from(&session);
    app.report(1, returns[0].clone()).await;
    let correction = with(&returns[1], &json!({ "correction": 1, "period": 1, "reason": "a slip" }));
    let (status, corrected) = app.post(&format!("/sessions/{session}/corrections"), &correction).await;
    assert_eq!(status, 200, "{corrected}");
    let again = with(&returns[0], &json!({ "correction": 2, "period": 1, "reason": "none" }));
    assert_eq!(app.post(&format!("/sessions/{session}/corrections"), &again).await.0, 200);
    let answer = what_if(&app, &session, start.clone()).await;
    app.restart().await;
    assert_eq!(what_if(&app, &session, start).await, answer);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_supposed_is_named() {
    let mut app = App::start().await;
    app.train(&request(2)).await;
    app.open().await;
    let several = app.session.clone();
    app.train(&crate::support::specification(2)).await;
    app.open().await;
    let one = app.session.clone();
    let shares = |stocks: f64| json!({ "stocks": stocks, "bonds": 0.3, "gold": 0.3 });
    let range = json!({ "from": 0.0, "to": 0.1, "points": 3 });
    for (session, supposed, field) in [
        (&several, json!({ "log_return": 0.1 }), "log_return"),
        (&several, json!({ "holding": 0.1 }), "holding"),
        (&several, json!({ "sweep": { "log_return": range } }), "sweep.log_return"),
        (&several, json!({ "sweep": { "holding": range } }), "sweep.holding"),
        (&several, json!({ "holdings": shares(0.5) }), "holdings"),
        (&several, json!({ "holdings": { "stocks": 0.1 } }), "holdings.bonds"),
        (&several, json!({ "log_returns": { "stocks": 0.1, "bonds": 0.0, "silver": 0.0 } }), "log_returns.silver"),
        (&several, json!({ "log_returns": shares(9.0) }), "log_returns.stocks"),
        (&several, json!({ "log_returns": shares(0.1), "simple_returns": shares(0.1) }), "log_returns"),
        (&several, json!({ "prices": shares(1.0) }), "previous_prices"),
        (&several, json!({ "previous_prices": shares(1.0) }), "previous_prices"),
        (&several, json!({ "wealth": 1e15, "simple_returns": shares(2.0) }), "simple_returns"),
        (&one, json!({ "holdings": shares(0.1) }), "holdings"),
        (&one, json!({ "log_returns": shares(0.1) }), "log_returns"),
    ] {
        let mut request = supposed.clone();
        request["session"] = json!(session);
        let (status, problem) = app.post("/what-if", &request).await;
        let found = (status.as_u16(), problem["field"].as_str());
        assert_eq!(found, (422, Some(field)), "{supposed}: {problem}");
    }
    app.session.clone_from(&several);
    let returns = json!({ "stocks": 0.01, "bonds": 0.002, "gold": 0.0 });
    assert_eq!(app.report(1, json!({ "log_returns": returns })).await.0, 200);
    let last = json!({ "session": several, "log_returns": returns });
    assert_eq!(app.post("/what-if", &last).await.1["field"], json!("log_returns"));
}
