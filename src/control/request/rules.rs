//! Every rule a specification must satisfy, checked before any work.

use crate::control::error::FieldError;
use crate::control::request::asset_history::LARGEST_LOG_RETURN;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
pub use crate::control::request::bounds::{interval, whole, within};
use crate::control::request::contributions::Contributions;
use crate::control::request::framework::Framework;
use crate::control::request::learning::Learning;
use crate::control::request::radius_rules::check_radius;
use crate::control::request::specification::{
    DesignSpecification, HyperparameterBounds, InitialLaws, ProblemSpecification, Specification,
    SurrogateSpecification, UtilitySpecification,
};
use crate::control::request::support::Interval;
use crate::control::request::withdrawals;

/// Allowed range of `design.accuracy`, in basis points.
pub const ACCURACY: (f64, f64) = (0.01, 100.0);
/// Allowed number of design points per step: the covariance matrix of 10,000 takes 800 MB.
pub const COUNT: std::ops::RangeInclusive<usize> = 10..=10_000;
/// Allowed number of periods of a horizon, up to ten years of weeks.
pub const HORIZON: std::ops::RangeInclusive<usize> = 1..=520;
/// Allowed number of log-returns in a history.
pub const HISTORY_LENGTH: std::ops::RangeInclusive<usize> = 2..=20_000;
/// Largest log-return in absolute value.
pub const LOG_RETURN: f64 = LARGEST_LOG_RETURN;
/// Allowed simple returns: those whose log-returns are allowed.
pub const SIMPLE_RETURN: (f64, f64) = (-0.993_262_053_000_914_5, 147.413_159_102_576_6);
/// Largest number of simulated returns in the design: 800 MB.
const DESIGN_NUMBERS: usize = 100_000_000;
/// Above this product of risk aversion and wealth, exponential utility is flat in double precision over the design.
const EXPONENTIAL_SCALE: f64 = 300.0;
/// Smallest upper end of the action interval. The search treats actions closer than 1e-7 as one, so the interval must
/// be wider.
const SMALLEST_HIGHEST_ACTION: f64 = 1e-4;
/// Allowed number of periods in a year: a period is a year at most and a day at least.
pub const PERIODS_PER_YEAR: (f64, f64) = (1.0, 366.0);
/// Allowed absolute risk aversions of exponential utility, per unit of wealth. They include every relative one at every
/// initial wealth.
pub const RISK_AVERSION: (f64, f64) = (1e-18, 1e9);
/// Allowed risk aversions of exponential utility, as multiples of one over the initial wealth.
pub const RISK_AVERSION_RELATIVE: (f64, f64) = (1e-3, 100.0);
/// Allowed relative risk aversions: log utility at 1, power utility above.
pub const RELATIVE_RISK_AVERSION: (f64, f64) = (1.0, 100.0);
/// Allowed trading costs, as shares of the amount traded.
pub const TRADING_COST: (f64, f64) = (0.0, 0.1);
/// Smallest trading cost above 0. The effect of a smaller one is lost in rounding.
const SMALLEST_TRADING_COST: f64 = 1e-9;
/// Allowed returns of the bank per step.
pub const RATE: (f64, f64) = (-0.5, 0.5);
/// Smallest and largest allowed wealth.
pub const WEALTH: (f64, f64) = (1e-6, 1e15);
/// Allowed number of moments of the law among the features.
pub const MOMENTS: std::ops::RangeInclusive<usize> = 1..=6;
/// Ends of the search for a hyperparameter.
const HYPERPARAMETER: (f64, f64) = (1e-12, 1e12);

/// The bounds of a log-return.
pub const LOG_RETURNS: ValueBounds = ValueBounds::Number(-LOG_RETURN, LOG_RETURN);
/// The bounds of a simple return.
pub const SIMPLE_RETURNS: ValueBounds = ValueBounds::number(SIMPLE_RETURN);
/// The bounds of a share of wealth.
pub const SHARES: ValueBounds = ValueBounds::Number(0.0, 1.0);
const PAIR: ValueBounds = ValueBounds::List(2, 2, &ValueBounds::number(HYPERPARAMETER));

