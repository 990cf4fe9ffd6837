//! The investor of the story: the goals, and the information before a month.

use serde_json::{Value, json};

use super::DemoError;
use crate::command::returns::Returns;

/// Months of history: twenty years.
pub const HISTORY: usize = 240;
pub const INITIAL_WEALTH: f64 = 100.0;
pub const RISK_AVERSION: f64 = 3.0;
pub const ALPHA: f64 = 0.1;

/// The information available before a month.
pub struct Past {
    pub month: String,
    log_returns: Vec<f64>,
    /// Bank return per month, equal to that of the last known month.
    pub rate: f64,
    mean_return: f64,
}

impl Past {
    pub fn before(market: &Returns, month: &str) -> Result<Self, DemoError> {
        let months = market.before(month, HISTORY)?;
        Ok(Past {
            month: month.into(),
            log_returns: months.iter().map(|row| row.risky_return.ln_1p()).collect(),
            rate: months.last().map_or(0.0, |row| row.risk_free_return),
            mean_return: months.iter().map(|row| row.risky_return).sum::<f64>() / months.len() as f64,
        })
    }

    /// Returns the known record as part of a request.
    pub fn record(&self) -> Value {
        json!({ "framework": "adaptive", "rate_per_step": self.rate, "history": self.log_returns })
    }

    /// Returns the mean monthly return beyond the bank.
    pub fn edge(&self) -> f64 {
        self.mean_return - self.rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn january_2008_pays_beyond_the_bank_more_than_the_radius_and_1987_less() {
        let market = Returns::bundled().unwrap();
        assert!(Past::before(&market, "2008-01").unwrap().edge() > 0.0049);
        assert!(Past::before(&market, "1987-01").unwrap().edge() < 0.0056);
    }
}
