//! The training request: every choice a user has, its default and its rule.
//!
//! A [`Specification`] arrives with fields left out. `Specification::completed` checks every rule (`rules.rs`) and
//! fills in the fields that depend on others (`completion.rs`). Only a completed one is stored, hashed and solved.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::caution::{CautionLevel, CautionLevels};
use crate::control::request::centre::CentreSpecification;
use crate::control::request::contributions::Contributions;
use crate::control::request::framework::Framework;
use crate::control::request::fund::FundSpecification;
use crate::control::request::learning::Learning;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::spending::Spending;
use crate::control::request::support::{Interval, Support};

/// A complete training job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Specification {
    /// The investor, the asset and the history. For several assets, the asset is their fund.
    pub problem: ProblemSpecification,
    /// The assets of the fund, if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fund: Option<Box<FundSpecification>>,
    /// States that the surrogates are trained on.
    #[serde(default)]
    pub design: DesignSpecification,
    /// Settings of the surrogates.
    #[serde(default)]
    pub surrogate: SurrogateSpecification,
    /// Seed of all random draws. The same specification and seed give the same policy, bit for bit. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl Specification {
    /// Creates the specification of a problem, with the defaults for everything else.
    pub fn of(problem: ProblemSpecification, seed: u64) -> Self {
        Specification { problem, fund: None, design: Default::default(), surrogate: Default::default(), seed }
    }
}

/// The investor, the asset, and what is known of its returns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProblemSpecification {
    /// The framework: what the advice is robust against. Default: `adaptive`.
    #[serde(default)]
    pub framework: Framework,
    /// Number of allocation decisions, T, 1 to 520. Default 10.
    #[serde(default = "defaults::horizon")]
    pub horizon: usize,
    /// Return of the bank per step, r, as a fraction, -0.5 to 0.5: wealth in the bank grows by the factor 1 + r. For
    /// example, 3 % a year is 0.00247 a month.
    pub rate_per_step: f64,
    /// Periods of the history in a year, 1 to 366; 12 for months. Used for annual figures; it does not change the
    /// advice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<f64>,
    /// Initial wealth, x_0, in any currency, 1e-6 to 1e15. Default 100.
    #[serde(default = "defaults::initial_wealth")]
    pub initial_wealth: f64,
    /// Share of wealth that may be held in the risky asset: `[0, highest]`. Default: `[0, 1]`.
    #[serde(default = "defaults::action_interval")]
    pub action_interval: [f64; 2],
    /// Cost of moving money either way between bank and asset, as a share of it: 0, or 1e-9 to 0.1. Default 0.
    #[serde(default)]
    pub trading_cost: f64,
    /// Money added at the end of each period, or withdrawn if negative: one number, or `horizon` numbers. Default 0.
    #[serde(default)]
    pub contributions: Contributions,
    /// Spending that the policy chooses, period after period. Default: none, and utility is of terminal wealth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spending: Option<Box<Spending>>,
    /// Relative risk aversion, 1 to 100, instead of `utility`: log utility at 1, power utility above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub risk_aversion: Option<f64>,
    /// Utility of terminal wealth, or of spending. Default: power utility with risk aversion 3.
    #[serde(default = "UtilitySpecification::not_given")]
    pub utility: UtilitySpecification,
    /// Weights of older returns in the learned law. Default: `equal`.
    #[serde(default)]
    pub learning: Learning,
    /// Centre of the ball. Default: `empirical`. `known_law` and the parametric frameworks have no ball, so they accept
    /// only the default.
    #[serde(default)]
    pub centre: CentreSpecification,
    /// Rule for the radius of the uncertainty set. Default: `bridge`; `chi_square` in the parametric frameworks, which
    /// accept no other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<RadiusRule>,
    /// Share of the radius that is used. Default: `balanced`, or `paper` if a `radius` is given. Levels other than
    /// `paper` need the radius rule `bridge` or `calibrated`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caution: Option<CautionLevel>,
    /// Shares and costs of the caution levels, found by the service from the record. A value in a request is replaced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<Box<CautionLevels>>,
    /// The log-returns that the adversary may use. Default: `worst_seen`. Must be absent in the parametric frameworks,
    /// because a normal law has no bounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<Support>,
    /// The return law of the `known_law` framework, which requires it. Must be absent in the other frameworks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<SamplingLaw>,
    /// The log-returns observed before the start, oldest first: 2 to 20,000 values from -5 to 5, at least two of them
    /// distinct.
    pub history: Vec<f64>,
}

