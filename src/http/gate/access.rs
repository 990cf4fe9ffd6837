//! Who may call what: one table, and one gate before every handler.
//!
//! Some operations are open to everybody. `/livez` and `/readyz` answer with one word, and orchestrators call them
//! without keys. The dashboard's page and files are the same for everybody, and people type their key there.
//! `/openapi.json`, the page `/docs` and the guide describe a published program. `/letter` needs the secret of a link, and
//! shows no more than that link's letter.
//! Everything else reveals somebody's data, so it needs a key. This includes `/health` and `/metrics`, whose figures
//! cover all tenants. An operation that is in no line of the table is for admins alone.
//!
//! The gate refuses in this order: not meant for this service, no key, no role. A handler then counts the call against
//! the rate limit of its class by extracting its caller. A call that comes too often is refused before its body is
//! read; too many calls at a time are refused after it.
//! The class of a call is decided by its route or its parsed parameters, never by its text. The use cases answer an
//! unknown object and another tenant's object with one and the same 404.

use std::marker::PhantomData;
use std::ops::Deref;
use std::sync::Arc;

use axum::extract::{DefaultBodyLimit, FromRequestParts, MatchedPath, OptionalFromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;

use crate::http::connection::exchanges::LocalAddress;
use crate::http::gate::bodies::Bodies;
use crate::http::gate::extract::{AfterBody, BodyLimit, LargeBody, Parameters};
use crate::http::gate::hosts::{self, Hosts};
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::Service;
use crate::service::callers::allowance::{Class, HeavyPermit, Refused};
use crate::service::callers::keys::{Caller, PREFIX, Rejected};
use crate::service::error::ServiceError;
use crate::store::{KeyRole, Tenant};

/// The key that an operation needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Open,
    /// A key with any role.
    AnyKey,
    Role(KeyRole),
}

/// Returns the access that an operation needs; `route` is `None` if there is nothing at the address.
pub fn access(method: &str, route: Option<&str>) -> Access {
    let Some(route) = route else { return Access::AnyKey };
    match (method, route) {
        (
            _,
            "/livez" | "/readyz" | "/" | "/dashboard/{file}" | "/openapi.json" | "/docs" | "/docs/{file}" | "/guide"
            | "/guide/{file}" | "/llms.txt" | "/letter",
        ) => Access::Open,
        (
            "POST",
            "/sessions"
            | "/sessions/import"
            | "/observe"
            | "/sessions/{id}/corrections"
            | "/sessions/{id}/renewals"
            | "/sessions/{id}/links"
            | "/subscriptions"
            | "/subscriptions/{id}/secret"
            | "/subscriptions/{id}/resend",
        )
        | ("DELETE", "/subscriptions/{id}" | "/links/{id}")
        | ("DELETE" | "PATCH", "/sessions/{id}") => Access::Role(KeyRole::Operate),
        ("POST", "/train" | "/evaluate" | "/backtest" | "/frontier" | "/jobs/{id}/cancel" | "/policies/import")
        | ("DELETE", "/jobs/{id}" | "/policies/{id}")
        | ("PATCH", "/policies/{id}") => Access::Role(KeyRole::Train),
        (_, "/health" | "/metrics" | "/audit") => Access::Role(KeyRole::Admin),
        ("GET" | "HEAD", "/key") => Access::AnyKey,
        ("GET" | "HEAD", _)
        | (
            "POST",
            "/what-if" | "/orders" | "/advise" | "/plan" | "/sleeve" | "/decide" | "/returns" | "/sessions/{id}/letter",
        )
        | (_, "/mcp") => Access::Role(KeyRole::Read),
        _ => Access::Role(KeyRole::Admin),
    }
}

/// The routes whose bodies are large by nature.
const LARGE_BODIES: [&str; 2] = ["/policies/import", "/sessions/import"];
/// The route whose body holds a text, and its limit in bytes: the longest text that is read, with every second letter
/// escaped.
const TEXT_BODY: (&str, usize) = ("/returns", 12_000_000);

/// The state of the gate.
#[derive(Clone)]
pub struct Gate {
    pub service: Arc<Service>,
    /// Limit on the body of an imported policy or session.
    pub large_body_bytes: usize,
    /// Limit on the body of any other request.
    pub body_bytes: usize,
    pub bodies: Bodies,
    pub hosts: Arc<Hosts>,
}

/// The caller whose request was answered, for logs and metrics: an extension of the response.
#[derive(Debug, Clone)]
pub struct Asker {
    /// The tenant of the key shown, even if the key is no longer in force; `None` if the key is unknown.
    pub tenant: Option<Tenant>,
    /// The name of the key, which is no secret; empty if no key was needed or accepted.
    pub key: Arc<str>,
}

impl Asker {
    fn signed(tenant: Option<Tenant>, key: Arc<str>, mut response: Response) -> Response {
        response.extensions_mut().insert(Asker { tenant, key });
        response
    }
}

