//! The OpenAPI description as one static page, and the table of problems; no script, nothing loaded from elsewhere.

use std::fmt::Write;
use std::sync::LazyLock;

use serde_json::Value;
use utoipa::openapi::OpenApi;

use super::problem::ProblemKind;

const HEAD: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Ballast: interface</title>\
<style>body{font:16px/1.5 system-ui;max-width:60rem;margin:2rem auto;padding:0 1rem}\
code{background:#8882;padding:0 .2em}h2{border-top:1px solid #8885;padding-top:1rem}</style>\
<h1>Ballast</h1><p>The machine-readable form is <a href=\"/openapi.json\">openapi.json</a>; \
<a href=\"/\">the dashboard</a> is made of these calls.</p>";

/// The description as it is published. Made once: anybody may ask for it, as often as he likes.
pub struct Published {
    /// As checked in under `api/openapi.json`.
    pub json: String,
    /// As a page to read.
    pub page: String,
}

/// What the router hands to those of its handlers that publish the description of all of them.
pub type Shared = &'static LazyLock<Published>;

impl Published {
    pub fn of(description: &OpenApi) -> Self {
        Published { json: description.to_pretty_json().unwrap_or_default() + "\n", page: page(description) }
    }
}

fn page(description: &OpenApi) -> String {
    let description = serde_json::to_value(description).unwrap_or_default();
    let mut page = String::from(HEAD);
    for (path, operations) in members(&description["paths"]) {
        for (method, operation) in members(operations) {
            operation_section(&mut page, method, path, operation);
        }
    }
    page.push_str("<h2>Problems</h2><ul>");
    for (slug, status, title) in ProblemKind::ALL.map(ProblemKind::entry) {
        // Writing to a string cannot fail.
        let _ = write!(page, "<li><code>/problems/{slug}</code> {}: {}", status.as_u16(), escaped(title));
    }
    page.push_str("</ul></html>");
    page
}

fn operation_section(page: &mut String, method: &str, path: &str, operation: &Value) {
    let summary = escaped(operation["summary"].as_str().unwrap_or_default());
    let _ = write!(page, "<h2><code>{} {}</code></h2><p>{summary}</p><ul>", method.to_uppercase(), escaped(path));
    for parameter in operation["parameters"].as_array().into_iter().flatten() {
        let name = escaped(parameter["name"].as_str().unwrap_or_default());
        let meaning = escaped(parameter["description"].as_str().unwrap_or_default());
        let _ = write!(page, "<li><code>{name}</code> {meaning}");
    }
    for (status, response) in members(&operation["responses"]) {
        let meaning = escaped(response["description"].as_str().unwrap_or_default());
        let _ = write!(page, "<li>{status}: {meaning}");
    }
    page.push_str("</ul>");
}

fn members(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flatten()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
