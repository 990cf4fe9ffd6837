//! Sessions that live a declared problem: a session is what its reports as they stand make of it, by the problem's own
//! formulas, and it decides as `POST /decide` does at the same state.

use rand::{RngExt, SeedableRng};
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::decide::stock;
use crate::support::patience::until;
use crate::support::values::number;
use crate::support::{App, specification};

over_either_store![
    a_session_moves_by_the_formulas_and_decides_as_decide_does,
    a_corrected_session_is_as_if_reported_right,
    a_renewed_session_decides_by_the_next_policy
];

async fn action(app: &App) -> Value {
    let (status, answer) = app.action().await;
    assert_eq!(status, 200, "{answer}");
    answer
}

async fn session(app: &App) -> Value {
    app.get(&format!("/sessions/{}", app.session)).await.1
}

/// The stock after a period of the example, and what the period earns, by formulas of this file.
fn after(stock: f64, order: f64, demand: f64) -> (f64, f64) {
    let left = (stock + order - demand).max(0.0);
    (left, 9.0 * (stock + order).min(demand) - 5.0 * order - 0.5 * left)
}

async fn a_session_moves_by_the_formulas_and_decides_as_decide_does(mut app: App) {
    app.train(&stock(4)).await;
    app.open_with(json!({ "state": { "stock": 7.0 }, "name": "The shop" })).await;
    let opened = session(&app).await;
    assert_eq!(opened["states"], json!({ "stock": 7.0 }));
    assert_eq!((&opened["wealth"], &opened["horizon"], &opened["earned"]), (&Value::Null, &json!(4), &json!(0.0)));
    let mut noises = Vec::new();
    let (mut stands, mut earned) = (7.0, 0.0);
    let reports = [
        json!({ "noise": 18.5 }),
        json!({ "noise": 11.0, "executed": { "order": 12.0 }, "date": "2026-01-31" }),
        // What was counted differs from the formula, and is believed.
        json!({ "noise": 14.0, "executed": { "order": 20.0 }, "state": { "stock": 8.5 } }),
    ];
    for (index, report) in reports.into_iter().enumerate() {
        let period = index + 1;
        let question =
            json!({ "policy": app.policy, "period": period, "state": { "stock": stands }, "noises": noises });
        let (status, mut decided) = app.post("/decide", &question).await;
        assert_eq!(status, 200, "{decided}");
        let advised = action(&app).await;
        assert_eq!(advised["state"], json!({ "stock": stands }));
        let known = decided.as_object_mut().unwrap();
        known.remove("policy");
        for (field, value) in known {
            assert_eq!(&advised[field.as_str()], value, "{field} of period {period}, bit for bit");
        }
        let (status, observed) = app.report(period, report.clone()).await;
        assert_eq!(status, 200, "{observed}");
        assert_eq!(observed["advised"], advised["actions"]);
        let executed = report.pointer("/executed/order").unwrap_or(&advised["actions"]["order"]).clone();
        assert_eq!(observed["executed"]["order"], executed);
        let (next, reward) = after(stands, number(&executed), number(&report["noise"]));
        assert!((number(&observed["reward"]) - reward).abs() < 1e-9, "{observed}");
        earned += reward;
        stands = report.pointer("/state/stock").map_or(next, number);
        assert!((number(&observed["state"]["stock"]) - stands).abs() < 1e-9, "{observed}");
        stands = number(&observed["state"]["stock"]);
        noises.push(report["noise"].clone());
        // The same report again has the same answer, and another is refused.
        assert_eq!(app.report(period, report.clone()).await, (StatusCode::OK, observed.clone()));
        let mut other = report;
        other["noise"] = json!(18.25);
        assert_eq!(app.report(period, other).await.0, StatusCode::CONFLICT);
        let coming = action(&app).await;
        assert_eq!(coming["radius"], observed["radius"], "of period {}", period + 1);
        app.restart().await;
        assert_eq!(action(&app).await, coming, "replayed");
    }
    let present = session(&app).await;
    assert!((number(&present["earned"]) - earned).abs() < 1e-9, "{present}");
    assert_eq!((&present["date"], &present["sample_size"]), (&json!("2026-01-31"), &json!(10)));
    // Among sessions of investors it has no wealth.
    for sort in ["wealth", "-wealth", "name"] {
        let (status, page) = app.get(&format!("/sessions?sort={sort}&limit=1")).await;
        assert_eq!((status, &page["sessions"][0]["wealth"]), (StatusCode::OK, &Value::Null), "{page}");
        assert_eq!(page["sessions"][0]["period"], 4);
    }
    // A noise that nobody knows moves the state by what is reported of it.
    let (status, last) = app.report(4, json!({ "missing": true, "state": { "stock": 2.0 } })).await;
    assert_eq!((status, &last["noise"], &last["reward"]), (StatusCode::OK, &Value::Null, &Value::Null), "{last}");
    assert_eq!((&last["completed"], &last["state"]["stock"]), (&json!(true), &json!(2.0)));
    let over = json!({ "noise": 1.0 });
    assert_eq!((app.action().await.0, app.report(5, over).await.0), (StatusCode::CONFLICT, StatusCode::CONFLICT));
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!((&history["initial_state"]["stock"], &history["history"][1]), (&json!(7.0), &json!(27.3)));
    assert_eq!(history["observations"][3]["answered"], last);
    assert_eq!(history["observations"][2]["reported"]["state"]["stock"], 8.5);
    assert_eq!(app.delete(&format!("/sessions/{}", app.session)).await, StatusCode::NO_CONTENT);
}

