//! Names for jobs, sessions and processes.

use rand::TryRng;
use rand::rngs::SysRng;

use crate::service::error::ServiceError;

/// Returns `prefix_` and 128 random bits from the operating system, in hexadecimal.
///
/// # Errors
/// The operating system gives no random bits.
pub fn new_id(prefix: &str) -> Result<String, ServiceError> {
    let mut bits = [0u8; 16];
    SysRng.try_fill_bytes(&mut bits).map_err(|error| ServiceError::Internal(format!("no random bits: {error}")))?;
    Ok(format!("{prefix}_{:032x}", u128::from_be_bytes(bits)))
}
