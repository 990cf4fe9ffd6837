//! Turns simulated paths into the report, each figure with its interval.

use rayon::prelude::*;

use crate::control::evaluation::account::mix_ended;
use crate::control::evaluation::deciding_paths::few_decide;
use crate::control::evaluation::names::{framework_name, mix_name};
use crate::control::evaluation::paths::{Evaluation, Follower, HistoryStart, Lived, Outcomes};
use crate::control::evaluation::report::{
    Costs, Difference, EvaluationReport, FORMAT, HistoryReport, OwnMix, PeriodReport, RadiusSpread, Spread,
    StrategyReport, UtilityReport, WealthReport,
};
use crate::control::evaluation::verdict::beside_own_mix;
use crate::control::policy::content_hash;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::framework::Framework;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::search::chebyshev::even;
use crate::numerics::statistics::summary::{Clustered, Estimate, interpolated_quantile, range};

/// Number of bins of the histograms.
const BINS: usize = 40;
/// Relative distance to the bank's wealth within which wealth counts as the bank's: it differs by rounding alone.
const AT_BANK: f64 = 1e-9;
/// Share of the paths that count as the worst.
const WORST: f64 = 0.05;

impl EvaluationReport {
    /// Builds the report of a simulation, on the current pool. Cost O(strategies paths ln paths).
    ///
    /// # Errors
    /// As [`Policy::to_json`](crate::control::policy::Policy::to_json), whose bytes identify a policy.
    pub fn new(
        evaluation: &Evaluation,
        followers: &[Follower],
        outcomes: &Outcomes,
        costs: Costs,
    ) -> serde_json::Result<Self> {
        let request = &evaluation.request;
        let sample = Clustered::new(evaluation.histories.len(), request.paths, request.level);
        let count = request.frameworks.len() + request.mixes().len() + evaluation.own.len();
        let wealth: Vec<Vec<f64>> = (0..count)
            .map(|index| outcomes.outcomes.iter().map(|outcome| outcome.ended[index].wealth).collect())
            .collect();
        let (relative, floor) = relative_utility(&request.problem);
        let value = |wealth: &f64| relative.value((wealth / floor).ln());
        let utilities: Vec<Vec<f64>> = wealth.iter().map(|wealth| wealth.iter().map(value).collect()).collect();
        let (edges, wealth_edges) = (edges(&utilities), edges(&wealth));
        let reference = request.frameworks.iter().position(|&framework| framework == Framework::Adaptive).unwrap_or(0);
        let table = SimulationTable {
            evaluation,
            followers,
            outcomes,
            sample,
            wealth: &wealth,
            utilities: &utilities,
            edges: &edges,
            wealth_edges: &wealth_edges,
            reference,
        };
        let strategies = (0..count).into_par_iter().map(|index| table.strategy(index));
        let strategies: Vec<StrategyReport> = strategies.collect::<serde_json::Result<_>>()?;
        let names = strategies.iter().map(|strategy| strategy.strategy.as_str());
        let few_decide = few_decide(names.zip(&wealth), relative, floor);
        let nested = strategies.iter().filter_map(StrategyReport::inside_first).collect::<Vec<_>>();
        Ok(EvaluationReport {
            format: FORMAT.to_owned(),
            reference: strategies.get(reference).map_or(String::new(), |strategy| strategy.strategy.clone()),
            histories: table.histories(),
            sentences: strategies.iter().filter_map(sentence).chain(few_decide).chain(nested).collect(),
            strategies,
            request: request.clone(),
            costs,
            floor,
            histogram_edges: edges,
            wealth_edges,
        })
    }
}

impl Costs {
    /// Computes the costs from the seconds of both stages and the total time of re-solving.
    pub fn new(training_seconds: f64, simulation_seconds: f64, outcomes: &Outcomes) -> Self {
        let resolved =
            outcomes.outcomes.iter().flat_map(|outcome| &outcome.lived).filter(|lived| lived.resolved).count();
        let resolve_seconds = (resolved > 0).then(|| outcomes.resolve_seconds / resolved as f64);
        Costs { training_seconds, simulation_seconds, resolve_seconds }
    }
}

