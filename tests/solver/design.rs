//! The states that surrogates are trained on.

use crate::support::policies::specification;
use ballast::control::request::support::{Interval, LawExtent, Support};
use ballast::control::surrogate::counts::{Counts, LEAPING};
use ballast::control::surrogate::design::Design;
use ballast::control::surrogate::target::TargetMap;
use serde_json::{Value, json};

const HISTORY: [f64; 6] = [0.03, -0.05, 0.02, 0.06, -0.01, 0.04];

fn request(framework: &str, utility: Value) -> Value {
    json!({ "problem": { "framework": framework, "horizon": 4, "rate_per_step": 0.002, "history": HISTORY, "utility": utility,
                "radius": { "rule": "fixed", "radius": 0.01 } },
            "design": { "count": 20 } })
}

fn exponential() -> Value {
    json!({ "kind": "exponential", "risk_aversion": 0.01 })
}

#[test]
fn wealth_alone_is_a_ladder_over_all_that_can_be_reached() {
    let mut request = request("static", exponential());
    request["design"]["wealth"] = json!({ "min": 80.0, "max": 120.0 });
    let design = Design::new(&specification(request));
    let mean = HISTORY.iter().sum::<f64>() / 6.0;
    let variance = HISTORY.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / 6.0;
    for step in 0..4 {
        assert_eq!(design.counts(step), Counts { design: 20, chosen: false, leaps: false, guards: 20..20 });
        let rungs: Vec<f64> = (0..20).map(|index| design.state(step, index).wealth.ln()).collect();
        let gap = (rungs[19] - rungs[0]) / 19.0;
        assert!(rungs.windows(2).all(|pair| (pair[1] - pair[0] - gap).abs() < 1e-12), "{rungs:?}");
        // Five deviations below the worse of bank and asset, and above the better.
        let (elapsed, bank) = (step as f64, step as f64 * 1.002_f64.ln());
        let spread = 5.0 * (elapsed * variance).sqrt();
        let (low, high) =
            (80_f64.ln() + bank.min(elapsed * mean) - spread, 120_f64.ln() + bank.max(elapsed * mean) + spread);
        assert!((rungs[0] - low).abs() < 1e-12 && (rungs[19] - high).abs() < 1e-12, "{rungs:?} {low} {high}");
    }
}

#[test]
fn where_all_states_are_one_there_is_one_design_point() {
    let log = || json!({ "kind": "log" });
    let count = |framework: &str, utility: Value, step: usize| {
        Design::new(&specification(request(framework, utility))).count(step)
    };
    assert_eq!([0, 3].map(|step| count("static", log(), step)), [1, 1]);
    assert_eq!([0, 3].map(|step| count("adaptive", log(), step)), [1, 20]);
    assert_eq!([0, 3].map(|step| count("adaptive", exponential(), step)), [1, 20]);
    let mut resampled = request("adaptive", log());
    resampled["design"]["initial_laws"] = json!("resampled");
    assert_eq!(Design::new(&specification(resampled)).count(0), 20);
}

#[test]
fn a_quarter_is_taken_as_drawn_and_the_guards_are_none_of_the_candidates() {
    let design = Design::new(&specification(request("adaptive", exponential())));
    let counts = design.counts(2);
    // Two of the five leap.
    assert_eq!((counts.candidates(20), counts.as_drawn(20), counts.leaping(20), counts.guards), (60, 3, 2, 60..260));
}

#[test]
fn simulated_states_keep_to_the_history_the_support_and_the_returns_accepted() {
    let mut request = request("adaptive", exponential());
    request["design"]["sampling_law"] =
        json!({ "kind": "student_t", "location": 0.0, "scale": 1.0, "degrees_of_freedom": 2.1 });
    let free = Design::new(&specification(request.clone()));
    request["problem"]["support"] = json!({ "rule": "between", "min": -0.3, "max": 0.2 });
    let bounded = Design::new(&specification(request));
    let mut widest = 0.0_f64;
    for index in 0..200 {
        let laws = [&free, &bounded].map(|design| design.state(3, index).law.atoms().to_vec());
        for atoms in &laws {
            assert_eq!(atoms.len(), 9);
            assert!(HISTORY.iter().all(|z| atoms.contains(z)), "{atoms:?}");
        }
        widest = laws[0].iter().fold(widest, |widest, z| widest.max(z.abs()));
        assert!(laws[1].iter().all(|z| (-0.3..=0.2).contains(z)), "{:?}", laws[1]);
    }
    let accepted = ballast::control::request::rules::LOG_RETURN;
    assert!(widest > 1.0 && widest <= accepted, "{widest}");
}

