//! Names for jobs, sessions and processes, and the random bits of names and secrets.

use rand::TryRng;
use rand::rngs::SysRng;

use crate::service::error::ServiceError;

/// Returns `prefix_` and 128 random bits from the operating system, in hexadecimal.
///
/// # Errors
/// The operating system gives no random bits.
pub fn new_id(prefix: &str) -> Result<String, ServiceError> {
    Ok(format!("{prefix}_{:032x}", u128::from_be_bytes(random_bytes()?)))
}

/// Draws random bytes from the operating system.
///
/// # Errors
/// The operating system gives no random bits.
pub(in crate::service) fn random_bytes<const N: usize>() -> Result<[u8; N], ServiceError> {
    let mut bytes = [0; N];
    SysRng.try_fill_bytes(&mut bytes).map_err(|error| ServiceError::Internal(format!("no random bits: {error}")))?;
    Ok(bytes)
}
