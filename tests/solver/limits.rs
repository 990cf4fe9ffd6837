//! The one-step problem of several assets with limits on its composition: against cutting planes, grids, and allocations
//! drawn within the limits.

use ballast::control::assets::{AssetsSolution, PortfolioStep, ReturnScenarios};
use ballast::control::problem::actions::ActionInterval;
use ballast::control::problem::compositions::{CompositionSet, GroupRange};
use ballast::control::problem::utility::RelativeUtility;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::transport::water_filling::{GroundMetric, inverse_volatility};
use microlp::{ComparisonOp, LinearExpr, OptimizationDirection, Problem, SolveOutcome};
use rand::{Rng, RngExt};

/// A hundredth of a percent.
const BP: f64 = 1e-4;
/// The contract: a value and its bound are at most this far apart.
const CERTIFIED: f64 = 0.01 * BP;
/// Limits are kept up to this.
const KEPT: f64 = 1e-9;
const BANK: f64 = 1.002;
/// The lowest log-return.
const FLOOR: f64 = -0.6;
const POWER: RelativeUtility = RelativeUtility::Power { eta: 3.0 };

/// Draws log-returns with a common part, of deviation 0.05 a period and mean 0.008 to 0.016.
fn drawn_returns(random: &mut impl Rng, assets: usize, dates: usize) -> Vec<Vec<f64>> {
    let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let mut row = || {
        let common = normal();
        let mut own = |asset: usize| 0.008 * (1.0 + asset as f64 / assets as f64) + 0.035 * (common + normal());
        (0..assets).map(&mut own).collect()
    };
    (0..dates).map(|_| row()).collect()
}

/// Draws shares that sum to 1, some of them 0.
fn drawn_composition(random: &mut impl Rng, assets: usize) -> Vec<f64> {
    let mut shares: Vec<f64> =
        (0..assets).map(|_| (random.random::<f64>() - 0.2).max(0.0) * random.random::<f64>()).collect();
    shares[random.random_range(0..assets)] += 0.1;
    let sum: f64 = shares.iter().sum();
    shares.iter().map(|share| share / sum).collect()
}

/// Limits as a user gives them, kept apart from the set under test.
#[derive(Debug, Clone)]
struct Limits {
    ranges: Vec<[f64; 2]>,
    groups: Vec<(Vec<usize>, f64, f64)>,
    turnover: Option<(Vec<f64>, f64)>,
}

impl Limits {
    /// Draws limits that one composition keeps; some leave no room.
    fn drawn(random: &mut impl Rng, assets: usize) -> Limits {
        let inside = drawn_composition(random, assets);
        let away = |random: &mut dyn FnMut() -> f64, none: f64| if random() < none { 0.0 } else { 0.4 * random() };
        let mut draw = || random.random::<f64>();
        let range = |share: &f64| {
            let (down, up) = (away(&mut draw, 0.15), away(&mut draw, 0.15));
            match draw() {
                chance if chance < 0.3 => [0.0, 1.0],
                chance if chance < 0.6 => [0.0, (share + up).min(1.0)],
                _ => [(share - down).max(0.0), (share + up).min(1.0)],
            }
        };
        let ranges: Vec<[f64; 2]> = inside.iter().map(range).collect();
        let count = random.random_range(0..4);
        let mut group = |_| {
            let members: Vec<usize> = (0..assets).filter(|_| random.random::<f64>() < 0.5).collect();
            let sum: f64 = members.iter().map(|asset| inside[*asset]).sum();
            let room = [0.0, 0.05, 0.2][random.random_range(0..3)];
            (members, (sum - room).max(0.0), (sum + room * random.random::<f64>()).min(1.0))
        };
        let groups = (0..count).map(&mut group).filter(|(members, ..)| !members.is_empty()).collect();
        let turnover = (random.random::<f64>() < 0.5).then(|| {
            let held = drawn_composition(random, assets);
            let needed: f64 = held.iter().zip(&inside).map(|(held, share)| (held - share).abs()).sum();
            (held, needed + 0.3 * random.random::<f64>())
        });
        Limits { ranges, groups, turnover }
    }

