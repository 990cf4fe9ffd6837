//! Policies trained in this process, without a server.

use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::progress::Watch;
use ballast::control::request::specification::Specification;
use ballast::control::training::Training;
use serde_json::{Value, json};

/// Returns a specification whose problem is the paper's unless `value` says otherwise.
pub fn specification(mut value: Value) -> Specification {
    let problem = value["problem"].as_object_mut().expect("a problem");
    if !problem.get("framework").is_some_and(|name| name.as_str().expect("a name").starts_with("parametric")) {
        problem.entry("support").or_insert_with(|| json!({ "rule": "none" }));
    }
    serde_json::from_value::<Specification>(value).unwrap().completed().unwrap()
}

pub fn train(value: Value) -> Policy {
    Training::new(&specification(value)).unwrap().run(&Watch::unwatched()).unwrap()
}

pub fn advisor(value: Value) -> Advisor {
    Advisor::new(train(value))
}
