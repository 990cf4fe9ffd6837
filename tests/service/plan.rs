//! Plans of spending: the answer of `POST /plan`, and sessions that live by a policy with spending.

use std::time::Duration;

use crate::support::values::{number, replaced};
use crate::support::{App, specification};
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::state::{PeriodOutcome, State};
use ballast::control::request::learning::Learning;
use ballast::service::advice::plan::PlanAsked;
use serde_json::{Value, json};

const YEARS: usize = 30;
const EVERY: usize = 5;
const HISTORY: [f64; 12] = [0.12, -0.09, 0.21, 0.03, -0.18, 0.24, 0.11, 0.07, -0.05, 0.16, 0.02, 0.09];

/// Thirty yearly returns, some good and some bad.
fn lived(year: usize) -> f64 {
    ((37 * year + 11) % 41) as f64 / 100.0 - 0.17
}

fn request(horizon: usize, history: &[f64], spending: Value) -> Value {
    let mut request = specification(horizon);
    request["problem"] = json!({
        "framework": "static", "horizon": horizon, "rate_per_step": 0.01, "periods_per_year": 1,
        "utility": { "kind": "power", "risk_aversion": 3.0 }, "radius": { "rule": "root_n", "kappa": 0.05 },
        "support": { "rule": "worst_seen" }, "spending": spending, "history": history });
    request
}

/// The request of a renewal: with floors the wealth at the time matters.
fn of_wealth(horizon: usize, history: &[f64], wish: &Value, wealth: f64) -> Value {
    let mut request = request(horizon, history, wish.clone());
    if wish.get("secured").is_some() {
        request["problem"]["initial_wealth"] = json!(wealth);
    }
    request
}

async fn session(app: &App) -> Value {
    app.get(&format!("/sessions/{}", app.session)).await.1
}

async fn until_renewed(app: &App, renewals: usize) {
    for _ in 0..600 {
        if session(app).await["renewals"] == renewals {
            return;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("not renewed: {}", session(app).await);
}

/// A session of thirty years that renews itself every five, after which the horizon is nearer. In the seventh year more is
/// spent than was advised, the eighth year's return is corrected afterwards, and from the twelfth on the wish is another. It
/// equals the same life by the library, bit for bit.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_lives_by_a_plan_for_thirty_years() {
    live_by_a_plan(0.0).await;
}

/// A life with floors: the reserve is that of the wealth and the prices at each renewal.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_lives_by_a_plan_with_floors_for_thirty_years() {
    live_by_a_plan(1.2).await;
}

