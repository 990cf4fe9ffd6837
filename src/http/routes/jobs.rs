//! Jobs: trainings are queued; all jobs are listed, cancelled and deleted.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoResponses, ToSchema};

use crate::control::error::FieldError;
use crate::control::posed::Posed;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::declared::{DeclaredDesign, DeclaredProblem, DeclaredSpecification};
use crate::control::request::fund::FundSpecification;
use crate::control::request::specification::{
    DesignSpecification, ProblemSpecification, Specification, SurrogateSpecification, default_seed,
};
use crate::http::gate::access::{CallerOf, HeavyCalls, LiveCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBytes, Parameters};
use crate::http::gate::{bodies, decode};
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::http::routes::advise::{ProblemShape, peek_shape};
use crate::http::routes::page::{self, Page};
use crate::http::routes::wire;
use crate::service::Service;
use crate::service::error::ServiceError;
use crate::service::jobs::Accepted;
use crate::service::process::memory::Large;
use crate::store::Relabel;

/// A training: its specification, and the labels of its policy, which are no part of the specification.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Train {
    /// Decision problem of the investor.
    problem: ProblemSpecification,
    /// Assets of the fund, in a completed specification for several assets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fund: Option<Box<FundSpecification>>,
    /// States at which the surrogates are trained.
    #[serde(default)]
    design: DesignSpecification,
    /// Construction of the surrogates.
    #[serde(default)]
    surrogate: SurrogateSpecification,
    /// Seed of the training: equal specifications and seeds give equal policies, bit for bit.
    #[serde(default = "default_seed")]
    seed: u64,
    /// Name of the policy, at most 100 letters.
    name: Option<String>,
    /// Notes, at most 2,000 letters.
    notes: Option<String>,
    /// Tags: at most 20, all different, of 1 to 50 letters each.
    tags: Option<Vec<String>>,
}

/// Queues a training.
#[utoipa::path(post, path = "/train", tag = "jobs",
    request_body(content = TrainQuestion, example = json!({
        "problem": {
            "framework": "adaptive", "horizon": 12, "rate_per_step": 0.0027, "periods_per_year": 12,
            "initial_wealth": 100.0, "action_interval": [0.0, 1.0], "utility": { "kind": "power", "risk_aversion": 3.0 },
            "radius": { "rule": "bridge", "alpha": 0.1, "paths": 2000, "scale": 1.0 },
            "history": [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008]
        },
        "design": { "count": 500, "initial_laws": "given", "sampling_law": { "kind": "bootstrap" } },
        "surrogate": { "target": "floor_gain", "features": "standardized", "moment_count": 4 },
        "seed": 1
    })),
    params(("Idempotency-Key" = Option<String>, Header, description = "Repeating the key with the same body returns the same job.")),
    responses(Queueing))]
pub async fn train(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    headers: HeaderMap,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let key = idempotency_key(&headers)?;
    let (posed, labels) = match body.decoded(question).await? {
        TrainQuestion::Assets(request) => request.posed().map_err(ServiceError::from)?,
        TrainQuestion::Asset(request) => request.posed(),
        TrainQuestion::Declared(request) => request.posed(),
    };
    Ok(accepted(service.jobs.train(&caller, posed, labels, key).await?))
}

/// A training of a policy for one asset, for several, which `problem.assets` names, or for a problem that is declared in
/// formulas, with `problem.states`.
#[derive(Debug, ToSchema)]
#[serde(untagged)]
pub enum TrainQuestion {
    Asset(Box<Train>),
    Assets(Box<TrainAssets>),
    Declared(Box<TrainDeclared>),
}

/// Decodes the request by its shape, so that an error names the right field.
fn question(bytes: &[u8]) -> Result<TrainQuestion, ProblemDocument> {
    match peek_shape(bytes) {
        Some(ProblemShape { assets: Some(_), .. }) => decode::object(bytes).map(TrainQuestion::Assets),
        Some(ProblemShape { states: Some(_), .. }) => decode::object(bytes).map(TrainQuestion::Declared),
        _ => decode::object(bytes).map(TrainQuestion::Asset),
    }
}

/// A training of a policy for several assets.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainAssets {
    /// The assets and the investor.
    problem: AssetsProblem,
    /// States at which the surrogates are trained; the initial laws are resampled.
    #[serde(default)]
    design: DesignSpecification,
    /// Construction of the surrogates.
    #[serde(default)]
    surrogate: SurrogateSpecification,
    /// Seed of the training: equal requests and seeds give equal policies, bit for bit.
    #[serde(default = "default_seed")]
    seed: u64,
    /// Name of the policy, at most 100 letters.
    name: Option<String>,
    /// Notes, at most 2,000 letters.
    notes: Option<String>,
    /// Tags: at most 20, all different, of 1 to 50 letters each.
    tags: Option<Vec<String>>,
}

