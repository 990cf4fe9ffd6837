//! What is stored of a session as JSON.

use serde::{Deserialize, Serialize};

use super::error::ServiceError;

pub(super) fn json(of: &impl Serialize) -> Result<String, ServiceError> {
    serde_json::to_string(of).map_err(ServiceError::internal)
}

pub(super) fn read<'a, T: Deserialize<'a>>(json: &'a str) -> Result<T, ServiceError> {
    serde_json::from_str(json).map_err(ServiceError::internal)
}
