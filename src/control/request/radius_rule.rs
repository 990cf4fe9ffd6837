//! How the radius of an uncertainty set follows from the sample.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::framework::Framework;

/// How the radius of the uncertainty set follows from the sample of size n: `chi_square` of the parametric frameworks'
/// confidence region, every other of the Wasserstein ball.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "rule", rename_all = "snake_case", deny_unknown_fields)]
pub enum RadiusRule {
    /// `scale Q / sqrt(n)`, Q the (1 - alpha)-quantile of the bridge statistic over simulated paths.
    Bridge {
        /// Miscoverage, the probability that the ball misses the true law.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// Simulated paths.
        #[serde(default = "defaults::paths")]
        paths: usize,
        /// A factor on the radius.
        #[serde(default = "defaults::scale")]
        scale: f64,
        /// By what every simulated quantile is multiplied, so that that of the history is exact: found, never asked for. What a
        /// request says here is found anew.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        correction: Option<f64>,
    },
    /// That of `bridge` times a factor found once, from the history: with it, the balls of a share 1 - alpha of records drawn from the
    /// smoothed law of the history hold that law.
    Calibrated {
        /// Miscoverage.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// Simulated paths.
        #[serde(default = "defaults::paths")]
        paths: usize,
        /// One more factor on the radius.
        #[serde(default = "defaults::scale")]
        scale: f64,
    },
    /// `sqrt(ln(C / alpha) / (c n))`, the concentration inequality of Fournier and Guillin.
    Concentration {
        /// Miscoverage.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
        /// C of the inequality.
        #[serde(rename = "C")]
        numerator: f64,
        /// c of the inequality, per squared log-return.
        #[serde(rename = "c")]
        rate: f64,
    },
    /// `kappa / sqrt(n)`.
    RootN {
        /// In log-return.
        kappa: f64,
    },
    /// The same radius at every sample size.
    Fixed {
        /// In log-return.
        radius: f64,
    },
    /// `sqrt(kappa / n)` estimated standard deviations, kappa the (1 - alpha)-quantile of chi-square with two degrees
    /// of freedom: `n (mu - m)^2 / v + n (s2 - v)^2 / (2 v^2) <= kappa`, m and v the sample's mean and variance.
    ChiSquare {
        /// Miscoverage.
        #[serde(default = "defaults::alpha")]
        alpha: f64,
    },
}

impl RadiusRule {
    /// As on the wire.
    pub fn name(&self) -> &'static str {
        match self {
            RadiusRule::Bridge { .. } => "bridge",
            RadiusRule::Calibrated { .. } => "calibrated",
            RadiusRule::Concentration { .. } => "concentration",
            RadiusRule::RootN { .. } => "root_n",
            RadiusRule::Fixed { .. } => "fixed",
            RadiusRule::ChiSquare { .. } => "chi_square",
        }
    }

    /// The rule of a request that names none.
    pub fn default_of(framework: Framework) -> Self {
        let alpha = defaults::alpha();
        if framework.is_parametric() { RadiusRule::ChiSquare { alpha } } else { RadiusRule::bridge(alpha) }
    }

    /// The bridge rule at this miscoverage, with the default number of paths and no factor.
    pub fn bridge(alpha: f64) -> Self {
        RadiusRule::scaled_bridge(alpha, defaults::scale())
    }

    /// The same with a factor on the radius.
    pub fn scaled_bridge(alpha: f64, scale: f64) -> Self {
        RadiusRule::Bridge { alpha, paths: defaults::paths(), scale, correction: None }
    }

    /// The rule of a radius so many times as large, of those that are simulated.
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

    /// Simulated paths, 0 under rules that simulate none.
    pub fn paths(&self) -> usize {
        match *self {
            RadiusRule::Bridge { paths, .. } | RadiusRule::Calibrated { paths, .. } => paths,
            _ => 0,
        }
    }

    /// The level of the rules that have one.
    pub fn alpha(&self) -> Option<f64> {
        match *self {
            RadiusRule::Bridge { alpha, .. }
            | RadiusRule::Calibrated { alpha, .. }
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