/// The adversary's default support after the history is [-0.189, 0.219]: 0.015 and five deviations of 0.0377 less and
/// more, of which the lower end is below twice the worst return and the upper above twice the best.
#[test]
fn leaping_states_reach_all_of_the_support() {
    let reach = |support: Value, learned: &str| {
        let mut request = request("adaptive", exponential());
        request["problem"]["support"] = support;
        request["design"]["initial_laws"] = json!(learned);
        request["design"]["sampling_law"] =
            json!({ "kind": "gaussian_mixture", "components": [{ "weight": 1.0, "mean": 0.01, "variance": 1e-10 }] });
        let design = Design::new(&specification(request));
        assert!(design.counts(3).leaps && !design.counts(0).leaps);
        let leaps_of = |index: usize| -> Vec<f64> {
            let atoms = design.state(3, LEAPING + index).law.atoms().to_vec();
            let drawn = |z: &f64| (z - 0.01).abs() < 1e-3;
            atoms.into_iter().filter(|z| !HISTORY.contains(z) && !drawn(z)).collect()
        };
        let (more, once): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (0..400).map(leaps_of).partition(|leaps| leaps.len() > 1);
        let mut leaps = once.concat();
        leaps.sort_by(f64::total_cmp);
        (leaps, more.len())
    };
    let extent = LawExtent::of(HISTORY.into_iter());
    let Interval { min, max } = Support::default().around(|| extent).unwrap();
    assert!(min < -0.15 && max > 0.15, "[{min}, {max}]");
    // The support may follow the returns drawn before the leap, which narrow it.
    let ends = |leaps: &[f64]| [leaps[0], leaps[leaps.len() - 1]];
    let (usual, more) = reach(json!({ "rule": "worst_seen", "factor": 2.0 }), "given");
    let [lowest, highest] = ends(&usual);
    assert!((lowest - min).abs() < 1e-3 && (highest - max).abs() < 1e-3, "[{lowest}, {highest}] for [{min}, {max}]");
    // The first leap is in any of three periods, and each later return leaps with a chance of 0.3 over the root of the
    // returns. Four standard deviations of such a count are at most 40.
    let again = 0.3 / (HISTORY.len() as f64).sqrt();
    let expected = 400.0 * (1.0 - (1.0 + (1.0 - again) + (1.0 - again).powi(2)) / 3.0);
    assert!((more as f64 - expected).abs() < 40.0, "{more} for {expected}");
    // Spread evenly, but for a twentieth at either end and the places of those that leap again.
    let largest = usual.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!(largest < 0.05 * (max - min), "{largest}");
    let (between, _) = reach(json!({ "rule": "between", "min": -0.3, "max": 0.2 }), "given");
    assert_eq!(ends(&between), [-0.3, 0.2]);
    let (free, _) = reach(json!({ "rule": "none" }), "given");
    assert!(free[0] < -1.0 && 2 * free.iter().filter(|z| **z < min).count() < free.len(), "{free:?}");
}

#[test]
fn a_target_leads_back_to_its_gain() {
    for target in ["floor_gain", "value"] {
        for utility in [exponential(), json!({ "kind": "power", "risk_aversion": 3.0 }), json!({ "kind": "log" })] {
            let mut request = request("adaptive", utility.clone());
            request["surrogate"] = json!({ "target": target });
            let map = TargetMap::new(&specification(request), 1);
            for wealth in [60.0, 100.0, 170.0] {
                for gain in [0.0, 1e-5, 0.02, 0.4] {
                    let back = map.gain(map.target(gain, wealth), wealth);
                    // A utility near 1/eta cancels four digits.
                    assert!((back - gain).abs() < 1e-12, "{target} {utility} {wealth}: {gain} became {back}");
                }
            }
            if target == "value" && utility["kind"] != "log" {
                // No wealth has a utility past the bound of all.
                assert_eq!(map.gain(1e3, 100.0), f64::INFINITY, "{utility}");
            }
        }
    }
}
