//! The identifiers of operations, which programs that are generated from the description call their functions.

use utoipa::openapi::OpenApi;

use crate::http::description::operations;

/// Gives every operation an identifier of its own, from its method and path: `get_sessions_id` for `GET /sessions/{id}`.
/// OpenAPI asks for unique identifiers, and several handlers have the same name.
pub fn tell(description: &mut OpenApi) {
    for (path, item) in &mut description.paths.paths {
        for (method, operation) in operations(item) {
            let method = method.to_lowercase();
            let words = path.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
            let identifier = std::iter::once(&*method).chain(words).collect::<Vec<&str>>().join("_");
            operation.operation_id = Some(identifier);
        }
    }
}
