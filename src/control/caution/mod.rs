//! The levels of caution: the share of the radius with the least worst regret.
//!
//! Three worlds represent what the record leaves open. In world k the returns are those of the record, all shifted so
//! that their mean beyond the bank is 0, half, or the whole of
//!
//!   q = max(premium seen, 0) + its standard error.
//!
//! Records are drawn from each world in circular blocks of a year. On each the advice for one period is solved at every
//! share s of the radius, and is scored in its world. L_k(s) is the mean loss of log certainty equivalent against the
//! best allocation there. Regret is R_k(s) = L_k(s) - min L_k, and a level has the share of least max_k w_k R_k(s).
//! `balanced` weighs all worlds alike, `bold` the world of the whole premium twice, `cautious` the one without premium
//! twice. The rule is Savage's (1951, The theory of statistical decision, Journal of the American Statistical
//! Association 46).
//!
//! One draw of blocks serves the three worlds, because a shift changes no radius. Checked by: `tests/solver/caution.rs`
//! against plain simulation with the robust step of `POST /advise`.

mod curve;

use sha2::{Digest, Sha256};

pub use self::curve::{AllocationCurve, OnePeriodInvestor};
use crate::control::cache::{Cache, Key};
use crate::control::pool;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::annualised::premium;
use crate::control::request::caution::{CautionLevel, CautionLevels, CautionScale};
use crate::control::request::learning::Learning;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::{ProblemSpecification, Specification};
use crate::control::uncertainty::centre::representative_record;
use crate::control::uncertainty::joint::radius_factor;
use crate::control::uncertainty::laws::Laws;
use crate::control::uncertainty::radius::RadiusEstimator;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::block_bootstrap::circular_blocks;

/// Records drawn of a world. For long records the number is capped by the returns in all, but is at least the last
/// constant.
const RECORDS: usize = 600;
/// Groups of records that are left out in turn, which gives the simulation error of a level.
const GROUPS: usize = 12;
const RETURNS: usize = 360_000;
const LEAST_RECORDS: usize = 60;
/// Returns in a row that are drawn together: a year of months.
const BLOCK: usize = 12;
/// Shares of the radius: hundredths.
const SCALES: usize = 100;
/// Allocations at which the worth in a world is computed; it is linear between them.
const WORTHS: usize = 400;
/// Largest number of records of one part of the work, and of returns: shorter requests are solved between two parts.
const TOGETHER: usize = 25;
const TOGETHER_RETURNS: usize = 6000;
/// Parts of the premium in the three worlds.
const WORLDS: [f64; 3] = [0.0, 0.5, 1.0];

impl Specification {
    /// Returns a completed specification with the results found from its record: the factor on the radius of several
    /// assets, the correction of simulated radii, and its levels if its caution is one of them. Cost: the joint factor of
    /// several assets, that of [`RadiusEstimator::found_correction`], 600 radii and 43,200 sums over the returns, fewer for
    /// long records: 0.25 s at 240 returns of one asset.
    #[must_use]
    pub fn resolved(mut self, kept: &Cache) -> Self {
        if let Some(fund) = self.fund.as_mut().filter(|fund| fund.radius_factor.is_none()) {
            let rule = self.problem.radius_rule();
            let factor = radius_factor(&fund.history, rule, self.seed);
            (fund.radius_factor, self.problem.radius) = (Some(factor), Some(rule.scaled(factor)));
        }
        // Earlier results are computed again, by the whole radius.
        self.problem.levels = None;
        let found = RadiusEstimator::new(&self, kept.clone()).found_correction();
        if let Some(RadiusRule::Bridge { correction, .. }) = &mut self.problem.radius {
            *correction = found;
        }
        let is_found = self.problem.takes_levels() && self.problem.caution_level().is_some_and(CautionLevel::is_found);
        self.problem.levels = is_found.then(|| Box::new(self.levels(kept)));
        self
    }