/// A period as a test knows it: the order, the demand, and the stock that was reported.
type Period = (f64, f64, Option<f64>);

fn reported(&(order, demand, counted): &Period) -> Value {
    let mut report = json!({ "noise": demand, "executed": { "order": order } });
    if let Some(counted) = counted {
        report["state"] = json!({ "stock": counted });
    }
    report
}

/// Checks the session against the formulas of this file, in memory and replayed.
async fn check(app: &mut App, start: f64, periods: &[Period]) {
    let (mut stands, mut earned) = (start, 0.0);
    let mut expected = Vec::new();
    for (order, demand, counted) in periods {
        let (next, reward) = after(stands, *order, *demand);
        stands = counted.unwrap_or(next);
        earned += reward;
        expected.push((stands, reward, earned));
    }
    for place in ["in memory", "replayed"] {
        let present = session(app).await;
        assert!((number(&present["states"]["stock"]) - stands).abs() < 1e-9, "{place}: {present} for {stands}");
        assert!((number(&present["earned"]) - earned).abs() < 1e-9, "{place}: {present} for {earned}");
        assert_eq!(present["period"], periods.len() + 1, "{place}");
        let (status, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
        assert_eq!(status, 200, "{history}");
        let observations = history["observations"].as_array().unwrap();
        assert_eq!(observations.len(), expected.len(), "{place}");
        for (observation, (stands, reward, earned)) in observations.iter().zip(&expected) {
            let now = &observation["now"];
            let close = |field: &str, value: f64| (number(now.pointer(field).unwrap()) - value).abs() < 1e-9;
            assert!(close("/state/stock", *stands) && close("/reward", *reward) && close("/earned", *earned), "{now}");
        }
        app.restart().await;
    }
}

/// Random reports and corrections of a session against formulas of this file.
async fn a_corrected_session_is_as_if_reported_right(mut app: App) {
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(38);
    let mut draw = |least: f64, most: f64| least + (most - least) * generator.random::<f64>();
    app.train(&stock(8)).await;
    app.open_with(json!({ "state": { "stock": 10.0 } })).await;
    let mut period = |counts: bool| -> Period {
        let counted = counts.then(|| draw(0.0, 30.0));
        // An order of at most 20 is allowed at any stock up to 40.
        (draw(0.0, 20.0), draw(8.0, 28.0), counted)
    };
    let mut periods: Vec<Period> = Vec::new();
    for number in 1..=5 {
        periods.push(period(number % 2 == 0));
        let (status, observed) = app.report(number, reported(&periods[number - 1])).await;
        assert_eq!(status, 200, "{observed}");
    }
    check(&mut app, 10.0, &periods).await;
    let changes =
        [("replace", 2), ("remove", 3), ("insert", 1), ("replace", 5), ("insert", 4), ("remove", 6), ("replace", 1)];
    for (number, (change, at)) in (1..).zip(changes) {
        let now = period(number % 2 == 1);
        let mut correction = match change {
            "remove" => json!({}),
            _ => reported(&now),
        };
        match change {
            "replace" => periods[at - 1] = now,
            "insert" => periods.insert(at - 1, now),
            _ => drop(periods.remove(at - 1)),
        }
        for (field, value) in [
            ("correction", json!(number)),
            ("period", json!(at)),
            ("change", json!(change)),
            ("reason", json!("it was counted again")),
        ] {
            correction[field] = value;
        }
        let path = format!("/sessions/{}/corrections", app.session);
        let (status, corrected) = app.post(&path, &correction).await;
        assert_eq!(status, 200, "{correction}: {corrected}");
        assert_eq!(corrected["observed"], periods.len());
        let noise = if change == "remove" { Value::Null } else { json!(now.1) };
        assert!(noise.is_null() == corrected["noise"].is_null(), "{corrected}");
        assert_eq!(app.post(&path, &correction).await.1, corrected, "repeated");
        let advised = action(&app).await;
        assert_eq!(advised["radius"], corrected["radius"]);
        // As at the same state after the same noises.
        let noises: Vec<f64> = periods.iter().map(|(_, demand, _)| *demand).collect();
        let state = &corrected["state"];
        let question = json!({ "policy": app.policy, "period": periods.len() + 1, "state": state, "noises": noises });
        assert_eq!(app.post("/decide", &question).await.1["actions"], advised["actions"]);
        check(&mut app, 10.0, &periods).await;
    }
    // Nothing was advised for a period that is inserted.
    let untold = json!({ "correction": 8, "period": 1, "change": "insert", "noise": 12.0, "reason": "it was skipped" });
    let (status, problem) = app.post(&format!("/sessions/{}/corrections", app.session), &untold).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("executed")), "{problem}");
}