/// Lets a request through to its handler, with its [`Call`] and its body limit.
pub async fn admit(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let matched = request.extensions().get::<MatchedPath>().cloned();
    let route = matched.as_ref().map(MatchedPath::as_str);
    if let Err(problem) = addressed(&gate, &request) {
        return problem.into_response();
    }
    let access = access(request.method().as_str(), route);
    let limit = match route {
        Some(route) if LARGE_BODIES.contains(&route) => gate.large_body_bytes,
        Some(route) if route == TEXT_BODY.0 => gate.large_body_bytes.min(TEXT_BODY.1),
        _ => gate.body_bytes,
    };
    let call = match access {
        Access::Open => None,
        access => match admitted(&gate.service, access, request.headers()) {
            Ok(caller) => Some(Call::new(caller)),
            Err(refused) => {
                let (of, problem) = *refused;
                return Asker::signed(of.tenant, of.key, problem.into_response());
            }
        },
    };
    let room = match gate.bodies.admit(&request, limit) {
        Ok(room) => room,
        Err(problem) => return answered(call, problem.into_response()),
    };
    if let Some(call) = &call {
        request.extensions_mut().insert(call.clone());
    }
    if let (Some(call), Some(_)) = (&call, &room) {
        let (decoding, tenant) = (gate.service.decoding.clone(), call.tenant.clone());
        request.extensions_mut().insert(LargeBody { decoding, tenant });
    }
    DefaultBodyLimit::max(limit).apply(&mut request);
    request.extensions_mut().insert(BodyLimit(limit));
    let response = next.run(request).await;
    drop(room);
    answered(call, response)
}

/// Ends the call; a heavy call releases its permits here and not before.
fn answered(call: Option<Call>, response: Response) -> Response {
    match call {
        Some(call) => Asker::signed(Some(call.tenant.clone()), call.key().clone(), response),
        None => response,
    }
}

/// Rejects a request whose headers say that it is not meant for this service.
fn addressed(gate: &Gate, request: &Request) -> Result<(), ProblemDocument> {
    hosts::refuse_ambiguous(request.headers())?;
    if !gate.service.keys.are_absent() {
        return Ok(());
    }
    let local = request.extensions().get::<LocalAddress>().map(|LocalAddress(local)| local.ip());
    gate.hosts.refuse_foreign(request.headers(), request.uri(), local)?;
    hosts::refuse_other_pages(request.headers(), request.method())
}

fn admitted(
    service: &Service,
    access: Access,
    headers: &HeaderMap,
) -> Result<Arc<Caller>, Box<(Asker, ProblemDocument)>> {
    let caller = service.keys.admit(bearer(headers)).map_err(|turned| {
        let tenant = match &turned {
            Rejected::WrongKey { of } => of.clone(),
            Rejected::Expired { of, .. } => Some(of.clone()),
            Rejected::NoKey => None,
        };
        Box::new((Asker { tenant, key: "".into() }, unauthenticated(turned)))
    })?;
    match access {
        Access::Role(role) if !caller.may(role) => {
            let (role, detail) = (role.as_str(), format!("the call needs the role {}", role.as_str()));
            let rule = format!("must be a key with the role {role}");
            let shown = format!("a key with the roles {}", caller.roles());
            let problem = ProblemDocument::new(ProblemKind::Forbidden, detail).naming("Authorization", shown, rule);
            Err(Box::new((Asker { tenant: Some(caller.tenant.clone()), key: caller.key().clone() }, problem)))
        }
        _ => Ok(caller),
    }
}

/// Returns the text after the scheme of an `Authorization: Bearer`; the scheme's name has no case (RFC 9110).
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, key) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| key.trim())
}

/// Returns the problem without the key shown, because that may be a valid key with one letter wrong.
fn unauthenticated(turned: Rejected) -> ProblemDocument {
    let (detail, value) = match turned {
        Rejected::NoKey => ("the call needs a key".to_owned(), "no key".to_owned()),
        Rejected::WrongKey { .. } => {
            ("the key is unknown or was revoked".to_owned(), "an unknown or revoked key".to_owned())
        }
        Rejected::Expired { expires_ms, .. } => {
            let at = jiff::Timestamp::from_millisecond(expires_ms).map_or(String::new(), |at| format!(" at {at:.0}"));
            (format!("the key expired{at}"), format!("a key that expired{at}"))
        }
    };
    let rule = format!("must be `Bearer {PREFIX}...`, with a key of this service that is neither revoked nor expired");
    ProblemDocument::new(ProblemKind::Unauthenticated, detail).naming("Authorization", value, rule)
}

/// A call let through by the gate: its caller, and the permits that it needs before heavy work.
#[derive(Debug, Clone)]
pub struct Call {
    pub caller: Arc<Caller>,
    pub turn: Arc<HeavyPermit>,
}

impl Call {
    fn new(caller: Arc<Caller>) -> Self {
        let turn = Arc::new(HeavyPermit::new(caller.allowance.clone()));
        Call { caller, turn }
    }

    /// Counts the call against the rate limit of its class.
    fn counted(self, class: Class) -> Result<Self, Refused> {
        match class {
            Class::Heavy => self.turn.count()?,
            class => self.caller.allowance.take(class)?,
        }
        Ok(self)
    }

