//! The rules of a radius.

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole, within};
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::bridge::partial_sums::CELLS;
use crate::numerics::bridge::paths::GRADED_FROM;

/// Allowed number of simulated bridge paths.
pub const PATHS: std::ops::RangeInclusive<usize> = 100..=100_000;
/// Largest bridge matrix, 30 million numbers: 60 MB. Long records share a matrix of fewer times than returns.
const BRIDGE_NUMBERS: usize = 30_000_000;
/// Largest product of paths and returns for a calibration, which reads the paths for each of a thousand records: about a
/// second.
const CALIBRATED_NUMBERS: usize = 3_000_000;
/// Largest number of normals behind a joint factor: about four seconds.
const JOINT_NUMBERS: usize = 300_000_000;
/// Allowed factors on a bridge radius.
pub const RADIUS_SCALE: (f64, f64) = (0.0, 100.0);
/// Allowed corrections of a simulated quantile: a hundred paths are off by less.
pub const RADIUS_CORRECTION: (f64, f64) = (0.5, 2.0);
/// Allowed fixed radii, in log-return.
pub const FIXED_RADIUS: (f64, f64) = (0.0, 10.0);
/// Allowed miscoverages.
pub const ALPHA: (f64, f64) = (1e-3, 0.999);
/// Allowed miscoverages of a calibrated ball, for which a thousand records are drawn.
const CALIBRATED_ALPHA: (f64, f64) = (1e-2, 0.999);
/// Allowed miscoverages of a confidence region; at 1 it is the sample's own law.
const REGION_ALPHA: (f64, f64) = (1e-3, 1.0);
/// Allowed constants kappa of a radius of kappa / sqrt(n), in log-return.
pub const KAPPA: (f64, f64) = (0.0, 100.0);

impl Bounded for RadiusRule {
    const BOUNDS: &'static [FieldBounds] = &[
        ("bridge.alpha", ValueBounds::number(ALPHA)),
        ("calibrated.alpha", ValueBounds::number(CALIBRATED_ALPHA)),
        ("joint.alpha", ValueBounds::number(ALPHA)),
        ("concentration.alpha", ValueBounds::number(ALPHA)),
        ("chi_square.alpha", ValueBounds::number(REGION_ALPHA)),
        ("paths", ValueBounds::count(&PATHS)),
        ("scale", ValueBounds::number(RADIUS_SCALE)),
        ("correction", ValueBounds::number(RADIUS_CORRECTION)),
        ("kappa", ValueBounds::number(KAPPA)),
        ("radius", ValueBounds::number(FIXED_RADIUS)),
    ];
}

/// Checks the radius rule of a problem.
///
/// # Errors
/// The first field that breaks a rule.
pub fn check_radius(rule: &RadiusRule, problem: &ProblemSpecification) -> Result<(), FieldError> {
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
    let size = problem.history.len() + problem.horizon;
    let check_scale = |scale: f64| within("problem.radius.scale", scale, RADIUS_SCALE.0, RADIUS_SCALE.1);
    match *rule {
        RadiusRule::Bridge { alpha, paths, scale, correction } => {
            within("problem.radius.alpha", alpha, ALPHA.0, ALPHA.1)?;
            check_bridges(paths, size)?;
            check_scale(scale)?;
            let (least, most) = RADIUS_CORRECTION;
            correction.map_or(Ok(()), |correction| within("problem.radius.correction", correction, least, most))
        }
        RadiusRule::Calibrated { alpha, paths, scale } => {
            within("problem.radius.alpha", alpha, CALIBRATED_ALPHA.0, CALIBRATED_ALPHA.1)?;
            check_paths(paths, size, CALIBRATED_NUMBERS, "the final sample size")?;
            check_scale(scale)
        }
        RadiusRule::Joint { .. } if problem.learning.decays() => {
            let rule =
                "must be another rule if weights decay: such balls have no last step until which to hold the law";
            Err(FieldError::new("problem.radius.rule", name, rule))
        }
        RadiusRule::Joint { alpha, paths } => {
            within("problem.radius.alpha", alpha, ALPHA.0, ALPHA.1)?;
            check_bridges(paths, size)?;
            let times = problem.history.len().min(CELLS).saturating_mul(problem.horizon);
            let counted = format!("problem.horizon and by the sample size (of which {CELLS} count)");
            check_paths(paths, times, JOINT_NUMBERS, &counted)
        }
        RadiusRule::Concentration { .. } if problem.support_rule().given().is_none() => {
            let rule =
                "must be between under the radius rule concentration, whose radius follows from the bounds on returns";
            Err(FieldError::new("problem.support", "no bounds", rule))
        }
        RadiusRule::Concentration { .. } if problem.centre.takes_order() => {
            let rule = "must be another under the radius rule concentration: rescaled returns may leave the support";
            Err(FieldError::new("problem.centre", problem.centre.name(), rule))
        }
        RadiusRule::Concentration { alpha } => within("problem.radius.alpha", alpha, ALPHA.0, ALPHA.1),
        RadiusRule::RootN { kappa } => within("problem.radius.kappa", kappa, KAPPA.0, KAPPA.1),
        RadiusRule::Fixed { radius } => within("problem.radius.radius", radius, FIXED_RADIUS.0, FIXED_RADIUS.1),
        RadiusRule::ChiSquare { alpha } => within("problem.radius.alpha", alpha, REGION_ALPHA.0, REGION_ALPHA.1),
    }
}

/// Checks the number of paths of the bridges of a final sample size.
fn check_bridges(paths: usize, size: usize) -> Result<(), FieldError> {
    let counted = format!("the final sample size (of which {GRADED_FROM} count)");
    check_paths(paths, size.min(GRADED_FROM), BRIDGE_NUMBERS, &counted)
}

/// Checks a number of paths, of which each has `times` numbers and all together at most so many; `counted` describes
/// `times`.
fn check_paths(paths: usize, times: usize, most: usize, counted: &str) -> Result<(), FieldError> {
    whole("problem.radius.paths", paths, &PATHS)?;
    if paths.saturating_mul(times) > most {
        let rule = format!("must be smaller: multiplied by {counted} it may be at most {most}");
        return Err(FieldError::new("problem.radius.paths", paths, rule));
    }
    Ok(())
}
