//! The problems of every operation, derived from its shape and the problem table.
//!
//! A handler describes the problems that are its own, such as the 409 of a period gap; what follows from having a body,
//! a query, a path or the store is added here, so that no operation forgets it.

use std::collections::BTreeMap;

use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::{ContentBuilder, OpenApi, Ref, RefOr, Response, ResponseBuilder};

use super::problem::ProblemKind;

/// Operations that touch no store and take no input: they answer or the process is gone.
const INFALLIBLE: [&str; 4] = ["/livez", "/openapi.json", "/docs", "/"];

/// Adds what is missing; what a handler describes itself stays.
pub fn with_every_problem(description: &mut OpenApi) {
    for (path, item) in &mut description.paths.paths {
        if INFALLIBLE.contains(&path.as_str()) {
            continue;
        }
        let (reads, writes) = ([&mut item.get], [&mut item.post, &mut item.delete]);
        reads.into_iter().flatten().for_each(|operation| complete(operation, &[]));
        writes.into_iter().flatten().for_each(|operation| complete(operation, &[ProblemKind::StorageFull]));
    }
}

fn complete(operation: &mut Operation, own: &[ProblemKind]) {
    let mut meanings: BTreeMap<u16, Vec<&str>> = BTreeMap::new();
    for kind in by_shape(operation).iter().chain(own) {
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
