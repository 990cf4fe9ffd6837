//! Assets that enter and leave a session at a renewal.

use crate::asset_periods::{assert_replayed, correct, known, report};
use crate::support::values::number;
use crate::support::{App, ROWS, several_assets};
use serde_json::{Value, json};

over_either_store!(assets_enter_and_leave_at_a_renewal, an_asset_that_lost_everything_is_replaced,);

const COST: f64 = 0.002;

/// Log-returns of oil in the ten periods of the history.
const OIL: [f64; 10] = [0.04, -0.06, 0.02, 0.05, -0.03, 0.01, 0.03, -0.02, 0.06, -0.01];

fn training() -> Value {
    let mut request = several_assets(3);
    request["problem"]["trading_cost"] = json!(COST);
    request
}

/// A training for bonds, oil and stocks: without gold, and in another order.
fn changed() -> Value {
    let mut request = training();
    request["problem"]["assets"] = json!(["bonds", "oil", "stocks"]);
    let rows = ROWS.iter().zip(OIL).map(|(row, oil)| [row[1], oil, row[0]]);
    request["problem"]["history"] = json!(rows.collect::<Vec<_>>());
    request
}

async fn renew(app: &App, renewal: &Value) -> (u16, Value) {
    let (status, renewed) = app.post(&format!("/sessions/{}/renewals", app.session), renewal).await;
    (status.as_u16(), renewed)
}

async fn assets_enter_and_leave_at_a_renewal(mut app: App) {
    app.train(&training()).await;
    app.open_with(json!({ "wealth": 1000.0, "holdings": { "stocks": 0.2, "bonds": 0.1, "gold": 0.1 } })).await;
    let first_report = json!({ "log_returns": { "stocks": 0.02, "bonds": -0.005, "gold": 0.03 },
        "executed_allocations": { "stocks": 0.3, "bonds": 0.2, "gold": 0.2 } });
    let first = report(&app, 1, first_report.clone()).await;
    let no_gold = json!({ "simple_returns": { "stocks": 0.01, "bonds": 0.002, "gold": null },
        "executed_allocations": { "stocks": 0.3, "bonds": 0.2, "gold": 0.2 } });
    let second = report(&app, 2, no_gold.clone()).await;
    let (gone, kept) = (number(&second["assets"]["holdings"]["gold"]), second["assets"]["holdings"].clone());
    let before = known(&app).await;
    app.train(&changed()).await;

    // What does not fit is named, and changes nothing.
    let mut record: Vec<Value> = OIL.iter().map(|z| json!(z)).collect();
    record.extend([json!(0.015), json!(-0.02)]);
    let with = |records: Value, leaving: Value| json!({ "renewal": 1, "policy": app.policy, "records": records, "leaving": leaving });
    for (renewal, field) in [
        (json!({ "renewal": 1, "policy": app.policy }), "policy"),
        (with(json!({}), json!(["gold"])), "records.oil"),
        (with(json!({ "oil": record }), json!([])), "leaving"),
        (with(json!({ "oil": record }), json!(["gold", "bonds"])), "leaving[1]"),
        (with(json!({ "oil": record, "bonds": record }), json!(["gold"])), "records.bonds"),
        (with(json!({ "oil": [0.1] }), json!(["gold"])), "records.oil"),
        (with(json!({ "oil": [0.1, 9.0] }), json!(["gold"])), "records.oil[1]"),
        // Of the last two periods one has no return of all assets.
        (with(json!({ "oil": [0.1, 0.2] }), json!(["gold"])), "records"),
    ] {
        let (status, refused) = renew(&app, &renewal).await;
        assert_eq!((status, &refused["field"]), (422, &json!(field)), "{renewal}: {refused}");
    }
    assert_eq!(known(&app).await, before);

    let renewal = with(json!({ "oil": record }), json!(["gold"]));
    let (status, renewed) = renew(&app, &renewal).await;
    assert_eq!(status, 200, "{renewed}");
    assert_eq!(renewed["names"], json!(["bonds", "oil", "stocks"]));
    // Ten dates of the history and the first period; in the second one gold had no price, so no row was learned.
    assert_eq!(renewed["sample_size"], 11, "{renewed}");
    let holdings = &renewed["assets"]["holdings"];
    assert_eq!((&holdings["stocks"], &holdings["bonds"]), (&kept["stocks"], &kept["bonds"]));
    assert_eq!((&holdings["oil"], &renewed["assets"]["leaving"]["gold"]), (&json!(0.0), &json!(gone)), "{renewed}");
    assert_replayed(&mut app).await;
    let session = app.get(&format!("/sessions/{}", app.session)).await.1;
    assert_eq!(
        (&session["wealth"], &session["drift"]),
        (&second["wealth"], &second["drift"]),
        "the track record stays"
    );
    // Repeated: the answer as it was, of every entry.
    assert_eq!(renew(&app, &renewal).await, (200, renewed.clone()));
    assert_eq!(report(&app, 1, first_report.clone()).await, first);
    assert_eq!(report(&app, 2, no_gold).await, second);

    // Gold is sold before the next period, which pays for it.
    let executed = json!({ "stocks": 0.3, "bonds": 0.2, "oil": 0.25 });
    let returns = [("stocks", 0.01), ("bonds", 0.003), ("oil", -0.02)];
    let mut third = json!({ "simple_returns": {}, "executed_allocations": executed });
    returns.iter().for_each(|(name, back)| third["simple_returns"][name] = json!(back));
    let (status, refused) = app.report(3, first_report.clone()).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("log_returns.gold")), "{refused}");
    let observed = report(&app, 3, third.clone()).await;
    let moved = |name: &str| (number(&executed[name]) - number(&holdings[name])).abs();
    let turnover = gone + moved("stocks") + moved("bonds") + moved("oil");
    let growth: f64 =
        0.25 * 1.001 + returns.iter().map(|(name, back)| number(&executed[name]) * (1.0 + back)).sum::<f64>();
    let expected = number(&second["wealth"]) * (1.0 - COST * turnover) * growth;
    assert!((number(&observed["wealth"]) / expected - 1.0).abs() < 1e-12, "{observed} {expected}");
    assert!(observed["assets"].get("leaving").is_none() && observed["sample_size"] == 12, "{observed}");
    assert!(observed["drift"]["p_value"].is_number());
    assert_replayed(&mut app).await;

    // The history names the assets of each period, and the benchmarks go on.
    let list = app.get(&format!("/sessions/{}/history", app.session)).await.1;
    assert_eq!(list["assets"], json!(["stocks", "bonds", "gold"]));
    assert_eq!(list["renewals"][0]["names"], json!(["bonds", "oil", "stocks"]));
    assert_eq!(list["observations"][1]["assets"], second["assets"]);
    assert_eq!(list["observations"][2]["assets"], observed["assets"]);
    let accounts: Vec<&Value> = (0..3).map(|period| &list["observations"][period]["account"]).collect();
    assert!((number(&accounts[2]["turnover"]) - turnover).abs() < 1e-12, "{list}");
    // Equal weights: a third each, the third of gold is sold and all is restored to thirds.
    let [before, after] = [1, 2].map(|period| number(&accounts[period]["benchmarks"]["equal_weights"]));
    let grown = [1.01, 1.002, 1.0].map(|growth| growth / (1.01 + 1.002 + 1.0));
    let third = 1.0 / 3.0;
    let traded: f64 = grown[2] + third + f64::abs(grown[0] - third) + f64::abs(grown[1] - third);
    let expected = before * (1.0 - COST * traded) * (1.01 + 1.003 + 0.98) / 3.0;
    assert!((after / expected - 1.0).abs() < 1e-12, "{after} {expected}");

    // Corrected before the change and back: the same bits. A correction names the assets of its period.
    let expected = known(&app).await;
    let mut slip = first_report.clone();
    slip["log_returns"]["stocks"] = json!(0.025);
    let corrected = correct(&app, 1, 1, slip).await;
    assert!(number(&corrected["wealth"]) > number(&observed["wealth"]), "{corrected}");
    assert_replayed(&mut app).await;
    correct(&app, 2, 1, first_report).await;
    let back = known(&app).await;
    for place in ["/0/wealth", "/0/holding", "/0/drift", "/0/sample_size", "/0/assets/holdings"] {
        assert_eq!(back.pointer(place), expected.pointer(place), "{place}: {back} {expected}");
    }
    // A return that was missing then is no row of the present assets unless the asset that entered has one.
    let all = json!({ "simple_returns": { "stocks": 0.01, "bonds": 0.002, "gold": 0.001 },
        "executed_allocations": { "stocks": 0.3, "bonds": 0.2, "gold": 0.2 } });
    assert_eq!(correct(&app, 3, 2, all).await["sample_size"], 13);
    assert_replayed(&mut app).await;
}

