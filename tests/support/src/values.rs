//! Values of an answer in JSON.

use serde_json::Value;

/// Returns a number.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Returns an object with the field at a pointer, such as `/problem/horizon`, replaced or added.
pub fn replaced(mut object: Value, pointer: &str, value: Value) -> Value {
    let (parent, name) = pointer.rsplit_once('/').expect("a pointer");
    object.pointer_mut(parent).expect("the object of the field")[name] = value;
    object
}
