//! The dashboard and the alerts ask for metrics that a service in use has.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::certificates::Authority;
use crate::support::patience::until;
use crate::support::{App, specification};
use ballast::service::callers::keys;
use ballast::service::process::clock::Clock;
use ballast::service::process::config::TlsFiles;
use ballast::store::KeyRing;
use serde_json::{Value, json};

const DASHBOARD: &str = include_str!("../../docker/grafana/ballast.json");
const ALERTS: &str = include_str!("../../docker/alerts.yaml");
const OPERATING: &str = include_str!("../../docs/operating.md");
const PROMETHEUS: &str = include_str!("../../docker/prometheus.yaml");
const CLUSTER: &str = include_str!("../../docker/compose.cluster.yaml");

/// Every `ballast_...` and `process_...` name with the labels asked of it, one each: `name` alone, or `name` and
/// `label="value"`; of a status the name alone, since the one asked for may never happen.
fn metrics(expression: &str) -> Vec<(String, Option<String>)> {
    let mut found = Vec::new();
    let starts = ["ballast_", "process_"].iter().flat_map(|start| expression.match_indices(start));
    for (start, _) in starts {
        let rest = &expression[start..];
        let end = rest.find(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').unwrap_or(rest.len());
        let name = rest[..end].to_owned();
        let braces = rest[end..].strip_prefix('{').and_then(|labels| labels.split('}').next());
        found.push((name.clone(), None));
        for label in braces.into_iter().flat_map(|labels| labels.split(',')).map(str::trim) {
            // Prometheus itself says which job and instance it asked.
            let is_own = label.contains("=\"") && !label.starts_with("job=") && !label.starts_with("instance=");
            if is_own {
                let label = if label.starts_with("status=") { "status=" } else { label };
                found.push((name.clone(), Some(label.to_owned())));
            }
        }
    }
    found
}

async fn keyless(app: &App) -> u16 {
    reqwest::get(format!("{}/jobs", app.url)).await.unwrap().status().as_u16()
}

/// The text of `/metrics` after a training, an observation, an allocation and refusals, with a key that is about to expire.
async fn exposition() -> String {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    assert_eq!(app.action().await.0, 200);
    assert_eq!(app.get("/sessions/nobody").await.0, 404);
    assert_eq!(app.post("/what-if", &json!({ "session": app.session })).await.0, 200);
    // The metrics are those of the process: another service in it has a certificate.
    let certificate = Authority::new().certificate("127.0.0.1");
    let files = TlsFiles { certificate: app.folder().join("cert.pem"), key: app.folder().join("key.pem") };
    std::fs::write(&files.certificate, &certificate.pem).unwrap();
    std::fs::write(&files.key, &certificate.key).unwrap();
    let _encrypted = App::configured(|config| config.tls = Some(files)).await;
    let ring = KeyRing::open(app.folder()).await.unwrap();
    let (tenant, roles) = ("north".parse().unwrap(), "admin".parse().unwrap());
    let expires_ms = Some(Clock::system().now_milliseconds() + 3_600_000);
    let (_, secret) = keys::issue(&ring, tenant, roles, expires_ms, &Clock::system()).await.unwrap();
    ring.close().await;
    app.hold(secret.reveal());
    let counts = async || {
        let is_measured = app.get("/metrics").await.1.as_str().is_some_and(|page| page.contains("certificate_expiry"));
        (app.get("/no-such-path").await.0 == 404 && keyless(&app).await == 401 && is_measured).then_some(())
    };
    until("the key to count", counts).await;
    app.client.get(format!("{}/metrics", app.url)).send().await.unwrap().text().await.unwrap()
}

/// The expressions of the dashboard's panels.
fn panels() -> Vec<String> {
    let dashboard: Value = serde_json::from_str(DASHBOARD).expect("JSON");
    let panels = dashboard["panels"].as_array().expect("panels");
    let targets = panels.iter().flat_map(|panel| panel["targets"].as_array().expect("targets"));
    targets.map(|target| target["expr"].as_str().expect("an expression").to_owned()).collect()
}

/// The expressions of the rules, each on a line of its own.
fn rules() -> Vec<String> {
    let expressions: Vec<_> =
        ALERTS.lines().filter_map(|line| line.trim().strip_prefix("expr: ")).map(str::to_owned).collect();
    assert_eq!(expressions.len(), ALERTS.matches("- alert: ").count(), "every alert has an expression on its line");
    expressions
}

#[tokio::test]
async fn every_metric_of_the_dashboard_and_the_alerts_exists_in_a_service_in_use() {
    let exposition = exposition().await;
    let (panels, rules) = (panels(), rules());
    assert!(panels.len() >= 10 && rules.len() >= 5, "{} panels, {} rules", panels.len(), rules.len());
    let used: BTreeSet<_> = panels.iter().chain(&rules).flat_map(|expression| metrics(expression)).collect();
    let samples: Vec<_> = exposition.lines().filter(|line| !line.starts_with('#')).collect();
    for (name, label) in used {
        let named = |line: &&str| line.split(['{', ' ']).next() == Some(name.as_str());
        let mut found = samples.iter().copied().filter(named).peekable();
        assert!(found.peek().is_some(), "nothing is called {name} in\n{exposition}");
        if let Some(label) = label {
            assert!(found.any(|line| line.contains(&label)), "{name} never has {label}");
        }
    }
    // And the other way round: what the service measures is looked at.
    for described in exposition.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
        let name = described.split(' ').next().unwrap();
        assert!(panels.iter().any(|expression| expression.contains(name)), "no panel shows {name}");
    }
}

/// Prometheus' own tool for rules; `None` where the machine has none, which is said loudly and fails in CI.
fn promtool() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/promtool/usr/bin/promtool");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|folder| folder.join("promtool")).chain([own]);
    let found = found.into_iter().find(|tool| tool.is_file());
    let required = std::env::var_os("BALLAST_TEST_PROMTOOL").is_some_and(|value| value == "required");
    assert!(found.is_some() || !required, "there is no promtool");
    if found.is_none() {
        eprintln!("SKIPPED: there is no promtool (Debian's package prometheus has it), so no alert was fired");
    }
    found
}

#[test]
fn every_alert_is_fired_by_prometheus_own_rules() {
    const FIRED: &str = include_str!("../data/alerts_fired.yaml");
    for alert in ALERTS.lines().filter_map(|line| line.trim().strip_prefix("- alert: ")) {
        assert!(FIRED.contains(&format!("alertname=\"{alert}\"")), "{alert} is never fired");
        assert!(OPERATING.contains(&format!("`{alert}`")), "{alert} is not explained");
    }
    let Some(promtool) = promtool() else { return };
    for arguments in [["check", "rules", "docker/alerts.yaml"], ["test", "rules", "tests/data/alerts_fired.yaml"]] {
        let output = Command::new(&promtool).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
        let printed = [output.stdout, output.stderr].concat();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&printed));
    }
}

#[test]
fn prometheus_is_given_the_rules() {
    assert!(PROMETHEUS.contains("rule_files:\n  - alerts.yaml"));
    assert!(CLUSTER.contains("./alerts.yaml:/etc/prometheus/alerts.yaml:ro"));
}
