//! One field of a file and where it stands.

use super::error::ReturnsError;

/// Largest loss and gain of a column of fractions: what is beyond is in per cent, or no return.
const RETURNS: std::ops::RangeInclusive<f64> = -0.99..=1.0;

#[derive(Debug, Clone, Copy)]
pub struct Cell<'a> {
    pub line: u64,
    pub column: &'a str,
    pub text: &'a str,
}

impl Cell<'_> {
    pub fn refused(self, rule: impl Into<String>) -> ReturnsError {
        let Cell { line, column, text } = self;
        ReturnsError::Cell { line, column: column.into(), found: text.into(), rule: rule.into() }
    }

    /// A finite number with a decimal point.
    pub fn number(self) -> Result<f64, ReturnsError> {
        if self.text.ends_with('%') {
            return Err(self.refused("must be a fraction without a percent sign: 1.2 % is 0.012"));
        }
        if self.text.contains(',') {
            return Err(self.refused("must be a number with a decimal point and no comma, as 0.012 or 1234.5"));
        }
        let number = self.text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.refused("must be a number"))
    }

    /// A simple return of the risky asset.
    pub fn simple_return(self) -> Result<f64, ReturnsError> {
        let rule = "must be a fraction from -0.99 to 1: 0.012 is 1.2 % (of an asset that gained more, give prices)";
        Some(self.number()?).filter(|number| RETURNS.contains(number)).ok_or_else(|| self.refused(rule))
    }

    pub fn price(self) -> Result<f64, ReturnsError> {
        Some(self.number()?).filter(|number| *number > 0.0).ok_or_else(|| self.refused("must be above 0"))
    }

    /// What the bank pays a period.
    pub fn rate(self) -> Result<f64, ReturnsError> {
        let rule = "must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %";
        Some(self.number()?).filter(|number| super::RATE.contains(number)).ok_or_else(|| self.refused(rule))
    }
}
