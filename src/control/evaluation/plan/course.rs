//! Courses of wealth by rules for spending and holding, on the same paths of returns.

use super::by_state::{ByState, DescribedBy, between};
use super::report::PlanRule;
use crate::control::policy::futures::World;
use crate::control::policy::worst_case::TransportedMass;
use crate::control::pool;
use crate::control::problem::goal::funded;
use crate::numerics::machine::streams::stream;
use rand::RngExt;

/// Paths that a thread follows together, period after period, so that the laws of a period are read from memory once: enough
/// to cost more than the handing over, some tens of microseconds.
const PATHS_TOGETHER: usize = 128;

/// The returns of a period: those of the centre, and where the law that is worst for each state of the plan moves them.
pub(super) struct PeriodReturns {
    nodes: Vec<f64>,
    laws: Vec<MovedReturns>,
}

/// The returns of the centre, ascending, and where one law moves each.
struct MovedReturns {
    /// Growth of a unit held, in either world.
    grown: Vec<[f64; 2]>,
    /// Probability of the returns up to each.
    up_to: Vec<f64>,
}

impl MovedReturns {
    fn new(transport: &[TransportedMass]) -> Self {
        let mut sum = 0.0;
        let up_to = transport.iter().map(|moved| {
            sum += moved.mass;
            sum
        });
        MovedReturns {
            up_to: up_to.collect(),
            grown: transport.iter().map(|moved| [moved.atom.exp(), moved.moved_to.exp()]).collect(),
        }
    }

    /// Returns the place of the return at which the probability reaches `share` of the whole.
    fn place(&self, share: f64) -> usize {
        let whole = self.up_to.last().copied().unwrap_or(1.0);
        let place = self.up_to.partition_point(|up_to| *up_to <= share * whole);
        place.min(self.grown.len() - 1)
    }
}

impl PeriodReturns {
    /// Prepares the worst laws of the states `nodes`, ascending.
    pub(super) fn new(nodes: &[f64], transports: &[Vec<TransportedMass>]) -> Self {
        let laws = transports.iter().map(|transport| MovedReturns::new(transport)).collect();
        PeriodReturns { nodes: nodes.to_vec(), laws }
    }

    /// Returns the growth of a unit held, in a state of the plan.
    fn growth(&self, world: World, state: f64, drawn: DrawnReturn) -> f64 {
        let [of_centre, moved] = self.laws[0].grown[drawn.place as usize];
        if world == World::Record {
            return of_centre;
        }
        if self.laws.len() == 1 {
            return moved;
        }
        let (node, weight) = between(&self.nodes, state);
        let moved = |law: &MovedReturns| law.grown[law.place(drawn.share())][1];
        let near = moved(&self.laws[node]);
        if weight == 0.0 { near } else { near + weight * (moved(&self.laws[node + 1]) - near) }
    }
}

/// The return of a period on a path.
#[derive(Debug, Clone, Copy)]
struct DrawnReturn {
    /// Its quantile, in parts of 2^32.
    quantile: u32,
    /// Its place in the first law of its period.
    place: u32,
}

impl DrawnReturn {
    fn share(self) -> f64 {
        (f64::from(self.quantile) + 0.5) / (f64::from(u32::MAX) + 1.0)
    }
}

/// Paths of returns, on which every rule is followed.
pub(super) struct ReturnPaths {
    periods: Vec<PeriodReturns>,
    /// The return of each period, path after path.
    drawn: Vec<Vec<DrawnReturn>>,
    market: Market,
}

/// The bank and prices of all paths, and what describes the state of the plan.
pub(super) struct Market {
    /// Growth of money in the bank, and of prices, in a period.
    pub(super) bank: f64,
    pub(super) prices: f64,
    /// The payments of each period and the reserve before them, in money of now; empty if nothing is secured or aimed at.
    pub(super) reserves: Vec<[f64; 2]>,
    pub(super) described: DescribedBy,
    /// The drawdown at the start.
    pub(super) drawdown: f64,
}

/// The spending of each period.
#[derive(Debug, Clone)]
pub(super) enum Spends {
    /// The secured amount and a share of the surplus, period after period.
    Planned(Vec<ByState>),
    /// A share of wealth.
    Share(f64),
    /// An amount in money of now; negative if it is put in.
    Amount(f64),
}

/// A rule for spending and holding.
#[derive(Debug, Clone)]
pub(super) struct SpendingRule {
    pub(super) named: PlanRule,
    pub(super) spends: Spends,
    /// Shares held of what is left, or of the surplus that is left if the reserve stays in the bank, period after period.
    pub(super) held: Vec<ByState>,
    /// True if the reserve stays in the bank.
    pub(super) keeps_reserve: bool,
}

impl SpendingRule {
    /// Returns the spending of a period and the share held afterwards, given the state of the plan, wealth and the reserve.
    fn acts(&self, period: usize, state: f64, now: f64, [secured, reserve]: [f64; 2]) -> (f64, f64) {
        let surplus = (now - reserve).max(0.0);
        let spent = match &self.spends {
            Spends::Planned(shares) => (secured + shares[period].at(state) * surplus).min(now),
            Spends::Share(share) => share * now,
            Spends::Amount(amount) => amount.min(now),
        };
        let held = self.held[period].at(state);
        if !self.keeps_reserve || reserve == 0.0 {
            return (spent, held);
        }
        let (left, kept) = (now - spent, reserve - secured);
        (spent, if left > kept { held * (left - kept) / left } else { 0.0 })
    }

