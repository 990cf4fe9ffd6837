//! OpenAPI schemas for figures of floor 0 that reports carry; floor 0 itself describes nothing for the wire.

use std::borrow::Cow;

use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::numerics::statistics::summary::Estimate;

/// A figure and its interval.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only the derive reads it")]
struct Described {
    /// The estimate.
    value: f64,
    /// Lower end of the interval.
    low: f64,
    /// Upper end of the interval.
    high: f64,
}

impl PartialSchema for Estimate {
    fn schema() -> RefOr<Schema> {
        Described::schema()
    }
}

impl ToSchema for Estimate {
    fn name() -> Cow<'static, str> {
        "Estimate".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_is_described_as_it_is_written() {
        let written = serde_json::to_value(Estimate { value: 1.0, low: 0.5, high: 2.0 }).unwrap();
        let described = serde_json::to_value(Estimate::schema()).unwrap();
        let names: Vec<&String> = written.as_object().unwrap().keys().collect();
        assert_eq!(described["properties"].as_object().unwrap().keys().collect::<Vec<_>>(), names);
        assert_eq!(described["required"].as_array().unwrap().len(), names.len());
    }
}
