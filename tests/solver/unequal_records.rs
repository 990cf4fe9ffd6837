//! Records of several assets that begin at different dates: the estimate of what was not seen, and what it costs.

use crate::support::values::number;
use ballast::control::request::asset_history::AssetHistory;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::fund::GroundNorm;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::transport::water_filling::{GroundMetric, inverse_volatility};
use ballast::service::advice::advise_assets::AdviseAssets;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::{Value, json};

/// Draws log-returns of assets that share a market, and takes the first `missing` dates of each away.
fn drawn(seed: u64, dates: usize, missing: &[usize]) -> Vec<Vec<Option<f64>>> {
    let mut random = stream(seed, "unequal", 0, 0);
    let row = |date: usize| {
        let market: f64 = random.sample(StandardNormal);
        let of = |(asset, missing): (usize, &usize)| {
            let own: f64 = random.sample(StandardNormal);
            let z = 0.004 + 0.03 * market * (1.0 + 0.3 * asset as f64) + 0.02 * own;
            (date >= *missing).then_some(z)
        };
        missing.iter().enumerate().map(of).collect()
    };
    (0..dates).map(row).collect()
}

fn moments(rows: &[Vec<f64>]) -> (DVector<f64>, DMatrix<f64>) {
    let (count, width) = (rows.len() as f64, rows[0].len());
    let mean = DVector::from_fn(width, |i, _| rows.iter().map(|row| row[i]).sum::<f64>() / count);
    let covariance = DMatrix::from_fn(width, width, |i, j| {
        rows.iter().map(|row| (row[i] - mean[i]) * (row[j] - mean[j])).sum::<f64>() / count
    });
    (mean, covariance)
}

/// The maximum-likelihood estimate of a normal law from returns with gaps, by expectation and maximisation.
fn most_likely(given: &[Vec<Option<f64>>]) -> (DVector<f64>, DMatrix<f64>) {
    let width = given[0].len();
    let (mut mean, mut covariance) = (DVector::zeros(width), DMatrix::identity(width, width) * 1e-3);
    for _ in 0..3000 {
        let (mut sum, mut squares) = (DVector::zeros(width), DMatrix::zeros(width, width));
        for row in given {
            let (seen, unseen): (Vec<usize>, Vec<usize>) = (0..width).partition(|i| row[*i].is_some());
            let part = |rows: &[usize], columns: &[usize]| {
                DMatrix::from_fn(rows.len(), columns.len(), |i, j| covariance[(rows[i], columns[j])])
            };
            let slopes = part(&unseen, &seen) * part(&seen, &seen).try_inverse().unwrap();
            let away = DVector::from_fn(seen.len(), |i, _| row[seen[i]].unwrap() - mean[seen[i]]);
            let (expected, left) = (&slopes * away, part(&unseen, &unseen) - &slopes * part(&seen, &unseen));
            let mut full = DVector::from_fn(width, |i, _| row[i].unwrap_or(mean[i]));
            unseen.iter().enumerate().for_each(|(place, i)| full[*i] += expected[place]);
            squares += &full * full.transpose();
            for (a, i) in unseen.iter().enumerate() {
                unseen.iter().enumerate().for_each(|(b, j)| squares[(*i, *j)] += left[(a, b)]);
            }
            sum += full;
        }
        mean = sum / given.len() as f64;
        covariance = squares / given.len() as f64 - &mean * mean.transpose();
    }
    (mean, covariance)
}

/// Means are those of the likeliest normal law. Covariances differ by the sampling of residuals alone: over 20 records of 120
/// estimated returns each, by less than a twentieth on average.
#[test]
fn what_was_not_seen_is_estimated_as_by_maximum_likelihood() {
    let mut apart = Vec::new();
    for seed in 0..20 {
        let given = drawn(seed, 240, &[0, 120, 0, 150, 120]);
        let (mean, covariance) = moments(&AssetHistory::new(&given));
        let (likeliest, likely_covariance) = most_likely(&given);
        // Both are solved to rounding; 3,000 rounds leave less than 1e-10.
        assert!((&mean - &likeliest).amax() < 1e-9, "{seed}: {mean} {likeliest}");
        for asset in [1, 3, 4] {
            apart.push(covariance[(asset, asset)] / likely_covariance[(asset, asset)] - 1.0);
        }
        let correlation = |of: &DMatrix<f64>| of[(1, 4)] / (of[(1, 1)] * of[(4, 4)]).sqrt();
        assert!((correlation(&covariance) - correlation(&likely_covariance)).abs() < 0.05, "{seed}");
    }
    let mean = apart.iter().sum::<f64>() / apart.len() as f64;
    let widest = apart.iter().fold(0.0, |widest: f64, one| widest.max(one.abs()));
    assert!(mean.abs() < 0.05 && widest < 0.25, "{mean} {widest}");
}

/// By hand: with one older asset that earned 1 % less on average before the younger began, and a slope of 2, the younger is
/// estimated to have earned 2 % less.
#[test]
fn a_younger_asset_follows_the_older_one_back() {
    let old: Vec<f64> = (0..24).map(|date| 0.01 * f64::from(date % 2) - if date < 12 { 0.01 } else { 0.0 }).collect();
    let given: Vec<Vec<Option<f64>>> =
        (0..24).map(|date| vec![Some(old[date]), (date >= 12).then(|| 2.0 * old[date] + 0.003)]).collect();
    let returns = AssetHistory::new(&given);
    for (row, old) in returns.iter().zip(&old) {
        assert!((row[1] - 2.0 * old - 0.003).abs() < 1e-14, "{row:?}");
    }
    assert_eq!(returns.missing(), [0, 12]);
}

