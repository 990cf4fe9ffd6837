//! `ballast-lab loadtest`, with sizes that say nothing of speed: every scenario runs, and its figures hang together.

use std::process::Command;

use ballast_test_support::certificates::Authority;
use ballast_test_support::process::{Process, serve};
use serde_json::Value;

fn loadtest(arguments: &[&str]) -> Value {
    let sizes = ["--clients", "4", "--sessions", "12", "--live-sessions", "40", "--rounds", "2"];
    let policy = ["--horizon", "3", "--count", "20", "--seconds", "0.4", "--json"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast-lab"));
    command.arg("loadtest").args(arguments).args(sizes).args(policy).env("RUST_LOG", "warn");
    let output = command.output().expect("the command runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn every_scenario_runs_and_its_figures_hang_together() {
    let report = loadtest(&[]);
    let figures = report["figures"].as_array().expect("figures");
    let names: Vec<&str> = figures.iter().filter_map(|figure| figure["what"].as_str()).collect();
    let expected =
        ["limit: pages", "observe:", "limit: /livez", "action-vs-livez", "action-idle", "action-while-training"];
    for name in expected.iter().chain(&["sessions-100k"]) {
        assert!(names.iter().any(|found| found.starts_with(name)), "no {name} in {names:?}");
    }
    for figure in figures.iter().filter(|figure| !figure["p50_ms"].is_null()) {
        let [rate, p50, p99, max] =
            ["rate", "p50_ms", "p99_ms", "max_ms"].map(|field| figure[field].as_f64().expect(field));
        assert!(rate > 0.0 && 0.0 < p50 && p50 <= p99 && p99 <= max, "{figure}");
    }
}

#[test]
fn lists_report_what_calls_report() {
    let report = loadtest(&["observe", "--batch", "5"]);
    let figures = report["figures"].as_array().expect("figures");
    let found = figures.iter().find(|figure| figure["what"] == "observe: 4 clients, 12 sessions, lists of 5");
    let observe = found.unwrap_or_else(|| panic!("no lists in {figures:?}"));
    assert_eq!(observe["bounds"].as_array().map(Vec::len), Some(1), "the wait for a list has no bound: {observe}");
    assert!(observe["rate"].as_f64().expect("a rate") > 0.0 && observe["processor_us"].as_f64().expect("time") > 0.0);
}

#[test]
fn a_bound_is_met_or_not_by_the_figure_beside_it() {
    let report = loadtest(&["observe"]);
    let figures = report["figures"].as_array().expect("figures");
    let observe = figures.iter().find(|figure| figure["what"].as_str().is_some_and(|what| what.starts_with("observe")));
    let observe = observe.expect("the scenario");
    let bounds = observe["bounds"].as_array().expect("bounds");
    let met = |index: usize| bounds[index]["met"].as_bool().expect("a verdict");
    assert_eq!(met(0), observe["rate"].as_f64().expect("a rate") >= 8000.0);
    assert_eq!(met(1), observe["p99_ms"].as_f64().expect("a quantile") < 40.0);
}

#[test]
fn an_encrypted_service_is_driven_if_its_authority_is_named() {
    let (folder, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let [certificate, key, authorities] = ["cert.pem", "key.pem", "ca.pem"].map(|name| folder.path().join(name));
    let issued = authority.certificate("127.0.0.1");
    for (path, text) in [(&certificate, &issued.pem), (&key, &issued.key), (&authorities, &authority.pem)] {
        std::fs::write(path, text).unwrap();
    }
    let (child, url) = serve(|command| {
        command.arg("--data").arg(folder.path().join("data"));
        command.arg("--tls-cert").arg(&certificate).arg("--tls-key").arg(&key);
    });
    let _process = Process(child);
    assert!(url.starts_with("https://"), "{url}");
    let figures = loadtest(&["observe", "--url", &url, "--ca", authorities.to_str().unwrap()])["figures"].clone();
    assert!(figures.as_array().is_some_and(|figures| !figures.is_empty()), "{figures}");
}
