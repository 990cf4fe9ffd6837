//! `ballast demo` as it is run the first time, to the page that it opens.

mod support;

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use support::patience::patience;

#[tokio::test]
async fn the_demo_tells_both_acts_and_opens_its_page() {
    let folder = tempfile::tempdir().unwrap();
    // What opens a browser on a desktop writes down what it was asked to open.
    let (opener, asked) = (folder.path().join("xdg-open"), folder.path().join("asked"));
    fs::write(&opener, format!("#!/bin/sh\nprintf %s \"$1\" > {}\n", asked.display())).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
    let mut demo = Command::new(env!("CARGO_BIN_EXE_ballast"));
    demo.args(["demo", "--count", "30", "--open"]).env("PATH", path).stdout(Stdio::piped());
    let mut demo = demo.spawn().unwrap();
    let mut told = Vec::new();
    // It writes to the end: what it writes to must stay open.
    let mut lines = BufReader::new(demo.stdout.take().unwrap()).lines().map(Result::unwrap);
    for line in lines.by_ref() {
        let last = line.contains("stays up on");
        told.push(line);
        if last {
            break;
        }
    }
    let told = told.join("\n");
    for part in ["Told for 2008-01: hold", "four industries", "Done in"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let page = fs::read_to_string(&asked).unwrap();
    assert!(
        told.ends_with(&format!("The service stays up on {} until Ctrl-C.", page.trim_end_matches('/'))),
        "{told} {page}"
    );
    assert!(reqwest::get(&page).await.unwrap().text().await.unwrap().contains("<title>Ballast"));
    assert!(Command::new("kill").args(["-INT", &demo.id().to_string()]).status().unwrap().success());
    let ended = tokio::task::spawn_blocking(move || demo.wait().unwrap());
    assert!(tokio::time::timeout(patience(), ended).await.unwrap().unwrap().success());
}
