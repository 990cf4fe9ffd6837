//! The one-step problem of several assets: against direct solutions, one asset, and laws of its own ball.

use ballast::control::assets::{AssetsSolution, PortfolioStep, ReturnScenarios};
use ballast::control::policy::advisor::Advisor;
use ballast::control::problem::actions::ActionInterval;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::progress::Watch;
use ballast::control::request::specification::{Specification, UtilitySpecification};
use ballast::control::training::Training;
use ballast::numerics::bridge::Quantile;
use ballast::numerics::bridge::funds::{FundBridges, fund_returns};
use ballast::numerics::machine::streams::stream;
use ballast::numerics::transport::wasserstein::WassersteinBall;
use ballast::numerics::transport::water_filling::{GroundMetric, inverse_volatility};
use microlp::{ComparisonOp, LinearExpr, OptimizationDirection, Problem, SolveOutcome};
use rand::RngExt;
use serde_json::{Value, json};

/// A hundredth of a percent.
const BP: f64 = 1e-4;
const WHOLE: ActionInterval = ActionInterval { lowest: 0.0, highest: 1.0 };

fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn ground(name: &str, returns: &[Vec<f64>]) -> GroundMetric {
    match name {
        "sup" => GroundMetric::Sup,
        _ => GroundMetric::Weighted(inverse_volatility(returns)),
    }
}

fn utility(case: &Value) -> RelativeUtility {
    let risk_aversion = case["risk_aversion"].as_f64().unwrap();
    let floor = case["wealth"].as_f64().unwrap() * (1.0 + case["rate_per_step"].as_f64().unwrap());
    let utility = match case["utility"].as_str().unwrap() {
        "power" => UtilitySpecification::Power { risk_aversion },
        "log" => UtilitySpecification::Log {},
        _ => UtilitySpecification::exponential(risk_aversion),
    };
    RelativeUtility::new(utility, floor)
}

fn certified(solution: &AssetsSolution) {
    let gap = solution.bound - solution.value;
    // The contract: a hundredth of a hundredth of a percent.
    assert!((0.0..0.01 * BP).contains(&gap), "{} hundredths of a percent apart: {solution:?}", gap / BP);
}

