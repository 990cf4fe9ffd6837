//! Levels of caution against plain simulation with the robust step itself.

use ballast::control::cache::Cache;
use ballast::control::caution::{AllocationCurve, OnePeriodInvestor};
use ballast::control::policy::one_period::OnePeriod;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{ProblemSpecification, Specification, UtilitySpecification};
use ballast::control::request::support::Support;
use ballast::control::uncertainty::centre::Centring;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;

use crate::support::policies::advisor;

/// Log-returns of `count` periods.
fn drawn(seed: usize, count: usize, mean: f64, deviation: f64) -> Vec<f64> {
    let mut random = stream(3, "caution test", seed, 0);
    let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    (0..count).map(|_| mean + deviation * normal()).collect()
}

fn advised(problem: ProblemSpecification) -> f64 {
    let specification = Specification::of(problem, 1).completed().unwrap();
    OnePeriod::new(&specification, Cache::default()).advise(0.0).unwrap().0.allocation
}

/// The robust step is certified by duality, and shares no line with the curve.
#[test]
fn the_curve_is_the_advice_of_the_robust_step_at_every_radius() {
    let utilities = [
        UtilitySpecification::Log {},
        UtilitySpecification::Power { risk_aversion: 1.5 },
        UtilitySpecification::Power { risk_aversion: 3.0 },
        UtilitySpecification::Power { risk_aversion: 8.0 },
        UtilitySpecification::exponential(0.05),
    ];
    let supports = [Support::default(), Support::None {}, Support::WorstSeen { factor: 1.0 }];
    let mut inside = 0;
    for (index, utility) in utilities.into_iter().enumerate() {
        for (other, support) in supports.into_iter().enumerate() {
            let seed = 10 * index + other;
            let highest = [1.0, 0.7][seed % 2];
            let history = drawn(seed, 30 + 25 * index, 0.004 + 0.004 * other as f64, 0.03 + 0.01 * index as f64);
            let problem = ProblemSpecification {
                horizon: 1,
                utility,
                action_interval: [0.0, highest],
                support: Some(support),
                ..ProblemSpecification::of(history.clone(), 0.002)
            };
            let centre = Centring::of(&problem).centre(&EmpiricalDistribution::new(&history));
            let utility = RelativeUtility::new(utility, 100.0 * 1.002);
            let curve = AllocationCurve::of(&centre, OnePeriodInvestor { bank: 1.002, utility, highest, support });
            for radius in [0.0, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016] {
                let exact =
                    advised(ProblemSpecification { radius: Some(RadiusRule::Fixed { radius }), ..problem.clone() });
                let read = curve.at(radius);
                inside += usize::from(exact > 0.01 && exact < highest - 0.01);
                // Half of a twenty-fourth of the interval: between two allocations of which the radius is known it is linear.
                assert!((read - exact).abs() < 0.021, "{utility:?} {support:?} {highest} {radius}: {read} {exact}");
            }
        }
    }
    assert!(inside > 30, "{inside}");
}

/// Nothing is held where the least mean among the laws of the ball pays no more than the bank, and only there: the slope of the robust
/// step at 0, by another sum.
#[test]
fn nothing_is_held_where_no_premium_is_left() {
    let mut nothing = 0;
    for seed in 0..60 {
        let history = drawn(seed, 12 + 3 * seed, 0.006, 0.04);
        let support = [None, Some(Support::None {})][seed % 2];
        let problem = ProblemSpecification {
            horizon: 1,
            support,
            radius: Some(RadiusRule::scaled_bridge(0.1, 0.02 * seed as f64)),
            ..ProblemSpecification::of(history, 0.002)
        };
        let specification = Specification::of(problem, 1).completed().unwrap();
        let investor = OnePeriod::new(&specification, Cache::default());
        let (advice, _) = investor.advise(0.0).unwrap();
        let Some(why) = investor.why_nothing(0.0, &advice).unwrap() else {
            assert!(advice.allocation > 0.0);
            let advisor = advisor(serde_json::to_value(&specification).unwrap());
            let left = advisor.laws().worst_mean(&advisor.initial_state(None, None).unwrap().law) - 1.002;
            assert!(left > 0.0, "{seed}: {} held, {left} left", advice.allocation);
            continue;
        };
        nothing += 1;
        // To rounding.
        assert!(why.premium_left.unwrap() < 1e-12, "{seed}: {why:?}");
        let half = ProblemSpecification {
            radius: Some(specification.problem.radius_rule().scaled(0.5)),
            ..specification.problem
        };
        assert_eq!(why.at_half_the_caution, Some(advised(half)));
    }
    assert!((15..45).contains(&nothing), "{nothing}");
}

