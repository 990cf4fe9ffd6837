//! The design: simulated states, step by step, under randomised actions and the sampling law.
//!
//! Every state is drawn anew from its streams when needed, so a design of any size costs no memory. If the law is part
//! of the state, three times as many candidates as design points are simulated. A quarter of the design is used as
//! drawn. The rest are the candidates that lie farthest apart, so that the design includes its edges. Candidates count
//! as farther apart if the points drawn show that a surrogate errs there.
//!
//! One state in eight leaps beyond the record: one return on the way to it is spread evenly over the support, or over
//! twice the worst and the best of the record. The adversary moves returns that far, and a session may report them, so
//! the value there must be learned and not extrapolated. In each period the adversary moves a few percent of the mass,
//! less as the record grows. Over several periods it leads to states after two and three leaps, and so some later
//! returns leap too.

use rand::RngExt;

use super::counts::{Counts, LEAPING};
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::problem::state::State;
use crate::control::request::completion::DEFAULT_COUNT;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{InitialLaws, ProblemSpecification, Specification};
use crate::control::request::support::{Interval, LawExtent, Support};
use crate::control::uncertainty::centre::Centre;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::confidence_region::{self, ConfidenceRegion, NormalLaw};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::streams::stream;

/// Largest number of states that set the guard: 5 of them lie beyond a guard that 99.5 % pass.
pub const GUARDS: usize = 1000;
/// Share of leaps beyond each end of the range, which are moved to the end: the adversary goes there.
const AT_THE_ENDS: f64 = 0.05;
/// Chance of another leap in each later period, times the root of the returns: somewhat more than the mass that the
/// adversary moves under the usual radii.
const AGAIN: f64 = 0.3;
/// How far below the worst return the adversary may go in one period if every return is allowed, in log-return.
const FREE_FALL: f64 = 1.2;
/// Largest number of guards for each design point: in a small design more features would cost more than solving it.
const GUARDS_PER_POINT: usize = 10;

/// A return beyond the record on the way to a state.
struct Leap {
    period: usize,
    /// Its place in the range, from 0 to 1.
    place: f64,
    /// True if the range is all that the adversary may use.
    far: bool,
}

/// The states that a training may have to solve.
pub struct Design {
    problem: ProblemSpecification,
    /// The law of the history.
    history: EmpiricalDistribution,
    /// The dynamics of every period, and of the time after the last.
    periods: Vec<Dynamics>,
    law: ContinuousLaw,
    seed: u64,
    count: usize,
    /// Initial wealths.
    start: Interval,
    resampled: bool,
    /// `ladder[i][t]`: wealths if the state is wealth alone; empty if the law is part of it.
    ladder: Vec<Vec<f64>>,
    /// True if all states of a step are the same: no learning and no wealth in the state.
    constant: bool,
    start_is_single: bool,
}

impl Design {
    /// Builds the design of a completed specification.
    pub fn new(specification: &Specification) -> Self {
        let problem = &specification.problem;
        let design = &specification.design;
        let count = design.count.unwrap_or(DEFAULT_COUNT);
        let bootstrap = SamplingLaw::Bootstrap {};
        let start = design.wealth.unwrap_or(Interval { min: problem.initial_wealth, max: problem.initial_wealth });
        let learns = problem.framework.learns();
        let resampled = learns && design.initial_laws == InitialLaws::Resampled;
        let wealth_matters = problem.depends_on_wealth();
        Design {
            law: continuous_law(design.sampling_law.as_ref().unwrap_or(&bootstrap), problem),
            seed: specification.seed,
            count,
            start,
            resampled,
            ladder: if learns { Vec::new() } else { wealth_ladders(problem, start, count) },
            constant: !learns && !wealth_matters,
            start_is_single: !resampled && (start.min == start.max || !wealth_matters),
            periods: Dynamics::of(problem),
            history: problem.learning.law(&problem.history),
            problem: problem.clone(),
        }
    }

