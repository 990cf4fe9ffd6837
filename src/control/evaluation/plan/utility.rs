//! The utility of a course of spending, and its sure level.

use super::course::SpendingCourse;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::statistics::summary::{Clustered, Estimate};

/// The mean utility of the spending of every period and of the wealth at the horizon, by their weights: of log utility the
/// logarithm, and of power utility the power, of each amount over a level near it.
pub(super) struct SpendingUtility {
    level: f64,
    /// Amounts that are secured in every period and at the horizon, in money of now; they do not count.
    secured: [f64; 2],
    /// One less the risk aversion; 0 is log utility.
    power: f64,
    /// The weights of the periods and of the horizon, with sum 1.
    weights: Vec<f64>,
}

/// Share of the level of spending that amounts may fall below what is secured by rounding.
const ROUNDING: f64 = 1e-9;

/// The figures that count of a course.
pub(super) struct Followed {
    /// Lowest spending of a period, and the mean.
    pub(super) lowest: f64,
    pub(super) mean: f64,
    /// Wealth at the horizon.
    pub(super) left: f64,
    /// The sum of what could not be paid.
    pub(super) unpaid: f64,
    pub(super) drawdown: f64,
    pub(super) utility: f64,
}

impl Followed {
    pub(super) fn of(course: &SpendingCourse, utility: &SpendingUtility) -> Self {
        Followed {
            lowest: course.spent.iter().copied().fold(f64::INFINITY, f64::min),
            mean: course.spent.iter().sum::<f64>() / course.spent.len() as f64,
            left: course.wealth.last().copied().unwrap_or_default(),
            unpaid: course.unpaid,
            drawdown: course.drawdown,
            utility: utility.of_course(course),
        }
    }
}

impl SpendingUtility {
    /// Returns the utility in a problem whose sure level of spending is near `level`.
    pub(super) fn of(problem: &ProblemSpecification, level: f64) -> Self {
        let power = problem.utility.power();
        let spending = problem.spending.as_deref().cloned().unwrap_or_default();
        let mut weights = vec![1.0];
        for step in 0..problem.horizon {
            weights.push(weights[step] * spending.weight_after(step));
        }
        weights[problem.horizon] *= spending.bequest;
        let whole: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= whole);
        let secured = [spending.secured, spending.secured_left];
        SpendingUtility { level: level - secured[0], secured, power, weights }
    }

    fn of_course(&self, course: &SpendingCourse) -> f64 {
        let [each, left] = self.secured;
        let of_amount = |amount: f64| {
            let relative = amount / self.level;
            // Less than what is secured is worth nothing, whatever the power.
            if relative < -ROUNDING {
                return f64::NAN;
            }
            let relative = relative.max(0.0);
            if self.power == 0.0 { relative.ln() } else { relative.powf(self.power) }
        };
        let spent = course.spent.iter().map(|spent| spent - each);
        let amounts = spent.chain(course.wealth.last().map(|wealth| wealth - left));
        self.weights.iter().zip(amounts).map(|(weight, amount)| weight * of_amount(amount)).sum()
    }

    /// Returns the sure level of spending with the mean of these utilities; 0 if one is that of spending nothing.
    pub(super) fn certainty_equivalent(&self, utilities: &[f64], sample: &Clustered) -> Estimate {
        if utilities.iter().any(|utility| !utility.is_finite()) {
            return Estimate { value: 0.0, low: 0.0, high: 0.0 };
        }
        let Estimate { value, low, high } = sample.mean(utilities);
        if self.power == 0.0 {
            return Estimate { value, low, high }.mapped(|utility| self.secured[0] + self.level * utility.exp());
        }
        // A negative power turns the order around.
        let level = |utility: f64| self.secured[0] + self.level * utility.max(f64::MIN_POSITIVE).powf(1.0 / self.power);
        Estimate { value: level(value), low: level(high), high: level(low) }
    }
}
