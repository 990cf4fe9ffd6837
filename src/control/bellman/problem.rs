//! The problem with everything that does not change from step to step: its uncertainty sets, its dynamics and its
//! features.

use std::borrow::Cow;
use std::sync::OnceLock;

use crate::control::error::FieldError;
use crate::control::kept::Cache;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::holdings::Holdings;
use crate::control::problem::state::State;
use crate::control::request::rules::LOG_RETURN;
use crate::control::request::specification::{ProblemSpecification, Specification, UtilitySpecification};
use crate::control::request::support::{LawExtent, Support};
use crate::control::request::withdrawals::check_bank;
use crate::control::surrogate::features::{FeatureSelection, Features, LawSummary};
use crate::control::uncertainty::UncertaintySet;
use crate::control::uncertainty::centre::{Centre, Centring, record};
use crate::control::uncertainty::radius::{Measure, Radii, RadiusEstimator};
use crate::numerics::confidence_region::{ConfidenceRegion, NormalLaw};
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::exponential_mean::{ExponentialMean, WorstExponential};
use crate::numerics::moments::CentralMoments;

/// Smallest variance of an estimated law. With decaying weights no other may be left; an accepted history varies more,
/// however long its session lasts.
const SMALLEST_VARIANCE: f64 = 1e-18;
/// Radii for features that do not depend on the ball.
const NO_BALL: Radii = Radii { radius: 0.0, radius_ahead: 0.0 };

/// The problem of a completed specification.
pub struct Problem {
    /// The completed specification.
    pub specification: Specification,
    /// Radii of its uncertainty sets.
    pub sets: RadiusEstimator,
    /// Centres of its uncertainty sets.
    pub centring: Centring,
    /// The features of a state that the surrogates use.
    pub selection: FeatureSelection,
    /// The dynamics of every period, and of the time after the last.
    periods: Vec<Dynamics>,
    /// The uncertainty set of every state, if nothing is learned; computed once.
    frozen: OnceLock<Frozen>,
}

struct Frozen {
    set: UncertaintySet,
    measure: Measure,
}

impl Problem {
    /// Builds the problem of a completed specification.
    pub fn new(specification: &Specification) -> Self {
        Problem::with(specification, Cache::default())
    }

    /// Builds the problem with `kept` as the cache of recomputable results.
    pub fn with(specification: &Specification, kept: Cache) -> Self {
        let sets = RadiusEstimator::new(specification, kept);
        let selection = FeatureSelection::new(specification, sets.varies());
        let periods = Dynamics::of(&specification.problem);
        let centring = Centring::of(&specification.problem);
        Problem { specification: specification.clone(), sets, centring, selection, periods, frozen: OnceLock::new() }
    }

    /// Returns `count` holdings if trading costs; otherwise the holding does not matter, and one is enough.
    pub fn holdings(&self, count: usize) -> Holdings {
        let problem = &self.specification.problem;
        Holdings::new(if problem.trading_cost > 0.0 { count } else { 1 }, problem.action_interval[1])
    }

    /// Returns A, the shares of wealth that may be held in the period after `step`.
    pub fn actions(&self, step: usize, state: &State) -> ActionInterval {
        let [lowest, highest] = self.specification.problem.action_interval;
        ActionInterval { lowest, highest: self.dynamics(step).highest_action(state.wealth, highest) }
    }

    /// Returns S of the period after `step`, which is at most the horizon.
    pub fn dynamics(&self, step: usize) -> Dynamics {
        self.periods[step.min(self.periods.len() - 1)]
    }

    /// Returns an action of 1 as a share of total wealth, before anything is sold: the surrogates know actions as
    /// shares of that.
    pub fn unit_of_action(&self, step: usize, state: &State) -> f64 {
        self.dynamics(step).in_hand(state.wealth, 0.0)
    }

    /// Returns the terminal all-bank wealth from a state at `step`.
    pub fn floor(&self, step: usize, state: &State) -> f64 {
        self.dynamics(step).floor(state.wealth, state.holding, self.specification.problem.horizon - step)
    }

    /// Checks that the bank alone pays for every withdrawal, starting from the wealth left after selling everything in
    /// the first state.
    ///
    /// # Errors
    /// The bank runs dry; the field is `wealth`.
    pub fn check_withdrawals(&self, state: &State) -> Result<(), FieldError> {
        let liquidated = state.wealth * self.dynamics(0).liquidation(state.holding);
        let periods = &self.periods[..self.periods.len() - 1];
        check_bank(periods, liquidated).map_err(|rule| FieldError::new("wealth", state.wealth, rule))
    }

    /// Returns the derivative of U at the floor times the floor, which turns relative utility into utility.
    pub fn utility_at_floor(&self, step: usize, state: &State) -> f64 {
        let floor = self.floor(step, state);
        match self.specification.problem.utility {
            UtilitySpecification::Exponential { risk_aversion, .. } => floor * (-risk_aversion * floor).exp(),
            UtilitySpecification::Power { risk_aversion } => floor.powf(1.0 - risk_aversion),
            UtilitySpecification::Log {} => 1.0,
        }
    }

