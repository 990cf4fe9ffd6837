//! Adds the defaults of requests to the description, as the decoder applies them.
//!
//! The smallest valid request is decoded and written again: every field that was not in it has its default. A default
//! that depends on other fields is filled in later by the service, and is described by the field itself.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use utoipa::openapi::OpenApi;

use crate::control::request::assets::AssetsProblem;
use crate::control::request::backtest::BacktestRequest;
use crate::control::request::backtest_assets::AssetsBacktestRequest;
use crate::control::request::evaluation::EvaluationRequest;
use crate::control::request::frontier::FrontierRequest;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::{
    DesignSpecification, HyperparameterBounds, ProblemSpecification, Specification, SurrogateSpecification,
};
use crate::http::description::bounds::{merged, with_field};
use crate::http::routes::jobs::Train;

/// Adds to every request schema the defaults of its fields.
pub fn tell(description: &mut OpenApi) {
    let Some(components) = &mut description.components else { return };
    for (name, defaults) in documented() {
        let Some(schema) = components.schemas.get_mut(name) else { continue };
        for (field, default) in defaults {
            with_field(schema, &field, None, &mut |property| merged(property, &json!({ "default": default })));
        }
    }
}

fn documented() -> [(&'static str, Map<String, Value>); 12] {
    let least = json!({ "history": [], "rate_per_step": 0.0 });
    [
        ("Specification", of::<Specification>(json!({ "problem": least }))),
        ("Train", of::<Train>(json!({ "problem": least }))),
        ("ProblemSpecification", of::<ProblemSpecification>(least.clone())),
        ("AssetsProblem", of::<AssetsProblem>(json!({ "assets": [], "history": [], "rate_per_step": 0.0 }))),
        ("DesignSpecification", of::<DesignSpecification>(json!({}))),
        ("SurrogateSpecification", of::<SurrogateSpecification>(json!({}))),
        ("HyperparameterBounds", of::<HyperparameterBounds>(json!({}))),
        ("RadiusRule", of::<RadiusRule>(json!({ "rule": "bridge" }))),
        ("EvaluationRequest", of::<EvaluationRequest>(json!({ "problem": least }))),
        ("BacktestRequest", of::<BacktestRequest>(json!({ "rate": 0.0 }))),
        ("AssetsBacktestRequest", of::<AssetsBacktestRequest>(json!({ "assets": [], "rate": 0.0, "dates": [] }))),
        ("FrontierRequest", of::<FrontierRequest>(json!({ "problem": least }))),
    ]
}

fn of<T: Serialize + DeserializeOwned>(least: Value) -> Map<String, Value> {
    let read = serde_json::from_value::<T>(least.clone()).ok().and_then(|read| serde_json::to_value(read).ok());
    let Some(Value::Object(mut whole)) = read else { return Map::new() };
    whole.retain(|field, value| least.get(field).is_none() && !has_null(value));
    whole
}

/// Returns true if a value, or a part of it, is filled in later.
fn has_null(value: &Value) -> bool {
    value.is_null() || value.as_object().is_some_and(|members| members.values().any(has_null))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::router;

    #[test]
    fn every_default_is_told() {
        let description = serde_json::to_value(router::description()).unwrap();
        let schemas = &description["components"]["schemas"];
        for (name, field, default) in [
            ("ProblemSpecification", "horizon", json!(10)),
            ("ProblemSpecification", "framework", json!("adaptive")),
            ("ProblemSpecification", "action_interval", json!([0.0, 1.0])),
            ("SurrogateSpecification", "moment_count", json!(4)),
            ("HyperparameterBounds", "noise_variance", json!([1e-10, 1.0])),
            ("EvaluationRequest", "level", json!(0.95)),
            ("Specification", "seed", json!(1)),
            ("BacktestRequest", "alpha", json!([0.05, 0.1, 0.5])),
        ] {
            assert_eq!(schemas[name]["properties"][field]["default"], default, "{name}.{field}");
        }
        let rules = schemas["RadiusRule"]["oneOf"].as_array().unwrap();
        assert_eq!(rules.iter().filter(|rule| rule["properties"]["alpha"]["default"] == 0.1).count(), 5);
        assert!(documented().iter().all(|(_, defaults)| !defaults.is_empty()));
    }
}
