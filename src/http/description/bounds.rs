//! Adds the bounds of single fields to the description, as JSON Schema expresses them: lengths, ranges, exactly one of
//! several.
//!
//! The types of requests list the bounds of their fields, next to their checkers. Rules between fields are left to the
//! service.

use std::borrow::Cow;

use serde_json::{Map, Value, json};
use utoipa::ToSchema;
use utoipa::openapi::{Object, OpenApi, RefOr, Schema};

use crate::control::request::assets::AssetsProblem;
use crate::control::request::backtest::BacktestRequest;
use crate::control::request::backtest_assets::AssetsBacktestRequest;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::{CentreSpecification, Covariate};
use crate::control::request::declared::{DeclaredDesign, DeclaredProblem};
use crate::control::request::declared_backtest::DeclaredBacktest;
use crate::control::request::declared_comparison::DeclaredComparison;
use crate::control::request::evaluation::{EvaluationRequest, InitialHistories};
use crate::control::request::frontier::FrontierRequest;
use crate::control::request::fund::FundSpecification;
use crate::control::request::learning::Learning;
use crate::control::request::limits::{GroupLimit, ShareRange, WeightLimits};
use crate::control::request::means::MeansRule;
use crate::control::request::plan::PlanQuestion;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::sampling_law::{MixtureComponent, SamplingLaw};
use crate::control::request::specification::{
    DesignSpecification, HyperparameterBounds, ProblemSpecification, SurrogateSpecification, UtilitySpecification,
};
use crate::control::request::spending::Spending;
use crate::control::request::support::Support;
use crate::service::advice::advise::Advise;
use crate::service::advice::advise_assets::AdviseAssets;
use crate::service::advice::decide::Decide;
use crate::service::advice::orders::OrdersQuestion;
use crate::service::advice::policy_map::InputRange;
use crate::service::advice::returns::ReadReturns;
use crate::service::advice::sweep::SweepRange;
use crate::service::advice::what_if::WhatIf;
use crate::service::entries::report::{Correct, Observe, Report};
use crate::service::field_bounds::LISTED_REPORTS;
use crate::service::letter::links::MakeLink;
use crate::service::letter::request::{Firm, SmallestTrade};
use crate::service::sessions::opening::SessionStart;
use crate::service::sessions::plan::{Renew, Renewing};
use crate::service::subscriptions::Subscribe;
use crate::store::Relabel;

/// Adds to every schema the bounds of its fields.
pub fn tell(description: &mut OpenApi) {
    let Some(components) = &mut description.components else { return };
    for (name, fields) in schemas() {
        let Some(schema) = components.schemas.get_mut(&*name) else { continue };
        for (field, bounds) in fields {
            let (variant, field) =
                field.split_once('.').map_or((None, *field), |(variant, field)| (Some(variant), field));
            with_field(schema, field, variant, &mut |property| merged(property, &as_schema(*bounds)));
        }
    }
    if let Some(sweep) = components.schemas.get_mut("Sweep") {
        merged(sweep, &json!({ "minProperties": 1, "maxProperties": 1 }));
    }
    if let Some(RefOr::T(Schema::OneOf(reports))) = components.schemas.get_mut("Reports") {
        let lists = reports.items.iter_mut().filter(|item| matches!(item, RefOr::T(Schema::Array(_))));
        lists.for_each(|list| merged(list, &as_schema(LISTED_REPORTS)));
    }
}

/// Returns the names of schemas, each with bounds of its fields.
fn schemas() -> Vec<(Cow<'static, str>, &'static [FieldBounds])> {
    vec![
        of::<ProblemSpecification>(),
        of::<UtilitySpecification>(),
        of::<Learning>(),
        of::<CentreSpecification>(),
        of::<Covariate>(),
        of::<RadiusRule>(),
        of::<CautionLevel>(),
        of::<Support>(),
        of::<SamplingLaw>(),
        of::<MixtureComponent>(),
        of::<DesignSpecification>(),
        of::<SurrogateSpecification>(),
        of::<HyperparameterBounds>(),
        of::<AssetsProblem>(),
        of::<FundSpecification>(),
        of::<Spending>(),
        of::<PlanQuestion>(),
        of::<PlanQuestion<AssetsProblem>>(),
        of::<WeightLimits>(),
        of::<ShareRange>(),
        of::<GroupLimit>(),
        of::<MeansRule>(),
        of::<EvaluationRequest>(),
        of::<InitialHistories>(),
        of::<BacktestRequest>(),
        of::<AssetsBacktestRequest>(),
        of::<FrontierRequest>(),
        of::<Advise>(),
        of::<AdviseAssets>(),
        of::<DeclaredProblem>(),
        of::<DeclaredDesign>(),
        of::<DeclaredComparison>(),
        of::<DeclaredBacktest>(),
        of::<Decide>(),
        of::<InputRange>(),
        of::<WhatIf>(),
        of::<OrdersQuestion>(),
        of::<Firm>(),
        of::<SmallestTrade>(),
        of::<MakeLink>(),
        of::<SweepRange>(),
        of::<Report>(),
        of::<Observe>(),
        ("Observe".into(), Report::BOUNDS),
        of::<Correct>(),
        ("Correct".into(), Report::BOUNDS),
        of::<Renew>(),
        of::<Renewing>(),
        of::<ReadReturns>(),
        of::<Subscribe>(),
        ("OpenSession".into(), SessionStart::BOUNDS),
        of::<Relabel>(),
        ("OpenSession".into(), Relabel::BOUNDS),
        ("Train".into(), Relabel::BOUNDS),
        ("TrainAssets".into(), Relabel::BOUNDS),
        ("TrainDeclared".into(), Relabel::BOUNDS),
    ]
}

