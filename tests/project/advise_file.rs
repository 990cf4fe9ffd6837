//! `ballast advise` reads a file and answers what `POST /advise` answers; its transcript in the README is true.

use std::process::{Command, Output, Stdio};

use crate::support::App;
use serde_json::{Value, json};

const MARKET: &str = "data/us_market_monthly.csv";

fn ballast(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Columns 1 and 2 of the last rows of the bundled file.
fn last(count: usize) -> Vec<[f64; 2]> {
    let file = std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(MARKET)).unwrap();
    let number = |field: Option<&str>| field.unwrap().parse().unwrap();
    let mut rows: Vec<[f64; 2]> = file
        .lines()
        .skip(1)
        .map(|line| line.split(',').skip(1))
        .map(|mut fields| [number(fields.next()), number(fields.next())])
        .collect();
    rows.split_off(rows.len() - count)
}

/// As `head` does, which has read enough: nothing is told of it.
#[test]
fn who_reads_no_further_is_no_fault() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["advise", MARKET]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr).contains("panicked")), (Some(141), false), "{output:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn it_answers_what_the_service_answers_to_the_last_bit() {
    let app = App::start().await;
    let rows = last(480);
    let history: Vec<f64> = rows.iter().map(|[risky, _]| risky.ln_1p()).collect();
    let (equal, decay) = (json!({ "kind": "equal" }), json!({ "kind": "decay", "half_life": 240.0 }));
    for (rate, learning, arguments) in
        [(rows[479][1], equal, &[][..]), (0.0015, decay, &["--rate", "0.0015", "--half-life", "240"])]
    {
        let usual = ["advise", MARKET, "--window", "480", "--risk-aversion", "4.5", "--trading-cost", "0.004"];
        let more = ["--wealth", "80", "--holding", "0.25", "--json"];
        let output = ballast(&[&usual, &more[..], arguments].concat());
        assert!(output.status.success(), "{output:?}");
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let problem = json!({ "history": history, "rate_per_step": rate, "periods_per_year": 12,
            "trading_cost": 0.004, "learning": learning,
            "utility": { "kind": "power", "risk_aversion": 4.5 } });
        let question = json!({ "problem": problem, "wealth": 80.0, "holding": 0.25 });
        let (status, expected) = app.post("/advise", &question).await;
        assert_eq!((status.as_u16(), &found), (200, &expected));
        assert!(found["allocation"].as_f64().unwrap() > 0.0, "{found}");
        assert!(text(&output.stderr).starts_with("480 monthly returns, 1978-12 to 2018-11, "), "{output:?}");
    }
}

#[test]
fn what_is_wrong_is_said_by_line_or_option() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("returns.csv");
    std::fs::write(&path, "date,return\n2008-01,0.01\n2008-02,-0.04\n2008-03,0.02\n2008-05,0.02\n").unwrap();
    let file = path.to_str().unwrap();
    for (arguments, refusal) in [
        (&["advise", file][..], "the file does not say what the bank pays"),
        (&["advise", file, "--rate", "0.001"], "line 5: date is \"2008-05\": must be the month after 2008-03"),
        (&["advise", "no such file"], "reading no such file: "),
        (&["advise", MARKET, "--window", "2000"], "--window is 2000 of 1109: must be"),
        (&["advise", MARKET, "--rate", "2"], "--rate is 2: must be"),
        (&["advise", MARKET, "--holding", "1.5"], "--holding is 1.5: must be a number in [0, 1]"),
        (&["advise", MARKET, "--wealth", "0"], "--wealth is 0: must be a number in"),
        (&["advise", MARKET, "--trading-cost", "0.2"], "--trading-cost is 0.2: must be a number in [0, 0.1]"),
        (&["advise", MARKET, "--half-life", "0.5"], "--half-life is 0.5: must be a number in [1, "),
        (&["advise", MARKET, "--risk-aversion", "0.5"], "--risk-aversion is 0.5: must be a number in [1, 100]"),
        (
            &["backtest", MARKET, "--out", file, "--window", "1100"],
            "--window is 1100: must be at most 1097: the record has 1109 periods",
        ),
    ] {
        let output = ballast(arguments);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(text(&output.stderr).starts_with(&format!("ballast: {refusal}")), "{output:?}");
    }
}

#[test]
fn sixty_years_of_days_are_advised_and_more_than_eighty_need_a_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("days.csv");
    let first = jiff::civil::date(1960, 1, 1);
    let day = |day: i64| {
        format!("{},{}\n", first.checked_add(jiff::Span::new().days(day)).unwrap(), 0.001 * (day % 7 - 3) as f64)
    };
    std::fs::write(&path, format!("date,return\n{}", (0..20_001).map(day).collect::<String>())).unwrap();
    let arguments = ["advise", path.to_str().unwrap(), "--rate", "0"];
    let refused = ballast(&arguments);
    assert_eq!(
        text(&refused.stderr),
        "ballast: the file is 20001 values: must hold 2 to 20000 log-returns; --window keeps the last ones\n"
    );
    let named = ballast(&[&arguments[..], &["--window", "20001"]].concat());
    assert!(text(&named.stderr).starts_with("ballast: --window is 20001"), "{named:?}");
    let answered = ballast(&[&arguments[..], &["--window", "15000"]].concat());
    assert!(text(&answered.stdout).starts_with("15000 daily returns, 1973-09-10 to 2014-10-04, "), "{answered:?}");
}

#[test]
fn the_readme_shows_what_it_prints() {
    const COMMAND: &str = "\ncargo run --release -- advise ";
    let readme = std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let line = readme[readme.find(COMMAND).unwrap() + COMMAND.len()..].lines().next().unwrap();
    let arguments: Vec<&str> =
        ["advise"].into_iter().chain(line.split('#').next().unwrap().split_whitespace()).collect();
    let output = ballast(&arguments);
    assert!(output.status.success(), "{output:?}");
    let printed = text(&output.stdout);
    assert!(readme.contains(&format!("```text\n{printed}```")), "the README does not show\n{printed}");
}

