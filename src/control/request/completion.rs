//! Defaults for the fields that a specification leaves out.

use crate::control::error::FieldError;
use crate::control::request::assets::check_fund;
use crate::control::request::centre_rules::check_centre;
use crate::control::request::rules;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{Specification, UtilitySpecification};
use crate::control::request::support::Interval;

/// Largest default number of design points per step if the law is part of the state: the paper's count.
pub const DEFAULT_COUNT: usize = 1000;
/// Default accuracy if no number of design points is given, in basis points.
pub const DEFAULT_ACCURACY: f64 = 0.5;
/// Default number of design points per step if the state is wealth alone: the paper's count.
pub const DEFAULT_COUNT_WEALTH_ALONE: usize = 200;

/// Returns the utility `given`, the utility of a relative risk aversion that is given instead, or the default.
///
/// # Errors
/// Both are given, or the risk aversion breaks its rule.
fn utility(given: UtilitySpecification, risk_aversion: Option<f64>) -> Result<UtilitySpecification, FieldError> {
    const FIELD: &str = "problem.risk_aversion";
    match risk_aversion {
        None if given.is_given() => Ok(given),
        None => Ok(UtilitySpecification::default()),
        Some(value) if given.is_given() => {
            Err(FieldError::new(FIELD, value, "must be left out if problem.utility is given"))
        }
        Some(value) => {
            let (low, high) = rules::RELATIVE_RISK_AVERSION;
            rules::within(FIELD, value, low, high)?;
            Ok(UtilitySpecification::relative(value))
        }
    }
}

impl UtilitySpecification {
    /// Returns the exponential utility of this absolute risk aversion.
    pub fn exponential(risk_aversion: f64) -> Self {
        UtilitySpecification::Exponential { risk_aversion, risk_aversion_relative: None }
    }

    /// Returns the utility with its risk aversion per unit of wealth, for an investor who starts with `initial_wealth`:
    /// `risk_aversion = risk_aversion_relative / initial_wealth`.
    /// Checked by: `tests/service/advise.rs::a_relative_risk_aversion_is_of_the_wealth_at_the_start`.
    #[must_use]
    pub fn absolute(self, initial_wealth: f64) -> Self {
        match self {
            UtilitySpecification::Exponential { risk_aversion_relative: Some(relative), .. } => {
                UtilitySpecification::exponential(relative / initial_wealth)
            }
            absolute => absolute,
        }
    }
}

impl Specification {
    /// Checks every rule, and fills in the fields that depend on others.
    ///
    /// # Errors
    /// The first field, in the order of the request, that breaks its rule.
    pub fn completed(mut self) -> Result<Self, FieldError> {
        self.problem.utility = utility(self.problem.utility, self.problem.risk_aversion.take())?;
        rules::check(&self)?;
        self.problem.check_caution()?;
        self.problem.check_support()?;
        check_centre(&self.problem, self.design.initial_laws)?;
        self.fund.as_ref().map_or(Ok(()), |fund| check_fund(fund, &self.problem, self.design.initial_laws))?;
        let learns = self.problem.framework.learns();
        let wealth = self.problem.initial_wealth;
        self.problem.contributions = self.problem.contributions.canonical();
        self.problem.utility = self.problem.utility.absolute(wealth);
        self.problem.caution = self.problem.caution_level();
        self.problem.radius = Some(self.problem.radius_rule());
        self.problem.support = Some(self.problem.support_rule()).filter(|_| !self.problem.framework.is_parametric());
        if learns && self.design.count.is_none() {
            self.design.accuracy.get_or_insert(DEFAULT_ACCURACY);
        }
        self.design.count.get_or_insert(if learns { DEFAULT_COUNT } else { DEFAULT_COUNT_WEALTH_ALONE });
        self.design.sampling_law.get_or_insert(SamplingLaw::Bootstrap {});
        self.design.wealth.get_or_insert(Interval { min: wealth, max: wealth });
        Ok(self)
    }
}
