//! A session of several assets through years of renewals, beside the walk-forward of its policies.

use crate::support::App;
use crate::support::patience::until;
use crate::support::values::number;
use ballast::control::cache::Cache;
use ballast::control::evaluation::assets::AssetsRecord;
use ballast::control::evaluation::assets::policy::{FundWalk, HeldPeriod};
use ballast::control::pool::TrainingPool;
use ballast::control::progress::Watch;
use ballast::control::request::asset_history::AssetHistory;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::frequency::Frequency;
use ballast::control::request::specification::DesignSpecification;
use serde_json::{Value, json};

/// Months before the first period.
const WINDOW: usize = 36;
const LIVED: usize = 120;
const EVERY: usize = 12;
const CONTRIBUTION: f64 = 0.5;
const COST: f64 = 0.002;

/// The twelve industries from three years before 1991 to the end of 2000.
fn industries() -> AssetsRecord {
    let file = include_str!("../../data/us_industries_monthly.csv");
    let mut lines = file.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let all: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let first = all.iter().position(|row| row[0] == "1991-01").unwrap();
    let rows = &all[first - WINDOW..first + LIVED];
    let returns =
        |row: &Vec<&str>| -> Vec<f64> { row[1..13].iter().map(|cell| cell.parse::<f64>().unwrap().ln_1p()).collect() };
    AssetsRecord {
        assets: header[1..13].iter().map(|&name| name.to_owned()).collect(),
        rows: rows.iter().map(returns).collect::<Vec<_>>().into(),
        bank: rows.iter().map(|row| row[13].parse().unwrap()).collect(),
        dates: rows.iter().map(|row| row[0].to_owned()).collect(),
        frequency: Frequency::Monthly,
        periods_per_year: 12,
    }
}

/// The training of the first policy, with a small share of the radius so that much is held.
fn training(record: &AssetsRecord) -> Value {
    json!({
        "problem": {
            "assets": record.assets, "history": record.rows.of(0..WINDOW), "rate_per_step": record.bank[WINDOW - 1],
            "horizon": EVERY + 1, "trading_cost": COST, "contributions": CONTRIBUTION,
            "radius": { "rule": "bridge", "alpha": 0.5 }, "caution": "bold", "means": { "kind": "bayes_stein" },
        },
        "design": { "count": 10 },
        "seed": 5,
    })
}

fn walked(record: &AssetsRecord, window: usize) -> Vec<HeldPeriod> {
    let training = training(record);
    let problem: AssetsProblem = serde_json::from_value(training["problem"].clone()).unwrap();
    let design: DesignSpecification = serde_json::from_value(training["design"].clone()).unwrap();
    let walk = FundWalk { record, first: WINDOW, window: Some(window), every: EVERY, problem, design, seed: 5 };
    TrainingPool::new(2)
        .unwrap()
        .install(|| walk.run(&Watch::unwatched(), &Cache::default(), |_, tenure| tenure()))
        .unwrap()
}

async fn session(app: &App) -> Value {
    app.get(&format!("/sessions/{}", app.session)).await.1
}

/// Ten years through HTTP, renewed by itself every year, with a trading cost, contributions and the rates that the bank
/// paid, and a correction made and undone. The shares advised, the radius and the wealth are those of the walk, bit for bit.
#[tokio::test(flavor = "multi_thread")]
async fn ten_years_of_a_live_session_of_twelve_industries_equal_the_walk() {
    let record = industries();
    let walked = lived_as_walked(&record, WINDOW).await;
    let compositions = walked.iter().filter(|held| held.shares.iter().sum::<f64>() > 0.01).count();
    assert!(compositions > LIVED / 2, "{compositions} periods hold something");
    let traded: f64 = walked.iter().map(|held| held.traded).sum();
    assert!(traded > 0.5, "{traded} is traded");
}

/// Two industries begin a few months after the others, and the window still reaches these months when the session is
/// renewed.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_of_unequal_records_equals_the_walk() {
    let mut record = industries();
    let mut given = record.rows[..WINDOW + 2 * EVERY + 1].to_vec();
    given[..3].iter_mut().for_each(|row| row[4] = f64::NAN);
    given[..2].iter_mut().for_each(|row| row[9] = f64::NAN);
    record.rows = AssetHistory::marked(given);
    let walked = lived_as_walked(&record, 2 * WINDOW).await;
    assert_eq!((walked.len(), record.rows.missing()[4]), (2 * EVERY + 1, 3));
}

/// Lives a session through the record and compares it with the walk, which is returned.
async fn lived_as_walked(record: &AssetsRecord, window: usize) -> Vec<HeldPeriod> {
    let walked = walked(record, window);
    let named = |values: &[f64]| {
        Value::Object(record.assets.iter().cloned().zip(values.iter().map(|value| json!(value))).collect())
    };
    let listed =
        |value: &Value| -> Vec<f64> { record.assets.iter().map(|name| number(&value[name.as_str()])).collect() };

    let mut app = App::start().await;
    app.train(&training(record)).await;
    app.open_with(json!({ "renew": { "every": EVERY, "window": window } })).await;
    for (period, held) in (1..).zip(&walked) {
        let (renewals, row) = ((period - 1) / EVERY, WINDOW + period - 1);
        if (period - 1) % EVERY == 0 {
            let renewed = until("a renewal", async || (session(&app).await["renewals"] == renewals).then_some(()));
            renewed.await;
        }
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        assert_eq!(listed(&action["allocation"]), held.shares, "period {period}");
        assert_eq!(number(&action["radius"]), held.radius, "period {period}");
        let right = json!({ "log_returns": named(&record.rows[row]), "rate": record.bank[row], "confirm": true });
        let (status, observed) = app.report(period, right.clone()).await;
        assert_eq!(status, 200, "{observed}");
        assert_eq!(number(&observed["wealth"]), held.wealth, "period {period}");
        if period == 30 {
            let mut wrong = right.clone();
            wrong["log_returns"]["energy"] = json!(0.2);
            for (number, mut correction) in [(1, wrong), (2, right)] {
                (correction["correction"], correction["period"]) = (json!(number), json!(period));
                correction["reason"] = json!("read wrong");
                let (status, corrected) =
                    app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
                assert_eq!(status, 200, "{corrected}");
            }
        }
    }
    assert_eq!(number(&session(&app).await["wealth"]), walked.last().unwrap().wealth);
    walked
}
