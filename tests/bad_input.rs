//! Everything a client can get wrong is a problem document that names field, value and rule.

mod support;

use std::collections::BTreeSet;

use serde_json::{Value, json};
use support::{App, specification};

/// Changes to the request, and the field each must be answered with.
fn faults() -> Vec<(&'static str, Value, &'static str)> {
    let mixture = |weight: f64, mean: f64, variance: f64| json!({"kind": "gaussian_mixture", "components": [{"weight": weight, "mean": mean, "variance": variance}]});
    let student = |location: f64, scale: f64, degrees: f64| json!({"kind": "student_t", "location": location, "scale": scale, "degrees_of_freedom": degrees});
    vec![
        ("/problem/framework", json!("bold"), "problem.framework"),
        ("/problem/horizon", json!(0), "problem.horizon"),
        ("/problem/horizon", json!(10_000), "problem.horizon"),
        ("/problem/rate_per_step", json!(2.0), "problem.rate_per_step"),
        ("/problem/initial_wealth", json!(-1.0), "problem.initial_wealth"),
        ("/problem/action_interval", json!([0.1, 1.0]), "problem.action_interval[0]"),
        ("/problem/action_interval", json!([0.0, 1.5]), "problem.action_interval[1]"),
        ("/problem/utility", json!({"kind": "exponential", "risk_aversion": 0.0}), "problem.utility.risk_aversion"),
        ("/problem/utility", json!({"kind": "power", "risk_aversion": 1.0}), "problem.utility.risk_aversion"),
        ("/problem/radius", json!({"rule": "bridge", "alpha": 0.0}), "problem.radius.alpha"),
        ("/problem/radius", json!({"rule": "bridge", "paths": 1}), "problem.radius.paths"),
        ("/problem/radius", json!({"rule": "bridge", "scale": -1.0}), "problem.radius.scale"),
        ("/problem/radius", json!({"rule": "concentration", "C": 0.0, "c": 1.0}), "problem.radius.C"),
        ("/problem/radius", json!({"rule": "concentration", "C": 2.0, "c": 0.0}), "problem.radius.c"),
        ("/problem/radius", json!({"rule": "root_n", "kappa": -1.0}), "problem.radius.kappa"),
        ("/problem/radius", json!({"rule": "fixed", "radius": -1.0}), "problem.radius.radius"),
        ("/problem/support", json!({"min": -30.0, "max": 1.0}), "problem.support.min"),
        ("/problem/support", json!({"min": 1.0, "max": 0.0}), "problem.support.max"),
        ("/problem/law", mixture(1.0, 0.0, 0.01), "problem.law"),
        ("/problem/history", json!([0.1]), "problem.history"),
        ("/problem/history", json!([0.1, 0.1, 0.1]), "problem.history"),
        ("/problem/history", json!([0.1, 1e308]), "problem.history[1]"),
        ("/design/count", json!(0), "design.count"),
        ("/design/count", json!(10_000_000), "design.count"),
        ("/design/initial_laws", json!("any"), "design.initial_laws"),
        ("/design/sampling_law", mixture(0.0, 0.0, 0.01), "design.sampling_law.components[0].weight"),
        ("/design/sampling_law", mixture(1.0, 9.0, 0.01), "design.sampling_law.components[0].mean"),
        ("/design/sampling_law", mixture(1.0, 0.0, 0.0), "design.sampling_law.components[0].variance"),
        ("/design/sampling_law", student(9.0, 0.1, 5.0), "design.sampling_law.location"),
        ("/design/sampling_law", student(0.0, 0.0, 5.0), "design.sampling_law.scale"),
        ("/design/sampling_law", student(0.0, 0.1, 1.0), "design.sampling_law.degrees_of_freedom"),
        ("/design/wealth", json!({"min": -1.0, "max": 1.0}), "design.wealth.min"),
        ("/design/wealth", json!({"min": 2.0, "max": 1.0}), "design.wealth.max"),
        ("/surrogate", json!({"target": "price"}), "surrogate.target"),
        ("/surrogate", json!({"features": "all"}), "surrogate.features"),
        ("/surrogate", json!({"moment_count": 0}), "surrogate.moment_count"),
        ("/surrogate", json!({"bounds": {"lengthscale": [0.0, 1.0]}}), "surrogate.bounds.lengthscale[0]"),
        ("/surrogate", json!({"bounds": {"signal_variance": [2.0, 1.0]}}), "surrogate.bounds.signal_variance[1]"),
        ("/surrogate", json!({"bounds": {"noise_variance": [0.0, 1.0]}}), "surrogate.bounds.noise_variance[0]"),
        ("/seed", json!(-1), "seed"),
        ("/colour", json!(1), "colour"),
        ("/problem/colour", json!(1), "problem.colour"),
    ]
}

