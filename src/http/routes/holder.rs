//! The holder of the key that a call shows: for people who hold several keys and cannot tell them apart.

use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::store::KeyRole;

/// The caller that the key belongs to.
#[derive(Debug, Serialize, ToSchema)]
pub struct KeyHolder {
    /// Name of the key, which is no secret; null if the store needs no keys.
    pub key: Option<String>,
    /// Tenant whose jobs, policies and sessions the key reaches.
    pub tenant: String,
    /// Roles of the key: `read`, `operate`, `train`, `admin`. An admin may do everything that the others may.
    #[schema(value_type = Vec<String>)]
    pub roles: Vec<&'static str>,
    /// Expiry of the key, in milliseconds since 1970; null if it does not expire.
    pub expires_ms: Option<i64>,
}

/// Returns the holder of the key in use.
#[utoipa::path(get, path = "/key", tag = "operations",
    responses((status = 200, description = "The holder of the key, and what they may do.", body = KeyHolder)))]
pub async fn get(CallerOf(caller, _): CallerOf<ReadCalls>) -> Json<KeyHolder> {
    Json(KeyHolder {
        key: Some(caller.key().to_string()).filter(|key| !key.is_empty()),
        tenant: caller.tenant.to_string(),
        roles: KeyRole::ALL.into_iter().filter(|role| caller.may(*role)).map(KeyRole::as_str).collect(),
        expires_ms: caller.expires_ms(),
    })
}
