//! The rules of the means of several assets, and how they move a record.

use std::borrow::Cow;

use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::means::MeansRule;
use super::rules::{LOG_RETURN, within};
use super::specification::Specification;
use super::support::Support;
use crate::control::error::FieldError;
use crate::numerics::statistics::shrinkage::ShrunkMeans;

/// Allowed intensities of shrinkage.
const INTENSITY: (f64, f64) = (0.0, 1.0);

impl Bounded for MeansRule {
    const BOUNDS: &'static [FieldBounds] = &[("shrunk.intensity", ValueBounds::number(INTENSITY))];
}

impl Specification {
    /// Returns the means that the law of several assets has.
    pub fn means(&self) -> MeansRule {
        self.fund.as_ref().map_or_else(MeansRule::default, |fund| fund.means)
    }
}

impl MeansRule {
    /// Checks the rule in the field `named`, with the support of the returns.
    ///
    /// # Errors
    /// The intensity is no share, or the support has bounds that a moved return may leave.
    pub fn check(&self, named: &str, support: Option<Support>) -> Result<(), FieldError> {
        if let MeansRule::Shrunk { intensity } = self {
            within(&format!("{named}.intensity"), *intensity, INTENSITY.0, INTENSITY.1)?;
        }
        if !self.is_sample() && support.is_some_and(|support| support.given().is_some()) {
            let rule = "must be sample if problem.support is between: a return with another mean may lie outside";
            return Err(FieldError::new(format!("{named}.kind"), self.name(), rule));
        }
        Ok(())
    }

    /// Returns the log-returns `rows`, date by date, with the means of the rule. Cost: that of [`ShrunkMeans`], and
    /// nothing for `sample`.
    pub fn applied<'a>(&self, rows: &'a [Vec<f64>]) -> Cow<'a, [Vec<f64>]> {
        match self {
            MeansRule::Sample {} => Cow::Borrowed(rows),
            MeansRule::Shrunk { intensity } => ShrunkMeans::by(rows, *intensity).applied(rows, LOG_RETURN).into(),
            MeansRule::BayesStein {} => ShrunkMeans::bayes_stein(rows).applied(rows, LOG_RETURN).into(),
        }
    }
}
