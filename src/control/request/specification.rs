//! The training request: every choice a user has, its default and its rule.
//!
//! A [`Specification`] arrives with holes; `Specification::completed` checks every rule (`rules.rs`) and fills what depends on
//! other fields (`completion.rs`). Only a completed one is stored, hashed and solved.

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
use crate::control::request::support::{Interval, Support};

/// A whole training job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Specification {
    /// What the investor is and may do; of several assets, with their fund in the place of one.
    pub problem: ProblemSpecification,
    /// The assets of that fund, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fund: Option<Box<FundSpecification>>,
    /// Where the surrogates are trained.
    #[serde(default)]
    pub design: DesignSpecification,
    /// How the surrogates are made.
    #[serde(default)]
    pub surrogate: SurrogateSpecification,
    /// The same specification and seed give the same policy, bit for bit.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl Specification {
    /// Of a problem, with the defaults of all else.
    pub fn of(problem: ProblemSpecification, seed: u64) -> Self {
        Specification { problem, fund: None, design: Default::default(), surrogate: Default::default(), seed }
    }
}

/// The investor, the asset, and what is known of its returns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProblemSpecification {
    /// What the investor is robust against.
    #[serde(default)]
    pub framework: Framework,
    /// Number of allocation decisions, T.
    #[serde(default = "defaults::horizon")]
    pub horizon: usize,
    /// Bank return per step, r, as a fraction: wealth in the bank grows by the factor 1 + r. 3 % a year are 0.00247 a month.
    pub rate_per_step: f64,
    /// Periods of the history in a year, 12 where they are months: what is said a year is said with it. It changes no advice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<f64>,
    /// x_0, in any currency.
    #[serde(default = "defaults::initial_wealth")]
    pub initial_wealth: f64,
    /// Share of wealth that may be held in the risky asset: `[0, highest]`.
    #[serde(default = "defaults::action_interval")]
    pub action_interval: [f64; 2],
    /// Lost of what is moved between bank and asset, as a share of it, both ways alike.
    #[serde(default)]
    pub trading_cost: f64,
    /// Money added at the end of each period, withdrawn where it is negative: one number for all, or `horizon` numbers.
    #[serde(default)]
    pub contributions: Contributions,
    /// Relative risk aversion, in the place of `utility`: log utility at 1, power utility above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub risk_aversion: Option<f64>,
    /// Of terminal wealth. Default: power utility, risk aversion 3.
    #[serde(default = "UtilitySpecification::not_given")]
    pub utility: UtilitySpecification,
    /// What older returns weigh in the law that is learned.
    #[serde(default)]
    pub learning: Learning,
    /// What the ball is centred on. `known_law` and the parametric frameworks, which have no ball, take no other than the default.
    #[serde(default)]
    pub centre: CentreSpecification,
    /// Default: `bridge`; `chi_square` in the parametric frameworks, which take no other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<RadiusRule>,
    /// The share of the radius that is acted on. Default: `balanced`, and `paper` where a `radius` is given. For the radius rules
    /// `bridge` and `calibrated` alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caution: Option<CautionLevel>,
    /// What the levels are and cost on this record: found, never asked for. What a request says here is found anew.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<Box<CautionLevels>>,
    /// The log-returns that the adversary may use. Default: `worst_seen`. Refused by the parametric frameworks: a normal law has no
    /// bounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<Support>,
    /// The return law of the `known_law` framework; refused by the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<SamplingLaw>,
    /// The log-returns observed before the start, at least two of them distinct.
    pub history: Vec<f64>,
}

/// Utility of terminal wealth, always maximised.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum UtilitySpecification {
    /// `(1 - exp(-risk_aversion x)) / risk_aversion`, risk aversion per unit of wealth. Exactly one of its fields is given.
    Exponential {
        /// Absolute, per unit of wealth.
        #[serde(default = "defaults::not_given")]
        risk_aversion: f64,
        /// The same times the initial wealth, without unit; a completed specification has the absolute one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        risk_aversion_relative: Option<f64>,
    },
    /// `(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)`, risk aversion above 1.
    Power {
        /// Relative, without unit.
        risk_aversion: f64,
    },
    /// `ln x`.
    Log {},
}

impl UtilitySpecification {
    /// Of constant relative risk aversion: log utility at 1, power utility above.
    pub fn relative(risk_aversion: f64) -> Self {
        match risk_aversion {
            1.0 => UtilitySpecification::Log {},
            risk_aversion => UtilitySpecification::Power { risk_aversion },
        }
    }
}

impl Default for UtilitySpecification {
    fn default() -> Self {
        UtilitySpecification::Power { risk_aversion: 3.0 }
    }
}

