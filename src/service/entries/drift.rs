//! Tests whether a session's returns still come from the same law as those behind its advice.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::statistics::exchangeability::{TestMartingale, p_value};
use crate::service::metrics::DRIFT_ALARMS;

/// Values of the test martingale that cause a warning and an alarm. If nothing changes, the chance of ever an alarm is
/// at most 1 %.
const WARNING: f64 = 20.0;
const ALARM: f64 = 100.0;
/// The largest value that is reported.
const LARGEST: f64 = 1e12;

/// A bet that the order of the returns matters. It wins if new returns lie further from the median of all than those
/// before them did: their volatility or their mean has changed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Drift {
    /// P-value of the last return: the share of the record that lies as far from its median. Null if none was observed.
    pub p_value: Option<f64>,
    /// The value of the test martingale, which starts at 1; at most 1e12.
    pub capital: f64,
    /// Its highest value so far. If nothing changes, at most a share 1 / c of sessions ever reaches c.
    pub highest: f64,
    /// Level of the highest value: `warning` from 20 on, `alarm` from 100 on.
    pub level: DriftLevel,
}

/// The meaning of the highest value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DriftLevel {
    /// Nothing unusual.
    None,
    /// The returns may have changed.
    Warning,
    /// The returns have changed, or one session in a hundred was unlucky.
    Alarm,
}

/// The drift test of a session, and its last p-value.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DriftTest {
    capital: TestMartingale,
    p_value: Option<f64>,
}

impl DriftTest {
    /// Updates the test with `log_return`, the last one in `record`, of `period` of `session`. A missing return changes
    /// nothing.
    #[must_use]
    pub(in crate::service) fn after(
        self,
        record: &EmpiricalDistribution,
        log_return: Option<f64>,
        session: &str,
        period: usize,
    ) -> DriftTest {
        let Some(log_return) = log_return else { return self };
        let p_value = p_value(record, log_return, tie(session, period));
        DriftTest { capital: self.capital.after(p_value), p_value: Some(p_value) }
    }

    /// Returns the test as answers show it.
    pub fn drift(self) -> Drift {
        let [capital, highest] = [self.capital.log(), self.capital.log_highest()].map(|log| log.exp().min(LARGEST));
        Drift { p_value: self.p_value, capital, highest, level: self.level() }
    }

    /// Returns the level of the highest value.
    pub fn level(self) -> DriftLevel {
        match self.capital.log_highest().exp() {
            highest if highest >= ALARM => DriftLevel::Alarm,
            highest if highest >= WARNING => DriftLevel::Warning,
            _ => DriftLevel::None,
        }
    }
}

/// Returns a uniform number in (0, 1] that breaks ties between equal returns. It is the same at every replay. Clients
/// cannot choose it because the name of a session is drawn at random.
fn tie(session: &str, period: usize) -> f64 {
    let digest = Sha256::new().chain_update(session).chain_update((period as u64).to_le_bytes()).finalize();
    let bits = digest.iter().take(8).fold(0_u64, |bits, &byte| bits << 8 | u64::from(byte));
    ((bits >> 11) + 1) as f64 / (1_u64 << 53) as f64
}

/// Counts a session whose level rose.
pub(in crate::service) fn count(before: DriftLevel, after: DriftLevel) {
    for (level, name) in [(DriftLevel::Warning, "warning"), (DriftLevel::Alarm, "alarm")] {
        if before < level && level <= after {
            metrics::counter!(DRIFT_ALARMS, "level" => name).increment(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For 10,000 draws, the largest gap between the empirical and the uniform law is below 1.63 / sqrt(10,000) with
    /// probability 99 %.
    #[test]
    fn ties_are_parted_by_uniform_numbers() {
        let mut ties: Vec<f64> =
            (0..100).flat_map(|name| (1..=100).map(move |period| tie(&format!("s{name}"), period))).collect();
        ties.sort_by(f64::total_cmp);
        assert!(ties[0] > 0.0 && ties[9999] <= 1.0);
        let gap =
            ties.iter().enumerate().map(|(rank, tie)| (tie - (rank as f64 + 0.5) / 1e4).abs()).fold(0.0, f64::max);
        assert!(gap < 0.0163, "{gap}");
    }
}
