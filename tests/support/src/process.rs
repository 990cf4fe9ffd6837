//! The real binary.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A child process that is killed when its test ends.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns the program of the service, which cargo builds beside the folder of the tests.
pub fn binary() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    own.parent().and_then(|folder| folder.parent()).expect("the folder of a build").join("ballast")
}

/// Runs `ballast` with these arguments, without a store from the environment.
pub fn ballast(arguments: &[&str]) -> Output {
    let mut command = Command::new(binary());
    command.args(arguments).env_remove("BALLAST_DATA").env_remove("BALLAST_STORE").output().unwrap()
}

/// Starts `ballast serve` on a free port, with what `configure` adds; returns the process and its address.
pub fn serve(configure: impl FnOnce(&mut Command)) -> (Child, String) {
    try_serve(configure).unwrap_or_else(|(_, printed)| panic!("printed {printed:?}"))
}

/// Starts like [`serve`]; if the service does not begin to listen, returns the process and what it printed instead.
pub fn try_serve(configure: impl FnOnce(&mut Command)) -> Result<(Child, String), (Child, String)> {
    let mut command = quiet(Command::new(binary()));
    command.arg("serve");
    configure(&mut command);
    started(command)
}

/// Starts like [`serve`], with a command that finally executes the real binary.
pub fn serve_by(command: Command) -> (Child, String) {
    started(quiet(command)).unwrap_or_else(|(_, printed)| panic!("printed {printed:?}"))
}

fn quiet(mut command: Command) -> Command {
    command.env("BALLAST_LISTEN", "127.0.0.1:0").env("RUST_LOG", "warn").stdout(Stdio::piped());
    command
}

fn started(mut command: Command) -> Result<(Child, String), (Child, String)> {
    let mut child = command.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    match line.trim().strip_prefix("listening on ") {
        Some(url) => Ok((child, url.to_owned())),
        None => Err((child, line)),
    }
}

/// Returns the number of backward steps that the process at `url` has solved since it started.
pub async fn steps_solved(url: &str) -> usize {
    let metrics = reqwest::get(format!("{url}/metrics")).await.unwrap().text().await.unwrap();
    let count = "ballast_training_step_duration_seconds_count ";
    metrics.lines().find_map(|line| line.strip_prefix(count)).map_or(0, |number| number.parse().unwrap())
}
