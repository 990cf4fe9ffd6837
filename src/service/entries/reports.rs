//! Reports of many sessions at once: each element of a list is handled like a call of its own, except for doubts that
//! its peers raise.
//!
//! A list is not a transaction and needs none, because each element is recorded exactly once. The same list sent again
//! gets the same answers, and resumes if the first call was cut off. A list saves the overhead of a call for each
//! report.
//! Its reports also reach the store together, which writes them together.

use std::collections::HashSet;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Instant;

use futures_util::{StreamExt, stream};
use tokio::sync::Semaphore;

use crate::control::error::FieldError;
use crate::service::callers::allowance::{Class, HeavyPermit};
use crate::service::callers::keys::Caller;
use crate::service::entries::report::Observe;
use crate::service::error::ServiceError;
use crate::service::metrics::OBSERVE_SECONDS;
use crate::service::sessions::Sessions;

/// Number of reports in one list.
pub const REPORTS: RangeInclusive<usize> = 1..=1000;
/// Elements of one list in progress at a time: two commits of the store, so that one is prepared while the other is
/// written.
const AT_A_TIME: usize = 128;

/// The outcome of one element of a list.
#[derive(Debug)]
pub struct Reported {
    pub session: String,
    pub period: usize,
    /// The answer in JSON as it was recorded.
    pub outcome: Result<String, ServiceError>,
}

impl Sessions {
    /// Records one report as [`Sessions::observe`] does.
    ///
    /// # Errors
    /// As [`Sessions::observe`].
    pub async fn report(&self, caller: &Caller, report: Observe, turn: &HeavyPermit) -> Result<String, ServiceError> {
        let started = Instant::now();
        let report = Observe { reported_by: caller.key().clone(), ..report };
        let answer = self.observe(&caller.tenant, &report, turn).await?;
        metrics::histogram!(OBSERVE_SECONDS).record(started.elapsed().as_secs_f64());
        Ok(answer)
    }

    /// Records a list of reports, each like a call of its own, and returns their outcomes in order. The call itself
    /// took the first element from the rate limit; every other element is taken here.
    ///
    /// # Errors
    /// The list is empty or too long, or names a session twice. Nothing is recorded in that case.
    pub async fn report_all(&self, caller: &Caller, reports: Vec<Observe>) -> Result<Vec<Reported>, ServiceError> {
        check(&reports)?;
        // As many at a time as can begin, and at most the tenant's limit of heavy calls.
        let lane = Arc::new(Semaphore::new(self.resolving.of_one.min(caller.allowance.heavy_of_one())));
        let doubts = self.peer_doubts(caller, &reports).await;
        let elements = reports.into_iter().zip(doubts).enumerate().map(|(index, (report, peer_doubts))| {
            let report = Observe { peer_doubts, ..report };
            let turn = HeavyPermit::in_lane(caller.allowance.clone(), lane.clone());
            async move {
                let (session, period) = (report.session.clone(), report.period);
                let counted = if index == 0 { Ok(()) } else { caller.allowance.take(Class::Live) };
                let outcome = match counted {
                    Ok(()) => self.report(caller, report, &turn).await,
                    Err(refused) => Err(refused.into()),
                };
                (index, Reported { session, period, outcome })
            }
        });
        let mut reported: Vec<_> = stream::iter(elements).buffer_unordered(AT_A_TIME).collect().await;
        reported.sort_unstable_by_key(|(index, _)| *index);
        Ok(reported.into_iter().map(|(_, reported)| reported).collect())
    }
}

/// Checks the list. Two periods of one session would race, and chance would decide which is rejected.
fn check(reports: &[Observe]) -> Result<(), FieldError> {
    if !REPORTS.contains(&reports.len()) {
        return Err(FieldError::new("body", format!("{} reports", reports.len()), too_many()));
    }
    let mut named = HashSet::with_capacity(reports.len());
    match reports.iter().position(|report| !named.insert(report.session.as_str())) {
        None => Ok(()),
        Some(index) => {
            let rule = "must be another session: a list holds one period of each session";
            Err(FieldError::new(format!("[{index}].session"), &reports[index].session, rule))
        }
    }
}

/// Returns the rule for the length of a list.
pub fn too_many() -> String {
    format!("must hold {} to {} reports", REPORTS.start(), REPORTS.end())
}