    /// Returns what wealth does not pay of the spending of a period.
    fn unpaid(&self, now: f64, secured: f64) -> f64 {
        match self.spends {
            Spends::Planned(_) => (secured - now).max(0.0),
            Spends::Share(_) => 0.0,
            Spends::Amount(amount) => (amount - now).max(0.0),
        }
    }
}

/// Wealth before spending and the spending of each period, and wealth at the horizon, in money of now.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SpendingCourse {
    pub(super) wealth: Vec<f64>,
    pub(super) spent: Vec<f64>,
    /// The sum of what could not be paid.
    pub(super) unpaid: f64,
    /// The largest drawdown of a unit that stays invested.
    pub(super) drawdown: f64,
}

/// A unit of money that stays invested, and its highest value so far.
struct InvestedUnit([f64; 2]);

impl InvestedUnit {
    fn grows(&mut self, growth: f64) {
        let now = self.0[0] * growth;
        self.0 = [now, self.0[1].max(now)];
    }

    fn of_peak(&self) -> f64 {
        self.0[0] / self.0[1]
    }
}

impl ReturnPaths {
    /// Draws paths. Cost O(paths horizon ln returns).
    pub(super) fn draw(periods: Vec<PeriodReturns>, paths: usize, seed: u64, market: Market) -> Self {
        let draw = |&path: &usize| {
            let mut random = stream(seed, "plan", 0, path);
            let drawn = periods.iter().map(|period| {
                let drawn = DrawnReturn { quantile: random.random(), place: 0 };
                DrawnReturn { place: period.laws[0].place(drawn.share()) as u32, ..drawn }
            });
            drawn.collect()
        };
        let drawn = together(&(0..paths).collect::<Vec<usize>>(), |block| block.iter().map(draw).collect());
        ReturnPaths { periods, drawn, market }
    }

    /// Returns the growth of a unit of wealth in a period, in money of the same value.
    fn growth(
        &self,
        (world, shift): (World, f64),
        (period, state): (usize, f64),
        drawn: DrawnReturn,
        held: f64,
    ) -> f64 {
        let grown = self.periods[period].growth(world, state, drawn);
        ((1.0 - held) * self.market.bank + held * shift * grown) / self.market.prices
    }

    fn unit(&self) -> InvestedUnit {
        InvestedUnit([1.0 - self.market.drawdown, 1.0])
    }

    /// Returns the number that describes the state of the plan.
    fn state(&self, wealth: f64, reserve: f64, unit: &InvestedUnit) -> f64 {
        match self.market.described {
            DescribedBy::Period => 0.0,
            DescribedBy::Funds => funded(wealth, reserve),
            DescribedBy::Unit => unit.of_peak(),
        }
    }

    /// Follows a rule from `wealth` on every path, and returns what `of` finds of each course. Growth of what is held is
    /// multiplied by `shift`. Cost O(paths horizon); in the worst case of a plan that depends on its state, times ln returns.
    pub(super) fn follow<R: Send>(
        &self,
        (world, shift): (World, f64),
        rule: &SpendingRule,
        wealth: f64,
        of: impl Fn(&SpendingCourse) -> R + Sync + Send,
    ) -> Vec<R> {
        let fallen = |unit: &InvestedUnit| 1.0 - unit.of_peak();
        let start = || {
            let unit = self.unit();
            let drawdown = fallen(&unit);
            (SpendingCourse { wealth: vec![wealth], spent: Vec::new(), unpaid: 0.0, drawdown }, unit)
        };
        together(&self.drawn, |block| {
            let mut followed: Vec<(SpendingCourse, InvestedUnit)> = block.iter().map(|_| start()).collect();
            for period in 0..self.periods.len() {
                let reserved = self.market.reserves.get(period).copied().unwrap_or_default();
                for ((course, unit), drawn) in followed.iter_mut().zip(block) {
                    let now = course.wealth[period];
                    let state = self.state(now, reserved[1], unit);
                    let (spent, held) = rule.acts(period, state, now, reserved);
                    let growth = self.growth((world, shift), (period, state), drawn[period], held);
                    unit.grows(growth * self.market.prices);
                    course.unpaid += rule.unpaid(now, reserved[0]);
                    course.drawdown = course.drawdown.max(fallen(unit));
                    course.spent.push(spent);
                    course.wealth.push((now - spent) * growth);
                }
            }
            followed.iter().map(|(course, _)| of(course)).collect()
        })
    }

    /// Returns on every path the amount that can be spent at the start of each period and leaves nothing, per unit of
    /// wealth: one over the sum of what a unit of money of each period costs now. Growth of what is held is multiplied
    /// by `shift`. What is held may not depend on funds.
    pub(super) fn sustainable(&self, world: World, held: &[ByState], shift: f64) -> Vec<f64> {
        together(&self.drawn, |block| {
            let mut costs: Vec<(f64, f64, InvestedUnit)> = block.iter().map(|_| (1.0, 0.0, self.unit())).collect();
            for (period, held) in held.iter().enumerate() {
                for ((cost, sum, unit), drawn) in costs.iter_mut().zip(block) {
                    *sum += *cost;
                    let state = self.state(1.0, 1.0, unit);
                    let growth = self.growth((world, shift), (period, state), drawn[period], held.at(state));
                    unit.grows(growth * self.market.prices);
                    *cost /= growth;
                }
            }
            costs.into_iter().map(|(_, sum, _)| 1.0 / sum).collect()
        })
    }
}

/// Applies `work` to the paths, some together, and returns what it finds of each, in order.
fn together<T: Sync + Send, R: Send>(paths: &[T], work: impl Fn(&[T]) -> Vec<R> + Sync + Send) -> Vec<R> {
    let blocks = paths.chunks(PATHS_TOGETHER).collect();
    pool::map(blocks, work).into_iter().flatten().collect()
}
