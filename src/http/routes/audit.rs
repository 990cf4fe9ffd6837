//! Who did what, for admins: over all tenants, like `/health` and `/metrics`.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::Parameters;
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::http::routes::page::{self, Page};
use crate::service::Service;
use crate::service::process::memory::Large;
use crate::store::{AuditFilter, AuditRow};

/// Query parameters, as text.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AuditQuery {
    limit: Option<String>,
    after: Option<String>,
    tenant: Option<String>,
    object: Option<String>,
}

/// One recorded action.
#[derive(Debug, Serialize, ToSchema)]
pub struct AuditEntry {
    /// Time of the action, in milliseconds since 1970.
    pub at_ms: i64,
    pub tenant: String,
    /// Name of the key; null if no key was needed, or if a command on the store did it.
    pub key: Option<String>,
    /// Roles of the key. `anybody` if no key was needed, `operator` for a command on the store, or `service`. Empty for
    /// `session.observe`, because an observation keeps only the name of the key.
    pub roles: String,
    #[schema(example = "session.delete")]
    pub action: String,
    /// The object of the action.
    pub object: String,
    /// Result of the action.
    #[schema(example = "deleted, with 12 entries")]
    pub outcome: String,
    /// Number of the entry, from 1, among those of its key in this tenant. For `session.observe`, among those of its
    /// session.
    pub number: i64,
    /// SHA-256 over the entry and the seal of the entry before it, in hexadecimal digits. A saved copy proves later
    /// that this entry and all before it are unchanged.
    pub seal: String,
}

/// A page of the audit log, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct AuditPage {
    pub entries: Vec<AuditEntry>,
    /// Cursor to pass as `after` for the next page; null on the last page.
    pub next: Option<i64>,
}

impl From<AuditRow> for AuditEntry {
    fn from(row: AuditRow) -> Self {
        AuditEntry {
            at_ms: row.at_ms,
            tenant: row.tenant.to_string(),
            key: Some(row.key).filter(|key| !key.is_empty()),
            roles: row.roles,
            action: row.deed,
            object: row.object,
            outcome: row.outcome,
            number: row.number,
            seal: row.seal,
        }
    }
}

/// Lists who did what, newest first, over all tenants.
#[utoipa::path(get, path = "/audit", tag = "operations",
    params(("limit" = Option<usize>, Query, minimum = 1, maximum = 1000, description = "1 to 1000; default 50."),
           ("after" = Option<i64>, Query, description = "The `next` of the previous page."),
           ("tenant" = Option<String>, Query, description = "Only entries of this tenant."),
           ("object" = Option<String>, Query, description = "Only entries about this session, job, policy or key. For a session, the first page also shows its observations.")),
    responses(
        (status = 200, description = "A page of the audit.", body = AuditPage),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(_admin, _): CallerOf<ReadCalls>,
    Parameters(ask): Parameters<AuditQuery>,
) -> Result<Response, ProblemDocument> {
    let (limit, after) = Page::new(ask.limit, ask.after).bounds()?;
    let room = service.room_for(page::bytes(limit)).await?;
    let tenant = ask.tenant.map(|name| name.parse()).transpose();
    let tenant = tenant.map_err(|error| ProblemDocument::of_field(ProblemKind::InvalidQuery, error))?;
    let rows = service.audit.list(&AuditFilter { tenant, object: ask.object }, limit, after).await?;
    let mut entries = rows.iter().filter(|row| row.sequence > 0);
    let next = page::next(entries.clone().count(), limit, entries.next_back().map(|row| row.sequence));
    let value = AuditPage { entries: rows.into_iter().map(Into::into).collect(), next };
    bodies::written(&service, Large { value, room }).await
}
