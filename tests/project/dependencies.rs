//! The packages that are built in: their licences, their registry, and that each is there once, as `deny.toml` has it.
//!
//! `cargo deny check` reads the same file and knows more; this needs nothing but cargo, so that it runs wherever the tests
//! do. No database of advisories is asked.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

const DENY: &str = include_str!("../../deny.toml");

/// The texts of a list of `deny.toml`.
fn list(name: &str) -> BTreeSet<&'static str> {
    let start = format!("\n{name} = [");
    let (_, rest) = DENY.split_once(&start).unwrap_or_else(|| panic!("{name}"));
    let (inside, _) = rest.split_once(']').expect("its end");
    inside.split('"').skip(1).step_by(2).collect()
}

/// Returns cargo's list of the packages that are built for Linux, and the identifiers of those in the binary itself.
fn packages() -> (Vec<Value>, BTreeSet<String>) {
    let arguments = ["metadata", "--locked", "--format-version", "1", "--filter-platform", "x86_64-unknown-linux-gnu"];
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap();
    let nodes: BTreeMap<&str, &Value> = nodes.iter().map(|node| (node["id"].as_str().unwrap(), node)).collect();
    let (mut built, mut next) = (BTreeSet::new(), vec![metadata["resolve"]["root"].as_str().unwrap()]);
    while let Some(id) = next.pop() {
        if built.insert(id.to_owned()) {
            let dependencies = nodes[id]["deps"].as_array().unwrap().iter();
            let in_binary = dependencies.filter(|dependency| {
                dependency["dep_kinds"].as_array().unwrap().iter().any(|kind| kind["kind"] != "dev")
            });
            next.extend(in_binary.map(|dependency| dependency["pkg"].as_str().unwrap()));
        }
    }
    (metadata["packages"].as_array().unwrap().clone(), built)
}

/// Returns true if the allowed licences meet an SPDX expression, or the older `A/B`.
fn is_allowed(expression: &str, allowed: &BTreeSet<&str>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let (met, rest) = any_of(&words, allowed);
    assert!(rest.is_empty(), "{expression}");
    met
}

fn any_of<'a>(words: &'a [&'a str], allowed: &BTreeSet<&str>) -> (bool, &'a [&'a str]) {
    let (mut met, mut rest) = all_of(words, allowed);
    while let ["OR", after @ ..] = rest {
        let (next, after) = all_of(after, allowed);
        (met, rest) = (met | next, after);
    }
    (met, rest)
}

fn all_of<'a>(words: &'a [&'a str], allowed: &BTreeSet<&str>) -> (bool, &'a [&'a str]) {
    let (mut met, mut rest) = one(words, allowed);
    while let ["AND", after @ ..] = rest {
        let (next, after) = one(after, allowed);
        (met, rest) = (met & next, after);
    }
    (met, rest)
}

fn one<'a>(words: &'a [&'a str], allowed: &BTreeSet<&str>) -> (bool, &'a [&'a str]) {
    match words {
        ["(", inside @ ..] => match any_of(inside, allowed) {
            (met, [")", after @ ..]) => (met, after),
            (_, rest) => panic!("a bracket is open before {rest:?}"),
        },
        [licence, "WITH", exception, after @ ..] => {
            (allowed.contains(format!("{licence} WITH {exception}").as_str()), after)
        }
        [licence, after @ ..] => (allowed.contains(licence), after),
        [] => (false, words),
    }
}

#[test]
fn expressions_of_licences_are_read_as_they_are_meant() {
    let allowed = BTreeSet::from(["MIT", "ISC", "Apache-2.0 WITH LLVM-exception"]);
    for met in ["MIT", "GPL-3.0 OR MIT", "GPL-3.0/MIT", "(GPL-3.0 OR MIT) AND ISC", "Apache-2.0 WITH LLVM-exception"] {
        assert!(is_allowed(met, &allowed), "{met}");
    }
    for unmet in ["GPL-3.0", "MIT AND GPL-3.0", "GPL-3.0 OR MIT AND BSL-1.0", "Apache-2.0", ""] {
        assert!(!is_allowed(unmet, &allowed), "{unmet}");
    }
}

#[test]
fn what_is_built_in_is_licensed_from_one_registry_and_there_once() {
    let (packages, built) = packages();
    assert!(packages.len() > 200 && built.len() > 100, "{} packages, {} built in", packages.len(), built.len());
    let (licences, registries) = (list("allow"), list("allow-registry"));
    let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in &packages {
        let text = |field: &str| package[field].as_str().unwrap_or_default();
        let name = text("name");
        let from = text("source").trim_start_matches("registry+");
        let own = package["source"].is_null();
        assert!(own && name.starts_with("ballast") || registries.contains(from), "{name} comes from '{from}'");
        assert!(is_allowed(text("license"), &licences), "{name} is licensed '{}'", text("license"));
        assert!(!list("deny").contains(name), "{name} is banned");
        if built.contains(text("id")) {
            versions.entry(name).or_default().push(text("version"));
        }
        for dependency in package["dependencies"].as_array().unwrap().iter().filter(|_| own) {
            assert_ne!(dependency["req"], "*", "{name} takes any version of {}", dependency["name"]);
        }
    }
    let several: BTreeMap<_, _> = versions.into_iter().filter(|(_, versions)| versions.len() > 1).collect();
    let skipped = list("skip");
    for (name, versions) in &several {
        assert!(skipped.contains(name), "{name} is built in more than once: {versions:?}");
    }
    for name in skipped {
        assert!(several.contains_key(name), "{name} is there once: take it off the list");
    }
}