/// Checks that the coming period of the session is decided as `/decide` does it in this period of the policy.
async fn decides_as(app: &App, policy: &str, period: usize, noises: &[f64]) {
    let advised = action(app).await;
    let question = json!({ "policy": policy, "period": period, "state": advised["state"], "noises": noises });
    let (status, decided) = app.post("/decide", &question).await;
    assert_eq!(status, 200, "{decided}");
    for field in ["actions", "value", "radius", "worst_law"] {
        assert_eq!(advised[field], decided[field], "{field} of period {period}");
    }
}

async fn a_renewed_session_decides_by_the_next_policy(mut app: App) {
    let mut discounted = stock(3);
    discounted["problem"]["discount"] = json!(0.9);
    app.train(&discounted).await;
    let first = app.policy.clone();
    app.open_with(json!({ "state": { "stock": 7.0 } })).await;
    for (period, noise) in [(1, 18.5), (2, 11.0)] {
        let report = json!({ "noise": noise, "executed": { "order": 12.0 } });
        assert_eq!(app.report(period, report).await.0, 200);
    }
    let before = session(&app).await;
    // The next policy has seen more, looks further, and sells for another price.
    let mut next = stock(4);
    next["problem"]["discount"] = json!(0.5);
    next["problem"]["history"].as_array_mut().unwrap().extend([json!(18.5), json!(11.0)]);
    next["problem"]["parameters"]["price"] = json!(12.0);
    app.train(&next).await;
    let second = app.policy.clone();
    let path = format!("/sessions/{}/renewals", app.session);
    for (change, what) in
        [(("/problem/noise/high", json!(41)), "noise"), (("/problem/states/stock/high", json!(1)), "state.stock")]
    {
        let mut other = stock(2);
        *other.pointer_mut(change.0).unwrap() = change.1;
        other["problem"]["parameters"]["capacity"] = json!(1);
        other["problem"]["states"]["stock"]["start"] = json!(0.5);
        app.train(&other).await;
        let (status, problem) = app.post(&path, &json!({ "renewal": 1, "policy": app.policy })).await;
        assert_eq!(status, 422, "{problem}");
        let named = [&problem["field"], &problem["value"]].map(ToString::to_string).join(" ");
        assert!(named.contains(what), "{what}: {problem}");
    }
    app.train(&specification(2)).await;
    let (status, problem) = app.post(&path, &json!({ "renewal": 1, "policy": app.policy })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("policy")), "{problem}");
    let renewal = json!({ "renewal": 1, "policy": second });
    let (status, renewed) = app.post(&path, &renewal).await;
    assert_eq!((status.as_u16(), &renewed["period"], &renewed["horizon"]), (200, &json!(3), &json!(6)), "{renewed}");
    assert_eq!(renewed["problem"]["parameters"]["price"], 12.0);
    assert_eq!(app.post(&path, &renewal).await.1, renewed, "repeated");
    let after = session(&app).await;
    for field in ["states", "earned", "drift", "period", "sample_size"] {
        assert_eq!(after[field], before[field], "{field}");
    }
    assert_eq!((&after["policy"], &after["renewals"], &after["horizon"]), (&json!(second), &json!(1), &json!(6)));
    decides_as(&app, &second, 1, &[]).await;
    let (status, observed) = app.report(3, json!({ "noise": 20.0, "executed": { "order": 16.0 } })).await;
    assert_eq!(status, 200, "{observed}");
    // 0.5 and 1.5 were left of the first two orders, and 17.5 are sold for the new price.
    assert_eq!(observed["state"]["stock"], 0.0);
    assert!((number(&observed["reward"]) - (12.0 * 17.5 - 5.0 * 16.0)).abs() < 1e-9, "{observed}");
    // Of two periods with the first discount, and then with the second.
    let [one, two, three] = [9.0 * 18.5 - 60.0 - 0.25, 9.0 * 11.0 - 60.0 - 0.75, 12.0 * 17.5 - 80.0];
    let earned = number(&observed["earned"]);
    assert!((earned - (one + 0.9 * two + 0.81 * three)).abs() < 1e-9, "{observed}");
    decides_as(&app, &second, 2, &[20.0]).await;
    let coming = action(&app).await;
    app.restart().await;
    assert_eq!(action(&app).await, coming, "replayed");
    // What the next policy knows of the first periods is its own history.
    let correct =
        |period: usize| json!({ "correction": 1, "period": period, "noise": 19.0, "reason": "it was counted again" });
    let corrections = format!("/sessions/{}/corrections", app.session);
    let (status, problem) = app.post(&corrections, &correct(2)).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("period")), "{problem}");
    let (status, corrected) = app.post(&corrections, &correct(3)).await;
    assert_eq!((status.as_u16(), &corrected["noise"]), (200, &json!(19.0)), "{corrected}");
    decides_as(&app, &second, 2, &[19.0]).await;
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!((&history["policy"], &history["renewals"][0]["policy"]), (&json!(first), &json!(second)));
    assert_eq!(history["observations"].as_array().unwrap().len(), 3);
    for period in 4..=6 {
        assert_eq!(app.report(period, json!({ "noise": 18.0 })).await.0, 200);
    }
    assert_eq!(app.action().await.0, StatusCode::CONFLICT);
    // Neither policy may go while the session needs it.
    assert_eq!(app.delete(&format!("/policies/{second}")).await, StatusCode::CONFLICT);
}