    fn set(&self) -> CompositionSet {
        let group = |(members, least, most): &(Vec<usize>, f64, f64)| GroupRange {
            members: members.clone(),
            least: *least,
            most: *most,
        };
        let set = CompositionSet::new(self.ranges.clone(), self.groups.iter().map(group).collect());
        match &self.turnover {
            // The total does not count.
            Some((held, most)) => set.within_turnover(&held.iter().map(|held| 0.3 * held).collect::<Vec<_>>(), *most),
            None => set,
        }
    }

    /// Returns by how much an allocation is beyond the limit that its composition breaks most.
    fn excess(&self, allocation: &[f64]) -> f64 {
        let total: f64 = allocation.iter().sum();
        if total == 0.0 {
            return 0.0;
        }
        let composition: Vec<f64> = allocation.iter().map(|share| share / total).collect();
        let ranges = composition.iter().zip(&self.ranges);
        let mut excess = ranges.map(|(share, [low, high])| (low - share).max(share - high)).fold(0.0, f64::max);
        for (members, least, most) in &self.groups {
            let sum: f64 = members.iter().map(|asset| composition[*asset]).sum();
            excess = excess.max(least - sum).max(sum - most);
        }
        if let Some((held, most)) = &self.turnover {
            let moved: f64 = held.iter().zip(&composition).map(|(held, share)| (held - share).abs()).sum();
            excess = excess.max(moved - most);
        }
        excess
    }
}

fn step(
    returns: &[Vec<f64>],
    ground: &GroundMetric,
    utility: RelativeUtility,
    radius: f64,
    [lowest, highest]: [f64; 2],
) -> PortfolioStep {
    let law = ReturnScenarios { returns, radius, floors: vec![FLOOR; returns[0].len()] };
    PortfolioStep::new(law, ground.clone(), utility, BANK - 1.0, ActionInterval { lowest, highest })
}

fn drawn_ground(case: usize, returns: &[Vec<f64>]) -> GroundMetric {
    if case.is_multiple_of(2) { GroundMetric::Sup } else { GroundMetric::Weighted(inverse_volatility(returns)) }
}

fn gap(solution: &AssetsSolution) -> f64 {
    solution.bound - solution.value
}

