//! The error of a fitted value surrogate at states outside its design, and the number of design points for the accuracy
//! asked for.
//!
//! Errors of a surrogate have heavy tails, and leave-one-out errors predict them poorly. The error at fresh states of
//! the design's own law was between a fifth and five times the leave-one-out error, over the counts, levels, costs and
//! utilities of the tests. So some fresh states are solved. Half of a state's chance to be drawn follows the predicted
//! variance, because the errors are large there. Each squared error is weighted by the inverse of that chance
//! (importance sampling; Owen, Monte Carlo theory, methods and examples, chapter 9). No state weighs more than twice
//! its weight under equal chances, and the estimate has no bias.

use rand::RngExt;

use super::fitting::DesignPoint;
use super::value_surrogate::ValueSurrogate;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::specification::{DesignSpecification, Specification};
use crate::control::solved_step::{ExpectedError, StepDiagnostics};
use crate::numerics::machine::streams::stream;

/// Number of fresh states that are solved to judge a fit.
pub const CHECKS: usize = 100;
/// Design points of a step to begin with.
const LEAST: usize = 100;
/// Margin below the aim, which spares a round: errors fall about as the inverse of the number of design points.
const MARGIN: f64 = 1.15;
/// Bounds of the growth of the number of design points from one round to the next.
const GROWTH: [f64; 2] = [1.25, 2.0];
/// The least aim of a step if others erred by more, as a share of an even split.
const LEAST_SHARE: f64 = 0.5;
/// Halvings of an interval, for a share to 12 digits.
const HALVINGS: usize = 40;
const BASIS_POINTS: f64 = 1e4;

/// The largest error allowed at one step, and the number of design points to begin with.
#[derive(Debug, Clone, PartialEq)]
pub struct Aim {
    /// The error of its surrogate alone, in basis points.
    pub own: f64,
    /// The errors of the step after.
    pub after: ExpectedError,
    /// Design points to begin with.
    pub first: usize,
}

impl Aim {
    /// Computes the aim of a step. `erring` is how many steps with surrogates are left, itself among them, and `after`
    /// the diagnostics of the next. `None` if a number of points is asked for. Error allowance that later steps did not
    /// use is shared among the earlier.
    pub fn of(
        design: &DesignSpecification,
        step: usize,
        erring: usize,
        after: Option<&StepDiagnostics>,
    ) -> Option<Self> {
        let accuracy = design.accuracy?;
        let next = after.and_then(|after| after.expected_error).unwrap_or_default();
        let steps = (erring + after.map_or(0, |_| 1)).max(step + 1);
        let even = even_share(accuracy, ExpectedError::default(), steps);
        let own = even_share(accuracy, next, erring.max(1)).max(LEAST_SHARE * even);
        let points = after.filter(|after| after.expected_error.is_some()).map_or(0, |after| after.design_count);
        let first = (points as f64 * (MARGIN * next.own / own).min(1.0)).ceil() as usize;
        Some(Aim { own, after: next, first: first.max(LEAST) })
    }

    /// Returns true if an error is no more than the aim.
    pub fn is_met_by(&self, own: f64) -> bool {
        own <= self.own
    }

    /// Returns the next number of design points, if `count` of them erred by `own`.
    pub fn next(&self, count: usize, own: f64) -> usize {
        let [least, most] = GROWTH;
        (count as f64 * (MARGIN * own / self.own).clamp(least, most)).ceil() as usize
    }

    /// Returns the error with those of the steps after.
    pub fn expected_error(&self, own: f64) -> ExpectedError {
        self.after.before(own)
    }
}

/// Returns the error of each of `steps` surrogates, all alike, for which they err by `accuracy` with those after them.
/// Found by bisection; 0 if those after them err by more already.
fn even_share(accuracy: f64, after: ExpectedError, steps: usize) -> f64 {
    let total = |own: f64| (0..steps).fold(after, |after, _| after.before(own)).total;
    let (mut low, mut high) = (0.0, accuracy);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if total(middle) > accuracy { high = middle } else { low = middle }
    }
    low
}

/// The fresh states to solve, with their weights.
pub struct Checks {
    /// By number, ascending, with the weight of its squared error; the mean square is the sum of weight times squared
    /// error.
    pub weighted: Vec<(usize, f64)>,
}

impl Checks {
    /// Draws among the states with these predicted deviations: [`CHECKS`] draws, evenly along the cumulative chances,
    /// so that one state may be drawn more than once. Beyond the `limit` the surrogate is not used, and so has no
    /// error. Streams: ("accuracy", step, round).
    pub fn of(deviations: &[f64], limit: f64, seed: u64, step: usize, round: usize) -> Self {
        let states = deviations.len() as f64;
        let within = || deviations.iter().filter(|deviation| **deviation <= limit);
        let (served, variance) =
            (within().count() as f64, within().map(|deviation| deviation * deviation).sum::<f64>());
        let chance = |deviation: &f64| {
            if *deviation > limit {
                return 0.0;
            }
            let by_variance = if variance > 0.0 { deviation * deviation / variance } else { 1.0 / served };
            0.5 * by_variance + 0.5 / served
        };
        let start: f64 = stream(seed, "accuracy", step, round).random();
        let (mut reached, mut drawn) = (0.0, 0);
        let mut weighted = Vec::new();
        for (state, chance) in deviations.iter().map(chance).enumerate() {
            reached += chance;
            let before = drawn;
            while drawn < CHECKS && (drawn as f64 + start) / (CHECKS as f64) < reached {
                drawn += 1;
            }
            if drawn > before {
                weighted.push((state, (drawn - before) as f64 / (CHECKS as f64 * states * chance)));
            }
        }
        Checks { weighted }
    }