/// Returns the edges of [`BINS`] even bins from the smallest value to the largest.
fn edges(values: &[Vec<f64>]) -> Vec<f64> {
    let [low, high] = range(values.iter().flatten().copied());
    even(low, high, BINS + 1)
}

/// Counts the values in each bin between even edges.
fn binned(values: impl Iterator<Item = f64>, edges: &[f64]) -> Vec<usize> {
    let (low, high) = (edges[0], edges[BINS]);
    let mut counts = vec![0; BINS];
    for value in values {
        let position = if high > low { (value - low) / (high - low) * BINS as f64 } else { 0.0 };
        counts[(position as usize).min(BINS - 1)] += 1;
    }
    counts
}

/// Everything simulated, strategy by strategy.
pub(super) struct SimulationTable<'a> {
    pub(super) evaluation: &'a Evaluation,
    pub(super) followers: &'a [Follower],
    pub(super) outcomes: &'a Outcomes,
    pub(super) sample: Clustered,
    wealth: &'a [Vec<f64>],
    utilities: &'a [Vec<f64>],
    edges: &'a [f64],
    wealth_edges: &'a [f64],
    reference: usize,
}

impl SimulationTable<'_> {
    fn strategy(&self, index: usize) -> serde_json::Result<StrategyReport> {
        let request = &self.evaluation.request;
        let follower = self.followers.get(index);
        let beyond = index.checked_sub(self.followers.len());
        let mix = beyond.and_then(|mix| request.mixes().get(mix)).copied();
        let own = beyond.and_then(|place| place.checked_sub(request.mixes().len()));
        let own = own.and_then(|place| self.evaluation.own.get(place)).map(|(name, _)| name.clone());
        let fixed = || own.unwrap_or_else(|| mix_name(mix.unwrap_or_default()));
        let advisor = follower.and_then(|follower| follower.advisor.as_ref());
        let utilities = self.utilities[index].as_slice();
        let named = |follower: &Follower| framework_name(follower.framework).to_owned();
        let policy = advisor.map(|advisor| advisor.policy().to_json()).transpose()?;
        Ok(StrategyReport {
            strategy: follower.map_or_else(fixed, named),
            framework: follower.map(|follower| follower.framework),
            constant_mix: mix,
            policy: policy.map(|json| content_hash(&json)),
            utility: self.utility(utilities),
            certainty_equivalent: self.certainty_equivalent(&self.wealth[index]),
            own_mix: follower.map(|_| self.own_mix(index)),
            wealth: self.wealth(index),
            difference: (index != self.reference).then(|| self.difference(index)),
            histogram: binned(utilities.iter().copied(), self.edges),
            periods: follower.map(|_| self.periods(index)),
            coverage: follower.filter(|follower| follower.framework.has_ball()).map(|_| self.coverage(index)),
            resolved_share: follower.map(|_| share(self.lived(index), |lived| lived.resolved)),
        })
    }

    fn wealth(&self, index: usize) -> WealthReport {
        let (wealth, problem) = (&self.wealth[index], &self.evaluation.request.problem);
        let sorted = ascending(wealth);
        let put_in =
            problem.initial_wealth + (0..problem.horizon).map(|step| problem.contributions.at(step)).sum::<f64>();
        let (_, floor) = self.relative_utility();
        let is_beyond = |wealth: &f64| (wealth - floor).abs() > AT_BANK * floor;
        let histogram = binned(wealth.iter().copied().filter(is_beyond), self.wealth_edges);
        let falls: Vec<f64> = self.outcomes.outcomes.iter().map(|outcome| outcome.ended[index].fall).collect();
        WealthReport {
            mean: self.sample.mean(wealth),
            quantile_20: self.sample.quantile(wealth, &sorted, 0.2),
            quantile_90: self.sample.quantile(wealth, &sorted, 0.9),
            max: self.sample.largest(wealth),
            min: self.sample.smallest(wealth),
            worst_twentieth: self.sample.lowest(wealth, WORST),
            chance_of_loss: self.sample.share(wealth, |wealth| *wealth < put_in),
            max_drawdown: self.sample.mean(&falls),
            at_bank: wealth.len() - histogram.iter().sum::<usize>(),
            histogram,
        }
    }

    fn utility(&self, utilities: &[f64]) -> UtilityReport {
        let sorted = ascending(utilities);
        UtilityReport {
            mean: self.sample.mean(utilities),
            variance: self.sample.variance(utilities),
            quantile_20: self.sample.quantile(utilities, &sorted, 0.2),
            quantile_90: self.sample.quantile(utilities, &sorted, 0.9),
            max: self.sample.largest(utilities),
            min: self.sample.smallest(utilities),
        }
    }

    /// Maps mean utility in units of the floor, which does not saturate, back to wealth, clamped to the simulated
    /// wealths.
    fn certainty_equivalent(&self, wealth: &[f64]) -> Estimate {
        let (relative, floor) = self.relative_utility();
        let extreme = |pick: fn(f64, f64) -> f64, start: f64| wealth.iter().copied().fold(start, pick);
        let (lowest, highest) = (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY));
        let [least, most] = [lowest, highest].map(|wealth| relative.value((wealth / floor).ln()));
        let mean = self.sample.mean(&self.relative_utilities(wealth));
        mean.mapped(|value| floor * relative.inverse(value.clamp(least, most)).exp())
    }

    fn difference(&self, index: usize) -> Difference {
        let pairs = self.utilities[index].iter().zip(&self.utilities[self.reference]);
        let utility: Vec<f64> = pairs.map(|(own, other)| own - other).collect();
        let certainty_equivalent = self.apart(&self.wealth[index], &self.wealth[self.reference]);
        Difference { utility: self.sample.mean(&utility), certainty_equivalent }
    }

    /// Returns the difference of certainty equivalents by the delta method: each utility is weighted by the slope of
    /// U^{-1} at its strategy's mean.
    fn apart(&self, own: &[f64], other: &[f64]) -> Estimate {
        let (relative, floor) = self.relative_utility();
        let linear = |wealth: &[f64]| {
            let values = self.relative_utilities(wealth);
            let mean = self.sample.mean(&values).value;
            let slope = floor * wealth_slope(relative, mean);
            let found = self.certainty_equivalent(wealth).value;
            values.into_iter().map(move |value| found + slope * (value - mean))
        };
        let apart: Vec<f64> = linear(own).zip(linear(other)).map(|(own, other)| own - other).collect();
        self.sample.mean(&apart)
    }

    /// Compares a framework with its own mix. The mix is simulated on every path again, because its share is known only
    /// now.
    fn own_mix(&self, index: usize) -> OwnMix {
        let Evaluation { request, .. } = self.evaluation;
        let (sum, count) = self.lived(index).fold((0.0, 0), |(sum, count), lived| (sum + lived.allocation, count + 1));
        let allocation = sum / f64::from(count);
        let periods = Dynamics::of(&request.problem);
        let of_path = |path: usize| {
            let returns = self.evaluation.returns(path / request.paths, path % request.paths);
            mix_ended(&periods, request.problem.initial_wealth, allocation, &returns).wealth
        };
        let wealth: Vec<f64> = (0..self.outcomes.outcomes.len()).into_par_iter().map(of_path).collect();
        OwnMix { allocation, beyond: self.apart(&self.wealth[index], &wealth) }
    }

    fn relative_utility(&self) -> (RelativeUtility, f64) {
        relative_utility(&self.evaluation.request.problem)
    }

    fn relative_utilities(&self, wealth: &[f64]) -> Vec<f64> {
        let (relative, floor) = self.relative_utility();
        wealth.iter().map(|wealth| relative.value((wealth / floor).ln())).collect()
    }

    /// Returns every step of a framework, path by path.
    fn lived(&self, index: usize) -> impl Iterator<Item = &Lived> {
        let horizon = self.evaluation.request.problem.horizon;
        self.outcomes.outcomes.iter().flat_map(move |outcome| &outcome.lived[index * horizon..(index + 1) * horizon])
    }

    /// Returns the value of `of` in one period of a framework, on every path.
    fn at(&self, index: usize, step: usize, of: impl Fn(&Lived) -> f64) -> Vec<f64> {
        let position = index * self.evaluation.request.problem.horizon + step;
        self.outcomes.outcomes.iter().map(|outcome| of(&outcome.lived[position])).collect()
    }

    fn periods(&self, index: usize) -> Vec<PeriodReport> {
        let problem = &self.evaluation.request.problem;
        let period = |step: usize| {
            let allocations = self.at(index, step, |lived| lived.allocation);
            let radii = self.at(index, step, |lived| lived.radius);
            let banked = allocations.iter().filter(|&&allocation| allocation <= 0.0).count();
            PeriodReport {
                period: step + 1,
                sample_size: problem.history.len() + step,
                all_bank_share: banked as f64 / allocations.len() as f64,
                allocation: spread(allocations),
                radius: self.followers[index].framework.has_ball().then(|| radius_spread(radii)),
            }
        };
        (0..problem.horizon).map(period).collect()
    }

    fn histories(&self) -> Vec<HistoryReport> {
        let paths = self.evaluation.request.paths;
        let mean = |history: usize, utilities: &Vec<f64>| {
            utilities[history * paths..(history + 1) * paths].iter().sum::<f64>() / paths as f64
        };
        let starts = self.outcomes.starts.iter().enumerate();
        let report = |(history, start): (usize, &HistoryStart)| HistoryReport {
            quantile: start.quantile,
            radius: start.radius,
            promised: start.promised.clone(),
            mean_utility: self.utilities.iter().map(|utilities| mean(history, utilities)).collect(),
        };
        starts.map(report).collect()
    }
}

