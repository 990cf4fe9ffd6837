//! The checked-in description is the one the routes make.
//! To accept a change: `cargo run -- openapi > api/openapi.json`, and read the difference.

use serde_json::Value;

const CHECKED_IN: &str = include_str!("../api/openapi.json");

#[test]
fn the_description_has_not_drifted() {
    assert!(
        ballast::http::description_json() == CHECKED_IN,
        "api/openapi.json is out of date: cargo run -- openapi > api/openapi.json"
    );
}

#[test]
fn every_response_is_described() {
    let description: Value = serde_json::from_str(CHECKED_IN).unwrap();
    for (path, operations) in description["paths"].as_object().unwrap() {
        for operation in operations.as_object().unwrap().values() {
            for (status, response) in operation["responses"].as_object().unwrap() {
                assert!(response["description"].as_str().is_some_and(|text| !text.is_empty()), "{path} {status}");
            }
        }
    }
}
