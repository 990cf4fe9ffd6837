//! What a problem says of caution and of the returns that are thought possible, and the rules of both.

use super::caution::{CautionLevel, LARGEST_SCALE};
use super::radius_rule::RadiusRule;
use super::rules;
use super::specification::ProblemSpecification;
use super::support::{FACTOR, Interval, LIMIT, Support};
use crate::control::error::FieldError;

impl ProblemSpecification {
    /// The level given, or the default: the paper's where a radius is given, else `balanced`; `None` where there is no ball of which
    /// to take a share.
    pub fn caution_level(&self) -> Option<CautionLevel> {
        let usual = if self.radius.is_some() { CautionLevel::Paper } else { CautionLevel::Balanced };
        self.framework.has_ball().then(|| self.caution.unwrap_or(usual))
    }

    /// The same problem at the paper's caution, with every return possible, where neither is given.
    #[must_use]
    pub fn as_in_the_paper(mut self) -> Self {
        self.caution.get_or_insert(CautionLevel::Paper);
        self.support.get_or_insert(Support::None {});
        self
    }

    /// Whether levels can be found: of a ball whose radius is that of the bridge.
    pub fn takes_levels(&self) -> bool {
        matches!(self.radius_rule(), RadiusRule::Bridge { .. } | RadiusRule::Calibrated { .. })
            && self.caution_level().is_some()
    }

    /// The radius rule with the share of its radius that is acted on.
    pub fn radius_in_force(&self) -> RadiusRule {
        let level = self.caution_level().unwrap_or(CautionLevel::Paper);
        self.radius_rule().scaled(level.share(self.levels.as_deref()))
    }

    /// Checks the support.
    ///
    /// # Errors
    /// It breaks a rule, or a return of the history lies outside of it.
    pub fn check_support(&self) -> Result<(), FieldError> {
        let Some(given) = self.support else { return Ok(()) };
        if self.framework.is_parametric() {
            let rule = "must be absent in the parametric frameworks: a normal law has no bounds";
            return Err(FieldError::new("problem.support", "an object", rule));
        }
        check_support("problem.support", given)?;
        let mut seen = self.history.iter().enumerate();
        seen.try_for_each(|(index, z)| check_within(given, || format!("problem.history[{index}]"), *z))
    }

    /// Checks the level.
    ///
    /// # Errors
    /// It is out of its bounds, or there is nothing of which to take a share.
    pub fn check_caution(&self) -> Result<(), FieldError> {
        if let Some(levels) = &self.levels {
            let scales = [levels.bold, levels.balanced, levels.cautious, levels.paper].map(|level| level.scale);
            scales.into_iter().try_for_each(|scale| rules::within("problem.levels", scale, 0.0, 1.0))?;
        }
        let Some(level) = self.caution else { return Ok(()) };
        if let CautionLevel::Scale(scale) = level {
            rules::within("problem.caution.scale", scale, 0.0, LARGEST_SCALE)?;
        }
        if level != CautionLevel::Paper && !self.takes_levels() {
            let rule = "must be left out: it is a share of the radius of `bridge` or `calibrated`, in the frameworks `adaptive` \
                        and `static`";
            return Err(FieldError::new("problem.caution", level.name(), rule));
        }
        Ok(())
    }
}

/// Checks the numbers of a support, in the field `named`.
///
/// # Errors
/// The first that breaks its rule.
pub fn check_support(named: &str, support: Support) -> Result<(), FieldError> {
    match support {
        Support::WorstSeen { factor } => rules::within(&format!("{named}.factor"), factor, FACTOR.0, FACTOR.1),
        Support::None {} => Ok(()),
        Support::Between { min, max } => rules::interval(named, Interval { min, max }, -LIMIT, LIMIT),
    }
}

/// Checks that a return lies within what is given, where bounds are; `field` names it.
///
/// # Errors
/// It lies outside.
pub fn check_within(support: Support, field: impl FnOnce() -> String, log_return: f64) -> Result<(), FieldError> {
    match support.given() {
        Some(Interval { min, max }) if !(min..=max).contains(&log_return) => {
            let rule = format!("must lie in problem.support, [{min}, {max}]");
            Err(FieldError::new(field(), log_return, rule))
        }
        _ => Ok(()),
    }
}
