//! Shrunk means of several assets: against skfolio, and by hand.

use ballast::control::request::means::MeansRule;
use ballast::numerics::statistics::shrinkage::ShrunkMeans;
use serde_json::Value;

fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn gross_means(rows: &[Vec<f64>]) -> Vec<f64> {
    let of = |asset: usize| rows.iter().map(|row| row[asset].exp()).sum::<f64>() / rows.len() as f64;
    (0..rows[0].len()).map(of).collect()
}

#[test]
fn bayes_stein_is_that_of_skfolio() {
    let oracle: Value = serde_json::from_str(include_str!("../data/shrunk_means.json")).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let rows = rows(&case["log_returns"]);
        let found = ShrunkMeans::bayes_stein(&rows);
        let means: Vec<f64> = serde_json::from_value(case["means"].clone()).unwrap();
        // Two inversions of a matrix whose condition is below 1e3.
        assert!((found.intensity - case["intensity"].as_f64().unwrap()).abs() < 1e-12, "{found:?}");
        let applied = MeansRule::BayesStein {}.applied(&rows);
        for ((shrunk, expected), mean) in found.shrunk.iter().zip(&means).zip(gross_means(&applied)) {
            assert!((shrunk - 1.0 - expected).abs() < 1e-13, "{shrunk} {expected}");
            assert!((mean - shrunk).abs() < 1e-13, "the returns have the means: {mean} {shrunk}");
        }
    }
}

/// By hand: means 1.02 and 0.98 of gross returns, whose average is 1.
#[test]
fn half_of_the_way_is_the_middle() {
    let rows = [[1.06, 0.97], [0.98, 0.99]].map(|row| row.map(f64::ln).to_vec());
    let found = ShrunkMeans::by(&rows, 0.5);
    for (found, expected) in found.seen.iter().chain(&found.shrunk).zip([1.02, 0.98, 1.01, 0.99]) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
    let moved = MeansRule::Shrunk { intensity: 0.5 }.applied(&rows);
    assert!((moved[0][0] - (1.06_f64 * 1.01 / 1.02).ln()).abs() < 1e-15, "{moved:?}");
    assert!((moved[1][1] - (0.99_f64 * 0.99 / 0.98).ln()).abs() < 1e-15, "{moved:?}");
    let all = MeansRule::Shrunk { intensity: 1.0 }.applied(&rows);
    assert!(gross_means(&all).iter().all(|mean| (mean - 1.0).abs() < 1e-15));
}

#[test]
fn without_shrinkage_every_bit_stays() {
    let oracle: Value = serde_json::from_str(include_str!("../data/shrunk_means.json")).unwrap();
    for case in oracle["cases"].as_array().unwrap() {
        let rows = rows(&case["log_returns"]);
        assert_eq!(*MeansRule::Sample {}.applied(&rows), *rows);
        assert_eq!(*MeansRule::Shrunk { intensity: 0.0 }.applied(&rows), *rows);
    }
}

/// Fewer dates than assets, an asset twice, and one that hardly moves: the means stay between those seen.
#[test]
fn degenerate_records_have_means_too() {
    let wave = |date: usize, pace: f64| 0.004 + 0.03 * (pace * date as f64).sin();
    let row = |date: usize| vec![wave(date, 0.9), wave(date, 0.9), wave(date, 1.7), 1e-6 * wave(date, 2.3)];
    for dates in [2, 5, 6, 7, 200] {
        let rows: Vec<Vec<f64>> = (0..dates).map(row).collect();
        let ShrunkMeans { intensity, seen, shrunk } = ShrunkMeans::bayes_stein(&rows);
        assert!((0.0..=1.0).contains(&intensity) && (intensity == 1.0) == (dates <= 6), "{dates}: {intensity}");
        assert!((shrunk[0] - shrunk[1]).abs() < 1e-12);
        let (low, high) =
            (seen.iter().copied().fold(f64::INFINITY, f64::min), seen.iter().copied().fold(0.0, f64::max));
        assert!(shrunk.iter().all(|mean| (low - 0.05..=high + 0.05).contains(mean)), "{dates}: {shrunk:?}");
    }
}
