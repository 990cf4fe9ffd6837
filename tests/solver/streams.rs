//! Labelled random streams: no two labels share one, and a draw more in one place changes nothing in another.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::policies::specification;
use ballast::control::evaluation::paths::Evaluation;
use ballast::control::surrogate::design::Design;
use ballast::numerics::machine::streams::stream;
use rand::RngExt;
use serde_json::{Value, json};

#[test]
fn no_two_labels_share_a_stream() {
    // Numbers that a careless packing would confuse: each in the place of another, and beyond 32 bits.
    let numbers = [0_u64, 1, 2, 255, 256, 1 << 32, (1 << 32) + 1, u64::MAX];
    let purposes = ["", "a", "b", "ab", "ba", "a ", "aa", "evaluate-path", "evaluate-paths", "evaluate-history"];
    let mut seen = HashSet::new();
    let mut labels = 0;
    for seed in numbers {
        for step in numbers {
            for index in numbers {
                for purpose in purposes {
                    let mut generator = stream(seed, purpose, step as usize, index as usize);
                    labels += 1;
                    // 5,000 labels of 128 bits: two that share their first draws share the stream.
                    seen.insert((generator.random::<u64>(), generator.random::<u64>()));
                }
            }
        }
    }
    assert_eq!((labels, seen.len()), (5120, 5120));
}

/// Every file of `src`.
fn sources() -> Vec<PathBuf> {
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut files = Vec::new();
    while let Some(path) = open.pop() {
        match path.is_dir() {
            true => open.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path())),
            false => files.push(path),
        }
    }
    files
}

#[test]
fn a_purpose_is_drawn_for_in_one_file() {
    let mut files_of: BTreeMap<String, HashSet<PathBuf>> = BTreeMap::new();
    for path in sources() {
        let text = fs::read_to_string(&path).unwrap_or_default();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for call in code.split(" stream(").skip(1).chain(code.split("&mut stream(").skip(1)) {
            let arguments = call.split(')').next().unwrap_or_default();
            if let Some(purpose) = arguments.split('"').nth(1) {
                files_of.entry(purpose.to_owned()).or_default().insert(path.clone());
            }
        }
    }
    let known = ["bridge", "bridge in cells", "design", "evaluate-history", "evaluate-path", "initial"];
    for purpose in known {
        assert!(files_of.contains_key(purpose), "no call draws for {purpose}: {files_of:?}");
    }
    for (purpose, files) in files_of {
        assert_eq!(files.len(), 1, "{purpose} is drawn for in {files:?}");
    }
}

fn request(count: usize, horizon: usize) -> Value {
    json!({
        "problem": { "horizon": horizon, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": [0.02, -0.03, 0.05, 0.01] },
        "design": { "count": count, "initial_laws": "resampled", "wealth": { "min": 50.0, "max": 200.0 } }
    })
}

#[test]
fn a_design_point_is_the_same_in_a_larger_design_and_a_longer_horizon() {
    let design = |count, horizon| Design::new(&specification(request(count, horizon)));
    let (small, large) = (design(10, 3), design(40, 6));
    for index in 0..30 {
        for step in 0..3 {
            assert_eq!(small.state(step, index), large.state(step, index), "point {index} of step {step}");
        }
        // One path: each step adds a return to those before.
        let [before, after] = [1, 2].map(|step| large.state(step, index).law.atoms().to_vec());
        assert!(before.iter().all(|z| after.contains(z)) && after.len() == before.len() + 1, "{before:?} {after:?}");
    }
    assert_ne!(small.state(0, 0), small.state(0, 1));
    let mut other = request(10, 3);
    other["seed"] = json!(2);
    assert_ne!(Design::new(&specification(other)).state(0, 0), small.state(0, 0));
}

#[test]
fn a_path_is_the_same_beside_more_paths_histories_and_strategies() {
    let evaluation = |paths: usize, histories: usize, mixes: Value| {
        let request = json!({
            "problem": { "horizon": 3, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": [0.02, -0.03, 0.05, 0.01] }, "frameworks": [], "constant_mixes": mixes,
            "paths": paths, "histories": { "kind": "drawn", "count": histories } });
        Evaluation::new(serde_json::from_value(request).unwrap()).unwrap()
    };
    let (few, many) = (evaluation(100, 2, json!([0.5])), evaluation(500, 4, json!([0.1, 0.2, 0.3])));
    assert_eq!(few.histories[..2], many.histories[..2]);
    assert_ne!(few.histories[0], few.histories[1]);
    let mut seen = Vec::new();
    for history in 0..2 {
        for path in 0..100 {
            let returns = few.returns(history, path);
            assert_eq!(returns, many.returns(history, path), "path {path} of history {history}");
            seen.push(returns);
        }
    }
    // The bootstrap is smoothed, so that no two draws of it are the same.
    seen.sort_by(|left, right| left.partial_cmp(right).unwrap());
    seen.dedup();
    assert_eq!(seen.len(), 200);
}
