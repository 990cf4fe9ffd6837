//! Idempotency keys as users send them.

use crate::control::error::FieldError;

/// Longest idempotency key taken, in bytes.
const KEY_LENGTH: usize = 255;

/// # Errors
/// The key is empty or too long.
pub(super) fn check(key: &str) -> Result<(), FieldError> {
    if (1..=KEY_LENGTH).contains(&key.len()) {
        return Ok(());
    }
    let value = format!("{} bytes", key.len());
    Err(FieldError::new("Idempotency-Key", value, format!("must hold 1 to {KEY_LENGTH} characters")))
}
