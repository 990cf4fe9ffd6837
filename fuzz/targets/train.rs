//! The body of `POST /train`: refused, or a specification that completing and writing out do not change.
#![no_main]

use ballast::control::request::specification::Specification;
use ballast::http::gate::decode;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|body: &[u8]| {
    let Ok(specification) = decode::json::<Specification>(body) else { return };
    let Ok(completed) = specification.completed() else { return };
    assert_eq!(completed.clone().completed().as_ref(), Ok(&completed));
    let written = serde_json::to_vec(&completed).expect("plain data");
    assert_eq!(decode::json::<Specification>(&written).ok(), Some(completed));
});
