//! Latency of `GET /action` for one client on loopback, and of `POST /observe` before it.

use std::error::Error;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Instant;

use ballast::control::request::specification::InitialLaws;
use ballast::http::api_client::{ApiClient, ApiError};
use ballast::http::serve;
use ballast::numerics::statistics::summary::quantile;
use ballast::service::process::config::Config;
use ballast::service::process::shutdown::Shutdown;
use clap::Args;
use serde_json::{Map, Value, json};

use super::assets;
use crate::paper;

#[derive(Debug, Args)]
pub struct ActionBench {
    /// Design points per step of the policy
    #[arg(long, default_value_t = 1000)]
    count: usize,
    #[arg(long, default_value_t = 2)]
    horizon: usize,
    /// Number of sessions called
    #[arg(long, default_value_t = 1000)]
    calls: usize,
    /// Number of assets: 1 is the paper's configuration; more use power utility over their first 240 months, and
    /// `/observe` chooses their composition anew
    #[arg(long, default_value_t = 1)]
    assets: usize,
    /// CSV file of simple returns of several assets: dates, assets, and the bank in the last column
    #[arg(long, default_value = "data/us_industries_monthly.csv")]
    file: PathBuf,
}

/// Months of history of several assets before the first period.
const MONTHS: usize = 240;

pub async fn run(bench: &ActionBench) -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let mut config = Config::new(folder.path());
    config.listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let service = serve(config, Shutdown::new()).await?;
    let measured = measure(&ApiClient::new(service.address), bench).await;
    service.stop().await?;
    measured
}

/// The training specification, and the returns reported for a session's first period.
struct ActionCase {
    specification: Value,
    returns: Vec<Value>,
}

impl ActionCase {
    fn of(bench: &ActionBench) -> Result<Self, Box<dyn Error>> {
        if bench.assets == 1 {
            let specification = paper::specification(20, bench.horizon, bench.count, InitialLaws::Given);
            // Returns spread evenly over the range that holds nine in ten draws of the mixture.
            let spread = |call: usize| -0.15 + 0.3 * (call as f64 * 0.618_033_988_75).fract();
            let returns = (0..bench.calls).map(|call| json!({ "log_return": spread(call), "confirm": true })).collect();
            return Ok(ActionCase { specification: serde_json::to_value(&specification)?, returns });
        }
        let rows = assets::read(&bench.file)?;
        let later = rows.len().saturating_sub(MONTHS);
        if later == 0 || rows[0].len() < bench.assets {
            return Err(
                format!("{} has {} months of {} assets", bench.file.display(), rows.len(), rows[0].len()).into()
            );
        }
        let names: Vec<String> = (1..=bench.assets).map(|asset| format!("asset_{asset}")).collect();
        let of = |row: &Vec<f64>| names.iter().cloned().zip(row.iter().map(|value| json!(value))).collect();
        let named = |call: usize| -> Map<String, Value> { of(&rows[MONTHS + call % later]) };
        let history: Vec<&[f64]> = rows[..MONTHS].iter().map(|row| &row[..bench.assets]).collect();
        let problem = json!({
            "assets": names,
            "history": history,
            "horizon": bench.horizon,
            "rate_per_step": assets::RATE,
            "utility": { "kind": "power", "risk_aversion": assets::RISK_AVERSION },
        });
        Ok(ActionCase {
            specification: json!({ "problem": problem, "design": { "count": bench.count }, "seed": 1 }),
            returns: (0..bench.calls).map(|call| json!({ "log_returns": named(call), "confirm": true })).collect(),
        })
    }
}

async fn measure(api: &ApiClient, bench: &ActionBench) -> Result<(), Box<dyn Error>> {
    let case = ActionCase::of(bench)?;
    println!("training {} design points, {} steps", bench.count, bench.horizon);
    let job = api.post("/train", &case.specification).await?;
    let mut events = api.events(&format!("/jobs/{}/events", text(&job, "job")?)).await?;
    let mut last = job;
    while let Some(event) = events.next().await? {
        last = event;
    }
    let policy = text(&last, "policy")?;
    let (mut observe, mut first, mut again, mut livez, mut resolved) = (vec![], vec![], vec![], vec![], 0);
    for returns in case.returns {
        // The first step is solved at one state; the second, after an observation, answers from the surrogates.
        let opened = api.post("/sessions", &json!({ "policy": policy })).await?;
        let session = text(&opened, "session")?;
        let mut report = returns;
        report["session"] = json!(session);
        report["period"] = json!(1);
        let started = Instant::now();
        api.post("/observe", &report).await?;
        observe.push(1e6 * started.elapsed().as_secs_f64());
        let action = format!("/action?session={session}");
        first.push(microseconds(api, &action).await?);
        again.push(microseconds(api, &action).await?);
        livez.push(microseconds(api, "/livez").await?);
        resolved += usize::from(api.get(&action).await?["source"] != "policy_surrogate");
    }
    println!("{:<26} {:>10} {:>10}   of {} sessions", "call", "median us", "99 % us", bench.calls);
    let calls = [("/observe", &observe), ("/action", &first), ("/action, again", &again), ("/livez", &livez)];
    for (name, times) in calls {
        println!("{name:<26} {:>10.0} {:>10.0}", quantile(times, 0.5), quantile(times, 0.99));
    }
    println!("{resolved} of them lay outside the design and were re-solved");
    Ok(())
}

async fn microseconds(api: &ApiClient, path: &str) -> Result<f64, ApiError> {
    let started = Instant::now();
    api.touch(path).await?;
    Ok(1e6 * started.elapsed().as_secs_f64())
}

fn text<'a>(value: &'a Value, field: &str) -> Result<&'a str, String> {
    value[field].as_str().ok_or_else(|| format!("no {field} in {value}"))
}
