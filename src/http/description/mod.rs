//! The OpenAPI description: problems, bounds, defaults and schemas, and the page that shows it.

pub(super) mod bounds;
pub(super) mod defaults;
pub(super) mod documentation;
pub(super) mod identifiers;
pub(super) mod problem_responses;
pub(super) mod reference;
pub(super) mod schema;

use utoipa::openapi::PathItem;
use utoipa::openapi::path::Operation;

/// Returns the operations at a path, with their methods.
fn operations(item: &mut PathItem) -> impl Iterator<Item = (&'static str, &mut Operation)> {
    let PathItem { get, post, patch, delete, .. } = item;
    let all = [("GET", get), ("POST", post), ("PATCH", patch), ("DELETE", delete)];
    all.into_iter().filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}
