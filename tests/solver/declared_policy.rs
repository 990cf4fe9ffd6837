//! Decisions of declared problems after their first period, and when they are a guess.

use std::collections::BTreeMap;

use ballast::control::cache::Cache;
use ballast::control::policy::declared::{DeclaredAdvisor, DeclaredPolicy};
use ballast::control::progress::Watch;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use serde_json::{Value, json};

use crate::declared::{action, example, solved};

fn advisor(request: &Value) -> DeclaredAdvisor {
    let declared = serde_json::from_value(request.clone()).unwrap();
    let policy = DeclaredPolicy::train(&declared, &Watch::unwatched()).unwrap();
    // Through its document, as it is stored.
    let document = serde_json::to_vec(&policy).unwrap();
    serde_json::from_slice::<DeclaredPolicy>(&document).unwrap().prepared(Cache::default()).unwrap()
}

fn stock(horizon: usize, count: usize, framework: &str) -> Value {
    let mut request = example("stock");
    request["problem"]["horizon"] = json!(horizon);
    request["problem"]["framework"] = json!(framework);
    request["design"]["count"] = json!(count);
    request
}

fn named(stock: f64) -> BTreeMap<String, f64> {
    BTreeMap::from([("stock".to_owned(), stock)])
}

/// Each period of a policy is the first of the shorter problem that begins there, up to the error of both surrogates.
#[test]
fn a_later_period_is_the_first_of_the_problem_that_is_left() {
    let history = example("stock")["problem"]["history"].clone();
    for (framework, learns) in [("adaptive", true), ("static", false)] {
        let request = stock(4, 100, framework);
        let advisor = advisor(&request);
        for (period, left, noises) in
            [(1, 4.0, vec![]), (2, 9.0, vec![21.0]), (3, 0.5, vec![17.0, 24.0]), (4, 30.0, vec![9.0, 30.0, 22.0])]
        {
            let found = advisor.decide(period, Some(&named(left)), &noises).unwrap();
            let mut rest = stock(5 - period, 100, framework);
            rest["problem"]["states"]["stock"]["start"] = json!(left);
            // The radius of a static set is that of its own record, so only the learning sets have the same.
            if learns {
                let seen: Vec<f64> =
                    serde_json::from_value::<Vec<f64>>(history.clone()).unwrap().into_iter().chain(noises).collect();
                rest["problem"]["history"] = json!(seen);
            }
            let expected = solved(&rest).unwrap();
            let scale = expected.value.abs().max(1.0);
            assert!(
                (found.value - expected.value).abs() < 4e-3 * scale,
                "{framework} {period}: {} {}",
                found.value,
                expected.value
            );
            // Around the best order the worth is flat: the errors of both surrogates move it by a percent of the range.
            assert!((action(&found) - action(&expected)).abs() < 1.2, "{framework} {period}: {found:?} {expected:?}");
            assert!((found.radius - expected.radius).abs() < 1e-9, "{framework} {period}");
        }
    }
}

#[test]
fn a_discount_counts_from_the_period_decided() {
    let mut request = stock(3, 100, "adaptive");
    request["problem"]["discount"] = json!(0.9);
    let found = advisor(&request).decide(3, Some(&named(5.0)), &[20.0, 18.0]).unwrap();
    let mut rest = stock(1, 100, "adaptive");
    rest["problem"]["discount"] = json!(0.9);
    rest["problem"]["states"]["stock"]["start"] = json!(5.0);
    rest["problem"]["history"].as_array_mut().unwrap().extend([json!(20.0), json!(18.0)]);
    let expected = solved(&rest).unwrap();
    assert!((found.value - expected.value).abs() < 1e-6 * expected.value.abs(), "{} {}", found.value, expected.value);
}

/// States that the design's own simulation reaches are decided from trained values; laws that it never saw are not.
#[test]
fn an_untrained_share_is_small_where_it_was_trained_and_large_far_away() {
    let advisor = advisor(&stock(6, 100, "adaptive"));
    let mut shares = Vec::new();
    for path in 0..40 {
        let mut generator = stream(7, "untrained", 0, path);
        let (mut left, mut noises, period) = (4.0_f64, Vec::new(), 1 + path % 5);
        let history: Vec<f64> = serde_json::from_value(example("stock")["problem"]["history"].clone()).unwrap();
        for _ in 1..period {
            let ordered = generator.random_range(0.0..=60.0 - left);
            let noise = history[generator.random_range(0..history.len())];
            left = (left + ordered - noise).max(0.0);
            noises.push(noise);
        }
        shares.push(advisor.decide(period, Some(&named(left)), &noises).unwrap().untrained_share);
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!(mean < 0.05, "{mean}: {shares:?}");
    let far = advisor.decide(5, Some(&named(4.0)), &[40.0, 40.0, 40.0, 40.0]).unwrap();
    assert!(far.untrained_share > 0.5, "{far:?}");
    // Nothing is trained after the last period.
    let last = advisor.decide(6, Some(&named(4.0)), &[40.0; 5]).unwrap();
    assert_eq!(last.untrained_share, 0.0);
}

/// A value is the mean, under the worst law, of what the period earns and what the next state is worth. The next states
/// are solved here, and were predicted there.
#[test]
fn the_first_value_is_the_mean_of_the_second_under_the_worst_law() {
    for framework in ["adaptive", "static"] {
        let advisor = advisor(&stock(3, 100, framework));
        let first = advisor.decide(1, None, &[]).unwrap();
        let order = action(&first);
        let of_move = |to: f64| {
            let left = (4.0 + order - to).max(0.0);
            let earned = 9.0 * to.min(4.0 + order) - 5.0 * order - 0.5 * left;
            earned + advisor.decide(2, Some(&named(left)), &[to]).unwrap().value
        };
        let mean: f64 = first.worst_law.iter().map(|moved| moved.share * of_move(moved.to)).sum();
        assert!((mean - first.value).abs() < 2e-3 * first.value, "{framework}: {mean} and {}", first.value);
        // Under the law that was seen it is worth more.
        let seen: f64 = first.worst_law.iter().map(|moved| moved.share * of_move(moved.from)).sum();
        assert!(seen > first.value + 5.0, "{framework}: {seen} and {}", first.value);
    }
}