    /// Returns checks of `count` states that all weigh alike.
    pub fn evenly(count: usize) -> Self {
        Checks { weighted: (0..count).map(|state| (state, 1.0 / count as f64)).collect() }
    }

    /// Returns the root mean square error of `served`, in basis points, from the states solved in the order of the
    /// checks, at their holdings and halfway between. No gain is below `least`.
    pub fn error<'a>(
        &self,
        served: &ValueSurrogate,
        (specification, step, least): (&Specification, usize, f64),
        solved: impl Iterator<Item = &'a DesignPoint>,
    ) -> f64 {
        let dynamics = Dynamics::of(&specification.problem)[step];
        let squares = |point: &DesignPoint| {
            let predictions = served.prediction(&point.features);
            let unsold = dynamics.total(point.wealth, 0.0);
            let holdings = served.holdings();
            let error = |(holding, gain): (f64, &f64)| {
                let total = dynamics.total(point.wealth, holding);
                let largest = point.largest_gain + (unsold / total).ln();
                served.clamped_gain(holdings.at(&predictions, holding), total, [least, largest]) - gain
            };
            let between = holdings.halved().nodes().skip(1).step_by(2).zip(&point.between);
            let errors: Vec<f64> = holdings.nodes().zip(&point.floor_gains).chain(between).map(error).collect();
            errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64
        };
        let mean: f64 = self.weighted.iter().zip(solved).map(|((_, weight), point)| weight * squares(point)).sum();
        BASIS_POINTS * mean.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_square_has_no_bias_and_varies_less_than_that_of_states_drawn_alike() {
        // Errors twice the deviations, of which few are large: 3 of 1000 hold two thirds of the mean square.
        let deviations: Vec<f64> = (0..1000).map(|state| if state % 400 == 7 { 20.0 } else { 0.75 }).collect();
        let square = |state: usize| 4.0 * deviations[state] * deviations[state];
        let truth = (0..1000).map(square).sum::<f64>() / 1000.0;
        let found: Vec<f64> = (0..400)
            .map(|round| {
                let checks = Checks::of(&deviations, f64::INFINITY, 3, 1, round);
                checks.weighted.iter().map(|&(state, weight)| weight * square(state)).sum()
            })
            .collect();
        let mean = found.iter().sum::<f64>() / 400.0;
        let deviation = (found.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / 400.0).sqrt();
        // With 100 states drawn uniformly the mean square would deviate by sqrt(E e^4 - (E e^2)^2) / 10 = 8.7.
        assert!(deviation < 2.0, "{deviation} around {truth}");
        // Four standard errors of 400 rounds.
        assert!((mean - truth).abs() < 4.0 * deviation.max(1e-9) / 20.0, "{mean} against {truth}");
    }

    #[test]
    fn what_later_steps_did_not_use_is_left_to_the_earlier() {
        let design = DesignSpecification { accuracy: Some(0.5), ..DesignSpecification::default() };
        let last = Aim::of(&design, 9, 9, None).unwrap();
        let all = (0..9).fold(ExpectedError::default(), |after, _| after.before(last.own));
        assert!((all.total - 0.5).abs() < 1e-9 && last.first == LEAST, "{last:?}");
        let mut diagnostics = StepDiagnostics {
            step: 9,
            design_count: 400,
            all_bank_share: 0.0,
            uncertified_share: 0.0,
            duality_gap: 0.0,
            expected_error: Some(last.expected_error(0.05)),
            value: None,
            policy: None,
        };
        let next = Aim::of(&design, 8, 8, Some(&diagnostics)).unwrap();
        let all = (0..8).fold(ExpectedError { own: 0.05, total: 0.05 }, |after, _| after.before(next.own));
        assert!((all.total - 0.5).abs() < 1e-9 && next.own > last.own, "{next:?}");
        assert_eq!(next.first, (400.0 * MARGIN * 0.05 / next.own).ceil() as usize);
        // A step that missed its aim leaves half of an even share to each.
        diagnostics.expected_error = Some(ExpectedError { own: 2.0, total: 2.0 });
        let least = Aim::of(&design, 8, 8, Some(&diagnostics)).unwrap();
        assert!((least.own - 0.5 * last.own).abs() < 1e-12 && least.first == 400, "{least:?}");
        assert_eq!(Aim::of(&DesignSpecification::default(), 8, 8, None), None);
    }
}
