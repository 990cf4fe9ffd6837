//! The futures of a policy in two worlds: one in which every period brings the law that is worst for what is decided,
//! and one in which periods are drawn from the record.
//!
//! The first world is the measure Q^(phi, psi) of the paper's section 2.2, phi what the policy does and psi the worst
//! law for it. Its section 2.3 says what it is worth:
//!
//!   V_0(y_0) = E[ U(X_T) ] under Q^(phi*, psi*),
//!
//! so one number checks the value, the policy, the worst laws and the surrogates of a whole horizon. The mean over
//! paths is estimated with a control variate. With V^ the surrogate and psi_t the law that is played at step t,
//!
//!   U(X_T) - sum_t ( V^_(t+1)(Y_(t+1)) - E_psi_t[ V^_(t+1) ] )
//!
//! has the same mean, because every term of the sum has mean 0, and hardly any variance if V^ is close to the truth.

pub mod declared;
pub mod investor;
mod report;

use rand::RngExt;
use rand_distr::StandardNormal;

pub use self::report::{Course, FanPoint, Futures};
use self::report::{fan, in_words};
use crate::control::bellman::solution::Adversary;
use crate::control::error::FieldError;
use crate::control::request::rules;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::Clustered;

/// Allowed number of paths of each world.
pub const PATHS: std::ops::RangeInclusive<usize> = 20..=1000;
/// Paths of a question that names no number, unless the periods are so many that they exceed [`MOST_STEPS`].
const DEFAULT_PATHS: usize = 100;
/// Most periods on all paths of a world. A robust step at each takes about a millisecond.
const MOST_STEPS: usize = 20_000;
/// Confidence of the interval.
const LEVEL: f64 = 0.9;

/// Decides in every state, and knows the law that is worst for what it decides.
pub trait GamePlayer: Send + Sync {
    /// State before a period.
    type State: Clone + Send + Sync;

    /// Returns the number of periods decided.
    fn horizon(&self) -> usize;

    /// Returns the noun for a period.
    fn noun(&self) -> &'static str;

    /// Returns the amount that no law can take away, if there is one.
    fn floor(&self) -> Option<f64>;

    /// Returns the names of the figures that describe a state.
    fn names(&self) -> Vec<String>;

    /// Returns the figures of a state, in the order of their names.
    fn figures(&self, state: &Self::State) -> Vec<f64>;

    /// Returns what is decided after `step` periods; with the worst law for it if it is to be played.
    ///
    /// # Errors
    /// A state in which nothing can be decided.
    fn decide(&self, step: usize, state: &Self::State, world: World) -> Result<GameMove, FieldError>;

    /// Returns the state after a period with this noise.
    ///
    /// # Errors
    /// The state leaves its range.
    fn next(
        &self,
        step: usize,
        state: &Self::State,
        decision: &GameMove,
        noise: f64,
    ) -> Result<Self::State, FieldError>;

    /// Returns the utility of what a state is worth: by the surrogate, and at the horizon the utility itself.
    fn utility(&self, step: usize, state: &Self::State) -> f64;

    /// Returns what an answer says a state is worth, whose decision is known.
    fn promise(&self, step: usize, state: &Self::State, decision: &GameMove) -> Promise;

    /// Returns the amount that has this utility for certain.
    fn certain(&self, utility: f64) -> f64;
}

/// The actions of a period, and the worst law for them.
#[derive(Debug, Clone)]
pub struct GameMove {
    /// Actions, in the order of the problem.
    pub actions: Vec<f64>,
    /// The worst law, and the mean utility of the next state under it by the surrogate.
    pub worst: Option<(Adversary, f64)>,
}

/// The worth for certain that an answer gives for a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promise {
    /// The worth, an amount.
    pub worth: f64,
    /// The standard deviation that the answer states for it, as an amount; `None` if it states none.
    pub stated_error: Option<f64>,
}

/// The world that brings the noises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum World {
    /// Every period has the law that is worst for what was decided.
    Worst,
    /// Every period has the law of the record at the start.
    Record,
}

/// One path.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayedPath {
    /// Figures of the state before each period and at the end.
    pub figures: Vec<Vec<f64>>,
    /// Utility at the end.
    pub utility: f64,
    /// Utility at the end less the control variate, in the worst world.
    pub controlled: f64,
}

/// The start of all paths, and the policy that they follow.
pub struct Opening<P: GamePlayer> {
    /// The player.
    pub player: P,
    /// Periods before the start.
    pub step: usize,
    /// The state at the start.
    pub start: P::State,
    /// The law of the noises known at the start, from which the record's world draws.
    pub record: EmpiricalDistribution,
    /// Seed of the draws.
    pub seed: u64,
}

