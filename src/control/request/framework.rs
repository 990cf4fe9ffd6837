//! The frameworks: what the investor is robust against, and whether he learns.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the investor is robust against, and whether observing returns changes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Framework {
    /// Wasserstein ball whose centre and radius follow the observed returns (the paper).
    #[default]
    Adaptive,
    /// Wasserstein ball frozen at the history.
    Static,
    /// No uncertainty: the law is `problem.law`.
    KnownLaw,
    /// The empirical law is learned and taken as true: radius zero.
    PlugIn,
    /// Returns are taken as normal: the joint confidence region for their mean and variance, frozen at the history.
    ParametricStatic,
    /// The same region, estimated anew with every return (Bielecki, Chen, Cialenco, Cousin and Jeanblanc 2019).
    ParametricAdaptive,
}

impl Framework {
    /// The name in requests and reports.
    pub fn name(self) -> &'static str {
        match self {
            Framework::Adaptive => "adaptive",
            Framework::Static => "static",
            Framework::KnownLaw => "known_law",
            Framework::PlugIn => "plug_in",
            Framework::ParametricStatic => "parametric_static",
            Framework::ParametricAdaptive => "parametric_adaptive",
        }
    }

    /// True where the empirical law is part of the state.
    pub fn learns(self) -> bool {
        matches!(self, Framework::Adaptive | Framework::PlugIn | Framework::ParametricAdaptive)
    }

    /// True where the uncertainty set is frozen at the history.
    pub fn is_frozen(self) -> bool {
        matches!(self, Framework::Static | Framework::ParametricStatic)
    }

    /// True where laws lie in a Wasserstein ball.
    pub fn has_ball(self) -> bool {
        matches!(self, Framework::Adaptive | Framework::Static)
    }

    /// True where returns are taken as normal.
    pub fn is_parametric(self) -> bool {
        matches!(self, Framework::ParametricStatic | Framework::ParametricAdaptive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_framework_is_called_what_a_request_calls_it() {
        use Framework::{Adaptive, KnownLaw, ParametricAdaptive, ParametricStatic, PlugIn, Static};
        for framework in [Adaptive, Static, KnownLaw, PlugIn, ParametricStatic, ParametricAdaptive] {
            assert_eq!(serde_json::to_value(framework).unwrap(), framework.name());
        }
    }
}