async fn what_if(app: &App, mut question: Value) -> (StatusCode, Value) {
    question["session"] = json!(app.session);
    app.post("/what-if", &question).await
}

/// A hypothesis is answered as the session would be if it were true, and nothing is recorded.
#[tokio::test(flavor = "multi_thread")]
async fn a_hypothesis_is_answered_as_if_it_were_true() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    app.open_with(json!({ "state": { "stock": 7.0 } })).await;
    assert_eq!(app.report(1, json!({ "noise": 18.5, "executed": { "order": 12.0 } })).await.0, 200);
    let (before, advised) = (session(&app).await, action(&app).await);
    let same = what_if(&app, json!({ "radius_scale": 1.0 })).await.1;
    for field in ["actions", "value", "radius", "worst_law", "state", "period"] {
        assert_eq!(same[field], advised[field], "{field}");
    }
    let question = json!({ "policy": app.policy, "period": 2, "state": { "stock": 20.0 }, "noises": [18.5] });
    let decided = app.post("/decide", &question).await.1;
    let supposed = what_if(&app, json!({ "state": { "stock": 20.0 } })).await.1;
    assert_eq!((&supposed["actions"], &supposed["value"]), (&decided["actions"], &decided["value"]));
    // A larger ball has more laws, so what is sure against all of them is less; a scale is the radius itself.
    let sweep = json!({ "sweep": { "radius_scale": { "from": 0.0, "to": 2.0, "points": 9 } } });
    let points = what_if(&app, sweep).await.1["points"].as_array().unwrap().clone();
    assert_eq!(points.len(), 9);
    for (index, pair) in points.windows(2).enumerate() {
        let [less, more] = [&pair[0], &pair[1]].map(|point| number(&point["value"]));
        assert!(more <= less + 1e-6 * less.abs(), "{less} and {more} at {index}");
        let expected = 0.25 * (index + 1) as f64 * number(&advised["radius"]);
        assert!((number(&pair[1]["radius"]) - expected).abs() < 1e-12, "{}", pair[1]);
    }
    assert!(number(&points[8]["value"]) < number(&points[0]["value"]) - 1.0);
    // After a noise, the advice is that of the session once it has come.
    let supposed = what_if(&app, json!({ "noise": 22.0 })).await.1;
    let swept = what_if(&app, json!({ "sweep": { "noise": { "from": 10.0, "to": 22.0, "points": 3 } } })).await.1;
    assert_eq!((&swept["points"][2]["actions"], &swept["points"][1]["noise"]), (&supposed["actions"], &json!(16.0)));
    assert_eq!(session(&app).await, before);
    assert_eq!(app.report(2, json!({ "noise": 22.0 })).await.0, 200);
    let came = action(&app).await;
    for field in ["actions", "value", "radius", "worst_law", "state", "period"] {
        assert_eq!(supposed[field], came[field], "{field}");
    }
    let (status, problem) = what_if(&app, json!({ "noise": 22.0 })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("noise")), "{problem}");
}

