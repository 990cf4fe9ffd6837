//! Declared problems over HTTP: trained as a job, kept as a policy, and asked at any state.

use ballast::control::policy::declared::Decided;
use ballast::control::progress::Watch;
use ballast::control::request::declared::DeclaredSpecification;
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::support::{App, read, specification};

over_either_store![a_trained_declaration_decides_as_the_command_does, a_restart_resumes_to_the_same_policy];

/// A map has the decisions at the points of its ranges.
#[tokio::test(flavor = "multi_thread")]
async fn a_map_decides_at_every_point() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    let range = |input: &str, from: f64, to: f64, points: usize| json!({ "input": input, "from": from, "to": to, "points": points });
    let number = |value: &Value| value.as_f64().unwrap();
    let one = json!({ "period": 2, "noises": [20.0], "across": [range("stock", 0.0, 60.0, 4)] });
    let (status, map) = decide(&app, one).await;
    assert_eq!((status, &map["across"][0]["values"]), (StatusCode::OK, &json!([0.0, 20.0, 40.0, 60.0])), "{map}");
    let both = json!({ "period": 3, "state": { "stock": 1.0 }, "across": [range("demand", 0.0, 40.0, 3), range("stock", 0.0, 60.0, 4)] });
    let (status, wide) = decide(&app, both).await;
    assert_eq!(status, 200, "{wide}");
    assert_eq!((map["points"].as_array().unwrap().len(), wide["points"].as_array().unwrap().len()), (4, 12));
    for (points, place, question) in [
        (&map, 1, json!({ "period": 2, "state": { "stock": 20.0 }, "noises": [20.0] })),
        (&wide, 4, json!({ "period": 3, "state": { "stock": 0.0 }, "noises": [20.0, 20.0] })),
        (&wide, 11, json!({ "period": 3, "state": { "stock": 60.0 }, "noises": [40.0, 40.0] })),
    ] {
        let alone = decide(&app, question).await.1;
        for field in ["actions", "value", "untrained_share"] {
            assert_eq!(points["points"][place][field], alone[field], "{field} of {place}");
        }
    }
    // More in stock means a smaller order and a larger worth.
    for pair in map["points"].as_array().unwrap().windows(2) {
        assert!(number(&pair[0]["actions"]["order"]) >= number(&pair[1]["actions"]["order"]) - 0.2, "{pair:?}");
        assert!(number(&pair[0]["value"]) < number(&pair[1]["value"]), "{pair:?}");
    }
    for (question, field) in [
        (json!({ "across": [range("stok", 0.0, 60.0, 4)] }), "across[0].input"),
        (json!({ "across": [range("demand", 0.0, 40.0, 4)] }), "across[0].input"),
        (json!({ "across": [range("stock", 0.0, 61.0, 4)] }), "across[0].to"),
        (json!({ "across": [range("stock", 30.0, 30.0, 4)] }), "across[0].to"),
        (json!({ "across": [range("stock", 0.0, 60.0, 22)] }), "across[0].points"),
        (json!({ "across": [range("stock", 0.0, 60.0, 2), range("stock", 0.0, 60.0, 2)] }), "across[1].input"),
        (
            json!({ "across": [range("stock", 0.0, 60.0, 2), range("stock", 0.0, 60.0, 2), range("stock", 0.0, 60.0, 2)] }),
            "across",
        ),
        (json!({ "period": 2, "across": [range("stock", 0.0, 60.0, 2)] }), "noises"),
        (json!({ "period": 2, "noises": [20.0], "across": [range("demand", 0.0, 40.0, 2)] }), "noises"),
        (json!({ "period": 4, "across": [range("stock", 0.0, 60.0, 2)] }), "period"),
    ] {
        let (status, problem) = decide(&app, question.clone()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{question}: {problem}");
    }
}

/// The example of the stock, of fewer periods and states.
pub(crate) fn stock(horizon: usize) -> Value {
    let path = format!("{}/examples/problems/stock.json", env!("CARGO_MANIFEST_DIR"));
    let mut request: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    request["problem"]["horizon"] = json!(horizon);
    request["design"] = json!({ "count": 30 });
    request
}

fn decided(request: &Value) -> Value {
    let declared: DeclaredSpecification = serde_json::from_value(request.clone()).unwrap();
    serde_json::to_value(Decided::first(&declared, &Watch::unwatched()).unwrap()).unwrap()
}

