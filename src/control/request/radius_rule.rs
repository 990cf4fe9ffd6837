//! How the radius of an uncertainty set follows from the sample.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::framework::Framework;

/// Rule by which the radius of the uncertainty set follows from the sample of size n. `chi_square` is for the
/// confidence region of the parametric frameworks, every other rule for the Wasserstein ball.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "rule", rename_all = "snake_case", deny_unknown_fields)]
pub enum RadiusRule {
    /// `scale Q / sqrt(n)`, with Q the (1 - alpha)-quantile of the bridge statistic over simulated paths.
    Bridge {
        /// Miscoverage: the probability that the ball misses the true law, 0.001 to 0.999. Default 0.1.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// Number of simulated paths, 100 to 100,000. Default 2000.
        #[serde(default = "defaults::paths")]
        paths: usize,
        /// Factor on the radius, 0 to 100. Default 1.
        #[serde(default = "defaults::scale")]
        scale: f64,
        /// Factor on every simulated quantile that makes the quantile of the history exact. The service computes it and
        /// replaces any value in a request.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        correction: Option<f64>,
    },
    /// The radius of `bridge` times a factor found once, from the history. For records drawn from the smoothed law of
    /// the history, a share 1 - alpha of the balls with this factor contain that law.
    Calibrated {
        /// Miscoverage, 0.01 to 0.999. Default 0.1.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// Number of simulated paths, 100 to 100,000. Default 2000.
        #[serde(default = "defaults::paths")]
        paths: usize,
        /// Further factor on the radius, 0 to 100. Default 1.
        #[serde(default = "defaults::scale")]
        scale: f64,
    },
    /// The radius of `bridge` times a factor found once, from the history, with which the balls of all steps of the
    /// horizon hold the law together in a share 1 - alpha of all cases. With one step, or a ball frozen at the history,
    /// the factor is 1. The weights of returns must be equal.
    Joint {
        /// Miscoverage: the probability that the ball of any step misses the true law, 0.001 to 0.999. Default 0.1.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// Number of simulated paths, 100 to 100,000. Default 2000.
        #[serde(default = "defaults::paths")]
        paths: usize,
    },
    /// `D min(sqrt(ln(2 / alpha) / (2 n)), (1/2 + sqrt(ln(1 / alpha) / 2)) / sqrt(n))`, with D the length of the
    /// `support`, which must be `between`. At every n and for every law on the support, a ball misses the law with
    /// probability at most alpha, if returns are independent. If weights decay, only the second term applies. Sources:
    /// Massart (1990) for the constant of the Dvoretzky-Kiefer-Wolfowitz inequality, and McDiarmid (1989).
    Concentration {
        /// Miscoverage, 0.001 to 0.999. Default 0.1.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
    },
    /// `kappa / sqrt(n)`.
    RootN {
        /// kappa, in log-return, 0 to 100.
        kappa: f64,
    },
    /// A fixed radius at every sample size.
    Fixed {
        /// Radius, in log-return, 0 to 10.
        radius: f64,
    },
    /// `sqrt(kappa / n)` estimated standard deviations, with kappa the (1 - alpha)-quantile of chi-square with two
    /// degrees of freedom. The region is `n (mu - m)^2 / v + n (s2 - v)^2 / (2 v^2) <= kappa`, with m and v the
    /// sample's mean and variance.
    ChiSquare {
        /// Miscoverage, 0.001 to 1. Default 0.1.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
    },
}

impl RadiusRule {
    /// Returns the name used in requests.
    pub fn name(&self) -> &'static str {
        match self {
            RadiusRule::Bridge { .. } => "bridge",
            RadiusRule::Calibrated { .. } => "calibrated",
            RadiusRule::Joint { .. } => "joint",
            RadiusRule::Concentration { .. } => "concentration",
            RadiusRule::RootN { .. } => "root_n",
            RadiusRule::Fixed { .. } => "fixed",
            RadiusRule::ChiSquare { .. } => "chi_square",
        }
    }

    /// Returns the rule of a request that names none.
    pub fn default_of(framework: Framework) -> Self {
        let alpha = defaults::alpha();
        if framework.is_parametric() { RadiusRule::ChiSquare { alpha } } else { RadiusRule::bridge(alpha) }
    }

    /// Returns the bridge rule at this miscoverage, with the default number of paths and no factor.
    pub fn bridge(alpha: f64) -> Self {
        RadiusRule::scaled_bridge(alpha, defaults::scale())
    }

    /// Returns the bridge rule at this miscoverage, with a factor on the radius.
    pub fn scaled_bridge(alpha: f64, scale: f64) -> Self {
        RadiusRule::Bridge { alpha, paths: defaults::paths(), scale, correction: None }
    }

    /// Multiplies the scale of a rule that has one by `factor`; other rules stay as they are.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            RadiusRule::Bridge { alpha, paths, scale, correction } => {
                RadiusRule::Bridge { alpha, paths, scale: scale * factor, correction }
            }
            RadiusRule::Calibrated { alpha, paths, scale } => {
                RadiusRule::Calibrated { alpha, paths, scale: scale * factor }
            }
            rule => rule,
        }
    }

    /// Returns the number of simulated paths, 0 under rules that simulate none.
    pub fn paths(&self) -> usize {
        match *self {
            RadiusRule::Bridge { paths, .. }
            | RadiusRule::Calibrated { paths, .. }
            | RadiusRule::Joint { paths, .. } => paths,
            _ => 0,
        }
    }

    /// Returns the miscoverage of the rules that have one.
    pub fn alpha(&self) -> Option<f64> {
        match *self {
            RadiusRule::Bridge { alpha, .. }
            | RadiusRule::Calibrated { alpha, .. }
            | RadiusRule::Joint { alpha, .. }
            | RadiusRule::Concentration { alpha, .. }
            | RadiusRule::ChiSquare { alpha } => Some(alpha),
            RadiusRule::RootN { .. } | RadiusRule::Fixed { .. } => None,
        }
    }
}

/// The paper's configuration.
mod defaults {
    pub fn alpha() -> f64 {
        0.1
    }
    pub fn paths() -> usize {
        2000
    }
    pub fn scale() -> f64 {
        1.0
    }
}