/// A session that renews itself goes on by policies trained on what it saw, from the states that it had.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_renews_itself() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    app.open_with(json!({ "state": { "stock": 7.0 }, "renew": { "every": 2, "window": 6 } })).await;
    let mut noises = vec![11.6, 19.0, 22.3, 21.1, 18.7];
    assert_eq!(action(&app).await["caution"], json!([]));
    for renewal in 1..=2 {
        for period in [2 * renewal - 1, 2 * renewal] {
            let noise = 17.3 + period as f64;
            noises.push(noise);
            assert_eq!(app.report(period, json!({ "noise": noise })).await.0, 200);
        }
        let renewed = until("the renewal", async || Some(session(&app).await).filter(|now| now["renewals"] == renewal));
        let renewed = renewed.await;
        let policy = renewed["policy"].as_str().unwrap().to_owned();
        let (_, detail) = app.get(&format!("/policies/{policy}")).await;
        let problem = &detail["specification"]["problem"];
        noises.drain(..noises.len() - 6);
        assert_eq!(problem["history"], json!(noises));
        assert_eq!(problem["states"]["stock"]["start"], renewed["states"]["stock"]);
        decides_as(&app, &policy, 1, &[]).await;
    }
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(history["renewals"].as_array().unwrap().len(), 2);
    assert_eq!(history["observations"][3]["now"]["noise"], 21.3);
}