#[test]
fn limits_are_kept_and_nothing_within_them_is_better() {
    let mut random = stream(31, "limits", 0, 0);
    let (mut bound_by, mut widest, mut warned) = (0, 0.0_f64, Vec::new());
    for case in 0..240 {
        let assets = 1 + case % 12;
        let returns = drawn_returns(&mut random, assets, [24, 60, 120][case % 3]);
        let ground = drawn_ground(case / 12, &returns);
        let utility = [POWER, RelativeUtility::Log, RelativeUtility::Power { eta: 8.0 }][case / 3 % 3];
        let radius = 0.015 * random.random::<f64>().powi(2);
        let total = [[0.0, 1.0], [0.0, 0.6], [0.3, 0.8], [0.5, 0.5]][case / 5 % 4];
        let limits = Limits::drawn(&mut random, assets);
        let free = step(&returns, &ground, utility, radius, total);
        let limited = free.clone().within(Some(limits.set()));
        let cost = [0.0, 0.003][case / 7 % 2];
        let holdings: Vec<f64> = match &limits.turnover {
            Some((held, _)) => held.iter().map(|held| 0.3 * held).collect(),
            None => drawn_composition(&mut random, assets).iter().map(|share| 0.5 * share).collect(),
        };
        let unlimited = free.solve_from(&holdings, cost, None);
        let found = limited.solve_from(&holdings, cost, None);
        assert!(limits.excess(&found.allocation) < KEPT, "{case}: {limits:?} {found:?}");
        let sum: f64 = found.allocation.iter().sum();
        assert!((total[0] - 1e-5..=total[1] + 1e-12).contains(&sum), "{case}: {found:?}");
        assert!(gap(&found) > -1e-12, "{case}: {found:?}");
        assert!(found.value < unlimited.bound + 1e-9, "{case}: {found:?} {unlimited:?}");
        widest = widest.max(gap(&found) / BP);
        if gap(&found) > CERTIFIED {
            warned.push((case, assets, gap(&found) / BP));
        }
        bound_by += usize::from(unlimited.value > found.value + CERTIFIED);
        let turnover = |allocation: &[f64]| -> f64 {
            allocation.iter().zip(&holdings).map(|(share, held)| (share - held).abs()).sum()
        };
        let worth = |allocation: &[f64]| free.worth(allocation).value + (-cost * turnover(allocation)).ln_1p();
        assert!((worth(&found.allocation) - found.value).abs() < 0.01 * BP, "{case}: {found:?}");
        // From the answer towards compositions within the limits, near and far, and to other totals.
        let set = limits.set();
        for part in [1e-3, 0.03, 0.3, 1.0] {
            for _ in 0..3 {
                let other = set.nearest(drawn_composition(&mut random, assets));
                let whole = total[0] + (total[1] - total[0]) * random.random::<f64>();
                let tried: Vec<f64> = (found.allocation.iter().zip(&other))
                    .map(|(share, other)| share + part * (whole * other - share))
                    .collect();
                assert!(limits.excess(&tried) < KEPT, "{case}: {limits:?} {other:?}");
                // Limits without room are kept up to rounding, and may have a high price.
                let worth = worth(&tried);
                assert!(worth < found.bound + 0.001 * BP, "{case}: {worth} {tried:?} {found:?}");
            }
        }
        // From a warm start that breaks the limits, the same value.
        if cost == 0.0 {
            let near = limited.solve(Some(&unlimited));
            assert!((near.value - found.value).abs() < CERTIFIED, "{case}: {near:?} {found:?}");
            assert!(limits.excess(&near.allocation) < KEPT, "{case}: {limits:?} {near:?}");
        }
    }
    println!("limits bind in {bound_by} of 240 cases, the widest gap is {widest:.4} bp");
    assert!(warned.is_empty(), "{warned:?}");
    assert!(bound_by > 80, "{bound_by}");
}

#[test]
fn two_assets_are_best_by_a_fine_grid() {
    let mut random = stream(32, "grid", 0, 0);
    for case in 0..12 {
        let returns = drawn_returns(&mut random, 2, 24);
        let ground = drawn_ground(case, &returns);
        let radius = 0.006 * random.random::<f64>();
        let low = 0.6 * random.random::<f64>();
        let high = low + 0.4 * random.random::<f64>();
        let limits = Limits { ranges: vec![[low, high], [0.0, 1.0]], groups: Vec::new(), turnover: None };
        let step = step(&returns, &ground, POWER, radius, [0.0, 1.0]).within(Some(limits.set()));
        let found = step.solve(None);
        assert!(gap(&found) < CERTIFIED && limits.excess(&found.allocation) < KEPT, "{case}: {found:?}");
        // Finer and finer around the best so far: the value has kinks.
        let high = high.min(1.0);
        let (mut best, mut at, mut width) = (f64::NEG_INFINITY, [0.5 * (low + high), 0.5], [0.5 * (high - low), 0.5]);
        for _ in 0..5 {
            let middle = at;
            for share in -16..=16 {
                let first = (middle[0] + width[0] * f64::from(share) / 16.0).clamp(low, high);
                for total in -16..=16 {
                    let total = (middle[1] + width[1] * f64::from(total) / 16.0).clamp(0.0, 1.0);
                    let value = step.worth(&[total * first, total * (1.0 - first)]).value;
                    if value > best {
                        (best, at) = (value, [first, total]);
                    }
                }
            }
            width = width.map(|width| 0.25 * width);
        }
        assert!(best < found.bound + 1e-12 && best > found.value - 0.01 * BP, "{case}: {best} {found:?}");
    }
}

