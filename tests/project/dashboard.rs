//! The files of the dashboard and of the page `/docs`: all of them are served, as what they are, and can do no more than
//! they must.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;

use crate::support::App;
use flate2::read::GzDecoder;
use reqwest::StatusCode;
use reqwest::header::{ACCEPT, ACCEPT_ENCODING, ETAG, IF_NONE_MATCH};
use serde_json::{Value, json};

fn files() -> BTreeMap<String, Vec<u8>> {
    files_of("src/http/site/dashboard")
}

fn files_of(folder: &str) -> BTreeMap<String, Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let read = |entry: std::fs::DirEntry| {
        (entry.file_name().into_string().expect("UTF-8"), std::fs::read(entry.path()).expect("a file"))
    };
    std::fs::read_dir(folder).expect("the folder").map(|entry| read(entry.expect("an entry"))).collect()
}

fn media(name: &str) -> &'static str {
    match name.rsplit('.').next().expect("an extension") {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        "woff2" => "font/woff2",
        "txt" => "text/plain; charset=utf-8",
        other => panic!("a file of the dashboard ends in {other}"),
    }
}

/// Asks for a file twice, the second time as one who has it; its policy.
async fn served(app: &App, address: &str, name: &str, bytes: &[u8]) -> String {
    let address = format!("{}{address}", app.url);
    let answer = app.client.get(&address).send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK, "{name} is not in the table of assets");
    let headers = answer.headers().clone();
    assert_eq!(headers["content-type"], media(name), "{name}");
    assert_eq!(headers["x-content-type-options"], "nosniff", "{name}");
    assert_eq!(headers["cache-control"], "no-cache", "{name}");
    assert_eq!(answer.bytes().await.expect("bytes"), bytes, "{name}");
    let again = app.client.get(&address).header(IF_NONE_MATCH, &headers[ETAG]).send().await.expect("an answer");
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED, "{name}");
    assert_eq!(again.headers()[ETAG], headers[ETAG], "{name}");
    headers["content-security-policy"].to_str().expect("text").to_owned()
}

/// The modules that a report alone needs.
const OF_REPORTS: [&str; 2] = ["report_file.js", "reproduction.js"];

/// A browser asks for one script, and what it decodes it gets compressed.
#[tokio::test(flavor = "multi_thread")]
async fn the_page_has_one_script_and_its_text_is_compressed() {
    let app = App::start().await;
    let fetched = async |address: &str, coding: &str| {
        let request = app.client.get(format!("{}{address}", app.url)).header(ACCEPT_ENCODING, coding);
        let answer = request.send().await.expect("an answer");
        (answer.headers().clone(), answer.bytes().await.expect("bytes"))
    };
    let page = String::from_utf8(files()["index.html"].clone()).expect("UTF-8");
    let loaded = page.split("=\"/dashboard/").skip(1).filter_map(|rest| rest.split('"').next());
    let loaded: BTreeSet<String> = loaded.map(|name| format!("/dashboard/{name}")).collect();
    assert!(loaded.contains("/dashboard/main.js") && loaded.len() < 10, "{loaded:?}");
    let mut bytes = 0;
    for address in loaded.iter().map(String::as_str).chain(["/"]) {
        let (headers, plain) = fetched(address, "gzip;q=0, br").await;
        assert!(headers.get("content-encoding").is_none(), "{address}");
        let (coded, packed) = fetched(address, "br, gzip").await;
        assert!(headers.get_all("vary").iter().any(|vary| vary == "accept-encoding"), "{address}");
        bytes += packed.len();
        if coded.get("content-encoding").is_none() {
            assert_eq!((&packed, &coded[ETAG]), (&plain, &headers[ETAG]), "{address}");
            continue;
        }
        let mut unpacked = Vec::new();
        GzDecoder::new(packed.as_ref()).read_to_end(&mut unpacked).expect("a gzip");
        assert!(unpacked == plain && packed.len() < plain.len(), "{address}");
        assert_ne!(coded[ETAG], headers[ETAG], "{address}: a strong tag is that of the bytes");
        let again = app.client.get(format!("{}{address}", app.url)).header(ACCEPT_ENCODING, "gzip");
        let again = again.header(IF_NONE_MATCH, &coded[ETAG]).send().await.expect("an answer");
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED, "{address}");
    }
    assert!(bytes < 300_000, "a first visit loads {bytes} bytes");
    let script = String::from_utf8(fetched("/dashboard/main.js", "").await.1.to_vec()).expect("UTF-8");
    let script = format!("\n{script}");
    for name in files().keys().filter(|name| name.ends_with(".js") && !OF_REPORTS.contains(&name.as_str())) {
        assert_eq!(script.matches(&format!("\n// {name}\n")).count(), 1, "{name}");
    }
    assert!(!script.contains("</script"), "a report holds the modules within its page");
}

