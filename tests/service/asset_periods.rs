//! Periods of several assets in which one loses everything or has no price, and the account of every period.

use crate::support::values::number;
use crate::support::{App, several_assets, specification};
use serde_json::{Value, json};

over_either_store!(
    a_total_loss_is_recorded_once_it_is_confirmed,
    an_asset_without_a_price_is_carried_until_it_comes,
    every_period_has_its_account,
);

const NAMES: [&str; 3] = ["stocks", "bonds", "gold"];

fn named(values: [f64; 3]) -> Value {
    NAMES.iter().zip(values).map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
}

fn listed(value: &Value) -> Vec<f64> {
    NAMES.map(|name| number(&value[name])).to_vec()
}

pub async fn report(app: &App, period: usize, report: Value) -> Value {
    let (status, observed) = app.report(period, report).await;
    assert_eq!(status, 200, "{observed}");
    observed
}

async fn history(app: &App) -> Value {
    let (status, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(status, 200, "{history}");
    history
}

pub async fn correct(app: &App, number: usize, period: usize, mut report: Value) -> Value {
    report["correction"] = json!(number);
    report["period"] = json!(period);
    report["reason"] = json!("a slip");
    let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &report).await;
    assert_eq!(status, 200, "{corrected}");
    corrected
}

/// Returns the state and the advice of a session without its corrections.
pub async fn known(app: &App) -> Value {
    let (_, mut session) = app.get(&format!("/sessions/{}", app.session)).await;
    session["corrections"] = Value::Null;
    json!([session, app.action().await.1])
}

/// Asserts that a replay of the entries leads to the same bits.
pub async fn assert_replayed(app: &mut App) {
    let before = known(app).await;
    app.restart().await;
    assert_eq!(known(app).await, before);
}

