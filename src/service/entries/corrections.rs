//! Applies a correction: replays the changed periods from the start.

use jiff::civil::Date;

use crate::control::error::FieldError;
use crate::control::request::text::check_text;
use crate::service::entries::change::Change;
use crate::service::entries::doubts::{self, Doubt, Doubts};
use crate::service::entries::periods::{Periods, ReplayedPeriod};
use crate::service::entries::report::{Correct, LONGEST_REASON, MOST_CORRECTIONS, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::plan::PolicyTenure;
use crate::service::sessions::session_state::SessionState;

/// The effect of a correction on a session.
pub(super) struct AppliedCorrection {
    /// The state before the correction.
    pub before: SessionState,
    /// The state after it.
    pub standing: SessionState,
    /// Periods observed after it.
    pub observed: usize,
    /// The period corrected or inserted as it is now; `None` if it is removed.
    pub now: Option<ReplayedPeriod>,
    /// The state before the last period, after the correction.
    pub before_last: SessionState,
}

impl Correct {
    /// Checks the correction by itself.
    ///
    /// # Errors
    /// The number is above the limit, or the reason is empty or too long.
    pub(in crate::service) fn check(&self) -> Result<(), FieldError> {
        if self.correction > MOST_CORRECTIONS {
            let rule = format!("must be at most {MOST_CORRECTIONS}: open a new session with the present history");
            return Err(FieldError::new("correction", self.correction, rule));
        }
        check_text("reason", &self.reason, 1..=LONGEST_REASON, &[])?;
        if self.reason.trim().is_empty() {
            return Err(FieldError::new(
                "reason",
                format!("{:?}", self.reason),
                "must not be blank: say why the period is corrected",
            ));
        }
        if self.change == Change::Remove && self.report() != Report::default() {
            return Err(FieldError::new("change", "remove", "must come without a report: the period is removed"));
        }
        Ok(())
    }
}

impl Periods {
    /// Applies the change of the correction, the entry with this index, and replays all periods.
    ///
    /// # Errors
    /// The correction names no observed period, makes a period break a rule, or raises a doubt without `confirm`.
    pub(super) fn apply_correction(
        &mut self,
        correction: &Correct,
        entry: usize,
        today: Date,
    ) -> Result<AppliedCorrection, ServiceError> {
        let (mut previous, mut passage) = (Vec::with_capacity(self.all.len() + 1), self.passage()?);
        while let Some(step) = passage.next().map_err(ServiceError::of_recorded)? {
            previous.push(Some((step.seen, passage.standing.days().last)));
        }
        let before = passage.standing;
        self.correct(correction, entry)?;
        match correction.change {
            Change::Replace => {}
            Change::Insert => previous.insert(correction.period - 1, None),
            Change::Remove => drop(previous.remove(correction.period - 1)),
        }
        let (mut now, mut doubts, mut passage) = (None, Vec::new(), self.passage()?);
        let mut before_last = passage.standing.clone();
        for (period, previous) in (1..).zip(previous) {
            let periods_per_year = passage.stretch().terms.periods_per_year;
            let passed = passage.next().map_err(|(period, error)| in_period(period, correction, error))?;
            let Some(passed) = passed else { break };
            let ReplayedPeriod { before, seen, .. } = &passed;
            let report = &self.all[period - 1].report;
            let (seen_before, day_before) = previous.unzip();
            let is_corrected = period == correction.period && correction.change != Change::Remove;
            if is_corrected && day_before != Some(passage.standing.days().last) {
                doubts.extend(doubts::of_day(before.days(), report.date, periods_per_year, today));
            }
            // A corrected price also changes the return after it.
            if seen_before.as_ref() != Some(seen) {
                doubts.extend(
                    before.noise_doubts(report, seen).into_iter().map(|doubt| later(period, correction, doubt)),
                );
            }
            before_last.clone_from(before);
            if is_corrected {
                now = Some(passed);
            }
        }
        if !doubts.is_empty() && !correction.confirm {
            return Err(ServiceError::Unconfirmed(Doubts(doubts)));
        }
        let standing = passage.stands();
        Ok(AppliedCorrection { before, standing, observed: self.all.len(), now, before_last })
    }
}

impl PolicyTenure {
    /// Checks that the `observed` periods of the session may be changed in this way under this policy.
    ///
    /// # Errors
    /// The change moves periods of earlier policies, or there is no room for one more period.
    pub(super) fn check_change(&self, correction: &Correct, observed: usize) -> Result<(), FieldError> {
        let Correct { period, change, .. } = *correction;
        if change.is_replace() {
            return Ok(());
        }
        if period <= self.after {
            let rule = format!(
                "must be later than {}, after which the session was renewed: replace a period of an earlier policy with a missing one instead",
                self.after
            );
            return Err(FieldError::new("period", period, rule));
        }
        if change == Change::Insert && observed >= self.horizon() {
            let rule = format!(
                "must leave at most {} periods, but {observed} are already observed: renew the session first",
                self.horizon()
            );
            return Err(FieldError::new("change", "insert", rule));
        }
        Ok(())
    }
}

/// Names the period in which a field breaks a rule because of the correction of another one.
fn in_period(period: usize, correction: &Correct, error: FieldError) -> FieldError {
    if period == correction.period {
        return error;
    }
    let rule = format!("in period {period}, after the correction of period {}: {}", correction.period, error.rule);
    FieldError { rule, ..error }
}

/// Names the period of a doubt that comes from the correction of another one.
fn later(period: usize, correction: &Correct, doubt: Doubt) -> Doubt {
    if period == correction.period {
        return doubt;
    }
    let sentence =
        format!("in period {period}, after the correction of period {}: {}", correction.period, doubt.sentence);
    Doubt { sentence, ..doubt }
}
