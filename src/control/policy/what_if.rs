//! Hypothetical advice: for another wealth, another holding, another radius, another return.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use crate::control::error::FieldError;
use crate::control::policy::worst_case::WorstCase;
use crate::control::problem::state::State;
use crate::control::request::{radius_rules, rules};

/// The hypothetical changes; everything else stays as it is. They apply in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Hypothesis {
    /// Wealth now.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset now.
    pub holding: Option<f64>,
    /// Return of the coming period, during which the advised allocation is held; the advice is for the period after.
    pub log_return: Option<f64>,
    /// Radius of the uncertainty set in the advised period; later periods keep their own.
    pub radius: Option<HypotheticalRadius>,
}

/// A radius other than the state's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HypotheticalRadius {
    /// A multiple of the state's own radius.
    Scaled(f64),
    /// A radius in the unit of an advice's radius.
    Fixed(f64),
}

/// The advice under a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct WhatIfResult {
    /// Wealth at that time.
    pub wealth: f64,
    /// Advice for the period after those observed at that time.
    pub advice: Advice,
    /// The worst case, if the step was solved and not read off a surrogate.
    pub worst_case: Option<WorstCase>,
}

impl Hypothesis {
    /// Returns the factor on the radius, if there is one.
    pub fn radius_scale(&self) -> Option<f64> {
        match self.radius {
            Some(HypotheticalRadius::Scaled(scale)) => Some(scale),
            _ => None,
        }
    }

    /// Checks the fields as far as possible without a state; fields are named as on the wire.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn check(&self) -> Result<(), FieldError> {
        if let Some(wealth) = self.wealth {
            rules::wealth("wealth", wealth)?;
        }
        if let Some(holding) = self.holding {
            rules::share("holding", holding)?;
        }
        if let Some(log_return) = self.log_return {
            rules::log_return("log_return", log_return)?;
        }
        match self.radius {
            Some(HypotheticalRadius::Scaled(scale)) => {
                rules::within("radius_scale", scale, radius_rules::RADIUS_SCALE.0, radius_rules::RADIUS_SCALE.1)
            }
            Some(HypotheticalRadius::Fixed(radius)) => {
                rules::within("radius", radius, radius_rules::FIXED_RADIUS.0, radius_rules::FIXED_RADIUS.1)
            }
            None => Ok(()),
        }
    }
}

impl Advisor {
    /// Returns the advice for `state` after `step` observed periods under `hypothesis`. `following` is the step that
    /// advises the period after that, if there is one. The policy surrogate does not cover a radius other than the
    /// state's own. For it the robust step is solved over the value surrogate of the next step, as always under
    /// [`AdviceMode::Resolve`]. Cost: as [`Advisor::advise`], twice with a hypothetical return.
    ///
    /// # Errors
    /// A field out of its range; a return that leads past the horizon or to a wealth that is not accepted.
    pub fn suppose(
        &self,
        step: usize,
        following: Option<usize>,
        state: &State,
        hypothesis: &Hypothesis,
        mode: AdviceMode,
    ) -> Result<WhatIfResult, FieldError> {
        hypothesis.check()?;
        let (step, state) = self.supposed_state(step, following, state, hypothesis)?;
        let wealth = state.wealth;
        let (advice, worst_case) = if hypothesis.radius.is_none() && mode == AdviceMode::Surrogate {
            (self.advise(step, &state, AdviceMode::Surrogate), None)
        } else {
            let own = self.radius(&state);
            let radius = match hypothesis.radius {
                Some(HypotheticalRadius::Fixed(radius)) => radius,
                Some(HypotheticalRadius::Scaled(scale)) => scale * own,
                None => own,
            };
            let (advice, worst_case) = self.explain_knowing(step, &state, own, radius);
            (advice, Some(worst_case))
        };
        Ok(WhatIfResult { wealth, advice, worst_case })
    }

    /// Returns the step and state with the hypothetical wealth and holding, after the hypothetical return.
    fn supposed_state(
        &self,
        step: usize,
        following: Option<usize>,
        state: &State,
        hypothesis: &Hypothesis,
    ) -> Result<(usize, State), FieldError> {
        let wealth = hypothesis.wealth.unwrap_or(state.wealth);
        let holding = hypothesis.holding.unwrap_or(state.holding);
        let now = State { wealth, holding, law: state.law.clone() };
        let Some(log_return) = hypothesis.log_return else { return Ok((step, now)) };
        let Some(following) = following else {
            let rule = "must be absent: the coming period is the last, so there is none after it to advise";
            return Err(FieldError::new("log_return", log_return, rule));
        };
        let advised = self.advise(step, &now, AdviceMode::Surrogate);
        let then = self.advance(step, &now, &advised.followed(log_return));
        let (low, high) = rules::WEALTH;
        if !(low..=high).contains(&then.wealth) {
            let rule = format!("must leave a wealth in [{low}, {high}]");
            return Err(FieldError::new("log_return", log_return, rule));
        }
        Ok((following, then))
    }
}
