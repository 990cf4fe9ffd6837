//! The factor on the radius of one fund with which the balls of all funds of several assets hold their laws at once.

use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::radius_rules::RADIUS_SCALE;
use crate::numerics::bridge::funds::FundBridges;

/// Paths of the joint factor: its relative standard error is then a hundredth.
const FACTOR_PATHS: usize = 1000;

/// Returns the bytes of the bridges behind the factor of assets over so many dates.
pub fn joint_bytes(dates: usize) -> usize {
    dates.saturating_mul(FACTOR_PATHS * size_of::<f64>())
}

/// Returns the factor for assets with the returns `rows`, date by date: at least 1, and at most what keeps the scale of
/// the rule within its bound. It is 1 for a single asset, and under rules that use the sample size alone.
pub fn radius_factor(rows: &[Vec<f64>], rule: RadiusRule, seed: u64) -> f64 {
    match rule {
        RadiusRule::Bridge { alpha, scale, .. } | RadiusRule::Calibrated { alpha, scale, .. }
            if rows.first().is_some_and(|row| row.len() > 1) =>
        {
            let found = FundBridges::simulate(rows, FACTOR_PATHS, seed).joint_factor(alpha).value;
            let most = RADIUS_SCALE.1 / scale;
            // A quotient may be rounded up.
            let most = if scale * most > RADIUS_SCALE.1 { most.next_down() } else { most };
            found.min(most).max(1.0)
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_stays_within_its_bound() {
        let rows: Vec<Vec<f64>> =
            (0..40).map(|date| vec![(date % 7) as f64 / 100.0, (date % 5) as f64 / 100.0]).collect();
        let factor = |scale| radius_factor(&rows, RadiusRule::scaled_bridge(0.1, scale), 1);
        assert!(factor(1.0) > 1.05, "{}", factor(1.0));
        assert_eq!((factor(0.0), factor(80.0), factor(100.0)), (factor(1.0), factor(1.0).min(1.25), 1.0));
        // 100 / 88 and 100 / 83, rounded, are too much.
        assert!([83.0, 88.0, 91.0, 99.9].into_iter().all(|scale| scale * factor(scale) <= 100.0));
    }
}