/// The walk-forward is what a session lives that renews itself and follows its advice, bit for bit.
#[tokio::test(flavor = "multi_thread")]
async fn a_walk_forward_is_the_life_of_a_session_that_renews_itself() {
    let record = [9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7, 18.3, 19.3, 20.3, 14.9, 24.6];
    let mut app = App::start().await;
    let mut request = stock(3);
    request["problem"]["history"] = json!(record[..7]);
    app.train(&request).await;
    app.open_with(json!({ "renew": { "every": 2, "window": 7 } })).await;
    let mut lived = Vec::new();
    for (index, noise) in record[7..].iter().enumerate() {
        let mut now = action(&app).await;
        assert_eq!(app.report(index + 1, json!({ "noise": noise })).await.0, 200);
        if index % 2 == 1 {
            let renewals = index.div_ceil(2);
            until("the renewal", async || Some(session(&app).await).filter(|now| now["renewals"] == renewals)).await;
        }
        lived.push((now["state"].take(), now["actions"].take(), now["radius"].take()));
    }
    let stands = session(&app).await;
    request["problem"]["history"] = json!(record);
    request["window"] = json!(7);
    request["every"] = json!(2);
    request["rules"] = json!({ "base": { "order": "max(25 - stock, 0)" } });
    let (status, accepted) = app.post("/backtest", &request).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    let ended = app.until(accepted["job"].as_str().unwrap(), |job| job["finished_ms"].is_number()).await;
    let (_, report) = app.get(ended["report"].as_str().unwrap_or_else(|| panic!("{ended}"))).await;
    assert_eq!(report["format"], "ballast-declared-walk-1");
    let own = &report["strategies"][0];
    for (period, (state, actions, radius)) in own["periods"].as_array().unwrap().iter().zip(&lived) {
        assert_eq!((&period["states"], &period["actions"], &period["radius"]), (state, actions, radius));
    }
    assert_eq!((own["periods"].as_array().unwrap().len(), &own["earned"]), (lived.len(), &stands["earned"]));
    assert_eq!(own["left"], 3.0 * number(&stands["states"]["stock"]));
    // What is wrong is named, before anything is queued.
    for (field, value, named) in [
        ("window", json!(12), "window"),
        ("frameworks", json!(["known_law"]), "frameworks[0]"),
        ("rules", json!({ "base": { "order": "max(25 - stok, 0)" } }), "rules.base.order"),
        ("windows", json!([7]), "windows"),
    ] {
        let mut wrong = request.clone();
        wrong[field] = value;
        let (status, problem) = app.post("/backtest", &wrong).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(named)), "{problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_is_named() {
    let mut app = App::start().await;
    let mut calm = stock(3);
    calm["problem"]["history"] = json!([18.0, 19.0, 20.0, 18.5, 19.5, 19.0, 20.0]);
    app.train(&calm).await;
    for (start, field) in [
        (json!({ "state": { "stock": 61 } }), "state.stock"),
        (json!({ "state": {} }), "state.stock"),
        (json!({ "wealth": 100 }), "wealth"),
        (json!({ "holding": 0.5 }), "holding"),
        (json!({ "history": [0.01, 0.02] }), "history"),
        (json!({ "renew": { "every": 3 } }), "renew.every"),
        (json!({ "renew": { "every": 2, "window": 1 } }), "renew.window"),
        (json!({ "rolling": true }), "rolling"),
    ] {
        let mut start = start;
        start["policy"] = json!(app.policy);
        let (status, problem) = app.post("/sessions", &start).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{start}: {problem}");
    }
    app.open().await;
    assert_eq!(session(&app).await["states"]["stock"], 4.0, "the declared start");
    for (report, field) in [
        (json!({}), "noise"),
        (json!({ "noise": 41.0 }), "noise"),
        (json!({ "noise": 18.0, "missing": true }), "missing"),
        (json!({ "missing": true }), "state"),
        (json!({ "log_return": 0.01 }), "log_return"),
        (json!({ "noise": 18.0, "wealth": 100.0 }), "wealth"),
        (json!({ "noise": 18.0, "executed_allocation": 0.5 }), "executed_allocation"),
        (json!({ "noise": 18.0, "executed": { "order": 56.5 } }), "executed.order"),
        (json!({ "noise": 18.0, "executed": { "oder": 5.0 } }), "executed.oder"),
        (json!({ "noise": 18.0, "executed": {} }), "executed.order"),
        (json!({ "noise": 18.0, "state": { "stock": -1.0 } }), "state.stock"),
    ] {
        let (status, problem) = app.report(1, report.clone()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{report}: {problem}");
    }
    // A noise far from all others is probably a mistake.
    let (status, problem) = app.report(1, json!({ "noise": 30.0 })).await;
    assert_eq!((status.as_u16(), &problem["doubts"][0]["reason"]), (409, &json!("unusual_noise")), "{problem}");
    assert_eq!(app.report(1, json!({ "noise": 30.0, "confirm": true })).await.0, 200);
    // What only an investor has is refused by name.
    let query = format!("/action?session={}&sensitivity=true", app.session);
    let (status, problem) = app.get(&query).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("sensitivity")), "{problem}");
    for (question, field) in [
        (json!({ "wealth": 100.0 }), "wealth"),
        (json!({ "radius": 0.1 }), "radius"),
        (json!({ "holdings": { "a": 0.1 } }), "holdings"),
        (json!({ "sweep": { "holding": { "from": 0.0, "to": 1.0, "points": 3 } } }), "sweep.holding"),
        (json!({ "sweep": {} }), "sweep"),
        (json!({ "radius_scale": 1.0, "sweep": { "radius_scale": { "from": 0, "to": 1, "points": 3 } } }), "sweep"),
        (json!({ "sweep": { "noise": { "from": 0.0, "to": 40.0, "points": 102 } } }), "sweep.noise.points"),
        (json!({ "radius_scale": -0.5 }), "radius_scale"),
        (json!({ "noise": 41.0 }), "noise"),
        (json!({ "state": { "stock": 61.0 } }), "state.stock"),
    ] {
        let (status, problem) = what_if(&app, question.clone()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{question}: {problem}");
    }
    for (field, value) in [("window", json!(5)), ("records", json!({ "a": [0.1, 0.2] })), ("leaving", json!(["a"]))] {
        let mut renewal = json!({ "renewal": 1, "policy": app.policy });
        renewal[field] = value;
        let (status, problem) = app.post(&format!("/sessions/{}/renewals", app.session), &renewal).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }
    // And the fields of a declared problem by an investor's session.
    let declared = (app.session.clone(), app.policy.clone());
    app.train(&specification(3)).await;
    let (status, problem) = app.post("/sessions", &json!({ "policy": app.policy, "state": { "stock": 4 } })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("state")), "{problem}");
    app.open().await;
    let (status, problem) = app.report(1, json!({ "log_return": 0.01, "noise": 18.0 })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("noise")), "{problem}");
    // One list may report of both.
    let list = json!([
        { "session": app.session, "period": 1, "log_return": 0.01 },
        { "session": declared.0, "period": 2, "noise": 19.0 },
    ]);
    let (status, answers) = app.post("/observe", &list).await;
    let statuses: Vec<&Value> = answers.as_array().unwrap().iter().map(|answer| &answer["status"]).collect();
    assert_eq!((status.as_u16(), statuses), (200, vec![&json!(200); 2]), "{answers}");
}