/// Shares of the radius that are simulated.
const SCALES: [f64; 12] = [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0];
const RECORDS: usize = 150;

/// Losses of every record in each of three worlds at each share: records drawn by blocks, each solved by the robust step, scored by a
/// sum over the world's returns.
fn simulated(history: &[f64], rate: f64, risk_aversion: f64) -> Vec<Vec<[f64; 12]>> {
    let count = history.len() as f64;
    let mean = history.iter().map(|z| z.exp() - 1.0).sum::<f64>() / count;
    let variance = history.iter().map(|z| (z.exp() - 1.0 - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let whole = (mean - rate).max(0.0) + (variance / count).sqrt();
    let utility = UtilitySpecification::Power { risk_aversion };
    let world = |part: f64| {
        let shift = ((1.0 + rate + part * whole) / (1.0 + mean)).ln();
        let worth = |allocation: f64| {
            let term = |z: &f64| {
                let wealth = 1.0 - allocation + allocation * (z + shift).exp() / (1.0 + rate);
                wealth.powf(1.0 - risk_aversion)
            };
            (history.iter().map(term).sum::<f64>() / count).ln() / (1.0 - risk_aversion)
        };
        let best = (0..=1000).map(|part| worth(f64::from(part) / 1000.0)).fold(f64::NEG_INFINITY, f64::max);
        let record = |index: usize| {
            let mut random = stream(77, "plain blocks", (10.0 * part) as usize, index);
            let mut drawn = Vec::new();
            while drawn.len() < history.len() {
                let start = random.random_range(0..history.len());
                drawn.extend((start..start + 12).map(|place| history[place % history.len()] + shift));
            }
            drawn.truncate(history.len());
            SCALES.map(|scale| {
                let problem = ProblemSpecification {
                    horizon: 1,
                    utility,
                    support: Some(Support::default()),
                    radius: Some(RadiusRule::scaled_bridge(0.1, scale)),
                    ..ProblemSpecification::of(drawn.clone(), rate)
                };
                best - worth(advised(problem))
            })
        };
        (0..RECORDS).map(record).collect()
    };
    [0.0, 0.5, 1.0].map(world).into()
}

/// The level has the least worst regret of an independent simulation, within its error: paired by record, three standard errors.
#[test]
fn a_level_has_the_least_worst_regret_of_a_plain_simulation() {
    for (seed, count, mean, deviation) in [(1, 60, 0.008, 0.04), (2, 120, 0.004, 0.05), (3, 240, 0.009, 0.045)] {
        let history = drawn(seed, count, mean, deviation);
        let problem = ProblemSpecification {
            support: Some(Support::default()),
            ..ProblemSpecification::of(history.clone(), 0.002)
        };
        let specification = Specification::of(problem, 1).completed().unwrap();
        let levels = specification.levels(&Cache::default());
        let losses = simulated(&history, 0.002, 3.0);
        // Linear between the shares simulated.
        let at = |losses: &[f64; 12], scale: f64| {
            let above = SCALES.iter().position(|other| *other >= scale).unwrap().max(1);
            let part = (scale - SCALES[above - 1]) / (SCALES[above] - SCALES[above - 1]);
            losses[above - 1] + part * (losses[above] - losses[above - 1])
        };
        let mean = |world: usize, scale: f64| {
            losses[world].iter().map(|losses| at(losses, scale)).sum::<f64>() / RECORDS as f64
        };
        let best = |world: usize| {
            SCALES.into_iter().min_by(|one, other| mean(world, *one).total_cmp(&mean(world, *other))).unwrap()
        };
        // The regret of a share in a world, and its standard error; the records are the same at all shares.
        let regret = |world: usize, scale: f64| {
            let apart: Vec<f64> =
                losses[world].iter().map(|losses| at(losses, scale) - at(losses, best(world))).collect();
            let mean = apart.iter().sum::<f64>() / RECORDS as f64;
            let square = apart.iter().map(|apart| (apart - mean).powi(2)).sum::<f64>();
            (mean, square.sqrt() / RECORDS as f64)
        };
        for (level, weights) in
            [(levels.bold, [1.0, 1.0, 2.0]), (levels.balanced, [1.0; 3]), (levels.cautious, [2.0, 1.0, 1.0])]
        {
            let worst = |scale: f64| {
                let weighed = |world: usize| {
                    let (mean, error) = regret(world, scale);
                    (weights[world] * mean, weights[world] * error)
                };
                (0..3).map(weighed).max_by(|one, other| one.0.total_cmp(&other.0)).unwrap()
            };
            let (found, error) = worst(level.scale);
            let least = SCALES.into_iter().map(|scale| worst(scale).0).fold(f64::INFINITY, f64::min);
            assert!(found < least + 3.0 * error, "{count}: {level:?}: {found} {error} {least}");
            for world in 0..3 {
                // Both are simulated: one of them of twice as many records. A tenth of a basis point is what some tails weigh.
                let (mean, error) = regret(world, level.scale);
                let apart = (level.regrets[world] - mean).abs();
                assert!(apart < 4.0 * error + 1e-5, "{count}: {level:?} in {world}: {mean} {error}");
            }
        }
        // What each costs is in the order of their caution.
        assert!(levels.bold.scale <= levels.balanced.scale && levels.balanced.scale <= levels.cautious.scale);
        assert_eq!(specification.levels(&Cache::new(1 << 30)), levels);
    }
}

/// Drawn over what is legal: few and heavy-tailed returns, banks that take and pay, any risk aversion, every support, radii from next
/// to none to a whole deviation.
#[test]
fn the_curve_is_the_advice_on_problems_drawn_at_random() {
    let (mut tried, mut further) = (0, 0);
    for index in 0..1500_usize {
        let mut random = stream(9, "random problems", index, 0);
        let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let count = uniform(2.0, 90.0) as usize + 1;
        let deviation = uniform(0.002_f64.ln(), 0.5_f64.ln()).exp();
        let mean = deviation * uniform(-0.3, 0.8);
        let history: Vec<f64> = (0..count)
            .map(|_| {
                let normal = (0..12).map(|_| uniform(0.0, 1.0)).sum::<f64>() - 6.0;
                let heavy = if uniform(0.0, 1.0) < 0.05 { 6.0 } else { 1.0 };
                (mean + deviation * normal * heavy).clamp(-4.9, 4.9)
            })
            .collect();
        let utility = match index % 3 {
            0 => UtilitySpecification::Log {},
            1 => UtilitySpecification::Power { risk_aversion: uniform(1.05_f64.ln(), 100_f64.ln()).exp() },
            _ => UtilitySpecification::exponential(uniform(0.01_f64.ln(), 100_f64.ln()).exp() / 100.0),
        };
        let support =
            [Support::default(), Support::None {}, Support::WorstSeen { factor: uniform(1.0, 10.0) }][index / 3 % 3];
        let (highest, rate) = (uniform(0.05, 1.0), uniform(-0.02, 0.05));
        let highest = if index % 2 == 0 { 1.0 } else { highest };
        let problem = ProblemSpecification {
            horizon: 1,
            utility,
            action_interval: [0.0, highest],
            support: Some(support),
            ..ProblemSpecification::of(history.clone(), rate)
        };
        // A deviation or a risk aversion that no request may have.
        if Specification::of(problem.clone(), 1).completed().is_err() {
            continue;
        }
        let centre = Centring::of(&problem).centre(&EmpiricalDistribution::new(&history));
        let relative = RelativeUtility::new(utility, 100.0 * (1.0 + rate));
        let curve =
            AllocationCurve::of(&centre, OnePeriodInvestor { bank: 1.0 + rate, utility: relative, highest, support });
        let radius = deviation * uniform(0.003_f64.ln(), 1.0_f64.ln()).exp();
        let exact = advised(ProblemSpecification { radius: Some(RadiusRule::Fixed { radius }), ..problem.clone() });
        let read = curve.at(radius);
        let off = (read - exact).abs() / highest;
        // Of the highest: a twenty-fourth lies between two allocations of which the radius is known.
        assert!(off < 1.0 / 24.0, "{index} {problem:?} {radius}: {read} {exact}");
        tried += 1;
        further += usize::from(off > 0.5 / 24.0);
    }
    assert!(tried > 1400 && 100 * further < tried, "{further} of {tried}");
}
