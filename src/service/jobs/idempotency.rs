//! Idempotency keys as users send them.

use crate::control::error::FieldError;
use crate::control::request::text::check_text;

/// The most characters of an idempotency key.
const KEY_LENGTH: usize = 255;

/// Checks an idempotency key.
///
/// # Errors
/// The key is empty, too long or has a control character.
pub(in crate::service) fn check(key: &str) -> Result<(), FieldError> {
    check_text("Idempotency-Key", key, 1..=KEY_LENGTH, &[])
}
