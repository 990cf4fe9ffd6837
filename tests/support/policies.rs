//! Policies trained here and now, with no server.

use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::progress::Watch;
use ballast::control::request::specification::Specification;
use ballast::control::training::Training;
use serde_json::Value;

pub fn specification(value: Value) -> Specification {
    serde_json::from_value::<Specification>(value).unwrap().completed().unwrap()
}

pub fn train(value: Value) -> Policy {
    Training::new(&specification(value)).unwrap().run(&Watch::unwatched()).unwrap()
}

pub fn advisor(value: Value) -> Advisor {
    Advisor::new(train(value))
}
