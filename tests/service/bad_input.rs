//! Everything a client can get wrong is a problem document that names field, value and rule.

use std::collections::BTreeSet;

use crate::support::values::replaced;
use crate::support::{App, specification};
use reqwest::Method;
use serde_json::{Value, json};

/// Changes to the request, and the field each must be answered with.
fn faults() -> Vec<(&'static str, Value, &'static str)> {
    let alike = |count: usize| {
        json!({ "kind": "gaussian_mixture",
        "components": vec![json!({ "weight": 1.0 / count as f64, "mean": 0.0, "variance": 0.01 }); count] })
    };
    let mixture = |weight: f64, mean: f64, variance: f64| json!({"kind": "gaussian_mixture", "components": [{"weight": weight, "mean": mean, "variance": variance}]});
    let student = |location: f64, scale: f64, degrees: f64| json!({"kind": "student_t", "location": location, "scale": scale, "degrees_of_freedom": degrees});
    vec![
        ("/problem/framework", json!("bold"), "problem.framework"),
        ("/problem/horizon", json!(0), "problem.horizon"),
        ("/problem/horizon", json!(10_000), "problem.horizon"),
        ("/problem/rate_per_step", json!(2.0), "problem.rate_per_step"),
        ("/problem/rate_per_step", json!(null), "problem.rate_per_step"),
        ("/problem/periods_per_year", json!(0.5), "problem.periods_per_year"),
        ("/problem/periods_per_year", json!(8760), "problem.periods_per_year"),
        ("/problem/initial_wealth", json!(-1.0), "problem.initial_wealth"),
        ("/problem/action_interval", json!([0.1, 1.0]), "problem.action_interval[0]"),
        ("/problem/action_interval", json!([0.0, 1.5]), "problem.action_interval[1]"),
        ("/problem/action_interval", json!([0.0, 5e-324]), "problem.action_interval[1]"),
        ("/problem/radius", json!({ "rule": "calibrated", "alpha": 0.005 }), "problem.radius.alpha"),
        ("/problem/trading_cost", json!(-0.001), "problem.trading_cost"),
        ("/problem/contributions", json!([1.0]), "problem.contributions"),
        ("/problem/contributions", json!(1e16), "problem.contributions"),
        ("/problem/contributions", json!(-60.0), "problem.initial_wealth"),
        ("/problem/contributions", json!("monthly"), "problem.contributions"),
        ("/problem/spending", json!({ "lowest": -0.1 }), "problem.spending.lowest"),
        ("/problem/spending", json!({ "highest": 0.0 }), "problem.spending.highest"),
        ("/problem/spending", json!({ "lowest": 0.2, "highest": 0.1 }), "problem.spending.highest"),
        ("/problem/spending", json!({ "discount": 2.0 }), "problem.spending.discount"),
        ("/problem/spending", json!({ "inflation": 0.5 }), "problem.spending.inflation"),
        ("/problem/spending", json!({ "survival": [1.0] }), "problem.spending.survival"),
        ("/problem/spending", json!({ "survival": [1.0, 0.0] }), "problem.spending.survival[1]"),
        ("/problem/spending", json!({ "bequest": 0.0 }), "problem.spending.bequest"),
        ("/problem/spending", json!({ "secured": -1.0 }), "problem.spending.secured"),
        ("/problem/spending", json!({ "secured_left": 1e9 }), "problem.spending.secured_left"),
        ("/problem/trading_cost", json!(0.5), "problem.trading_cost"),
        ("/problem/trading_cost", json!(1e-17), "problem.trading_cost"),
        ("/problem/utility", json!({"kind": "exponential", "risk_aversion": 0.0}), "problem.utility.risk_aversion"),
        ("/problem/utility", json!({"kind": "exponential"}), "problem.utility.risk_aversion"),
        (
            "/problem/utility",
            json!({"kind": "exponential", "risk_aversion_relative": 0.0}),
            "problem.utility.risk_aversion_relative",
        ),
        (
            "/problem/utility",
            json!({"kind": "exponential", "risk_aversion_relative": 101}),
            "problem.utility.risk_aversion_relative",
        ),
        (
            "/problem/utility",
            json!({"kind": "exponential", "risk_aversion": 0.03, "risk_aversion_relative": 3.0}),
            "problem.utility.risk_aversion_relative",
        ),
        ("/problem/utility", json!({"kind": "power", "risk_aversion": 1.0}), "problem.utility.risk_aversion"),
        ("/problem/risk_aversion", json!(4.0), "problem.risk_aversion"),
        ("/problem/learning", json!({"kind": "decay", "half_life": 0.5}), "problem.learning.half_life"),
        ("/problem/learning", json!({"kind": "decay", "half_life": -12.0}), "problem.learning.half_life"),
        ("/problem/centre", json!({"kind": "median"}), "problem.centre.kind"),
        ("/problem/centre", json!({"kind": "smoothed"}), "problem.centre.bandwidth"),
        ("/problem/centre", json!({"kind": "smoothed", "bandwidth": -0.01}), "problem.centre.bandwidth"),
        ("/problem/centre", json!({"kind": "smoothed", "bandwidth": 1.5}), "problem.centre.bandwidth"),
        ("/problem/centre", json!({"kind": "mixed", "law": student(0.0, 0.1, 5.0)}), "problem.centre.weight"),
        (
            "/problem/centre",
            json!({"kind": "mixed", "law": student(0.0, 0.1, 5.0), "weight": -1.0}),
            "problem.centre.weight",
        ),
        (
            "/problem/centre",
            json!({"kind": "mixed", "law": student(0.0, 0.1, 1.0), "weight": 9.0}),
            "problem.centre.law.degrees_of_freedom",
        ),
        ("/problem/centre", json!({"kind": "mixed", "law": alike(0), "weight": 9.0}), "problem.centre.law.components"),
        (
            "/problem/centre",
            json!({"kind": "mixed", "law": {"kind": "bootstrap"}, "weight": 9.0}),
            "problem.centre.law.kind",
        ),
        ("/problem/centre", json!({"kind": "mixed", "weight": 9.0}), "problem.centre.law"),
        ("/problem/centre", json!({"kind": "volatility_scaled", "half_life": 12.0}), "problem.centre.kind"),
        (
            "/problem/centre",
            json!({"kind": "conditional", "on": {"kind": "trend", "half_life": 12.0}, "bandwidth": 1.0}),
            "problem.centre.kind",
        ),
        ("/problem/centre", json!({"kind": "volatility_scaled"}), "problem.centre.half_life"),
        (
            "/problem/centre",
            json!({"kind": "mixed", "law": student(0.0, 0.1, 5.0), "history": [0.1, 0.2], "weight": 9.0}),
            "problem.centre.law",
        ),
        ("/problem/centre", json!({"kind": "mixed", "history": [0.1], "weight": 9.0}), "problem.centre.history"),
        (
            "/problem/centre",
            json!({"kind": "mixed", "history": [0.1, 9.0], "weight": 9.0}),
            "problem.centre.history[1]",
        ),
        ("/problem/radius", json!({"rule": "bridge", "alpha": 0.0}), "problem.radius.alpha"),
        ("/problem/radius", json!({"rule": "bridge", "paths": 1}), "problem.radius.paths"),
        ("/problem/radius", json!({"rule": "bridge", "scale": -1.0}), "problem.radius.scale"),
        ("/problem/radius", json!({"rule": "bridge", "correction": 3.0}), "problem.radius.correction"),
        ("/problem/radius", json!({"rule": "joint", "alpha": 1.0}), "problem.radius.alpha"),
        ("/problem/radius", json!({"rule": "joint", "paths": 1}), "problem.radius.paths"),
        ("/problem/radius", json!({"rule": "concentration"}), "problem.support"),
        ("/problem/radius", json!({"rule": "root_n", "kappa": -1.0}), "problem.radius.kappa"),
        ("/problem/radius", json!({"rule": "fixed", "radius": -1.0}), "problem.radius.radius"),
        ("/problem/support", json!({"rule": "worst_seen", "factor": 0.5}), "problem.support.factor"),
        ("/problem/caution", json!({"scale": -0.1}), "problem.caution.scale"),
        ("/problem/levels", found_levels(1.5), "problem.levels"),
        ("/problem/support", json!({"rule": "between", "min": -30.0, "max": 1.0}), "problem.support.min"),
        ("/problem/support", json!({"rule": "between", "min": 1.0, "max": 0.0}), "problem.support.max"),
        ("/problem/support", json!({"rule": "between", "min": 1.0, "max": 1.0}), "problem.support.max"),
        ("/problem/law", mixture(1.0, 0.0, 0.01), "problem.law"),
        ("/problem/history", json!([0.1]), "problem.history"),
        ("/problem/history", json!([0.1, 0.1, 0.1]), "problem.history"),
        ("/problem/history", json!([0.1, 1e308]), "problem.history[1]"),
        ("/design/accuracy", json!(0.0), "design.accuracy"),
        ("/design/count", json!(0), "design.count"),
        ("/design/count", json!(10_000_000), "design.count"),
        ("/design/initial_laws", json!("any"), "design.initial_laws"),
        ("/design/sampling_law", mixture(0.0, 0.0, 0.01), "design.sampling_law.components[0].weight"),
        ("/design/sampling_law", mixture(1.0, 9.0, 0.01), "design.sampling_law.components[0].mean"),
        ("/design/sampling_law", mixture(1.0, 0.0, 0.0), "design.sampling_law.components[0].variance"),
        ("/design/sampling_law", alike(0), "design.sampling_law.components"),
        ("/design/sampling_law", alike(33), "design.sampling_law.components"),
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
    replaced(specification(2), pointer, value)
}

/// Names of the properties of the request, from the description of the interface.
fn described_fields() -> BTreeSet<String> {
    let description: Value = serde_json::from_str(include_str!("../../api/openapi.json")).unwrap();
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

/// The levels of a policy, with this share of the radius.
fn found_levels(scale: f64) -> Value {
    let level = json!({ "scale": scale, "standard_error": 0.0, "regrets": [0.0, 0.0, 0.0], "spared": 0.0 });
    json!({ "premiums": [0.0, 0.001, 0.002], "premium_seen": 0.001, "standard_error": 0.001,
        "bold": level, "balanced": level, "cautious": level, "paper": level })
}

#[test]
fn the_list_covers_every_field() {
    let walked: BTreeSet<String> = faults()
        .iter()
        .flat_map(|(_, _, field)| field.split('.'))
        .map(|part| part.split('[').next().unwrap().to_owned())
        .collect();
    // The discriminators are walked by `a_wrong_kind_is_refused`, and what is said of several assets by
    // `tests/service/funds.rs::what_is_wrong_of_several_assets_is_named`.
    // What was found of levels is checked as a whole.
    let found =
        ["balanced", "bold", "cautious", "paper", "premium_seen", "premiums", "regrets", "spared", "standard_error"];
    let elsewhere = [
        "kind",
        "rule",
        "assets",
        "composition",
        "fund",
        "given",
        "ground_norm",
        "radius_factor",
        "means",
        "intensity",
        "on",
        "values",
        "limits",
        "each",
        "groups",
        "name",
        "max_turnover",
    ];
    let missing: Vec<_> = described_fields()
        .into_iter()
        .filter(|field| !walked.contains(field) && ![&elsewhere[..], &found].concat().contains(&field.as_str()))
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

/// The description refuses what the rules of single fields refuse. It leaves out rules of two fields, of an end of a range, and of
/// what takes such a range.
#[test]
fn the_description_is_as_strict_as_the_rules_of_single_fields() {
    let description: Value = serde_json::from_str(include_str!("../../api/openapi.json")).unwrap();
    let schemas = &description["components"]["schemas"];
    let fits = |request: &Value| fits(request, &schemas["TrainQuestion"], schemas);
    assert!(fits(&specification(2)));
    let loose = faults().into_iter().filter(|(pointer, value, _)| fits(&with(pointer, value.clone())));
    let loose: Vec<&str> = loose.map(|(.., field)| field).collect();
    assert_eq!(loose, DECIDED_TOGETHER);
}

const DECIDED_TOGETHER: [&str; 26] = [
    "problem.action_interval[0]",
    "problem.action_interval[1]",
    "problem.contributions",
    "problem.contributions",
    "problem.initial_wealth",
    "problem.spending.highest",
    "problem.spending.survival",
    "problem.spending.secured_left",
    "problem.trading_cost",
    "problem.utility.risk_aversion",
    "problem.utility.risk_aversion_relative",
    "problem.risk_aversion",
    "problem.centre.law.kind",
    "problem.centre.law",
    "problem.centre.kind",
    "problem.centre.kind",
    "problem.centre.law",
    "problem.support",
    "problem.levels",
    "problem.support.max",
    "problem.support.max",
    "problem.law",
    "problem.history",
    "design.wealth.min",
    "design.wealth.max",
    "surrogate.bounds.signal_variance[1]",
];

/// Returns true if a value fits a schema, by the keywords that the description has.
fn fits(value: &Value, schema: &Value, schemas: &Value) -> bool {
    let fits = |value: &Value, schema: &Value| fits(value, schema, schemas);
    let is = |kind: &str| match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
        kind => panic!("the type {kind}"),
    };
    let members = value.as_object();
    let number = |holds: &dyn Fn(f64) -> bool| value.as_f64().is_none_or(holds);
    let length = |holds: &dyn Fn(f64) -> bool| {
        let length = value.as_array().map(Vec::len).or(value.as_str().map(|text| text.chars().count()));
        length.is_none_or(|length| holds(length as f64))
    };
    let bound = |rule: &Value| rule.as_f64().unwrap();
    let listed = |list: &Value| list.as_array().unwrap().clone();
    schema.as_object().unwrap().iter().all(|(keyword, rule)| match keyword.as_str() {
        "type" => rule.as_str().map_or_else(|| listed(rule).iter().any(|kind| is(kind.as_str().unwrap())), is),
        "enum" => listed(rule).contains(value),
        "$ref" => fits(value, &schemas[rule.as_str().unwrap().rsplit('/').next().unwrap()]),
        "oneOf" => listed(rule).iter().filter(|schema| fits(value, schema)).count() == 1,
        "minimum" => number(&|number| number >= bound(rule)),
        "maximum" => number(&|number| number <= bound(rule)),
        "exclusiveMinimum" => number(&|number| number > bound(rule)),
        "minItems" | "minLength" => length(&|length| length >= bound(rule)),
        "maxItems" | "maxLength" => length(&|length| length <= bound(rule)),
        "uniqueItems" => {
            value.as_array().is_none_or(|items| (1..items.len()).all(|end| !items[..end].contains(&items[end])))
        }
        "items" => value.as_array().is_none_or(|items| items.iter().all(|item| fits(item, rule))),
        "required" => {
            members.is_none_or(|members| listed(rule).iter().all(|name| members.contains_key(name.as_str().unwrap())))
        }
        "properties" => members.is_none_or(|members| {
            members.iter().all(|(name, member)| rule.get(name).is_none_or(|schema| fits(member, schema)))
        }),
        "additionalProperties" => {
            assert_eq!(rule, false);
            let known = schema["properties"].as_object();
            members.is_none_or(|members| members.keys().all(|name| known.is_some_and(|known| known.contains_key(name))))
        }
        "description" | "default" | "example" | "format" => true,
        keyword => panic!("the keyword {keyword}"),
    })
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

/// The last value of a name that stands twice would be taken in silence.
#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_stands_twice_is_refused_in_every_object_of_names() {
    let app = App::start().await;
    for (path, rest, fields) in [
        (
            "/observe",
            r#""session":"s","period":1,"#,
            &[
                "log_returns",
                "simple_returns",
                "prices",
                "previous_prices",
                "executed_allocations",
                "executed",
                "state",
            ][..],
        ),
        ("/what-if", r#""session":"s","#, &["holdings", "log_returns", "simple_returns", "prices", "previous_prices"]),
        ("/orders", r#""session":"s","cash":1,"#, &["prices", "units"]),
        ("/orders", r#""session":"s","cash":1,"prices":{"a":1},"units":{"a":1},"#, &["lots"]),
        ("/sessions", r#""policy":"p","#, &["holdings", "state"]),
        ("/decide", r#""policy":"p","#, &["state"]),
    ] {
        for field in fields {
            let body = format!(r#"{{{rest}"{field}":{{"bonds":0.1,"stocks":0.2,"bonds":0.3}}}}"#);
            let request = app.client.post(format!("{}{path}", app.url)).header("content-type", "application/json");
            let (status, problem) = crate::support::read(request.body(body).send().await.unwrap()).await;
            assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{path}: {problem}");
            assert!(problem["rule"].as_str().unwrap().contains("`bonds` stands twice"), "{path}: {problem}");
        }
    }
    let renewal = r#"{"renewal":1,"policy":"p","records":{"a":[0.1,0.2],"a":[0.1,0.3]}}"#;
    let request =
        app.client.post(format!("{}/sessions/s/renewals", app.url)).header("content-type", "application/json");
    let (status, problem) = crate::support::read(request.body(renewal).send().await.unwrap()).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("records")), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_that_are_not_json_are_refused() {
    let app = App::start().await;
    let send = |body: String, media: &'static str| {
        let request = app.client.post(format!("{}/train", app.url)).header("content-type", media).body(body);
        async move { crate::support::read(request.send().await.unwrap()).await }
    };
    let (status, problem) = send(r#"{"problem": {"history": [0.1, NaN]}}"#.into(), "application/json").await;
    assert_eq!((status.as_u16(), &problem["value"]), (400, &json!("NaN")));
    assert_named(&problem, "problem.history[1]");
    for bomb in ["[".repeat(10_000), format!("{{\"seed\": {}", "[".repeat(10_000))] {
        assert!(send(bomb, "application/json").await.0.is_client_error());
    }
    assert_refused(&send(specification(2).to_string(), "text/plain").await, 415, "content-type", "text/plain");
    let large = send(" ".repeat(2 << 20), "application/json").await;
    assert_refused(&large, 413, "body", "2097152 bytes");
    assert_eq!(large.1["rule"], "must hold at most 1048576 bytes");
}

/// The faults of an observation: the body without session and period, the status and the field.
fn faulty_reports() -> Vec<(&'static str, u16, &'static str)> {
    vec![
        (r#""period": 1, "log_return": NaN"#, 400, "log_return"),
        (r#""period": 1, "log_return": 1e999"#, 400, "log_return"),
        (r#""period": 1, "log_return": "0.1""#, 422, "log_return"),
        (r#""period": 1, "log_return": 5.1"#, 422, "log_return"),
        (r#""period": 1"#, 422, "log_return"),
        (r#""period": 1, "log_return": 0.05, "simple_return": 0.05"#, 422, "log_return"),
        (r#""period": 1, "simple_return": 0.05, "price": 10.0"#, 422, "simple_return"),
        (r#""period": 1, "simple_return": -1.0"#, 409, "simple_return"),
        (r#""period": 1, "simple_return": -2.5"#, 422, "simple_return"),
        (r#""period": 1, "price": 0.0, "previous_price": 1.0"#, 409, "price"),
        (r#""period": 1, "price": 1.0, "previous_price": -1.0"#, 422, "previous_price"),
        (r#""period": 1, "price": 1e9, "previous_price": 1.0"#, 422, "price"),
        (r#""period": 1, "price": 1.0"#, 422, "previous_price"),
        (r#""period": 1, "log_return": 0.05, "previous_price": 1.0"#, 422, "previous_price"),
        (r#""period": 0, "log_return": 0.05"#, 422, "period"),
        (r#""period": -1, "log_return": 0.05"#, 422, "period"),
        (r#""period": 1.5, "log_return": 0.05"#, 422, "period"),
        (r#""log_return": 0.05"#, 422, "period"),
        (r#""period": 2, "log_return": 0.05"#, 409, "period"),
        (r#""period": 1, "log_return": 0.05, "executed_allocation": 1.01"#, 422, "executed_allocation"),
        (r#""period": 1, "log_return": 0.05, "executed_allocation": -0.01"#, 422, "executed_allocation"),
        (r#""period": 1, "log_return": 0.05, "wealth": -1.0"#, 422, "wealth"),
        (r#""period": 1, "log_return": 0.05, "wealth": 0"#, 422, "wealth"),
        (r#""period": 1, "log_return": 0.05, "spent": -1.0"#, 422, "spent"),
        (r#""period": 1, "log_return": 0.05, "spent": 1e9"#, 422, "spent"),
        (r#""period": 1, "log_return": 0.05, "missing": true"#, 422, "missing"),
        (r#""period": 1, "missing": "yes""#, 422, "missing"),
        (r#""period": 1, "missing": false"#, 422, "log_return"),
        (r#""period": 1, "log_return": 0.05, "date": "2008-02-30""#, 422, "date"),
        (r#""period": 1, "log_return": 0.05, "date": 20080131"#, 422, "date"),
        (r#""period": 1, "log_return": 0.05, "rate": 0.51"#, 422, "rate"),
        (r#""period": 1, "log_return": 0.05, "rate": "3 %""#, 422, "rate"),
        (r#""period": 1, "log_return": 0.05, "flow": 2e15"#, 422, "flow"),
        (r#""period": 1, "log_return": 0.05, "flow": -1000"#, 422, "flow"),
        (r#""period": 1, "log_return": 0.05, "confirm": 1"#, 422, "confirm"),
        (r#""period": 1, "log_return": 0.05, "colour": 1"#, 422, "colour"),
    ]
}

/// The faults of an opening, besides its policy.
fn faulty_sessions() -> Vec<(&'static str, &'static str)> {
    vec![
        (r#""wealth": 0"#, "wealth"),
        (r#""wealth": -1.0"#, "wealth"),
        (r#""wealth": 1e16"#, "wealth"),
        (r#""wealth": "much""#, "wealth"),
        (r#""holding": -0.1"#, "holding"),
        (r#""holding": 35"#, "holding"),
        (r#""history": []"#, "history"),
        (r#""history": [0.1]"#, "history"),
        (r#""history": [0.1, 0.1]"#, "history"),
        (r#""history": [0.1, 9.0]"#, "history[1]"),
        (r#""history": [0.1, null]"#, "history[1]"),
        (r#""history": 3"#, "history"),
        (r#""renew": 12"#, "renew"),
        (r#""renew": {"window": 12}"#, "renew.every"),
        (r#""renew": {"every": 0}"#, "renew.every"),
        (r#""renew": {"every": 1.5}"#, "renew.every"),
        (r#""renew": {"every": 1, "window": 1}"#, "renew.window"),
        (r#""renew": {"every": 1, "horizon": 2}"#, "renew.horizon"),
        (r#""rolling": true"#, "rolling"),
        (r#""rolling": "yes""#, "rolling"),
        (r#""name": 7"#, "name"),
        (r#""notes": "a\u0000b""#, "notes"),
        (r#""tags": ["a", "a"]"#, "tags[1]"),
        (r#""colour": 1"#, "colour"),
    ]
}

/// The faults of a hypothesis, and the field that the answer names.
fn faulty_hypotheses() -> Vec<(&'static str, &'static str)> {
    vec![
        (r#""wealth": 0"#, "wealth"),
        (r#""wealth": 1e16"#, "wealth"),
        (r#""holding": 1.5"#, "holding"),
        (r#""radius_scale": -0.1"#, "radius_scale"),
        (r#""radius_scale": 101"#, "radius_scale"),
        (r#""radius": -0.1"#, "radius"),
        (r#""radius": 11"#, "radius"),
        (r#""radius": 0.1, "radius_scale": 1"#, "radius"),
        (r#""log_return": 5.1"#, "log_return"),
        (r#""wealth": 1e15, "log_return": 4.9"#, "log_return"),
        (r#""simple_return": -1"#, "simple_return"),
        (r#""wealth": 1e15, "simple_return": 99"#, "simple_return"),
        (r#""log_return": 0.1, "simple_return": 0.1"#, "simple_return"),
        (r#""explain": "everything""#, "explain"),
        (r#""colour": 1"#, "colour"),
        (r#""sweep": {}"#, "sweep"),
        (r#""sweep": {"colour": 1}"#, "sweep.colour"),
        (
            r#""sweep": {"wealth": {"from": 1, "to": 2, "points": 3}, "radius": {"from": 1, "to": 2, "points": 3}}"#,
            "sweep",
        ),
        (r#""wealth": 1, "sweep": {"wealth": {"from": 1, "to": 2, "points": 3}}"#, "wealth"),
        (r#""radius": 1, "sweep": {"radius_scale": {"from": 1, "to": 2, "points": 3}}"#, "radius"),
        (r#""sweep": {"wealth": {"from": 0, "to": 2, "points": 3}}"#, "sweep.wealth.from"),
        (r#""sweep": {"wealth": {"from": 1e15, "to": 1e308, "points": 3}}"#, "sweep.wealth.to"),
        (r#""sweep": {"radius_scale": {"from": 0, "to": 101, "points": 3}}"#, "sweep.radius_scale.to"),
        (r#""sweep": {"radius_scale": {"from": 0, "to": 2, "points": 1}}"#, "sweep.radius_scale.points"),
        (r#""sweep": {"radius_scale": {"from": 0, "to": 2, "points": 102}}"#, "sweep.radius_scale.points"),
        (r#""sweep": {"radius_scale": {"from": 0, "to": 2, "points": 2, "step": 1}}"#, "sweep.radius_scale.step"),
        (r#""sweep": {"radius": {"from": -1, "to": 2, "points": 3}}"#, "sweep.radius.from"),
        (r#""sweep": {"log_return": {"from": -6, "to": 2, "points": 3}}"#, "sweep.log_return.from"),
        (r#""wealth": 1e15, "sweep": {"log_return": {"from": 0, "to": 4.9, "points": 3}}"#, "sweep.log_return"),
        (r#""sweep": {"simple_return": {"from": -1, "to": 2, "points": 3}}"#, "sweep.simple_return.from"),
        (r#""sweep": {"simple_return": {"from": 0, "points": 3}}"#, "sweep.simple_return.to"),
    ]
}

/// Changes to an evaluation, and the field each must be answered with.
fn faulty_evaluations() -> Vec<(&'static str, Value, &'static str)> {
    vec![
        ("/problem/framework", json!("static"), "problem.framework"),
        ("/problem/horizon", json!(0), "problem.horizon"),
        (
            "/problem/law",
            json!({"kind": "student_t", "location": 9.0, "scale": 0.1, "degrees_of_freedom": 5.0}),
            "problem.law.location",
        ),
        ("/design/count", json!(0), "design.count"),
        ("/surrogate", json!({"moment_count": 0}), "surrogate.moment_count"),
        ("/seed", json!(0.5), "seed"),
        ("/frameworks", json!(["adaptive", "bold"]), "frameworks[1]"),
        ("/frameworks", json!(["adaptive", "static", "adaptive"]), "frameworks[2]"),
        ("/constant_mixes", json!([0.5, 1.01]), "constant_mixes[1]"),
        ("/constant_mixes", json!([0.5, 0.5]), "constant_mixes[1]"),
        ("/constant_mixes", json!(vec![0.5; 102]), "constant_mixes"),
        ("/weights", json!({"Mine": "mean12 +"}), "weights.Mine"),
        ("/weights", json!({"Mine": "mean9999"}), "weights.Mine"),
        ("/weights", json!({"Mine": [0.5]}), "weights.Mine"),
        ("/weights", json!({"60/40": "1"}), "weights"),
        ("/policies", json!({"adaptive": "none"}), "policies.adaptive"),
        ("/paths", json!(99), "paths"),
        ("/paths", json!(1_000_000), "paths"),
        ("/histories", json!({"kind": "drawn", "count": 1}), "histories.count"),
        ("/histories", json!({"kind": "drawn", "count": 1001}), "histories.count"),
        ("/level", json!(0.4), "level"),
        ("/level", json!(1.0), "level"),
        ("/colour", json!(1), "colour"),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_an_evaluation_is_named() {
    let mut app = App::start().await;
    for (pointer, value, field) in faulty_evaluations() {
        let (status, problem) = app.post("/evaluate", &with(pointer, value)).await;
        assert_eq!(status, 422, "{pointer} {problem}");
        assert_named(&problem, field);
    }
    let drawn = |rest: Value| {
        let mut request = with("/histories", json!({"kind": "drawn", "count": 1000}));
        rest.as_object().unwrap().iter().for_each(|(key, value)| request[key] = value.clone());
        request
    };
    let (status, problem) = app.post("/evaluate", &drawn(json!({"paths": 100_000}))).await;
    assert_eq!(status, 422, "{problem}");
    assert_named(&problem, "paths");
    let (status, problem) = app.post("/evaluate", &with("/frameworks", json!([]))).await;
    assert_eq!(status, 202, "constant mixes alone are a comparison: {problem}");
    let mut nothing = with("/frameworks", json!([]));
    nothing["constant_mixes"] = json!([]);
    assert_named(&app.post("/evaluate", &nothing).await.1, "frameworks");

    // A policy for another horizon, one of no framework compared, and one for a framework that has one a history.
    app.train(&specification(3)).await;
    let policy = app.policy.clone();
    let other = app.post("/evaluate", &with("/policies", json!({"adaptive": policy}))).await.1;
    assert_named(&other, "policies.adaptive");
    assert!(other["rule"].as_str().unwrap().contains("problem.horizon"), "{other}");
    let mut absent = with("/policies", json!({"adaptive": policy}));
    absent["frameworks"] = json!(["static"]);
    assert_named(&app.post("/evaluate", &absent).await.1, "policies.adaptive");
    let frozen = drawn(json!({"policies": {"static": policy}}));
    assert_named(&app.post("/evaluate", &frozen).await.1, "policies.static");
}

/// Twelve quarters, of which the last four are lived through.
fn walk_forward() -> Value {
    let simple: Vec<f64> = (0..12).map(|quarter| 0.02 + 0.03 * (1.7 * f64::from(quarter)).sin()).collect();
    json!({ "simple_returns": simple, "rate": 0.002, "periods_per_year": 4, "window": 8, "count": 10, "alpha": [0.5] })
}

/// Changes to a walk-forward, and the field each must be answered with.
fn faulty_walk_forwards() -> Vec<(&'static str, Value, &'static str)> {
    let months =
        |count: usize| -> Vec<String> { (0..count).map(|k| format!("20{:02}-{:02}", k / 12, k % 12 + 1)).collect() };
    let gap: Vec<String> = months(13).into_iter().filter(|month| month != "2000-05").collect();
    vec![
        ("log_returns", json!([0.1, 0.2, 0.3]), "log_returns"),
        ("simple_returns", json!([0.1, 0.2]), "simple_returns"),
        ("simple_returns", json!([0.1, 0.2, -1.0]), "simple_returns[2]"),
        ("simple_returns", json!(vec![0.1; 12]), "simple_returns"),
        ("simple_returns", json!([0.1, 0.2, 0.3, 0.2]), "window"),
        ("simple_returns", Value::Null, "log_returns"),
        ("rate", json!(0.6), "rate"),
        ("rate", json!([0.1, 0.2]), "rate"),
        ("rate", json!([0, 0, 0, 0, 0, 0, 0, -0.6, 0, 0, 0, 0]), "rate[7]"),
        ("rate", json!("much"), "rate"),
        ("dates", json!(["2008"]), "dates"),
        ("dates", json!(vec!["31.1.2008"; 12]), "dates[0]"),
        ("dates", json!(gap), "dates[4]"),
        ("periods_per_year", json!(0), "periods_per_year"),
        ("periods_per_year", json!(367), "periods_per_year"),
        ("periods_per_year", Value::Null, "periods_per_year"),
        ("window", json!(9), "window"),
        ("window", json!(1), "window"),
        ("window", json!(usize::MAX), "window"),
        ("every", json!(0), "every"),
        ("every", json!(usize::MAX), "horizon"),
        ("horizon", json!(521), "horizon"),
        ("horizon", json!(0), "every"),
        ("alpha", json!([]), "alpha"),
        ("alpha", json!([0.1, 0.2, 0.3, 0.4]), "alpha"),
        ("alpha", json!([0.1, 0.1]), "alpha[1]"),
        ("alpha", json!([0.1, 1.0]), "alpha[1]"),
        ("caution", json!({ "scale": -0.5 }), "caution.scale"),
        ("support", json!({ "rule": "worst_seen", "factor": 11.0 }), "support.factor"),
        ("scale", json!(-0.1), "scale"),
        ("centre", json!({ "kind": "smoothed", "bandwidth": 2.0 }), "centre.bandwidth"),
        ("centre", json!({ "kind": "volatility_scaled", "half_life": 12.0 }), "centre.kind"),
        (
            "centre",
            json!({ "kind": "conditional", "on": { "kind": "column", "values": [0.0, 1.0] }, "bandwidth": 1.0 }),
            "centre.on.kind",
        ),
        ("centre", json!({ "kind": "mixed", "weight": 10.0 }), "centre.law"),
        ("centre", json!({ "kind": "wild" }), "centre.kind"),
        ("risk_aversion", json!(0.9), "risk_aversion"),
        ("trading_cost", json!(0.2), "trading_cost"),
        ("trading_cost", json!(1e-12), "trading_cost"),
        ("cost_blind", json!(1), "cost_blind"),
        ("weights", json!({ "Mine": [0.5] }), "weights.Mine"),
        ("weights", json!({ "Mine": 0.5 }), "weights.Mine"),
        ("weights", json!({ "Mine": [0.5, "half"] }), "weights.Mine[1]"),
        ("weights", json!({ "Mine": "wealth" }), "weights.Mine"),
        ("weights", json!({ "Mine": "mean13" }), "weights.Mine"),
        ("weights", json!([0.5]), "weights"),
        ("count", json!(9), "count"),
        ("seed", json!(0.5), "seed"),
        ("colour", json!(1), "colour"),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_walk_forward_is_named() {
    let app = App::start().await;
    for (name, value, field) in faulty_walk_forwards() {
        let mut request = walk_forward();
        request[name] = value;
        let (status, problem) = app.post("/backtest", &request).await;
        assert_eq!(status, 422, "{name} {problem}");
        assert_named(&problem, field);
    }
    // A training every period of a long record, and long horizons of many trainings.
    let long: Vec<f64> = (0..5000).map(|day| 0.01 * (1.7 * f64::from(day)).sin()).collect();
    for (every, horizon, field) in [(1, 1, "every"), (5, 400, "horizon")] {
        let mut request = walk_forward();
        (request["simple_returns"], request["every"], request["horizon"]) = (json!(long), json!(every), json!(horizon));
        let (status, problem) = app.post("/backtest", &request).await;
        assert_eq!(status, 422, "{problem}");
        assert_named(&problem, field);
    }
    let (status, job) = app.post("/backtest", &walk_forward()).await;
    assert_eq!((status, &job["progress"]["steps_total"]), (reqwest::StatusCode::ACCEPTED, &json!(3)), "{job}");
}

/// Three years of two assets by quarters, of which the last four are lived through.
fn walk_of_assets() -> Value {
    let row = |quarter: u32| [0.02, 0.01].map(|mean| mean + 0.03 * (1.7 * f64::from(quarter) * (1.0 + mean)).sin());
    let rows: Vec<[f64; 2]> = (0..12).map(row).collect();
    json!({ "assets": ["stocks", "bonds"], "simple_returns": rows, "rate": 0.002, "dates": quarters(12), "windows": [8] })
}

fn quarters(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("{}-{:02}", 2000 + k / 4, 3 * (k % 4) + 1)).collect()
}

/// Changes to a walk-forward of several assets, and the field each must be answered with.
fn faulty_walks_of_assets() -> Vec<(&'static str, Value, &'static str)> {
    let rows = walk_of_assets()["simple_returns"].clone();
    let changed = |pointer: &str, value: Value| {
        let mut rows = rows.clone();
        *rows.pointer_mut(pointer).unwrap() = value;
        rows
    };
    let gap: Vec<String> = quarters(13).into_iter().filter(|date| date != "2001-04").collect();
    vec![
        ("assets", json!(["stocks"]), "assets"),
        ("means", json!({ "kind": "shrunk", "intensity": -0.1 }), "means.intensity"),
        ("limits", json!({ "each": { "max": 0.4 } }), "limits.assets"),
        ("limits", json!({ "max_turnover": -0.1 }), "limits.max_turnover"),
        ("assets", json!(["stocks", "stocks"]), "assets[1]"),
        ("assets", json!(["stocks", ""]), "assets[1]"),
        ("assets", json!(["stocks", "bonds", "gold"]), "simple_returns[0]"),
        ("log_returns", rows.clone(), "log_returns"),
        ("simple_returns", json!([[0.1, 0.2], [0.2, 0.1]]), "simple_returns"),
        ("simple_returns", changed("/3", json!([0.1])), "simple_returns[3]"),
        ("simple_returns", changed("/3/1", json!(-1.0)), "simple_returns[3][1]"),
        ("simple_returns", changed("/3/1", json!("much")), "simple_returns[3][1]"),
        ("simple_returns", json!(vec![[0.1, 0.2]; 12]), "simple_returns, stocks"),
        ("simple_returns", Value::Null, "log_returns"),
        ("rate", json!(0.6), "rate"),
        ("rate", json!([0.1, 0.2]), "rate"),
        ("dates", json!(["2008"]), "dates"),
        ("dates", json!(vec!["31.1.2008"; 12]), "dates[0]"),
        ("dates", json!(gap), "dates[5]"),
        ("periods_per_year", json!(0), "periods_per_year"),
        ("strategies", json!([]), "strategies"),
        ("strategies", json!(["policy", "policy"]), "strategies"),
        ("count", json!(100), "count"),
        ("windows", json!([]), "windows"),
        ("windows", json!([2, 3, 4, 5, 6, 7]), "windows"),
        ("windows", json!([8, 8]), "windows"),
        ("windows", json!([1]), "windows"),
        ("windows", json!([9]), "windows"),
        ("every", json!(0), "every"),
        ("every", json!(10_001), "every"),
        ("alpha", json!(1.0), "alpha"),
        ("alpha", json!([0.1]), "alpha"),
        ("support", json!({ "rule": "worst_seen", "factor": 0.5 }), "support.factor"),
        ("support", json!({ "rule": "between", "min": 0.0, "max": 0.2 }), "simple_returns[3][0]"),
        ("risk_aversion", json!(0.9), "risk_aversion"),
        ("weights", json!({ "Mine": [[0.5, 0.5]] }), "weights.Mine"),
        ("weights", json!({ "Mine": "1/0" }), "weights.Mine"),
        ("trading_cost", json!(0.2), "trading_cost"),
        ("seed", json!(0.5), "seed"),
        ("horizon", json!(4), "horizon"),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_walk_forward_of_several_assets_is_named() {
    let app = App::start().await;
    for (name, value, field) in faulty_walks_of_assets() {
        let mut request = walk_of_assets();
        request[name] = value;
        let (status, problem) = app.post("/backtest", &request).await;
        assert_eq!(status, 422, "{name} {problem}");
        assert_named(&problem, field);
    }
    // More than a report holds, and more than is solved in some hours.
    let long = |assets: usize, days: usize, windows: [usize; 5]| {
        let back = |day: usize, asset: usize| (30.0 * ((day * (7 + asset)) as f64).sin()).round() / 1000.0;
        let row = |day: usize| -> Vec<f64> { (0..assets).map(|asset| back(day, asset)).collect() };
        let rows: Vec<Vec<f64>> = (0..days).map(row).collect();
        let names: Vec<String> = (0..assets).map(|asset| format!("asset {asset}")).collect();
        let first = "1950-01-01".parse::<jiff::civil::Date>().unwrap();
        let date = |day: usize| first.checked_add(jiff::Span::new().days(day as i64)).unwrap().to_string();
        let dates: Vec<String> = (0..days).map(date).collect();
        json!({ "assets": names, "log_returns": rows, "rate": 0.0001, "dates": dates, "windows": windows })
    };
    let windows = [2000, 1999, 1998, 1997, 1996];
    for (request, field) in
        [(long(30, 2200, [20, 30, 40, 50, 60]), "log_returns"), (long(12, 4000, windows), "windows")]
    {
        let (status, problem) = app.post("/backtest", &request).await;
        assert_eq!(status, 422, "{problem}");
        assert_named(&problem, field);
    }
    let (status, job) = app.post("/backtest", &walk_of_assets()).await;
    assert_eq!((status, &job["progress"]["steps_total"]), (reqwest::StatusCode::ACCEPTED, &json!(12)), "{job}");
}

/// Names of the properties of a schema of the description.
fn properties(schema: &str) -> BTreeSet<String> {
    let description: Value = serde_json::from_str(include_str!("../../api/openapi.json")).unwrap();
    description["components"]["schemas"][schema]["properties"].as_object().unwrap().keys().cloned().collect()
}

#[test]
fn the_walks_cover_every_field() {
    let mut walked: BTreeSet<String> = faulty_reports().iter().map(|(_, _, field)| (*field).to_owned()).collect();
    // A session that is missing or unknown is walked beside the list.
    walked.insert("session".into());
    // So are those of several assets.
    let of_several = ["log_returns", "simple_returns", "prices", "previous_prices", "executed_allocations"];
    walked.extend(of_several.map(str::to_owned));
    // Those of a declared problem are walked in `tests/service/declared_sessions.rs`.
    walked.extend(["noise", "executed", "state"].map(str::to_owned));
    assert!(properties("Observe").is_subset(&walked), "{walked:?}");
    let mut walked: BTreeSet<String> =
        faulty_sessions().iter().map(|(_, field)| field.split(['[', '.']).next().unwrap().to_owned()).collect();
    walked.extend(["policy", "holdings", "state"].map(str::to_owned));
    let evaluated = faulty_evaluations();
    let evaluated: BTreeSet<String> =
        evaluated.iter().map(|(_, _, field)| field.split(['.', '[']).next().unwrap().to_owned()).collect();
    assert!(properties("EvaluationRequest").is_subset(&evaluated), "{evaluated:?}");
    assert!(properties("OpenSession").is_subset(&walked), "{walked:?}");
    let lived: BTreeSet<String> = faulty_walk_forwards().iter().map(|(name, _, _)| (*name).to_owned()).collect();
    assert!(properties("BacktestRequest").is_subset(&lived), "{lived:?}");
    let lived: BTreeSet<String> = faulty_walks_of_assets().iter().map(|(name, _, _)| (*name).to_owned()).collect();
    assert!(properties("AssetsBacktestRequest").is_subset(&lived), "{lived:?}");
    let mut walked: BTreeSet<String> =
        faulty_hypotheses().iter().flat_map(|(_, field)| field.split('.').map(str::to_owned)).collect();
    walked.insert("session".into());
    // Those of declared problems are walked in `tests/service/declared_sessions.rs`.
    walked.extend(["state", "noise"].map(str::to_owned));
    // Those of several assets are walked in `tests/service/funds.rs`.
    let of_several = ["holdings", "log_returns", "simple_returns", "prices", "previous_prices"];
    walked.extend(of_several.map(str::to_owned));
    for schema in ["WhatIf", "Sweep", "SweepRange"] {
        assert!(properties(schema).is_subset(&walked), "{schema} {walked:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_session_and_a_report_is_named() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    let post = |path: &'static str, body: String| {
        let request = app.client.post(format!("{}{path}", app.url)).header("content-type", "application/json");
        async move { crate::support::read(request.body(body).send().await.unwrap()).await }
    };
    for (report, expected, field) in faulty_reports() {
        let (status, problem) = post("/observe", format!(r#"{{"session": "{}", {report}}}"#, app.session)).await;
        assert_eq!(status, expected, "{report} {problem}");
        assert_named(&problem, field);
    }
    assert_named(&post("/observe", r#"{"period": 1, "log_return": 0.1}"#.into()).await.1, "session");
    for (session, field) in faulty_sessions() {
        let (status, problem) = post("/sessions", format!(r#"{{"policy": "{}", {session}}}"#, app.policy)).await;
        assert_eq!(status, 422, "{session} {problem}");
        assert_named(&problem, field);
    }
    for (hypothesis, field) in faulty_hypotheses() {
        let (status, problem) = post("/what-if", format!(r#"{{"session": "{}", {hypothesis}}}"#, app.session)).await;
        assert_eq!(status, 422, "{hypothesis} {problem}");
        assert_named(&problem, field);
    }
    assert_named(&post("/what-if", r#"{"wealth": 1}"#.into()).await.1, "session");
    assert_named(&post("/sessions", "{}".into()).await.1, "policy");
    assert_named(&post("/sessions", r#"{"policy": 1}"#.into()).await.1, "policy");
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!(session["period"], 1, "a refused report changed the session");
}

fn assert_refused((status, problem): &(reqwest::StatusCode, Value), expected: u16, field: &str, value: &str) {
    assert_eq!(status.as_u16(), expected, "{problem}");
    assert_named(problem, field);
    assert_eq!(problem["value"], value, "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn unknown_things_are_refused() {
    let app = App::start().await;
    for (path, what) in [
        ("/jobs/42", "job"),
        ("/jobs/42/events", "job"),
        ("/policies/42", "policy"),
        ("/policies/42/export", "policy"),
        ("/policies/42/surface", "policy"),
        ("/sessions/42", "session"),
        ("/sessions/42/history", "session"),
        ("/action?session=42", "session"),
        ("/action?session=42&mode=resolve", "session"),
    ] {
        let answer = app.get(path).await;
        assert_refused(&answer, 404, what, "42");
        assert_eq!(answer.1["rule"], format!("must name a {what}"), "{path}");
    }
    for (path, what) in [("/jobs/42", "job"), ("/policies/42", "policy"), ("/sessions/42", "session")] {
        assert_refused(&app.send(Method::DELETE, path, None).await, 404, what, "42");
    }
    assert_refused(&app.post("/sessions", &json!({"policy": "42"})).await, 404, "policy", "42");
    let report = json!({"session": "42", "period": 1, "log_return": 0.1});
    assert_refused(&app.post("/observe", &report).await, 404, "session", "42");
    assert_refused(&app.post("/what-if", &json!({"session": "42"})).await, 404, "session", "42");
    let orders = json!({"session": "42", "prices": {}, "units": {}, "cash": 1.0});
    assert_refused(&app.post("/orders", &orders).await, 404, "session", "42");
    assert_refused(&app.post("/sessions/42/letter", &json!({})).await, 404, "session", "42");
    assert_refused(&app.get("/nowhere").await, 404, "path", "/nowhere");
    assert_refused(&app.get("/jobs/%ff").await, 404, "id", "/jobs/%ff");
    assert_refused(&app.send(Method::DELETE, "/train", None).await, 405, "method", "DELETE");
    let allowed = app.client.delete(format!("{}/train", app.url)).send().await.unwrap();
    assert_eq!(allowed.headers()["allow"], "POST");
}

#[tokio::test(flavor = "multi_thread")]
async fn parameters_are_named() {
    let app = App::start().await;
    for (path, field) in [
        ("/action", "session"),
        ("/action?session=x&session=y", "session"),
        ("/action?session=x&mode=guess", "mode"),
        ("/action?session=x&explain=everything", "explain"),
        ("/action?session=x&colour=1", "colour"),
        ("/jobs?limit=0", "limit"),
        ("/jobs?limit=1001", "limit"),
        ("/policies?limit=many", "limit"),
        ("/sessions?after=last", "after"),
        ("/sessions?colour=1", "colour"),
    ] {
        let (status, problem) = app.get(path).await;
        assert_eq!(status, 400, "{path} {problem}");
        assert_named(&problem, field);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn documents_that_are_no_policies_are_refused() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    let sound: Value = serde_json::from_slice(&app.export().await).unwrap();
    let with = |pointer: &str, value: Value| {
        let mut document = sound.clone();
        *document.pointer_mut(pointer).unwrap() = value;
        document
    };
    for (document, field) in [
        (json!({"format": "ballast-policy-1"}), "specification"),
        (with("/format", json!("ballast-policy-9")), "format"),
        (with("/specification/problem/horizon", json!(3)), "steps"),
        (with("/specification/problem/horizon", json!(0)), "problem.horizon"),
        (with("/steps/1/step", json!(0)), "steps[1].step"),
        (with("/steps/1/diagnostics", json!({"colour": 1})), "steps[1].diagnostics.colour"),
    ] {
        let (status, problem) = app.post("/policies/import", &document).await;
        assert_eq!(status, 422, "{problem}");
        assert_named(&problem, field);
    }
    let request = app.client.post(format!("{}/policies/import", app.url)).header("content-type", "application/json");
    let (status, problem) = crate::support::read(request.body("{\"format\": ").send().await.unwrap()).await;
    assert_eq!(status, 400, "{problem}");
}
