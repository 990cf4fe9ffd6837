//! The state of a session that lives a declared problem.
//!
//! A period moves it by the problem's own formula `next`, with the actions that were executed and the noise that was
//! seen. A state that is reported is believed.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::control::error::FieldError;
use crate::control::problem::declared::{Declared, EarnedState};
use crate::control::request::declared::DeclaredProblem;
use crate::control::request::support::LawExtent;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::service::entries::days::Days;
use crate::service::entries::doubts::{self, Doubt};
use crate::service::entries::drift::DriftTest;
use crate::service::entries::record::{PeriodNoise, SessionRecord};
use crate::service::entries::report::{OF_INVESTORS, Report, none_of};
use crate::service::error::ServiceError;
use crate::service::sessions::plan::PlannedProblem;
use crate::service::sessions::transition::Transition;
use crate::store::SessionRow;

/// Bytes of a parsed formula for each byte of its text.
const PARSED: usize = 16;
/// Bytes of the worst law that an advice shows, for each noise known: most noises are moved to two others at most.
const MOVES: usize = 48;

/// The state of a declared problem's session between two periods.
#[derive(Debug, Clone)]
pub struct ProblemState {
    problem: Arc<Declared>,
    /// The states, and the rewards since the start of the session.
    pub state: EarnedState,
    /// The worth at the start of an amount of the coming period: the discounts of all periods so far.
    discounted: f64,
    /// The noises under the present policy that did not miss, in the unit of the solver.
    pub seen: Vec<f64>,
    /// The last days of the periods.
    pub days: Days,
    /// The test of whether noises still come from the same law.
    pub bet: DriftTest,
    /// All noises known, in the unit of the solver.
    known: EmpiricalDistribution,
    session: Arc<str>,
    /// Bytes of its formulas.
    formulas: usize,
}

/// A period of a declared problem, as a report moved it.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemPeriod {
    /// The noise in its own unit, as it was reported; `None` if it is missing.
    pub noise: Option<f64>,
    /// The executed actions, in the order of their names.
    pub actions: Vec<f64>,
    /// The reward of the period by the formula. `None` if its noise is missing.
    pub reward: Option<f64>,
}

impl ProblemState {
    /// Returns the state at the start of a session, and the record that its law is made of.
    ///
    /// # Errors
    /// The problem or the state is not one.
    pub(in crate::service) fn start(
        row: &SessionRow,
        planned: &PlannedProblem,
    ) -> Result<(Self, SessionRecord), ServiceError> {
        let problem = Declared::parsed(&planned.problem)?;
        let state = problem.state("state", &planned.state)?;
        let history: Vec<f64> = row.initial_history.iter().map(|noise| problem.scaled(*noise)).collect();
        let formulas = planned.problem.formulas().map(str::len).sum();
        let start = ProblemState {
            problem: problem.into(),
            state,
            discounted: 1.0,
            seen: Vec::new(),
            days: Days::default(),
            bet: DriftTest::default(),
            known: EmpiricalDistribution::new(&history),
            session: row.session.as_str().into(),
            formulas,
        };
        Ok((start, SessionRecord::new(history)))
    }

    /// Returns the number of noises known.
    pub(in crate::service) fn noises(&self) -> usize {
        self.known.sample_size()
    }

    /// Returns the bytes of its formulas and of its advice.
    pub(in crate::service) fn bytes(&self) -> usize {
        PARSED * self.formulas + MOVES * self.noises()
    }

    /// Returns the same with other values of the states, read from a field with this name.
    ///
    /// # Errors
    /// They are not values of the states.
    pub(in crate::service) fn at(&self, field: &str, values: &BTreeMap<String, f64>) -> Result<Self, FieldError> {
        let supposed = self.problem.state(field, values)?;
        Ok(ProblemState { state: EarnedState { earned: self.state.earned, ..supposed }, ..self.clone() })
    }

    /// Returns the states by name.
    pub fn named(&self) -> BTreeMap<String, f64> {
        self.problem.states_by_name(&self.state)
    }

    /// Returns actions by name.
    pub(in crate::service) fn actions_named(&self, actions: &[f64]) -> BTreeMap<String, f64> {
        self.problem.actions_by_name(actions)
    }

