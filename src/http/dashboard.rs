//! The dashboard: files of this folder, embedded, at `/` and below `/dashboard/`.
//!
//! Plain HTML, CSS and ES modules as they stand in the repository: no framework, nothing built, nothing loaded from
//! elsewhere, so it works where the network ends at this machine. The browser may run these files and nothing else: the
//! policy below allows no inline script or style, and the modules make elements, never markup from text.

use std::sync::LazyLock;

use axum::Extension;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use super::documentation::Shared;
use super::extract::Id;
use super::problem::{Problem, ProblemKind};

const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
    font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; \
    require-trusted-types-for 'script'";
/// RFC 8631: where a program that starts at `/` finds the interface.
const LINKS: &str = "</openapi.json>; rel=\"service-desc\", </docs>; rel=\"service-doc\"";

const SCRIPT: &str = "text/javascript; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

/// One embedded file.
struct Asset {
    name: &'static str,
    media: &'static str,
    bytes: &'static [u8],
    /// Strong entity tag: the hash of the bytes. A browser asks each time and gets 304 until the binary changes.
    tag: String,
}

macro_rules! assets {
    ($($name:literal: $media:expr),+ $(,)?) => {
        [$(($name, $media, include_bytes!(concat!("dashboard/", $name)).as_slice())),+]
    };
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let files = assets! {
        "index.html": "text/html; charset=utf-8",
        "style.css": "text/css; charset=utf-8",
        "icon.svg": "image/svg+xml",
        "inter.woff2": "font/woff2",
        "inter-LICENSE.txt": TEXT,
        "advice.js": SCRIPT,
        "api.js": SCRIPT,
        "chart.js": SCRIPT,
        "dates.js": SCRIPT,
        "delimited.js": SCRIPT,
        "dom.js": SCRIPT,
        "evaluation.js": SCRIPT,
        "evaluation_asking.js": SCRIPT,
        "evaluations.js": SCRIPT,
        "form.js": SCRIPT,
        "format.js": SCRIPT,
        "heatmap.js": SCRIPT,
        "interval_chart.js": SCRIPT,
        "jobs.js": SCRIPT,
        "key.js": SCRIPT,
        "law_chart.js": SCRIPT,
        "laws.js": SCRIPT,
        "main.js": SCRIPT,
        "number_text.js": SCRIPT,
        "observe.js": SCRIPT,
        "outcomes.js": SCRIPT,
        "pages.js": SCRIPT,
        "policies.js": SCRIPT,
        "policy.js": SCRIPT,
        "problem_words.js": SCRIPT,
        "reading_sentence.js": SCRIPT,
        "return_kind.js": SCRIPT,
        "returns_field.js": SCRIPT,
        "returns_reader.js": SCRIPT,
        "session.js": SCRIPT,
        "session_opening.js": SCRIPT,
        "sessions.js": SCRIPT,
        "specification.js": SCRIPT,
        "surface.js": SCRIPT,
        "surface_picture.js": SCRIPT,
        "surface_view.js": SCRIPT,
        "surface_worker.js": SCRIPT,
        "train.js": SCRIPT,
        "what_if.js": SCRIPT,
    };
    let example: (_, _, &[u8]) =
        ("us_market_monthly.csv", "text/csv; charset=utf-8", include_bytes!("../../data/us_market_monthly.csv"));
    let asset = |(name, media, bytes)| Asset { name, media, bytes, tag: entity_tag(bytes) };
    files.into_iter().chain([example]).map(asset).collect()
});

fn entity_tag(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    let hex: String = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    format!("\"{hex}\"")
}

fn asset(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}

/// The dashboard. A program that asks for JSON and not for HTML gets the description of the interface instead.
#[utoipa::path(get, path = "/", tag = "operations",
    responses(
        (status = 200, description = "A page; the description of this interface where only JSON is accepted.", body = String, content_type = "text/html"),
        (status = 304, description = "The page is the one that `If-None-Match` names.")))]
pub async fn root(Extension(published): Extension<Shared>, headers: HeaderMap) -> Response {
    let mut response = match asset("index.html") {
        Some(page) if !wants_json(&headers) => served(page, &headers),
        _ => ([(header::CONTENT_TYPE, "application/json")], published.json.as_str()).into_response(),
    };
    response.headers_mut().insert(header::LINK, HeaderValue::from_static(LINKS));
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    response
}

fn wants_json(headers: &HeaderMap) -> bool {
    let accepted = headers.get(header::ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or("*/*");
    accepted.contains("application/json") && !accepted.contains("text/html")
}

/// A file of the dashboard.
#[utoipa::path(get, path = "/dashboard/{file}", tag = "operations", params(("file" = String, Path, description = "Its name.")),
    responses(
        (status = 200, description = "The file.", body = String, content_type = "text/javascript"),
        (status = 304, description = "The file is the one that `If-None-Match` names."),
        (status = 404, description = "There is no such file.", body = Problem, content_type = "application/problem+json")))]
pub async fn file(Id(name): Id, headers: HeaderMap) -> Result<Response, Problem> {
    let found = asset(&name).ok_or_else(|| {
        let problem = Problem::new(ProblemKind::NotFound, format!("the dashboard has no file {name}"));
        problem.naming("file", name, "must be a file of the dashboard")
    })?;
    Ok(served(found, &headers))
}

fn served(asset: &'static Asset, headers: &HeaderMap) -> Response {
    let known = headers.get(header::IF_NONE_MATCH).and_then(|tags| tags.to_str().ok());
    let unchanged =
        known.is_some_and(|tags| tags.split(',').any(|tag| tag.trim().trim_start_matches("W/") == asset.tag));
    let fixed: [(HeaderName, &str); 5] = [
        (header::CONTENT_TYPE, asset.media),
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let tag = [(header::ETAG, asset.tag.as_str())];
    if unchanged {
        return (StatusCode::NOT_MODIFIED, fixed, tag).into_response();
    }
    (fixed, tag, asset.bytes).into_response()
}