async fn a_total_loss_is_recorded_once_it_is_confirmed(mut app: App) {
    app.train(&several_assets(4)).await;
    app.open_with(json!({ "wealth": 1000.0 })).await;
    let held = named([0.3, 0.2, 0.1]);
    let mut loss = json!({ "simple_returns": named([0.02, -0.005, -1.0]), "executed_allocations": held });
    let (status, doubted) = app.report(1, loss.clone()).await;
    assert_eq!(status, 409, "{doubted}");
    assert_eq!(doubted["doubts"][0]["reason"], "total_loss", "{doubted}");
    assert_eq!(doubted["field"], "simple_returns.gold");
    assert!(doubted["doubts"][0]["sentence"].as_str().unwrap().contains("a total loss is always doubted"), "{doubted}");
    loss["confirm"] = json!(true);
    let observed = report(&app, 1, loss.clone()).await;
    // 40 % in the bank, and the last tenth is gone.
    let wealth = 1000.0 * (0.4 * 1.001 + 0.3 * 1.02 + 0.2 * 0.995);
    assert!((number(&observed["wealth"]) / wealth - 1.0).abs() < 1e-14, "{observed}");
    assert_eq!(observed["assets"]["holdings"]["gold"], 0.0, "{observed}");
    assert!(observed["assets"]["log_returns"]["gold"].is_null(), "{observed}");
    let notes = &observed["notes"];
    assert_eq!((&notes[0]["reason"], &notes[0]["asset"]), (&json!("total_loss"), &json!("gold")), "{observed}");
    assert!(notes[0]["sentence"].as_str().unwrap().contains("the law learns a log-return of -5"), "{observed}");
    assert_eq!(observed["sample_size"], 11);
    assert_replayed(&mut app).await;
    let lost = known(&app).await;
    // The same again is answered as before, and the price of 0 that says it has no return after it.
    assert_eq!(report(&app, 1, loss.clone()).await, observed);

    // The law is the one of a log-return at the bound: a twin that held none of it is in the same state.
    let rest = named([0.3, 0.2, 0.0]);
    let twin = async |app: &mut App, gold: f64| {
        app.open_with(json!({ "wealth": 1000.0 })).await;
        let given = match gold.is_finite() {
            true => json!({ "log_returns": named([0.02_f64.ln_1p(), (-0.005_f64).ln_1p(), gold]) }),
            false => json!({ "simple_returns": named([0.02, -0.005, -1.0]) }),
        };
        let mut given = given;
        (given["executed_allocations"], given["confirm"]) = (rest.clone(), json!(true));
        report(app, 1, given).await;
        let mut action = app.action().await.1;
        action["session"] = Value::Null;
        action
    };
    let session = app.session.clone();
    assert_eq!(twin(&mut app, f64::NEG_INFINITY).await, twin(&mut app, -5.0).await);
    app.session = session;

    // Corrected and corrected back: the same bits.
    let mut fell = loss.clone();
    fell["simple_returns"]["gold"] = json!(-0.02);
    let corrected = correct(&app, 1, 1, fell).await;
    assert!(number(&corrected["wealth"]) > wealth + 90.0, "{corrected}");
    let corrected = correct(&app, 2, 1, loss).await;
    assert!((number(&corrected["wealth"]) / wealth - 1.0).abs() < 1e-14, "{corrected}");
    let back = known(&app).await;
    for place in ["/0/wealth", "/0/holding", "/0/drift", "/0/sample_size", "/0/assets/holdings"] {
        assert_eq!(back.pointer(place), lost.pointer(place), "{place}: {back} {lost}");
    }
    assert_replayed(&mut app).await;
    let history = history(&app).await;
    let now = &history["observations"][0]["now"];
    assert_eq!((&now["notes"], &now["assets"]["log_returns"]["gold"]), (notes, &Value::Null), "{history}");

    // A price of 0 says the same, and no return follows it.
    let before = named([50.0, 20.0, 10.0]);
    let none = json!({ "prices": named([51.0, 20.0, 0.0]), "previous_prices": before, "confirm": true });
    let observed = report(&app, 2, none).await;
    assert_eq!(observed["notes"][0]["reason"], "total_loss", "{observed}");
    let (status, refused) = app.report(3, json!({ "prices": named([51.0, 20.0, 0.0]) })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("prices.gold")), "{refused}");
    let third = json!({ "prices": { "stocks": 51.0, "bonds": 20.2, "gold": null }, "confirm": true });
    let third = report(&app, 3, third).await;
    assert_eq!(third["notes"][0]["reason"], "price_missing", "{third}");
    assert_replayed(&mut app).await;

    // One asset: what was not in it is left, and all in it leaves nothing to record.
    app.train(&specification(3)).await;
    app.open_with(json!({ "wealth": 1000.0 })).await;
    let (status, doubted) = app.report(1, json!({ "simple_return": -1.0, "executed_allocation": 0.25 })).await;
    assert_eq!((status.as_u16(), &doubted["doubts"][0]["reason"]), (409, &json!("total_loss")), "{doubted}");
    let all = json!({ "simple_return": -1.0, "executed_allocation": 1.0, "confirm": true });
    let (status, refused) = app.report(1, all).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("wealth")), "{refused}");
    let part = json!({ "simple_return": -1.0, "executed_allocation": 0.25, "confirm": true });
    let observed = report(&app, 1, part).await;
    assert!((number(&observed["wealth"]) / (1000.0 * 0.75 * 1.002) - 1.0).abs() < 1e-14, "{observed}");
    assert_eq!((&observed["holding"], &observed["notes"][0]["reason"]), (&json!(0.0), &json!("total_loss")));
    assert!(observed["log_return"].is_null() && observed["sample_size"] == 11, "{observed}");
    assert_replayed(&mut app).await;
}

