//! Walk-forwards as jobs: the same report as the command's, to the tenant who asked alone, cancelled and resumed.

use std::process::Command;

use crate::support::App;
use reqwest::StatusCode;
use serde_json::{Value, json};

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
    let own = strategies.iter().find(|strategy| strategy["strategy"] == "Cautious, learns, 10 %").unwrap();
    let mix = strategies.iter().find(|strategy| strategy["hindsight"] == true).unwrap();
    assert_eq!(own["beyond_own_mix"]["value"], mix["adaptive_ahead"]["value"]);
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
        ["Cautious, learns, 70 %", "Cautious, learns, 10 %", "Cautious, blind to costs", "Cautious, fixed"]
    );
    assert_eq!((&reported["dates"][0], reported["dates"].as_array().unwrap().len()), (&json!("2013-01"), 8));
    // Something was held, and its wealth follows from it by hand in the first quarter.
    let held = &reported["periods"][1];
    let (allocation, wealth) = (held["allocation"][0].as_f64().unwrap(), held["wealth"][0].as_f64().unwrap());
    assert!(allocation > 0.0, "{held}");
    let by_hand =
        100.0 * (1.0 - 0.001 * allocation) * ((1.0 - allocation) * (1.0 + bank[12]) + allocation * (1.0 + risky[12]));
    assert!((wealth / by_hand - 1.0).abs() < 1e-12, "{wealth} {by_hand}");
    // Two years of quarters hold five years that begin with a quarter; a twentieth of them is a quarter of the worst.
    let stock = names.iter().position(|name| *name == "All in stocks").unwrap();
    let ends = reported["periods"][stock]["wealth"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap());
    let course: Vec<f64> = std::iter::once(100.0).chain(ends).collect();
    let years: Vec<f64> = (0..5).map(|start| course[start + 4] / course[start] - 1.0).collect();
    let worst = years.iter().copied().fold(f64::INFINITY, f64::min);
    let lost = years.iter().filter(|year| **year < 0.0).count() as f64 / 5.0;
    let value = |figure: &str| strategies[stock][figure]["value"].as_f64().unwrap();
    assert!((value("worst_twentieth") - worst).abs() < 1e-12, "{years:?} {}", strategies[stock]);
    assert!((value("chance_of_loss") - lost).abs() < 1e-12, "{years:?} {}", strategies[stock]);
}

