//! The rules of spending.

use super::bounds::within;
use super::specification::{ProblemSpecification, UtilitySpecification};
use super::spending::{BEQUEST, DISCOUNT, INFLATION, SECURED, SHARE, SMALLEST_HIGHEST, SURVIVAL, Spending};
use crate::control::error::FieldError;

/// Share of wealth below which a surplus counts as none.
const ROUNDING: f64 = 1e-9;

impl ProblemSpecification {
    /// Returns the rise of prices in a period, as a fraction: 0 without spending.
    pub fn inflation(&self) -> f64 {
        self.spending.as_ref().map_or(0.0, |spending| spending.inflation)
    }

    /// Checks that nothing is spent, for a call that compares or advises terminal wealth; `why` ends the rule.
    ///
    /// # Errors
    /// There is spending.
    pub fn check_without_spending(&self, why: &str) -> Result<(), FieldError> {
        let rule = || format!("must be left out: {why}");
        self.spending.as_ref().map_or(Ok(()), |_| Err(FieldError::new("problem.spending", "an object", rule())))
    }
}

impl Spending {
    /// Checks the spending of `problem`, whose utility is known.
    ///
    /// # Errors
    /// A field breaks its rule, or the problem has what spending excludes.
    pub fn check(&self, problem: &ProblemSpecification) -> Result<(), FieldError> {
        within("problem.spending.lowest", self.lowest, SHARE.0, SHARE.1)?;
        within("problem.spending.highest", self.highest, SMALLEST_HIGHEST.max(self.lowest), SHARE.1)?;
        within("problem.spending.discount", self.discount, DISCOUNT.0, DISCOUNT.1)?;
        within("problem.spending.inflation", self.inflation, INFLATION.0, INFLATION.1)?;
        if let Some(chances) = &self.survival {
            if chances.len() != problem.horizon {
                let rule = format!("must hold problem.horizon = {} numbers", problem.horizon);
                let field = "problem.spending.survival";
                return Err(FieldError::new(field, format!("{} numbers", chances.len()), rule));
            }
            for (index, &chance) in chances.iter().enumerate() {
                within(&format!("problem.spending.survival[{index}]"), chance, SURVIVAL.0, SURVIVAL.1)?;
            }
        }
        within("problem.spending.bequest", self.bequest, BEQUEST.0, BEQUEST.1)?;
        within("problem.spending.secured", self.secured, SECURED.0, SECURED.1)?;
        within("problem.spending.secured_left", self.secured_left, SECURED.0, SECURED.1)?;
        if self.secures() {
            self.check_secured(problem)?;
        }
        if let UtilitySpecification::Exponential { .. } = problem.utility {
            let rule = "must be log or power if problem.spending is given: spending is a share of wealth";
            return Err(FieldError::new("problem.utility.kind", "exponential", rule));
        }
        if problem.trading_cost > 0.0 {
            let rule = "must be 0 if problem.spending is given";
            return Err(FieldError::new("problem.trading_cost", problem.trading_cost, rule));
        }
        if !problem.contributions.are_none() {
            let rule = "must be left out if problem.spending is given, which is all that is withdrawn";
            return Err(FieldError::new("problem.contributions", "not 0", rule));
        }
        Ok(())
    }

    /// Checks that the initial wealth exceeds the reserve.
    fn check_secured(&self, problem: &ProblemSpecification) -> Result<(), FieldError> {
        let wealth = problem.initial_wealth;
        let cost = |secured: f64, secured_left: f64| {
            let one = Spending { secured, secured_left, ..self.clone() };
            one.reserves(problem.rate_per_step, problem.horizon).first().map_or(0.0, |[_, reserve]| *reserve)
        };
        let [of_level, of_left] = [cost(1.0, 0.0), cost(0.0, 1.0)];
        let rule = |most: f64, what: &str| {
            format!(
                "must be below {most}: problem.initial_wealth of {wealth}, left in the bank, pays for no more {what}"
            )
        };
        let free = wealth - self.secured_left * of_left;
        if free <= ROUNDING * wealth {
            let rule = rule(wealth / of_left, "at the horizon");
            return Err(FieldError::new("problem.spending.secured_left", self.secured_left, rule));
        }
        if free - self.secured * of_level <= ROUNDING * wealth {
            let rule = rule(free / of_level, "in every period");
            return Err(FieldError::new("problem.spending.secured", self.secured, rule));
        }
        Ok(())
    }
}
