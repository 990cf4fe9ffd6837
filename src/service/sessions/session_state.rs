//! The state of a session of any problem, and the transition that a report causes.
//!
//! This is the one place that knows which problems there are: the entries of a session, their order, corrections and
//! replays are the same for all of them. A problem brings its state, how a report moves it, and how answers show it.

use crate::control::error::FieldError;
use crate::control::request::declared::DeclaredProblem;
use crate::control::request::learning::Learning;
use crate::service::entries::days::Days;
use crate::service::entries::doubts::Doubt;
use crate::service::entries::drift::DriftTest;
use crate::service::entries::record::{PeriodNoise, SessionRecord};
use crate::service::entries::report::Report;
use crate::service::error::ServiceError;
use crate::service::sessions::account_state::{AccountPeriod, AccountState};
use crate::service::sessions::advised::{AdvisedActions, AdvisedShares};
use crate::service::sessions::asset_change::AssetChange;
use crate::service::sessions::assets::Composition;
use crate::service::sessions::plan::{PolicyTenure, SessionPlan};
use crate::service::sessions::problem_state::{ProblemPeriod, ProblemState};
use crate::service::sessions::transition::Transition;
use crate::store::SessionRow;

/// Copies of the asset names: in the order of the columns, in the plan, and in the answers.
const COPIES_OF_NAMES: usize = 8;

/// The state of a session between two periods.
#[derive(Debug, Clone)]
pub enum SessionState {
    /// An investor's.
    Account(Box<AccountState>),
    /// A declared problem's.
    Declared(Box<ProblemState>),
}

/// A period as a report moved it.
#[derive(Debug, Clone, PartialEq)]
pub enum Moved {
    Account(AccountPeriod),
    Declared(ProblemPeriod),
}

/// The changes that the next policy of a session brings.
#[derive(Debug, Clone)]
pub enum NextPolicy {
    /// An investor's, perhaps with other assets.
    Account(Option<AssetChange>),
    /// The problem from here on.
    Declared(Box<DeclaredProblem>),
}

impl NextPolicy {
    /// Returns the change of the assets, if there is one.
    pub(in crate::service) fn asset_change(&self) -> Option<&AssetChange> {
        match self {
            NextPolicy::Account(change) => change.as_ref(),
            NextPolicy::Declared(_) => None,
        }
    }
}

impl SessionState {
    /// Returns the state before the first period, and the record that its law is made of.
    ///
    /// # Errors
    /// The row is not that of a session.
    pub(in crate::service) fn start(
        row: &SessionRow,
        plan: &SessionPlan,
    ) -> Result<(Self, SessionRecord), ServiceError> {
        match &plan.problem {
            Some(problem) => {
                let (state, record) = ProblemState::start(row, problem)?;
                Ok((SessionState::Declared(state.into()), record))
            }
            None => {
                let (state, record) = AccountState::start(row, plan)?;
                Ok((SessionState::Account(state.into()), record))
            }
        }
    }

    /// Returns the state of an investor.
    ///
    /// # Errors
    /// The session lives a declared problem.
    pub fn account(&self) -> Result<&AccountState, FieldError> {
        match self {
            SessionState::Account(state) => Ok(state),
            SessionState::Declared(_) => {
                let rule = "must be of an investor";
                Err(FieldError::new("session", "of a declared problem", rule))
            }
        }
    }

    /// Returns the last days of the periods.
    pub fn days(&self) -> &Days {
        match self {
            SessionState::Account(state) => &state.days,
            SessionState::Declared(state) => &state.days,
        }
    }

    /// Returns the test of whether the noises still come from the same law.
    pub fn bet(&self) -> DriftTest {
        match self {
            SessionState::Account(state) => state.bet,
            SessionState::Declared(state) => state.bet,
        }
    }

    /// Returns the names of the assets if there are several; otherwise empty.
    pub(in crate::service) fn names(&self) -> &[String] {
        match self {
            SessionState::Account(state) => state.names(),
            SessionState::Declared(_) => &[],
        }
    }

    /// Returns the number of noises that the state holds.
    pub(in crate::service) fn noises(&self) -> usize {
        match self {
            SessionState::Account(state) => state.returns(),
            SessionState::Declared(state) => state.noises(),
        }
    }

    /// Returns the bytes of its names, and of the formulas and the advice of a declared problem.
    pub(in crate::service) fn other_bytes(&self) -> usize {
        match self {
            SessionState::Account(state) => COPIES_OF_NAMES * state.names().iter().map(String::len).sum::<usize>(),
            SessionState::Declared(state) => state.bytes(),
        }
    }

    /// Returns the number of noises behind the law.
    pub fn sample_size(&self) -> usize {
        match self {
            SessionState::Account(state) => state.state.law.sample_size(),
            SessionState::Declared(state) => state.noises(),
        }
    }