/// Returns as they are given are found in the document again, and values that were estimated are none of them.
#[test]
fn a_document_has_null_for_what_was_not_seen() {
    for (seed, missing) in [(1, [0, 40, 15]), (2, [30, 0, 30]), (3, [0, 0, 0])] {
        let given = drawn(seed, 60, &missing);
        let returns = AssetHistory::new(&given);
        let document = serde_json::to_value(&returns).unwrap();
        assert_eq!(document, serde_json::to_value(&given).unwrap());
        assert_eq!(serde_json::from_value::<AssetHistory>(document).unwrap(), returns);
        assert!(returns.iter().flatten().all(|z| z.is_finite()));
        // A part of it is what those dates alone would be.
        let part = AssetHistory::new(&given[10..]);
        assert_eq!(returns.of(10..60), part);
    }
}

fn asked(given: &impl serde::Serialize) -> Value {
    json!({
        "problem": {
            "assets": ["old", "young", "whole"], "history": given, "rate_per_step": 0.001, "caution": "paper",
            "radius": { "rule": "bridge", "alpha": 0.5, "scale": 0.3 }
        }
    })
}

fn advised(given: &impl serde::Serialize) -> Value {
    let question: AdviseAssets = serde_json::from_value(asked(given)).unwrap();
    serde_json::to_value(question.answer().unwrap()).unwrap()
}

/// The weight of an asset in the cost of a move falls with the root of the share of returns that are its own. So the ball
/// is larger than if every estimate had been seen: the advice is worth no more, and holds less of the young asset where
/// that counts.
#[test]
fn a_short_record_is_moved_more_cheaply_and_held_less() {
    let mut less = 0;
    for seed in 0..40 {
        let given = drawn(100 + seed, 120, &[0, 90, 0]);
        let unequal = AssetHistory::new(&given);
        let seen: AssetHistory = unequal.to_vec().into();
        let GroundMetric::Weighted(weights) = GroundNorm::ScaledOne.at(&unequal, &unequal) else { unreachable!() };
        let plain = inverse_volatility(&unequal);
        assert_eq!(weights, [plain[0], 0.5 * plain[1], plain[2]]);
        let [known, unknown] = [advised(&seen), advised(&unequal)];
        let young = |advice: &Value| number(&advice["allocation"]["young"]);
        // No more than the bound that is certified for the smaller ball.
        assert!(number(&unknown["certainty_equivalent"]) <= number(&known["bound"]), "{seed}: {unknown} {known}");
        less += usize::from(young(&unknown) < young(&known) - 1e-3);
        // 0.01 bp.
        let [value, bound] = ["certainty_equivalent", "bound"].map(|field| number(&unknown[field]));
        assert!((bound / value).ln() < 1e-6, "{seed}: {unknown}");
    }
    assert!(less >= 10, "{less} of 40 hold less");
}

#[test]
fn a_young_asset_is_named_in_a_warning() {
    let advice = advised(&drawn(7, 60, &[0, 40, 0]));
    let warning = advice["warnings"].as_array().unwrap().iter().find(|one| one["code"] == "estimated_returns").unwrap();
    assert!(warning["message"].as_str().unwrap().contains("20 of 60 returns of young"), "{warning}");
    assert!(!advised(&drawn(7, 60, &[0, 0, 0]))["warnings"].to_string().contains("estimated_returns"));
}

#[test]
fn what_cannot_be_estimated_is_refused_by_name() {
    let refused = |change: &dyn Fn(&mut Value)| {
        let mut question = asked(&drawn(9, 60, &[0, 20, 0]));
        change(&mut question["problem"]);
        let problem: AssetsProblem = serde_json::from_value(question["problem"].clone()).unwrap();
        let error = problem.fund(1).unwrap_err();
        format!("{}: {}: {}", error.field, error.value, error.rule)
    };
    for (change, expected) in [
        (
            (&|of: &mut Value| of["history"][30][1] = Value::Null) as &dyn Fn(&mut Value),
            "problem.history[30][1]: null: must be a number",
        ),
        (
            &|of: &mut Value| of["history"][0] = json!([null, null, null]),
            "problem.history[0]: null for every asset: must have",
        ),
        (
            &|of: &mut Value| of["support"] = json!({ "rule": "between", "min": -1, "max": 1 }),
            "problem.support.rule: between: must not",
        ),
        (&|of: &mut Value| of["history"][3] = json!([0.1, null]), "problem.history[3]: 2 values: must have one"),
    ] {
        let found = refused(change);
        assert!(found.starts_with(expected), "{found}");
    }
    let rows = AssetHistory::new(&drawn(9, 60, &[0, 20, 0])).to_vec();
    let error = AssetHistory::filled(rows, vec![0, 1000, 0]).check("history", &[]).unwrap_err();
    assert_eq!(error.value, "0 returns of asset 2", "{error:?}");
    let few = refused(&|of| {
        (20..52).for_each(|date| of["history"][date][1] = Value::Null);
    });
    assert!(few.starts_with("problem.history: 8 returns of young: must have at least 12 returns of young"), "{few}");
}