/// `specification(2)` with the value at a pointer replaced or added.
fn with(pointer: &str, value: Value) -> Value {
    let mut request = specification(2);
    let (parent, name) = pointer.rsplit_once('/').unwrap();
    request.pointer_mut(parent).unwrap()[name] = value;
    request
}

/// Names of the properties of the request, from the description of the interface.
fn described_fields() -> BTreeSet<String> {
    let description: Value = serde_json::from_str(include_str!("../api/openapi.json")).unwrap();
    let schemas = &description["components"]["schemas"];
    let mut fields = BTreeSet::new();
    let mut open = vec![schemas["Specification"].clone()];
    let mut seen = BTreeSet::new();
    while let Some(schema) = open.pop() {
        match schema {
            Value::Object(members) => {
                if let Some(Value::Object(properties)) = members.get("properties") {
                    fields.extend(properties.keys().cloned());
                }
                if let Some(name) = members.get("$ref").and_then(|name| name.as_str()?.rsplit('/').next())
                    && seen.insert(name.to_owned())
                {
                    open.push(schemas[name].clone());
                }
                open.extend(members.into_iter().map(|(_, member)| member));
            }
            Value::Array(items) => open.extend(items),
            _ => {}
        }
    }
    fields
}

#[test]
fn the_list_covers_every_field() {
    let walked: BTreeSet<String> = faults()
        .iter()
        .flat_map(|(_, _, field)| field.split('.'))
        .map(|part| part.split('[').next().unwrap().to_owned())
        .collect();
    // The discriminators are walked by `a_wrong_kind_is_refused`.
    let missing: Vec<_> = described_fields()
        .into_iter()
        .filter(|field| !walked.contains(field) && field != "kind" && field != "rule")
        .collect();
    assert!(missing.is_empty(), "no fault for {missing:?}");
}

fn assert_named(problem: &Value, field: &str) {
    assert_eq!(problem["field"], field, "{problem}");
    assert!(problem.get("value").is_some() && problem["rule"].is_string(), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_out_of_range_is_named() {
    let app = App::start().await;
    for (pointer, value, field) in faults() {
        let (status, problem) = app.post("/train", &with(pointer, value)).await;
        assert_eq!(status, 422, "{pointer} {problem}");
        assert_named(&problem, field);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_kind_is_refused() {
    let app = App::start().await;
    for (pointer, value) in [
        ("/problem/utility", json!({"kind": "linear"})),
        ("/problem/radius", json!({"rule": "none"})),
        ("/design/sampling_law", json!({"kind": "cauchy"})),
    ] {
        let (status, problem) = app.post("/train", &with(pointer, value)).await;
        assert!(
            status == 422 && problem["field"].as_str().unwrap().starts_with(&pointer[1..].replace('/', ".")),
            "{problem}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_that_are_not_json_are_refused() {
    let app = App::start().await;
    let send = |body: String, media: &'static str| {
        let request = app.client.post(format!("{}/train", app.url)).header("content-type", media).body(body);
        async move { support::read(request.send().await.unwrap()).await }
    };
    let (status, problem) = send(r#"{"problem": {"history": [0.1, NaN]}}"#.into(), "application/json").await;
    assert_eq!((status.as_u16(), &problem["value"]), (400, &json!("NaN")));
    assert_named(&problem, "problem.history[1]");
    for bomb in ["[".repeat(10_000), format!("{{\"seed\": {}", "[".repeat(10_000))] {
        assert!(send(bomb, "application/json").await.0.is_client_error());
    }
    assert_eq!(send(specification(2).to_string(), "text/plain").await.0, 415);
    assert_eq!(send(" ".repeat(2 << 20), "application/json").await.0, 413);
}

#[tokio::test(flavor = "multi_thread")]
async fn unknown_things_are_refused() {
    let app = App::start().await;
    for path in ["/jobs/x", "/jobs/x/events", "/policies/x", "/policies/x/export", "/sessions/x", "/sessions/x/history"]
    {
        assert_eq!(app.get(path).await.0, 404, "{path}");
    }
    assert_eq!(app.get("/nowhere").await.1["type"], "/problems/unknown-route");
    assert_eq!(app.delete("/train").await, 405);
    assert_eq!(app.get("/action?session=x").await.0, 404);
    assert_eq!(app.post("/sessions", &json!({"policy": "x"})).await.0, 404);
    assert_named(&app.get("/action").await.1, "session");
    assert_named(&app.get("/action?session=x&mode=guess").await.1, "mode");
    assert_named(&app.get("/jobs?limit=0").await.1, "limit");
    let (status, problem) = app.post("/observe", &json!({"session": "x", "period": 1, "log_return": 0.1})).await;
    assert_eq!(status, 404, "{problem}");
    let (status, problem) = app.post("/policies/import", &json!({"format": "ballast-policy-1"})).await;
    assert_eq!(status, 422, "{problem}");
}