    fn of(parts: &Parts) -> Result<Self, ProblemDocument> {
        // If the table says that an operation is open, its handler cannot get a caller.
        let call = parts.extensions.get::<Call>().cloned();
        call.ok_or_else(|| ProblemDocument::new(ProblemKind::Internal, "the call has no caller"))
    }
}

impl Deref for Call {
    type Target = Caller;

    fn deref(&self) -> &Caller {
        &self.caller
    }
}

/// A class of calls as a type, for [`CallerOf`].
pub trait Classed {
    const CLASS: Class;
}

/// See [`Class::Live`].
pub struct LiveCalls;
/// See [`Class::Heavy`].
pub struct HeavyCalls;
/// See [`Class::Read`].
pub struct ReadCalls;

impl Classed for LiveCalls {
    const CLASS: Class = Class::Live;
}

impl Classed for HeavyCalls {
    const CLASS: Class = Class::Heavy;
}

impl Classed for ReadCalls {
    const CLASS: Class = Class::Read;
}

/// The caller, once the call is counted against the rate limit of its class. A handler can get its caller only through
/// this or [`CallerAsking`], so every handler is rate-limited. Heavy calls take their permits after the body has arrived, so
/// clients that send slowly hold none.
pub struct CallerOf<C>(pub Call, pub PhantomData<C>);

impl<C: Classed, S: Send + Sync> FromRequestParts<S> for CallerOf<C> {
    type Rejection = ProblemDocument;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ProblemDocument> {
        let call = Call::of(parts)?.counted(C::CLASS).map_err(ServiceError::from)?;
        if C::CLASS == Class::Heavy {
            parts.extensions.insert(AfterBody(call.turn.clone()));
        }
        Ok(CallerOf(call, PhantomData))
    }
}

impl<C: Classed, S: Send + Sync> OptionalFromRequestParts<S> for CallerOf<C> {
    type Rejection = ProblemDocument;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Option<Self>, ProblemDocument> {
        if parts.extensions.get::<Call>().is_none() {
            return Ok(None);
        }
        <Self as FromRequestParts<S>>::from_request_parts(parts, state).await.map(Some)
    }
}

/// Query parameters that decide the class of their call.
pub trait ClassedQuery {
    fn class(&self) -> Class;
}

/// The caller and the parsed query, once the call is counted against the rate limit of the query's class. A query that
/// cannot be parsed also counts as a call.
pub struct CallerAsking<Q>(pub Call, pub Q);

impl<Q: ClassedQuery + DeserializeOwned, S: Send + Sync> FromRequestParts<S> for CallerAsking<Q> {
    type Rejection = ProblemDocument;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ProblemDocument> {
        let call = Call::of(parts)?;
        let question = Parameters::<Q>::from_request_parts(parts, state).await;
        let class = question.as_ref().map_or(Class::Read, |Parameters(question)| question.class());
        let call = call.counted(class).map_err(ServiceError::from)?;
        question.map(|Parameters(question)| CallerAsking(call, question))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changes_something_needs_more_than_read_and_what_is_in_no_line_is_for_admins() {
        for (method, route, expected) in [
            ("GET", Some("/policies"), Access::Role(KeyRole::Read)),
            ("HEAD", Some("/action"), Access::Role(KeyRole::Read)),
            ("POST", Some("/observe"), Access::Role(KeyRole::Operate)),
            ("DELETE", Some("/jobs/{id}"), Access::Role(KeyRole::Train)),
            ("GET", Some("/metrics"), Access::Role(KeyRole::Admin)),
            ("POST", Some("/of-tomorrow"), Access::Role(KeyRole::Admin)),
            ("GET", Some("/key"), Access::AnyKey),
            ("GET", None, Access::AnyKey),
        ] {
            assert_eq!(access(method, route), expected, "{method} {route:?}");
        }
    }

    /// Checks that every route for users has a line; one without would be for admins alone, and other keys would fail.
    #[test]
    fn every_operation_of_users_is_in_a_line() {
        let description = serde_json::to_value(crate::http::router::description()).unwrap();
        let mut operations = 0;
        for (path, methods) in description["paths"].as_object().unwrap() {
            for (method, operation) in methods.as_object().unwrap() {
                if operation["tags"][0] != "operations" {
                    let required = access(&method.to_uppercase(), Some(path));
                    assert_ne!(required, Access::Role(KeyRole::Admin), "{method} {path}");
                    operations += 1;
                }
            }
        }
        assert!(operations >= 20, "{operations}");
    }

    #[test]
    fn only_a_bearer_is_read() {
        let shown = |value: &str| {
            let headers = HeaderMap::from_iter([(header::AUTHORIZATION, value.parse().unwrap())]);
            bearer(&headers).map(str::to_owned)
        };
        assert_eq!(shown("Bearer abc").as_deref(), Some("abc"));
        assert_eq!(shown("bEARER  abc ").as_deref(), Some("abc"));
        assert_eq!((shown("Basic abc"), shown("abc"), bearer(&HeaderMap::new())), (None, None, None));
    }
}
