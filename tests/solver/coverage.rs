//! Coverage of balls against closed forms, and the command as a user runs it.

use std::process::Command;

use crate::support::{App, specification};
use ballast::control::evaluation::coverage::{CoverageQuestion, DrawnLaw, coverage};
use ballast::control::kept::Cache;
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{Specification, UtilitySpecification};
use ballast::control::uncertainty::radius::RadiusEstimator;
use ballast::numerics::law::ContinuousLaw;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use serde_json::json;

/// Independent draws of two returns, each with probability one half.
const TWO: [f64; 2] = [-0.15, 0.17];

fn question(rules: Vec<RadiusRule>) -> CoverageQuestion {
    CoverageQuestion {
        size: 20,
        records: 4000,
        rate_per_step: 0.002,
        utility: UtilitySpecification::Log {},
        centres: vec![CentreSpecification::Empirical {}],
        rules,
        seed: 1,
        level: 0.9,
    }
}

#[test]
fn two_returns_are_held_as_often_as_the_binomial_law_says() {
    // k of 20 draws are the upper return; the distance is |k / 20 - 1/2| times 0.32, at most 0.034 where 8 <= k <= 12.
    let held = [125_970.0, 167_960.0, 184_756.0, 167_960.0, 125_970.0].iter().sum::<f64>() / 1_048_576.0;
    let rules = vec![RadiusRule::Fixed { radius: 0.034 }, RadiusRule::Fixed { radius: 1.0 }];
    let law = DrawnLaw::Blocks { returns: TWO.to_vec(), length: 1 };
    let found = coverage(&law, &question(rules)).unwrap();
    // Four standard errors of a share of 4000 records.
    assert!((found[0].covered.value - held).abs() < 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt(), "{found:?}");
    assert_eq!(found[1].covered.value, 1.0);

    // In a ball that wide all stays in the bank, and what is lost is all that the best allocation gains: with excess growths
    // u < 0 < v of even chances, a* = -(u + v) / (2 u v) under logarithmic utility.
    let [low, high] = TWO.map(|z| z.exp() / 1.002 - 1.0);
    let best = -(low + high) / (2.0 * low * high);
    assert!((0.0..1.0).contains(&best), "{best}");
    let gained = 0.5 * ((best * low).ln_1p() + (best * high).ln_1p());
    assert_eq!(found[1].allocation, 0.0);
    // The best allocation is searched to 1e-6, where growth is flat.
    assert!((found[1].lost.value - 1e4 * gained).abs() < 1e-6, "{} {}", found[1].lost.value, 1e4 * gained);
}

/// Twenty runs of 100 records whose radii rest on few bridges: what is covered differs between runs as the interval of each says.
#[test]
fn intervals_of_coverage_hold_for_other_seeds_too() {
    let law = DrawnLaw::Continuous(ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]));
    let covered = |seed: u64| {
        let rules = vec![RadiusRule::Bridge { alpha: 0.1, paths: 100, scale: 1.0, correction: None }];
        let question = CoverageQuestion { records: 100, seed, ..question(rules) };
        coverage(&law, &question).unwrap()[0].covered.value
    };
    let shares: Vec<f64> = (1..=20).map(covered).collect();
    let mean = shares.iter().sum::<f64>() / 20.0;
    let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / 19.0;
    // That of 100 independent records; 19 degrees of freedom exceed 1.9 times their mean once in a hundred.
    assert!(variance < 1.9 * mean * (1.0 - mean) / 100.0, "{variance} {mean}: {shares:?}");
}

#[test]
fn a_centre_mixed_with_the_law_itself_is_nearer_by_the_share_that_was_seen() {
    // Mixed with twenty returns of the law, twenty draws are half as far from it: at most 0.034 where 6 <= k <= 14.
    let held =
        (6..=14).map(|k| (1..=k).map(|i| f64::from(21 - i) / f64::from(i)).product::<f64>()).sum::<f64>() / 1_048_576.0;
    let law = DrawnLaw::Blocks { returns: TWO.to_vec(), length: 1 };
    let itself = CentreSpecification::Mixed { law: None, history: Some(TWO.to_vec()), weight: 20.0 };
    let rules = vec![RadiusRule::Fixed { radius: 0.034 }];
    let centres = vec![CentreSpecification::Empirical {}, itself];
    let found = coverage(&law, &CoverageQuestion { centres, ..question(rules) }).unwrap();
    // Four standard errors of a share of 4000 records.
    assert!(
        (found[1].covered.value - held).abs() < 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt(),
        "{found:?} {held}"
    );
    assert!(found[0].covered.value < 0.8 && held > 0.95, "{found:?} {held}");
}

