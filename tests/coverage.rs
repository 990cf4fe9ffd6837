//! Coverage of balls against closed forms, and the command as a user runs it.

use std::process::Command;

use ballast::control::evaluation::coverage::{CoverageQuestion, DrawnLaw, coverage};
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::UtilitySpecification;

/// Independent draws of two returns, each with probability one half.
const TWO: [f64; 2] = [-0.15, 0.17];

fn question(rules: Vec<RadiusRule>) -> CoverageQuestion {
    CoverageQuestion {
        size: 20,
        records: 4000,
        rate_per_step: 0.002,
        utility: UtilitySpecification::Log {},
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
    assert!((found[0].held.value - held).abs() < 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt(), "{found:?}");
    assert_eq!(found[1].held.value, 1.0);

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

#[test]
fn the_command_tells_a_line_for_each_law_size_and_rule_and_names_the_option_it_refuses() {
    let run = |arguments: &[&str]| {
        let command = Command::new(env!("CARGO_BIN_EXE_ballast")).arg("coverage").args(arguments).output().unwrap();
        (String::from_utf8(command.stdout).unwrap(), String::from_utf8(command.stderr).unwrap())
    };
    let (told, _) = run(&["--records", "20", "--sizes", "5,8"]);
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 1 + 4 * 2 * 4, "{told}");
    for name in ["normal", "the paper's mixture", "Student, 4 degrees", "market, in blocks"] {
        assert_eq!(lines.iter().filter(|line| line.starts_with(name)).count(), 8, "{told}");
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