/// Nothing can be advised where the formulas lead out of the range of a state, but what happened can be reported.
#[tokio::test(flavor = "multi_thread")]
async fn a_state_that_leaves_its_range_must_be_reported() {
    let mut app = App::start().await;
    let mut kept = stock(3);
    // No path from the start leaves this range, but one from its end does.
    kept["problem"]["states"]["stock"] = json!({ "start": 4, "low": -120, "high": 64 });
    kept["problem"]["next"]["stock"] = json!("stock + order - demand");
    kept["problem"]["actions"]["order"] = json!({ "low": "0", "high": "20" });
    app.train(&kept).await;
    app.open_with(json!({ "state": { "stock": 60.0 } })).await;
    let (status, problem) = app.action().await;
    assert!(status.is_client_error() && problem["field"] == "state", "{status} {problem}");
    // Fewer were wanted than ever before, which is meant.
    let moved = json!({ "noise": 1.0, "executed": { "order": 20.0 }, "confirm": true });
    for (report, field) in [(json!({ "noise": 1.0, "confirm": true }), "executed"), (moved.clone(), "state")] {
        let (status, problem) = app.report(1, report.clone()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{report}: {problem}");
    }
    // What was earned is known even if the formula of the state leaves its range.
    let mut counted = moved;
    counted["state"] = json!({ "stock": 30.0 });
    let (status, observed) = app.report(1, counted).await;
    assert_eq!((status.as_u16(), &observed["advised"]), (200, &Value::Null), "{observed}");
    assert_eq!((&observed["reward"], &observed["earned"]), (&json!(9.0 - 100.0 - 39.5), &json!(-130.5)), "{observed}");
    app.restart().await;
    assert_eq!(session(&app).await["states"]["stock"], 30.0);
    assert!(action(&app).await["actions"]["order"].is_number());
}

/// A correction replaces the whole report: without actions, those that were advised count.
#[tokio::test(flavor = "multi_thread")]
async fn a_correction_without_actions_counts_the_advised_ones() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    app.open().await;
    let advised = action(&app).await["actions"]["order"].clone();
    assert_eq!(app.report(1, json!({ "noise": 18.0, "executed": { "order": 10.0 } })).await.0, 200);
    for (number, executed, expected) in [(1, None, advised.clone()), (2, Some(12.0), json!(12.0)), (3, None, advised)] {
        let mut correction =
            json!({ "correction": number, "period": 1, "noise": 10.0, "reason": "it was counted again" });
        if let Some(order) = executed {
            correction["executed"] = json!({ "order": order });
        }
        let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
        assert_eq!(status, 200, "{corrected}");
        let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
        assert_eq!(history["observations"][0]["now"]["executed"]["order"], expected, "{number}");
    }
}

