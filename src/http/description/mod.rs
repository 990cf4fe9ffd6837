//! The OpenAPI description: problems, bounds, defaults and schemas, and the page that shows it.

pub(super) mod bounds;
pub(super) mod defaults;
pub(super) mod documentation;
pub(super) mod problem_responses;
pub(super) mod reference;
pub(super) mod schema;