async fn live_by_a_plan(secured: f64) {
    let mut app = App::start().await;
    let mut wish = json!({ "inflation": 0.02, "bequest": 3.0, "survival": vec![0.98; YEARS] });
    if secured > 0.0 {
        (wish["secured"], wish["secured_left"]) = (json!(secured), json!(8.0 * secured));
    }
    app.train(&request(YEARS, &HISTORY, wish.clone())).await;
    app.open_with(json!({ "wealth": 100.0, "renew": { "every": EVERY } })).await;
    let solved = |request: Value| Advisor::new(crate::support::policies::train(request));
    // Money of the start in money of a renewal.
    let prices = |periods: usize| (0.02_f64.ln_1p() * periods as f64).exp();
    let mut seen = HISTORY.to_vec();
    let mut advisor = solved(request(YEARS, &HISTORY, wish.clone()));
    let mut state = State::new(&HISTORY, 100.0, Learning::default()).unwrap();
    let (mut after, mut renewals) = (0, 0);
    for year in 0..YEARS {
        let changes = year == 11;
        if (year > 0 && year == after + EVERY) || changes {
            let left = YEARS - year;
            wish["survival"] = json!(vec![0.98; left]);
            for floor in ["secured", "secured_left"] {
                if let Some(amount) = wish[floor].as_f64() {
                    wish[floor] = json!(amount * prices(year - after));
                }
            }
            if changes {
                wish["highest"] = json!(0.07);
                app.train(&of_wealth(left, &seen, &wish, state.wealth)).await;
                let renewal = json!({ "renewal": renewals + 1, "policy": app.policy });
                let (status, renewed) = app.post(&format!("/sessions/{}/renewals", app.session), &renewal).await;
                assert_eq!(status, 200, "{renewed}");
            }
            renewals += 1;
            until_renewed(&app, renewals).await;
            assert_eq!(session(&app).await["horizon"], YEARS, "{year}");
            advisor = solved(of_wealth(left, &seen, &wish, state.wealth));
            let wealth = state.wealth;
            state = State::new(&seen, wealth, Learning::default()).unwrap().with_holding(state.holding).unwrap();
            after = year;
        }
        let step = year - after;
        let expected = advisor.advise(step, &state, AdviceMode::Surrogate);
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        let spending = expected.spending.unwrap();
        assert_eq!(number(&action["allocation"]), expected.allocation, "{year}");
        assert_eq!(number(&action["spending"]["share"]), spending.share, "{year}");
        assert_eq!(number(&action["spending"]["amount"]), spending.amount, "{year}");
        assert_eq!(action["spending"]["reserve"].as_f64().unwrap_or_default(), spending.reserve, "{year}");
        assert_eq!(secured > 0.0, spending.reserve > 0.0);
        assert_eq!(number(&action["certainty_equivalent"]), expected.certainty_equivalent);
        let spent = if year == 6 { 9.0 / state.wealth } else { spending.share };
        let reported = if year == 7 { lived(year) + 0.05 } else { lived(year) };
        let mut report = json!({ "session": app.session, "period": year + 1, "log_return": reported });
        if year == 6 {
            report["spent"] = json!(9.0);
        }
        let (status, observed) = app.post("/observe", &report).await;
        assert_eq!(status, 200, "{observed}");
        assert_eq!(number(&observed["spent"]), spent * state.wealth, "{observed}");
        assert_eq!(observed["completed"], year + 1 == YEARS, "{observed}");
        if year == 7 {
            let correction = json!({ "correction": 1, "period": 8, "log_return": lived(7), "reason": "misread" });
            let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
            assert_eq!(status, 200, "{corrected}");
        }
        state = advisor.advance(
            step,
            &state,
            &PeriodOutcome { spent, ..PeriodOutcome::of(expected.allocation, lived(year)) },
        );
        seen.push(lived(year));
        assert_eq!(number(&session(&app).await["wealth"]), state.wealth, "{year}");
    }
    assert_eq!(session(&app).await["state"], "completed");
    let history = app.get(&format!("/sessions/{}/history", app.session)).await.1;
    let accounts: Vec<f64> =
        history["observations"].as_array().unwrap().iter().map(|period| number(&period["account"]["spent"])).collect();
    assert!(accounts.len() == YEARS && accounts[6] == 9.0 && accounts.iter().all(|spent| *spent > 0.0), "{accounts:?}");
}

/// Spending more than there is, or reporting nothing where something was advised.
#[tokio::test(flavor = "multi_thread")]
async fn no_more_is_spent_than_there_is() {
    let mut app = App::start().await;
    app.train(&request(3, &HISTORY, json!({}))).await;
    app.open_with(json!({ "wealth": 50.0 })).await;
    for (spent, expected) in [(50.0, 422), (60.0, 422), (0.0, 200)] {
        let report = json!({ "session": app.session, "period": 1, "simple_return": 0.1, "spent": spent });
        let (status, answer) = app.post("/observe", &report).await;
        assert_eq!(status, expected, "{answer}");
        if expected == 422 {
            assert_eq!(answer["field"], "spent");
        }
    }
    // A what-if after a return has spent what is advised.
    let (_, action) = app.action().await;
    let asked = json!({ "session": app.session, "log_return": 0.1 });
    let (status, then) = app.post("/what-if", &asked).await;
    assert_eq!(status, 200, "{then}");
    let (wealth, share) = (number(&session(&app).await["wealth"]), number(&action["spending"]["share"]));
    let held = number(&action["allocation"]);
    let expected = wealth * (1.0 - share) * ((1.0 - held) * 1.01 + held * 0.1_f64.exp());
    assert!((number(&then["wealth"]) / expected - 1.0).abs() < 1e-12, "{then} {expected}");
    let (_, futures) = app.get(&format!("/sessions/{}/futures", app.session)).await;
    assert_eq!(futures["field"], "problem.spending", "{futures}");
}