/// Nothing is recorded that could not be read back, and nothing is advised that could not be done.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_number_is_not_recorded() {
    let mut app = App::start().await;
    let mut far = stock(4);
    // No path from the start comes near these states.
    far["problem"]["states"]["stock"] = json!({ "start": 4, "low": 0, "high": 400 });
    far["problem"]["reward"] = json!("if(stock > 350, 1.7e308, price*min(stock + order, demand) - cost*order)");
    far["problem"]["actions"]["order"] = json!({ "low": "if(stock > 300, 5, 0)", "high": "if(stock > 300, 1, 60)" });
    app.train(&far).await;
    app.open_with(json!({ "state": { "stock": 320.0 } })).await;
    let (status, problem) = app.action().await;
    assert!(status.is_client_error() && problem["rule"].to_string().contains("`low` at most `high`"), "{problem}");
    app.open_with(json!({ "state": { "stock": 4.0 } })).await;
    assert_eq!(app.report(1, json!({ "noise": 18.0, "state": { "stock": 360.0 } })).await.0, 200);
    let enormous = json!({ "missing": true, "executed": { "order": 3.0 }, "state": { "stock": 360.0 } });
    let (status, problem) = app.report(2, enormous).await;
    // No action is allowed there.
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("executed.order")), "{problem}");
    far["problem"]["actions"]["order"] = json!({ "low": "0", "high": "60" });
    app.train(&far).await;
    app.open_with(json!({ "state": { "stock": 360.0 } })).await;
    let report = json!({ "noise": 18.0, "executed": { "order": 0.0 }, "state": { "stock": 360.0 } });
    assert_eq!(app.report(1, report.clone()).await.0, 200);
    let (status, problem) = app.report(2, report).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("noise")), "{problem}");
    assert_eq!(app.get(&format!("/sessions/{}/history", app.session)).await.0, 200);
}
