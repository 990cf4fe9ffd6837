//! How long `GET /action` takes for one client on loopback.

use std::error::Error;
use std::time::Instant;

use ballast::control::request::specification::InitialLaws;
use ballast::numerics::summary::quantile;
use clap::Args;
use serde_json::{Value, json};

use super::paper;
use crate::command::api_client::{ApiClient, ApiError};
use crate::command::host::Host;

#[derive(Debug, Args)]
pub struct ActionBench {
    /// Design points per step of the policy asked
    #[arg(long, default_value_t = 1000)]
    count: usize,
    #[arg(long, default_value_t = 2)]
    horizon: usize,
    /// Sessions asked
    #[arg(long, default_value_t = 1000)]
    calls: usize,
}

pub async fn run(bench: &ActionBench) -> Result<(), Box<dyn Error>> {
    let host = Host::start("bench").await?;
    let measured = measure(&ApiClient::new(host.address), bench).await;
    host.stop().await;
    measured
}

async fn measure(api: &ApiClient, bench: &ActionBench) -> Result<(), Box<dyn Error>> {
    let specification = paper::specification(20, bench.horizon, bench.count, InitialLaws::Given);
    println!("training {} design points, {} steps", bench.count, bench.horizon);
    let job = api.post("/train", &serde_json::to_value(&specification)?).await?;
    let mut events = api.events(&format!("/jobs/{}/events", text(&job, "job")?)).await?;
    let mut last = job;
    while let Some(event) = events.next().await? {
        last = event;
    }
    let policy = text(&last, "policy")?;
    let (mut first, mut again, mut livez, mut resolved) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for call in 0..bench.calls {
        let session = open_session(api, policy, call).await?;
        let action = format!("/action?session={session}");
        first.push(microseconds(api, &action).await?);
        again.push(microseconds(api, &action).await?);
        livez.push(microseconds(api, "/livez").await?);
        resolved += usize::from(api.get(&action).await?["source"] != "policy_surrogate");
    }
    println!("{:<26} {:>10} {:>10}   of {} sessions", "call", "median us", "99 % us", bench.calls);
    for (name, times) in [("/action", &first), ("/action, asked again", &again), ("/livez", &livez)] {
        println!("{name:<26} {:>10.0} {:>10.0}", quantile(times, 0.5), quantile(times, 0.99));
    }
    println!("{resolved} of them lay outside the design and were re-solved");
    Ok(())
}

/// A session in its second period: the first step is solved at one state, the second answers from the surrogates.
async fn open_session(api: &ApiClient, policy: &str, index: usize) -> Result<String, Box<dyn Error>> {
    let session = api.post("/sessions", &json!({ "policy": policy })).await?;
    let session = text(&session, "session")?;
    // Returns spread evenly over what the mixture gives nine times in ten.
    let log_return = -0.15 + 0.3 * (index as f64 * 0.618_033_988_75).fract();
    api.post("/observe", &json!({ "session": session, "period": 1, "log_return": log_return })).await?;
    Ok(session.to_owned())
}

async fn microseconds(api: &ApiClient, path: &str) -> Result<f64, ApiError> {
    let started = Instant::now();
    api.touch(path).await?;
    Ok(1e6 * started.elapsed().as_secs_f64())
}

fn text<'a>(value: &'a Value, field: &str) -> Result<&'a str, String> {
    value[field].as_str().ok_or_else(|| format!("no {field} in {value}"))
}
