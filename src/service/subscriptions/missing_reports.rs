//! Looks now and again for reports that are due or late, and stores an event for each that a subscription asks for.
//!
//! Every process looks. The store keeps for which report of a session an event was stored, so there is one of each kind
//! for it, whoever finds it.

use std::time::Duration;

use jiff::civil::Date;
use serde_json::json;
use tokio::time::MissedTickBehavior;

use crate::service::catalogue::overview::next_report;
use crate::service::entries::answer::StateSummary;
use crate::service::error::ServiceError;
use crate::service::jobs::due::first_day;
use crate::service::process::clock::{Clock, day_of};
use crate::service::process::shutdown::Shutdown;
use crate::service::sessions::content::read;
use crate::service::subscriptions::outbox::Outbox;
use crate::store::{Attention, EventKind, NewEvent, SessionFilter, SessionQuery, SessionSummary, Store, Tenant, Today};

/// Sessions read at a time.
const PAGE: usize = 256;

pub(in crate::service) struct MissingReports {
    pub store: Store,
    pub clock: Clock,
    pub outbox: Outbox,
    /// The time between two looks.
    pub pause: Duration,
}

impl MissingReports {
    /// Looks until the service ends.
    pub async fn run(self, shutdown: Shutdown) {
        let mut look = tokio::time::interval(self.pause);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = shutdown.begun() => return,
                _ = look.tick() => {}
            }
            if let Err(error) = self.look().await {
                tracing::warn!(error = &error as &dyn std::error::Error, "looking for missing reports failed");
            }
        }
    }

    async fn look(&self) -> Result<(), ServiceError> {
        let Some(today) = day_of(self.clock.now_milliseconds()) else { return Ok(()) };
        for kind in [EventKind::ReportDue, EventKind::ReportLate] {
            // A report that is due today would be late tomorrow.
            let day = if kind == EventKind::ReportDue { today.tomorrow().unwrap_or(today) } else { today };
            for tenant in self.store.subscribed([kind; 2]).await? {
                self.look_for(kind, &tenant, day).await?;
            }
        }
        Ok(())
    }

    /// Stores the events about reports of a tenant that are late on `day`.
    async fn look_for(&self, kind: EventKind, tenant: &Tenant, day: Date) -> Result<(), ServiceError> {
        let calendars = self.store.calendars(tenant).await?;
        let first_days: Vec<_> = calendars.into_iter().filter_map(|periods| first_day(day, periods)).collect();
        if first_days.is_empty() {
            return Ok(());
        }
        let reminded = self.store.reminded(tenant, kind).await?;
        let is_new = |row: &SessionSummary| reminded.get(&row.session).is_none_or(|before| *before < row.observations);
        let mut query = SessionQuery {
            is: Some(SessionFilter::Needing(Some(Attention::Overdue))),
            today: Today { first_days },
            limit: PAGE,
            ..SessionQuery::default()
        };
        loop {
            let page = self.store.sessions(tenant, &query).await?;
            for row in page.sessions.iter().filter(|row| is_new(row)) {
                let event = self.event(kind, row)?;
                if self.store.remind(tenant, row.observations, event).await? {
                    self.outbox.ring();
                }
            }
            match page.last {
                Some(place) => query.after = Some(place),
                None => return Ok(()),
            }
        }
    }

    fn event(&self, kind: EventKind, row: &SessionSummary) -> Result<NewEvent, ServiceError> {
        let stands: Option<StateSummary> = row.last.as_ref().map(|(answer, _)| read(answer)).transpose()?;
        let (session, period) = (row.session.clone(), row.observations + 1);
        let due = next_report(row, stands.as_ref());
        Ok(NewEvent {
            kind,
            fact: format!("{session}\n{period}"),
            change: f64::INFINITY,
            data: json!({ "session": session, "period": period, "due": due }),
            session,
            at_ms: self.clock.now_milliseconds(),
        })
    }
}
