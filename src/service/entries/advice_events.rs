//! The events that a report causes: the advice changed, the holding left its band, the drift alarm was raised.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::service::entries::drift::DriftLevel;
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::service::sessions::current_advice::{AdviceContext, CurrentAdvice};
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::session_state::SessionState;
use crate::store::{EventKind, NewEvent};

/// Rounding of a share of wealth.
const ROUNDING: f64 = 1e-9;

/// The advice before a report, and the levels of drift before and after it.
pub(super) struct BeforeReport {
    /// `None` if no subscription asks for it, or nothing was advised.
    pub advised: Option<BTreeMap<String, f64>>,
    pub levels: (DriftLevel, DriftLevel),
}

/// Returns the advice of a session by name: the share of wealth in each asset, or each action.
pub(super) fn by_name(live: &LiveSession) -> Option<BTreeMap<String, f64>> {
    match (live.advice.as_ref()?, &live.standing) {
        (CurrentAdvice::Account(advice), SessionState::Account(account)) => Some(match &account.assets {
            None => BTreeMap::from([("allocation".to_owned(), advice.allocation)]),
            Some(assets) => {
                let shares = assets.composed().composition.into_iter();
                shares.map(|(name, share)| (name, share * advice.allocation)).collect()
            }
        }),
        (CurrentAdvice::Declared(decided), _) => Some(decided.actions.clone()),
        _ => None,
    }
}

impl Sessions {
    /// Returns the events of the entry that leads to `next`. The advice after it is computed if a subscription asks for
    /// it, and stays with the session. If the policy has none, no event is about it: the report is a fact anyhow.
    ///
    /// # Errors
    /// Too much is computed already. The report is not recorded and can be sent again.
    pub(super) async fn events(
        &self,
        means: &AdviceContext<'_>,
        before: BeforeReport,
        next: &mut LiveSession,
    ) -> Result<Vec<NewEvent>, ServiceError> {
        let mut events: Vec<NewEvent> = alarm(next, before.levels, self.clock.now_milliseconds()).into_iter().collect();
        let Some(advised) = before.advised.filter(|_| next.check_active().is_ok()) else { return Ok(events) };
        match next.current_advice(means).await {
            Ok(_) => {}
            Err(error @ (ServiceError::Busy | ServiceError::Refused(_))) => return Err(error),
            Err(error) => {
                let session = next.row.session.as_str();
                tracing::warn!(session, error = &error as &dyn std::error::Error, "an event has no advice");
                return Ok(events);
            }
        }
        events.extend(change(next, advised, self.clock.now_milliseconds()));
        events.extend(left_band(next, self.clock.now_milliseconds()));
        Ok(events)
    }
}

/// Returns the event that the drift alarm was raised.
pub(super) fn alarm(next: &LiveSession, levels: (DriftLevel, DriftLevel), at_ms: i64) -> Option<NewEvent> {
    if levels.0 == DriftLevel::Alarm || levels.1 != DriftLevel::Alarm {
        return None;
    }
    let drift = next.standing.bet().drift();
    let data = json!({ "session": next.row.session, "period": next.observed, "highest": drift.highest });
    Some(event(next, EventKind::DriftAlarm, f64::INFINITY, data, at_ms))
}

/// Returns the event that the advice changed. An asset that left or joined counts with its whole share.
fn change(next: &LiveSession, before: BTreeMap<String, f64>, at_ms: i64) -> Option<NewEvent> {
    let after = by_name(next)?;
    let share = |of: &BTreeMap<String, f64>, name: &str| of.get(name).copied().unwrap_or_default();
    let differences = before.keys().chain(after.keys()).map(|name| (share(&after, name) - share(&before, name)).abs());
    let change = differences.fold(0.0, f64::max);
    if change == 0.0 {
        return None;
    }
    let (session, period) = (&next.row.session, next.observed + 1);
    let data = json!({ "session": session, "period": period, "change": change, "before": before, "after": after });
    Some(event(next, EventKind::AdviceChanged, change, data, at_ms))
}

/// Returns the event that the holding lies outside of the band, so that a trade is advised.
fn left_band(next: &LiveSession, at_ms: i64) -> Option<NewEvent> {
    let Some(CurrentAdvice::Account(advice)) = &next.advice else { return None };
    let (band, holding) = (advice.band, advice.holding);
    // Without trading costs every holding is to be traded.
    let is_costly = next.current.terms.trading_cost > 0.0;
    if !is_costly || (band.low - ROUNDING..=band.high + ROUNDING).contains(&holding) {
        return None;
    }
    let data = json!({
        "session": next.row.session, "period": next.observed + 1, "holding": holding, "band": band,
        "trade": advice.trade,
    });
    Some(event(next, EventKind::LeftBand, f64::INFINITY, data, at_ms))
}

fn event(next: &LiveSession, kind: EventKind, change: f64, data: Value, at_ms: i64) -> NewEvent {
    let session = next.row.session.clone();
    let fact = format!("{session}\n{}", next.seen.entries());
    NewEvent { kind, session, fact, change, data, at_ms }
}
