//! The second act: the same year with four industries, each held by its name.

use std::collections::BTreeMap;

use ballast::control::evaluation::assets::AssetsRecord;
use ballast::control::evaluation::names::StrategyKind;
use ballast::returns::Choices;
use serde_json::json;

use super::DemoError;
use super::calls::{DemoAssetsAdvice, DemoWorstMean, advice, observe, open_session, train};
use super::past::{HISTORY, INITIAL_WEALTH};
use super::story::{FIRST_MONTH, HORIZON, YEAR, tell_worst_case};
use crate::command::returns::{AnyReturns, ReturnsError};
use ballast::http::api_client::ApiClient;

const CSV: &str = include_str!("../../../data/us_industries_monthly.csv");
const INDUSTRIES: [&str; 4] = ["energy", "finance", "health", "utilities"];
/// Divisor of the design points of the first act: the laws of the second act start resampled, which takes longer.
const FEWER: usize = 4;
const FEWEST: usize = 10;
/// Trading cost, as a share of the amount traded, in the lines about trading.
const COST: f64 = 0.001;

/// Trains for the four industries, explains their holdings, and goes through the year.
pub async fn narrate(api: &ApiClient, count: usize) -> Result<(), DemoError> {
    let record = industries()?;
    let start = record.dates.partition_point(|date| date.as_str() < FIRST_MONTH);
    let count = (count / FEWER).max(FEWEST);
    println!("\nSecond act: the same investor, the same year and four industries of the same {HISTORY} months.");
    println!(
        "One policy, with {count} design points a step, decides how much wealth is in a fund of them; the fund's \
         composition is"
    );
    println!("chosen anew each month.");
    let known = json!({
        "assets": record.assets,
        "rate_per_step": record.bank[start - 1],
        "history": record.rows[start - HISTORY..start],
    });
    let policy = train(api, known, HORIZON, count).await?;
    let session = open_session(api, &policy).await?;
    let first: DemoAssetsAdvice = advice(api, &session, true).await?;
    tell_first(&first, record.bank[start - 1]);
    live_through(api, &session, &record, start, &first).await
}

/// Reads the four industries of the bundled file.
fn industries() -> Result<AssetsRecord, ReturnsError> {
    let columns = INDUSTRIES.map(str::to_owned).to_vec();
    match AnyReturns::parse(CSV, &Choices { columns, ..Choices::default() }, None, None)? {
        AnyReturns::Several(several) => Ok(several.record),
        AnyReturns::One(_) => Err(ReturnsError::Several { found: 1 }),
    }
}

fn by_name(shares: &BTreeMap<String, f64>) -> String {
    let named = |(name, share): (&String, &f64)| format!("{name} {:.1} %", 100.0 * share);
    shares.iter().map(named).collect::<Vec<String>>().join(", ")
}

fn tell_first(advised: &DemoAssetsAdvice, rate: f64) {
    println!(
        "\nAdvice for {FIRST_MONTH}: hold {:.0} % in all, {}.",
        100.0 * advised.total,
        by_name(&advised.allocation)
    );
    println!(
        "That is worth {:.2} for certain at the horizon; the bank alone pays {:.2}. The radius, {:.4}, holds for all funds",
        advised.certainty_equivalent, advised.floor, advised.radius
    );
    println!(
        "of the four at once. The average log-return of a month, as seen and under the worst law, with {:.2} % of the bank:",
        100.0 * rate
    );
    for (name, DemoWorstMean { seen, worst }) in &advised.one_step.worst_means {
        println!("  {name:<10} {:>6.2} % {:>6.2} %", 100.0 * seen, 100.0 * worst);
    }
    tell_worst_case("this", advised.worst_case.as_ref());
}

/// Prints one line per month, next to all wealth in equal shares of the four; then the cost of trading.
async fn live_through(
    api: &ApiClient,
    session: &str,
    record: &AssetsRecord,
    start: usize,
    first: &DemoAssetsAdvice,
) -> Result<(), DemoError> {
    println!("\nThe year {YEAR}, month by month, with the share of wealth in each:");
    let names: String = record.assets.iter().map(|name| format!(" {name:>10}")).collect();
    let equal_shares = StrategyKind::EqualShares.name();
    println!("{:<8}{names} {:>8} {:>9} {equal_shares:>13}", "month", "in all", "wealth");
    let (mut wealth, mut equal, mut traded) = (INITIAL_WEALTH, INITIAL_WEALTH, 0.0);
    for month in start..start + HORIZON {
        let advised: DemoAssetsAdvice = advice(api, session, false).await?;
        let returns: BTreeMap<&String, f64> =
            record.assets.iter().zip(&record.rows[month]).map(|(name, z)| (name, z.exp_m1())).collect();
        wealth = observe(api, session, advised.period, ("simple_returns", json!(returns))).await?;
        equal *= 1.0 + returns.values().sum::<f64>() / returns.len() as f64;
        traded += advised.trade.values().map(|share| share.abs()).sum::<f64>();
        let held: String = advised.allocation.values().map(|share| format!(" {share:>10.3}")).collect();
        println!("{:<8}{held} {:>8.3} {wealth:>9.2} {equal:>13.2}", record.dates[month], advised.total);
    }
    println!(
        "\nWhat it cost: {INITIAL_WEALTH} became {wealth:.2}. Equal shares of all wealth became {equal:.2}, and the bank would have paid \
         {:.2}.",
        first.floor
    );
    println!(
        "{:.0} % of wealth was bought and sold in the year; at {:.1} % of what is traded that is {:.2} % of wealth.",
        100.0 * traded,
        100.0 * COST,
        100.0 * COST * traded
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_industries_have_the_year_and_twenty_before() {
        let record = industries().unwrap();
        assert_eq!(record.assets, INDUSTRIES);
        let start = record.dates.partition_point(|date| date.as_str() < FIRST_MONTH);
        assert_eq!((record.dates[start].as_str(), record.dates[start - HISTORY].as_str()), (FIRST_MONTH, "1988-01"));
        assert_eq!(record.dates[start + HORIZON - 1], "2008-12");
        assert_eq!(by_name(&BTreeMap::from([("a".into(), 0.1234), ("b".into(), 0.0)])), "a 12.3 %, b 0.0 %");
    }
}