/// Returns utility in units of the terminal wealth of all-bank, and that wealth.
fn relative_utility(problem: &ProblemSpecification) -> (RelativeUtility, f64) {
    let floor = Dynamics::of(problem)[0].floor(problem.initial_wealth, 0.0, problem.horizon);
    (RelativeUtility::new(problem.utility, floor), floor)
}

/// Returns a sentence on whether changing the allocation earned anything.
fn sentence(strategy: &StrategyReport) -> Option<String> {
    let OwnMix { allocation, beyond: Estimate { value, low, high } } = strategy.own_mix?;
    Some(beside_own_mix(&strategy.strategy, allocation, value, [low, high], "these paths do"))
}

/// Returns the derivative at `value` of wealth over the floor, exp(u^{-1}).
fn wealth_slope(relative: RelativeUtility, value: f64) -> f64 {
    relative.inverse_slope(value) * relative.inverse(value).exp()
}

fn share<'a>(steps: impl Iterator<Item = &'a Lived>, holds: impl Fn(&Lived) -> bool) -> f64 {
    let (held, all) = steps.fold((0, 0), |(held, all), lived| (held + usize::from(holds(lived)), all + 1));
    held as f64 / f64::max(f64::from(all), 1.0)
}

fn ascending(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

fn sorted_with_mean(values: &[f64]) -> (Vec<f64>, f64) {
    (ascending(values), values.iter().sum::<f64>() / values.len() as f64)
}

fn spread(values: Vec<f64>) -> Spread {
    let (sorted, mean) = sorted_with_mean(&values);
    let at = |share| interpolated_quantile(&sorted, share);
    Spread { mean, quantile_10: at(0.1), quantile_90: at(0.9) }
}

fn radius_spread(values: Vec<f64>) -> RadiusSpread {
    let first_path = values[0];
    let (sorted, mean) = sorted_with_mean(&values);
    let at = |share| interpolated_quantile(&sorted, share);
    RadiusSpread { mean, quantile_10: at(0.1), quantile_50: at(0.5), quantile_90: at(0.9), first_path }
}
