//! `ballast-lab coverage`, as a reader of the documents runs it.

use std::process::{Command, Stdio};

#[test]
fn the_command_tells_a_line_for_each_law_size_centre_and_rule_and_names_the_option_it_refuses() {
    let run = |arguments: &[&str]| {
        let command = Command::new(env!("CARGO_BIN_EXE_ballast-lab")).arg("coverage").args(arguments).output().unwrap();
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
    let (over_a_horizon, _) = run(&["--records", "20", "--sizes", "5,8", "--horizon", "3"]);
    assert_eq!(over_a_horizon.lines().count(), 1 + 4 * 2, "{over_a_horizon}");
    for (arguments, option) in [
        (["--horizon", "0"], "--horizon"),
        (["--alpha", "0"], "--alpha"),
        (["--sizes", "1"], "--sizes"),
        (["--risk-aversion", "0.5"], "--risk-aversion"),
        (["--records", "1"], "--records"),
    ] {
        let (_, refused) = run(&arguments);
        assert!(refused.contains(&format!("{option} ")), "{refused}");
    }
}

/// A reader that ends, as `head` does once it has read enough, is no fault of the program.
#[test]
fn a_reader_that_ends_is_no_fault() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast-lab"));
    command.args(["coverage", "--records", "20", "--sizes", "5"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), complaint.contains("panicked")), (Some(141), false), "{complaint}");
}
