//! Adds the rules of single fields to the description, as far as JSON Schema can express them: lengths, ranges, exactly
//! one of several.
//!
//! The rules are defined in `control::request::rules` and beside their requests. This module repeats their numbers for
//! readers of the description, and a test checks the rules themselves at both ends. Rules between fields are left to
//! the service.

use serde_json::{Map, Value, json};
use utoipa::openapi::{Object, OpenApi, RefOr, Schema};

use crate::control::evaluation::assets::MOST_WINDOWS;
use crate::control::request::assets::{ASSETS, DATES, LARGEST_FACTOR, NAME_LENGTH};
use crate::control::request::backtest;
use crate::control::request::caution;
use crate::control::request::centre_rules::{ASSUMED_WEIGHT, BANDWIDTH};
use crate::control::request::evaluation::{self, HISTORIES, LEVEL, MOST_MIXES};
use crate::control::request::frontier::{LARGEST_SCALE, RESAMPLES, SCALES};
use crate::control::request::learning::HALF_LIFE;
use crate::control::request::rules::{
    ACCURACY, COUNT, FIXED_RADIUS, HISTORY_LENGTH, HORIZON, LOG_RETURN, MOMENTS, PATHS, PERIODS_PER_YEAR,
    RADIUS_CORRECTION, RADIUS_SCALE, RATE, RELATIVE_RISK_AVERSION, RISK_AVERSION, RISK_AVERSION_RELATIVE, TRADING_COST,
    WEALTH,
};
use crate::control::request::support::{FACTOR, LIMIT};
use crate::service::advice::what_if::POINTS;
use crate::service::entries::report::{LONGEST_REASON, MOST_CORRECTIONS, PRICE};
use crate::service::entries::reports::REPORTS;
use crate::service::sessions::plan::MOST_RENEWALS;
use crate::store::{LONGEST_NAME, LONGEST_NOTES, LONGEST_TAG, MOST_TAGS};

/// Adds to every schema the bounds of its fields.
pub fn tell(description: &mut OpenApi) {
    let Some(components) = &mut description.components else { return };
    for (name, field, rule) in rules() {
        let (name, variant) = name.split_once(' ').map_or((name, None), |(name, variant)| (name, Some(variant)));
        if let Some(schema) = components.schemas.get_mut(name) {
            with_field(schema, field, variant, &mut |property| merged(property, &rule));
        }
    }
    if let Some(sweep) = components.schemas.get_mut("Sweep") {
        merged(sweep, &json!({ "minProperties": 1, "maxProperties": 1 }));
    }
    if let Some(RefOr::T(Schema::OneOf(reports))) = components.schemas.get_mut("Reports") {
        let lists = reports.items.iter_mut().filter(|item| matches!(item, RefOr::T(Schema::Array(_))));
        let length = json!({ "minItems": REPORTS.start(), "maxItems": REPORTS.end() });
        lists.for_each(|list| merged(list, &length));
    }
}

