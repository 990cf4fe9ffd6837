//! The text of keys, which is shown once and stored nowhere.

use std::fmt;

use crate::service::callers::identity::random_bytes;
use crate::service::error::ServiceError;

/// Prefix of a key, so that people and repository scanners recognise one.
pub const PREFIX: &str = "ballast_";

/// The text of a key, 256 random bits; shown once and never printed otherwise.
pub struct Secret(String);

impl Secret {
    /// Draws a new secret.
    ///
    /// # Errors
    /// The operating system gives no random bits.
    pub fn new() -> Result<Self, ServiceError> {
        Ok(Secret(format!("{PREFIX}{}", random_digits()?)))
    }

    /// Returns the text, to show it to its new owner.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

/// Draws 256 random bits, in hexadecimal.
///
/// # Errors
/// The operating system gives no random bits.
pub fn random_digits() -> Result<String, ServiceError> {
    Ok(random_bytes::<32>()?.iter().map(|byte| format!("{byte:02x}")).collect())
}

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret(..)")
    }
}
