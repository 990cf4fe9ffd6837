//! Walk-forwards as jobs: the same report as the command's, to the tenant who asked alone, cancelled and resumed.

mod support;

use std::process::Command;

use reqwest::StatusCode;
use serde_json::{Value, json};
use support::App;

/// Simple returns and what the bank paid, quarter by quarter from 2010 on.
fn record(quarters: usize) -> (Vec<f64>, Vec<f64>, Vec<String>) {
    let risky = |quarter: usize| 0.02 + 0.03 * (1.7 * quarter as f64).sin();
    let bank = |quarter: usize| 0.002 + 0.0001 * (quarter % 7) as f64;
    let date = |quarter: usize| format!("{}-{:02}", 2010 + quarter / 4, 3 * (quarter % 4) + 1);
    ((0..quarters).map(risky).collect(), (0..quarters).map(bank).collect(), (0..quarters).map(date).collect())
}

/// A walk-forward of `years` after a window of three.
fn request(years: usize, rest: &Value) -> Value {
    let (simple_returns, rate, dates) = record(12 + 4 * years);
    let mut request = json!({ "simple_returns": simple_returns, "rate": rate, "dates": dates, "window": 12, "every": 2,
        "horizon": 3, "count": 10, "alpha": [0.3, 0.9], "trading_cost": 0.001 });
    rest.as_object().unwrap().iter().for_each(|(name, value)| request[name] = value.clone());
    request
}

async fn queue(app: &App, request: &Value) -> String {
    let (status, job) = app.post("/backtest", request).await;
    assert_eq!((status, &job["kind"]), (StatusCode::ACCEPTED, &json!("backtest")), "{job}");
    job["job"].as_str().unwrap().to_owned()
}

