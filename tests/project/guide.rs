//! The documents of the project as the binary serves them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::support::App;
use reqwest::StatusCode;

/// Returns every text between `before` and the next quotation mark.
fn quoted(page: &str, before: &str) -> Vec<String> {
    page.split(before).skip(1).filter_map(|rest| rest.split('"').next().map(str::to_owned)).collect()
}

async fn text(app: &App, address: &str) -> String {
    let answer = app.client.get(format!("{}{address}", app.url)).send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK, "{address}");
    String::from_utf8_lossy(&answer.bytes().await.expect("a body")).into_owned()
}

#[tokio::test]
async fn every_link_of_every_page_leads_to_what_is_served() {
    let app = App::start().await;
    let start = text(&app, "/guide").await;
    let mut pages = BTreeMap::new();
    for address in quoted(&start, "<li><a href=\"").into_iter().filter(|link| link.starts_with("/guide/")) {
        let page = text(&app, &address).await;
        pages.insert(address, page);
    }
    assert_eq!(pages["/guide/start"], start);
    let named: BTreeMap<&String, BTreeSet<String>> =
        pages.iter().map(|(address, page)| (address, quoted(page, " id=\"").into_iter().collect())).collect();
    let mut served = BTreeSet::new();
    for (address, page) in &pages {
        for link in quoted(page, " href=\"").into_iter().chain(quoted(page, " src=\"")) {
            if link.starts_with("https://") {
                continue;
            }
            let (path, at) = link.split_once('#').unwrap_or((&link, ""));
            let path = if path.is_empty() { address.as_str() } else { path };
            assert!(path.starts_with('/'), "{address}: {link}");
            if !pages.contains_key(path) && served.insert(path.to_owned()) {
                text(&app, path).await;
            }
            assert!(at.is_empty() || named[&path.to_owned()].contains(at), "{address}: no heading {link}");
        }
    }
}

#[tokio::test]
async fn every_document_is_a_page_without_script() {
    let app = App::start().await;
    let start = text(&app, "/guide").await;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    for entry in std::fs::read_dir(folder).expect("the documents") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        let Some(name) = name.strip_suffix(".md") else { continue };
        assert!(start.contains(&format!("href=\"/guide/{name}\"")), "{name} is in no list");
        let page = text(&app, &format!("/guide/{name}")).await;
        assert!(page.contains("<h1") && page.contains("aria-current=\"page\"") && !page.contains("<script"), "{name}");
    }
    let (status, problem) = app.get("/guide/nothing").await;
    assert_eq!((status, &problem["field"]), (StatusCode::NOT_FOUND, &"file".into()), "{problem}");
    let answer = app.client.get(format!("{}/guide/requests", app.url)).send().await.expect("an answer");
    let policy = answer.headers()["content-security-policy"].to_str().expect("ASCII").to_owned();
    assert!(policy.contains("default-src 'none'") && !policy.contains("script-src"), "{policy}");
}

#[tokio::test]
async fn every_link_of_the_list_leads_to_markdown() {
    let app = App::start().await;
    let list = text(&app, "/llms.txt").await;
    assert!(list.starts_with("# Ballast\n\n> "), "{list}");
    let start = text(&app, "/guide").await;
    let pages: BTreeSet<String> =
        quoted(&start, "<li><a href=\"").into_iter().filter(|link| link.starts_with("/guide/")).collect();
    let lines: Vec<&str> = list.lines().filter(|line| line.starts_with("- [")).collect();
    let mut listed = BTreeSet::new();
    for line in lines {
        let (address, about) = line.split_once("](").and_then(|(_, rest)| rest.split_once("): ")).expect("a link");
        assert!(about.len() > 20 && about.len() < 300, "{line}");
        let answer = app.client.get(format!("{}{address}", app.url)).send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK, "{address}");
        assert_eq!(answer.headers()["content-type"], "text/markdown; charset=utf-8", "{address}");
        let page = answer.text().await.expect("a text");
        assert!(page.starts_with("# ") || page.starts_with("<"), "{address}: {}", &page[..40]);
        for link in links(&page) {
            let path = link.split('#').next().unwrap_or_default();
            let is_page = path.starts_with("/guide/") && path.ends_with(".md");
            assert!(
                is_page || path.is_empty() || path.starts_with("/guide/") || path.starts_with("https://"),
                "{address}: {link}"
            );
            if path.starts_with('/') {
                text(&app, path).await;
            }
        }
        listed.insert(address.trim_end_matches(".md").to_owned());
    }
    assert_eq!(listed, pages);
    assert!(listed.len() >= 20, "{listed:?}");
    let (status, problem) = app.get("/guide/nothing.md").await;
    assert_eq!((status, &problem["field"]), (StatusCode::NOT_FOUND, &"file".into()), "{problem}");
}

/// Returns the targets of the links of a text, outside its blocks of code.
fn links(page: &str) -> Vec<String> {
    let text: String = page.split("```").step_by(2).collect();
    let text: String = text.split('`').step_by(2).collect();
    text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next().map(str::to_owned)).collect()
}
