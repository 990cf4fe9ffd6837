//! The radius of the Wasserstein ball around an empirical law, or of the confidence region of a normal law's estimates,
//! rule by rule.

use std::sync::{Arc, OnceLock};

use crate::control::cache::{Cache, Key};
use crate::control::request::centre::CentreSpecification;
use crate::control::request::framework::Framework;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::Specification;
use crate::control::request::support::Interval;
use crate::control::uncertainty::centre::{learned_law, record};
use crate::numerics::bridge::limit::BridgeLaw;
use crate::numerics::bridge::paths::{AbsoluteBridges, GRADED_FROM};
use crate::numerics::bridge::sized_gaps::Statistic;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::law::{concentration, confidence_region};
use crate::numerics::search::chebyshev::local_cubic;

/// If the oldest return of the last law weighs at least this share of the newest, the decay of weights is treated as
/// rounding: times lie within 1/8000 of i/n, and |B| is read from the bridges of n.
const ALL_BUT_EQUAL: f64 = 0.999;

/// Least number of exact returns at which the radius one return later is computed.
const LEAST_THINNED: usize = 9;

/// The radius rule of a specification, with its common random numbers.
pub struct RadiusEstimator {
    /// The rule of the specification, with `bridge` instead of `calibrated` and `joint`; a radius of 0 if the framework
    /// has no uncertainty (known law, plug-in).
    pub(super) rule: RadiusRule,
    /// The calibration, under `calibrated` and `joint`.
    pub(super) calibration: Option<Calibration>,
    pub(super) seed: u64,
    /// Sample size at the last step.
    last_size: usize,
    /// True if weights decay by more than a little.
    decays: bool,
    /// Length of the support if it is given, else 0.
    support_length: f64,
    /// The rule for the centres of the balls.
    centre: CentreSpecification,
    /// The law of the history. Most laws of a design share its values.
    pub(super) learned: EmpiricalDistribution,
    /// The law of its bridge statistic, once it is needed.
    pub(super) exact: OnceLock<BridgeLaw>,
    /// The cache of the common random numbers.
    kept: Cache,
}

/// The factor on the radius that the history implies, computed when a radius is first needed.
pub(super) struct Calibration {
    /// Oldest first.
    pub(super) history: Vec<f64>,
    pub(super) retention: f64,
    pub(super) goal: CalibrationGoal,
    pub(super) factor: OnceLock<f64>,
}

/// The event that a calibrated radius gives the probability 1 - alpha.
#[derive(Clone, Copy)]
pub(super) enum CalibrationGoal {
    /// The ball of a record drawn from the smoothed history holds that law.
    SmoothedLaw,
    /// The balls of this many steps in a row hold the law together.
    AllSteps(usize),
}

/// The radius of a law, and the quantile behind it under the rules of the bridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// In log-return; for a confidence region, in estimated standard deviations.
    pub radius: f64,
    /// Absent under rules other than `bridge`, `calibrated` and `joint`.
    pub quantile: Option<f64>,
}

/// The radius of a law and its expected value one return later.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radii {
    /// In log-return; for a confidence region, in estimated standard deviations.
    pub radius: f64,
    /// Radius of the mean statistic over the laws with one value of this law twice; the radius itself if no step comes
    /// after.
    pub radius_ahead: f64,
}

impl RadiusEstimator {
    /// Builds the estimator of a completed specification; `kept` is the cache of bridges.
    pub fn new(specification: &Specification, kept: Cache) -> Self {
        let rule = match specification.problem.framework {
            Framework::KnownLaw | Framework::PlugIn => RadiusRule::Fixed { radius: 0.0 },
            _ => specification.problem.radius_in_force(),
        };
        let Specification { problem, seed, .. } = specification;
        let steps = if problem.framework.is_frozen() { 1 } else { problem.horizon };
        let bridge = |alpha, paths, scale| RadiusRule::Bridge { alpha, paths, scale, correction: None };
        let (rule, goal) = match rule {
            RadiusRule::Calibrated { alpha, paths, scale } => {
                (bridge(alpha, paths, scale), Some(CalibrationGoal::SmoothedLaw))
            }
            RadiusRule::Joint { alpha, paths } => (bridge(alpha, paths, 1.0), Some(CalibrationGoal::AllSteps(steps))),
            rule => (rule, None),
        };
        let (last_size, learning) = (problem.history.len() + problem.horizon - 1, problem.learning);
        let (learned, retention) = (learned_law(problem), learning.retention());
        let history = || record(&problem.history, problem);
        let calibration = goal.map(|goal| Calibration { history: history(), retention, goal, factor: OnceLock::new() });
        let decays = retention.powf(last_size as f64) < ALL_BUT_EQUAL || !learned.is_by_age();
        let support_length = problem.support_rule().given().map_or(0.0, |Interval { min, max }| max - min);
        let (seed, centre) = (*seed, problem.centre.clone());
        RadiusEstimator {
            rule,
            calibration,
            seed,
            last_size,
            decays,
            support_length,
            centre,
            learned,
            exact: OnceLock::new(),
            kept,
        }
    }

