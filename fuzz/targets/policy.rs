//! The body of `POST /policies/import`: refused, or a policy that is written as it was read, gives a sane advice and is
//! drawn.
#![no_main]

use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::policy::Policy;
use ballast::http::gate::decode;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|body: &[u8]| {
    let Ok(policy) = decode::json::<Policy>(body) else { return };
    let Ok(policy) = policy.checked() else { return };
    let written = policy.to_json().expect("plain numbers and strings");
    let advisor = Advisor::new(Policy::from_json(&written).expect("what was checked is a policy"));
    assert_eq!(advisor.policy().to_json().expect("as before"), written);
    let state = advisor.initial_state(None, None).expect("its own start");
    for step in 0..advisor.policy().steps().len().min(2) {
        let advice = advisor.advise(step, &state, AdviceMode::Surrogate);
        assert!((0.0..=1.0).contains(&advice.allocation), "{}", advice.allocation);
        let drawn = advisor.surface_column(&advisor.surface_states(step, None), 0);
        assert!(drawn.iter().all(|(allocation, _)| (0.0..=1.0).contains(allocation)), "{drawn:?}");
    }
});