/// Returns all rules, each as schema (or schema and variant), field and rule.
fn rules() -> Vec<(&'static str, &'static str, Value)> {
    let pair = json!({ "minItems": 2, "maxItems": 2, "items": { "minimum": 1e-12, "maximum": 1e12 } });
    let history = listed(&HISTORY_LENGTH, within((-LOG_RETURN, LOG_RETURN)));
    let wealth = within(WEALTH);
    let probability = within((1e-3, 0.999));
    let rules = [
        ("ProblemSpecification", "horizon", whole(&HORIZON)),
        ("ProblemSpecification", "trading_cost", within(TRADING_COST)),
        ("ProblemSpecification", "risk_aversion", within(RELATIVE_RISK_AVERSION)),
        ("ProblemSpecification", "history", history.clone()),
        ("CentreSpecification smoothed", "bandwidth", within(BANDWIDTH)),
        ("CentreSpecification volatility_scaled", "half_life", within(HALF_LIFE)),
        ("CentreSpecification mixed", "history", history),
        ("CentreSpecification mixed", "weight", within(ASSUMED_WEIGHT)),
        ("Learning", "half_life", within(HALF_LIFE)),
        ("UtilitySpecification exponential", "risk_aversion", within(RISK_AVERSION)),
        ("UtilitySpecification exponential", "risk_aversion_relative", within(RISK_AVERSION_RELATIVE)),
        ("UtilitySpecification power", "risk_aversion", json!({ "exclusiveMinimum": 1, "maximum": 100 })),
        ("Support worst_seen", "factor", within(FACTOR)),
        ("Support between", "min", within((-LIMIT, LIMIT))),
        ("Support between", "max", within((-LIMIT, LIMIT))),
        ("CautionLevel", "scale", within((0.0, caution::LARGEST_SCALE))),
        ("RadiusRule bridge", "alpha", probability.clone()),
        ("RadiusRule calibrated", "alpha", within((1e-2, 0.999))),
        ("RadiusRule concentration", "alpha", probability),
        ("RadiusRule concentration", "C", json!({ "exclusiveMinimum": 0, "maximum": 1e9 })),
        ("RadiusRule chi_square", "alpha", within((1e-3, 1.0))),
        ("RadiusRule", "paths", whole(&PATHS)),
        ("RadiusRule", "scale", within(RADIUS_SCALE)),
        ("RadiusRule", "correction", within(RADIUS_CORRECTION)),
        ("RadiusRule", "kappa", within((0.0, 100.0))),
        ("RadiusRule", "radius", within(FIXED_RADIUS)),
        ("RadiusRule", "c", within((1e-9, 1e12))),
        ("SamplingLaw", "components", json!({ "minItems": 1, "maxItems": 32 })),
        ("SamplingLaw", "location", within((-1.0, 1.0))),
        ("SamplingLaw", "scale", within((1e-6, 1.0))),
        ("SamplingLaw", "degrees_of_freedom", within((2.1, 1e6))),
        ("MixtureComponent", "weight", json!({ "exclusiveMinimum": 0, "maximum": 1 })),
        ("MixtureComponent", "mean", within((-1.0, 1.0))),
        ("MixtureComponent", "variance", within((1e-12, 1.0))),
        ("SurrogateSpecification", "moment_count", whole(&MOMENTS)),
        ("HyperparameterBounds", "lengthscale", pair.clone()),
        ("HyperparameterBounds", "signal_variance", pair.clone()),
        ("HyperparameterBounds", "noise_variance", pair),
        ("Advise", "wealth", wealth.clone()),
        ("Advise", "holding", within((0.0, 1.0))),
        ("AdviseAssets", "wealth", wealth),
        ("ReadReturns", "text", json!({ "maxLength": 8_000_000 })),
        ("FrontierRequest", "scales", listed(&SCALES, within((0.0, LARGEST_SCALE)))),
        ("FrontierRequest", "resamples", whole(&RESAMPLES)),
        ("FrontierRequest", "block", json!({ "minimum": 1 })),
        ("SweepRange", "points", whole(&POINTS)),
        ("EvaluationRequest", "constant_mixes", json!({ "maxItems": MOST_MIXES, "items": within((0.0, 1.0)) })),
        ("EvaluationRequest", "paths", whole(&evaluation::PATHS)),
        ("EvaluationRequest", "level", within(LEVEL)),
        ("InitialHistories", "count", whole(&HISTORIES)),
    ];
    let investors = ["ProblemSpecification", "AssetsProblem"].into_iter().flat_map(of_investor);
    rules
        .into_iter()
        .chain(investors)
        .chain(of_designs())
        .chain(of_assets())
        .chain(of_sessions())
        .chain(supposed())
        .chain(of_labels())
        .chain(walked())
        .chain(reported())
        .collect()
}

/// Returns the rules for the design of training states.
fn of_designs() -> [(&'static str, &'static str, Value); 2] {
    [("accuracy", within(ACCURACY)), ("count", whole(&COUNT))].map(|(field, rule)| ("DesignSpecification", field, rule))
}

/// Returns the rules of the problems that have an investor and a bank.
fn of_investor(problem: &'static str) -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let action = json!({ "minItems": 2, "maxItems": 2, "items": within((0.0, 1.0)) });
    let rules = [
        (problem, "rate_per_step", within(RATE)),
        (problem, "periods_per_year", within(PERIODS_PER_YEAR)),
        (problem, "initial_wealth", within(WEALTH)),
        (problem, "action_interval", action),
    ];
    rules.into_iter()
}