    /// Returns the number of distinct design points of a step: 1 if they are all the same state.
    pub fn count(&self, step: usize) -> usize {
        if self.constant || (step == 0 && self.start_is_single) { 1 } else { self.count }
    }

    /// Returns the number of states of a step by kind. Guards are independent draws of the design's law, to judge the
    /// surrogates by; there are none if the state is wealth alone.
    pub fn counts(&self, step: usize) -> Counts {
        let design = self.count(step);
        let chosen = design > 1 && self.ladder.is_empty();
        let guards = if self.ladder.is_empty() { GUARDS.min(GUARDS_PER_POINT * design) } else { 0 };
        Counts { leaps: chosen && step > 0, ..Counts::new(design, chosen, guards) }
    }

    /// Returns state `index` of `step`; those beyond the candidates are independent draws of the same law. Those from
    /// [`LEAPING`] leap beyond the record in one of the periods or more. Streams: ("initial", 0, index) for the start,
    /// ("design", t, index) for each step, ("leap", step, index) for the leaps. Cost O(history) a step.
    pub fn state(&self, step: usize, index: usize) -> State {
        let problem = &self.problem;
        if let Some(wealths) = self.ladder.get(index) {
            return self.holding_half(wealths[step], self.history.clone());
        }
        let mut generator = stream(self.seed, "initial", 0, index);
        let mut wealth = self.start.min * (self.start.max / self.start.min).powf(generator.random::<f64>());
        let mut holding = stream(self.seed, "initial holding", 0, index).random::<f64>();
        let mut law = if self.resampled {
            let draw = |_: &f64| admissible(self.law.draw(&mut generator), problem);
            problem.learning.law(&problem.history.iter().map(draw).collect::<Vec<f64>>())
        } else {
            self.history.clone()
        };
        let mut leaps = self.leaps_to(step, index).into_iter().peekable();
        let mut seen = Vec::with_capacity(step);
        for (earlier, dynamics) in self.periods[..step].iter().enumerate() {
            let mut generator = stream(self.seed, "design", earlier, index);
            let action = dynamics.highest_action(wealth, problem.action_interval[1]) * generator.random::<f64>();
            let mut log_return = admissible(self.law.draw(&mut generator), problem);
            if let Some(leap) = leaps.next_if(|leap| leap.period == earlier) {
                let mut known = law.clone();
                known.extend(&seen);
                log_return = admissible(self.leap(&known, &leap), problem);
            }
            (wealth, holding) = dynamics.next(wealth, holding, action, log_return);
            seen.push(log_return);
        }
        law.extend(&seen);
        self.holding_half(wealth.max(self.periods[step].least_wealth()), law)
    }

    /// Returns the leaps of a state that leaps, in order: one in any period, and some in the periods after it.
    fn leaps_to(&self, step: usize, index: usize) -> Vec<Leap> {
        let Some(number) = index.checked_sub(LEAPING).filter(|_| step > 0) else { return Vec::new() };
        let mut generator = stream(self.seed, "leap", step, number);
        let period = generator.random_range(0..step);
        // Multiples of the golden ratio are even in every range of numbers.
        let first = Leap { period, place: (number as f64 * GOLDEN).fract(), far: !number.is_multiple_of(2) };
        let again_chance = AGAIN / self.problem.learning.effective_size(self.problem.history.len()).sqrt();
        let again = |period: usize| {
            let leaps = generator.random::<f64>() < again_chance;
            leaps.then(|| Leap { period, place: generator.random(), far: generator.random() })
        };
        std::iter::once(first).chain((period + 1..step).filter_map(again)).collect()
    }

