//! The frameworks: what the investor is robust against, and whether they learn.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The framework: what the advice is robust against, and whether new returns change it. Default: `adaptive`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Framework {
    /// Wasserstein ball whose centre and radius follow the observed returns (the paper).
    #[default]
    Adaptive,
    /// Wasserstein ball of the history, which later returns do not change.
    Static,
    /// No uncertainty: returns follow `problem.law`.
    KnownLaw,
    /// The empirical law is learned and taken as the true law: the radius is 0.
    PlugIn,
    /// Returns are assumed normal. The uncertainty set is the joint confidence region for their mean and variance,
    /// frozen at the history.
    ParametricStatic,
    /// The confidence region of `parametric_static`, estimated again with every new return (Bielecki, Chen, Cialenco,
    /// Cousin and Jeanblanc 2019).
    ParametricAdaptive,
}

impl Framework {
    /// Returns the name used in requests and reports.
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

    /// Returns true if the empirical law is part of the state.
    pub fn learns(self) -> bool {
        matches!(self, Framework::Adaptive | Framework::PlugIn | Framework::ParametricAdaptive)
    }

    /// Returns true if the uncertainty set is frozen at the history.
    pub fn is_frozen(self) -> bool {
        matches!(self, Framework::Static | Framework::ParametricStatic)
    }

    /// Returns true if the uncertainty set is a Wasserstein ball.
    pub fn has_ball(self) -> bool {
        matches!(self, Framework::Adaptive | Framework::Static)
    }

    /// Returns true if returns are assumed normal.
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
