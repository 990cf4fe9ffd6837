//! The exact inner solve against a linear-programming solver.

use ballast::numerics::wasserstein::WassersteinBall;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn worst_expectation_agrees_with_the_transport_programme() {
    let oracle: Value = serde_json::from_str(include_str!("data/transport.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let (atoms, support, payoff) = (numbers(&case["atoms"]), numbers(&case["support"]), numbers(&case["payoff"]));
        let mut masses = vec![0.0; support.len()];
        for atom in &atoms {
            let index = support.iter().position(|point| (point - atom).abs() < 1e-12).unwrap();
            masses[index] += 1.0 / atoms.len() as f64;
        }
        let solutions = case["solutions"].as_array().unwrap();
        assert_eq!(solutions.len(), 6);
        for solution in solutions {
            let radius = solution["radius"].as_f64().unwrap();
            let expected = solution["worst_expectation"].as_f64().unwrap();
            let worst = WassersteinBall { support: &support, masses: &masses, radius }.worst_law(&payoff);
            // HiGHS solves to a feasibility tolerance; the oracle states 1e-9.
            assert!((worst.expectation - expected).abs() < 1e-9, "radius {radius}: {} {expected}", worst.expectation);
            assert!((worst.dual - expected).abs() < 1e-9, "radius {radius}: dual {} {expected}", worst.dual);
        }
    }
}
