//! Whose key a call shows: for people, who hold several and see only letters.

use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;

use super::access::{By, Read};
use crate::store::KeyRole;

/// Who a call is answered to.
#[derive(Debug, Serialize, ToSchema)]
pub struct KeyHolder {
    /// The key's name, which is no secret; null where the store asks for none.
    pub key: Option<String>,
    /// Whose jobs, policies and sessions are answered.
    pub tenant: String,
    /// What the holder may do: `read`, `operate`, `train`, `admin`. Who is an admin may do all of them.
    #[schema(value_type = Vec<String>)]
    pub roles: Vec<&'static str>,
    /// When the key ends, in milliseconds since 1970; null where that is not set.
    pub expires_ms: Option<i64>,
}

/// The holder of the key that is shown.
#[utoipa::path(get, path = "/key", tag = "operations",
    responses((status = 200, description = "Who is answered, and what he may do.", body = KeyHolder)))]
pub async fn get(By(caller, _): By<Read>) -> Json<KeyHolder> {
    Json(KeyHolder {
        key: Some(caller.key().to_string()).filter(|key| !key.is_empty()),
        tenant: caller.tenant.to_string(),
        roles: KeyRole::ALL.into_iter().filter(|role| caller.may(*role)).map(KeyRole::as_str).collect(),
        expires_ms: caller.expires_ms(),
    })
}
