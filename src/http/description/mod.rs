//! The OpenAPI description: problems, bounds, defaults and schemas, and the page that shows it.

pub(super) mod bounds;
pub(super) mod defaults;
pub(super) mod described;
pub(super) mod documentation;
pub(super) mod schema;