async fn decide(app: &App, question: Value) -> (StatusCode, Value) {
    let mut question = question;
    question["policy"] = json!(app.policy);
    app.post("/decide", &question).await
}

async fn a_trained_declaration_decides_as_the_command_does(mut app: App) {
    let mut request = stock(3);
    request["name"] = json!("The shop");
    let job = app.queue(&request).await;
    let job = app.until(&job, |job| job["finished_ms"].is_number()).await;
    app.policy = job["policy"].as_str().unwrap_or_else(|| panic!("{job}")).to_owned();
    assert_eq!((&job["progress"]["steps_done"], &job["progress"]["steps_total"]), (&json!(2), &json!(2)));
    let (status, answer) = decide(&app, json!({})).await;
    assert_eq!(status, 200, "{answer}");
    let mut expected = decided(&stock(3));
    expected["policy"] = json!(app.policy);
    assert_eq!(answer, expected, "bit for bit");
    let (status, detail) = app.get(&format!("/policies/{}", app.policy)).await;
    assert_eq!(status, 200);
    assert_eq!((&detail["name"], &detail["horizon"]), (&json!("The shop"), &json!(3)));
    assert_eq!(detail["specification"]["problem"]["states"]["stock"]["start"], 4.0);
    assert_eq!(detail["diagnostics"].as_array().unwrap().len(), 2);
    assert_eq!(detail["diagnostics"][0]["value"]["features"][0], "stock");
    // The last period has no later value, so it is a problem of one period whose history goes on.
    let (noises, left) = ([25.0, 3.5], 11.25);
    let (status, last) = decide(&app, json!({ "period": 3, "state": { "stock": left }, "noises": noises })).await;
    assert_eq!(status, 200, "{last}");
    let mut shorter = stock(1);
    shorter["problem"]["states"]["stock"]["start"] = json!(left);
    shorter["problem"]["history"].as_array_mut().unwrap().extend(noises.map(|noise| json!(noise)));
    let alone = decided(&shorter);
    for (field, digits) in [("/value", 1e-6), ("/actions/order", 1e-3), ("/radius", 1e-9)] {
        let [found, expected] = [&last, &alone].map(|answer| answer.pointer(field).unwrap().as_f64().unwrap());
        assert!((found - expected).abs() < digits * expected.abs().max(1.0), "{field}: {found} and {expected}");
    }
    assert_eq!(last["untrained_share"], 0.0, "nothing comes after it");
    // More in stock is worth more, and nothing is ordered from some level on.
    let at =
        async |stock: f64| decide(&app, json!({ "period": 2, "state": { "stock": stock }, "noises": [20.0] })).await.1;
    let (low, high) = (at(2.0).await, at(45.0).await);
    let number = |answer: &Value, field: &str| answer.pointer(field).unwrap().as_f64().unwrap();
    assert!(number(&high, "/value") > number(&low, "/value"));
    assert!(number(&high, "/actions/order") < 1e-6 && number(&low, "/actions/order") > 5.0, "{low} {high}");
    // The document alone decides alike in another place.
    let (_, document) = app.get(&format!("/policies/{}/export", app.policy)).await;
    let mut other = App::start().await;
    let (status, imported) = other.post("/policies/import", &document).await;
    assert_eq!((status, &imported["policy"]), (StatusCode::CREATED, &json!(app.policy)), "{imported}");
    other.policy.clone_from(&app.policy);
    assert_eq!(decide(&other, json!({})).await.1, answer);
}