async fn an_asset_without_a_price_is_carried_until_it_comes(mut app: App) {
    app.train(&several_assets(4)).await;
    app.open_with(json!({ "wealth": 1000.0 })).await;
    let held = named([0.3, 0.2, 0.1]);
    let prices = |stocks: f64, bonds: f64, gold: Value| json!({ "stocks": stocks, "bonds": bonds, "gold": gold });
    let first = json!({ "prices": prices(101.0, 100.5, json!(51.0)),
        "previous_prices": named([100.0, 100.0, 50.0]), "executed_allocations": held });
    let first = report(&app, 1, first).await;
    assert!(first.get("notes").is_none() && first["sample_size"] == 11, "{first}");
    let none = json!({ "prices": { "stocks": null, "bonds": null, "gold": null } });
    let (status, refused) = app.report(2, none).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("prices")), "{refused}");

    // Without gold's price its tenth does not move, and the law learns nothing.
    let second = json!({ "prices": prices(102.01, 100.5, Value::Null), "executed_allocations": held });
    let second = report(&app, 2, second).await;
    let growth = 0.4 * 1.001 + 0.3 * 1.01 + 0.2 + 0.1;
    assert!((number(&second["wealth"]) / (number(&first["wealth"]) * growth) - 1.0).abs() < 1e-12, "{second}");
    assert!((number(&second["assets"]["holdings"]["gold"]) - 0.1 / growth).abs() < 1e-12, "{second}");
    assert_eq!((&second["sample_size"], &second["drift"]), (&json!(11), &first["drift"]), "{second}");
    assert!(second["assets"]["log_returns"]["gold"].is_null(), "{second}");
    assert!((number(&second["assets"]["log_returns"]["stocks"]) - 1.01_f64.ln()).abs() < 1e-12, "{second}");
    assert_eq!(
        (&second["notes"][0]["reason"], &second["notes"][0]["asset"]),
        (&json!("price_missing"), &json!("gold"))
    );
    assert_replayed(&mut app).await;

    // It comes: its return since the last price enters wealth now. The row of the period is no joint one.
    let third = json!({ "prices": prices(102.01, 100.5, json!(53.04)), "executed_allocations": held });
    let third = report(&app, 3, third).await;
    let growth = 0.4 * 1.001 + 0.3 + 0.2 + 0.1 * (53.04 / 51.0);
    assert!((number(&third["wealth"]) / (number(&second["wealth"]) * growth) - 1.0).abs() < 1e-12, "{third}");
    assert_eq!((&third["sample_size"], &third["drift"]), (&json!(11), &first["drift"]), "{third}");
    assert_eq!(third["notes"][0]["reason"], "price_late", "{third}");
    assert_replayed(&mut app).await;
    let expected = known(&app).await;

    // Its price was found: every period counts, and its return is that of one period again.
    let found = json!({ "prices": prices(102.01, 100.5, json!(52.02)), "executed_allocations": held });
    let found = correct(&app, 1, 2, found).await;
    assert_eq!(found["sample_size"], 13, "{found}");
    let list = history(&app).await;
    let now = |period: usize| &list["observations"][period - 1]["now"];
    assert!((number(&now(3)["assets"]["log_returns"]["gold"]) - (53.04_f64 / 52.02).ln()).abs() < 1e-12, "{list}");
    assert!(now(2).get("notes").is_none() && now(3).get("notes").is_none(), "{list}");
    // And lost again.
    let lost = json!({ "prices": prices(102.01, 100.5, Value::Null), "executed_allocations": held });
    let lost = correct(&app, 2, 2, lost).await;
    assert_eq!(lost["sample_size"], 11, "{lost}");
    let back = known(&app).await;
    for place in ["/0/wealth", "/0/holding", "/0/drift", "/0/sample_size", "/0/assets/holdings"] {
        assert_eq!(back.pointer(place), expected.pointer(place), "{place}: {back} {expected}");
    }
    assert_replayed(&mut app).await;

    // After a whole period again the law learns.
    let returns = json!({ "simple_returns": named([0.01, 0.002, -0.01]) });
    let fourth = report(&app, 4, returns).await;
    assert!(fourth["sample_size"] == 12 && fourth.get("notes").is_none(), "{fourth}");
}

/// Wealth of somebody who restores `shares`, period by period: rate, flow, cost and simple returns.
fn fixed_shares(shares: &[f64], start: (f64, &[f64]), cost: f64, periods: &[(f64, f64, Vec<f64>)]) -> Vec<f64> {
    let (mut wealth, mut held) = (start.0, start.1.to_vec());
    let mut all = Vec::new();
    for (rate, flow, returns) in periods {
        let traded: f64 = shares.iter().zip(&held).map(|(share, held)| (share - held).abs()).sum();
        let left = wealth * (1.0 - cost * traded);
        let grown: Vec<f64> = shares.iter().zip(returns).map(|(share, back)| left * share * (1.0 + back)).collect();
        wealth = left * (1.0 - shares.iter().sum::<f64>()) * (1.0 + rate) + grown.iter().sum::<f64>() + flow;
        held = grown.iter().map(|grown| grown / wealth).collect();
        all.push(wealth);
    }
    all
}