    /// Returns the levels of a completed specification that has levels, from `kept` if they are cached there.
    pub fn levels(&self, kept: &Cache) -> CautionLevels {
        let base = ProblemSpecification {
            horizon: 1,
            caution: Some(CautionLevel::Paper),
            levels: None,
            spending: None,
            ..self.problem.clone()
        };
        let base = Specification::of(base, self.seed);
        // Numbers are written with all their digits. A specification that cannot be written has no cache key.
        let Ok(written) = serde_json::to_vec(&base) else { return base.found(kept) };
        let key = Key::Levels(Sha256::digest(written).into());
        if let Some(levels) = kept.get::<CautionLevels>(&key) {
            return levels.as_ref().clone();
        }
        // Computed before taking the cache's guard, because it passes checkpoints and itself asks for cached bridges.
        let found = base.found(kept);
        kept.get_or_make(&key, size_of::<CautionLevels>(), || found).as_ref().clone()
    }

    fn found(&self, kept: &Cache) -> CautionLevels {
        let (history, learning) = representative_record(&self.problem);
        let laws = Laws::with(self, kept.clone());
        let worlds = Worlds::of(&history, &self.problem);
        let losses = worlds.losses(&laws, learning, &history, self.seed);
        worlds.levels(&losses)
    }
}

/// The three worlds of a record.
struct Worlds {
    premium_seen: f64,
    standard_error: f64,
    premiums: [f64; 3],
    /// Shifts of the log-returns.
    shifts: [f64; 3],
    investor: OnePeriodInvestor,
}

/// Mean loss in one world at every share of the radius.
type Losses = Vec<f64>;

/// Losses in the three worlds, over all records and with each of [`GROUPS`] groups left out.
struct SimulatedLosses {
    all: [Losses; 3],
    without: Vec<[Losses; 3]>,
}

impl Worlds {
    fn of(history: &[f64], problem: &ProblemSpecification) -> Self {
        let bank = 1.0 + problem.rate_per_step;
        let (premium_seen, standard_error) = premium(history, problem.rate_per_step);
        let premiums = WORLDS.map(|part| part * (premium_seen.max(0.0) + standard_error));
        Worlds {
            premium_seen,
            standard_error,
            premiums,
            shifts: premiums.map(|premium| ((bank + premium) / (bank + premium_seen)).ln()),
            investor: OnePeriodInvestor {
                bank,
                utility: RelativeUtility::new(problem.utility, problem.initial_wealth * bank),
                highest: problem.action_interval[1],
                support: problem.support_rule(),
            },
        }
    }

    fn losses(&self, laws: &Laws, learning: Learning, history: &[f64], seed: u64) -> SimulatedLosses {
        let count = (RETURNS / history.len()).clamp(LEAST_RECORDS, RECORDS);
        let draw = |index: usize| {
            let indices = circular_blocks(history.len(), BLOCK, &mut stream(seed, "caution", 0, index));
            indices.into_iter().map(|index| history[index]).collect::<Vec<f64>>()
        };
        let together = (TOGETHER_RETURNS / history.len()).clamp(1, TOGETHER);
        let parts: Vec<usize> = (0..count).step_by(together).collect();
        let of_part = |first: usize| {
            let records: Vec<Vec<f64>> = (first..(first + together).min(count)).map(draw).collect();
            let radii: Vec<f64> = records.iter().map(|record| laws.radii.radius(&learning.law(record))).collect();
            let allocations = |shift: f64| {
                let of_record = |(record, radius): (&Vec<f64>, &f64)| {
                    let shifted: Vec<f64> = record.iter().map(|z| z + shift).collect();
                    let centre = laws.centring.centre(&learning.law(&shifted));
                    let curve = AllocationCurve::of(&centre, self.investor);
                    (0..=SCALES).map(|scale| curve.at(radius * share(scale))).collect::<Vec<f64>>()
                };
                records.iter().zip(&radii).map(of_record).collect::<Vec<_>>()
            };
            self.shifts.map(allocations)
        };
        let drawn = pool::map(parts, of_part);
        let worlds: [Worth; 3] = std::array::from_fn(|world| Worth::of(history, self.shifts[world], self.investor));
        let mut groups: Vec<[Losses; 3]> = vec![std::array::from_fn(|_| vec![0.0; SCALES + 1]); GROUPS];
        for (world, worth) in worlds.iter().enumerate() {
            for (record, allocations) in drawn.iter().flat_map(|part| &part[world]).enumerate() {
                for (loss, allocation) in groups[record % GROUPS][world].iter_mut().zip(allocations) {
                    *loss += worth.lost(*allocation);
                }
            }
        }
        let mean = |left_out: Option<usize>| {
            let among = |group: usize| Some(group) != left_out;
            let counted = (0..count).filter(|record| among(record % GROUPS)).count() as f64;
            let kept = || groups.iter().enumerate().filter(|(group, _)| among(*group));
            let sum = |world: usize, scale: usize| kept().map(|(_, losses)| losses[world][scale]).sum::<f64>();
            std::array::from_fn(|world| (0..=SCALES).map(|scale| sum(world, scale) / counted).collect())
        };
        SimulatedLosses { all: mean(None), without: (0..GROUPS).map(|group| mean(Some(group))).collect() }
    }