fn of<T: Bounded + ToSchema>() -> (Cow<'static, str>, &'static [FieldBounds]) {
    (T::name(), T::BOUNDS)
}

/// Returns the bounds as members of a schema.
fn as_schema(bounds: ValueBounds) -> Value {
    match bounds {
        ValueBounds::Number(low, high) => json!({ "minimum": low, "maximum": high }),
        ValueBounds::Above(low, high) => json!({ "exclusiveMinimum": low, "maximum": high }),
        ValueBounds::Count(least, most) => json!({ "minimum": least, "maximum": most }),
        ValueBounds::CountFrom(least) => json!({ "minimum": least }),
        ValueBounds::Text(least, most) => Value::Object(lengths(["minLength", "maxLength"], [least, most])),
        ValueBounds::List(least, most, element) | ValueBounds::Set(least, most, element) => {
            let mut list = lengths(["minItems", "maxItems"], [least, most]);
            if matches!(bounds, ValueBounds::Set(..)) {
                list.insert("uniqueItems".into(), json!(true));
            }
            let element = as_schema(*element);
            if element != json!({}) {
                list.insert("items".into(), element);
            }
            Value::Object(list)
        }
        ValueBounds::ByAsset(value) => json!({ "additionalProperties": as_schema(*value) }),
        ValueBounds::Any => json!({}),
    }
}

/// Returns the least and the most of a length, without an end that says nothing.
fn lengths(names: [&str; 2], [least, most]: [usize; 2]) -> Map<String, Value> {
    let ends = [(names[0], least, least > 0), (names[1], most, most < usize::MAX)];
    ends.into_iter().filter(|(.., says)| *says).map(|(name, end, _)| (name.to_owned(), json!(end))).collect()
}

/// Changes the field, in `variant` or in every variant that has it.
pub fn with_field(
    schema: &mut RefOr<Schema>,
    field: &str,
    variant: Option<&str>,
    change: &mut impl FnMut(&mut RefOr<Schema>),
) {
    let RefOr::T(schema) = schema else { return };
    match schema {
        Schema::Object(object) if variant.is_none_or(|variant| is_tagged(object, variant)) => {
            if let Some(property) = object.properties.get_mut(field) {
                change(property);
            }
        }
        Schema::OneOf(variants) => {
            variants.items.iter_mut().for_each(|item| with_field(item, field, variant, change));
        }
        _ => {}
    }
}

/// Returns true if a field of the variant can hold only its name.
fn is_tagged(variant: &Object, name: &str) -> bool {
    let only = Some(vec![json!(name)]);
    variant
        .properties
        .values()
        .any(|property| matches!(property, RefOr::T(Schema::Object(tag)) if tag.enum_values == only))
}

/// Adds the members of `rule` to a schema.
pub fn merged(schema: &mut RefOr<Schema>, rule: &Value) {
    let Ok(mut written) = serde_json::to_value(&*schema) else { return };
    merge(&mut written, rule);
    if let Ok(read) = serde_json::from_value(written) {
        *schema = read;
    }
}

