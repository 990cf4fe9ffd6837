//! The bounds of single fields of requests, as far as they depend on no other field.
//!
//! A type lists the bounds of its fields next to its checker, and both use the same constants. The description of the
//! interface and its pages are made from the lists.

use std::ops::RangeInclusive;

use crate::control::error::FieldError;
use crate::control::request::support::Interval;

/// The bounds of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValueBounds {
    /// A number from the first to the second.
    Number(f64, f64),
    /// A number above the first, and at most the second.
    Above(f64, f64),
    /// A whole number from the first to the second.
    Count(usize, usize),
    /// A whole number of at least this.
    CountFrom(usize),
    /// A text of at least and at most so many characters.
    Text(usize, usize),
    /// A list of at least and at most so many elements, each with these bounds.
    List(usize, usize, &'static ValueBounds),
    /// A list as above, whose elements all differ.
    Set(usize, usize, &'static ValueBounds),
    /// An object with a value for each asset, by its name.
    ByAsset(&'static ValueBounds),
    /// Values that depend on other fields, or on nothing.
    Any,
}

impl ValueBounds {
    /// Builds the bounds of a number, lowest and highest.
    pub const fn number((low, high): (f64, f64)) -> Self {
        ValueBounds::Number(low, high)
    }

    /// Builds the bounds of a whole number.
    pub const fn count(range: &RangeInclusive<usize>) -> Self {
        ValueBounds::Count(*range.start(), *range.end())
    }

    /// Builds the bounds of a text from those of its number of characters.
    pub const fn text(characters: &RangeInclusive<usize>) -> Self {
        ValueBounds::Text(*characters.start(), *characters.end())
    }

    /// Builds the bounds of a list from those of its length.
    pub const fn list(length: &RangeInclusive<usize>, element: &'static ValueBounds) -> Self {
        ValueBounds::List(*length.start(), *length.end(), element)
    }

    /// Builds the bounds of a list whose elements all differ.
    pub const fn set(length: &RangeInclusive<usize>, element: &'static ValueBounds) -> Self {
        ValueBounds::Set(*length.start(), *length.end(), element)
    }
}

/// A field and its bounds. If only one variant of a type has them, the field is written `variant.field`.
pub type FieldBounds = (&'static str, ValueBounds);

/// A type of requests whose fields have bounds.
pub trait Bounded {
    /// The bounds of its own fields; a field that is an object has those of its type.
    const BOUNDS: &'static [FieldBounds];
}

/// Checks that a count is allowed.
pub fn whole(field: &str, value: usize, allowed: &RangeInclusive<usize>) -> Result<(), FieldError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must lie in [{}, {}]", allowed.start(), allowed.end())))
}

/// Checks that `value` is finite and lies in `[low, high]`.
pub fn within(field: &str, value: f64, low: f64, high: f64) -> Result<(), FieldError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must be a number in [{low}, {high}]")))
}

/// Checks that `value` lies in `(low, high]`.
pub fn above(field: &str, value: f64, (low, high): (f64, f64)) -> Result<(), FieldError> {
    if value > low && value <= high {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must be a number in ({low}, {high}]")))
}

/// Checks that an interval lies in `[low, high]` and has a length.
pub fn interval(field: &str, interval: Interval, low: f64, high: f64) -> Result<(), FieldError> {
    within(&format!("{field}.min"), interval.min, low, high)?;
    within(&format!("{field}.max"), interval.max, low, high)?;
    if interval.max > interval.min {
        return Ok(());
    }
    Err(FieldError::new(format!("{field}.max"), interval.max, format!("must exceed {field}.min, {}", interval.min)))
}
