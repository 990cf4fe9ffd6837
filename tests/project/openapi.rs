//! The checked-in description is the one the routes make.
//! To accept a change: `cargo run -- openapi > api/openapi.json` and `cargo run -- openapi --page > docs/requests.md`, and
//! read the differences.

use ballast::http::problem::ProblemKind;
use serde_json::Value;

const CHECKED_IN: &str = include_str!("../../api/openapi.json");

#[test]
fn the_description_has_not_drifted() {
    assert!(
        ballast::http::description_json() == CHECKED_IN,
        "api/openapi.json is out of date: cargo run -- openapi > api/openapi.json"
    );
}

#[test]
fn the_page_for_people_has_not_drifted() {
    let out_of_date = "docs/requests.md is out of date: cargo run -- openapi --page > docs/requests.md";
    assert!(ballast::http::reference_page() == include_str!("../../docs/requests.md"), "{out_of_date}");
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

#[test]
fn every_operation_has_an_identifier_of_its_own() {
    let description: Value = serde_json::from_str(CHECKED_IN).unwrap();
    let operations =
        description["paths"].as_object().unwrap().values().flat_map(|item| item.as_object().unwrap().values());
    let identifiers: Vec<&str> = operations.map(|operation| operation["operationId"].as_str().unwrap()).collect();
    let distinct: std::collections::BTreeSet<&str> = identifiers.iter().copied().collect();
    assert_eq!(distinct.len(), identifiers.len(), "{identifiers:?}");
}

#[test]
fn every_operation_lists_what_its_shape_can_answer() {
    let description: Value = serde_json::from_str(CHECKED_IN).unwrap();
    let mut with_body = 0;
    for (path, operations) in description["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            let mut expected = Vec::new();
            if operation["tags"][0] != "operations" {
                expected.extend(["500", "503"]);
            }
            if operation["requestBody"].is_object() {
                with_body += 1;
                expected.extend(["400", "413", "415", "422", "507"]);
            }
            if method == "delete" {
                expected.push("507");
            }
            if path.contains('{') {
                expected.push("404");
            }
            for status in expected {
                let content = &operation["responses"][status]["content"];
                assert!(content["application/problem+json"].is_object(), "{method} {path} {status}");
            }
        }
    }
    assert_eq!(with_body, 23);
}

#[test]
fn every_problem_is_in_the_table_and_a_full_quota_is_said_where_it_refuses() {
    let description: Value = serde_json::from_str(CHECKED_IN).unwrap();
    let table = description["info"]["description"].as_str().unwrap();
    for (slug, status, title) in ProblemKind::ALL.map(ProblemKind::entry) {
        let row = format!("| `/problems/{slug}` | {} | {title} |", status.as_u16());
        assert_eq!(table.matches(&row).count(), 1, "{row}");
    }
    let (_, _, title) = ProblemKind::QuotaExceeded.entry();
    let refusing = description["paths"].as_object().unwrap().iter().filter(|(_, operations)| {
        operations["post"]["responses"]["413"]["description"].as_str().is_some_and(|meaning| meaning.contains(title))
    });
    let refusing: Vec<&String> = refusing.map(|(path, _)| path).collect();
    assert_eq!(
        refusing,
        ["/backtest", "/evaluate", "/frontier", "/policies/import", "/sessions", "/sessions/import", "/train"]
    );
}

/// A schema that is named by hand would otherwise be missed when its type is renamed.
#[test]
fn every_schema_that_is_named_exists() {
    let whole: Value = serde_json::from_str(CHECKED_IN).unwrap();
    let mut named = CHECKED_IN.split("#/components/schemas/").skip(1).map(|rest| rest.split('"').next().unwrap());
    let unknown = named.find(|name| whole["components"]["schemas"].get(name).is_none());
    assert_eq!(unknown, None);
}