/// The whole problem over laws on a grid of moves of two assets, by Kelley's cutting planes with linear programmes of a
/// library: `max sum p_j t_j - gamma radius` with tangents of the utility of every move found to be worst, and the limits
/// as bounds of the programme. Returns the value of the programme at the end, and what its best allocation has on the grid.
fn by_cutting_planes(returns: &[Vec<f64>], ground: &GroundMetric, radius: f64, limits: &Limits) -> (f64, f64) {
    let offsets: Vec<f64> = (0..=500).map(|index| f64::from(index) * 0.0015).collect();
    let coarse: Vec<f64> = offsets.iter().copied().step_by(4).collect();
    let mut moves: Vec<(f64, [f64; 2])> = Vec::new();
    for &first in &offsets {
        for &second in coarse.iter().chain([&first]) {
            let cost = match ground {
                GroundMetric::Sup => first.max(second),
                GroundMetric::Weighted(weights) => weights[0] * first + weights[1] * second,
            };
            moves.push((cost, [first, second]));
        }
    }
    let excess =
        |row: &[f64], down: [f64; 2]| [0, 1].map(|asset| (row[asset] - down[asset]).max(FLOOR).exp() / BANK - 1.0);
    let mass = 1.0 / returns.len() as f64;
    // Atom, price of distance and slopes of a tangent `t <= at + price gamma + slopes . a`.
    let mut cuts: Vec<(usize, f64, f64, [f64; 2])> = Vec::new();
    let (mut shares, mut price, mut lower) = ([0.2, 0.2], 0.5, f64::NEG_INFINITY);
    for _ in 0..400 {
        let mut dual = -price * radius;
        for (atom, row) in returns.iter().enumerate() {
            let payoff = |(cost, down): &(f64, [f64; 2])| {
                let excess = excess(row, *down);
                POWER.at(1.0 + excess[0] * shares[0] + excess[1] * shares[1]).0 + price * cost
            };
            let worst = moves.iter().min_by(|left, right| payoff(left).total_cmp(&payoff(right))).unwrap();
            dual += mass * payoff(worst);
            for (cost, down) in [worst, &moves[0]] {
                let excess = excess(row, *down);
                let (utility, slope) = POWER.at(1.0 + excess[0] * shares[0] + excess[1] * shares[1]);
                let slopes = excess.map(|excess| slope * excess);
                cuts.push((atom, *cost, utility - slopes[0] * shares[0] - slopes[1] * shares[1], slopes));
            }
        }
        lower = lower.max(dual);
        let mut programme = Problem::new(OptimizationDirection::Maximize);
        let held = [0, 1].map(|_| programme.add_var(0.0, (0.0, 1.0)));
        let gamma = programme.add_var(-radius, (0.0, 50.0));
        let tops: Vec<_> = returns.iter().map(|_| programme.add_var(mass, (-10.0, 10.0))).collect();
        let sum = |parts: &[(microlp::Variable, f64)]| {
            let mut sum = LinearExpr::empty();
            parts.iter().for_each(|(unknown, factor)| sum.add(*unknown, *factor));
            sum
        };
        for (atom, cost, at, slopes) in &cuts {
            let left = [(tops[*atom], 1.0), (gamma, -cost), (held[0], -slopes[0]), (held[1], -slopes[1])];
            programme.add_constraint(sum(&left), ComparisonOp::Le, *at);
        }
        programme.add_constraint(sum(&[(held[0], 1.0), (held[1], 1.0)]), ComparisonOp::Le, 1.0);
        for (asset, [low, high]) in limits.ranges.iter().enumerate() {
            let own = |limit: f64| [(held[asset], 1.0 - limit), (held[1 - asset], -limit)];
            programme.add_constraint(sum(&own(*low)), ComparisonOp::Ge, 0.0);
            programme.add_constraint(sum(&own(*high)), ComparisonOp::Le, 0.0);
        }
        if let Some((before, most)) = &limits.turnover {
            let moved = [0, 1].map(|_| programme.add_var(0.0, (0.0, 2.0)));
            for asset in [0, 1] {
                for sign in [1.0, -1.0] {
                    let own = sign * (1.0 - before[asset]);
                    let left = [(held[asset], own), (held[1 - asset], -sign * before[asset]), (moved[asset], -1.0)];
                    programme.add_constraint(sum(&left), ComparisonOp::Le, 0.0);
                }
            }
            let left = [(moved[0], 1.0), (moved[1], 1.0), (held[0], -most), (held[1], -most)];
            programme.add_constraint(sum(&left), ComparisonOp::Le, 0.0);
        }
        let SolveOutcome::Solution(best) = programme.solve().unwrap() else { unreachable!("no limit is set") };
        let upper = best.objective();
        if upper - lower < 2e-7 {
            return (POWER.inverse(upper), POWER.inverse(lower));
        }
        (shares, price) = (held.map(|unknown| best.var_value(unknown)), best.var_value(gamma));
    }
    panic!("the planes do not meet");
}