/// Years end with the last period: of 21 quarters after the window the first counts in no year, and a crash in the last one counts.
/// The terminal, the table and the report give each strategy one name and one place.
#[test]
fn the_last_year_ends_with_the_record_and_every_output_ranks_alike() {
    let folder = tempfile::tempdir().unwrap();
    let risky: Vec<f64> =
        (0..33).map(|quarter| if quarter == 32 { -0.3 } else { [0.03, 0.05, 0.04][quarter % 3] }).collect();
    let date = |quarter: usize| format!("{}-{:02}", 2010 + quarter / 4, 3 * (quarter % 4) + 3);
    let rows: String =
        risky.iter().enumerate().map(|(quarter, back)| format!("{},{back},0.002\n", date(quarter))).collect();
    let file = folder.path().join("returns.csv");
    std::fs::write(&file, format!("date,return,rf\n{rows}")).unwrap();
    let out = folder.path().join("report");
    let done = Command::new(env!("CARGO_BIN_EXE_ballast"))
        .args(["backtest".as_ref(), file.as_os_str(), "--out".as_ref(), out.as_os_str()])
        .args("--window 12 --horizon 1 --count 10 --alpha 0.3,0.9".split(' '))
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let printed = String::from_utf8(done.stdout).unwrap();
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!((&report["whole_years"], &report["uncounted_periods"]), (&json!(5), &json!(1)));
    let uncounted = "The first quarter counts in no year: years end with the last quarter.";
    assert!(printed.contains(uncounted) && read("report.html").contains(uncounted), "{printed}");
    let strategies = report["strategies"].as_array().unwrap();
    let worth = |one: &Value| one["yearly_certainty_equivalent"]["value"].as_f64().unwrap();
    let stock = strategies.iter().find(|one| one["kind"] == "all_stock").unwrap();
    // Power utility with risk aversion 3: the certainty equivalent is the mean of x^-2, to the power of -1/2.
    let year = |quarters: &[f64]| quarters.iter().map(|back| 1.0 + back).product::<f64>();
    let years: Vec<f64> = risky[13..].chunks(4).map(year).collect();
    let by_hand = 100.0 * (years.iter().map(|growth| growth.powi(-2)).sum::<f64>() / 5.0).powf(-0.5);
    assert!((worth(stock) - by_hand).abs() < 1e-9, "{} {by_hand}", worth(stock));
    let table = read("strategies.csv");
    for one in strategies {
        let name = one["strategy"].as_str().unwrap();
        let above = strategies.iter().filter(|other| other["hindsight"] == false && worth(other) > worth(one)).count();
        let place = (one["hindsight"] == false).then_some(above + 1);
        assert_eq!(one["place"], json!(place), "{one}");
        let cell = if name.contains(',') { format!("\"{name}\"") } else { name.to_owned() };
        assert_eq!(table.contains(&format!("{cell},place,")), place.is_some(), "{name} in {table}");
        assert!(place.is_none_or(|place| table.contains(&format!("{cell},place,{place},"))), "{name} in {table}");
    }
    let (main, place) = (strategies[1]["strategy"].as_str().unwrap(), &strategies[1]["place"]);
    assert!(
        printed.contains(&format!("With “{main}” a year that starts at 100"))
            && printed.contains(&format!("place {place} of 7"))
    );
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
        crate::support::read(sent.send().await.unwrap()).await
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
    let warnings = |name: &str| -> Vec<String> {
        job["warnings"].as_array().unwrap().iter().map(|warning| warning[name].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(warnings("code"), ["rate_high", "trading_cost_high", "record_in_percent"]);
    assert_eq!(warnings("field"), ["rate", "trading_cost", "log_returns"]);
    assert!(
        warnings("message").iter().zip(warnings("field")).all(|(message, field)| message.starts_with(&field)),
        "{job}"
    );
    app.cancel(job["job"].as_str().unwrap()).await;
}

/// A walk-forward of two assets, `quarters` of which the last three years and four are lived through.
fn of_assets(quarters: usize, rest: &Value) -> Value {
    let (risky, rate, dates) = record(quarters);
    let rows: Vec<[f64; 2]> = risky.iter().enumerate().map(|(quarter, back)| [*back, other(quarter)]).collect();
    let mut request = json!({ "assets": ["energy", "health"], "simple_returns": rows, "rate": rate, "dates": dates,
        "windows": [12, null], "every": 2, "alpha": 0.9, "trading_cost": 0.01 });
    rest.as_object().unwrap().iter().for_each(|(name, value)| request[name] = value.clone());
    request
}

fn other(quarter: usize) -> f64 {
    0.015 + 0.02 * (2.9 * quarter as f64).cos()
}

fn file_of_assets(folder: &std::path::Path, quarters: usize) -> std::path::PathBuf {
    let (risky, bank, dates) = record(quarters);
    let row = |index: usize| format!("{},{},{},{}\n", dates[index], risky[index], other(index), bank[index]);
    let file = folder.join("returns.csv");
    let rows: String = (0..quarters).map(row).collect();
    std::fs::write(&file, format!("date,energy,health,rf\n{rows}")).unwrap();
    file
}

/// A table of several assets: the report of the job is that of the command, also where it was cut off in the middle.
#[tokio::test(flavor = "multi_thread")]
async fn a_job_reports_of_several_assets_what_the_command_reports() {
    let mut app = App::start().await;
    let request = of_assets(28, &json!({}));
    let (status, job) = app.post("/backtest", &request).await;
    assert_eq!((status, &job["warnings"]), (StatusCode::ACCEPTED, &json!([])), "{job}");
    let reported = report(&app, job["job"].as_str().unwrap()).await;
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (file_of_assets(folder.path(), 28), folder.path().join("report"));
    let command = Command::new(env!("CARGO_BIN_EXE_ballast"))
        .args(["backtest".as_ref(), file.as_os_str(), "--out".as_ref(), out.as_os_str()])
        .args("--window 12,all --every 2 --alpha 0.9 --cost-bp 100".split(' '))
        .output()
        .unwrap();
    assert!(command.status.success(), "{}", String::from_utf8_lossy(&command.stderr));
    let text = std::fs::read_to_string(out.join("report.json")).unwrap();
    assert_eq!(reported, serde_json::from_str::<Value>(&text).unwrap());
    assert_eq!(reported["format"], "ballast-backtest-assets-1");

    // Log-returns are the same record, and so is a rate of each period.
    let rows = request["simple_returns"].as_array().unwrap().iter().map(|row| row.as_array().unwrap());
    let logs: Vec<Vec<f64>> = rows.map(|row| row.iter().map(|back| back.as_f64().unwrap().ln_1p()).collect()).collect();
    let job = queue(&app, &of_assets(28, &json!({ "simple_returns": null, "log_returns": logs }))).await;
    assert_eq!(report(&app, &job).await, reported);

    let longer = of_assets(60, &json!({}));
    let whole = report(&app, &queue(&app, &longer).await).await;
    let job = queue(&app, &longer).await;
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() > Some(0) || job["finished_ms"].is_i64()).await;
    app.restart().await;
    assert_eq!(report(&app, &job).await, whole);
}

/// The policy of a session by the job and by the command, also if the job was stopped between two policies. Its wealth is
/// that of the formula, from the shares it held.
#[tokio::test(flavor = "multi_thread")]
async fn the_policy_of_several_assets_is_walked_by_the_job_and_by_the_command() {
    let mut app = App::start().await;
    let request = of_assets(28, &json!({ "strategies": ["policy"], "horizon": 3, "count": 10 }));
    let job = queue(&app, &request).await;
    let walked = report(&app, &job).await;
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (file_of_assets(folder.path(), 28), folder.path().join("report"));
    let command = Command::new(env!("CARGO_BIN_EXE_ballast"))
        .args(["backtest".as_ref(), file.as_os_str(), "--out".as_ref(), out.as_os_str()])
        .args(
            "--strategies policy --window 12,all --every 2 --horizon 3 --count 10 --alpha 0.9 --cost-bp 100".split(' '),
        )
        .output()
        .unwrap();
    assert!(command.status.success(), "{}", String::from_utf8_lossy(&command.stderr));
    let text = std::fs::read_to_string(out.join("report.json")).unwrap();
    assert_eq!(walked, serde_json::from_str::<Value>(&text).unwrap());
    let names: Vec<&Value> = walked["strategies"].as_array().unwrap().iter().map(|one| &one["strategy"]).collect();
    assert_eq!((names.len(), names[0]), (8, &json!("Policy, balanced, knows 3 years")), "{names:?}");
    assert!(walked["sentences"].to_string().contains("policies are trained with it"), "{}", walked["sentences"]);
    // Eight policies for each window, and six strategies that train none.
    let steps = app.get(&format!("/jobs/{job}")).await.1["progress"]["steps_total"].clone();
    assert_eq!(steps, json!(22));

    let (risky, bank, _) = record(28);
    let policy = &walked["periods"][0];
    let at = |figures: &Value, period: usize| figures[period].as_f64().unwrap();
    let (mut wealth, mut held, mut most) = (100.0, [0.0, 0.0], 0.0_f64);
    for period in 0..16 {
        let quarter = 12 + period;
        let shares = ["energy", "health"].map(|name| at(&policy["allocations"][name], period));
        let traded: f64 = shares.iter().zip(held).map(|(share, had)| f64::abs(share - had)).sum();
        let grown = [shares[0] * (1.0 + risky[quarter]), shares[1] * (1.0 + other(quarter))];
        let growth = (1.0 - shares[0] - shares[1]) * (1.0 + bank[quarter]) + grown[0] + grown[1];
        wealth *= (1.0 - 0.01 * traded) * growth;
        held = grown.map(|position| position / growth);
        most = most.max(shares[0] + shares[1]);
        assert!((at(&policy["wealth"], period) / wealth - 1.0).abs() < 1e-12, "{period}: {policy}");
        assert!((at(&policy["traded"], period) - traded).abs() < 1e-12, "{period}: {policy}");
    }
    assert!(most > 0.05, "{policy}");

    let job = queue(&app, &request).await;
    app.until(&job, |job| job["progress"]["steps_done"].as_u64() > Some(0) || job["finished_ms"].is_i64()).await;
    app.restart().await;
    assert_eq!(report(&app, &job).await, walked);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_walk_forward_of_several_assets_is_cancelled_and_warned_of() {
    let app = App::start().await;
    let (status, job) = app.post("/backtest", &of_assets(700, &json!({ "rate": 0.2, "windows": [350] }))).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{job}");
    let fields: Vec<&Value> = job["warnings"].as_array().unwrap().iter().map(|warning| &warning["field"]).collect();
    assert_eq!(fields, ["rate", "rate"], "{job}");
    let job = job["job"].as_str().unwrap();
    app.until(job, |job| job["state"] == "running").await;
    assert_eq!(app.cancel(job).await, StatusCode::ACCEPTED);
    let ended = app.until(job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!((&ended["state"], &ended["report"]), (&json!("cancelled"), &Value::Null), "{ended}");
}

/// Equal shares by hand, with what trading costs; what the others hold is by name, within the whole.
#[test]
fn a_file_of_several_assets_is_walked_by_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let (risky, ..) = record(28);
    let file = file_of_assets(folder.path(), 28);
    let out = folder.path().join("report");
    let command = |options: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.arg("backtest").args([&file, &std::path::PathBuf::from("--out"), &out]).args(options.split(' '));
        command.output().unwrap()
    };
    let done = command("--window 12,all --every 2 --alpha 0.9 --cost-bp 100");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!((&report["assets"], &report["choices"]["windows"]), (&json!(["energy", "health"]), &json!([12, null])));
    assert_eq!((report["dates"].as_array().unwrap().len(), &report["dates"][0]), (16, &json!("2013-01")));
    let names: Vec<&str> =
        report["strategies"].as_array().unwrap().iter().map(|one| one["strategy"].as_str().unwrap()).collect();
    assert_eq!((names.len(), names[0], names[20]), (22, "Robust, balanced, knows 3 years", "Equal shares"));

    let (mut wealth, mut held) = (100.0, [0.0, 0.0]);
    let mut highest: f64 = 100.0;
    let mut fall: f64 = 0.0;
    for quarter in 12..28 {
        let traded: f64 = held.iter().map(|share: &f64| (0.5 - share).abs()).sum();
        let grown = [0.5 * (1.0 + risky[quarter]), 0.5 * (1.0 + other(quarter))];
        wealth *= (1.0 - 0.01 * traded) * (grown[0] + grown[1]);
        held = grown.map(|position| position / (grown[0] + grown[1]));
        highest = highest.max(wealth);
        fall = fall.max(1.0 - wealth / highest);
        let found = report["periods"][20]["wealth"][quarter - 12].as_f64().unwrap();
        assert!((found / wealth - 1.0).abs() < 1e-12, "{quarter}: {found} {wealth}");
    }
    let equal = &report["strategies"][20];
    assert!((equal["final_wealth"].as_f64().unwrap() / wealth - 1.0).abs() < 1e-12, "{equal} {wealth}");
    assert!((equal["max_drawdown"].as_f64().unwrap() - fall).abs() < 1e-12, "{equal} {fall}");
    assert_eq!((&equal["effective_assets"], &equal["mean_allocations"]["health"]), (&json!(2.0), &json!(0.5)));

    for periods in report["periods"].as_array().unwrap() {
        let of =
            |name: &str| periods["allocations"][name].as_array().unwrap().iter().map(|share| share.as_f64().unwrap());
        assert!(
            of("energy").zip(of("health")).all(|(one, other)| one >= 0.0 && other >= 0.0 && one + other < 1.0 + 1e-9)
        );
    }
    assert_eq!(read("periods.csv").lines().count(), 1 + 16 * 22);
    assert!(
        read("periods.csv")
            .starts_with("date,strategy,allocation,radius,traded,wealth,drawdown,held: energy,held: health\n")
    );
    let page = read("report.html");
    // One file, drawn from the data in it and loading nothing; whoever runs no scripts reads the sentences.
    assert!(page.contains("default-src 'none'; script-src 'sha256-") && !page.contains("src=\""));
    assert!(page.contains("\"mean_allocations\":{\"energy\"") && page.contains("<noscript><h1>Backtest of 2 assets"));
    let output = String::from_utf8(done.stdout).unwrap();
    assert!(output.contains("Each of the 2 columns is an asset") && output.contains("place "), "{output}");
    assert!(
        output.contains("Trading costs 100 bp of what is traded in every account; no strategy knows of it."),
        "{output}"
    );

    for (options, complaint) in [
        (
            "--horizon 4",
            "--horizon is 4: must be left out unless strategies has policy, because nothing else is trained",
        ),
        ("--alpha 0.1,0.2", "--alpha is 2 levels: must be one level if there are several assets"),
        ("--window 40", "--window is 40: must be at most 24: the record has 28 periods"),
        (
            "--column energy --window 12,all",
            "--window is 12,all: must be one number of periods, because the file has one asset",
        ),
    ] {
        let refused = command(options);
        let error = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && error.contains(complaint), "{options}: {error}");
    }
}