    /// Returns true if laws of one sample size have different radii.
    pub fn varies(&self) -> bool {
        matches!(self.rule, RadiusRule::Bridge { scale, .. } if scale > 0.0)
    }

    /// Returns the sample size whose bridges serve laws of n returns: all large ones share those of [`GRADED_FROM`],
    /// and so do all whose weights decay.
    fn bridged(&self, sample_size: usize) -> usize {
        if self.decays { GRADED_FROM } else { sample_size.min(GRADED_FROM) }
    }

    /// Returns the cache key of those bridges.
    fn key(&self, sample_size: usize, paths: usize) -> Key {
        Key::Bridges { sample_size: self.bridged(sample_size), paths, seed: self.seed }
    }

    /// Returns those bridges, simulated if they are not cached.
    pub(super) fn bridges(&self, sample_size: usize, paths: usize) -> Arc<AbsoluteBridges> {
        let simulate = || match self.bridged(sample_size) {
            size @ ..GRADED_FROM => AbsoluteBridges::simulate(size, paths, self.seed),
            _ => AbsoluteBridges::graded(paths, self.seed),
        };
        let bytes = AbsoluteBridges::bytes_of(self.bridged(sample_size), paths);
        self.kept.get_or_make(&self.key(sample_size, paths), bytes, simulate)
    }

    /// Returns the bytes of the largest bridges that a law of `sample_size` values needs while it learns `steps` more.
    pub fn heaviest(&self, sample_size: usize, steps: usize) -> usize {
        match self.rule {
            RadiusRule::Bridge { paths, .. } => {
                let largest_of_its_own = sample_size.max(GRADED_FROM - 1);
                AbsoluteBridges::bytes_of(self.bridged((sample_size + steps).min(largest_of_its_own)), paths)
            }
            _ => 0,
        }
    }

    /// Returns true if the radius of laws of this size is also estimated one return later. Decaying laws always look
    /// one step ahead, because a rolling session has no last step.
    fn looks_ahead(&self, sample_size: usize) -> bool {
        self.decays || sample_size < self.last_size
    }

    /// Returns the sizes whose bridges measuring laws of `sample_size` reads: its own, and the next if it looks ahead.
    fn sizes(&self, sample_size: usize) -> impl Iterator<Item = usize> {
        [sample_size, sample_size + 1].into_iter().take(if self.looks_ahead(sample_size) { 2 } else { 1 })
    }

    /// Returns how many numbers are read to measure a law of this size, or `None` if its bridges are yet to be
    /// simulated.
    pub fn cost(&self, sample_size: usize) -> Option<usize> {
        match self.rule {
            RadiusRule::Bridge { paths, .. } => {
                let calibrated = self.calibration.as_ref().is_none_or(|known| known.factor.get().is_some());
                let ready = |size: usize| calibrated && self.kept.has(&self.key(size, paths));
                self.sizes(sample_size).all(ready).then_some(2 * self.bridged(sample_size) * paths)
            }
            _ => Some(sample_size),
        }
    }

    /// Simulates what measuring laws of this size needs, if that is yet to be done.
    pub fn prepare(&self, sample_size: usize) {
        if let RadiusRule::Bridge { alpha, paths, scale, .. } = self.rule {
            self.factor(scale, alpha, paths);
            self.sizes(sample_size).for_each(|size| drop(self.bridges(size, paths)));
        }
    }