    /// Reads the noise of the coming period from `report`.
    ///
    /// # Errors
    /// It is neither given nor missing, lies beyond its support, or a field of an investor is given.
    pub(in crate::service) fn read(&self, report: &Report) -> Result<PeriodNoise, FieldError> {
        none_of(&report.of_investors(), OF_INVESTORS)?;
        self.days.check_later(report.date)?;
        match (report.noise, report.missing) {
            (Some(noise), false) => Ok(PeriodNoise::of(Some(self.problem.checked_noise("noise", noise)?))),
            (None, true) => Ok(PeriodNoise::of(None)),
            (None, false) => Err(FieldError::new("noise", "null", "must be given, or missing instead of it")),
            (Some(_), true) => Err(FieldError::new("missing", true, "must be absent if noise is given")),
        }
    }

    /// Returns the doubt about a noise that lies far from all those known.
    pub(in crate::service) fn noise_doubts(&self, noise: Option<f64>) -> Vec<Doubt> {
        let LawExtent { ends, mean, variance } = LawExtent::of_law(&self.known);
        let known = LawExtent {
            ends: ends.map(|end| self.problem.noise(end)),
            mean: self.problem.noise(mean),
            variance: variance * self.problem.noise_width().powi(2),
        };
        let doubt = |noise| doubts::of_noise(noise, &known);
        noise.and_then(doubt).into_iter().collect()
    }

    /// Returns the state under the next policy, whose problem may differ in all but the names and the noise.
    ///
    /// # Errors
    /// It has other states, actions or another noise, or its states may not be what they are now.
    pub(in crate::service) fn renewed(&self, next: &DeclaredProblem) -> Result<Self, FieldError> {
        let problem = Declared::parsed(next)?;
        let own = &self.problem;
        let alike = [
            ("states", own.states_named() == problem.states_named()),
            ("actions", own.actions_named() == problem.actions_named()),
            ("noise", own.noise_named() == problem.noise_named()),
        ];
        if let Some((what, _)) = alike.into_iter().find(|(_, is_alike)| !is_alike) {
            let rule = format!("must have the {what} of the session");
            return Err(FieldError::new("policy", format!("a policy with other {what}"), rule));
        }
        let kept = problem.state("state", &self.named())?;
        let (problem, formulas) = (problem.into(), next.formulas().map(str::len).sum());
        let state = EarnedState { earned: self.state.earned, ..kept };
        Ok(ProblemState { problem, formulas, state, seen: Vec::new(), ..self.clone() })
    }

    /// Returns the effect of `report` on `period`, the one after `step` periods of the policy, for which these actions were
    /// advised; none for a period that was inserted later.
    ///
    /// # Errors
    /// As [`Self::read`]; the executed actions are not allowed, or lead a state out of its range.
    pub(in crate::service) fn after(
        &self,
        (step, period): (usize, usize),
        report: &Report,
        advised: &[f64],
    ) -> Result<Transition<ProblemState, ProblemPeriod>, FieldError> {
        let seen = self.read(report)?;
        let actions = match &report.executed {
            Some(executed) => self.problem.executed("executed", (step, &self.state), executed, report.is_recorded())?,
            None if advised.is_empty() => {
                return Err(FieldError::new("executed", "null", "must be given: nothing was advised for the period"));
            }
            None => advised.to_vec(),
        };
        let passed = seen.values[0].map(|scaled| self.problem.passed(step, &self.state, &actions, scaled));
        let reported = report.state.as_ref().map(|state| self.problem.state("state", state)).transpose()?;
        let (values, reward) = match (reported, passed) {
            (None, Some((values, reward))) => {
                let reported = |fault: FieldError| {
                    let rule = format!("must be reported: by the formulas, {} {}", fault.field, fault.rule);
                    FieldError::new("state", "null", rule)
                };
                (values.map_err(reported)?, Some(reward.map_err(reported)?))
            }
            (None, None) => {
                let rule = "must be given if the noise is missing: it moves the state";
                return Err(FieldError::new("state", "null", rule));
            }
            (Some(reported), passed) => (reported.values, passed.and_then(|(_, reward)| reward.ok())),
        };
        let earned = self.state.earned + self.discounted * reward.unwrap_or(0.0);
        if !earned.is_finite() {
            let rule = "must lead to rewards whose sum is a number";
            return Err(FieldError::new("noise", report.noise.unwrap_or(f64::NAN), rule));
        }
        let discounted = self.discounted * self.problem.discounted(1);
        let mut standing = ProblemState { state: EarnedState { values, earned }, discounted, ..self.clone() };
        if let Some(scaled) = seen.values[0] {
            standing.seen.push(scaled);
            standing.known.push(scaled);
        }
        standing.bet = self.bet.after(&standing.known, seen.values[0], &self.session, period);
        standing.days = self.days.after(report.date, None);
        Ok(Transition { seen, moved: ProblemPeriod { noise: report.noise, actions, reward }, standing })
    }
}