/// Runs every command that a page shows after `$ `, in a folder with `data/` of its own.
#[cfg(unix)]
#[test]
fn the_pages_show_what_commands_print() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let binaries = std::path::Path::new(env!("CARGO_BIN_EXE_ballast")).parent().unwrap().to_str().unwrap();
    let path = format!("{binaries}:{}", std::env::var("PATH").unwrap());
    let mut shown = 0;
    for entry in std::fs::read_dir(root.join("docs")).unwrap() {
        let Ok(page) = std::fs::read_to_string(entry.unwrap().path()) else { continue };
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(root.join("data"), folder.path().join("data")).unwrap();
        let run = |line: &str| {
            let mut shell = Command::new("sh");
            shell.args(["-c", &format!("exec 2>&1\n{line}")]).current_dir(folder.path()).env("PATH", &path);
            text(&shell.output().unwrap().stdout)
        };
        page.lines().filter(|line| line.starts_with("cut ")).for_each(|line| drop(run(line)));
        for block in page.split("```text\n$ ").skip(1) {
            let block = format!("$ {}", block.split("```").next().unwrap());
            let (commands, printed): (Vec<&str>, Vec<&str>) = block.lines().partition(|line| line.starts_with("$ "));
            let found: String = commands.iter().map(|command| run(&command[2..])).collect();
            assert_eq!(found.lines().collect::<Vec<&str>>(), printed, "{commands:?}");
            shown += 1;
        }
    }
    assert_eq!(shown, 9);
}

/// Options by the year are refused by the year, and percent typed as a fraction with them.
#[test]
fn a_plan_is_refused_in_the_unit_that_was_typed() {
    for (option, value, refusal) in [
        ("--years", "50", "--years is 50: must lie in [1, 43]"),
        ("--inflation", "3", "--inflation is 3: must be a number in [-0.2, 0.5]"),
        ("--highest", "13", "--highest is 13: must be a number in [0.000012, 12]"),
        ("--wanted", "-12", "--wanted is -12: must be a number in [0.000012, "),
        ("--goal", "-1", "--goal is -1: must be a number in "),
        ("--certainty", "90", "--certainty is 90: must be a number in [0.5, 0.999]"),
    ] {
        let refused = text(&ballast(&["plan", MARKET, &format!("{option}={value}")]).stderr);
        assert!(refused.starts_with(&format!("ballast: {refusal}")), "{option}: {refused}");
    }
}

#[test]
fn named_columns_are_an_asset_each() {
    let root = env!("CARGO_MANIFEST_DIR");
    let file = format!("{root}/data/us_industries_monthly.csv");
    let arguments = ["advise", &file, "--window", "120", "--column", "energy", "--column", "utilities"];
    let answered = ballast(&[&arguments[..], &["--json"]].concat());
    let advised: serde_json::Value = serde_json::from_str(&text(&answered.stdout)).unwrap();
    let held = advised["allocation"].as_object().unwrap();
    assert_eq!(held.keys().collect::<Vec<_>>(), ["energy", "utilities"]);
    let total: f64 = held.values().map(|share| share.as_f64().unwrap()).sum();
    assert!((total - advised["total"].as_f64().unwrap()).abs() < 1e-12 && total > 0.0, "{advised}");
    let printed = text(&ballast(&arguments).stdout);
    for part in
        ["of wealth in these assets through the coming month", "\n  energy ", "\n  utilities ", "Caution is balanced"]
    {
        assert!(printed.contains(part), "{printed}");
    }
    let held = ballast(&[&arguments[..], &["--holding", "energy=0.4", "--trading-cost", "0.05", "--json"]].concat());
    let held: serde_json::Value = serde_json::from_str(&text(&held.stdout)).unwrap();
    // At such a cost nothing is bought, and no more sold than what is too much.
    assert!(held["trade"]["utilities"] == 0.0 && held["allocation"]["energy"].as_f64().unwrap() > 0.0, "{held}");
    let limited = ballast(&[&arguments[..], &["--limits", r#"{"each": {"max": 0.5}}"#, "--json"]].concat());
    let limited: serde_json::Value = serde_json::from_str(&text(&limited.stdout)).unwrap();
    assert!((limited["composition"]["energy"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{limited}");
    for (options, refusal) in [
        (&["--limits", r#"{"each": {"max": 0.4}}"#][..], "--limits assets is greatest shares that sum to 0.8: must be"),
        (&["--holding", "0.1"], "--holding is 0.1: must be COLUMN=SHARE if there are several assets, each column once"),
        (&["--holding", "energy=0.1", "--holding", "energy=0.2"], "--holding is energy=0.2: must be COLUMN=SHARE"),
        (&["--holding", "coal=0.1"], "--holding is coal=0.1: must name one of the assets: energy, utilities"),
        (
            &["--holding", "energy=0.6", "--holding", "utilities=0.6"],
            "--holding is shares summing to 1.2: must sum to at most 1",
        ),
        (&["--holding", "energy=1.5"], "--holding is energy=1.5: must be a number in [0, 1]"),
        (&["--half-life", "12"], "--half-life is given with 2 assets: must be left out"),
    ] {
        let refused = text(&ballast(&[&arguments[..], options].concat()).stderr);
        assert!(refused.starts_with(&format!("ballast: {refusal}")), "{options:?}: {refused}");
    }
    // Not named, they are asked for: a file of prices has more columns than assets.
    assert!(text(&ballast(&["advise", &file]).stderr).contains("--column"));
}