/// Returns the rules of requests about several assets.
fn of_assets() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let (log_return, names) = (within((-LOG_RETURN, LOG_RETURN)), asset_names());
    let rules = [
        ("AssetsProblem", "horizon", whole(&HORIZON)),
        ("AssetsProblem", "trading_cost", within(TRADING_COST)),
        ("AssetsProblem", "risk_aversion", within(RELATIVE_RISK_AVERSION)),
        ("FundSpecification", "assets", names.clone()),
        ("FundSpecification", "radius_factor", within((1.0, LARGEST_FACTOR))),
        ("FundSpecification", "history", listed(&DATES, listed(&ASSETS, log_return.clone()))),
        ("AssetsProblem", "assets", names),
        ("AssetsProblem", "history", listed(&DATES, listed(&ASSETS, log_return.clone()))),
    ];
    rules.into_iter()
}

/// Returns the rules of sessions, and of what is recorded in them.
fn of_sessions() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let rules = [
        ("OpenSession", "policy", json!({ "minLength": 1 })),
        ("OpenSession", "holdings", each(within((0.0, 1.0)))),
        ("OpenSession", "wealth", within(WEALTH)),
        ("OpenSession", "holding", within((0.0, 1.0))),
        ("Observe", "session", json!({ "minLength": 1 })),
        ("Observe", "period", json!({ "minimum": 1 })),
        ("Correct", "correction", whole(&(1..=MOST_CORRECTIONS))),
        ("Correct", "period", json!({ "minimum": 1 })),
        ("Correct", "reason", json!({ "minLength": 1, "maxLength": LONGEST_REASON })),
        ("Renew", "renewal", whole(&(1..=MOST_RENEWALS))),
        ("Renew", "policy", json!({ "minLength": 1 })),
        ("Renew", "window", whole(&HISTORY_LENGTH)),
        ("Renewing", "every", json!({ "minimum": 1 })),
        ("Renewing", "window", whole(&HISTORY_LENGTH)),
    ];
    rules.into_iter()
}

/// Returns the rules of what-if requests.
fn supposed() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let rules = [
        ("WhatIf", "session", json!({ "minLength": 1 })),
        ("WhatIf", "wealth", within(WEALTH)),
        ("WhatIf", "holding", within((0.0, 1.0))),
        ("WhatIf", "radius_scale", within(RADIUS_SCALE)),
        ("WhatIf", "radius", within(FIXED_RADIUS)),
        ("WhatIf", "log_return", within((-LOG_RETURN, LOG_RETURN))),
        ("WhatIf", "simple_return", within(((-LOG_RETURN).exp_m1(), LOG_RETURN.exp_m1()))),
        ("WhatIf", "holdings", each(within((0.0, 1.0)))),
        ("AdviseAssets", "holdings", each(within((0.0, 1.0)))),
    ];
    rules.into_iter()
}

/// Returns the rules of names, notes and tags.
fn of_labels() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    ["Train", "OpenSession", "Relabel"].into_iter().flat_map(|schema| {
        let tag = json!({ "minLength": 1, "maxLength": LONGEST_TAG });
        let tags = json!({ "maxItems": MOST_TAGS, "uniqueItems": true, "items": tag });
        let [name, notes] = [LONGEST_NAME, LONGEST_NOTES].map(|most| json!({ "maxLength": most }));
        [(schema, "name", name), (schema, "notes", notes), (schema, "tags", tags)]
    })
}

/// Returns the rules of a walk-forward backtest.
fn walked() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let fields = [
        ("periods_per_year", whole(&backtest::YEAR)),
        ("window", whole(&HISTORY_LENGTH)),
        ("every", whole(&HORIZON)),
        ("horizon", whole(&HORIZON)),
        ("alpha", listed(&backtest::LEVELS, within(backtest::ALPHA))),
        ("scale", within(RADIUS_SCALE)),
        ("risk_aversion", within(RELATIVE_RISK_AVERSION)),
        ("trading_cost", within(TRADING_COST)),
        ("count", whole(&COUNT)),
        ("log_returns", listed(&backtest::PERIODS, within((-LOG_RETURN, LOG_RETURN)))),
        ("simple_returns", listed(&backtest::PERIODS, within(((-LOG_RETURN).exp_m1(), LOG_RETURN.exp_m1())))),
        ("dates", json!({ "minItems": backtest::PERIODS.start(), "maxItems": backtest::PERIODS.end() })),
    ];
    fields.into_iter().map(|(field, rule)| ("BacktestRequest", field, rule)).chain(walked_of_assets())
}

