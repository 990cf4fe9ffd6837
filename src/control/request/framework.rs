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
    /// The name on the wire.
    pub fn name(self) -> String {
        // A unit variant always has one.
        serde_json::to_value(self).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// True where the empirical law is part of the state.
    pub fn learns(self) -> bool {
        matches!(self, Framework::Adaptive | Framework::PlugIn | Framework::ParametricAdaptive)
    }

    /// True where the uncertainty set is frozen at the history.
    pub fn is_frozen(self) -> bool {
        matches!(self, Framework::Static | Framework::ParametricStatic)
    }

    /// True where returns are taken as normal.
    pub fn is_parametric(self) -> bool {
        matches!(self, Framework::ParametricStatic | Framework::ParametricAdaptive)
    }
}
