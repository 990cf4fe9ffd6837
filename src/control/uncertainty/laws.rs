//! The belief about the coming return: a framework turns the law of the returns seen into an uncertainty set, and
//! into the summary from which the features of a law are made.
//!
//! No wealth, no action and no utility: every controlled problem uses the same laws.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::UncertaintySet;
use super::centre::{Centring, known_law};
use super::radius::{Measure, Radii, RadiusEstimator};
use crate::control::cache::Cache;
use crate::control::request::framework::Framework;
use crate::control::request::rules::LOG_RETURN;
use crate::control::request::specification::{FeatureMap, Specification};
use crate::control::request::support::{LawExtent, Support};
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::confidence_region::{ConfidenceRegion, NormalLaw};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::law::exponential_mean::{ExponentialMean, WorstExponential};
use crate::numerics::law::moments::CentralMoments;

/// Smallest variance of an estimated law. With decaying weights no other may be left; an accepted history varies more,
/// however long its session lasts.
const SMALLEST_VARIANCE: f64 = 1e-18;
/// Radii in a summary that leaves the ball out.
const NO_BALL: Radii = Radii { radius: 0.0, radius_ahead: 0.0 };

/// The uncertainty sets of a completed specification, and the summaries of its laws.
pub struct Laws {
    framework: Framework,
    support: Support,
    /// 1 + r, the growth of the bank per step.
    bank: f64,
    /// True if summaries include the ball, because features use it.
    summarises_ball: bool,
    /// Radii of the uncertainty sets.
    pub radii: RadiusEstimator,
    /// Centres of the uncertainty sets.
    pub centring: Centring,
    /// True if the set follows the law of the returns seen.
    learns: bool,
    /// The law of returns, if the framework knows it.
    known_law: Option<ContinuousLaw>,
    /// The uncertainty set of every law, if nothing is learned; computed once.
    fixed: OnceLock<FixedSet>,
}

struct FixedSet {
    set: UncertaintySet,
    measure: Measure,
}

/// A law and its ball in the quantities from which features are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawSummary {
    /// Moments of the empirical law.
    pub moments: CentralMoments,
    /// Radii of its uncertainty set.
    pub radii: Radii,
    /// `min_F E_F[e^Z] / (1 + r) - 1` over the ball around the law of the returns seen: the gain of the first unit of
    /// allocation against the worst law. If that law is the centre its sign decides whether anything is held at the
    /// last step.
    pub robust_excess: f64,
    /// The variance of `e^Z / (1 + r)` under that law.
    pub robust_variance: f64,
}

impl Laws {
    /// Builds the laws of a completed specification with an empty cache.
    pub fn new(specification: &Specification) -> Self {
        Laws::with(specification, Cache::default())
    }

    /// Builds the laws of a completed specification with `kept` as the cache of recomputable results.
    pub fn with(specification: &Specification, kept: Cache) -> Self {
        let problem = &specification.problem;
        let framework = problem.framework;
        let is_ball = framework.learns() && !framework.is_parametric();
        Laws {
            framework,
            support: problem.support_rule(),
            bank: 1.0 + problem.rate_per_step,
            summarises_ball: is_ball && specification.surrogate.features == FeatureMap::Standardized,
            radii: RadiusEstimator::new(specification, kept),
            centring: Centring::of(problem),
            learns: framework.learns() && !problem.centre.takes_order(),
            known_law: known_law(problem),
            fixed: OnceLock::new(),
        }
    }

    /// Returns true if summaries include the ball.
    pub fn summarises_ball(&self) -> bool {
        self.summarises_ball
    }

