//! The levels of caution: which share of the radius has the least worst regret.
//!
//! Three worlds stand for what the record leaves open. In world k the returns are those of the record, all shifted so that their mean
//! beyond the bank is 0, half, or the whole of
//!
//!   q = max(premium seen, 0) + its standard error.
//!
//! Records are drawn from each world in circular blocks of a year, the advice for one period is solved on each at every share s of
//! the radius, and is scored in its world: L_k(s) is the mean loss of log certainty equivalent beside the best allocation there.
//! Regret is R_k(s) = L_k(s) - min L_k, and a level has the share of least max_k w_k R_k(s): `balanced` weighs all worlds alike, `bold`
//! the world of the whole premium twice, `cautious` the one without. The rule is Savage's (1951, The theory of statistical decision,
//! Journal of the American Statistical Association 46).
//!
//! One draw of blocks serves the three worlds: a shift changes no radius. Checked by: `tests/solver/caution.rs` against plain
//! simulation with the robust step of `POST /advise`.

mod curve;

use sha2::{Digest, Sha256};

pub use self::curve::{AllocationCurve, Investor};
use crate::control::bellman::problem::Problem;
use crate::control::kept::{Kept, Key};
use crate::control::pool;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::caution::{CautionLevel, CautionLevels, CautionScale};
use crate::control::request::specification::{ProblemSpecification, Specification};
use crate::control::uncertainty::centre::record;
use crate::numerics::block_bootstrap::circular_blocks;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::streams::stream;

/// Records drawn of a world, and of how many returns altogether where that is less; of the longest at least so many.
const RECORDS: usize = 300;
const RETURNS: usize = 360_000;
const LEAST_RECORDS: usize = 60;
/// Returns in a row that are drawn together: a year of months.
const BLOCK: usize = 12;
/// Shares of the radius: hundredths.
const SCALES: usize = 100;
/// Allocations at which the worth in a world is known; between them it is linear.
const WORTHS: usize = 400;
/// Records measured together, at most, and of how many returns: shorter questions are solved between two parts.
const TOGETHER: usize = 25;
const TOGETHER_RETURNS: usize = 6000;
/// For bridges of one question.
const OWN_BYTES: usize = 1 << 30;
/// Parts of the premium in the three worlds.
const WORLDS: [f64; 3] = [0.0, 0.5, 1.0];

impl Specification {
    /// A completed specification with its levels found, where its caution is one of them.
    /// Cost: 300 radii and 21,600 sums over the returns, fewer for long records: 0.15 s at 240 returns.
    #[must_use]
    pub fn resolved(mut self, kept: &Kept) -> Self {
        let is_found = self.problem.takes_levels() && self.problem.caution_level().is_some_and(CautionLevel::is_found);
        self.problem.levels = is_found.then(|| Box::new(self.levels(kept)));
        self
    }

    /// The levels of a completed specification of which they can be found, from `kept` where they were found before.
    pub fn levels(&self, kept: &Kept) -> CautionLevels {
        let base = ProblemSpecification {
            horizon: 1,
            caution: Some(CautionLevel::Paper),
            levels: None,
            ..self.problem.clone()
        };
        let base = Specification::of(base, self.seed);
        let mut hash = Sha256::new();
        // Numbers are written with all their digits; a specification is always written.
        hash.update(serde_json::to_vec(&base).unwrap_or_default());
        let key = Key::Levels(hash.finalize().into());
        // Found outside of the place where it is kept, since finding passes checkpoints and asks for bridges that are kept.
        let found = (!kept.has(&key)).then(|| base.found(kept));
        // Dropped in this instant, they are found again with bridges of their own.
        let find = || found.unwrap_or_else(|| base.found(&Kept::new(OWN_BYTES)));
        kept.get_or_make(&key, size_of::<CautionLevels>(), find).as_ref().clone()
    }

    fn found(&self, kept: &Kept) -> CautionLevels {
        let history = record(&self.problem.history, &self.problem);
        let problem = Problem::with(self, kept.clone());
        let worlds = Worlds::of(&history, &self.problem);
        let losses = worlds.losses(&problem, &history, self.seed);
        worlds.levels(&losses)
    }
}

/// The three worlds of a record.
struct Worlds {
    premium_seen: f64,
    standard_error: f64,
    premiums: [f64; 3],
    /// Of log-returns.
    shifts: [f64; 3],
    investor: Investor,
}

/// Mean loss in one world at every share of the radius.
type Losses = Vec<f64>;