    /// Returns the radius of the ball around `law`, in log-return; of the confidence region, in standard deviations of
    /// `law`.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale, .. } => {
                let bridges = self.bridges(law.sample_size(), paths);
                let scale = self.factor(scale, alpha, paths);
                self.scaled_quantile(
                    scale,
                    bridges.bridge_quantile(law, Statistic::Current, alpha),
                    law.effective_size(),
                )
            }
            _ => self.radius_of_size(law.effective_size()),
        }
    }

    /// Returns the radius of `law` and its parts.
    pub fn measure(&self, law: &EmpiricalDistribution) -> Measure {
        let size = law.effective_size();
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale, .. } => {
                let simulated = self.bridges(law.sample_size(), paths).bridge_quantile(law, Statistic::Current, alpha);
                let radius = self.scaled_quantile(self.factor(scale, alpha, paths), simulated, size);
                Measure { radius, quantile: Some(self.correction_at(alpha, paths) * simulated) }
            }
            _ => Measure { radius: self.radius_of_size(size), quantile: None },
        }
    }

    /// Returns the known radius of `law` and its expected value one return later.
    pub fn radii(&self, law: &EmpiricalDistribution, known: f64) -> Radii {
        let size = law.sample_size();
        let radius_ahead = match self.rule {
            RadiusRule::Bridge { .. } if !self.looks_ahead(size) => known,
            RadiusRule::Bridge { alpha, paths, scale, .. } => {
                let bridges = self.bridges(size + 1, paths);
                let scale = self.factor(scale, alpha, paths);
                self.scaled_quantile(
                    scale,
                    bridges.bridge_quantile(law, Statistic::AfterOneMore, alpha),
                    law.effective_sizes_ahead()[0],
                )
            }
            _ => self.radius_of_size(law.effective_size()),
        };
        Radii { radius: known, radius_ahead }
    }

    /// Returns the radii of laws with the same number of values, each at every one of `alphas` instead of the rule's
    /// own alpha. They differ from [`Self::radius`] and [`Self::radii`] of each law by at most 5e-6 of themselves.
    ///
    /// Checked by: `laws_measured_together_are_measured_as_one_by_one`.
    pub fn radii_of(&self, laws: &[&EmpiricalDistribution], alphas: &[f64]) -> Vec<Vec<Radii>> {
        let Some(first) = laws.first() else { return Vec::new() };
        let (size, effective_size) = (first.sample_size(), first.effective_size());
        let RadiusRule::Bridge { paths, scale, .. } = self.rule else {
            let radius = self.radius_of_size(effective_size);
            return vec![vec![Radii { radius, radius_ahead: radius }; alphas.len()]; laws.len()];
        };
        let factors: Vec<f64> = alphas.iter().map(|alpha| self.factor(scale, *alpha, paths)).collect();
        let base = self.learned.atoms();
        let quantiles = |which, size| self.bridges(size, paths).bridge_quantiles(laws, base, which, alphas);
        let now = quantiles(Statistic::Current, size);
        let ahead = self.looks_ahead(size).then(|| quantiles(Statistic::AfterOneMore, size + 1));
        let effective_size_ahead = first.effective_sizes_ahead()[0];
        let of_law = |(index, now): (usize, Vec<f64>)| {
            let of_level = |(level, now): (usize, f64)| {
                let factor = factors[level];
                let known = self.scaled_quantile(factor, now, effective_size);
                let later =
                    ahead.as_ref().map(|ahead| self.scaled_quantile(factor, ahead[index][level], effective_size_ahead));
                Radii { radius: known, radius_ahead: later.unwrap_or(known) }
            };
            now.into_iter().enumerate().map(of_level).collect()
        };
        now.into_iter().enumerate().map(of_law).collect()
    }

    /// Returns the miscoverage of the rule, if it gives laws of one size different radii that differ between levels in
    /// their quantiles alone.
    pub fn alpha(&self) -> Option<f64> {
        self.rule.alpha().filter(|_| self.varies() && self.calibration.is_none())
    }

    /// Returns the radii of `law` with one more value, for every value in ascending `values`. The change of a radius
    /// until one return later is computed at some of them and interpolated by cubics: it varies less than the radius
    /// does by a factor of the sample size.
    pub fn radii_with(&self, law: &EmpiricalDistribution, values: &[f64]) -> Vec<Radii> {
        let size = law.sample_size() + 1;
        let [next_size, size_after] = law.effective_sizes_ahead();
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale, .. } => {
                let scale = self.factor(scale, alpha, paths);
                let radii = |values: &[f64], which, size, effective_size| {
                    let found = self.bridges(size, paths).bridge_quantiles_with(law, values, which, alpha);
                    found
                        .into_iter()
                        .map(|quantile| self.scaled_quantile(scale, quantile, effective_size))
                        .collect::<Vec<f64>>()
                };
                let now = radii(values, Statistic::Current, size, next_size);
                if !self.looks_ahead(size) {
                    return now.into_iter().map(|radius| Radii { radius, radius_ahead: radius }).collect();
                }
                let some = thinned(values.len());
                let at: Vec<f64> = some.iter().map(|&index| values[index]).collect();
                let later = radii(&at, Statistic::AfterOneMore, size + 1, size_after);
                let gained: Vec<f64> = later.iter().zip(&some).map(|(later, &index)| later - now[index]).collect();
                let ahead = |(radius, &value): (f64, &f64)| {
                    let (first, weights) = local_cubic(&at, value);
                    let gained: f64 = gained[first..].iter().zip(weights).map(|(gained, weight)| gained * weight).sum();
                    Radii { radius, radius_ahead: radius + gained }
                };
                now.into_iter().zip(values).map(ahead).collect()
            }
            _ => {
                let radius = self.radius_of_size(next_size);
                vec![Radii { radius, radius_ahead: radius }; values.len()]
            }
        }
    }

    /// Returns the radius under the rules that use the effective sample size alone.
    fn radius_of_size(&self, size: f64) -> f64 {
        let of_returns = match self.rule {
            RadiusRule::Bridge { .. } | RadiusRule::Calibrated { .. } | RadiusRule::Joint { .. } => 0.0,
            RadiusRule::Concentration { alpha } => {
                self.support_length * concentration::radius(alpha, size, self.learned.retention())
            }
            RadiusRule::RootN { kappa } => kappa / size.sqrt(),
            RadiusRule::Fixed { radius } => return radius,
            RadiusRule::ChiSquare { alpha } => confidence_region::radius(alpha, size),
        };
        of_returns * self.centre.share_seen(size)
    }

    fn scaled_quantile(&self, scale: f64, quantile: f64, effective_size: f64) -> f64 {
        scale * quantile / effective_size.sqrt() * self.centre.share_seen(effective_size)
    }

    /// Converts `radius` of a ball around the centre to the radius of the ball around the law of `size` returns seen,
    /// of which the former is the share seen.
    pub fn of_returns(&self, radius: f64, size: f64) -> f64 {
        radius / self.centre.share_seen(size)
    }
}