/// The service answers what the library does, and the same again.
#[tokio::test(flavor = "multi_thread")]
async fn a_plan_is_that_of_the_library_and_names_its_faults() {
    let app = App::start().await;
    let problem = request(YEARS, &HISTORY, json!({ "inflation": 0.02 }))["problem"].clone();
    let question = json!({ "problem": problem, "goal": 80.0, "wanted": 4.0, "paths": 500 });
    let (status, plan) = app.post("/plan", &question).await;
    assert_eq!(status, 200, "{plan}");
    let expected = PlanAsked::Asset(serde_json::from_value(question.clone()).unwrap()).answer().unwrap();
    assert_eq!(plan, serde_json::from_str::<Value>(&serde_json::to_string(&expected).unwrap()).unwrap());
    // The first period is what a policy trained for the same problem advises.
    let solved = Advisor::new(crate::support::policies::train(request(YEARS, &HISTORY, json!({ "inflation": 0.02 }))));
    let advised = solved.advise(0, &State::new(&HISTORY, 100.0, Learning::default()).unwrap(), AdviceMode::Surrogate);
    assert_eq!(number(&plan["advice"]["spending"]["share"]), advised.spending.unwrap().share);
    let mut of_assets = question.clone();
    let rows: Vec<[f64; 2]> = HISTORY.iter().map(|z| [*z, 0.08 - 0.6 * z]).collect();
    of_assets["problem"]["history"] = json!(rows);
    of_assets["problem"].as_object_mut().unwrap().remove("framework");
    of_assets["problem"]["assets"] = json!(["stocks", "hedge"]);
    let (status, plan) = app.post("/plan", &of_assets).await;
    assert_eq!(status, 200, "{plan}");
    let expected = PlanAsked::Assets(serde_json::from_value(of_assets.clone()).unwrap()).answer().unwrap();
    assert_eq!(plan, serde_json::from_str::<Value>(&serde_json::to_string(&expected).unwrap()).unwrap());
    // Rows that are no table are refused before a fund is made of them.
    let mut ragged = of_assets.clone();
    for rows in [json!([[0.1, 0.2], [0.1]]), json!([]), json!([[], []])] {
        ragged["problem"]["history"] = rows;
        let (status, problem) = app.post("/plan", &ragged).await;
        assert_eq!(status, 422, "{problem}");
        assert!(problem["field"].as_str().unwrap().starts_with("problem.history"), "{problem}");
    }
    // Without the periods of a year nobody knows what 4 % of it are.
    let mut timeless = question.clone();
    timeless["problem"].as_object_mut().unwrap().remove("periods_per_year");
    let (_, plan) = app.post("/plan", &timeless).await;
    let rules: Vec<&Value> = plan["strategies"].as_array().unwrap().iter().map(|strategy| &strategy["rule"]).collect();
    assert_eq!(rules, ["plan", "trusting", "sixty_forty"]);
    of_assets["problem"]["assets"] = json!(["stocks", "stocks"]);
    assert_eq!(app.post("/plan", &of_assets).await.1["field"], "problem.assets[1]");
    let faults = [
        ("/problem/framework", json!("plug_in"), "problem.framework"),
        ("/problem/spending/discount", json!(0.1), "problem.spending.discount"),
        ("/problem/horizon", json!(521), "problem.horizon"),
        ("/wanted", json!(0.0), "wanted"),
        ("/goal", json!(-1.0), "goal"),
        ("/certainty", json!(1.0), "certainty"),
        ("/paths", json!(100), "paths"),
        ("/seed", json!(-1), "seed"),
        ("/colour", json!("red"), "colour"),
    ];
    for (pointer, value, field) in faults {
        let question = replaced(question.clone(), pointer, value);
        let (status, problem) = app.post("/plan", &question).await;
        assert_eq!((status.as_u16(), problem["field"].as_str()), (422, Some(field)), "{problem}");
    }
}
