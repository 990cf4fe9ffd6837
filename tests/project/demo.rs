//! `ballast demo` as it is run the first time, to the page that it opens.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use crate::support::patience::patience;
use crate::support::process::Process;

#[tokio::test]
async fn the_demo_tells_both_acts_and_opens_its_page() {
    let folder = tempfile::tempdir().unwrap();
    // What opens a browser on a desktop writes down what it was asked to open.
    let (opener, opened) = (folder.path().join("xdg-open"), folder.path().join("opened"));
    fs::write(&opener, format!("#!/bin/sh\nprintf %s \"$1\" > {}\n", opened.display())).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
    let mut demo = Command::new(env!("CARGO_BIN_EXE_ballast"));
    demo.args(["demo", "--count", "30", "--open"]).env("PATH", path).stdout(Stdio::piped());
    let mut demo = demo.spawn().unwrap();
    let mut printed = Vec::new();
    // It writes to the end: what it writes to must stay open.
    let mut lines = BufReader::new(demo.stdout.take().unwrap()).lines().map(Result::unwrap);
    for line in lines.by_ref() {
        let last = line.contains("stays up on");
        printed.push(line);
        if last {
            break;
        }
    }
    let printed = printed.join("\n");
    for part in ["Advice for 2008-01: hold", "four industries", "Done in"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    let page = fs::read_to_string(&opened).unwrap();
    assert!(
        printed.ends_with(&format!("The service stays up on {} until Ctrl-C.", page.trim_end_matches('/'))),
        "{printed} {page}"
    );
    assert!(reqwest::get(&page).await.unwrap().text().await.unwrap().contains("<title>Ballast"));
    assert!(Command::new("kill").args(["-INT", &demo.id().to_string()]).status().unwrap().success());
    let ended = tokio::task::spawn_blocking(move || demo.wait().unwrap());
    assert!(tokio::time::timeout(patience(), ended).await.unwrap().unwrap().success());
}

/// The blocks of text that the README shows, line by line.
fn shown() -> Vec<Vec<String>> {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let blocks = page.split("```text\n").skip(1).map(|block| block.split("```").next().unwrap());
    blocks.map(|block| block.lines().map(str::to_owned).collect()).collect()
}

#[test]
fn the_readme_shows_what_advise_prints() {
    let mut advise = Command::new(env!("CARGO_BIN_EXE_ballast"));
    let advise = advise.current_dir(env!("CARGO_MANIFEST_DIR")).args(["advise", "data/us_market_monthly.csv"]);
    let printed = String::from_utf8(advise.output().unwrap().stdout).unwrap();
    assert_eq!(shown()[0], printed.lines().collect::<Vec<_>>());
}

/// The demo as the README tells to run it, as far as the README shows it: to the end of its first act.
#[test]
fn the_readme_shows_what_the_demo_prints() {
    let mut demo = Command::new(env!("CARGO_BIN_EXE_ballast"));
    let mut demo = Process(demo.arg("demo").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap());
    let mut printed = BufReader::new(demo.0.stdout.take().unwrap()).lines().map(Result::unwrap);
    let mut last = String::new();
    // The README leaves lines out, and says so.
    for line in shown()[1].iter().filter(|line| *line != "...") {
        let found = printed.find(|printed| {
            last.clone_from(printed);
            printed.trim_end() == line
        });
        assert!(found.is_some(), "the demo prints no line {line:?} there; it ended with {last:?}");
    }
}
