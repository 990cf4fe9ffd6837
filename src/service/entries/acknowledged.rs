//! The parts of an acknowledged answer to an observation that a replay reads.

use serde::Deserialize;

use crate::service::entries::notes::{self, PeriodNote};
use crate::service::entries::report::Report;
use crate::service::sessions::assets::{Composition, ObservedAssets};

/// The numbers of the answer to an observation.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Acknowledged {
    log_return: Option<f64>,
    pub advised_allocation: f64,
    executed_allocation: f64,
    wealth: f64,
    assets: Option<ObservedAssets>,
    #[serde(default)]
    notes: Vec<PeriodNote>,
}

impl Acknowledged {
    /// Returns the report with the acknowledged numbers, so that a replay on another processor or library agrees with
    /// them.
    pub(in crate::service) fn report(&self, reported: &Report) -> Report {
        let Report { date, rate, flow, .. } = *reported;
        let wealth = Some(self.wealth);
        let common = Report { wealth, date, rate, flow, is_recorded: true, ..Report::default() };
        let of_lost = |asset| notes::is_lost(&self.notes, asset).then_some(f64::NEG_INFINITY);
        match &self.assets {
            Some(assets) => Report {
                log_returns: assets.log_returns.as_ref().map(|all| {
                    all.iter().map(|(name, seen)| (name.clone(), seen.or_else(|| of_lost(Some(name))))).collect()
                }),
                missing: assets.log_returns.is_none(),
                executed_allocations: Some(assets.executed_allocations.clone()),
                ..common
            },
            None => {
                let log_return = self.log_return.or_else(|| of_lost(None));
                let executed_allocation = Some(self.executed_allocation);
                Report { log_return, missing: log_return.is_none(), executed_allocation, ..common }
            }
        }
    }

    /// Returns the report. Several assets that were held as advised get their advised allocations as the executed ones.
    pub(super) fn held_as_advised(&self, reported: &Report) -> Report {
        let mut report = reported.clone();
        if let Some(assets) = &self.assets {
            report.executed_allocations.get_or_insert_with(|| assets.advised_allocations.clone());
        }
        report
    }

    /// Returns the acknowledged composition if there are several assets.
    pub(in crate::service) fn composed(&self) -> Option<&Composition> {
        self.assets.as_ref().map(|assets| &assets.composed)
    }
}
