//! The features of a state, from which the inputs of a surrogate are made.

use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::specification::{FeatureMap, Specification};
use crate::control::uncertainty::laws::{LawSummary, Laws};

/// Standard deviations below this count as this: the log stays finite.
const SMALLEST_DEVIATION: f64 = 1e-8;
/// Mean and variance fully describe a normal law, and its confidence region at one sample size.
const NORMAL_MOMENTS: usize = 2;
/// Radii below this count as this.
const SMALLEST_RADIUS: f64 = 1e-12;
/// A worst law whose variance is below this share of the centre's counts as having it: the ratio stays finite.
const SMALLEST_VARIANCE_LEFT: f64 = 0.01;

/// The features of a specification, in order: total wealth first, then the law, then its uncertainty set.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureSelection {
    map: FeatureMap,
    wealth: bool,
    moments: usize,
    radius: bool,
    ball: bool,
    /// Relative risk aversion at the initial total wealth.
    risk_aversion: f64,
}

/// The features of a state, unscaled, in the order of [`FeatureSelection::names`]: y-check of the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Features(pub(super) Vec<f64>);

impl Features {
    /// Returns the first feature; NaN if there is none.
    pub fn first(&self) -> f64 {
        self.0.first().copied().unwrap_or(f64::NAN)
    }

    /// Returns the features of a law after those of a physical state.
    pub fn after(self, mut described: Vec<f64>) -> Features {
        described.extend(self.0);
        Features(described)
    }
}

impl FeatureSelection {
    /// Selects the features of a specification with these laws.
    pub fn new(specification: &Specification, laws: &Laws) -> Self {
        let problem = &specification.problem;
        let learns = problem.framework.learns();
        let parametric = problem.framework.is_parametric();
        let most = if parametric { NORMAL_MOMENTS } else { usize::MAX };
        let map = specification.surrogate.features;
        let total = Dynamics::of(problem)[0].total(problem.initial_wealth, 0.0);
        FeatureSelection {
            map,
            wealth: problem.depends_on_wealth(),
            moments: if learns { specification.surrogate.moment_count.min(most) } else { 0 },
            radius: learns && laws.radii.varies() && map == FeatureMap::Standardized,
            ball: laws.summarises_ball(),
            risk_aversion: RelativeUtility::new(problem.utility, total).relative_risk_aversion(),
        }
    }

    /// Returns true if wealth is the first feature.
    pub fn has_wealth(&self) -> bool {
        self.wealth
    }

    /// Returns the names of the features, in order.
    pub fn names(&self) -> Vec<String> {
        let standardized = self.map == FeatureMap::Standardized;
        let mut names = Vec::new();
        if self.wealth {
            names.push(if standardized { "log_wealth" } else { "wealth" }.to_owned());
        }
        for order in 1..=self.moments {
            names.push(match (standardized, order) {
                (false, _) => format!("moment_{order}"),
                (true, 1) => "mean".to_owned(),
                (true, 2) => "log_standard_deviation".to_owned(),
                (true, 3) => "skewness".to_owned(),
                (true, 4) => "log_kurtosis".to_owned(),
                (true, _) => format!("shape_{order}"),
            });
        }
        if self.radius {
            names.push("log_radius".to_owned());
            names.push("radius_trend".to_owned());
        }
        if self.ball {
            names.extend(["robust_merton_ratio", "worst_law_merton_ratio"].map(str::to_owned));
        }
        names
    }

    /// Returns the wealth feature.
    pub fn wealth(&self, total: f64) -> f64 {
        if self.map == FeatureMap::Standardized { total.ln() } else { total }
    }

    /// Returns all features of a state, unscaled. The last two are Merton's ratio against the worst law of the ball,
    ///
    ///   asinh(robust_excess / (rho v)),   rho the relative risk aversion at the initial total wealth,
    ///
    /// v the law's own variance in the first and `robust_variance` in the second: to second order the allocation of an
    /// investor with one period alone. The robust allocation and its value change most where the ratio passes 0 and 1;
    /// asinh compresses its ends, which matter less.
    pub fn of(&self, total: f64, law: &LawSummary) -> Features {
        let mut features = Vec::with_capacity(self.moments + 5);
        if self.wealth {
            features.push(self.wealth(total));
        }
        self.push_law(&mut features, law);
        Features(features)
    }

    /// Returns the features of a law alone.
    pub fn of_law(&self, law: &LawSummary) -> Features {
        let mut features = Vec::with_capacity(self.moments + 4);
        self.push_law(&mut features, law);
        Features(features)
    }

    fn push_law(&self, features: &mut Vec<f64>, law: &LawSummary) {
        let LawSummary { moments, radii, robust_excess, robust_variance } = law;
        for order in 1..=self.moments {
            features.push(match self.map {
                FeatureMap::Standardized => moments.shape(order, SMALLEST_DEVIATION),
                FeatureMap::RawMoments => moments.raw(order),
            });
        }
        if self.radius {
            let log = |radius: f64| radius.max(SMALLEST_RADIUS).ln();
            features.push(log(radii.radius));
            features.push(log(radii.radius_ahead) - log(radii.radius));
        }
        let variance = moments.variance().max(SMALLEST_DEVIATION * SMALLEST_DEVIATION);
        let ratio = |variance: f64| (robust_excess / (self.risk_aversion * variance)).asinh();
        if self.ball {
            features.push(ratio(variance));
            features.push(ratio(robust_variance.max(SMALLEST_VARIANCE_LEFT * variance)));
        }
    }
}
