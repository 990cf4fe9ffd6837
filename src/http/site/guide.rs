//! The documents of this project as a site, embedded, at `/guide` and below `/guide/`.
//!
//! The pages are the Markdown files of the repository, turned into HTML at the first request. So they describe the
//! running version, and can be read on a machine without a network. Programs read the same pages as Markdown, and
//! `/llms.txt` lists them.

use std::sync::LazyLock;

use axum::http::HeaderMap;
use axum::response::Response;

use crate::http::gate::extract::Id;
use crate::http::problem::ProblemDocument;
use crate::http::site::asset::{Asset, HTML, MARKDOWN, STYLE};

mod markdown;
mod page;

/// The policy of the pages, which allows no script at all.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; style-src 'self'; img-src 'self'; font-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// One page: its name in the address, its title in the list of pages, its path in the repository, and its text.
struct GuidePage {
    name: &'static str,
    title: &'static str,
    path: &'static str,
    text: &'static str,
}

macro_rules! documents {
    ($($part:literal: [$($name:literal $title:literal $path:literal),+ $(,)?]),+ $(,)?) => {
        &[$(($part, &[$(GuidePage {
            name: $name,
            title: $title,
            path: $path,
            text: include_str!(concat!("../../../", $path)),
        }),+])),+]
    };
}

/// The pages by part, in the order of the list; the first is the start page.
const PARTS: &[(&str, &[GuidePage])] = documents! {
    "Start": [
        "start" "What it is" "README.md",
        "first-advice" "First advice on your own data" "docs/first-advice.md",
    ],
    "Concepts": [
        "concepts" "What it does, in four pictures" "docs/concepts.md",
        "choosing" "Choosing what to ask" "docs/choosing.md",
        "glossary" "Words" "docs/glossary.md",
        "results" "What it earned and cost" "docs/results.md",
        "beside" "Compared with other tools" "docs/beside.md",
    ],
    "How to": [
        "plan" "Plan what to spend" "docs/plan.md",
        "sleeve" "Size a strategy" "docs/sleeve.md",
        "letters" "Write letters to clients" "docs/letters.md",
        "backtest" "Run a walk-forward" "docs/backtest.md",
        "evaluation" "Evaluate a policy" "docs/evaluation.md",
        "declared" "Solve a problem of your own" "docs/declared.md",
        "templates" "Start from one of eight problems" "docs/templates.md",
        "python" "Use it from Python" "clients/python/README.md",
        "agents" "Use it from an agent" "docs/agents.md",
        "subscriptions" "Be told of events" "docs/subscriptions.md",
        "keys" "Give out keys" "docs/keys.md",
        "operating" "Operate it" "docs/operating.md",
        "replicas" "Run replicas" "docs/replicas.md",
        "capacity" "Plan the capacity" "docs/capacity.md",
    ],
    "Reference": [
        "requests" "Every request and field" "docs/requests.md",
        "problem" "The fields of a problem" "docs/problem.md",
        "sessions" "Sessions" "docs/sessions.md",
        "policy-format" "The format of a policy" "docs/policy-format.md",
        "walk-through" "From a call to the code" "docs/walk-through.md",
        "paper-to-code" "From the paper to the code" "docs/paper-to-code.md",
        "measurements" "Measurements" "docs/measurements.md",
        "threat-model" "Threat model" "docs/threat-model.md",
        "extending" "Extending it" "docs/extending.md",
        "contributing" "Changing it" "CONTRIBUTING.md",
    ],
};

fn documents() -> impl Iterator<Item = &'static GuidePage> {
    PARTS.iter().flat_map(|(_, documents)| documents.iter())
}

static PAGES: LazyLock<Vec<Asset>> =
    LazyLock::new(|| documents().map(|document| Asset::new((document.name, HTML, page::made(document)))).collect());

static MARKDOWN_PAGES: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let name = |document: &GuidePage| &*format!("{}.md", document.name).leak();
    documents().map(|document| Asset::new((name(document), MARKDOWN, markdown::made(document).as_bytes()))).collect()
});

/// Returns the name and the title of every page.
pub fn titles() -> impl Iterator<Item = (&'static str, &'static str)> {
    documents().map(|document| (document.name, document.title))
}

/// Returns a page as Markdown; `None` if there is no page of this name.
pub fn markdown(name: &str) -> Option<&'static str> {
    let page = documents().zip(MARKDOWN_PAGES.iter()).find(|(document, _)| document.name == name);
    page.and_then(|(_, page)| std::str::from_utf8(page.bytes()).ok())
}

static LIST: LazyLock<Asset> = LazyLock::new(|| Asset::new(("llms.txt", MARKDOWN, markdown::list().leak().as_bytes())));

/// The policy of a picture that has its own colours for light and dark.
const DRAWING_SECURITY_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'";

macro_rules! pictures {
    ($media:literal: $($name:literal),+) => {
        [$(($name, $media, include_bytes!(concat!("../../../docs/images/", $name)).as_slice())),+]
    };
}

static FILES: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let pictures =
        pictures!["image/png": "backtest.png", "industries.png", "policy.png", "reproduction.png", "session.png"];
    let drawings = pictures!["image/svg+xml": "ball.svg", "band.svg", "worst-law.svg", "worst-moves.svg"];
    let style = ("guide.css", STYLE, include_bytes!("guide/guide.css").as_slice());
    pictures.into_iter().chain(drawings).chain([style]).map(Asset::new).collect()
});

/// Serves the guide: its first page, and the list of all pages.
#[utoipa::path(get, path = "/guide", tag = "operations",
    responses(
        (status = 200, description = "A page.", body = String, content_type = "text/html"),
        (status = 304, description = "The page still matches `If-None-Match`.")))]
pub async fn start(headers: HeaderMap) -> Response {
    PAGES[0].served(CONTENT_SECURITY_POLICY, &headers)
}

/// Lists the pages of the guide for language models (llmstxt.org), as Markdown.
#[utoipa::path(get, path = "/llms.txt", tag = "operations",
    responses(
        (status = 200, description = "The list.", body = String, content_type = "text/markdown"),
        (status = 304, description = "The list still matches `If-None-Match`.")))]
pub async fn llms(headers: HeaderMap) -> Response {
    LIST.served(CONTENT_SECURITY_POLICY, &headers)
}

/// Serves a page of the guide, or a picture. With `.md` after its name a page is Markdown.
#[utoipa::path(get, path = "/guide/{file}", tag = "operations", params(("file" = String, Path, description = "The name of the page or picture.")),
    responses(
        (status = 200, description = "The page or the picture.", body = String, content_type = "text/html"),
        (status = 304, description = "The file still matches `If-None-Match`."),
        (status = 404, description = "There is no such page.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn file(Id(name): Id, headers: HeaderMap) -> Result<Response, ProblemDocument> {
    let files: &[Asset] = match name.rsplit_once('.') {
        None => &PAGES,
        Some((_, "md")) => &MARKDOWN_PAGES,
        Some(_) => &FILES,
    };
    let policy = if name.ends_with(".svg") { DRAWING_SECURITY_POLICY } else { CONTENT_SECURITY_POLICY };
    Ok(Asset::find(files, &name, "the guide")?.served(policy, &headers))
}