/// Returns the rules of a walk-forward backtest of several assets.
fn walked_of_assets() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    let rows = |bounds| listed(&backtest::PERIODS, listed(&ASSETS, within(bounds)));
    let fields = [
        ("assets", asset_names()),
        ("log_returns", rows(backtest::bounds(false))),
        ("simple_returns", rows(backtest::bounds(true))),
        ("dates", json!({ "minItems": backtest::PERIODS.start(), "maxItems": backtest::PERIODS.end() })),
        ("periods_per_year", whole(&backtest::YEAR)),
        ("windows", json!({ "minItems": 1, "maxItems": MOST_WINDOWS })),
        ("every", whole(&(1..=*DATES.end()))),
        ("alpha", within(backtest::ALPHA)),
        ("risk_aversion", within(RELATIVE_RISK_AVERSION)),
        ("trading_cost", within(TRADING_COST)),
    ];
    fields.into_iter().map(|(field, rule)| ("AssetsBacktestRequest", field, rule))
}

/// Returns the rule for the names of several assets.
fn asset_names() -> Value {
    let length = whole(&NAME_LENGTH);
    let name = json!({ "minLength": length["minimum"], "maxLength": length["maximum"] });
    let mut names = listed(&ASSETS, name);
    names["uniqueItems"] = json!(true);
    names
}

/// Returns the rules of a period's report, in every schema that has one.
fn reported() -> impl Iterator<Item = (&'static str, &'static str, Value)> {
    ["Observe", "Correct", "Report", "WhatIf"].into_iter().flat_map(|schema| {
        let of_assets = ["log_returns", "simple_returns", "prices", "previous_prices"];
        let fields = [
            ("log_return", within((-LOG_RETURN, LOG_RETURN))),
            ("simple_return", within(((-LOG_RETURN).exp_m1(), LOG_RETURN.exp_m1()))),
            ("price", within(PRICE)),
            ("previous_price", within(PRICE)),
            ("rate", within(RATE)),
            ("flow", within((-WEALTH.1, WEALTH.1))),
            ("log_returns", each(within((-LOG_RETURN, LOG_RETURN)))),
            ("simple_returns", each(within(((-LOG_RETURN).exp_m1(), LOG_RETURN.exp_m1())))),
            ("prices", each(within(PRICE))),
            ("previous_prices", each(within(PRICE))),
            ("executed_allocation", within((0.0, 1.0))),
            ("executed_allocations", each(within((0.0, 1.0)))),
            ("wealth", within(WEALTH)),
        ];
        let described = fields.into_iter().filter(move |(field, _)| schema != "WhatIf" || of_assets.contains(field));
        described.map(move |(field, rule)| (schema, field, rule))
    })
}

fn whole(range: &std::ops::RangeInclusive<usize>) -> Value {
    json!({ "minimum": range.start(), "maximum": range.end() })
}

fn listed(counts: &std::ops::RangeInclusive<usize>, items: Value) -> Value {
    json!({ "minItems": counts.start(), "maxItems": counts.end(), "items": items })
}

/// Returns the rule for an object with a value for each asset, by its name.
fn each(value: Value) -> Value {
    json!({ "additionalProperties": value })
}

fn within((low, high): (f64, f64)) -> Value {
    json!({ "minimum": low, "maximum": high })
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
    fn every_rule_is_of_a_field_there_is() {
        let description = serde_json::to_value(router::description()).unwrap();
        for (name, field, rule) in rules() {
            let schema = &description["components"]["schemas"][name.split(' ').next().unwrap()];
            let variants = schema["oneOf"].as_array().cloned().unwrap_or(vec![schema.clone()]);
            let matching = variants.iter().filter(|variant| {
                let property = &variant["properties"][field];
                rule.as_object().unwrap().keys().all(|key| !property[key].is_null())
            });
            assert!(matching.count() > 0, "{name} does not describe {field}: {rule}");
        }
        assert_eq!(description["components"]["schemas"]["Sweep"]["maxProperties"], 1);
        assert_eq!(description["components"]["schemas"]["Reports"]["oneOf"][1]["maxItems"], 1000);
    }
}
