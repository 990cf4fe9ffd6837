//! Orders in whole lots that follow the advice of a session: of one asset, of several, and refused where there are none.

use crate::support::values::number;
use crate::support::{App, specification};
use ballast::service::advice::orders::ONE_ASSET;
use serde_json::{Value, json};

/// With lots so small that nothing is rounded the orders reach the advice, and the account agrees to the cent.
#[tokio::test(flavor = "multi_thread")]
async fn orders_reach_the_advice_of_a_session() {
    let mut app = App::start().await;
    let mut request = specification(3);
    request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    request["problem"]["history"] =
        json!((0..24).map(f64::from).map(|k| 0.01 + 0.05 * (1.7 * k).sin()).collect::<Vec<_>>());
    app.train(&request).await;
    app.open().await;
    let (_, action) = app.action().await;
    let held = number(&action["allocation"]);
    assert!(held > 0.01, "{action}");
    let question = json!({ "session": app.session, "prices": { ONE_ASSET: 12.7 }, "units": { ONE_ASSET: 0.0 }, "cash": 1000.0,
        "lots": { ONE_ASSET: 1e-6 } });
    let (status, answer) = app.post("/orders", &question).await;
    assert_eq!((status.as_u16(), &answer["period"]), (200, &action["period"]), "{answer}");
    assert!((number(&answer["shares"][ONE_ASSET]) - held).abs() < 1e-6, "{answer} {held}");
    assert_eq!(number(&answer["advised"][ONE_ASSET]), held);
    let order = &answer["orders"][0];
    assert_eq!((&order["side"], answer["orders"].as_array().unwrap().len()), (&json!("buy"), 1));
    assert!((number(&order["units"]) * 12.7 + number(&answer["cash"]) - 1000.0).abs() < 1e-9, "{answer}");
    // Whole units, rounded towards no trade.
    let mut whole = question.clone();
    whole.as_object_mut().unwrap().remove("lots");
    let (_, answer) = app.post("/orders", &whole).await;
    assert_eq!(number(&answer["orders"][0]["units"]), (held * 1000.0 / 12.7).floor());
    assert_eq!(answer["left_out"][0]["limit"], "lot");
    // Nothing changed.
    assert_eq!(app.action().await.1, action);
    for (pointer, value, field) in [
        ("/prices", json!({ "stocks": 1.0 }), "prices.stocks"),
        ("/prices", json!({ ONE_ASSET: 0.0 }), "prices.asset"),
        ("/units", json!({}), "units.asset"),
        ("/units", json!({ ONE_ASSET: -1.0 }), "units.asset"),
        ("/cash", json!(0.0), "cash"),
        ("/cash", json!(-1.0), "cash"),
        ("/lots", json!({ ONE_ASSET: 0.0 }), "lots.asset"),
        ("/smallest", json!(-1.0), "smallest"),
        ("/trading_cost", json!(0.5), "trading_cost"),
        ("/buys_only", json!(1), "buys_only"),
        ("/colour", json!(1), "colour"),
    ] {
        let mut wrong = question.clone();
        wrong[&pointer[1..]] = value;
        let (status, problem) = app.post("/orders", &wrong).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn several_assets_are_ordered_by_name_and_a_declared_problem_has_none() {
    let mut app = App::start().await;
    let rows: Vec<[f64; 2]> =
        (0..24).map(f64::from).map(|k| [0.01 + 0.05 * (1.7 * k).sin(), 0.003 + 0.01 * (2.3 * k).cos()]).collect();
    let several = json!({ "problem": { "assets": ["stocks", "bonds"], "history": rows, "horizon": 2, "rate_per_step": 0.001,
        "radius": { "rule": "fixed", "radius": 0.001 } }, "design": { "count": 10 } });
    app.train(&several).await;
    app.open().await;
    let (_, action) = app.action().await;
    let question = json!({ "session": app.session, "prices": { "stocks": 3.0, "bonds": 7.0 }, "cash": 500.0,
        "units": { "stocks": 100.0, "bonds": 20.0 }, "lots": { "stocks": 1e-6, "bonds": 1e-6 } });
    let (status, answer) = app.post("/orders", &question).await;
    assert_eq!(status, 200, "{answer}");
    for name in ["stocks", "bonds"] {
        let off = number(&answer["shares"][name]) - number(&action["allocation"][name]);
        assert!(off.abs() < 1e-6, "{name}: {answer} {action}");
    }
    assert_eq!(number(&answer["wealth"]), 940.0);

    let stock: Value = serde_json::from_str(include_str!("../../examples/problems/stock.json")).unwrap();
    let mut declared = stock;
    (declared["problem"]["horizon"], declared["design"]) = (json!(2), json!({ "count": 10 }));
    app.train(&declared).await;
    app.open().await;
    let question = json!({ "session": app.session, "prices": {}, "units": {}, "cash": 1.0 });
    let (status, problem) = app.post("/orders", &question).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("session")), "{problem}");
}