/// Utility of terminal wealth, always maximised.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum UtilitySpecification {
    /// Exponential utility, `(1 - exp(-risk_aversion x)) / risk_aversion`. Exactly one of its fields is given.
    Exponential {
        /// Absolute risk aversion, per unit of wealth, 1e-18 to 1e9.
        #[serde(default = "defaults::not_given")]
        risk_aversion: f64,
        /// Risk aversion times initial wealth, without unit, 0.001 to 100. Completion replaces it by the absolute one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        risk_aversion_relative: Option<f64>,
    },
    /// Power utility, `(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)`.
    Power {
        /// Relative risk aversion, without unit, above 1 and at most 100.
        risk_aversion: f64,
    },
    /// Log utility, `ln x`.
    Log {},
}

impl UtilitySpecification {
    /// Returns the utility of constant relative risk aversion: log utility at 1, power utility above.
    pub fn relative(risk_aversion: f64) -> Self {
        match risk_aversion {
            1.0 => UtilitySpecification::Log {},
            risk_aversion => UtilitySpecification::Power { risk_aversion },
        }
    }

    /// Returns the power of a utility of relative amounts: one less the relative risk aversion, and 0 for the logarithm.
    /// Exponential utility, which spending excludes, has no power and gives 0.
    pub fn power(self) -> f64 {
        match self {
            UtilitySpecification::Power { risk_aversion } => 1.0 - risk_aversion,
            UtilitySpecification::Log {} | UtilitySpecification::Exponential { .. } => 0.0,
        }
    }
}

impl Default for UtilitySpecification {
    fn default() -> Self {
        UtilitySpecification::Power { risk_aversion: 3.0 }
    }
}

impl UtilitySpecification {
    /// Returns the placeholder for a utility that is left out, a value that JSON cannot express.
    pub(super) fn not_given() -> Self {
        UtilitySpecification::Power { risk_aversion: defaults::not_given() }
    }

    pub(super) fn is_given(self) -> bool {
        !matches!(self, UtilitySpecification::Power { risk_aversion } if risk_aversion.is_nan())
    }
}

impl ProblemSpecification {
    /// Returns the problem of an investor with this history and a bank that pays `rate_per_step`, with every default.
    pub fn of(history: Vec<f64>, rate_per_step: f64) -> Self {
        ProblemSpecification {
            framework: Framework::default(),
            horizon: defaults::horizon(),
            rate_per_step,
            periods_per_year: None,
            initial_wealth: defaults::initial_wealth(),
            action_interval: defaults::action_interval(),
            trading_cost: 0.0,
            contributions: Contributions::default(),
            spending: None,
            risk_aversion: None,
            utility: UtilitySpecification::default(),
            learning: Learning::default(),
            centre: CentreSpecification::default(),
            radius: None,
            caution: None,
            levels: None,
            support: None,
            law: None,
            history,
        }
    }

    /// Returns false if a state's value is proportional to its wealth and the best action does not depend on wealth.
    pub fn depends_on_wealth(&self) -> bool {
        matches!(self.utility, UtilitySpecification::Exponential { .. }) || !self.contributions.are_none()
    }

    /// Returns the radius rule given, or the framework's default.
    pub fn radius_rule(&self) -> RadiusRule {
        self.radius.unwrap_or_else(|| RadiusRule::default_of(self.framework))
    }

    /// Returns the support rule given, or the default.
    pub fn support_rule(&self) -> Support {
        self.support.unwrap_or_default()
    }
}