fn merge(into: &mut Value, rule: &Value) {
    let (Value::Object(into), Value::Object(rule)) = (into, rule) else { return };
    for (key, value) in rule {
        match value {
            Value::Object(_) => merge(into.entry(key).or_insert(Value::Object(Map::new())), value),
            value => drop(into.insert(key.clone(), value.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::request::specification::Specification;
    use crate::http::router;

    /// Sets `value` at `pointer` in a valid specification, and returns the field that the rules reject.
    fn refused(pointer: &str, value: Value) -> Option<String> {
        let mut given = json!({
            "problem": { "history": [0.1, -0.1, 0.05], "horizon": 3, "rate_per_step": 0.0, "periods_per_year": 12.0,
                "initial_wealth": 100.0, "trading_cost": 0.0, "utility": { "kind": "exponential", "risk_aversion": 0.01 },
                "radius": { "rule": "bridge", "alpha": 0.1, "paths": 200, "scale": 1.0 },
                "learning": { "kind": "decay", "half_life": 2.0 } },
            "design": { "accuracy": 1.0, "count": 20, "sampling_law": { "kind": "student_t", "location": 0.0, "scale": 0.1,
                "degrees_of_freedom": 5.0 } },
            "surrogate": { "moment_count": 4 }
        });
        *given.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
        let specification: Result<Specification, _> = serde_json::from_value(given);
        specification.unwrap().completed().err().map(|error| error.field)
    }

    #[test]
    fn the_rules_and_the_description_have_the_same_ends() {
        let description = serde_json::to_value(router::description()).unwrap();
        let of = |schema: &str, variant: Option<usize>, field: &str| {
            let schema = &description["components"]["schemas"][schema];
            let schema = variant.map_or(schema, |variant| &schema["oneOf"][variant]);
            schema["properties"][field].clone()
        };
        for (pointer, schema, step) in [
            ("/problem/horizon", of("ProblemSpecification", None, "horizon"), 1.0),
            ("/problem/rate_per_step", of("ProblemSpecification", None, "rate_per_step"), 1e-3),
            ("/problem/periods_per_year", of("ProblemSpecification", None, "periods_per_year"), 1e-3),
            ("/problem/initial_wealth", of("ProblemSpecification", None, "initial_wealth"), 1e-7),
            ("/problem/trading_cost", of("ProblemSpecification", None, "trading_cost"), 1e-3),
            ("/problem/history/0", of("ProblemSpecification", None, "history")["items"].clone(), 1e-3),
            ("/problem/learning/half_life", of("Learning", Some(1), "half_life"), 1e-3),
            ("/problem/radius/paths", of("RadiusRule", Some(0), "paths"), 1.0),
            ("/problem/radius/scale", of("RadiusRule", Some(0), "scale"), 1e-3),
            ("/problem/radius/alpha", of("RadiusRule", Some(0), "alpha"), 1e-4),
            ("/design/accuracy", of("DesignSpecification", None, "accuracy"), 1e-3),
            ("/design/count", of("DesignSpecification", None, "count"), 1.0),
            ("/design/sampling_law/location", of("SamplingLaw", Some(2), "location"), 1e-3),
            ("/design/sampling_law/scale", of("SamplingLaw", Some(2), "scale"), 1e-7),
            ("/design/sampling_law/degrees_of_freedom", of("SamplingLaw", Some(2), "degrees_of_freedom"), 1e-3),
            ("/surrogate/moment_count", of("SurrogateSpecification", None, "moment_count"), 1.0),
        ] {
            let number = |value: f64| if step == 1.0 { json!(value as u64) } else { json!(value) };
            let named = pointer.replace("/0", "[0]").trim_start_matches('/').replace('/', ".");
            for (end, beyond) in [("minimum", -step), ("maximum", step)] {
                let end = schema[end].as_f64().unwrap_or_else(|| panic!("{pointer} has no {end}: {schema}"));
                assert_ne!(refused(pointer, number(end)).as_ref(), Some(&named), "{pointer} at {end}");
                let beyond = end + if step == 1.0 { beyond } else { beyond * end.abs().max(1.0) };
                assert_eq!(refused(pointer, number(beyond)), Some(named.clone()), "{pointer} at {beyond}");
            }
        }
        let interval = of("ProblemSpecification", None, "action_interval");
        assert_eq!((&interval["minItems"], &interval["maxItems"]), (&json!(2), &json!(2)));
    }

    #[test]
    fn every_bound_is_of_a_field_there_is() {
        let description = serde_json::to_value(router::description()).unwrap();
        for (name, fields) in schemas() {
            let schema = &description["components"]["schemas"][&*name];
            let variants = schema["oneOf"].as_array().cloned().unwrap_or(vec![schema.clone()]);
            for (field, bounds) in fields {
                let (field, rule) = (field.split('.').next_back().unwrap(), as_schema(*bounds));
                let matching = variants.iter().filter(|variant| {
                    let property = &variant["properties"][field];
                    rule.as_object().unwrap().keys().all(|key| !property[key].is_null())
                });
                assert!(matching.count() > 0, "{name} does not describe {field}: {rule}");
            }
        }
        assert_eq!(description["components"]["schemas"]["Sweep"]["maxProperties"], 1);
        assert_eq!(description["components"]["schemas"]["Reports"]["oneOf"][1]["maxItems"], 1000);
    }
}