    /// Returns true if some law in a ball of this radius wipes out an allocation: all wealth, under power utility and
    /// without a least return. A slightly wrong surrogate may advise it; the step solved anew never does.
    pub fn is_ruined(&self, radius: f64, allocation: f64) -> bool {
        let problem = &self.specification.problem;
        let has_ball = problem.framework.has_ball() && radius > 0.0;
        let is_power = matches!(problem.utility, UtilitySpecification::Power { .. });
        has_ball && is_power && problem.support_rule() == (Support::None {}) && allocation >= 1.0
    }

    /// Returns an upper bound on the floor gain of a state at `step`: the gain at the best return of its centre in
    /// every period. The worst law of a ball is no better than its centre, and learning one of its own returns leaves
    /// the best as it is. For estimates that are learned, the bound uses the best return accepted.
    pub fn largest_gain(&self, step: usize, state: &State) -> f64 {
        let problem = &self.specification.problem;
        let best = match (self.learns(), problem.framework.is_parametric()) {
            (false, _) => self.frozen().set.best_return(),
            (true, true) => LOG_RETURN,
            (true, false) => self.centring.highest(&state.law, problem.horizon - step),
        };
        let [all, unsold] = [state.holding, 0.0].map(|holding| self.dynamics(step).total(state.wealth, holding));
        largest_gain(problem, step, best) + (unsold / all).ln()
    }