/// Returns the number of paths for a question about this many periods.
///
/// # Errors
/// A number that is not allowed.
pub fn checked_paths(paths: Option<usize>, periods: usize) -> Result<usize, FieldError> {
    let most = (MOST_STEPS / periods.max(1)).clamp(*PATHS.start(), *PATHS.end());
    match paths {
        None => Ok(DEFAULT_PATHS.min(most)),
        Some(paths) => rules::whole("paths", paths, &(*PATHS.start()..=most)).map(|()| paths),
    }
}

impl<P: GamePlayer> Opening<P> {
    /// Returns the decision at the start, which all paths have in common.
    ///
    /// # Errors
    /// As [`GamePlayer::decide`].
    pub fn first(&self) -> Result<GameMove, FieldError> {
        self.player.decide(self.step, &self.start, World::Worst)
    }

    /// Plays one path. Streams: ("futures", 0 or 1 by the world, path). Cost: a decision for each period but the first.
    ///
    /// # Errors
    /// As [`GamePlayer::decide`] and [`GamePlayer::next`].
    pub fn path(&self, first: &GameMove, world: World, path: usize) -> Result<PlayedPath, FieldError> {
        let player = &self.player;
        let mut generator = stream(self.seed, "futures", usize::from(world == World::Record), path);
        let mut played = PlayedPath { figures: vec![player.figures(&self.start)], utility: f64::NAN, controlled: 0.0 };
        let mut state = self.start.clone();
        for step in self.step..player.horizon() {
            let decision = match step == self.step {
                true => first.clone(),
                false => player.decide(step, &state, world)?,
            };
            let noise = match (world, &decision.worst) {
                (World::Worst, Some((adversary, _))) => drawn(adversary, &mut generator),
                _ => drawn_by_mass(masses(&self.record), &mut generator),
            };
            state = player.next(step, &state, &decision, noise)?;
            played.utility = player.utility(step + 1, &state);
            played.controlled -= played.utility - decision.worst.map_or(played.utility, |(_, mean)| mean);
            played.figures.push(player.figures(&state));
        }
        played.controlled += played.utility;
        Ok(played)
    }

    /// Returns the report of all paths, those of the worst world and those of the record's.
    /// Checked by: `tests/solver/futures.rs`.
    pub fn report(&self, first: &GameMove, worst: &[PlayedPath], record: &[PlayedPath]) -> Futures {
        let player = &self.player;
        let controlled: Vec<f64> = worst.iter().map(|path| path.controlled).collect();
        let Promise { worth: promised, stated_error } = player.promise(self.step, &self.start, first);
        let played = Clustered::new(1, worst.len(), LEVEL).mean(&controlled).mapped(|utility| player.certain(utility));
        let course =
            |(place, name): (usize, String)| Course { name, worst: fan(worst, place), record: fan(record, place) };
        let courses: Vec<Course> = player.names().into_iter().enumerate().map(course).collect();
        let periods = (player.horizon() - self.step, player.noun());
        let sentence = in_words(&courses, (played.value, player.floor()), periods);
        Futures { period: self.step + 1, paths: worst.len(), promised, stated_error, played, courses, sentence }
    }
}

/// Draws a noise from the worst law.
fn drawn(adversary: &Adversary, generator: &mut impl rand::Rng) -> f64 {
    match adversary {
        Adversary::Transport { support, moves } => {
            drawn_by_mass(moves.iter().map(|moved| (support[moved.to], moved.mass)), generator)
        }
        Adversary::Normal { worst, .. } => {
            worst.mean + worst.variance.sqrt() * generator.sample::<f64, _>(StandardNormal)
        }
    }
}

/// Returns the noises of a record with their weights.
fn masses(record: &EmpiricalDistribution) -> impl Iterator<Item = (f64, f64)> + Clone {
    record.atoms().iter().copied().zip(record.weights().iter().copied())
}

/// Draws one of some values, each with a probability in proportion to its mass; NaN if there are none.
fn drawn_by_mass(values: impl Iterator<Item = (f64, f64)> + Clone, generator: &mut impl rand::Rng) -> f64 {
    let mut left = generator.random::<f64>() * values.clone().map(|(_, mass)| mass).sum::<f64>();
    let mut last = f64::NAN;
    for (value, mass) in values {
        last = value;
        left -= mass;
        if left < 0.0 {
            break;
        }
    }
    last
}