/// Strategies of the user's own hold what they say, beside the others: 60 % by its own name is 60/40, and of two equal assets
/// equal shares are those of the service.
#[tokio::test(flavor = "multi_thread")]
async fn strategies_of_one_s_own_are_walked_beside_the_others() {
    let app = App::start().await;
    let shares: Vec<f64> = (0..20).map(|quarter| if quarter < 12 { 0.0 } else { 0.6 }).collect();
    let own = json!({ "Mine": shares, "Half": vec![0.5; 20] });
    let reported = report(&app, &queue(&app, &request(2, &json!({ "weights": own }))).await).await;
    let named = |name: &str| {
        let place = reported["strategies"].as_array().unwrap().iter().position(|one| one["strategy"] == name).unwrap();
        (reported["strategies"][place].clone(), reported["periods"][place].clone())
    };
    let ((mine, periods), (sixty, expected)) = (named("Mine"), named("60/40"));
    assert_eq!((&mine["kind"], &periods["wealth"]), (&json!("own"), &expected["wealth"]));
    assert_eq!(mine["yearly_certainty_equivalent"], sixty["yearly_certainty_equivalent"]);
    assert_eq!(named("Half").1["allocation"][0], json!(0.5));
    for (weights, field) in [
        (json!({ "Mine": vec![0.5; 19] }), "weights.Mine"),
        (json!({ "Mine": vec![60.0; 20] }), "weights.Mine[0]"),
        (json!({ "60/40": vec![0.5; 20] }), "weights"),
        (json!({ " Mine": vec![0.5; 20] }), "weights"),
    ] {
        let (status, problem) = app.post("/backtest", &request(2, &json!({ "weights": weights }))).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }

    let (risky, rate, dates) = record(20);
    let rows: Vec<Vec<f64>> = risky.iter().enumerate().map(|(at, z)| vec![*z, *z + 0.001 * (at % 3) as f64]).collect();
    let assets = json!({ "assets": ["a", "b"], "simple_returns": rows, "rate": rate, "dates": dates, "windows": [12],
        "trading_cost": 0.001, "weights": { "Mine": vec![[0.5, 0.5]; 20] } });
    let reported = report(&app, &queue(&app, &assets).await).await;
    let wealth = |name: &str| {
        let periods = reported["periods"].as_array().unwrap();
        periods.iter().find(|one| one["strategy"] == name).unwrap()["wealth"].clone()
    };
    assert_eq!(wealth("Mine"), wealth("Equal shares"));
    let mut wrong = assets.clone();
    wrong["weights"]["Mine"][3] = json!([0.7, 0.4]);
    let (status, problem) = app.post("/backtest", &wrong).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("weights.Mine[3]")), "{problem}");
}
