//! The share of the capital that a strategy's record supports, over HTTP.

use crate::support::values::replaced;
use crate::support::{App, several_assets};
use ballast::service::advice::sleeve::SleeveRequest;
use serde_json::{Value, json};

const OUTCOMES: [f64; 14] = [0.6, -0.4, 0.5, 0.3, -0.5, 0.7, 0.4, -0.3, 0.5, 0.6, -0.4, 0.2, 0.5, 0.3];

/// The service answers what the library does, and what it advises on the same record.
#[tokio::test(flavor = "multi_thread")]
async fn a_strategy_is_sized_as_by_the_library_and_faults_are_named() {
    let app = App::start().await;
    let problem = json!({ "history": OUTCOMES, "rate_per_step": 0.0, "caution": { "scale": 0.3 } });
    let question = json!({ "problem": problem, "record_of": "trades" });
    let (status, report) = app.post("/sleeve", &question).await;
    assert_eq!(status, 200, "{report}");
    let mut whole = question.clone();
    whole["problem"]["horizon"] = json!(1);
    let expected = SleeveRequest::Strategy(serde_json::from_value(whole).unwrap()).answer().unwrap();
    assert_eq!(report, serde_json::from_str::<Value>(&serde_json::to_string(&expected).unwrap()).unwrap());
    assert!(report["sentences"][0].as_str().unwrap().starts_with("Stake "), "{report}");
    let mut asked = json!({ "problem": problem });
    asked["problem"]["utility"] = json!({ "kind": "log" });
    let (_, advised) = app.post("/advise", &asked).await;
    assert_eq!(report["share"], advised["allocation"]);
    assert_eq!(report["worst_case"], advised["worst_case"]);

    let mut of_several = json!({ "problem": several_assets(1)["problem"] });
    let (status, report) = app.post("/sleeve", &of_several).await;
    assert_eq!(status, 200, "{report}");
    assert_eq!(report["strategies"].as_object().unwrap().len(), 3);
    of_several["problem"]["trading_cost"] = json!(0.001);
    assert_eq!(app.post("/sleeve", &of_several).await.1["field"], "problem.trading_cost");

    let power = json!({ "kind": "power", "risk_aversion": 3.0 });
    let exponential = json!({ "kind": "exponential", "risk_aversion": 0.01 });
    let faults = [
        ("/problem/horizon", json!(2), "problem.horizon"),
        ("/problem/utility", power, "problem.utility.kind"),
        ("/problem/utility", exponential, "problem.utility.kind"),
        ("/problem/risk_aversion", json!(3.0), "problem.risk_aversion"),
        ("/problem/trading_cost", json!(0.001), "problem.trading_cost"),
        ("/problem/contributions", json!(1.0), "problem.contributions"),
        ("/problem/spending", json!({}), "problem.spending"),
        ("/problem/framework", json!("plug_in"), "problem.framework"),
        ("/problem/framework", json!("parametric_static"), "problem.framework"),
        ("/problem/centre", json!({ "kind": "smoothed", "bandwidth": 0.3 }), "problem.centre.kind"),
        ("/problem/history", json!([0.1]), "problem.history"),
        ("/problem/history", json!([0.1, f64::ln_1p(-0.999)]), "problem.history[1]"),
        ("/record_of", json!("bets"), "record_of"),
        ("/seed", json!(-1), "seed"),
        ("/colour", json!("red"), "colour"),
    ];
    for (pointer, value, field) in faults {
        let question = replaced(question.clone(), pointer, value);
        let (status, problem) = app.post("/sleeve", &question).await;
        assert_eq!((status.as_u16(), problem["field"].as_str()), (422, Some(field)), "{problem}");
    }
}
