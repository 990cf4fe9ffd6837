//! How often the accuracy that a declared policy claims holds: fresh states of the design's own law, for every template.

use std::collections::BTreeMap;

use ballast::control::cache::Cache;
use ballast::control::policy::declared::{DeclaredAdvisor, DeclaredPolicy};
use ballast::control::problem::controlled::Controlled;
use ballast::control::problem::declared::Declared;
use ballast::control::progress::Watch;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use serde_json::{Value, json};

use crate::declared::example;

fn advisor(request: &Value) -> DeclaredAdvisor {
    let declared = serde_json::from_value(request.clone()).unwrap();
    DeclaredPolicy::train(&declared, &Watch::unwatched()).unwrap().prepared(Cache::default()).unwrap()
}

/// A state after some periods of random actions and noises, a quarter of which may be anything in the support, with the
/// noises.
fn fresh(problem: &Declared, request: &Value, periods: usize, number: usize) -> (BTreeMap<String, f64>, Vec<f64>) {
    let mut generator = stream(20_261_129, "fresh", 0, number);
    let history: Vec<f64> = serde_json::from_value(request["problem"]["history"].clone()).unwrap();
    let (mut state, mut noises) = (problem.start(), Vec::new());
    for step in 0..periods {
        let actions: Vec<f64> =
            problem.actions(step, &state).iter().map(|set| set.at(generator.random::<f64>())).collect();
        let scaled = match generator.random::<f64>() < 0.25 {
            true => generator.random::<f64>() - 0.5,
            false => problem.scaled(history[generator.random_range(0..history.len())]),
        };
        state = problem.next(step, &state, &actions, scaled);
        noises.push(problem.noise(scaled));
    }
    (problem.states_by_name(&state), noises)
}

/// Errors of the trained steps are at most 1.5 times what is claimed, with the errors of the steps after, in the root mean
/// square over 300 fresh states of each step. The last step is known exactly; the one before by a policy of 300 points.
#[test]
fn claims_hold_for_every_template() {
    const STATES: usize = 300;
    for (name, horizon, accuracy) in [
        ("stock", 3, 1.5),
        ("store", 3, 0.05),
        ("regulator", 3, 0.2),
        ("goal", 2, 0.1),
        ("investor", 2, 0.02),
        ("hedge", 2, 0.1),
        ("spending", 2, 0.05),
        ("liquidation", 2, 0.3),
    ] {
        let mut request = example(name);
        request["problem"]["horizon"] = json!(horizon);
        request["design"] = json!({ "accuracy": accuracy, "count": 200 });
        let policy = advisor(&request);
        let problem = Declared::new(&serde_json::from_value(request["problem"].clone()).unwrap()).unwrap();
        request["design"] = json!({ "count": 300 });
        let finer = (horizon > 2).then(|| advisor(&request));
        let diagnostics: Vec<_> = policy.policy().diagnostics().cloned().collect();
        for period in 2..=horizon {
            let (claimed, points) =
                (diagnostics[period - 2].expected_error.unwrap(), diagnostics[period - 2].design_count);
            // Of the start, if a utility counts ratios.
            let claimed = problem.error_amount(claimed.total, 100.0);
            let exact = if period == horizon { &policy } else { finer.as_ref().unwrap() };
            let error = |number: usize| {
                let (state, noises) = fresh(&problem, &request, period - 1, number);
                let truth = exact.decide(period, Some(&state), &noises).unwrap().value;
                // As of the start, as claims are.
                problem.discounted(period - 1) * (policy.predicted(period, &state, &noises).unwrap() - truth)
            };
            let squares = (0..STATES).map(|number| error(number).powi(2));
            let found = (squares.sum::<f64>() / STATES as f64).sqrt();
            println!("{name}, period {period}: {found:.2e} found, {claimed:.2e} claimed, {points} points");
            assert!(found <= 1.5 * claimed, "{name}, period {period}: {found} found, {claimed} claimed");
            assert!(claimed <= accuracy || points == 200, "{name}, period {period}: {claimed} with {points}");
        }
        let first = policy.decide(1, None, &[]).unwrap();
        let claimed = problem.error_amount(diagnostics[0].expected_error.unwrap().total, first.value);
        assert_eq!(first.value_error, Some(claimed), "{name}");
        let (state, noises) = fresh(&problem, &request, horizon - 1, 0);
        assert_eq!(
            policy.decide(horizon, Some(&state), &noises).unwrap().value_error,
            Some(0.0),
            "{name}: it is exact"
        );
        if let Some(finer) = finer {
            assert_eq!(finer.decide(1, None, &[]).unwrap().value_error, None, "{name}");
        }
    }
}

#[test]
fn an_accuracy_that_amounts_cannot_have_is_refused() {
    for accuracy in [1e-9, -1.0] {
        let mut request = example("stock");
        request["design"] = json!({ "accuracy": accuracy });
        let declared = serde_json::from_value(request).unwrap();
        let error = DeclaredPolicy::train(&declared, &Watch::unwatched()).unwrap_err().to_string();
        assert!(error.contains("design.accuracy") && error.contains("by the size of the amounts"), "{error}");
    }
    // More than amounts can be off is no fault: a life that shrank asks for as much.
    let mut request = example("stock");
    request["problem"]["horizon"] = json!(2);
    request["design"] = json!({ "accuracy": 1e6, "count": 100 });
    assert!(advisor(&request).decide(1, None, &[]).unwrap().value_error.unwrap() < 10.0);
}
