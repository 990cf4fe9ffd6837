//! The rules of a centre.

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::centre::{CentreSpecification, Covariate};
use crate::control::request::framework::Framework;
use crate::control::request::learning::HALF_LIFE;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::rules::{HISTORY_LENGTH, LOG_RETURN, LOG_RETURNS, within};
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{InitialLaws, ProblemSpecification};
use crate::control::request::support::Interval;
use crate::numerics::law::volatility::expected;
use crate::numerics::statistics::moving_mean::moving_means;

/// Allowed standard deviations of the smoothing error.
pub const BANDWIDTH: (f64, f64) = (0.0, 1.0);
/// Allowed bandwidths of a conditional centre, in standard deviations of what tells times apart.
pub const KERNEL_BANDWIDTH: (f64, f64) = (0.05, 1e15);
/// Allowed figures that tell times apart.
const COVARIATE: (f64, f64) = (-1e15, 1e15);
const FIGURES: ValueBounds = ValueBounds::number(COVARIATE);
/// Allowed numbers of such figures: one for each return of a history, and the present one.
const FIGURE_COUNT: std::ops::RangeInclusive<usize> = LEAST_LIKE + 2..=*HISTORY_LENGTH.end() + 1;
/// The least number of returns that count under a conditional centre.
pub const LEAST_LIKE: usize = 30;
/// Allowed number of returns that an assumed law counts as. With more, a record would have no effect.
pub const ASSUMED_WEIGHT: (f64, f64) = (0.0, 1e6);

impl Bounded for CentreSpecification {
    const BOUNDS: &'static [FieldBounds] = &[
        ("smoothed.bandwidth", ValueBounds::number(BANDWIDTH)),
        ("volatility_scaled.half_life", ValueBounds::number(HALF_LIFE)),
        ("conditional.bandwidth", ValueBounds::number(KERNEL_BANDWIDTH)),
        ("mixed.history", ValueBounds::list(&HISTORY_LENGTH, &LOG_RETURNS)),
        ("mixed.weight", ValueBounds::number(ASSUMED_WEIGHT)),
    ];
}

impl Covariate {
    /// Returns the figure before each return of a history, and the present one. Cost O(n).
    pub fn figures(&self, history: &[f64]) -> Vec<f64> {
        match self {
            Covariate::Trend { half_life } => moving_means(history, *half_life),
            Covariate::Volatility { half_life } => expected(history, *half_life),
            Covariate::Column { values } => values.clone(),
        }
    }
}

impl Bounded for Covariate {
    const BOUNDS: &'static [FieldBounds] = &[
        ("trend.half_life", ValueBounds::number(HALF_LIFE)),
        ("volatility.half_life", ValueBounds::number(HALF_LIFE)),
        ("column.values", ValueBounds::list(&FIGURE_COUNT, &FIGURES)),
    ];
}