/// The states that the surrogates are trained on.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DesignSpecification {
    /// Target accuracy of the value served, in basis points of the certainty equivalent, 0.01 to 100. It bounds the
    /// root mean square error over the states of a step, including the errors of later steps. Design points are added
    /// until fresh states show that the target is reached. Default 0.5 if there is no `count`. If the state is wealth
    /// alone, `count` decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// Number of design points per step, N, 10 to 10,000; with an `accuracy`, the largest number. Default 1000, or 200
    /// if the state is wealth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// Starting point of the design's empirical laws. Default: `given`.
    #[serde(default)]
    pub initial_laws: InitialLaws,
    /// The law that moves the design forward. Default: `bootstrap`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling_law: Option<SamplingLaw>,
    /// Range of initial wealths in the design. Default: the initial wealth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wealth: Option<Interval>,
}

/// Starting point of the design's empirical laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialLaws {
    /// Every design point starts at the history.
    #[default]
    Given,
    /// Each design point starts at fresh draws of the sampling law, as many as the history has returns.
    Resampled,
}

/// Settings of the surrogates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SurrogateSpecification {
    /// The quantity that the value surrogate regresses. Default: `floor_gain`.
    #[serde(default)]
    pub target: SurrogateTarget,
    /// The features of a state that the surrogates use. Default: `standardized`.
    #[serde(default)]
    pub features: FeatureMap,
    /// Number of moments of the law among the features, 1 to 6. The parametric frameworks use at most two, because a
    /// normal law has no more. Default 4.
    #[serde(default = "defaults::moment_count")]
    pub moment_count: usize,
    /// Bounds of the hyperparameter search.
    #[serde(default)]
    pub bounds: HyperparameterBounds,
}

impl Default for SurrogateSpecification {
    fn default() -> Self {
        SurrogateSpecification {
            target: SurrogateTarget::default(),
            features: FeatureMap::default(),
            moment_count: defaults::moment_count(),
            bounds: HyperparameterBounds::default(),
        }
    }
}

/// The quantity that the value surrogate regresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurrogateTarget {
    /// `ln(certainty equivalent / all-bank wealth)`: its zero prior mean is a valid lower bound.
    #[default]
    FloorGain,
    /// The value itself (the paper), around its mean over the design.
    Value,
}

/// The map from a state to the inputs of a surrogate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureMap {
    /// Log wealth; mean, log standard deviation, skewness, log kurtosis; log radius if it varies; the worst-case excess
    /// return over the ball.
    #[default]
    Standardized,
    /// Wealth and the raw moments (the paper).
    RawMoments,
}

/// Bounds of the maximum-likelihood search, lowest first, for inputs and targets scaled to unit variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HyperparameterBounds {
    /// Length scales, in standard deviations of an input over the design. Default: `[0.05, 1000]`.
    pub lengthscale: [f64; 2],
    /// Signal variances, in mean squares of the target over the design. Default: `[0.001, 100000]`.
    pub signal_variance: [f64; 2],
    /// Noise variances, in mean squares of the target over the design. Default: `[1e-10, 1]`.
    pub noise_variance: [f64; 2],
}

impl Default for HyperparameterBounds {
    fn default() -> Self {
        HyperparameterBounds { lengthscale: [0.05, 1e3], signal_variance: [1e-3, 1e5], noise_variance: [1e-10, 1.0] }
    }
}

/// Returns the default seed of every request that has one.
pub fn default_seed() -> u64 {
    1
}

/// Defaults that do not depend on other fields.
pub(super) mod defaults {
    pub fn horizon() -> usize {
        10
    }
    /// Returns the placeholder for a number that is left out, a value that JSON cannot express.
    pub fn not_given() -> f64 {
        f64::NAN
    }
    pub fn initial_wealth() -> f64 {
        100.0
    }
    pub fn action_interval() -> [f64; 2] {
        [0.0, 1.0]
    }
    pub fn moment_count() -> usize {
        4
    }
}