impl Bounded for ProblemSpecification {
    const BOUNDS: &'static [FieldBounds] = &[
        ("horizon", ValueBounds::count(&HORIZON)),
        ("rate_per_step", ValueBounds::number(RATE)),
        ("periods_per_year", ValueBounds::number(PERIODS_PER_YEAR)),
        ("initial_wealth", ValueBounds::number(WEALTH)),
        ("action_interval", ValueBounds::List(2, 2, &SHARES)),
        ("trading_cost", ValueBounds::number(TRADING_COST)),
        ("risk_aversion", ValueBounds::number(RELATIVE_RISK_AVERSION)),
        ("history", ValueBounds::list(&HISTORY_LENGTH, &LOG_RETURNS)),
    ];
}

impl Bounded for UtilitySpecification {
    const BOUNDS: &'static [FieldBounds] = &[
        ("exponential.risk_aversion", ValueBounds::number(RISK_AVERSION)),
        ("exponential.risk_aversion_relative", ValueBounds::number(RISK_AVERSION_RELATIVE)),
        ("power.risk_aversion", ValueBounds::Above(RELATIVE_RISK_AVERSION.0, RELATIVE_RISK_AVERSION.1)),
    ];
}

impl Bounded for DesignSpecification {
    const BOUNDS: &'static [FieldBounds] =
        &[("accuracy", ValueBounds::number(ACCURACY)), ("count", ValueBounds::count(&COUNT))];
}

impl Bounded for SurrogateSpecification {
    const BOUNDS: &'static [FieldBounds] = &[("moment_count", ValueBounds::count(&MOMENTS))];
}

impl Bounded for HyperparameterBounds {
    const BOUNDS: &'static [FieldBounds] =
        &[("lengthscale", PAIR), ("signal_variance", PAIR), ("noise_variance", PAIR)];
}

/// Checks every rule.
///
/// # Errors
/// The first field, in the order of the request, that breaks its rule.
pub fn check(specification: &Specification) -> Result<(), FieldError> {
    problem(&specification.problem)?;
    design(specification)?;
    surrogate(&specification.surrogate)
}

fn problem(problem: &ProblemSpecification) -> Result<(), FieldError> {
    whole("problem.horizon", problem.horizon, &HORIZON)?;
    within("problem.rate_per_step", problem.rate_per_step, RATE.0, RATE.1)?;
    let (least, most) = PERIODS_PER_YEAR;
    problem.periods_per_year.map_or(Ok(()), |count| within("problem.periods_per_year", count, least, most))?;
    wealth("problem.initial_wealth", problem.initial_wealth)?;
    let [lowest, highest] = problem.action_interval;
    if lowest != 0.0 {
        return Err(FieldError::new(
            "problem.action_interval[0]",
            lowest,
            "must be 0, so that all wealth may stay in the bank",
        ));
    }
    within("problem.action_interval[1]", highest, SMALLEST_HIGHEST_ACTION, 1.0)?;
    within("problem.trading_cost", problem.trading_cost, TRADING_COST.0, TRADING_COST.1)?;
    if problem.trading_cost > 0.0 && problem.trading_cost < SMALLEST_TRADING_COST {
        let rule = format!("must be 0 or at least {SMALLEST_TRADING_COST:e}");
        return Err(FieldError::new("problem.trading_cost", problem.trading_cost, rule));
    }
    problem.spending.as_ref().map_or(Ok(()), |spending| spending.check(problem))?;
    contributions(problem)?;
    utility(problem)?;
    problem.learning.check()?;
    check_radius(&problem.radius_rule(), problem)?;
    match (&problem.law, problem.framework) {
        (None, Framework::KnownLaw) => {
            return Err(FieldError::new("problem.law", "null", "must be given in the known_law framework"));
        }
        (Some(_), framework) if framework != Framework::KnownLaw => {
            let rule = "must be absent unless the framework is known_law";
            return Err(FieldError::new("problem.law", "an object", rule));
        }
        (Some(law), _) => law.check("problem.law")?,
        (None, _) => {}
    }
    history("problem.history", &problem.history, problem.learning)?;
    Ok(())
}