    /// Returns the return of a leap after `law`. Leaps are spread evenly over the support, or over the support that a
    /// record has by default; if that is not all, those that go far are spread over all, at distances that grow.
    fn leap(&self, law: &EmpiricalDistribution, leap: &Leap) -> f64 {
        let extent = LawExtent::of_law(law);
        let [min, max] = extent.ends;
        let usual = Support::default().around(|| extent).unwrap_or(Interval { min, max });
        let whole = self.problem.support_rule().around(|| extent);
        let Interval { min, max } = whole.unwrap_or(Interval { min: usual.min - FREE_FALL, ..usual });
        let place = ((1.0 + 2.0 * AT_THE_ENDS) * leap.place - AT_THE_ENDS).clamp(0.0, 1.0);
        let near = Interval { min: usual.min.max(min), max: usual.max.min(max) };
        if !leap.far || (near.min == min && near.max == max) {
            return near.min + place * (near.max - near.min);
        }
        let scale = 0.5 * (usual.max - usual.min);
        let [low, high] = [min, max].map(|end| ((end - extent.mean) / scale).asinh());
        extent.mean + scale * (low + place * (high - low)).sinh()
    }

    /// Returns a state whose holding is one half: the band and the value are computed for every holding from any one,
    /// best from one in the middle.
    fn holding_half(&self, wealth: f64, law: EmpiricalDistribution) -> State {
        State { wealth, holding: 0.5, law }
    }
}

/// Returns the wealths of a design whose state is wealth alone. They are even in log total wealth, over the range that
/// any allocation can reach within [`REACHED_DEVIATIONS`] of the centre. A simulated design would leave its edges,
/// which the robust step visits, to extrapolation.
fn wealth_ladders(problem: &ProblemSpecification, start: Interval, count: usize) -> Vec<Vec<f64>> {
    let centre = Centre::frozen(problem);
    let (mean, mut variance) = (centre.mean(), centre.variance());
    if let RadiusRule::ChiSquare { alpha } = problem.radius_rule() {
        let radius = confidence_region::radius(alpha, problem.learning.effective_size(problem.history.len()));
        variance = ConfidenceRegion { estimate: NormalLaw { mean, variance }, radius }.largest_variance();
    }
    let periods = Dynamics::of(problem);
    let comes_and_goes = !problem.contributions.are_none();
    // An action can be a larger share of total wealth than of wealth in hand.
    let highest = if comes_and_goes { 1.0 } else { problem.action_interval[1] };
    // The log growth of wealth held from the start, least and most.
    let growth = |step: usize, highest: f64| {
        let elapsed = step as f64;
        let spread = REACHED_DEVIATIONS * highest * (elapsed * variance).sqrt();
        let bank = elapsed * problem.rate_per_step.ln_1p();
        let cost = if step > 0 { periods[0].liquidation(1.0).ln() } else { 0.0 };
        [bank.min(elapsed * mean) - spread + cost, bank.max(elapsed * mean) + spread]
    };
    let mut in_hand = [start.min, start.max];
    let reached = |step: usize| {
        let [low, high] = growth(step, highest);
        let [least, most] = [start.min, start.max].map(|wealth| periods[0].total(wealth, 0.0).ln());
        let (mut low, mut high) = (least + low, most + high);
        if comes_and_goes {
            // Future contributions cannot be lost, and grow only as the bank does.
            let totals = in_hand.map(|wealth| periods[step].total(wealth, 0.0).max(f64::MIN_POSITIVE).ln());
            (low, high) = (low.max(totals[0]), high.min(totals[1]));
            let [now, then] = [step, step + 1].map(|step| growth(step, problem.action_interval[1]));
            for (end, wealth) in in_hand.iter_mut().enumerate() {
                *wealth = *wealth * (then[end] - now[end]).exp() + periods[step].contribution;
            }
        }
        [low, high]
    };
    let ranges: Vec<[f64; 2]> = (0..problem.horizon).map(reached).collect();
    let ladder = |point: usize, step: usize| {
        let [low, high] = ranges[step];
        let total = (low + (high - low) * point as f64 / (count - 1) as f64).exp();
        (total - periods[step].to_come).max(periods[step].least_wealth())
    };
    (0..count).map(|point| (0..problem.horizon).map(|step| ladder(point, step)).collect()).collect()
}

/// The golden ratio less 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Standard deviations of log wealth that the design covers if the state is wealth alone.
const REACHED_DEVIATIONS: f64 = 5.0;
