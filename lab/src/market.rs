//! The bundled months of the US stock market and of Treasury bills.

use std::num::ParseFloatError;

pub struct Market {
    pub log_returns: Vec<f64>,
    /// Mean simple return of the bank, a month.
    pub bank: f64,
}

impl Market {
    /// Parses the bundled file: a date, a simple return of the market and one of the bank in each row.
    pub fn bundled() -> Result<Self, ParseFloatError> {
        let months = include_str!("../../data/us_market_monthly.csv").lines().skip(1);
        let rows: Vec<Vec<f64>> =
            months.map(|row| row.split(',').skip(1).map(str::parse).collect()).collect::<Result<_, _>>()?;
        let bank = rows.iter().map(|row| row[1]).sum::<f64>() / rows.len() as f64;
        Ok(Market { log_returns: rows.iter().map(|row| row[0].ln_1p()).collect(), bank })
    }
}
