//! The text of keys, which is shown once and stored nowhere.

use std::fmt;

use rand::TryRng;
use rand::rngs::SysRng;

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
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| ServiceError::Internal(format!("no random bits: {error}")))?;
        let digits: String = bits.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Secret(format!("{PREFIX}{digits}")))
    }

    /// Returns the text, to show it to its new owner.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret(..)")
    }
}
