//! The problems in the description: a table of all, and the list of each operation. The list is derived from the
//! operation's shape, the access table and the problem table.
//!
//! A handler describes its own problems, such as the 409 of a period gap. Problems that follow from having a body, a
//! query, a path or the store are added here, so that no operation omits them.

use std::collections::BTreeMap;

use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, OpenApi, Ref, RefOr, Response, ResponseBuilder};

use crate::http::description::operations;
use crate::http::gate::access::{Access, access};
use crate::http::problem::ProblemKind;

/// Operations that touch no store and take no input: except for addressing problems, they cannot fail while the process
/// lives.
const INFALLIBLE: [&str; 5] = ["/livez", "/openapi.json", "/docs", "/llms.txt", "/"];

/// Adds the missing problems; those that a handler describes itself stay.
pub fn with_every_problem(description: &mut OpenApi) {
    for (path, item) in &mut description.paths.paths {
        let is_infallible = INFALLIBLE.contains(&path.as_str());
        for (method, operation) in operations(item) {
            if is_infallible {
                describe(operation, &ADDRESSED);
                continue;
            }
            let mut kinds = by_shape(operation);
            kinds.extend(by_deed(method, path));
            let access = access(method, Some(path));
            if access != Access::Open {
                kinds.extend([ProblemKind::Unauthenticated, ProblemKind::TooManyRequests]);
            }
            match access {
                Access::Open => {}
                Access::AnyKey => operation.security = Some(vec![SecurityRequirement::new(SCHEME, [""; 0])]),
                Access::Role(role) => guard(operation, role.as_str()),
            }
            describe(operation, &kinds);
        }
    }
    let information = description.info.description.get_or_insert_default();
    *information += "\n\n| type of problem | status | title |\n|---|---|---|";
    for (slug, status, title) in ProblemKind::ALL.map(ProblemKind::entry) {
        *information += &format!("\n| `/problems/{slug}` | {} | {title} |", status.as_u16());
    }
    let key = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).description(Some(KEY)).build();
    let components = description.components.get_or_insert_default();
    components.add_security_scheme(SCHEME, SecurityScheme::Http(key));
}

const SCHEME: &str = "key";
const KEY: &str = "A key made with `ballast keys create`. A service without keys requires none.";

/// Adds that the operation needs a key with this role.
fn guard(operation: &mut Operation, role: &str) {
    operation.security = Some(vec![SecurityRequirement::new(SCHEME, [role])]);
    let (_, status, title) = ProblemKind::Forbidden.entry();
    let refused = response(&format!("{title}: {role}"));
    operation.responses.responses.insert(status.as_str().into(), RefOr::T(refused));
}

/// Problems possible for every request: an invalid `Host` or `Authorization` header, or a request for another host.
const ADDRESSED: [ProblemKind; 2] = [ProblemKind::InvalidHeader, ProblemKind::Misdirected];

fn describe(operation: &mut Operation, kinds: &[ProblemKind]) {
    let mut meanings: BTreeMap<u16, Vec<&str>> = BTreeMap::new();
    for kind in kinds {
        let (_, status, title) = kind.entry();
        meanings.entry(status.as_u16()).or_default().push(title);
    }
    for (status, titles) in meanings {
        let described = operation.responses.responses.entry(status.to_string());
        described.or_insert_with(|| RefOr::T(response(&titles.join("; "))));
    }
}

/// Returns the problems that can keep an operation from writing.
fn by_deed(method: &str, path: &str) -> &'static [ProblemKind] {
    use ProblemKind as Kind;
    match (method, path) {
        ("GET", _) => &[],
        ("POST", "/train" | "/evaluate" | "/backtest" | "/frontier") => {
            &[Kind::StorageFull, Kind::QuotaExceeded, Kind::QueueFull]
        }
        ("POST", "/sessions" | "/sessions/import" | "/policies/import") | ("PATCH", _) => {
            &[Kind::StorageFull, Kind::QuotaExceeded]
        }
        _ => &[Kind::StorageFull],
    }
}

fn by_shape(operation: &Operation) -> Vec<ProblemKind> {
    use ProblemKind as Kind;
    let mut kinds = vec![Kind::Internal, Kind::Overloaded];
    kinds.extend(ADDRESSED);
    if operation.request_body.is_some() {
        kinds.extend([Kind::MalformedJson, Kind::BodyTooLarge, Kind::UnsupportedMediaType, Kind::InvalidField]);
    }
    for parameter in operation.parameters.iter().flatten() {
        match parameter {
            RefOr::T(parameter) if parameter.parameter_in == ParameterIn::Query => kinds.push(Kind::InvalidQuery),
            RefOr::T(parameter) if parameter.parameter_in == ParameterIn::Path => kinds.push(Kind::NotFound),
            _ => {}
        }
    }
    kinds.dedup();
    kinds
}

fn response(meaning: &str) -> Response {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("ProblemDocument"))).build();
    ResponseBuilder::new().description(format!("{meaning}.")).content("application/problem+json", content).build()
}
