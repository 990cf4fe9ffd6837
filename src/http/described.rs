//! The problems of every operation, derived from its shape, the table of access and the problem table.
//!
//! A handler describes the problems that are its own, such as the 409 of a period gap; what follows from having a body,
//! a query, a path or the store is added here, so that no operation forgets it.

use std::collections::BTreeMap;

use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, OpenApi, Ref, RefOr, Response, ResponseBuilder};

use super::access::{Access, access};
use super::problem::ProblemKind;

/// Operations that touch no store and take no input: but for how they are addressed, they answer or the process is gone.
const INFALLIBLE: [&str; 4] = ["/livez", "/openapi.json", "/docs", "/"];

/// Adds what is missing; what a handler describes itself stays.
pub fn with_every_problem(description: &mut OpenApi) {
    for (path, item) in &mut description.paths.paths {
        let is_infallible = INFALLIBLE.contains(&path.as_str());
        for (method, operation) in [("GET", &mut item.get), ("POST", &mut item.post), ("DELETE", &mut item.delete)] {
            let Some(operation) = operation else { continue };
            if is_infallible {
                describe(operation, &ADDRESSED);
                continue;
            }
            let own: &[_] = if method == "GET" { &[] } else { &[ProblemKind::StorageFull] };
            if let Access::Role(role) = access(method, Some(path)) {
                guard(operation, role.as_str());
            }
            complete(operation, own);
        }
    }
    let key = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).description(Some(KEY)).build();
    let components = description.components.get_or_insert_default();
    components.add_security_scheme(SCHEME, SecurityScheme::Http(key));
}

const SCHEME: &str = "key";
const KEY: &str = "A key of `ballast keys create`. A service whose store holds none asks for none.";

/// Says that the operation asks for a key with this role, and how it refuses.
fn guard(operation: &mut Operation, role: &str) {
    operation.security = Some(vec![SecurityRequirement::new(SCHEME, [role])]);
    let titled = |kind: ProblemKind| kind.entry().2;
    let responses = [
        ("401", titled(ProblemKind::Unauthenticated).to_owned()),
        ("403", format!("{}: {role}", titled(ProblemKind::Forbidden))),
        ("429", titled(ProblemKind::TooManyRequests).to_owned()),
    ];
    for (status, meaning) in responses {
        operation.responses.responses.insert(status.into(), RefOr::T(response(&meaning)));
    }
}

fn complete(operation: &mut Operation, own: &[ProblemKind]) {
    let kinds: Vec<ProblemKind> = by_shape(operation).iter().chain(own).copied().collect();
    describe(operation, &kinds);
}

/// What every request may break: who it says is asked, and who asks.
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
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    ResponseBuilder::new().description(format!("{meaning}.")).content("application/problem+json", content).build()
}
