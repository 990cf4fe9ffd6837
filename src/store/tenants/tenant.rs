//! The owners of stored things.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use crate::control::error::FieldError;

/// The name of a tenant. The default tenant owns what is made while no key is required.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tenant(Arc<str>);

const DEFAULT: &str = "default";
const LONGEST: usize = 64;

impl Tenant {
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Reads a stored name, which was checked when it was made.
    pub(in crate::store) fn stored(name: &str) -> Self {
        Tenant(name.into())
    }
}

impl Default for Tenant {
    fn default() -> Self {
        Tenant::stored(DEFAULT)
    }
}

impl FromStr for Tenant {
    type Err = FieldError;

    fn from_str(name: &str) -> Result<Self, FieldError> {
        let plain = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_' | '.');
        if (1..=LONGEST).contains(&name.len()) && name.chars().all(plain) {
            return Ok(Tenant::stored(name));
        }
        let rule = format!("must be 1 to {LONGEST} letters, digits, '-', '_' or '.'");
        Err(FieldError::new("tenant", name.escape_default(), rule))
    }
}

impl fmt::Display for Tenant {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}
