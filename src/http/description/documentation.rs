//! The OpenAPI description as a page: Swagger UI, embedded, at `/docs` and below `/docs/`.
//!
//! It works on a machine without a network. The files of Swagger UI come with the crate `utoipa-swagger-ui`. The page
//! that loads them is our own, so that it has one address and loads no more than it shows.

use std::borrow::Cow;
use std::sync::{Arc, LazyLock};

use axum::http::HeaderMap;
use axum::response::Response;

use crate::http::gate::extract::Id;
use crate::http::problem::ProblemDocument;
use crate::http::site::asset::{Asset, HTML, SCRIPT, STYLE};

/// The OpenAPI description, as checked in under `api/openapi.json`, for the handlers that publish it. It is made once,
/// because anybody may request it at any rate.
pub type Published = &'static LazyLock<String>;

/// The dashboard's content security policy, except that Swagger UI has pictures in its style sheet and makes markup from
/// text, which it sanitises.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

static PAGE: LazyLock<Asset> =
    LazyLock::new(|| Asset::new(("index.html", HTML, include_bytes!("documentation/index.html"))));

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let ours = [
        Asset::new(("page.css", STYLE, include_bytes!("documentation/page.css"))),
        Asset::new(("start.js", SCRIPT, include_bytes!("documentation/start.js"))),
    ];
    let theirs = [("swagger-ui.css", STYLE), ("swagger-ui-bundle.js", SCRIPT)];
    theirs.into_iter().filter_map(|(name, media)| embedded(name, media)).chain(ours).collect()
});

/// Returns a file of Swagger UI, compressed as the crate stores it.
fn embedded(name: &'static str, media: &'static str) -> Option<Asset> {
    let file = utoipa_swagger_ui::serve(name, Arc::default()).ok()??;
    let Cow::Borrowed(bytes) = file.bytes else { return None };
    let asset = Asset::new((name, media, bytes));
    Some(if file.gzpipped { asset.compressed() } else { asset })
}

/// Serves this interface as a page to read and to try: calls with their parameters, bodies, defaults and examples.
#[utoipa::path(get, path = "/docs", tag = "operations",
    responses(
        (status = 200, description = "The page.", body = String, content_type = "text/html"),
        (status = 304, description = "The page still matches `If-None-Match`.")))]
pub async fn docs(headers: HeaderMap) -> Response {
    PAGE.served(CONTENT_SECURITY_POLICY, &headers)
}

/// Serves a file of the page `/docs`.
#[utoipa::path(get, path = "/docs/{file}", tag = "operations", params(("file" = String, Path, description = "The name of the file.")),
    responses(
        (status = 200, description = "The file.", body = String, content_type = "text/javascript"),
        (status = 304, description = "The file still matches `If-None-Match`."),
        (status = 404, description = "There is no such file.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn docs_file(Id(name): Id, headers: HeaderMap) -> Result<Response, ProblemDocument> {
    Ok(Asset::find(&ASSETS, &name, "the page /docs")?.served(CONTENT_SECURITY_POLICY, &headers))
}
