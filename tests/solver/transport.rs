//! The exact inner solve against a linear-programming solver.

use ballast::numerics::transport::wasserstein::WassersteinBall;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn worst_expectation_agrees_with_the_transport_programme() {
    let oracle: Value = serde_json::from_str(include_str!("../data/transport.json")).unwrap();
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

#[test]
fn the_dual_is_a_lower_bound_at_every_multiplier_and_tight_at_one() {
    let support: Vec<f64> = (-20..=10).map(|k| 0.01 * f64::from(k)).collect();
    let mut masses = vec![0.0; support.len()];
    for atom in [12, 17, 20, 24, 29] {
        masses[atom] = 0.2;
    }
    let payoff: Vec<f64> = support.iter().map(|z: &f64| -(-9.0 * z).exp()).collect();
    let ball = WassersteinBall { support: &support, masses: &masses, radius: 0.013 };
    let worst = ball.worst_law(&payoff);
    let gap = |multiplier: f64| worst.expectation - ball.dual(&payoff, multiplier);
    assert!(worst.multiplier > 1.0 && gap(worst.multiplier).abs() < 1e-12, "{}", gap(worst.multiplier));
    // A poor multiplier shows as a gap, the wider the poorer.
    for factors in [[1.0, 1.2, 2.0, 4.0], [1.0, 0.8, 0.5, 0.0]] {
        let gaps = factors.map(|factor| gap(factor * worst.multiplier));
        assert!(gaps.windows(2).all(|pair| pair[1] > pair[0] + 1e-4), "{gaps:?}");
    }
}
