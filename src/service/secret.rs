//! The text of keys, which is shown once and kept nowhere.

use std::fmt;

use rand::TryRng;
use rand::rngs::SysRng;

use super::error::ServiceError;

/// What a key starts with, so that people and scanners of repositories know one when they see it.
pub const PREFIX: &str = "ballast_";

/// The text of a key, 256 random bits; shown once, printed by nothing else.
pub struct Secret(String);

impl Secret {
    /// # Errors
    /// The operating system gives no random bits.
    pub fn new() -> Result<Self, ServiceError> {
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| ServiceError::Internal(format!("no random bits: {error}")))?;
        let digits: String = bits.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Secret(format!("{PREFIX}{digits}")))
    }

    /// The text, to be shown to its new holder.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret(..)")
    }
}
