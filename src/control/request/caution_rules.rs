//! The caution level and the support of a problem, and the rules of both.

use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::caution::{CautionLevel, LARGEST_SCALE};
use super::radius_rule::RadiusRule;
use super::rules;
use super::specification::ProblemSpecification;
use super::support::{FACTOR, Interval, LIMIT, Support};
use crate::control::error::FieldError;

impl Bounded for CautionLevel {
    const BOUNDS: &'static [FieldBounds] = &[("scale", ValueBounds::Number(0.0, LARGEST_SCALE))];
}

impl Bounded for Support {
    const BOUNDS: &'static [FieldBounds] = &[
        ("worst_seen.factor", ValueBounds::number(FACTOR)),
        ("between.min", ValueBounds::Number(-LIMIT, LIMIT)),
        ("between.max", ValueBounds::Number(-LIMIT, LIMIT)),
    ];
}

impl ProblemSpecification {
    /// Returns the level given, or the default: `paper` if a radius is given, else `balanced`. Returns `None` if the
    /// framework has no ball.
    pub fn caution_level(&self) -> Option<CautionLevel> {
        let usual = if self.radius.is_some() { CautionLevel::Paper } else { CautionLevel::Balanced };
        self.framework.has_ball().then(|| self.caution.unwrap_or(usual))
    }

    /// Sets the paper's caution and allows every return, unless the problem gives its own values.
    #[must_use]
    pub fn as_in_the_paper(mut self) -> Self {
        self.caution.get_or_insert(CautionLevel::Paper);
        self.support.get_or_insert(Support::None {});
        self
    }

    /// Returns true if levels can be found: the problem has a ball, and its radius rule is `bridge` or `calibrated`.
    pub fn takes_levels(&self) -> bool {
        matches!(self.radius_rule(), RadiusRule::Bridge { .. } | RadiusRule::Calibrated { .. })
            && self.caution_level().is_some()
    }

    /// Returns the radius rule, scaled by the share of the radius that is used.
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

    /// Checks the caution level.
    ///
    /// # Errors
    /// It is out of its bounds, or there is no radius of which to use a share.
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
            let rule = "must be left out: caution applies only to the rules `bridge` and `calibrated`, in the frameworks \
                        `adaptive` and `static`";
            return Err(FieldError::new("problem.caution", level.name(), rule));
        }
        Ok(())
    }
}

/// Checks the numbers of a support in the field `named`.
///
/// # Errors
/// The first number that breaks its rule.
pub fn check_support(named: &str, support: Support) -> Result<(), FieldError> {
    match support {
        Support::WorstSeen { factor } => rules::within(&format!("{named}.factor"), factor, FACTOR.0, FACTOR.1),
        Support::None {} => Ok(()),
        Support::Between { min, max } => rules::interval(named, Interval { min, max }, -LIMIT, LIMIT),
    }
}

/// Checks that a return lies within the given bounds, if there are any; `field` names it.
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
