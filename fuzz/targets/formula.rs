//! A formula in the place of a reward: refused with its column, or evaluated.
#![no_main]

use ballast::control::problem::declared::Declared;
use ballast::control::request::declared::DeclaredSpecification;
use libfuzzer_sys::fuzz_target;
use serde_json::json;

fuzz_target!(|formula: &str| {
    let declared: DeclaredSpecification = serde_json::from_value(json!({ "problem": {
        "states": { "x": { "start": 1, "low": -2, "high": 2 } },
        "actions": { "a": { "low": "-1", "high": "1" } },
        "noise": { "name": "z", "low": -1, "high": 1 },
        "parameters": { "k": 0.5 },
        "next": { "x": "k*x + a/2 + z/2" }, "reward": formula, "horizon": 2, "history": [0.5, -0.25] } }))
    .expect("a declaration");
    if let Err(fault) = Declared::new(&declared.problem) {
        assert_eq!(fault.field, "problem.reward");
    }
});