fn contributions(problem: &ProblemSpecification) -> Result<(), FieldError> {
    const FIELD: &str = "problem.contributions";
    let amount = |field: &str, amount: f64| within(field, amount, -WEALTH.1, WEALTH.1);
    match &problem.contributions {
        Contributions::Each(each) => amount(FIELD, *each)?,
        Contributions::Listed(all) if all.len() != problem.horizon => {
            let rule = format!("must hold problem.horizon = {} numbers, or be one number", problem.horizon);
            return Err(FieldError::new(FIELD, format!("{} numbers", all.len()), rule));
        }
        Contributions::Listed(all) => {
            all.iter().enumerate().try_for_each(|(index, each)| amount(&format!("{FIELD}[{index}]"), *each))?;
        }
    }
    withdrawals::check_start(problem, "problem.initial_wealth", problem.initial_wealth)
}

fn utility(problem: &ProblemSpecification) -> Result<(), FieldError> {
    const FIELD: &str = "problem.utility.risk_aversion";
    const RELATIVE: &str = "problem.utility.risk_aversion_relative";
    let (least, most) = RELATIVE_RISK_AVERSION;
    let (field, given, (low, high)) = match problem.utility {
        UtilitySpecification::Exponential { risk_aversion, risk_aversion_relative: Some(relative) } => {
            if !risk_aversion.is_nan() {
                return Err(FieldError::new(RELATIVE, relative, "must be left out if risk_aversion is given"));
            }
            (RELATIVE, relative, RISK_AVERSION_RELATIVE)
        }
        UtilitySpecification::Exponential { risk_aversion, .. } if risk_aversion.is_nan() => {
            return Err(FieldError::new(FIELD, "null", "must be given, or risk_aversion_relative instead"));
        }
        UtilitySpecification::Exponential { risk_aversion, .. } => (FIELD, risk_aversion, RISK_AVERSION),
        UtilitySpecification::Power { risk_aversion } if !(risk_aversion > least && risk_aversion <= most) => {
            let rule = format!("must lie in ({least}, {most}]; at 1 use the log utility");
            return Err(FieldError::new(FIELD, risk_aversion, rule));
        }
        UtilitySpecification::Power { .. } | UtilitySpecification::Log {} => return Ok(()),
    };
    within(field, given, low, high)?;
    not_flat(problem, problem.initial_wealth, (field, given), "problem.initial_wealth")
}

/// Checks that utility still grows at an initial wealth. Otherwise the error names the field `refused` and its product
/// with `other`.
fn not_flat(problem: &ProblemSpecification, wealth: f64, refused: (&str, f64), other: &str) -> Result<(), FieldError> {
    let utility = problem.utility.absolute(problem.initial_wealth);
    let UtilitySpecification::Exponential { risk_aversion, .. } = utility else { return Ok(()) };
    if risk_aversion * wealth > EXPONENTIAL_SCALE {
        let rule = format!("must be smaller: multiplied by {other} it may be at most {EXPONENTIAL_SCALE}");
        return Err(FieldError::new(refused.0, refused.1, rule));
    }
    let total = withdrawals::total_wealth(problem, wealth);
    if risk_aversion * total > EXPONENTIAL_SCALE {
        let rule = format!(
            "must be smaller: its value now plus wealth is {total}; multiplied by problem.utility.risk_aversion, that may be at most {EXPONENTIAL_SCALE}"
        );
        return Err(FieldError::new("problem.contributions", "money to come", rule));
    }
    Ok(())
}