async fn every_period_has_its_account(mut app: App) {
    const COST: f64 = 0.002;
    let periods = [(0.001, 10.0, vec![0.03, 0.004, -0.01]), (0.004, -30.0, vec![-0.02, 0.01, 0.05])];
    let mut training = several_assets(2);
    training["problem"]["trading_cost"] = json!(COST);
    training["problem"]["contributions"] = json!(10.0);
    app.train(&training).await;
    let start = [0.2, 0.1, 0.0];
    app.open_with(json!({ "wealth": 1000.0, "holdings": named(start) })).await;
    let composition = listed(&app.action().await.1["composition"]);
    let executed = [0.3, 0.2, 0.1];
    let named_returns = |returns: &[f64]| json!({ "simple_returns": named([returns[0], returns[1], returns[2]]) });
    let first = report(&app, 1, named_returns(&periods[0].2)).await;
    let mut second = named_returns(&periods[1].2);
    second["executed_allocations"] = named(executed);
    (second["rate"], second["flow"]) = (json!(0.004), json!(-30.0));
    let second = report(&app, 2, second).await;
    let list = history(&app).await;
    let account = |period: usize| &list["observations"][period - 1]["account"];
    let held = listed(&first["assets"]["holdings"]);
    let turnover: f64 = executed.iter().zip(&held).map(|(share, held)| (share - held).abs()).sum();
    assert!((number(&account(2)["turnover"]) - turnover).abs() < 1e-12, "{list}");
    assert!((number(&account(2)["cost"]) / (number(&first["wealth"]) * COST * turnover) - 1.0).abs() < 1e-12);
    assert_eq!((&account(1)["rate"], &account(1)["flow"]), (&json!(0.001), &json!(10.0)));
    assert_eq!((&account(2)["rate"], &account(2)["flow"]), (&json!(0.004), &json!(-30.0)));
    for (name, shares) in
        [("equal_weights", vec![1.0 / 3.0; 3]), ("initial_composition", composition), ("bank", vec![0.0; 3])]
    {
        let expected = fixed_shares(&shares, (1000.0, &start), COST, &periods);
        for (period, expected) in (1..).zip(expected) {
            let found = number(&account(period)["benchmarks"][name]);
            assert!((found / expected - 1.0).abs() < 1e-12, "{name}, period {period}: {found} {expected}");
        }
    }
    assert!(second["completed"] == true);

    // One asset has the same account.
    app.train(&specification(2)).await;
    app.open_with(json!({ "wealth": 500.0, "holding": 0.4 })).await;
    report(&app, 1, json!({ "simple_return": 0.02, "executed_allocation": 0.7, "flow": 5.0 })).await;
    report(&app, 2, json!({ "missing": true, "executed_allocation": 0.5, "rate": 0.001 })).await;
    let list = history(&app).await;
    let account = |period: usize| &list["observations"][period - 1]["account"];
    assert!((number(&account(1)["turnover"]) - 0.3).abs() < 1e-15, "{list}");
    assert_eq!((&account(1)["cost"], &account(1)["flow"]), (&json!(0.0), &json!(5.0)), "{list}");
    let periods = [(0.002, 5.0, vec![0.02]), (0.001, 0.0, vec![0.0])];
    for (name, share) in [("equal_weights", 1.0), ("initial_composition", 1.0), ("bank", 0.0)] {
        let expected = fixed_shares(&[share], (500.0, &[0.4]), 0.0, &periods);
        for (period, expected) in (1..).zip(expected) {
            let found = number(&account(period)["benchmarks"][name]);
            assert!((found / expected - 1.0).abs() < 1e-12, "{name}, period {period}: {found} {expected}");
        }
    }
}
