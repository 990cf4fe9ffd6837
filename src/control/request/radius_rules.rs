//! The rules of a radius.

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole, within};
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::bridge::paths::GRADED_FROM;

/// Allowed number of simulated bridge paths.
pub const PATHS: std::ops::RangeInclusive<usize> = 100..=100_000;
/// Largest bridge matrix, 30 million numbers: 60 MB. Long records share a matrix of fewer times than returns.
const BRIDGE_NUMBERS: usize = 30_000_000;
/// Largest product of paths and returns for a calibration, which reads the paths for each of a thousand records: about a
/// second.
const CALIBRATED_NUMBERS: usize = 3_000_000;
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
/// Largest constant C of the concentration inequality; the smallest is alpha.
const LARGEST_NUMERATOR: f64 = 1e9;
/// Allowed constants c of the concentration inequality, per squared log-return.
const CONCENTRATION_RATE: (f64, f64) = (1e-9, 1e12);
/// Allowed constants kappa of a radius of kappa / sqrt(n), in log-return.
pub const KAPPA: (f64, f64) = (0.0, 100.0);

impl Bounded for RadiusRule {
    const BOUNDS: &'static [FieldBounds] = &[
        ("bridge.alpha", ValueBounds::number(ALPHA)),
        ("calibrated.alpha", ValueBounds::number(CALIBRATED_ALPHA)),
        ("concentration.alpha", ValueBounds::number(ALPHA)),
        ("chi_square.alpha", ValueBounds::number(REGION_ALPHA)),
        ("paths", ValueBounds::count(&PATHS)),
        ("scale", ValueBounds::number(RADIUS_SCALE)),
        ("correction", ValueBounds::number(RADIUS_CORRECTION)),
        ("C", ValueBounds::Above(0.0, LARGEST_NUMERATOR)),
        ("c", ValueBounds::number(CONCENTRATION_RATE)),
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
    match *rule {
        RadiusRule::Bridge { alpha, paths, scale, .. } | RadiusRule::Calibrated { alpha, paths, scale } => {
            let calibrated = matches!(rule, RadiusRule::Calibrated { .. });
            let ((least, most), numbers) =
                if calibrated { (CALIBRATED_ALPHA, CALIBRATED_NUMBERS) } else { (ALPHA, BRIDGE_NUMBERS) };
            within("problem.radius.alpha", alpha, least, most)?;
            whole("problem.radius.paths", paths, &PATHS)?;
            within("problem.radius.scale", scale, RADIUS_SCALE.0, RADIUS_SCALE.1)?;
            if let RadiusRule::Bridge { correction: Some(correction), .. } = *rule {
                within("problem.radius.correction", correction, RADIUS_CORRECTION.0, RADIUS_CORRECTION.1)?;
            }
            let size = problem.history.len() + problem.horizon;
            let times = if calibrated { size } else { size.min(GRADED_FROM) };
            if paths.saturating_mul(times) > numbers {
                let counted = if calibrated { String::new() } else { format!(" (of which {GRADED_FROM} count)") };
                let rule = format!(
                    "must be smaller: multiplied by the final sample size{counted} it may be at most {numbers}"
                );
                return Err(FieldError::new("problem.radius.paths", paths, rule));
            }
            Ok(())
        }
        RadiusRule::Concentration { alpha, numerator, rate } => {
            within("problem.radius.alpha", alpha, ALPHA.0, ALPHA.1)?;
            within("problem.radius.C", numerator, alpha, LARGEST_NUMERATOR)?;
            within("problem.radius.c", rate, CONCENTRATION_RATE.0, CONCENTRATION_RATE.1)
        }
        RadiusRule::RootN { kappa } => within("problem.radius.kappa", kappa, KAPPA.0, KAPPA.1),
        RadiusRule::Fixed { radius } => within("problem.radius.radius", radius, FIXED_RADIUS.0, FIXED_RADIUS.1),
        RadiusRule::ChiSquare { alpha } => within("problem.radius.alpha", alpha, REGION_ALPHA.0, REGION_ALPHA.1),
    }
}