    /// Returns the number of atoms of the law that an advice shows without being asked: none of an investor's.
    pub(in crate::service) fn law_shown(&self) -> usize {
        match self {
            SessionState::Account(_) => 0,
            SessionState::Declared(state) => state.noises(),
        }
    }

    /// Reads the noise of the coming period from `report`.
    ///
    /// # Errors
    /// A field breaks a rule, or the date is not after the last one.
    pub(in crate::service) fn read(&self, report: &Report) -> Result<PeriodNoise, FieldError> {
        match self {
            SessionState::Account(state) => state.read(report),
            SessionState::Declared(state) => state.read(report),
        }
    }

    /// Returns doubts about the noise of a report, each against the record.
    pub(in crate::service) fn noise_doubts(&self, report: &Report, seen: &PeriodNoise) -> Vec<Doubt> {
        match self {
            SessionState::Account(state) => state.return_doubts(report, seen),
            SessionState::Declared(state) => state.noise_doubts(report.noise),
        }
    }

    /// Returns the effect of `report` on the period after `observed` ones of a session under `tenure`, for which so much
    /// was advised. A report without a day takes the next one due, if the periods of a year are known.
    ///
    /// # Errors
    /// As [`Self::read`], or the state leaves its range.
    pub(in crate::service) fn after(
        &self,
        (tenure, observed): (&PolicyTenure, usize),
        report: &Report,
        advised: &AdvisedActions,
    ) -> Result<Transition<SessionState, Moved>, FieldError> {
        match self {
            SessionState::Account(state) => {
                let calendar = (advised.shares(), tenure.terms.periods_per_year);
                let passed = state.after(tenure.dynamics(observed), observed + 1, report, calendar)?;
                Ok(passed.map(|state| SessionState::Account(state.into()), Moved::Account))
            }
            SessionState::Declared(state) => {
                let passed = state.after((tenure.step(observed), observed + 1), report, advised.actions())?;
                Ok(passed.map(|state| SessionState::Declared(state.into()), Moved::Declared))
            }
        }
    }

    /// Returns the report of a period for which nothing was advised, and what counts as advised for it: of an investor
    /// to hold on.
    pub(in crate::service) fn held_on(&self, reported: &Report) -> (Report, AdvisedActions) {
        match self {
            SessionState::Account(state) => {
                let held_on = AdvisedShares { held: state.state.holding, spent: 0.0 };
                (state.held_on(reported), AdvisedActions::Shares(held_on))
            }
            SessionState::Declared(_) => (reported.clone(), AdvisedActions::Actions(Vec::new())),
        }
    }

    /// Takes over the prices reported with the last period.
    pub(in crate::service) fn price_as(&mut self, report: &Report) {
        if let SessionState::Account(state) = self {
            state.price_as(report);
        }
    }

    /// Applies a reported composition of several assets; the law must be rebuilt afterwards.
    ///
    /// # Errors
    /// It names other assets.
    pub(in crate::service) fn take(&mut self, reported: &Composition) -> Result<(), FieldError> {
        match self {
            SessionState::Account(state) => state.take(reported),
            SessionState::Declared(_) => Ok(()),
        }
    }

    /// Returns the state with the law of the fund rebuilt, if there are several assets.
    #[must_use]
    pub(in crate::service) fn with_law(self, learning: Learning) -> Self {
        match self {
            SessionState::Account(state) => SessionState::Account(state.with_law(learning).into()),
            declared @ SessionState::Declared(_) => declared,
        }
    }

    /// Returns the state at a renewal under `tenure`: the law of an investor is made of the record.
    ///
    /// # Errors
    /// The record is not a valid history, or the next problem does not fit the session.
    pub(in crate::service) fn renewed(
        &self,
        record: &SessionRecord,
        tenure: &PolicyTenure,
        next: &NextPolicy,
    ) -> Result<Self, FieldError> {
        match (self, next) {
            (SessionState::Declared(state), NextPolicy::Declared(problem)) => {
                Ok(SessionState::Declared(state.renewed(problem)?.into()))
            }
            (_, next) => {
                let change = next.asset_change();
                let renewed = self.account()?.renewed(record, tenure.window, &tenure.terms, change)?;
                Ok(SessionState::Account(renewed.into()))
            }
        }
    }
}

impl Moved {
    /// Returns the noise of a declared problem in its own unit, `None` if it is missing.
    pub(in crate::service) fn noise(&self) -> Option<f64> {
        match self {
            Moved::Account(_) => None,
            Moved::Declared(moved) => moved.noise,
        }
    }

    /// Returns the period of an investor.
    ///
    /// # Errors
    /// It is of a declared problem.
    pub(in crate::service) fn account(&self) -> Result<&AccountPeriod, ServiceError> {
        match self {
            Moved::Account(moved) => Ok(moved),
            Moved::Declared(_) => Err(ServiceError::internal("a period of another problem")),
        }
    }
}