/// Returns some of so many indices, the last among them: at least [`LEAST_THINNED`], or all.
fn thinned(count: usize) -> Vec<usize> {
    let last = count.saturating_sub(1);
    let every = (last / LEAST_THINNED).max(1);
    let before = (0..last).step_by(every);
    before.chain((count > 0).then_some(last)).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn estimator(framework: &str, rule: Value) -> RadiusEstimator {
        let history = [0.01, -0.02, 0.03, 0.005];
        let support = json!({ "rule": "between", "min": -0.1, "max": 0.3 });
        let request = json!({ "problem": { "framework": framework, "horizon": 3, "rate_per_step": 0.0, "radius": rule,
            "support": support, "history": history } });
        let specification = serde_json::from_value::<Specification>(request).unwrap();
        RadiusEstimator::new(&specification, Cache::default())
    }

    fn radius_of(framework: &str, rule: Value) -> f64 {
        estimator(framework, rule).radius(&EmpiricalDistribution::new(&[0.02, -0.01, 0.04, 0.01, 0.0]))
    }

    #[test]
    fn every_rule_of_the_sample_size_has_its_formula() {
        // By hand, at n = 5: 0.4 sqrt(ln(2 / 0.1) / (2 * 5)), 0.4 / sqrt(5), 0.25, sqrt(-2 ln(0.1) / 5), and none if the
        // law is assumed to be true.
        let rules = [
            ("adaptive", json!({ "rule": "concentration", "alpha": 0.1 }), 0.218_933_1),
            ("adaptive", json!({ "rule": "root_n", "kappa": 0.4 }), 0.178_885_4),
            ("adaptive", json!({ "rule": "fixed", "radius": 0.25 }), 0.25),
            ("parametric_adaptive", json!({ "rule": "chi_square", "alpha": 0.1 }), 0.959_705_2),
            ("plug_in", json!({ "rule": "fixed", "radius": 0.25 }), 0.0),
        ];
        for (framework, rule, expected) in rules {
            let found = radius_of(framework, rule.clone());
            assert!((found - expected).abs() < 1e-7, "{framework} {rule}: {found}");
        }
    }

    #[test]
    fn a_calibrated_radius_is_that_of_the_bridge_times_one_factor() {
        let rule = |name: &str| json!({ "rule": name, "alpha": 0.2, "paths": 500, "scale": 0.7 });
        let [bridge, calibrated] = ["bridge", "calibrated"].map(|name| estimator("adaptive", rule(name)));
        let law = EmpiricalDistribution::new(&[0.02, -0.01, 0.04, 0.01]);
        let factor = calibrated.radius(&law) / bridge.radius(&law);
        // Four returns show too little of their law's spread.
        assert!(factor > 1.05, "{factor}");
        let known = calibrated.radius(&law);
        let RadiusRule::Bridge { scale, .. } = calibrated.calibrated_rule() else { panic!("no bridge") };
        assert!((scale / 0.7 / factor - 1.0).abs() < 1e-12, "{scale}");
        let mut pairs = vec![(bridge.measure(&law).radius, calibrated.measure(&law).radius)];
        pairs.push((bridge.radii(&law, known).radius_ahead, calibrated.radii(&law, known).radius_ahead));
        let of = |sets: &RadiusEstimator| {
            let with = sets.radii_with(&law, &[-0.02, 0.03]);
            let together = sets.radii_of(&[&law], &[0.2]).remove(0);
            with.into_iter().chain(together).flat_map(|radii| [radii.radius, radii.radius_ahead]).collect::<Vec<f64>>()
        };
        pairs.extend(of(&bridge).into_iter().zip(of(&calibrated)));
        for (plain, scaled) in pairs {
            // Equal up to rounding.
            assert!((scaled / plain / factor - 1.0).abs() < 1e-12, "{plain} {scaled} {factor}");
        }
    }

    #[test]
    fn twice_the_paths_are_twice_the_numbers_read_once_they_are_there() {
        // Bridges are shared by the whole process; no other test uses these numbers of paths.
        let costs = [370, 740].map(|paths| {
            let sets = estimator("adaptive", json!({ "rule": "bridge", "alpha": 0.1, "paths": paths }));
            assert_eq!(sets.cost(4), None);
            sets.prepare(4);
            sets.cost(4).unwrap()
        });
        assert!(costs[0] >= 370 && costs[1] == 2 * costs[0], "{costs:?}");
    }

    #[test]
    fn laws_measured_together_are_measured_as_one_by_one() {
        let laws =
            [[0.02, -0.01, 0.04, 0.01], [0.03, -0.05, 0.0, 0.01]].map(|sample| EmpiricalDistribution::new(&sample));
        let at = |alpha: f64| json!({ "rule": "bridge", "alpha": alpha, "paths": 300, "scale": 1.0 });
        let alphas = [0.1, 0.5];
        let together = estimator("adaptive", at(0.3)).radii_of(&laws.each_ref(), &alphas);
        for (law, found) in laws.iter().zip(together) {
            let one_by_one = alphas.map(|alpha| {
                let sets = estimator("adaptive", at(alpha));
                sets.radii(law, sets.radius(law))
            });
            for (found, alone) in found.iter().zip(one_by_one) {
                for ratio in [found.radius / alone.radius, found.radius_ahead / alone.radius_ahead] {
                    // The tolerance of one of many quantiles.
                    assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
                }
            }
        }
    }

    #[test]
    fn a_bridge_radius_is_scale_times_quantile_over_root_n_whichever_way_it_is_asked_for() {
        let bridge = |scale: f64| json!({ "rule": "bridge", "alpha": 0.2, "paths": 500, "scale": scale });
        let sets = estimator("adaptive", bridge(0.7));
        let law = EmpiricalDistribution::new(&[0.02, -0.01, 0.04, 0.01]);
        let Measure { radius, quantile } = sets.measure(&law);
        assert!((radius - 0.7 * quantile.unwrap() / 2.0).abs() < 1e-15);
        assert_eq!(sets.radius(&law), radius);
        let mut larger = law.clone();
        larger.push(0.03);
        let carried = sets.radii_with(&law, &[0.03])[0];
        let direct = sets.radii(&larger, sets.radius(&larger));
        for (found, expected) in [(carried.radius, direct.radius), (carried.radius_ahead, direct.radius_ahead)] {
            // The tolerance of one of many quantiles.
            assert!((found / expected - 1.0).abs() < 1e-4, "{carried:?} {direct:?}");
        }
        assert!((radius_of("adaptive", bridge(1.4)) / radius_of("adaptive", bridge(0.7)) - 2.0).abs() < 1e-9);
    }
}