impl UtilitySpecification {
    /// Stands for one that is not given, which no JSON says.
    pub(super) fn not_given() -> Self {
        UtilitySpecification::Power { risk_aversion: defaults::not_given() }
    }

    pub(super) fn is_given(self) -> bool {
        !matches!(self, UtilitySpecification::Power { risk_aversion } if risk_aversion.is_nan())
    }

    /// Exponential utility of this absolute risk aversion.
    pub fn exponential(risk_aversion: f64) -> Self {
        UtilitySpecification::Exponential { risk_aversion, risk_aversion_relative: None }
    }

    /// The same with its risk aversion per unit of wealth, for who starts with `initial_wealth`:
    /// `risk_aversion = risk_aversion_relative / initial_wealth`.
    /// Checked by: `tests/service/advise.rs::a_relative_risk_aversion_is_of_the_wealth_at_the_start`.
    #[must_use]
    pub fn absolute(self, initial_wealth: f64) -> Self {
        match self {
            UtilitySpecification::Exponential { risk_aversion_relative: Some(relative), .. } => {
                UtilitySpecification::exponential(relative / initial_wealth)
            }
            absolute => absolute,
        }
    }
}

impl ProblemSpecification {
    /// The problem of an investor who has seen `history` and whose bank pays `rate_per_step`, every default taken.
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

    /// False where a state's worth is proportional to its wealth, and the best action does not depend on it.
    pub fn depends_on_wealth(&self) -> bool {
        matches!(self.utility, UtilitySpecification::Exponential { .. }) || !self.contributions.are_none()
    }

    /// The radius rule given, or the framework's default.
    pub fn radius_rule(&self) -> RadiusRule {
        self.radius.unwrap_or_else(|| RadiusRule::default_of(self.framework))
    }

    /// The support rule given, or the default.
    pub fn support_rule(&self) -> Support {
        self.support.unwrap_or_default()
    }
}

/// Which states the surrogates are trained on.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DesignSpecification {
    /// Basis points of the certainty equivalent by which the value served may be off, as a root mean square over the states of a
    /// step, the errors of the steps after it included. Design points are added until fresh states say that it is reached.
    /// Default 0.5 where there is no `count`; where the state is wealth alone, `count` decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// Design points per step, N; with an `accuracy`, at most. Default 1000; 200 where the state is wealth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// Where the empirical laws of the design start.
    #[serde(default)]
    pub initial_laws: InitialLaws,
    /// The law that moves the design forward. Default: `bootstrap`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling_law: Option<SamplingLaw>,
    /// Initial wealths of the design. Default: the initial wealth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wealth: Option<Interval>,
}

/// Where the design's empirical laws start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialLaws {
    /// Every design point starts at the history.
    #[default]
    Given,
    /// Each design point starts at as many fresh draws of the sampling law as the history has.
    Resampled,
}

/// How the surrogates are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SurrogateSpecification {
    /// What the value surrogate regresses.
    #[serde(default)]
    pub target: SurrogateTarget,
    /// What the surrogates see of a state.
    #[serde(default)]
    pub features: FeatureMap,
    /// Number of moments of the law that enter the features; at most two in the parametric frameworks, whose law has no more.
    #[serde(default = "defaults::moment_count")]
    pub moment_count: usize,
    /// Where the hyperparameters are searched.
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

/// What the value surrogate regresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurrogateTarget {
    /// `ln(certainty equivalent / all-bank wealth)`: its zero prior mean is a valid lower bound.
    #[default]
    FloorGain,
    /// The value itself (the paper), around its mean over the design.
    Value,
}

/// How a state becomes the inputs of a surrogate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureMap {
    /// Log wealth; mean, log standard deviation, skewness, log kurtosis; log radius where it varies; the worst-case
    /// excess return over the ball.
    #[default]
    Standardized,
    /// Wealth and the raw moments (the paper).
    RawMoments,
}

/// Box of the maximum-likelihood search, for inputs and targets scaled to unit variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HyperparameterBounds {
    /// In standard deviations of an input over the design.
    pub lengthscale: [f64; 2],
    /// In mean squares of the target over the design.
    pub signal_variance: [f64; 2],
    /// In mean squares of the target over the design.
    pub noise_variance: [f64; 2],
}

impl Default for HyperparameterBounds {
    fn default() -> Self {
        HyperparameterBounds { lengthscale: [0.05, 1e3], signal_variance: [1e-3, 1e5], noise_variance: [1e-10, 1.0] }
    }
}

/// Of every request that has a seed.
pub fn default_seed() -> u64 {
    1
}

/// Defaults that do not depend on other fields.
pub(super) mod defaults {
    pub fn horizon() -> usize {
        10
    }
    /// Stands for a number that is not given, which no JSON says.
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