/// A training of a policy for a problem declared in formulas.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainDeclared {
    /// The declaration.
    problem: DeclaredProblem,
    /// States at which the surrogates are trained.
    #[serde(default)]
    design: DeclaredDesign,
    /// Construction of the surrogates.
    #[serde(default)]
    surrogate: SurrogateSpecification,
    /// Seed of the training: equal requests and seeds give equal policies, bit for bit.
    #[serde(default = "default_seed")]
    seed: u64,
    /// Name of the policy, at most 100 letters.
    name: Option<String>,
    /// Notes, at most 2,000 letters.
    notes: Option<String>,
    /// Tags: at most 20, all different, of 1 to 50 letters each.
    tags: Option<Vec<String>>,
}

impl Train {
    fn posed(self) -> (Posed, Relabel) {
        let Train { problem, fund, design, surrogate, seed, name, notes, tags } = self;
        let specification = Specification { problem, fund, design, surrogate, seed };
        (Posed::Investor(specification.into()), Relabel { name, notes, tags })
    }
}

impl TrainAssets {
    fn posed(self) -> Result<(Posed, Relabel), FieldError> {
        let TrainAssets { problem, design, surrogate, seed, name, notes, tags } = self;
        Ok((Posed::Investor(problem.training(design, surrogate, seed)?.into()), Relabel { name, notes, tags }))
    }
}

impl TrainDeclared {
    fn posed(self) -> (Posed, Relabel) {
        let TrainDeclared { problem, design, surrogate, seed, name, notes, tags } = self;
        let declared = DeclaredSpecification { problem, design, surrogate, seed };
        (Posed::Declared(declared.into()), Relabel { name, notes, tags })
    }
}

/// The answers of every call that queues a job, described here once.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "answers are built from parts; this type only describes them")]
pub enum Queueing {
    /// Queued. Poll the Location, or follow the job's events.
    #[response(status = 202, headers(
        ("Location" = String, description = "The job."),
        ("Retry-After" = u32, description = "Seconds to wait before requesting the job.")))]
    Queued(wire::AcceptedJob),
    /// The body is not JSON.
    #[response(status = 400, content_type = "application/problem+json")]
    NotJson(ProblemDocument),
    /// The key was used with another body.
    #[response(status = 409, content_type = "application/problem+json")]
    KeyConflict(ProblemDocument),
    /// A field breaks a rule.
    #[response(status = 422, content_type = "application/problem+json")]
    BrokenRule(ProblemDocument),
}

/// Returns the answer for a queued job.
pub fn accepted(accepted: Accepted) -> Response {
    let accepted = wire::AcceptedJob::from(accepted);
    let location = [(header::LOCATION, format!("/jobs/{}", accepted.job.job)), (header::RETRY_AFTER, "1".to_owned())];
    (StatusCode::ACCEPTED, location, Json(accepted)).into_response()
}

pub fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, ProblemDocument> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    value.to_str().map(|key| Some(key.to_owned())).map_err(|_| {
        let error = FieldError::new("Idempotency-Key", "not ASCII", "must be visible ASCII");
        ProblemDocument::of_field(ProblemKind::InvalidField, error)
    })
}

/// Lists jobs, newest first.
#[utoipa::path(get, path = "/jobs", tag = "jobs",
    params(("limit" = Option<usize>, Query, minimum = 1, maximum = 1000, description = "1 to 1000; default 50."),
           ("after" = Option<i64>, Query, description = "The `next` of the previous page.")),
    responses(
        (status = 200, description = "A page of jobs.", body = wire::JobPage),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Parameters(page): Parameters<Page>,
) -> Result<Response, ProblemDocument> {
    let (limit, after) = page.bounds()?;
    let room = service.room_for(page::bytes(limit)).await?;
    let jobs = service.jobs.list(&caller.tenant, limit, after).await?;
    let next = page::next(jobs.len(), limit, jobs.last().map(|job| job.row.sequence));
    let value = wire::JobPage { jobs: jobs.into_iter().map(Into::into).collect(), next };
    bodies::written(&service, Large { value, room }).await
}

/// Returns a job: its state, progress and result.
#[utoipa::path(get, path = "/jobs/{id}", tag = "jobs", params(("id" = String, Path, description = "The job.")),
    responses(
        (status = 200, description = "The job.", body = wire::Job),
        (status = 404, description = "There is no such job.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn get(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    bodies::written(&service, Large::from(wire::Job::from(service.jobs.get(&caller.tenant, &id).await?))).await
}

/// Cancels a job: always accepted, and the job stops within a second. An ended job stays as it is.
#[utoipa::path(post, path = "/jobs/{id}/cancel", tag = "jobs", params(("id" = String, Path, description = "The job.")),
    responses(
        (status = 202, description = "The job as it is now.", body = wire::Job),
        (status = 404, description = "There is no such job.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn cancel(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    let job = wire::Job::from(service.jobs.cancel(&caller, &id).await?);
    Ok((StatusCode::ACCEPTED, Json(job)).into_response())
}

/// Deletes an ended job, its report and its idempotency key; the policy that it made stays.
#[utoipa::path(delete, path = "/jobs/{id}", tag = "jobs", params(("id" = String, Path, description = "The job.")),
    responses(
        (status = 204, description = "Deleted."),
        (status = 404, description = "There is no such job.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The job is queued or running: cancel it first.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn delete(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<StatusCode, ProblemDocument> {
    service.jobs.delete(&caller, &id).await?;
    Ok(StatusCode::NO_CONTENT)
}
