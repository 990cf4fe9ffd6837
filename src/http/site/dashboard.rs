//! The dashboard: the files of this folder, embedded, at `/` and below `/dashboard/`.
//!
//! Plain HTML, CSS and ES modules: no framework, no build, nothing loaded from elsewhere. So it works on a machine without
//! a network. `main.js` is served with all that it imports in one script, so that a first visit takes few requests. The
//! browser may run only these files: the policy below allows no inline script or style, and the modules create elements.
//! The one text that they parse as markup is a letter of the service, through a policy of trusted types that only
//! `letters.js` may have. A letter holds its logo as a `data:` address.

use std::sync::LazyLock;

use axum::Extension;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;

use crate::http::description::documentation::Published;
use crate::http::gate::extract::Id;
use crate::http::problem::ProblemDocument;
use crate::http::routes::operations;
use crate::http::site::asset::{Asset, HTML, SCRIPT, STYLE, TEXT};
use crate::report;

const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' data:; font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'; require-trusted-types-for 'script'; trusted-types ballast-letter";
/// Link headers by which a program that starts at `/` finds the interface (RFC 8631).
const LINKS: &str = "</openapi.json>; rel=\"service-desc\", </docs>; rel=\"service-doc\"";

macro_rules! assets {
    ($($name:literal: $media:expr),+ $(,)?) => {
        [$(($name, $media, include_bytes!(concat!("dashboard/", $name)).as_slice())),+]
    };
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let files = assets! {
        "index.html": HTML,
        "letter.css": STYLE,
        "lists.css": STYLE,
        "present.css": STYLE,
        "print.css": STYLE,
        "style.css": STYLE,
        "icon.svg": "image/svg+xml",
        "inter.woff2": "font/woff2",
        "inter-LICENSE.txt": TEXT,
        "advice.js": SCRIPT,
        "advise.js": SCRIPT,
        "advised.js": SCRIPT,
        "api.js": SCRIPT,
        "backtest.js": SCRIPT,
        "backtest_asking.js": SCRIPT,
        "backtest_assets.js": SCRIPT,
        "backtest_figures.js": SCRIPT,
        "bank_rate.js": SCRIPT,
        "beside.js": SCRIPT,
        "care.js": SCRIPT,
        "chart.js": SCRIPT,
        "comparators.js": SCRIPT,
        "compare.js": SCRIPT,
        "compare_policies.js": SCRIPT,
        "compare_sessions.js": SCRIPT,
        "comparison.js": SCRIPT,
        "correction.js": SCRIPT,
        "course.js": SCRIPT,
        "csv.js": SCRIPT,
        "declare.js": SCRIPT,
        "declared_asking.js": SCRIPT,
        "declared_policy.js": SCRIPT,
        "declared_session.js": SCRIPT,
        "declared_walk.js": SCRIPT,
        "dom.js": SCRIPT,
        "doubts.js": SCRIPT,
        "draft.js": SCRIPT,
        "evaluation.js": SCRIPT,
        "evaluation_asking.js": SCRIPT,
        "evaluations.js": SCRIPT,
        "file_drop.js": SCRIPT,
        "firm.js": SCRIPT,
        "flows.js": SCRIPT,
        "form.js": SCRIPT,
        "frontier.js": SCRIPT,
        "futures.js": SCRIPT,
        "format.js": SCRIPT,
        "heatmap.js": SCRIPT,
        "histogram.js": SCRIPT,
        "holder.js": SCRIPT,
        "interval_chart.js": SCRIPT,
        "job_report.js": SCRIPT,
        "jobs.js": SCRIPT,
        "key.js": SCRIPT,
        "law_chart.js": SCRIPT,
        "letter_links.js": SCRIPT,
        "letters.js": SCRIPT,
        "main.js": SCRIPT,
        "market_terms.js": SCRIPT,
        "money.js": SCRIPT,
        "money_today.js": SCRIPT,
        "naming.js": SCRIPT,
        "number_text.js": SCRIPT,
        "observe.js": SCRIPT,
        "observed.js": SCRIPT,
        "own_benchmark.js": SCRIPT,
        "own_formula.js": SCRIPT,
        "pages.js": SCRIPT,
        "peers.js": SCRIPT,
        "periods.js": SCRIPT,
        "picture.js": SCRIPT,
        "plan.js": SCRIPT,
        "plan_answer.js": SCRIPT,
        "policies.js": SCRIPT,
        "policy.js": SCRIPT,
        "policy_map.js": SCRIPT,
        "present.js": SCRIPT,
        "problem_words.js": SCRIPT,
        "renewal_due.js": SCRIPT,
        "renewing.js": SCRIPT,
        "report_fields.js": SCRIPT,
        "report_file.js": SCRIPT,
        "report_lines.js": SCRIPT,
        "report_tables.js": SCRIPT,
        "report_title.js": SCRIPT,
        "reporting.js": SCRIPT,
        "reproduction.js": SCRIPT,
        "returns_field.js": SCRIPT,
        "sample_book.js": SCRIPT,
        "sensitivity.js": SCRIPT,
        "several.js": SCRIPT,
        "several_fields.js": SCRIPT,
        "session.js": SCRIPT,
        "session_opening.js": SCRIPT,
        "session_rows.js": SCRIPT,
        "sessions.js": SCRIPT,
        "share_limits.js": SCRIPT,
        "share_prices.js": SCRIPT,
        "sleeve.js": SCRIPT,
        "sleeve_answer.js": SCRIPT,
        "specification.js": SCRIPT,
        "stacked.js": SCRIPT,
        "strategies.js": SCRIPT,
        "subscriptions.js": SCRIPT,
        "surface_view.js": SCRIPT,
        "tear_sheet.js": SCRIPT,
        "ticking.js": SCRIPT,
        "track.js": SCRIPT,
        "track_view.js": SCRIPT,
        "trades.js": SCRIPT,
        "train.js": SCRIPT,
        "train_fields.js": SCRIPT,
        "verdict.js": SCRIPT,
        "welcome.js": SCRIPT,
        "what_if.js": SCRIPT,
        "worklist.js": SCRIPT,
        "worst_market.js": SCRIPT,
    };
    let example: (_, _, &[u8]) =
        ("us_market_monthly.csv", "text/csv; charset=utf-8", include_bytes!("../../../data/us_market_monthly.csv"));
    files.into_iter().chain([example]).map(Asset::new).collect()
});

