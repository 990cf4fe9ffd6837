//! Time, as an argument.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use jiff::Timestamp;
use jiff::civil::Date;
use jiff::tz::TimeZone;

/// The source of the time; tests supply their own.
#[derive(Clone)]
pub struct Clock(Arc<dyn Fn() -> i64 + Send + Sync>);

impl fmt::Debug for Clock {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Clock(..)")
    }
}

impl Clock {
    /// Builds a clock from `read`, which returns milliseconds since 1970.
    pub fn new(read: impl Fn() -> i64 + Send + Sync + 'static) -> Self {
        Clock(Arc::new(read))
    }

    pub fn system() -> Self {
        Clock::new(|| {
            let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            i64::try_from(since_epoch.as_millis()).unwrap_or(i64::MAX)
        })
    }

    /// Returns this clock set back by `ahead_ms`, which may change.
    pub(in crate::service) fn behind(&self, ahead_ms: Arc<AtomicI64>) -> Self {
        let clock = self.clone();
        Clock::new(move || clock.now_milliseconds().saturating_sub(ahead_ms.load(Ordering::Relaxed)))
    }

    /// Returns milliseconds since 1970-01-01 UTC.
    pub fn now_milliseconds(&self) -> i64 {
        (self.0)()
    }

    /// Returns the day in UTC. If the clock has left the calendar this is the last day, so that nothing lies in its
    /// future.
    pub(in crate::service) fn today(&self) -> Date {
        day_of(self.now_milliseconds()).unwrap_or(Date::MAX)
    }
}

/// Returns the day in UTC of a time in milliseconds since 1970.
pub(in crate::service) fn day_of(milliseconds: i64) -> Option<Date> {
    Some(Timestamp::from_millisecond(milliseconds).ok()?.to_zoned(TimeZone::UTC).date())
}