impl Worlds {
    fn of(history: &[f64], problem: &ProblemSpecification) -> Self {
        let (count, bank) = (history.len() as f64, 1.0 + problem.rate_per_step);
        let mean = history.iter().map(|z| z.exp_m1()).sum::<f64>() / count;
        let squares: f64 = history.iter().map(|z| (z.exp_m1() - mean).powi(2)).sum();
        let (premium_seen, standard_error) = (mean - problem.rate_per_step, (squares / (count - 1.0) / count).sqrt());
        let premiums = WORLDS.map(|part| part * (premium_seen.max(0.0) + standard_error));
        Worlds {
            premium_seen,
            standard_error,
            premiums,
            shifts: premiums.map(|premium| ((bank + premium) / (1.0 + mean)).ln()),
            investor: Investor {
                bank,
                utility: RelativeUtility::new(problem.utility, problem.initial_wealth * bank),
                highest: problem.action_interval[1],
                support: problem.support_rule(),
            },
        }
    }

    fn losses(&self, problem: &Problem, history: &[f64], seed: u64) -> [Losses; 3] {
        let count = (RETURNS / history.len()).clamp(LEAST_RECORDS, RECORDS);
        let learning = problem.specification.problem.learning;
        let draw = |index: usize| {
            let indices = circular_blocks(history.len(), BLOCK, &mut stream(seed, "caution", 0, index));
            indices.into_iter().map(|index| history[index]).collect::<Vec<f64>>()
        };
        let together = (TOGETHER_RETURNS / history.len()).clamp(1, TOGETHER);
        let parts: Vec<usize> = (0..count).step_by(together).collect();
        let of_part = |first: usize| {
            let records: Vec<Vec<f64>> = (first..(first + together).min(count)).map(draw).collect();
            let laws: Vec<EmpiricalDistribution> = records.iter().map(|record| learning.law(record)).collect();
            let radii: Vec<f64> = laws.iter().map(|law| problem.sets.radius(law)).collect();
            let allocations = |shift: f64| {
                let of_record = |(record, radius): (&Vec<f64>, &f64)| {
                    let shifted: Vec<f64> = record.iter().map(|z| z + shift).collect();
                    let centre = problem.centring.centre(&learning.law(&shifted));
                    let curve = AllocationCurve::of(&centre, self.investor);
                    (0..=SCALES).map(|scale| curve.at(radius * share(scale))).collect::<Vec<f64>>()
                };
                records.iter().zip(&radii).map(of_record).collect::<Vec<_>>()
            };
            self.shifts.map(allocations)
        };
        let drawn = pool::map(parts, of_part);
        let world = |index: usize| {
            let worth = Worth::of(history, self.shifts[index], self.investor);
            let mut losses = vec![0.0; SCALES + 1];
            for allocations in drawn.iter().flat_map(|part| &part[index]) {
                for (loss, allocation) in losses.iter_mut().zip(allocations) {
                    *loss += worth.lost(*allocation) / count as f64;
                }
            }
            losses
        };
        [world(0), world(1), world(2)]
    }

    fn levels(&self, losses: &[Losses; 3]) -> CautionLevels {
        let least = |losses: &Losses| losses.iter().copied().fold(f64::INFINITY, f64::min);
        let least = [least(&losses[0]), least(&losses[1]), least(&losses[2])];
        let regret = |world: usize, scale: usize| losses[world][scale] - least[world];
        let priced = |scale: usize| CautionScale {
            scale: share(scale),
            regrets: [0, 1, 2].map(|world| regret(world, scale)),
            spared: losses[0][0] - losses[0][scale],
        };
        let weighed = |weights: [f64; 3]| {
            let worst = |scale: &usize| (0..3).map(|world| weights[world] * regret(world, *scale)).fold(0.0, f64::max);
            let best = (0..=SCALES).min_by(|one, other| worst(one).total_cmp(&worst(other)));
            priced(best.unwrap_or(SCALES))
        };
        CautionLevels {
            premiums: self.premiums,
            premium_seen: self.premium_seen,
            standard_error: self.standard_error,
            bold: weighed([1.0, 1.0, 2.0]),
            balanced: weighed([1.0, 1.0, 1.0]),
            cautious: weighed([2.0, 1.0, 1.0]),
            paper: priced(SCALES),
        }
    }
}

/// What allocations are worth in a world, in log certainty equivalent over the bank.
struct Worth {
    /// Evenly from nothing to the most that may be held.
    worths: Vec<f64>,
    best: f64,
    highest: f64,
}

impl Worth {
    fn of(history: &[f64], shift: f64, investor: Investor) -> Self {
        let Investor { bank, utility, highest, .. } = investor;
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

    /// Beside the best allocation.
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