#[test]
fn calibrated_balls_hold_a_law_that_no_record_was_smoothed_from() {
    let law = DrawnLaw::Continuous(ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]));
    let (alpha, paths, scale) = (0.1, 500, 1.0);
    let rules = vec![
        RadiusRule::Bridge { alpha, paths, scale, correction: None },
        RadiusRule::Calibrated { alpha, paths, scale },
    ];
    let found = coverage(&law, &CoverageQuestion { records: 1000, ..question(rules) }).unwrap();
    let [bridge, calibrated] = [0, 1].map(|rule: usize| found[rule].covered.value);
    // Four standard errors of a share of 1000 records around 90 %; the bridge alone falls short by more than that.
    assert!((calibrated - 0.9).abs() < 0.038 && bridge < 0.862, "{bridge} {calibrated}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_calibrated_policy_keeps_its_factor_wherever_it_goes() {
    let mut app = App::start().await;
    let mut request = specification(4);
    request["problem"]["radius"] = json!({ "rule": "calibrated", "paths": 200, "scale": 0.3 });
    app.train(&request).await;
    let exported = app.export().await;
    app.open().await;
    let advisor = Advisor::new(Policy::from_json(&exported).unwrap());
    let start = advisor.initial_state(None, None).unwrap();
    request["problem"]["radius"]["rule"] = json!("bridge");
    let problem = serde_json::from_value::<Specification>(request).unwrap().completed().unwrap();
    let bridge = RadiusEstimator::new(&problem, Cache::default());
    let (mut returns, mut factor) = (Vec::new(), None);
    for period in 1..=4 {
        let (_, action) = app.action().await;
        let expected = advisor.walk(start.clone(), &[returns.clone(), vec![0.0]].concat()).last().unwrap();
        assert_eq!(action["allocation"].as_f64(), Some(expected.allocation), "period {period}");
        let radius = action["radius"].as_f64().unwrap();
        assert_eq!(radius, expected.radius);
        // The same at every state, which the bridge knows as well.
        let history: Vec<f64> = problem.problem.history.iter().chain(&returns).copied().collect();
        let found = radius / bridge.radius(&EmpiricalDistribution::new(&history));
        assert!((found / *factor.get_or_insert(found) - 1.0).abs() < 1e-9 && found > 1.0, "{found} {factor:?}");
        returns.push(0.01 * f64::from(period) - 0.02);
        assert_eq!(app.observe(period as usize, *returns.last().unwrap()).await.0, 200);
    }
}

#[test]
fn the_command_tells_a_line_for_each_law_size_centre_and_rule_and_names_the_option_it_refuses() {
    let run = |arguments: &[&str]| {
        let command = Command::new(env!("CARGO_BIN_EXE_ballast")).arg("coverage").args(arguments).output().unwrap();
        (String::from_utf8(command.stdout).unwrap(), String::from_utf8(command.stderr).unwrap())
    };
    let (output, _) = run(&["--records", "20", "--sizes", "5,8"]);
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!(lines.len(), 1 + 4 * 2 * 4 * 4, "{output}");
    for name in ["normal", "the paper's mixture", "Student, 4 degrees", "market, in blocks"] {
        assert_eq!(lines.iter().filter(|line| line.starts_with(name)).count(), 32, "{output}");
    }
    for centre in [" empirical ", " smoothed ", " volatility_scaled ", " mixed "] {
        assert_eq!(lines.iter().filter(|line| line.contains(centre)).count(), 32, "{output}");
    }
    for (arguments, option) in [
        (["--alpha", "0"], "--alpha"),
        (["--sizes", "1"], "--sizes"),
        (["--risk-aversion", "0.5"], "--risk-aversion"),
        (["--records", "1"], "--records"),
    ] {
        let (_, refused) = run(&arguments);
        assert!(refused.contains(&format!("{option} ")), "{refused}");
    }
}
