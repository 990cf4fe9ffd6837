//! The file of `ballast solve`: refused with a field, or a problem whose start and first period can be evaluated.
#![no_main]

use ballast::control::problem::controlled::Controlled;
use ballast::control::problem::declared::Declared;
use ballast::control::request::declared::DeclaredSpecification;
use ballast::http::gate::decode;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|body: &[u8]| {
    let Ok(declared) = decode::json::<DeclaredSpecification>(body) else { return };
    let Ok(problem) = Declared::new(&declared.problem) else { return };
    let _ = problem.specification(&declared);
    let start = problem.start();
    let actions: Vec<f64> = problem.actions(0, &start).iter().map(|set| set.at(0.5)).collect();
    assert!(actions.iter().all(|action| action.is_finite()));
    let next = problem.next(0, &start, &actions, 0.0);
    assert!(next.values.iter().all(|value| value.is_finite()));
});