    /// Returns the uncertainty set at a law: around the law itself if the framework learns.
    pub fn uncertainty_set(&self, law: &EmpiricalDistribution) -> Cow<'_, UncertaintySet> {
        match self.learns {
            true => Cow::Owned(self.learned_set(law, self.radii.radius(law))),
            false => Cow::Borrowed(&self.fixed().set),
        }
    }

    /// Returns the uncertainty set with this radius, in the same unit: the known radius of the law, or a hypothetical
    /// one.
    pub fn uncertainty_set_within(&self, law: &EmpiricalDistribution, radius: f64) -> UncertaintySet {
        match self.learns {
            true => self.learned_set(law, radius),
            false => self.fixed().set.clone().with_radius(radius, self.support),
        }
    }

    /// Returns the radius of the uncertainty set at a law.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        if self.learns { self.radii.radius(law) } else { self.fixed().measure.radius }
    }

    /// Returns the radius at a law and its parts.
    pub fn measure(&self, law: &EmpiricalDistribution) -> Measure {
        if self.learns { self.radii.measure(law) } else { self.fixed().measure }
    }

    /// Returns the effective sample size of the law that the set is around.
    pub fn effective_size(&self, law: &EmpiricalDistribution) -> f64 {
        let learned = &self.radii.learned;
        if learned.is_by_age() { law.effective_size() } else { learned.effective_size() }
    }

    /// Returns how many numbers are read to measure a law, or `None` if these are yet to be computed.
    pub fn cost(&self, law: &EmpiricalDistribution) -> Option<usize> {
        if self.learns { self.radii.cost(law.sample_size()) } else { self.fixed.get().map(|_| 0) }
    }

    /// Computes the data that measuring a law reads.
    pub fn prepare(&self, law: &EmpiricalDistribution) {
        match self.learns {
            true => self.radii.prepare(law.sample_size()),
            false => _ = self.fixed(),
        }
    }

    /// Returns the least mean of e^Z, Z the return, among the laws of the ball around a law.
    pub fn worst_mean(&self, law: &EmpiricalDistribution) -> f64 {
        let lowest = self.least_return(law);
        let radius = self.radii.of_returns(self.radius(law), law.effective_size());
        ExponentialMean::of(law).worst(radius, lowest).mean
    }

    /// Returns an upper bound on the returns of the centre while `periods` more returns are learned, each of them at
    /// most the bound before it. For estimates that are learned, it is the best return accepted.
    pub fn best_return(&self, law: &EmpiricalDistribution, periods: usize) -> f64 {
        self.best_return_with(law, f64::NEG_INFINITY, periods)
    }

    /// Returns the bound of [`Self::best_return`] after `log_return` has been learned as well.
    pub fn best_return_with(&self, law: &EmpiricalDistribution, log_return: f64, periods: usize) -> f64 {
        match (self.learns, self.framework.is_parametric()) {
            (false, _) => self.fixed().set.best_return(),
            (true, true) => LOG_RETURN,
            (true, false) => self.centring.highest(law, log_return, periods),
        }
    }

    fn fixed(&self) -> &FixedSet {
        self.fixed.get_or_init(|| {
            let history = &self.radii.learned;
            let measure = self.radii.measure(history);
            let set = match &self.known_law {
                Some(law) => UncertaintySet::around(self.centring.known_centre(law), measure.radius, self.support),
                None => self.learned_set(history, measure.radius),
            };
            FixedSet { set, measure }
        })
    }

    /// Returns the set of the framework around an empirical law.
    fn learned_set(&self, law: &EmpiricalDistribution, radius: f64) -> UncertaintySet {
        if !self.framework.is_parametric() {
            return UncertaintySet::around(self.centring.centre(law), radius, self.support);
        }
        let moments = CentralMoments::of(law);
        let estimate = NormalLaw { mean: moments.mean(), variance: moments.variance().max(SMALLEST_VARIANCE) };
        UncertaintySet::Region(ConfidenceRegion { estimate, radius })
    }

    /// Returns the summary of a law.
    pub fn summary(&self, law: &EmpiricalDistribution) -> LawSummary {
        self.summary_within(law, if self.summarises_ball { self.radius(law) } else { 0.0 })
    }

    /// Returns the summary of a law whose radius is known already.
    pub fn summary_within(&self, law: &EmpiricalDistribution, radius: f64) -> LawSummary {
        match self.summarises_ball {
            true => self.summaries_within(law, &[self.radii.radii(law, radius)])[0],
            false => without_ball(CentralMoments::of(law)),
        }
    }

    /// Returns the summaries of laws of one size with their balls: law by law, at each miscoverage.
    pub fn summaries_of(&self, laws: &[&EmpiricalDistribution], alphas: &[f64]) -> Vec<Vec<LawSummary>> {
        let radii = self.radii.radii_of(laws, alphas);
        laws.iter().zip(radii).map(|(law, radii)| self.summaries_within(law, &radii)).collect()
    }

    /// Returns the summaries of one law within each of `radii`.
    fn summaries_within(&self, law: &EmpiricalDistribution, radii: &[Radii]) -> Vec<LawSummary> {
        let (moments, mean) = (CentralMoments::of(law), ExponentialMean::of(law));
        let lowest = self.lowest_return(|| extent(law, moments, None));
        let of_returns = |radius: f64| self.radii.of_returns(radius, law.effective_size());
        radii
            .iter()
            .map(|&radii| self.with_ball(moments, radii, mean.worst(of_returns(radii.radius), lowest)))
            .collect()
    }

    /// Returns the summaries of the laws that follow from `law` when each of `returns` (ascending) is learned.
    pub fn summaries_with(&self, law: &EmpiricalDistribution, returns: &[f64]) -> Vec<LawSummary> {
        let before = CentralMoments::of(law);
        if !self.learns {
            return vec![without_ball(before); returns.len()];
        }
        if !self.summarises_ball {
            return returns.iter().map(|&log_return| without_ball(before.with(log_return))).collect();
        }
        let (mean, [size, _]) = (ExponentialMean::of(law), law.effective_sizes_ahead());
        let summary = |(&log_return, radii): (&f64, Radii)| {
            let moments = before.with(log_return);
            let lowest = self.lowest_return(|| extent(law, moments, Some(log_return)));
            let worst = mean.worst_with(log_return, self.radii.of_returns(radii.radius, size), lowest);
            self.with_ball(moments, radii, worst)
        };
        returns.iter().zip(self.radii.radii_with(law, returns)).map(summary).collect()
    }

    fn with_ball(&self, moments: CentralMoments, radii: Radii, worst: WorstExponential) -> LawSummary {
        let WorstExponential { mean, variance } = worst;
        let [robust_excess, robust_variance] = [mean / self.bank - 1.0, variance / (self.bank * self.bank)];
        LawSummary { moments, radii, robust_excess, robust_variance }
    }

    /// Returns the least return that the support around a law allows, minus infinity without a support.
    pub fn least_return(&self, law: &EmpiricalDistribution) -> f64 {
        self.lowest_return(|| extent(law, CentralMoments::of(law), None))
    }

    /// Returns the least return to which a seen return may be moved.
    fn lowest_return(&self, law: impl FnOnce() -> LawExtent) -> f64 {
        self.support.around(law).map_or(f64::NEG_INFINITY, |support| support.min)
    }
}

/// Returns the extent of a law of these moments, including one more return if there is one.
fn extent(law: &EmpiricalDistribution, moments: CentralMoments, added: Option<f64>) -> LawExtent {
    let atoms = law.atoms();
    let seen = [atoms.first(), atoms.last()].map(|end| end.copied().or(added).unwrap_or_default());
    let ends = added.map_or(seen, |z| [seen[0].min(z), seen[1].max(z)]);
    LawExtent { ends, mean: moments.mean(), variance: moments.variance() }
}

fn without_ball(moments: CentralMoments) -> LawSummary {
    LawSummary { moments, radii: NO_BALL, robust_excess: 0.0, robust_variance: 0.0 }
}