/// The address of a page without its `#`, as people type it, leads there in a browser; a program is told that there is nothing.
#[tokio::test(flavor = "multi_thread")]
async fn a_browser_at_an_unknown_path_is_sent_to_the_page_of_that_name() {
    let app = App::start().await;
    let client = reqwest::Client::builder().redirect(reqwest::redirect::Policy::none()).build().expect("a client");
    let ask = |accept: &'static str| client.get(format!("{}/report", app.url)).header(ACCEPT, accept).send();
    let answer = ask("text/html,application/xhtml+xml,*/*;q=0.8").await.expect("an answer");
    assert_eq!(
        (answer.status(), &answer.headers()["location"]),
        (StatusCode::SEE_OTHER, &"/#/report".parse().unwrap())
    );
    let answer = ask("*/*").await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::NOT_FOUND);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_file_is_served_as_what_it_is_under_a_strict_policy() {
    let app = App::start().await;
    let files = files();
    assert!(files.contains_key("index.html") && files.contains_key("main.js"), "{:?}", files.keys());
    for (name, bytes) in files.iter().filter(|(name, _)| *name != "main.js") {
        let policy = served(&app, &format!("/dashboard/{name}"), name, bytes).await;
        assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"), "{policy}");
        assert!(!policy.contains("unsafe"), "{policy}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_page_of_the_interface_is_served_and_loads_nothing_from_elsewhere() {
    const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
        connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
    let app = App::start().await;
    let ours = files_of("src/http/description/documentation");
    let page = String::from_utf8(ours["index.html"].clone()).expect("UTF-8");
    assert_eq!(served(&app, "/docs", "index.html", page.as_bytes()).await, POLICY);
    for file in ["page.css", "start.js"] {
        assert_eq!(served(&app, &format!("/docs/{file}"), file, &ours[file]).await, POLICY);
    }
    let loaded: Vec<&str> = ["src=\"", "href=\""]
        .iter()
        .flat_map(|attribute| page.split(attribute).skip(1).filter_map(|rest| rest.split('"').next()))
        .collect();
    assert_eq!(
        loaded,
        [
            "/docs/swagger-ui-bundle.js",
            "/docs/start.js",
            "data:,",
            "/docs/swagger-ui.css",
            "/docs/page.css",
            "/openapi.json"
        ]
    );
    for (file, media) in [("swagger-ui-bundle.js", "text/javascript"), ("swagger-ui.css", "text/css")] {
        let answer = app.client.get(format!("{}/docs/{file}", app.url)).send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK, "{file}");
        let headers = answer.headers().clone();
        assert_eq!(headers["content-type"], format!("{media}; charset=utf-8"), "{file}");
        assert_eq!(headers["content-security-policy"], POLICY, "{file}");
        assert_eq!(headers["content-encoding"], "gzip", "{file}");
        let bytes = answer.bytes().await.expect("bytes");
        assert!(bytes.starts_with(&[0x1f, 0x8b]) && bytes.len() > 10_000, "{file} has {} bytes", bytes.len());
    }
    let (status, problem) = app.get("/docs/index.js").await;
    assert_eq!((status.as_u16(), &problem["value"]), (404, &"index.js".into()), "{problem}");
}

/// The page sends calls that are tried: a job is queued, or the thing that the example names is not there.
#[tokio::test(flavor = "multi_thread")]
async fn every_example_is_a_request_that_breaks_no_rule() {
    let app = App::start().await;
    let description: Value = serde_json::from_str(ballast::http::description_json()).expect("JSON");
    for (path, status, missing) in [
        ("/train", 202, Value::Null),
        ("/evaluate", 202, Value::Null),
        ("/sessions", 404, json!("policy")),
        ("/observe", 404, json!("session")),
        ("/what-if", 404, json!("session")),
    ] {
        let example = &description["paths"][path]["post"]["requestBody"]["content"]["application/json"]["example"];
        let (answered, answer) = app.post(path, example).await;
        assert_eq!((answered.as_u16(), &answer["field"]), (status, &missing), "{path}: {answer}");
        if let Some(job) = answer["job"].as_str() {
            app.post(&format!("/jobs/{job}/cancel"), &Value::Null).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn people_get_the_dashboard_and_programs_the_description() {
    let app = App::start().await;
    let page = app.client.get(&app.url).header(ACCEPT, "text/html,*/*;q=0.8").send().await.expect("an answer");
    assert!(page.headers()["link"].to_str().expect("text").contains("</openapi.json>; rel=\"service-desc\""));
    assert_eq!(page.bytes().await.expect("bytes"), files()["index.html"].as_slice());
    let described = app.client.get(&app.url).header(ACCEPT, "application/json").send().await.expect("an answer");
    assert_eq!(described.headers()["content-type"], "application/json");
    assert_eq!(described.text().await.expect("text"), ballast::http::description_json());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_is_not_there_is_a_problem_that_names_it() {
    let app = App::start().await;
    let (status, problem) = app.get("/dashboard/..%2Fmod.rs").await;
    assert_eq!((status.as_u16(), &problem["value"]), (404, &"../mod.rs".into()), "{problem}");
    let (status, example) = app.get("/dashboard/us_market_monthly.csv").await;
    assert_eq!(status, 200);
    assert!(example.as_str().is_some_and(|text| text.starts_with("month,market_return,risk_free_return\n")));
}

#[test]
fn the_page_calls_frameworks_what_reports_call_them() {
    use ballast::control::evaluation::names::framework_name;
    use ballast::control::request::framework::Framework::{
        Adaptive, KnownLaw, ParametricAdaptive, ParametricStatic, PlugIn, Static,
    };
    let words = String::from_utf8(files()["specification.js"].clone()).unwrap();
    let named = words.split("export const FRAMEWORKS = {").nth(1).unwrap().split('}').next().unwrap();
    for framework in [Adaptive, Static, KnownLaw, PlugIn, ParametricStatic, ParametricAdaptive] {
        let line = format!("{}: \"{}\"", framework.name(), framework_name(framework));
        assert!(named.contains(&line), "{line} is not in {named}");
    }
    // Every other strategy is called what its report calls it.
    for (name, bytes) in files() {
        let text = String::from_utf8_lossy(&bytes);
        for own in ["\"Trusts the record\"", "\"Least variance\"", "\"Robust, sup norm\"", "blind to costs"] {
            assert!(name == "specification.js" || !text.contains(own), "{name} has a name of its own: {own}");
        }
    }
}

/// Works offline and under the policy: nothing inline, nothing from elsewhere, no markup made from text.
#[test]
fn no_file_reaches_beyond_the_service() {
    const NAMESPACE: &str = "http://www.w3.org/2000/svg";
    for (name, bytes) in files() {
        let Ok(text) = String::from_utf8(bytes) else { continue };
        if name == "inter-LICENSE.txt" {
            continue;
        }
        let text = text.replace(NAMESPACE, "");
        for forbidden in
            ["http://", "https://", "innerHTML", "insertAdjacentHTML", "eval(", " style=\"", "<style", "onclick=\""]
        {
            assert!(!text.contains(forbidden), "{name} holds {forbidden}");
        }
        assert!(text.lines().count() <= 350, "{name} has more than 350 lines");
        assert_eq!(
            text.matches("<script").count(),
            text.matches("<script type=\"module\" src=\"/dashboard/").count(),
            "{name}"
        );
    }
}