#[test]
fn the_value_within_limits_agrees_with_cutting_planes_on_a_grid_of_moves() {
    let mut random = stream(33, "planes", 0, 0);
    let mut bound_by = 0;
    for case in 0..8 {
        let returns = drawn_returns(&mut random, 2, 8);
        let ground = drawn_ground(case, &returns);
        let radius = 0.004 * random.random::<f64>();
        let low = 0.5 * random.random::<f64>();
        let ranges = vec![[low, low + 0.3], [0.0, 1.0]];
        let turnover = (case >= 4).then(|| (vec![low, 1.0 - low], 0.2));
        let limits = Limits { ranges, groups: Vec::new(), turnover };
        let free = step(&returns, &ground, POWER, radius, [0.0, 1.0]);
        let found = free.clone().within(Some(limits.set())).solve(None);
        assert!(gap(&found) < CERTIFIED, "{case}: {found:?}");
        let (upper, lower) = by_cutting_planes(&returns, &ground, radius, &limits);
        // The grid holds fewer laws, so its value is higher, by the square of its step.
        assert!(found.value < upper + 1e-9 && found.bound > lower - 0.02 * BP, "{case}: {lower} {upper} {found:?}");
        bound_by += usize::from(free.solve(None).value > found.value + CERTIFIED);
    }
    assert!(bound_by >= 3, "{bound_by}");
}

#[test]
fn limits_that_do_not_bind_change_no_value() {
    let mut random = stream(34, "slack limits", 0, 0);
    for case in 0..12 {
        let assets = 2 + case % 5;
        let returns = drawn_returns(&mut random, assets, 60);
        let free = step(&returns, &drawn_ground(case, &returns), POWER, 0.003, [0.0, 1.0]);
        let wide = CompositionSet::new(
            vec![[0.0, 1.0]; assets],
            vec![GroupRange { members: vec![0, 1], least: 0.0, most: 1.0 }],
        );
        let (expected, found) = (free.solve(None), free.clone().within(Some(wide)).solve(None));
        assert!((found.value - expected.value).abs() < 0.002 * BP, "{case}: {found:?} {expected:?}");
        assert_eq!(free.clone().within(None).solve(None), expected);
    }
}

#[test]
fn a_turnover_too_small_for_the_limits_comes_as_near_as_it_can() {
    let returns = drawn_returns(&mut stream(35, "turnover", 0, 0), 3, 60);
    let ranges = vec![[0.0, 0.2], [0.0, 1.0], [0.0, 1.0]];
    let holdings = [0.4, 0.0, 0.0];
    let set = CompositionSet::new(ranges, Vec::new()).within_turnover(&holdings, 0.1);
    let found = step(&returns, &GroundMetric::Sup, POWER, 0.002, [0.2, 1.0]).within(Some(set)).solve(None);
    assert!(gap(&found) < CERTIFIED, "{found:?}");
    let total: f64 = found.allocation.iter().sum();
    // From 1 to 0.2 in the first asset, and 0.8 into the others.
    let turnover = 1.0 - found.allocation[0] / total + (found.allocation[1] + found.allocation[2]) / total;
    assert!((turnover - 1.6).abs() < 1e-8 && (found.allocation[0] / total - 0.2).abs() < 1e-8, "{found:?}");
}