/// The script of the page. `tests/project/dashboard.rs` checks that all modules can be joined.
static SCRIPT_OF_PAGE: LazyLock<Asset> = LazyLock::new(|| {
    let script =
        report::joined(embedded, &[MAIN]).unwrap_or_else(|error| format!("throw Error({:?});", error.to_string()));
    Asset::new((MAIN, SCRIPT, script.leak().as_bytes()))
});
const MAIN: &str = "main.js";

fn asset(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}

/// Returns the bytes of a file of the dashboard; a standalone report is drawn by the same modules.
pub fn embedded(name: &str) -> Option<&'static [u8]> {
    asset(name).map(Asset::bytes)
}

/// Serves the dashboard. A program that accepts JSON and not HTML gets the description of the interface instead.
#[utoipa::path(get, path = "/", tag = "operations",
    responses(
        (status = 200, description = "The dashboard, or the OpenAPI description if the client accepts only JSON.", body = String, content_type = "text/html"),
        (status = 304, description = "The page still matches `If-None-Match`.")))]
pub async fn root(Extension(published): Extension<Published>, headers: HeaderMap) -> Response {
    let mut response = match asset("index.html") {
        Some(page) if !wants_json(&headers) => page.served(CONTENT_SECURITY_POLICY, &headers),
        _ => operations::description(published),
    };
    response.headers_mut().insert(header::LINK, HeaderValue::from_static(LINKS));
    response.headers_mut().append(header::VARY, HeaderValue::from_static("accept"));
    response
}

fn wants_json(headers: &HeaderMap) -> bool {
    let accepted = headers.get(header::ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or("*/*");
    accepted.contains("application/json") && !accepted.contains("text/html")
}

/// Serves a file of the dashboard, and `main.js` with all that it imports.
#[utoipa::path(get, path = "/dashboard/{file}", tag = "operations", params(("file" = String, Path, description = "The name of the file.")),
    responses(
        (status = 200, description = "The file.", body = String, content_type = "text/javascript"),
        (status = 304, description = "The file still matches `If-None-Match`."),
        (status = 404, description = "There is no such file.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn file(Id(name): Id, headers: HeaderMap) -> Result<Response, ProblemDocument> {
    let file = Asset::find(&ASSETS, &name, "the dashboard")?;
    Ok(if name == MAIN { &SCRIPT_OF_PAGE } else { file }.served(CONTENT_SECURITY_POLICY, &headers))
}
