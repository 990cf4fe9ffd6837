//! Every rule a specification must satisfy, checked before any work.

use crate::control::error::FieldError;
use crate::control::request::contributions::Contributions;
use crate::control::request::framework::Framework;
use crate::control::request::learning::Learning;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{
    InitialLaws, ProblemSpecification, Specification, SurrogateSpecification, UtilitySpecification,
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
/// Largest log-return in absolute value: a factor of 148 in one step.
pub const LOG_RETURN: f64 = 5.0;
/// Allowed number of simulated bridge paths.
pub const PATHS: std::ops::RangeInclusive<usize> = 100..=100_000;
/// Largest bridge matrix, 30 million numbers: 240 MB.
pub const BRIDGE_NUMBERS: usize = 30_000_000;
/// Largest bridge matrix for a calibration, which reads it for each of a thousand records: about a second.
const CALIBRATED_NUMBERS: usize = 3_000_000;
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
/// Allowed factors on a bridge radius.
pub const RADIUS_SCALE: (f64, f64) = (0.0, 100.0);
/// Allowed corrections of a simulated quantile: a hundred paths are off by less.
pub const RADIUS_CORRECTION: (f64, f64) = (0.5, 2.0);
/// Allowed fixed radii, in log-return.
pub const FIXED_RADIUS: (f64, f64) = (0.0, 10.0);

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
    contributions(problem)?;
    utility(problem)?;
    problem.learning.check()?;
    radius(&problem.radius_rule(), problem)?;
    match (&problem.law, problem.framework) {
        (None, Framework::KnownLaw) => {
            return Err(FieldError::new("problem.law", "null", "must be given in the known_law framework"));
        }
        (Some(_), framework) if framework != Framework::KnownLaw => {
            let rule = "must be absent unless the framework is known_law";
            return Err(FieldError::new("problem.law", "an object", rule));
        }
        (Some(law), _) => sampling_law("problem.law", law)?,
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
        UtilitySpecification::Power { risk_aversion } if !(risk_aversion > 1.0 && risk_aversion <= 100.0) => {
            return Err(FieldError::new(FIELD, risk_aversion, "must lie in (1, 100]; at 1 use the log utility"));
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

fn radius(rule: &RadiusRule, problem: &ProblemSpecification) -> Result<(), FieldError> {
    let name = rule.name();
    match (problem.framework.is_parametric(), name == "chi_square") {
        (true, false) => {
            return Err(FieldError::new(
                "problem.radius.rule",
                name,
                "must be chi_square in the parametric frameworks",
            ));
        }
        (false, true) => {
            let rule = "must be another rule unless the framework is parametric_static or parametric_adaptive";
            return Err(FieldError::new("problem.radius.rule", name, rule));
        }
        _ => {}
    }
    match *rule {
        RadiusRule::Bridge { alpha, paths, scale, .. } | RadiusRule::Calibrated { alpha, paths, scale } => {
            let calibrated = matches!(rule, RadiusRule::Calibrated { .. });
            let (least_alpha, numbers) = if calibrated { (1e-2, CALIBRATED_NUMBERS) } else { (1e-3, BRIDGE_NUMBERS) };
            within("problem.radius.alpha", alpha, least_alpha, 0.999)?;
            whole("problem.radius.paths", paths, &PATHS)?;
            within("problem.radius.scale", scale, RADIUS_SCALE.0, RADIUS_SCALE.1)?;
            if let RadiusRule::Bridge { correction: Some(correction), .. } = *rule {
                within("problem.radius.correction", correction, RADIUS_CORRECTION.0, RADIUS_CORRECTION.1)?;
            }
            if paths.saturating_mul(problem.history.len() + problem.horizon) > numbers {
                let rule = format!("must be smaller: multiplied by the final sample size it may be at most {numbers}");
                return Err(FieldError::new("problem.radius.paths", paths, rule));
            }
            Ok(())
        }
        RadiusRule::Concentration { alpha, numerator, rate } => {
            within("problem.radius.alpha", alpha, 1e-3, 0.999)?;
            within("problem.radius.C", numerator, alpha, 1e9)?;
            within("problem.radius.c", rate, 1e-9, 1e12)
        }
        RadiusRule::RootN { kappa } => within("problem.radius.kappa", kappa, 0.0, 100.0),
        RadiusRule::Fixed { radius } => within("problem.radius.radius", radius, FIXED_RADIUS.0, FIXED_RADIUS.1),
        RadiusRule::ChiSquare { alpha } => within("problem.radius.alpha", alpha, 1e-3, 1.0),
    }
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
        sampling_law("design.sampling_law", law)?;
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

/// Checks a law, named `field` in messages.
pub fn sampling_law(field: &str, law: &SamplingLaw) -> Result<(), FieldError> {
    match law {
        SamplingLaw::Bootstrap {} => Ok(()),
        SamplingLaw::StudentT { location, scale, degrees_of_freedom } => {
            within(&format!("{field}.location"), *location, -1.0, 1.0)?;
            within(&format!("{field}.scale"), *scale, 1e-6, 1.0)?;
            within(&format!("{field}.degrees_of_freedom"), *degrees_of_freedom, 2.1, 1e6)
        }
        SamplingLaw::GaussianMixture { components } => {
            if components.is_empty() || components.len() > 32 {
                let value = format!("{} components", components.len());
                return Err(FieldError::new(format!("{field}.components"), value, "must hold 1 to 32 components"));
            }
            for (index, component) in components.iter().enumerate() {
                open_above_zero(&format!("{field}.components[{index}].weight"), component.weight, 1.0)?;
                within(&format!("{field}.components[{index}].mean"), component.mean, -1.0, 1.0)?;
                within(&format!("{field}.components[{index}].variance"), component.variance, 1e-12, 1.0)?;
            }
            let total: f64 = components.iter().map(|component| component.weight).sum();
            if (total - 1.0).abs() > 1e-9 {
                return Err(FieldError::new(
                    format!("{field}.components"),
                    format!("weights summing to {total}"),
                    "must sum to 1",
                ));
            }
            Ok(())
        }
    }
}

fn surrogate(surrogate: &SurrogateSpecification) -> Result<(), FieldError> {
    whole("surrogate.moment_count", surrogate.moment_count, &MOMENTS)?;
    let bounds = &surrogate.bounds;
    for (name, [low, high]) in [
        ("lengthscale", bounds.lengthscale),
        ("signal_variance", bounds.signal_variance),
        ("noise_variance", bounds.noise_variance),
    ] {
        within(&format!("surrogate.bounds.{name}[0]"), low, 1e-12, 1e12)?;
        within(&format!("surrogate.bounds.{name}[1]"), high, low, 1e12)?;
    }
    Ok(())
}

/// Checks that a count is allowed.
pub fn whole(field: &str, value: usize, allowed: &std::ops::RangeInclusive<usize>) -> Result<(), FieldError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must lie in [{}, {}]", allowed.start(), allowed.end())))
}

/// Checks that `value` is finite and lies in `[low, high]`.
pub fn within(field: &str, value: f64, low: f64, high: f64) -> Result<(), FieldError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must be a number in [{low}, {high}]")))
}

fn open_above_zero(field: &str, value: f64, high: f64) -> Result<(), FieldError> {
    if value > 0.0 && value <= high {
        return Ok(());
    }
    Err(FieldError::new(field, value, format!("must be a number in (0, {high}]")))
}

/// Checks that an interval lies in `[low, high]` and has a length.
pub fn interval(field: &str, interval: Interval, low: f64, high: f64) -> Result<(), FieldError> {
    within(&format!("{field}.min"), interval.min, low, high)?;
    within(&format!("{field}.max"), interval.max, low, high)?;
    if interval.max > interval.min {
        return Ok(());
    }
    Err(FieldError::new(format!("{field}.max"), interval.max, format!("must exceed {field}.min, {}", interval.min)))
}