/// Checks the centre of a problem whose other fields satisfy their rules.
///
/// # Errors
/// The first field that breaks its rule.
pub(super) fn check_centre(problem: &ProblemSpecification, laws: InitialLaws) -> Result<(), FieldError> {
    let ProblemSpecification { centre, framework, learning, .. } = problem;
    if !centre.is_empirical() && (framework.is_parametric() || *framework == Framework::KnownLaw) {
        let rule = format!("must be empirical in the framework {}, which has no ball around returns", framework.name());
        return Err(FieldError::new("problem.centre.kind", centre.name(), rule));
    }
    if centre.takes_order() && !framework.is_frozen() {
        let refused = |rule: &str| Err(FieldError::new("problem.centre.kind", centre.name(), rule));
        if problem.horizon > 1 {
            return refused(
                "must be another centre if the horizon exceeds 1, unless the framework is static: a state does not hold how later returns change it",
            );
        }
        if laws == InitialLaws::Resampled {
            return refused("must be another centre if design.initial_laws is resampled: a resampled law has no order");
        }
    }
    match centre {
        CentreSpecification::Empirical {} => Ok(()),
        CentreSpecification::VolatilityScaled { half_life } => {
            within("problem.centre.half_life", *half_life, HALF_LIFE.0, HALF_LIFE.1)
        }
        CentreSpecification::Smoothed { bandwidth } => {
            within("problem.centre.bandwidth", *bandwidth, BANDWIDTH.0, BANDWIDTH.1)
        }
        CentreSpecification::Conditional { on, bandwidth } => {
            within("problem.centre.bandwidth", *bandwidth, KERNEL_BANDWIDTH.0, KERNEL_BANDWIDTH.1)?;
            if problem.history.len() <= LEAST_LIKE {
                let rule =
                    format!("must hold more than {LEAST_LIKE} log-returns if the centre is conditional: so many count");
                return Err(FieldError::new("problem.history", format!("{} values", problem.history.len()), rule));
            }
            check_covariate(on, problem.history.len())?;
            match problem.radius_rule() {
                rule @ (RadiusRule::Calibrated { .. } | RadiusRule::Joint { .. }) => {
                    let allowed = "must be bridge, root_n or fixed if the centre is conditional";
                    Err(FieldError::new("problem.radius.rule", rule.name(), allowed))
                }
                _ => Ok(()),
            }
        }
        CentreSpecification::Mixed { .. } if learning.decays() => {
            let rule = "must be equal if the centre is mixed: the assumed law has no age";
            Err(FieldError::new("problem.learning.kind", "decay", rule))
        }
        CentreSpecification::Mixed { law, history, weight } => {
            within("problem.centre.weight", *weight, ASSUMED_WEIGHT.0, ASSUMED_WEIGHT.1)?;
            match (law, history) {
                (Some(law), None) => assumed_law(law),
                (None, Some(history)) => assumed_history(history, problem.support_rule().given()),
                (law, _) => {
                    let value = if law.is_some() { "given with history" } else { "null" };
                    let rule = "give either law or history, not both";
                    Err(FieldError::new("problem.centre.law", value, rule))
                }
            }
        }
    }
}

/// Refuses a column of numbers beside the returns of a walk-forward, of which each window would need its own part.
///
/// # Errors
/// The centre has one.
pub(super) fn check_walked(centre: &CentreSpecification) -> Result<(), FieldError> {
    match centre.has_column() {
        true => Err(FieldError::new("centre.on.kind", "column", "must be trend or volatility in a walk-forward")),
        false => Ok(()),
    }
}

fn check_covariate(on: &Covariate, returns: usize) -> Result<(), FieldError> {
    match on {
        Covariate::Trend { half_life } | Covariate::Volatility { half_life } => {
            within("problem.centre.on.half_life", *half_life, HALF_LIFE.0, HALF_LIFE.1)
        }
        Covariate::Column { values } if values.len() != returns + 1 => {
            let rule = format!(
                "must hold {} numbers: one known before each of the {returns} returns, and the present one",
                returns + 1
            );
            Err(FieldError::new("problem.centre.on.values", format!("{} values", values.len()), rule))
        }
        Covariate::Column { values } => {
            values.iter().enumerate().try_for_each(|(index, value)| {
                within(&format!("problem.centre.on.values[{index}]"), *value, COVARIATE.0, COVARIATE.1)
            })?;
            if values[1..returns].iter().all(|value| *value == values[0]) {
                let rule = "must vary before the returns: equal figures tell no times apart";
                return Err(FieldError::new("problem.centre.on.values", format!("all {}", values[0]), rule));
            }
            Ok(())
        }
    }
}

fn assumed_law(law: &SamplingLaw) -> Result<(), FieldError> {
    if *law == (SamplingLaw::Bootstrap {}) {
        let rule = "must be another law: the returns seen are already counted";
        return Err(FieldError::new("problem.centre.law.kind", "bootstrap", rule));
    }
    law.check("problem.centre.law")
}

fn assumed_history(history: &[f64], support: Option<Interval>) -> Result<(), FieldError> {
    const FIELD: &str = "problem.centre.history";
    if !HISTORY_LENGTH.contains(&history.len()) {
        let rule = format!("must hold {} to {} log-returns", HISTORY_LENGTH.start(), HISTORY_LENGTH.end());
        return Err(FieldError::new(FIELD, format!("{} values", history.len()), rule));
    }
    let bounds = support.unwrap_or(Interval { min: -LOG_RETURN, max: LOG_RETURN });
    let (low, high) = (bounds.min.max(-LOG_RETURN), bounds.max.min(LOG_RETURN));
    history.iter().enumerate().try_for_each(|(index, &value)| within(&format!("{FIELD}[{index}]"), value, low, high))
}
