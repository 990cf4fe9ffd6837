//! Who may call what: one table, and one gate before every handler.
//!
//! Open to everybody: `/livez` and `/readyz`, which orchestrators ask without keys and which say one word; the dashboard's
//! page and files, which are the same for everybody and where a key is typed in; `/openapi.json` and `/docs`, which
//! describe a published program. Everything else tells of somebody's data, so it asks for a key: `/health` and `/metrics`
//! too, whose figures are of all tenants together. An operation that is in no line of the table is for admins alone.
//!
//! The gate refuses in this order: no key, no role, too fast, too much at a time. The first three come before a body is
//! read. An unknown or another tenant's thing is found to be so by the use cases, with one and the same 404.

use std::sync::{Arc, OnceLock};

use axum::extract::{DefaultBodyLimit, FromRequestParts, MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::extract::BodyLimit;
use super::problem::{Problem, ProblemKind};
use crate::service::Service;
use crate::service::allowance::{Class, Places, TooMany};
use crate::service::keys::{Caller, PREFIX, Turned};
use crate::store::{KeyRole, Tenant};

/// What an operation asks of who calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Open,
    /// A key with any role.
    AnyKey,
    Role(KeyRole),
}

/// What an operation asks for; `route` is `None` where nothing stands at the address.
pub fn access(method: &str, route: Option<&str>) -> Access {
    let Some(route) = route else { return Access::AnyKey };
    match (method, route) {
        (_, "/livez" | "/readyz" | "/" | "/dashboard/{file}" | "/openapi.json" | "/docs") => Access::Open,
        ("POST", "/sessions" | "/observe") | ("DELETE", "/sessions/{id}") => Access::Role(KeyRole::Operate),
        ("POST", "/train" | "/evaluate" | "/jobs/{id}/cancel" | "/policies/import")
        | ("DELETE", "/jobs/{id}" | "/policies/{id}") => Access::Role(KeyRole::Train),
        (_, "/health" | "/metrics" | "/audit") => Access::Role(KeyRole::Admin),
        ("GET" | "HEAD", _) | ("POST", "/what-if") => Access::Role(KeyRole::Read),
        _ => Access::Role(KeyRole::Admin),
    }
}

fn class(method: &str, route: Option<&str>, query: &str) -> Class {
    match (method, route.unwrap_or_default()) {
        (_, "/action") if query.contains("resolve") || query.contains("explain") => Class::Heavy,
        (_, "/action" | "/observe") | ("POST", "/sessions" | "/jobs/{id}/cancel") | ("DELETE", _) => Class::Live,
        ("POST", _) => Class::Heavy,
        _ => Class::Read,
    }
}

/// The one body that is large by nature.
const LARGE_BODY: &str = "/policies/import";

/// What the gate knows.
#[derive(Clone)]
pub struct Gate {
    pub service: Arc<Service>,
    /// Of an imported policy.
    pub large_body_bytes: usize,
    /// Of any other request.
    pub body_bytes: usize,
}

/// Whose request was answered, for those who record it: an extension of the response.
#[derive(Debug, Clone)]
pub struct Asker {
    /// Of the key shown, also where it is no longer in force; `None` where none is known.
    pub tenant: Option<Tenant>,
    /// The name of the key, which is no secret; empty where none was asked for.
    pub key: Arc<str>,
}

impl Asker {
    fn signed(tenant: Option<Tenant>, key: Arc<str>, mut response: Response) -> Response {
        response.extensions_mut().insert(Asker { tenant, key });
        response
    }
}

