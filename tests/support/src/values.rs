//! Values of an answer in JSON.

use serde_json::Value;

/// Returns a number.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}