/// An asset is added to the others, and one that is worth nothing any more is dropped, one renewal after the other.
async fn an_asset_that_lost_everything_is_replaced(mut app: App) {
    app.train(&training()).await;
    app.open_with(json!({ "wealth": 1000.0, "renew": { "every": 2 } })).await;
    let loss = json!({ "simple_returns": { "stocks": 0.02, "bonds": -0.005, "gold": -1.0 }, "confirm": true });
    report(&app, 1, loss).await;
    // Oil beside the three, with a record that is shorter than theirs and lacks one period.
    let mut four = training();
    four["problem"]["assets"] = json!(["stocks", "bonds", "gold", "oil"]);
    let rows = ROWS.iter().zip(OIL).map(|(row, oil)| [row[0], row[1], row[2], oil]);
    four["problem"]["history"] = json!(rows.collect::<Vec<_>>());
    app.train(&four).await;
    let mut record: Vec<Value> = OIL[3..].iter().map(|z| json!(z)).collect();
    (record[2], record[6]) = (Value::Null, json!(0.01));
    record.push(json!(0.02));
    let added = json!({ "renewal": 1, "policy": app.policy, "records": { "oil": record } });
    let (status, renewed) = renew(&app, &added).await;
    assert_eq!((status, &renewed["sample_size"]), (200, &json!(7)), "{renewed}");
    assert_replayed(&mut app).await;
    app.train(&changed()).await;
    let (status, renewed) = renew(&app, &json!({ "renewal": 2, "policy": app.policy, "leaving": ["gold"] })).await;
    assert_eq!((status, &renewed["sample_size"]), (200, &json!(7)), "{renewed}");
    assert!(renewed["assets"].get("leaving").is_none(), "it was worth nothing: {renewed}");
    assert_replayed(&mut app).await;
    let three = json!({ "simple_returns": { "stocks": 0.01, "bonds": 0.002, "oil": 0.03 } });
    for period in 2..=3 {
        report(&app, period, three.clone()).await;
    }
    // The service trains the next policy for the present assets.
    let renewed = crate::support::patience::until("a renewal", async || {
        let session = app.get(&format!("/sessions/{}", app.session)).await.1;
        (session["renewals"] == 3).then_some(session)
    });
    let policy = renewed.await["policy"].as_str().unwrap().to_owned();
    let policy = app.get(&format!("/policies/{policy}")).await.1;
    assert_eq!(policy["specification"]["fund"]["assets"], json!(["bonds", "oil", "stocks"]));
    assert_eq!(policy["specification"]["fund"]["history"].as_array().unwrap().len(), 9);
    assert_replayed(&mut app).await;
}