#[test]
fn direct_solutions_are_met() {
    let oracle: Value = serde_json::from_str(include_str!("../data/assets.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 26);
    for (index, case) in cases.iter().enumerate() {
        let returns = rows(&case["returns"]);
        let law = ReturnScenarios {
            returns: &returns,
            radius: case["radius"].as_f64().unwrap(),
            floors: vec![case["floor"].as_f64().unwrap_or(f64::NEG_INFINITY); returns[0].len()],
        };
        let ground = ground(case["norm"].as_str().unwrap(), &returns);
        let step = PortfolioStep::new(law, ground, utility(case), case["rate_per_step"].as_f64().unwrap(), WHOLE);
        let solution = step.solve(None);
        certified(&solution);
        let expected = case["log_certainty_equivalent_over_bank"].as_f64().unwrap();
        assert!((solution.value - expected).abs() < 0.02 * BP, "{index}: {} {expected}", solution.value / BP);
        let allocation: Vec<f64> = serde_json::from_value(case["allocation"].clone()).unwrap();
        let apart = solution.allocation.iter().zip(&allocation).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Where the value is flat, another allocation of the same value.
        let worth = step.worth(&allocation).value;
        assert!(
            apart < 0.005 || (solution.value - worth).abs() < 0.002 * BP,
            "{index}: {:?} {allocation:?}",
            solution.allocation
        );
    }
}

/// Log-returns of `assets` with a common part, of deviation 0.05 a period and mean 0.008 to 0.016.
fn sample(assets: usize, dates: usize, seed: usize) -> Vec<Vec<f64>> {
    let mut random = stream(11, "assets", seed, 0);
    let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let row = |_| {
        let common = normal();
        let own = |asset: usize| 0.008 * (1.0 + asset as f64 / assets as f64) + 0.035 * (common + normal());
        (0..assets).map(own).collect()
    };
    (0..dates).map(row).collect()
}

const POWER: RelativeUtility = RelativeUtility::Power { eta: 3.0 };
const UTILITIES: [RelativeUtility; 3] = [POWER, RelativeUtility::Log, RelativeUtility::Exponential { k: 2.0 }];

fn step(
    returns: &[Vec<f64>],
    ground: &GroundMetric,
    utility: RelativeUtility,
    radius: f64,
    floor: f64,
) -> PortfolioStep {
    PortfolioStep::new(
        ReturnScenarios { returns, radius, floors: vec![floor; returns[0].len()] },
        ground.clone(),
        utility,
        0.002,
        WHOLE,
    )
}

fn without_floor(returns: &[Vec<f64>], ground: &GroundMetric, utility: RelativeUtility, radius: f64) -> PortfolioStep {
    step(returns, ground, utility, radius, f64::NEG_INFINITY)
}

#[test]
fn identical_columns_are_one_asset() {
    let oracle: Value = serde_json::from_str(include_str!("../data/last_step.json")).unwrap();
    let mut checked = 0;
    for case in oracle["cases"].as_array().unwrap() {
        let history: Vec<f64> = serde_json::from_value(case["history"].clone()).unwrap();
        for assets in [1, 3] {
            let returns: Vec<Vec<f64>> = history.iter().map(|z| vec![*z; assets]).collect();
            let even = GroundMetric::Weighted(vec![1.0 / assets as f64; assets]);
            for ground in [GroundMetric::Sup, even] {
                let radius = case["radius"].as_f64().unwrap();
                let law =
                    ReturnScenarios { returns: &returns, radius, floors: vec![f64::NEG_INFINITY; returns[0].len()] };
                let rate = case["rate_per_step"].as_f64().unwrap();
                let step = PortfolioStep::new(law, ground, utility(case), rate, WHOLE);
                let solution = step.solve(None);
                certified(&solution);
                let bank = case["wealth"].as_f64().unwrap() * (1.0 + rate);
                let expected = (case["certainty_equivalent"].as_f64().unwrap() / bank).ln();
                // The oracle states 1e-7.
                assert!((solution.value - expected).abs() < 0.02 * BP, "{case}: {solution:?}");
                let total: f64 = solution.allocation.iter().sum();
                let share = case["allocation"].as_f64().unwrap();
                let flat =
                    || (step.worth(&vec![share / assets as f64; assets]).value - solution.value).abs() < 0.002 * BP;
                assert!((total - share).abs() < 0.005 || flat(), "{case}: {solution:?}");
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 72 * 4);
}

/// The law of a static framework is the same in every period, and under power and log utility nothing else of the past counts: with
/// T - t periods left the policy of the best fund promises T - t times what one step gains.
#[test]
fn a_static_policy_promises_the_gain_of_one_step_for_every_period_left() {
    const HORIZON: usize = 6;
    let returns = sample(3, 60, 4);
    for (utility, relative) in
        [(json!({ "kind": "power", "risk_aversion": 3.0 }), POWER), (json!({ "kind": "log" }), RelativeUtility::Log)]
    {
        let solution = without_floor(&returns, &GroundMetric::Sup, relative, 0.003).solve(None);
        certified(&solution);
        let total: f64 = solution.allocation.iter().sum();
        assert!(solution.value > BP && total < 1.0, "{solution:?}");
        let fund: Vec<f64> = solution.allocation.iter().map(|share| share / total).collect();
        let specification: Specification = serde_json::from_value(json!({ "problem": { "framework": "static",
            "horizon": HORIZON, "rate_per_step": 0.002, "utility": utility, "history": fund_returns(&returns, &fund),
            "radius": { "rule": "fixed", "radius": 0.003 }, "support": { "rule": "none" } } }))
        .unwrap();
        let advisor = Advisor::new(Training::new(&specification).unwrap().run(&Watch::unwatched()).unwrap());
        let lived = [0.03, -0.08, 0.01, 0.0, 0.05, -0.02];
        let promised = advisor.walk(advisor.initial_state(None, None).unwrap(), &lived);
        let promised: Vec<f64> = promised.map(|advice| (advice.certainty_equivalent / advice.floor).ln()).collect();
        assert_eq!(promised.len(), HORIZON);
        for (step, gained) in promised.iter().enumerate() {
            let expected = (HORIZON - step) as f64 * solution.value;
            assert!((gained - expected).abs() < 0.01 * BP, "{step}: {} {}", gained / BP, expected / BP);
        }
    }
}

#[test]
fn the_order_of_assets_and_those_not_held_change_nothing() {
    let returns = sample(4, 40, 1);
    let weights = inverse_volatility(&returns);
    let order = [2, 0, 3, 1];
    let turned = |row: &[f64]| order.map(|asset| row[asset]).to_vec();
    let turned_returns: Vec<Vec<f64>> = returns.iter().map(|row| turned(row)).collect();
    for utility in UTILITIES {
        for (ground, other) in [
            (GroundMetric::Sup, GroundMetric::Sup),
            (GroundMetric::Weighted(weights.clone()), GroundMetric::Weighted(turned(&weights))),
        ] {
            let one = without_floor(&returns, &ground, utility, 0.004).solve(None);
            let two = without_floor(&turned_returns, &other, utility, 0.004).solve(None);
            certified(&one);
            assert!((one.value - two.value).abs() < 0.002 * BP, "{one:?} {two:?}");
            let apart = |(a, b): (&f64, &f64)| (a - b).abs() < 0.005;
            assert!(turned(&one.allocation).iter().zip(&two.allocation).all(apart), "{one:?} {two:?}");
        }
        // The first two alone, and with two that are not held.
        let fewer: Vec<Vec<f64>> = returns.iter().map(|row| row[..2].to_vec()).collect();
        for (ground, less) in [
            (GroundMetric::Sup, GroundMetric::Sup),
            (GroundMetric::Weighted(weights.clone()), GroundMetric::Weighted(weights[..2].to_vec())),
        ] {
            let all = without_floor(&returns, &ground, utility, 0.004).worth(&[0.2, 0.3, 0.0, 0.0]);
            let two = without_floor(&fewer, &less, utility, 0.004).worth(&[0.2, 0.3]);
            // Sums of the same numbers.
            assert!(
                (all.value - two.value).abs() < 1e-12 && (all.primal - two.primal).abs() < 1e-12,
                "{all:?} {two:?}"
            );
        }
    }
}

#[test]
fn another_asset_never_lowers_the_value_and_a_wider_ball_never_raises_it() {
    let returns = sample(5, 60, 2);
    let weights = inverse_volatility(&returns);
    for utility in UTILITIES {
        for sup in [true, false] {
            let value = |assets: usize, radius: f64| {
                let some: Vec<Vec<f64>> = returns.iter().map(|row| row[..assets].to_vec()).collect();
                let ground = if sup { GroundMetric::Sup } else { GroundMetric::Weighted(weights[..assets].to_vec()) };
                let solution = without_floor(&some, &ground, utility, radius).solve(None);
                certified(&solution);
                solution.value
            };
            let values: Vec<f64> = (1..=5).map(|assets| value(assets, 0.003)).collect();
            // What a certified value may fall short by.
            assert!(values.windows(2).all(|pair| pair[1] > pair[0] - 0.01 * BP), "{values:?}");
            let values = [0.0, 0.001, 0.004, 0.016].map(|radius| value(5, radius));
            assert!(values.windows(2).all(|pair| pair[1] < pair[0] + 0.01 * BP), "{values:?}");
        }
    }
}

/// The worst expectation over laws on a grid of moves of two assets, up and down: the transport programme, with a mass for each atom
/// and place, solved by a library. The masses of an atom sum to its own, and their distances to the radius at most.
fn by_programme(
    returns: &[Vec<f64>],
    ground: &GroundMetric,
    utility: RelativeUtility,
    radius: f64,
    allocation: &[f64],
) -> f64 {
    let offsets: Vec<f64> = (-20..=600).map(|index| f64::from(index) * 0.005).collect();
    // Distance and utility of every place on the grid, atom by atom; both assets together as finely as one alone.
    let places = |row: &Vec<f64>| {
        let mut places = Vec::new();
        for &first in &offsets {
            for &second in offsets.iter().step_by(4).chain([&first]) {
                let cost = match ground {
                    GroundMetric::Sup => first.abs().max(second.abs()),
                    GroundMetric::Weighted(weights) => weights[0] * first.abs() + weights[1] * second.abs(),
                };
                let growth = |z: f64, down: f64| (z - down).exp() / 1.002 - 1.0;
                let wealth = 1.0 + allocation[0] * growth(row[0], first) + allocation[1] * growth(row[1], second);
                places.push((cost, utility.at(wealth).0));
            }
        }
        places
    };
    let mut programme = Problem::new(OptimizationDirection::Minimize);
    let mut distance = LinearExpr::empty();
    for row in returns {
        let mut mass = LinearExpr::empty();
        for (cost, utility) in places(row) {
            let moved = programme.add_var(utility, (0.0, f64::INFINITY));
            mass.add(moved, 1.0);
            distance.add(moved, cost);
        }
        programme.add_constraint(mass, ComparisonOp::Eq, 1.0 / returns.len() as f64);
    }
    programme.add_constraint(distance, ComparisonOp::Le, radius);
    let SolveOutcome::Solution(worst) = programme.solve().unwrap() else { unreachable!("no limit is set") };
    worst.objective()
}

#[test]
fn what_an_allocation_is_worth_agrees_with_the_transport_programme() {
    let returns = sample(2, 3, 3);
    for (ground, utility) in [
        (GroundMetric::Sup, POWER),
        (GroundMetric::Weighted(vec![0.6, 0.4]), POWER),
        (GroundMetric::Weighted(vec![0.3, 0.7]), RelativeUtility::Log),
        (GroundMetric::Weighted(vec![0.5, 0.5]), RelativeUtility::Exponential { k: 2.0 }),
    ] {
        let worth = without_floor(&returns, &ground, utility, 0.02).worth(&[0.25, 0.3]);
        assert!((worth.primal - worth.value).abs() < 1e-9, "{worth:?}");
        let programme = utility.inverse(by_programme(&returns, &ground, utility, 0.02, &[0.25, 0.3]));
        // The grid holds fewer laws, so that its worst is no worse; it misses the least by the square of its step.
        let above = programme - worth.value;
        assert!(above > -1e-9 && above < 4e-6, "{ground:?} {utility:?}: {programme} {worth:?}");
    }
}

#[test]
fn all_in_is_worth_nothing_to_power_utility_and_the_radius_less_to_log_utility() {
    let returns = sample(2, 20, 6);
    let worth = |utility| without_floor(&returns, &GroundMetric::Sup, utility, 0.02).worth(&[0.4, 0.6]).value;
    assert_eq!(worth(POWER), f64::NEG_INFINITY);
    let fund = |row: &Vec<f64>| (0.4 * row[0].exp() + 0.6 * row[1].exp()).ln();
    let mean = returns.iter().map(fund).sum::<f64>() / returns.len() as f64;
    // Log utility is a straight line in the fund's log-return: every law that spends the radius is as bad.
    assert!((worth(RelativeUtility::Log) - (mean - 1.002_f64.ln() - 0.02)).abs() < 1e-9);
}

/// Log-returns and risk aversions drawn over what may be asked: an allocation is the best within a hundredth of a basis point, or
/// the answer warns; and no allocation tried is worth more than the bound.
#[test]
fn whatever_the_risk_aversion_the_best_is_found_or_the_answer_warns() {
    let mut warned = Vec::new();
    for case in 0..120 {
        let mut random = stream(17, "risk aversions", case, 0);
        let mut draw = |low: f64, high: f64| low * (high / low).powf(random.random::<f64>());
        let (assets, dates) = (draw(2.0, 8.99) as usize, draw(12.0, 120.0) as usize);
        let (eta, scale) = (draw(2.0, 200.0), draw(0.1, 3.0));
        let returns = sample(assets, dates, 100 + case);
        let ground =
            if case % 2 == 0 { GroundMetric::Sup } else { GroundMetric::Weighted(inverse_volatility(&returns)) };
        let utility =
            if case % 3 == 0 { RelativeUtility::Exponential { k: eta } } else { RelativeUtility::Power { eta } };
        let step = without_floor(&returns, &ground, utility, scale * 0.05 / (dates as f64).sqrt());
        let solution = step.solve(None);
        let gap = solution.bound - solution.value;
        assert!(gap >= 0.0, "{case}: {solution:?}");
        assert_eq!(solution.caution().is_some(), gap > 0.01 * BP, "{case}: {solution:?}");
        if gap > 0.01 * BP {
            warned.push((case, eta, assets, dates, gap / BP));
        }
        // Small shares of all, which is where the best lies at a high risk aversion.
        for share in [0.003, 0.01, 0.03, 0.1, 0.3] {
            let tried = step.worth(&vec![share / assets as f64; assets]);
            assert!(
                tried.value <= solution.value.max(solution.bound) + 1e-9,
                "{case}, {share}: {tried:?} {solution:?}"
            );
        }
    }
    assert!(warned.len() <= 6, "{} of 120: {warned:?}", warned.len());
}

#[test]
fn the_bounds_hold_between_the_bounds_of_the_total_and_with_a_floor() {
    let returns = sample(3, 50, 4);
    let ground = GroundMetric::Weighted(inverse_volatility(&returns));
    let total = ActionInterval { lowest: 0.3, highest: 0.7 };
    for floor in [-0.3, f64::NEG_INFINITY] {
        for utility in UTILITIES {
            let law = ReturnScenarios { returns: &returns, radius: 0.01, floors: vec![floor; 3] };
            let step = PortfolioStep::new(law, ground.clone(), utility, 0.002, total);
            let solution = step.solve(None);
            certified(&solution);
            let sum: f64 = solution.allocation.iter().sum();
            assert!((0.3 - 1e-5..=0.7).contains(&sum), "{solution:?}");
            // No allocation tried is worth more than the bound, and the solution is worth what it says.
            let worth = step.worth(&solution.allocation);
            assert!((worth.value - solution.value).abs() < 0.01 * BP && worth.primal - worth.value < 1e-9, "{worth:?}");
            for tried in [[0.1, 0.1, 0.1], [0.3, 0.2, 0.2], [0.0, 0.0, 0.5], [0.0, 0.35, 0.35], [0.4, 0.0, 0.0]] {
                assert!(step.worth(&tried).primal < solution.bound + 1e-9, "{tried:?} {solution:?}");
            }
            // From a similar step, the same answer.
            let near = step.solve(Some(&solution));
            assert!((near.value - solution.value).abs() < 0.002 * BP, "{near:?} {solution:?}");
        }
    }
}

/// Twenty years of twelve industries at which the adversary's crash of all atoms is about to go at the best price: a search that
/// takes the crash for the small move beside it never closes.
#[test]
fn a_window_at_which_the_crash_comes_and_goes_is_certified() {
    let file = include_str!("../../data/us_industries_monthly.csv");
    let lines = file.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| line.split(',').skip(1).take(12).map(|cell| cell.parse::<f64>().unwrap().ln_1p()).collect();
    let all: Vec<Vec<f64>> = lines.map(row).collect();
    let returns = &all[716 - 240..716];
    let deviation = |asset: usize| {
        let mean = returns.iter().map(|row| row[asset]).sum::<f64>() / 240.0;
        (returns.iter().map(|row| (row[asset] - mean).powi(2)).sum::<f64>() / 240.0).sqrt()
    };
    let radius = 1.3 * (0..12).map(deviation).sum::<f64>() / 12.0 / 240.0_f64.sqrt();
    for ground in [GroundMetric::Weighted(inverse_volatility(returns)), GroundMetric::Sup] {
        let law = ReturnScenarios { returns, radius, floors: vec![f64::NEG_INFINITY; returns[0].len()] };
        let solution = PortfolioStep::new(law, ground, POWER, 0.003, WHOLE).solve(None);
        certified(&solution);
        assert!(solution.value > BP, "{solution:?}");
    }
}

#[test]
fn a_large_radius_at_a_fixed_total_leads_to_inverse_volatilities() {
    let returns: Vec<Vec<f64>> = sample(3, 60, 5).iter().map(|row| vec![0.5 * row[0], row[1], 1.5 * row[2]]).collect();
    let weights = inverse_volatility(&returns);
    let total = ActionInterval { lowest: 0.2, highest: 0.2 };
    let apart = |radius: f64| {
        let law = ReturnScenarios { returns: &returns, radius, floors: vec![f64::NEG_INFINITY; returns[0].len()] };
        let step = PortfolioStep::new(law, GroundMetric::Weighted(weights.clone()), RelativeUtility::Log, 0.002, total);
        let solution = step.solve(None);
        certified(&solution);
        let apart = |(share, weight): (&f64, &f64)| (share / 0.2 - weight).abs();
        solution.allocation.iter().zip(&weights).map(apart).fold(0.0, f64::max)
    };
    let found = [0.0, 0.005, 0.02, 0.06].map(apart);
    assert!(found[0] > 0.3 && found[3] < 0.1 && found[3] < found[2] && found[2] < found[0], "{found:?}");
}

/// A coin of 5.002 % and -4.998 % beyond the bank: Kelly's share is p / b - q / a, worth some 8e-8 in the logarithm.
#[test]
fn a_premium_that_is_just_above_what_is_told_apart_is_taken() {
    let (up, down) = (0.050_02_f64, 0.049_98_f64);
    let returns: Vec<Vec<f64>> = [1.0 + up, 1.0 - down].iter().map(|growth| vec![(1.002 * growth).ln()]).collect();
    let kelly = 0.5 / down - 0.5 / up;
    let best = 0.5 * (kelly * up).ln_1p() + 0.5 * (-kelly * down).ln_1p();
    assert!((7.9e-8..8.1e-8).contains(&best), "{best}");
    let solution = without_floor(&returns, &GroundMetric::Sup, RelativeUtility::Log, 0.0).solve(None);
    // A search ends where its bounds are 1e-8 apart.
    assert!((solution.value - best).abs() < 2e-8 && solution.allocation[0] > 0.0, "{best} {solution:?}");
}

/// At the corners of what may be asked: whatever becomes of a search, what is told is finite, in order, and never less than the bank.
#[test]
fn extremes_are_answered_with_bounds_in_order() {
    let mut held = 0;
    for (assets, dates) in [(2, 2), (2, 9), (30, 12), (7, 40)] {
        let calm = sample(assets, dates, 3);
        let wild: Vec<Vec<f64>> =
            calm.iter().map(|row| row.iter().map(|z| (60.0 * z).clamp(-5.0, 5.0)).collect()).collect();
        let tiny: Vec<Vec<f64>> = calm.iter().map(|row| row.iter().map(|z| 1e-5 * z).collect()).collect();
        for returns in [&calm, &wild, &tiny] {
            for utility in [
                POWER,
                RelativeUtility::Power { eta: 100.0 },
                RelativeUtility::Log,
                RelativeUtility::Exponential { k: 1e3 },
            ] {
                for (radius, floor) in [(0.0, f64::NEG_INFINITY), (10.0, f64::NEG_INFINITY), (1e-9, -5.0), (10.0, -5.0)]
                {
                    for ground in [GroundMetric::Sup, GroundMetric::Weighted(inverse_volatility(returns))] {
                        let solution = step(returns, &ground, utility, radius, floor).solve(None);
                        let total: f64 = solution.allocation.iter().sum();
                        assert!(
                            solution.value >= 0.0 && solution.bound >= solution.value && solution.bound < 6.0,
                            "{solution:?}"
                        );
                        assert!((0.0..=1.0 + 1e-9).contains(&total), "{solution:?}");
                        assert!(
                            solution.allocation.iter().chain(&solution.mean_moves).all(|number| number.is_finite()),
                            "{solution:?}"
                        );
                        held += usize::from(total > 0.01);
                    }
                }
            }
        }
    }
    assert!(held > 50, "{held}");
}

#[test]
fn a_ball_restricted_to_its_sample_has_the_worst_law_of_another_program() {
    // The unit test of SDDP.jl's Wasserstein risk measure: of a payoff, the least is worst.
    let ball = WassersteinBall { support: &[0.3, 0.4, 0.5, 0.6], masses: &[0.2, 0.4, 0.1, 0.3], radius: 0.1 };
    let mut masses = [0.0_f64; 4];
    for moved in ball.worst_law(&[1.2, 1.3, 1.1, 0.6]).moves {
        masses[moved.to] += moved.mass;
    }
    for (found, expected) in masses.iter().zip([1.0 / 6.0, 0.0, 0.0, 5.0 / 6.0]) {
        assert!((found - expected).abs() < 1e-12, "{masses:?}");
    }
}

#[test]
fn the_joint_factor_agrees_with_an_independent_simulation() {
    let oracle: Value = serde_json::from_str(include_str!("../data/slices.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let returns = rows(&case["returns"]);
        let funds: Vec<Vec<f64>> = rows(&case["slices"]);
        let alpha = case["alpha"].as_f64().unwrap();
        let bridges = FundBridges::simulate(&returns, 20_000, 3);
        let check = |found: Quantile, expected: &Value, error: &Value| {
            let allowed = 4.0 * found.standard_error.hypot(error.as_f64().unwrap());
            let expected = expected.as_f64().unwrap();
            assert!((found.value - expected).abs() < allowed + 1e-8, "{found:?} {expected}");
        };
        for (index, fund) in funds.iter().enumerate() {
            check(bridges.quantile(fund, alpha), &case["quantiles"][index], &case["quantile_standard_errors"][index]);
        }
        check(bridges.factor_among(&funds, alpha), &case["joint_factor"], &case["joint_factor_standard_error"]);
        // The search finds more funds than these.
        assert!(bridges.joint_factor(alpha).value > 0.98 * case["joint_factor"].as_f64().unwrap());
    }
}

#[test]
fn the_joint_factor_is_that_of_thousands_of_funds() {
    for (assets, common) in [(2, 0.0), (3, 0.0), (5, 0.0), (12, 0.0), (12, 0.6), (30, 0.0), (30, 0.9)] {
        let mut random = stream(23, "joint factor", 0, assets);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let row = |_| {
            let all = normal();
            (0..assets).map(|_| 0.04 * (f64::sqrt(common) * all + f64::sqrt(1.0 - common) * normal())).collect()
        };
        let returns: Vec<Vec<f64>> = (0..60).map(row).collect();
        let mut random = stream(24, "funds", 0, assets);
        // Even draws among funds of few assets and of many.
        let fund = |index: usize| {
            let shares: Vec<f64> = (0..assets)
                .map(|_| {
                    if random.random::<f64>() < 0.2 + 0.2 * (index % 5) as f64 {
                        -random.random::<f64>().ln()
                    } else {
                        0.0
                    }
                })
                .collect();
            let total: f64 = shares.iter().sum();
            (total > 0.0).then(|| shares.iter().map(|share| share / total).collect::<Vec<f64>>())
        };
        let funds: Vec<Vec<f64>> = (0..5000).filter_map(fund).take(4000).collect();
        let bridges = FundBridges::simulate(&returns, 1000, 3);
        let (found, among) = (bridges.joint_factor(0.1).value, bridges.factor_among(&funds, 0.1).value);
        println!("{assets} assets, correlation {common}: {found:.4}, among 4,000 funds {among:.4}");
        assert!(found > 0.98 * among, "{assets} assets, correlation {common}: {found} {among}");
    }
}

/// If trading costs, a search tries everything that might be better: the holdings, everything sold, the optimum without the
/// cost, ways between them, and many allocations near the one found and far from it. Over laws, norms, costs and holdings drawn.
#[test]
fn holdings_and_a_cost_are_best_by_direct_search() {
    let mut random = stream(5, "trading", 0, 0);
    let (mut kept, mut moved) = (0, 0);
    for case in 0..60 {
        let assets = [2, 3, 5, 8][case % 4];
        let returns = sample(assets, [24, 60, 120][case % 3], case);
        let ground = ground(["sup", "scaled_one"][case / 2 % 2], &returns);
        let utility = [POWER, RelativeUtility::Log, RelativeUtility::Power { eta: 8.0 }][case % 3];
        let radius = 0.02 * random.random::<f64>().powi(2);
        let cost = [0.0005, 0.005, 0.02, 0.1][random.random_range(0..4)];
        let highest = [1.0, 0.6][usize::from(case % 5 == 0)];
        let step = PortfolioStep::new(
            ReturnScenarios { returns: &returns, radius, floors: vec![-0.4; assets] },
            ground,
            utility,
            0.002,
            ActionInterval { lowest: 0.0, highest },
        );
        // Up to all wealth is held, above the highest total too; some assets are not.
        let draws: Vec<f64> = (0..assets).map(|_| (random.random::<f64>() - 0.3).max(0.0)).collect();
        let scale = random.random::<f64>() / draws.iter().sum::<f64>().max(1e-9);
        let holdings: Vec<f64> = draws.iter().map(|draw| draw * scale).collect();
        let found = step.solve_from(&holdings, cost, None);
        certified(&found);
        let turnover = |allocation: &[f64]| -> f64 {
            allocation.iter().zip(&holdings).map(|(share, held)| (share - held).abs()).sum()
        };
        let worth = |allocation: &[f64]| step.worth(allocation).value + (1.0 - cost * turnover(allocation)).ln();
        assert!((worth(&found.allocation) - found.value).abs() < 0.002 * BP, "{case}: {found:?}");
        let free = step.solve(None).allocation;
        let towards = |other: &[f64], part: f64| -> Vec<f64> {
            found.allocation.iter().zip(other).map(|(share, other)| share + part * (other - share)).collect()
        };
        let mut tried: Vec<Vec<f64>> = Vec::new();
        for part in [1e-3, 0.03, 0.3, 1.0] {
            tried.extend([&holdings, &free, &vec![0.0; assets]].map(|other| towards(other, part)));
            for _ in 0..4 {
                let other: Vec<f64> = (0..assets).map(|_| 2.0 * random.random::<f64>() / assets as f64).collect();
                tried.push(towards(&other, part));
            }
            // From one asset into another, or into the bank.
            let (from, to) = (random.random_range(0..assets), random.random_range(0..assets));
            let mut other = found.allocation.clone();
            other[to] += part * other[from];
            other[from] -= part * found.allocation[from];
            tried.push(other);
        }
        for allocation in tried.iter().filter(|allocation| allocation.iter().sum::<f64>() <= highest) {
            assert!(worth(allocation) < found.bound + 1e-9, "{case}: {allocation:?} {found:?} {holdings:?}");
        }
        kept += found.allocation.iter().zip(&holdings).filter(|(share, held)| share == held).count();
        moved += found.allocation.iter().zip(&holdings).filter(|(share, held)| share != held).count();
    }
    // What is held is kept where it is hardly off, to the bit, and changed where it is far.
    assert!(kept > 30 && moved > 30, "{kept} {moved}");
}