/// Lets a request through to its handler, with its [`Caller`] and the size its body may have.
pub async fn admit(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let (method, matched) = (request.method().as_str(), request.extensions().get::<MatchedPath>().cloned());
    let route = matched.as_ref().map(MatchedPath::as_str);
    let access = access(method, route);
    let limit = if route == Some(LARGE_BODY) { gate.large_body_bytes } else { gate.body_bytes };
    let has_body = request.method() == Method::POST;
    let class = class(method, route, request.uri().query().unwrap_or_default());
    let admitted = match access {
        Access::Open => None,
        access => match admitted(&gate.service, access, request.headers()) {
            Ok(caller) => Some(caller),
            Err((of, problem)) => return Asker::signed(of.tenant, of.key, problem.into_response()),
        },
    };
    let (mut turn, mut asker) = (None, None);
    if let Some(caller) = admitted {
        asker = Some((caller.tenant.clone(), caller.key().clone()));
        if let Err(refused) = caller.allowance.take(class) {
            return Asker::signed(Some(caller.tenant.clone()), caller.key().clone(), too_many(class, refused));
        }
        if class == Class::Heavy {
            let own = turn.insert(Turn { caller: caller.clone(), places: Arc::default() });
            if has_body {
                request.extensions_mut().insert(own.clone());
            } else if let Err(problem) = own.begin() {
                return problem.into_response();
            }
        }
        request.extensions_mut().insert(caller);
    }
    DefaultBodyLimit::max(limit).apply(&mut request);
    request.extensions_mut().insert(BodyLimit(limit));
    let response = next.run(request).await;
    drop(turn);
    match asker {
        Some((tenant, key)) => Asker::signed(Some(tenant), key, response),
        None => response,
    }
}

/// The places of a heavy call: taken once its body is there, so that whoever sends his slowly holds none; given up with
/// the answer.
#[derive(Clone)]
pub struct Turn {
    caller: Arc<Caller>,
    places: Arc<OnceLock<Places>>,
}

impl Turn {
    /// # Errors
    /// All places are taken.
    pub fn begin(&self) -> Result<(), Problem> {
        let places = self.caller.allowance.places().ok_or_else(|| {
            let detail = "as many calls that solve, train or import are under way as may be at a time";
            Problem::new(ProblemKind::Overloaded, detail)
        })?;
        self.places.get_or_init(|| places);
        Ok(())
    }
}

fn admitted(service: &Service, access: Access, headers: &HeaderMap) -> Result<Arc<Caller>, (Asker, Problem)> {
    let caller = service.keys.admit(bearer(headers)).map_err(|turned| {
        let tenant = match &turned {
            Turned::WrongKey { of } => of.clone(),
            Turned::NoKey => None,
        };
        (Asker { tenant, key: "".into() }, unauthenticated(turned))
    })?;
    match access {
        Access::Role(role) if !caller.may(role) => {
            let (role, detail) = (role.as_str(), format!("the call needs the role {}", role.as_str()));
            let rule = format!("must be a key with the role {role}");
            let shown = format!("a key with {}", caller.roles());
            let problem = Problem::new(ProblemKind::Forbidden, detail).naming("Authorization", shown, rule);
            Err((Asker { tenant: Some(caller.tenant.clone()), key: caller.key().clone() }, problem))
        }
        _ => Ok(caller),
    }
}

/// What stands after the scheme of an `Authorization: Bearer`; the scheme's name has no case (RFC 9110).
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, key) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| key.trim())
}

/// What was shown may be a key with one letter wrong, so it is not shown back.
fn unauthenticated(turned: Turned) -> Problem {
    let (detail, value) = match turned {
        Turned::NoKey => ("the call needs a key", "no key"),
        Turned::WrongKey { .. } => ("the key is not one in force", "another key"),
    };
    let rule = format!("must be `Bearer {PREFIX}...`, with a key that was made here, not revoked and not expired");
    Problem::new(ProblemKind::Unauthenticated, detail).naming("Authorization", value, rule)
}

fn too_many(class: Class, TooMany { per_second, wait }: TooMany) -> Response {
    let seconds = wait.as_secs_f64().ceil().max(1.0);
    let detail = format!("more than {per_second} {} calls in a second", class.name());
    let rule = format!("must come at most {per_second} times a second, over all keys of the tenant");
    let problem = Problem::new(ProblemKind::TooManyRequests, detail).naming("rate", class.name(), rule);
    ([(header::RETRY_AFTER, seconds.to_string())], problem).into_response()
}

/// Who calls: what the gate found.
pub struct By(pub Arc<Caller>);

impl<S: Send + Sync> FromRequestParts<S> for By {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let caller = parts.extensions.get::<Arc<Caller>>().cloned();
        // A handler whose operation the table calls open cannot know for whom it works.
        caller.map(By).ok_or_else(|| Problem::new(ProblemKind::Internal, "the call has no caller"))
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
            ("GET", None, Access::AnyKey),
        ] {
            assert_eq!(access(method, route), expected, "{method} {route:?}");
        }
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