    fn levels(&self, simulated: &SimulatedLosses) -> CautionLevels {
        let regrets = Regrets::of(&simulated.all);
        let without: Vec<Regrets> = simulated.without.iter().map(Regrets::of).collect();
        let priced = |scale: usize, standard_error: f64| CautionScale {
            scale: share(scale),
            standard_error,
            regrets: [0, 1, 2].map(|world| regrets.at(world, scale)),
            spared: simulated.all[0][0] - simulated.all[0][scale],
        };
        let weighed = |weights: [f64; 3]| {
            let found: Vec<f64> = without.iter().map(|regrets| share(regrets.least_worst(weights))).collect();
            priced(regrets.least_worst(weights), jackknife_error(&found))
        };
        CautionLevels {
            premiums: self.premiums,
            premium_seen: self.premium_seen,
            standard_error: self.standard_error,
            bold: weighed([1.0, 1.0, 2.0]),
            balanced: weighed([1.0, 1.0, 1.0]),
            cautious: weighed([2.0, 1.0, 1.0]),
            paper: priced(SCALES, 0.0),
        }
    }
}

/// Losses beyond the least in their world.
struct Regrets<'a> {
    losses: &'a [Losses; 3],
    least: [f64; 3],
}

impl<'a> Regrets<'a> {
    fn of(losses: &'a [Losses; 3]) -> Self {
        let least = losses.each_ref().map(|losses| losses.iter().copied().fold(f64::INFINITY, f64::min));
        Regrets { losses, least }
    }

    fn at(&self, world: usize, scale: usize) -> f64 {
        self.losses[world][scale] - self.least[world]
    }

    /// Returns the share of least worst regret.
    fn least_worst(&self, weights: [f64; 3]) -> usize {
        let worst = |scale: &usize| (0..3).map(|world| weights[world] * self.at(world, *scale)).fold(0.0, f64::max);
        (0..=SCALES).min_by(|one, other| worst(one).total_cmp(&worst(other))).unwrap_or(SCALES)
    }
}

/// Returns the standard error of an estimate from its values with each group left out. Source: Efron and Tibshirani
/// (1993), An introduction to the bootstrap, section 11.
fn jackknife_error(without: &[f64]) -> f64 {
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let squares: f64 = without.iter().map(|found| (found - mean).powi(2)).sum();
    ((count - 1.0) / count * squares).sqrt()
}

/// The worth of allocations in a world, in log certainty equivalent over the bank.
struct Worth {
    /// At even allocations from 0 to the largest allowed.
    worths: Vec<f64>,
    best: f64,
    highest: f64,
}

impl Worth {
    fn of(history: &[f64], shift: f64, investor: OnePeriodInvestor) -> Self {
        let OnePeriodInvestor { bank, utility, highest, .. } = investor;
        let growths: Vec<f64> = history.iter().map(|z| (z + shift).exp() / bank).collect();
        let worth = |part: usize| {
            let allocation = highest * part as f64 / WORTHS as f64;
            let total: f64 = growths.iter().map(|growth| utility.at(1.0 + allocation * (growth - 1.0)).0).sum();
            utility.inverse(total / growths.len() as f64)
        };
        let worths: Vec<f64> = (0..=WORTHS).map(worth).collect();
        let best = worths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Worth { worths, best, highest }
    }

    /// Returns the loss against the best allocation.
    fn lost(&self, allocation: f64) -> f64 {
        let place = (allocation / self.highest * WORTHS as f64).clamp(0.0, WORTHS as f64);
        let below = (place as usize).min(WORTHS - 1);
        let part = place - below as f64;
        self.best - (self.worths[below] + part * (self.worths[below + 1] - self.worths[below]))
    }
}

fn share(scale: usize) -> f64 {
    scale as f64 / SCALES as f64
}
