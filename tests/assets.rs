//! The one-step problem of several assets: against direct solutions, one asset, and laws of its own ball.

use ballast::control::assets::{AssetsLaw, AssetsSolution, AssetsStep};
use ballast::control::problem::actions::ActionInterval;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::specification::UtilitySpecification;
use ballast::numerics::levelling::{Ground, inverse_volatility};
use serde_json::Value;

/// A hundredth of a percent.
const BP: f64 = 1e-4;
const WHOLE: ActionInterval = ActionInterval { lowest: 0.0, highest: 1.0 };

fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn ground(name: &str, returns: &[Vec<f64>]) -> Ground {
    match name {
        "sup" => Ground::Sup,
        _ => Ground::Weighted(inverse_volatility(returns)),
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
    let oracle: Value = serde_json::from_str(include_str!("data/assets.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 26);
    for (index, case) in cases.iter().enumerate() {
        let returns = rows(&case["returns"]);
        let law = AssetsLaw {
            returns: &returns,
            radius: case["radius"].as_f64().unwrap(),
            floor: case["floor"].as_f64().unwrap_or(f64::NEG_INFINITY),
        };
        let ground = ground(case["norm"].as_str().unwrap(), &returns);
        let step = AssetsStep::new(law, ground, utility(case), case["rate_per_step"].as_f64().unwrap(), WHOLE);
        let solution = step.solve(None);
        certified(&solution);
        let expected = case["log_certainty_equivalent_over_bank"].as_f64().unwrap();
        assert!((solution.value - expected).abs() < 0.02 * BP, "{index}: {} {expected}", solution.value / BP);
        let allocation: Vec<f64> = serde_json::from_value(case["allocation"].clone()).unwrap();
        let apart = solution.allocation.iter().zip(&allocation).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!(
            "{index} {} evaluations, {:.5} bp, {apart:.4} apart",
            solution.evaluations,
            (solution.value - expected) / BP
        );
        // Where the value is flat, another allocation of the same value.
        let worth = step.worth(&allocation).value;
        assert!(
            apart < 0.005 || (solution.value - worth).abs() < 0.002 * BP,
            "{index}: {:?} {allocation:?}",
            solution.allocation
        );
    }
}