/// Waits for the end of a job; its report.
async fn report(app: &App, job: &str) -> Value {
    let done = app.until(job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(
        (&done["state"], &done["report"]),
        (&json!("succeeded"), &json!(format!("/jobs/{job}/report"))),
        "{done}"
    );
    app.get(done["report"].as_str().unwrap()).await.1
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_reports_what_the_command_reports() {
    let app = App::start().await;
    let job = queue(&app, &request(2, &json!({}))).await;
    let reported = report(&app, &job).await;
    // Of the main line the mix is a line of its own, kept with the same cost.
    let strategies = reported["strategies"].as_array().unwrap();
    let own = strategies.iter().find(|strategy| strategy["strategy"] == "adaptive, alpha 0.9").unwrap();
    let mix = strategies.iter().find(|strategy| strategy["hindsight"] == true).unwrap();
    assert_eq!(own["beyond_own_mix"], mix["adaptive_ahead"]);
    assert!(own["annual_turnover"]["value"].as_f64() > Some(0.0) && mix["beyond_own_mix"].is_null(), "{own} {mix}");

    let folder = tempfile::tempdir().unwrap();
    let (risky, bank, dates) = record(20);
    let row = |index: usize| format!("{},{},{}\n", dates[index], risky[index], bank[index]);
    let rows: String = (0..20).map(row).collect();
    let file = folder.path().join("returns.csv");
    std::fs::write(&file, format!("date,return,rf\n{rows}")).unwrap();
    let out = folder.path().join("report");
    let options = "--window 12 --every 2 --horizon 3 --count 10 --alpha 0.3,0.9 --cost-bp 10";
    let command = Command::new(env!("CARGO_BIN_EXE_ballast"))
        .arg("backtest")
        .args([&file, &std::path::PathBuf::from("--out"), &out])
        .args(options.split(' '))
        .output()
        .unwrap();
    assert!(command.status.success(), "{}", String::from_utf8_lossy(&command.stderr));
    let text = std::fs::read_to_string(out.join("report.json")).unwrap();
    let by_command: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(reported, by_command);
    let names: Vec<&str> =
        reported["strategies"].as_array().unwrap().iter().map(|one| one["strategy"].as_str().unwrap()).collect();
    assert_eq!(
        names[..4],
        ["adaptive, alpha 0.3", "adaptive, alpha 0.9", "cost-blind, alpha 0.9", "static, alpha 0.9"]
    );
    assert_eq!((&reported["dates"][0], reported["dates"].as_array().unwrap().len()), (&json!("2013-01"), 8));
    // Something was held, and its wealth follows from it by hand in the first quarter.
    let held = &reported["periods"][1];
    let (allocation, wealth) = (held["allocation"][0].as_f64().unwrap(), held["wealth"][0].as_f64().unwrap());
    assert!(allocation > 0.0, "{held}");
    let by_hand =
        100.0 * (1.0 - 0.001 * allocation) * ((1.0 - allocation) * (1.0 + bank[12]) + allocation * (1.0 + risky[12]));
    assert!((wealth / by_hand - 1.0).abs() < 1e-12, "{wealth} {by_hand}");
}

/// Log-returns and simple returns are one record, as are a rate and a list of it; without dates a period is a period.
#[tokio::test(flavor = "multi_thread")]
async fn a_record_may_be_given_in_either_way() {
    let app = App::start().await;
    let common = json!({ "rate": 0.002, "dates": null, "periods_per_year": 4, "alpha": [0.9] });
    let simple = request(1, &common);
    let returns: Vec<f64> =
        simple["simple_returns"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
    let logs: Vec<f64> = returns.iter().map(|value| value.ln_1p()).collect();
    let mut other = simple.clone();
    (other["simple_returns"], other["log_returns"], other["rate"]) = (Value::Null, json!(logs), json!(vec![0.002; 16]));
    let (one, same) = (queue(&app, &simple).await, queue(&app, &other).await);
    let (one, same) = (report(&app, &one).await, report(&app, &same).await);
    assert_eq!(one, same);
    assert_eq!((&one["frequency"], &one["dates"]), (&Value::Null, &Value::Null));
    let sentences = one["sentences"].to_string();
    assert!(sentences.contains("of 4 periods;"), "{sentences}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_resumes_to_the_same_report() {
    let mut app = App::start().await;
    let whole = report(&app, &queue(&app, &request(3, &json!({}))).await).await;
    let job = queue(&app, &request(3, &json!({}))).await;
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() > Some(0)).await;
    app.restart().await;
    assert_eq!(report(&app, &job).await, whole);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_walk_forward_is_cancelled_and_repeated_by_its_key() {
    let app = App::start().await;
    let long = request(40, &json!({ "count": 200, "every": 1 }));
    let job = queue(&app, &long).await;
    app.until(&job, |job| job["state"] == "running").await;
    assert_eq!(app.cancel(&job).await, StatusCode::ACCEPTED);
    let ended = app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!((&ended["state"], &ended["report"]), (&json!("cancelled"), &Value::Null), "{ended}");
    assert_eq!(app.get(&format!("/jobs/{job}/report")).await.0, StatusCode::NOT_FOUND);

    let keyed = async |body: &Value| {
        let sent = app.client.post(format!("{}/backtest", app.url)).header("Idempotency-Key", "quarterly").json(body);
        support::read(sent.send().await.unwrap()).await
    };
    let small = request(1, &json!({}));
    let (first, again) = (keyed(&small).await, keyed(&small).await);
    assert_eq!((first.0, &first.1["job"]), (StatusCode::ACCEPTED, &again.1["job"]));
    assert_eq!(keyed(&request(1, &json!({ "seed": 2 }))).await.0, StatusCode::CONFLICT);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_may_train_may_walk_and_its_tenant_alone_sees_it() {
    let mut app = App::start().await;
    let (read, train, other) =
        (app.key("north", "read").await, app.key("north", "train,read").await, app.key("south", "train,read").await);
    app.enter(&train).await;
    let job = queue(&app, &request(1, &json!({}))).await;
    report(&app, &job).await;
    app.hold(&read);
    assert_eq!(app.post("/backtest", &request(1, &json!({}))).await.0, StatusCode::FORBIDDEN);
    assert_eq!(app.get(&format!("/jobs/{job}/report")).await.0, StatusCode::OK);
    app.hold(&other);
    assert_eq!(app.get(&format!("/jobs/{job}/report")).await.0, StatusCode::NOT_FOUND);
    assert_eq!(app.cancel(&job).await, StatusCode::NOT_FOUND);
}

/// A rate of a year for that of a quarter, and returns in percent, as they are named here.
#[tokio::test(flavor = "multi_thread")]
async fn what_may_be_a_mistake_is_said() {
    let app = App::start().await;
    let percent: Vec<f64> = (0..16).map(|quarter| 4.0 * (1.7 * f64::from(quarter)).sin()).collect();
    let strange = json!({ "simple_returns": null, "log_returns": percent, "rate": 0.2, "trading_cost": 0.05 });
    let (status, job) = app.post("/backtest", &request(1, &strange)).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{job}");
    let told = |name: &str| -> Vec<String> {
        job["warnings"].as_array().unwrap().iter().map(|warning| warning[name].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(told("code"), ["rate_high", "trading_cost_high", "record_in_percent"]);
    assert_eq!(told("field"), ["rate", "trading_cost", "log_returns"]);
    assert!(told("message").iter().zip(told("field")).all(|(message, field)| message.starts_with(&field)), "{job}");
    app.cancel(job["job"].as_str().unwrap()).await;
}