async fn a_restart_resumes_to_the_same_policy(mut app: App) {
    let mut request = stock(4);
    // A step must take long enough to be stopped in.
    request["design"]["count"] = json!(40);
    let (status, accepted) = app.post("/train", &request).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    let job = accepted["job"].as_str().unwrap().to_owned();
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() >= Some(1)).await;
    app.restart().await;
    let ended = app.until(&job, |job| job["finished_ms"].is_number()).await;
    let resumed = ended["policy"].as_str().unwrap_or_else(|| panic!("{ended}"));
    app.train(&request).await;
    assert_eq!(resumed, app.policy);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_is_named() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    for (question, field) in [
        (json!({ "period": 0 }), "period"),
        (json!({ "period": 4, "state": { "stock": 4 }, "noises": [1, 2, 3] }), "period"),
        (json!({ "period": 2, "noises": [1] }), "state"),
        (json!({ "period": 2, "state": { "stock": 4 } }), "noises"),
        (json!({ "period": 2, "state": { "stock": 4 }, "noises": [1, 2] }), "noises"),
        (json!({ "noises": [1] }), "noises"),
        (json!({ "period": 2, "state": { "stock": 4 }, "noises": [40.5] }), "noises[0]"),
        (json!({ "state": { "stock": 61 } }), "state.stock"),
        (json!({ "state": { "stok": 4 } }), "state.stok"),
        (json!({ "state": {} }), "state.stock"),
        (json!({ "state": { "stock": "4" } }), "state.stock"),
        (json!({ "wealth": 4 }), "wealth"),
    ] {
        let (status, problem) = decide(&app, question.clone()).await;
        assert_eq!(status, 422, "{question}: {problem}");
        assert_eq!(problem["field"], field, "{question}: {problem}");
    }
    // Of a name that stands twice the last would be read in silence.
    for (path, body, field) in [
        ("/decide", format!(r#"{{"policy":"{}","state":{{"stock":4,"stock":40}}}}"#, app.policy), "state"),
        (
            "/evaluate",
            format!(r#"{{"policies":{{"a":"{}"}},"rules":{{"r":{{"order":"1","order":"2"}}}}}}"#, app.policy),
            "rules.r",
        ),
    ] {
        let request = app.client.post(format!("{}{path}", app.url)).header("content-type", "application/json");
        let (status, problem) = read(request.body(body).send().await.unwrap()).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
        assert!(problem["rule"].as_str().unwrap().contains("stands twice"), "{problem}");
    }
    // Policies are counted before any is read.
    let many: serde_json::Map<String, Value> =
        (0..2000).map(|k| (format!("p{k}"), json!(format!("{k:064x}")))).collect();
    let (status, problem) = app.post("/evaluate", &json!({ "policies": many })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("policies")), "{problem}");
    // So are noises.
    let (status, problem) = decide(&app, json!({ "noises": vec![20.0; 50_000] })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("noises")), "{problem}");
    // A formula that is wrong is answered at once, with its column.
    let mut wrong = stock(3);
    wrong["problem"]["reward"] = json!("price*min(stock + ordr, demand)");
    let (status, problem) = app.post("/train", &wrong).await;
    assert_eq!((status, &problem["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("problem.reward")), "{problem}");
    assert!(problem["rule"].as_str().unwrap().contains("column 19"), "{problem}");
    // Each kind of policy says what asks it.
    let declared = app.policy.clone();
    assert_eq!(app.get(&format!("/policies/{declared}/surface")).await.0, 422);
    app.train(&specification(2)).await;
    let (status, problem) = decide(&app, json!({})).await;
    assert_eq!((status, &problem["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("policy")), "{problem}");
    app.policy = "0".repeat(64);
    assert_eq!(decide(&app, json!({})).await.0, 404);
    assert_eq!(app.delete(&format!("/policies/{declared}")).await, 204);
    app.policy = declared;
    assert_eq!(decide(&app, json!({})).await.0, 404);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_state_that_leaves_its_range_is_the_fault_of_its_question_alone() {
    let mut app = App::start().await;
    let mut request = stock(2);
    // Whoever has more than 20 in stock and meets no demand goes beyond 60.
    request["problem"]["next"]["stock"] = json!("if(stock > 20, 2, 1)*max(stock + order - demand, 0)");
    request["problem"]["actions"]["order"]["high"] = json!("20 - min(stock, 20)");
    request["problem"]["states"]["stock"]["high"] = json!(60);
    let (status, accepted) = app.post("/train", &request).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    let ended = app.until(accepted["job"].as_str().unwrap(), |job| job["finished_ms"].is_number()).await;
    app.policy = ended["policy"].as_str().unwrap_or_else(|| panic!("{ended}")).to_owned();
    let (status, problem) = decide(&app, json!({ "state": { "stock": 55 } })).await;
    assert_eq!((status, &problem["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("state")), "{problem}");
    assert!(problem["rule"].as_str().unwrap().contains("stock = 55"), "{problem}");
    assert_eq!(decide(&app, json!({})).await.0, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_document_is_refused_by_its_field() {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    let (_, document) = app.get(&format!("/policies/{}/export", app.policy)).await;
    for (pointer, value, field) in [
        ("/format", json!("ballast-policy-1"), "baselines"),
        ("/specification/problem/horizon", json!(5), "steps"),
        ("/specification/problem/reward", json!("stok"), "problem.reward"),
        ("/specification/design/count", json!(null), "specification"),
        ("/steps/0/step", json!(2), "steps[0].step"),
        ("/unit", json!(2.0), "unit"),
        ("/baselines/1/constant", json!(0.0), "baselines"),
        ("/steps/1/solution/inputs/0/0", json!(1e40), "steps[1].solution"),
        ("/steps/1/solution/policy/weights", json!([]), "steps[1].solution.policy.weights"),
        ("/steps/0/solution/value/weights/0", json!([1.0]), "steps[0].solution.weights"),
        ("/steps/0/solution/scaling/active", json!([0, 99]), "steps[0].solution.scaling.active"),
    ] {
        let mut changed = document.clone();
        *changed.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
        let (status, problem) = app.post("/policies/import", &changed).await;
        assert_eq!(
            (status, &problem["field"]),
            (StatusCode::UNPROCESSABLE_ENTITY, &json!(field)),
            "{pointer}: {problem}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn policies_and_rules_are_compared_by_a_job() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    let investor = app.policy.clone();
    app.train(&stock(2)).await;
    let robust = app.policy.clone();
    let mut other = stock(2);
    other["problem"]["parameters"]["price"] = json!(8);
    app.train(&other).await;
    let request = |change: Value| {
        let mut request = json!({ "policies": { "robust": robust }, "paths": 300,
            "rules": { "base": { "order": "max(25 - stock, 0)" } } });
        request.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        request
    };
    for (change, field) in [
        (json!({ "policies": { "robust": robust, "unlike": app.policy } }), "policies.unlike"),
        (json!({ "policies": { "robust": investor } }), "policies.robust"),
        (json!({ "policies": { "robust": "0".repeat(64) } }), "policies.robust"),
        (json!({ "policies": {} }), "policies"),
        (json!({ "rules": { "base": { "order": "max(25 - stok, 0)" } } }), "rules.base.order"),
        (json!({ "rules": { "base": {} } }), "rules.base.order"),
        (json!({ "rules": { "robust": { "order": "1" } } }), "rules.robust"),
        (json!({ "paths": 99 }), "paths"),
        (json!({ "level": 0.2 }), "level"),
        (json!({ "frameworks": ["static"] }), "frameworks"),
    ] {
        let (status, problem) = app.post("/evaluate", &request(change.clone())).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{change}: {problem}");
    }
    let (status, accepted) = app.post("/evaluate", &request(json!({}))).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    let job = accepted["job"].as_str().unwrap();
    let ended = app.until(job, |job| job["finished_ms"].is_number()).await;
    let (status, report) = app.get(ended["report"].as_str().unwrap_or_else(|| panic!("{ended}"))).await;
    assert_eq!((status.as_u16(), &report["format"]), (200, &json!("ballast-comparison-1")));
    let names: Vec<&str> =
        report["strategies"].as_array().unwrap().iter().map(|own| own["strategy"].as_str().unwrap()).collect();
    assert_eq!(names, ["robust", "base"]);
    // Every path starts with what is decided first.
    app.policy.clone_from(&robust);
    let (_, first) = decide(&app, json!({})).await;
    let [mean, order] = [&report["strategies"][0]["periods"][0], &first]
        .map(|found| found["actions"]["order"].as_f64().unwrap_or_else(|| panic!("{found}")));
    assert!((mean - order).abs() < 1e-9 * order, "a mean of equal numbers: {mean} and {order}");
    assert_eq!(report["strategies"][0]["robust_value"], first["value"]);
    // A policy that is trained inside the comparison is the same.
    let declared = stock(2);
    let inside = json!({ "problem": declared["problem"], "design": declared["design"],
        "frameworks": ["adaptive", "static"], "policies": { "robust": robust }, "paths": 300 });
    let (status, accepted) = app.post("/evaluate", &inside).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    let ended = app.until(accepted["job"].as_str().unwrap(), |job| job["finished_ms"].is_number()).await;
    assert_eq!(ended["progress"]["steps_done"], 3, "{ended}");
    let (_, inside) = app.get(ended["report"].as_str().unwrap_or_else(|| panic!("{ended}"))).await;
    let [before, adaptive, fixed] = [0, 1, 2].map(|place| inside["strategies"][place].clone());
    assert_eq!([&before["strategy"], &adaptive["strategy"], &fixed["strategy"]], ["robust", "adaptive", "static"]);
    assert_eq!([&before["value"], &before["periods"]], [&adaptive["value"], &adaptive["periods"]]);
}