/// Checks a history of log-returns, oldest first, for this kind of learning; `field` names it in messages.
pub fn history(field: &str, values: &[f64], learning: Learning) -> Result<(), FieldError> {
    if !HISTORY_LENGTH.contains(&values.len()) {
        let rule = format!("must hold {} to {} log-returns", HISTORY_LENGTH.start(), HISTORY_LENGTH.end());
        return Err(FieldError::new(field, format!("{} values", values.len()), rule));
    }
    for (index, &value) in values.iter().enumerate() {
        log_return(&format!("{field}[{index}]"), value)?;
    }
    learning.check_deviation(field, values)
}

/// Checks a wealth, named `field` in messages.
pub fn wealth(field: &str, value: f64) -> Result<(), FieldError> {
    within(field, value, WEALTH.0, WEALTH.1)
}

/// Checks a share of wealth, named `field` in messages.
pub fn share(field: &str, value: f64) -> Result<(), FieldError> {
    within(field, value, 0.0, 1.0)
}

/// Returns the lowest and the highest simple return or log-return.
pub fn return_bounds(are_simple: bool) -> (f64, f64) {
    if are_simple { SIMPLE_RETURN } else { (-LOG_RETURN, LOG_RETURN) }
}

/// Checks one log-return, named `field` in messages.
pub fn log_return(field: &str, value: f64) -> Result<(), FieldError> {
    within(field, value, -LOG_RETURN, LOG_RETURN)
}

fn design(specification: &Specification) -> Result<(), FieldError> {
    let design = &specification.design;
    let (least, most) = ACCURACY;
    design.accuracy.map_or(Ok(()), |accuracy| within("design.accuracy", accuracy, least, most))?;
    if let Some(count) = design.count {
        whole("design.count", count, &COUNT)?;
        let numbers = count.saturating_mul(specification.problem.history.len() + specification.problem.horizon);
        if design.initial_laws == InitialLaws::Resampled && numbers > DESIGN_NUMBERS {
            let rule =
                format!("must be smaller: multiplied by the final sample size it may be at most {DESIGN_NUMBERS}");
            return Err(FieldError::new("design.count", count, rule));
        }
    }
    if let Some(law) = &design.sampling_law {
        law.check("design.sampling_law")?;
    }
    if let Some(Interval { min, max }) = design.wealth {
        wealth("design.wealth.min", min)?;
        wealth("design.wealth.max", max)?;
        if max < min {
            return Err(FieldError::new("design.wealth.max", max, "must be at least design.wealth.min"));
        }
        withdrawals::check_start(&specification.problem, "design.wealth.min", min)?;
        not_flat(&specification.problem, max, ("design.wealth.max", max), "problem.utility.risk_aversion")?;
    }
    Ok(())
}

fn surrogate(surrogate: &SurrogateSpecification) -> Result<(), FieldError> {
    whole("surrogate.moment_count", surrogate.moment_count, &MOMENTS)?;
    let bounds = &surrogate.bounds;
    for (name, [low, high]) in [
        ("lengthscale", bounds.lengthscale),
        ("signal_variance", bounds.signal_variance),
        ("noise_variance", bounds.noise_variance),
    ] {
        within(&format!("surrogate.bounds.{name}[0]"), low, HYPERPARAMETER.0, HYPERPARAMETER.1)?;
        within(&format!("surrogate.bounds.{name}[1]"), high, low, HYPERPARAMETER.1)?;
    }
    Ok(())
}

/// Checks that a list is as long as the record.
///
/// # Errors
/// The list has another length.
pub fn same_length(field: &str, found: usize, wanted: usize) -> Result<(), FieldError> {
    if found == wanted {
        return Ok(());
    }
    Err(FieldError::new(field, format!("{found} values"), format!("must hold {wanted} values, one for each return")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simple_returns_have_the_bounds_of_log_returns() {
        for (simple, log) in [(SIMPLE_RETURN.0, -LOG_RETURN), (SIMPLE_RETURN.1, LOG_RETURN)] {
            assert!((simple - log.exp_m1()).abs() <= 1e-15 * log.exp() && simple.ln_1p().abs() <= LOG_RETURN + 1e-12);
        }
    }
}