    /// Returns the uncertainty set at a state: around the state's law if the framework learns.
    pub fn uncertainty_set(&self, state: &State) -> Cow<'_, UncertaintySet> {
        match self.learns() {
            true => Cow::Owned(self.learned_set(&state.law, self.sets.radius(&state.law))),
            false => Cow::Borrowed(&self.frozen().set),
        }
    }

    /// Returns the uncertainty set with this radius, in the same unit: the known radius of the state, or a hypothetical
    /// one.
    pub fn uncertainty_set_within(&self, state: &State, radius: f64) -> UncertaintySet {
        match self.learns() {
            true => self.learned_set(&state.law, radius),
            false => self.frozen().set.clone().with_radius(radius, self.specification.problem.support_rule()),
        }
    }

    /// Returns the radius of the uncertainty set at a state.
    pub fn radius(&self, state: &State) -> f64 {
        if self.learns() { self.sets.radius(&state.law) } else { self.frozen().measure.radius }
    }

    /// Returns the least mean of e^Z, Z the return, among the laws of a state's ball.
    pub fn worst_mean(&self, state: &State) -> f64 {
        let law = &state.law;
        let lowest = self.lowest_return(|| extent(law, CentralMoments::of(law), None));
        let radius = self.sets.of_returns(self.radius(state), law.effective_size());
        ExponentialMean::of(law).worst(radius, lowest).mean
    }

    /// Returns the radius of a state and its parts.
    pub fn measure(&self, state: &State) -> Measure {
        if self.learns() { self.sets.measure(&state.law) } else { self.frozen().measure }
    }

    /// Returns how many numbers are read to measure a state, or `None` if these are yet to be computed.
    pub fn cost(&self, state: &State) -> Option<usize> {
        if self.learns() { self.sets.cost(state.law.sample_size()) } else { self.frozen.get().map(|_| 0) }
    }

    /// Computes the data that measuring a state reads.
    pub fn prepare(&self, state: &State) {
        match self.learns() {
            true => self.sets.prepare(state.law.sample_size()),
            false => _ = self.frozen(),
        }
    }

    fn learns(&self) -> bool {
        let ProblemSpecification { framework, centre, .. } = &self.specification.problem;
        framework.learns() && !centre.takes_order()
    }

    fn frozen(&self) -> &Frozen {
        self.frozen.get_or_init(|| {
            let problem = &self.specification.problem;
            let history = problem.learning.law(&record(&problem.history, problem));
            let measure = self.sets.measure(&history);
            let set = match problem.framework.is_parametric() {
                true => self.learned_set(&history, measure.radius),
                false => UncertaintySet::around(Centre::frozen(problem), measure.radius, problem.support_rule()),
            };
            Frozen { set, measure }
        })
    }

    /// Returns the set of the framework around an empirical law.
    fn learned_set(&self, law: &EmpiricalDistribution, radius: f64) -> UncertaintySet {
        let problem = &self.specification.problem;
        if !problem.framework.is_parametric() {
            return UncertaintySet::around(self.centring.centre(law), radius, problem.support_rule());
        }
        let moments = CentralMoments::of(law);
        let estimate = NormalLaw { mean: moments.mean(), variance: moments.variance().max(SMALLEST_VARIANCE) };
        UncertaintySet::Region(ConfidenceRegion { estimate, radius })
    }

    /// Returns the features of a state, unscaled.
    pub fn features(&self, step: usize, state: &State) -> Features {
        self.features_within(step, state, if self.selection.has_ball() { self.radius(state) } else { 0.0 })
    }

    /// Returns the features if the radius of the state is known already.
    pub fn features_within(&self, step: usize, state: &State, radius: f64) -> Features {
        if !self.selection.has_ball() {
            let total = self.dynamics(step).total(state.wealth, 0.0);
            return self.selection.of(total, &without_ball(CentralMoments::of(&state.law)));
        }
        self.features_knowing(step, state, self.sets.radii(&state.law, radius))
    }

    /// Returns the features if both radii of the state are known already.
    fn features_knowing(&self, step: usize, state: &State, radii: Radii) -> Features {
        self.features_of(step, state.wealth, &self.summaries(&state.law, &[radii])[0])
    }

    /// Returns the features if the law is summed up already.
    pub fn features_of(&self, step: usize, wealth: f64, law: &LawSummary) -> Features {
        self.selection.of(self.dynamics(step).total(wealth, 0.0), law)
    }

    /// Returns the summaries behind the features, of laws of one size: law by law, at each miscoverage.
    pub fn summaries_of(&self, laws: &[&EmpiricalDistribution], alphas: &[f64]) -> Vec<Vec<LawSummary>> {
        let radii = self.sets.radii_of(laws, alphas);
        laws.iter().zip(radii).map(|(law, radii)| self.summaries(law, &radii)).collect()
    }

    /// Returns the summaries of one law within each of `radii`.
    fn summaries(&self, law: &EmpiricalDistribution, radii: &[Radii]) -> Vec<LawSummary> {
        let (moments, mean) = (CentralMoments::of(law), ExponentialMean::of(law));
        let lowest = self.lowest_return(|| extent(law, moments, None));
        let of_returns = |radius: f64| self.sets.of_returns(radius, law.effective_size());
        radii.iter().map(|&radii| self.summary(moments, radii, mean.worst(of_returns(radii.radius), lowest))).collect()
    }

    /// Returns the features of the laws that follow from `law` when each of `returns` (ascending) is learned, for one
    /// total wealth.
    pub fn features_with(&self, law: &EmpiricalDistribution, total: f64, returns: &[f64]) -> Vec<Features> {
        let before = CentralMoments::of(law);
        if !self.learns() {
            return vec![self.selection.of(total, &without_ball(before)); returns.len()];
        }
        if !self.selection.has_ball() {
            let features = |&log_return: &f64| self.selection.of(total, &without_ball(before.with(log_return)));
            return returns.iter().map(features).collect();
        }
        let (mean, [size, _]) = (ExponentialMean::of(law), law.effective_sizes_ahead());
        let features = |(&log_return, radii): (&f64, Radii)| {
            let moments = before.with(log_return);
            let lowest = self.lowest_return(|| extent(law, moments, Some(log_return)));
            let worst = mean.worst_with(log_return, self.sets.of_returns(radii.radius, size), lowest);
            self.selection.of(total, &self.summary(moments, radii, worst))
        };
        returns.iter().zip(self.sets.radii_with(law, returns)).map(features).collect()
    }

    fn summary(&self, moments: CentralMoments, radii: Radii, worst: WorstExponential) -> LawSummary {
        let bank = 1.0 + self.specification.problem.rate_per_step;
        let WorstExponential { mean, variance } = worst;
        LawSummary { moments, radii, robust_excess: mean / bank - 1.0, robust_variance: variance / (bank * bank) }
    }

    /// Returns the least return to which a seen return may be moved.
    fn lowest_return(&self, law: impl FnOnce() -> LawExtent) -> f64 {
        self.specification.problem.support_rule().around(law).map_or(f64::NEG_INFINITY, |support| support.min)
    }
}

/// Returns the extent of a law of these moments, including one more return if there is one.
fn extent(law: &EmpiricalDistribution, moments: CentralMoments, added: Option<f64>) -> LawExtent {
    let atoms = law.atoms();
    let seen = [atoms.first(), atoms.last()].map(|end| end.copied().or(added).unwrap_or_default());
    let ends = added.map_or(seen, |z| [seen[0].min(z), seen[1].max(z)]);
    LawExtent { ends, mean: moments.mean(), variance: moments.variance() }
}

/// Returns the floor gain from `step` of the highest allocation if every period earns `best_return`:
///
///   (T - t) ln(1 + a ((e^z / (1 + r)) - 1)),   z the best return,
///
/// a the highest allocation, or with contributions or withdrawals 1, the largest share of total wealth that an action
/// can be. A holding before trading also gains the cost of selling it.
pub fn largest_gain(problem: &ProblemSpecification, step: usize, best_return: f64) -> f64 {
    let bank = problem.rate_per_step.ln_1p();
    let excess = (best_return - bank).exp_m1().max(0.0);
    let highest = if problem.contributions.are_none() { problem.action_interval[1] } else { 1.0 };
    (problem.horizon - step) as f64 * (highest * excess).ln_1p()
}

fn without_ball(moments: CentralMoments) -> LawSummary {
    LawSummary { moments, radii: NO_BALL, robust_excess: 0.0, robust_variance: 0.0 }
}
