//! Deliberate faults: the real binary is killed, starved, disconnected and given false data. Then everything that it
//! acknowledged is requested from it. Prints a table; fails if anything is lost, doubled, stale or panicked, or if no
//! row ran.
//!
//! `cargo test --test reliability` is the short form. `cargo test --test reliability -- --trials 100 kill` runs a hundred
//! trials of every row whose name contains `kill`; `BALLAST_RELIABILITY_TRIALS` does the same for all rows, and
//! `BALLAST_ATTACK_SECONDS` has attacks of one tenant on another last longer than two seconds. Rows that need
//! root, a loop device, strace or PostgreSQL say so where they have to be left out; under `BALLAST_RELIABILITY=required`
//! none may be.
//!
//! Not here: random lists of operations against a model of the store, which `tests/service/store_model.rs` runs on both
//! engines.

mod caller;
mod damage;
mod disk;
mod kills;
mod ledger;
mod load;
mod mount;
mod moved;
mod neighbours;
mod power;
mod replicas;
mod scene;
mod server;
mod storm;
mod syncs;
mod tenants;
mod tracer;
mod unread;
mod work;

use ballast_test_support as support;

use std::process::ExitCode;
use std::time::Instant;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;

use crate::scene::{Outcome, Tally};

/// The most complaints printed for a row; the first is the most informative.
const COMPLAINTS: usize = 10;

struct Row {
    fault: &'static str,
    /// The number of trials in the short form.
    trials: usize,
    run: fn(usize) -> BoxFuture<'static, Outcome>,
    /// True for a control, which must lose what it is made to lose. If it lost nothing, zeros in other rows would mean
    /// nothing.
    control: bool,
}

macro_rules! row {
    ($fault:literal, $trials:literal, $run:path) => {
        Row { fault: $fault, trials: $trials, run: |trials| $run(trials).boxed(), control: false }
    };
    (control $fault:literal, $trials:literal, $run:path) => {
        Row { control: true, ..row!($fault, $trials, $run) }
    };
}

const ROWS: &[Row] = &[
    row!("kill -9 under load", 8, kills::killed),
    row!("SIGTERM under load", 4, kills::terminated),
    row!("retry storm, 16 clients", 2, storm::storm),
    row!("disk full, then freed", 3, disk::full),
    row!("power cut under load", 4, power::cut),
    row!(control "power cut, fsync ignored", 1, power::cut_without_fsync),
    row!("I/O error at an fsync", 4, syncs::failed),
    row!("kill -9 at an fsync", 4, syncs::killed),
    row!("damaged bytes on disk", 60, damage::flipped),
    row!("replicas and database", 1, replicas::crashed),
    row!("strangers, reads fail", 1, neighbours::strangers),
    row!("jobs larger than memory", 1, neighbours::overreachers),
    row!("policies beyond memory", 1, neighbours::hoarders),
    row!("connections, streams held", 1, neighbours::holders),
    row!("large jobs listed", 1, neighbours::listers),
    row!("queues filled by another", 1, neighbours::crowds),
    row!("answers that nobody reads", 1, unread::unread),
    row!("replays after a kill", 1, unread::replayed),
    row!("batches of reports", 1, work::batches),
    row!("searches of another", 1, work::searches),
    row!("largest question of twenty", 1, work::questions),
    row!("database moved or replaced", 6, moved::moved),
];

/// Returns the number of trials from the command line or the environment, and the parts of names that select rows.
fn arguments() -> (Option<usize>, Vec<String>) {
    let mut trials = std::env::var("BALLAST_RELIABILITY_TRIALS").ok();
    let (mut given, mut names) = (std::env::args().skip(1), Vec::new());
    while let Some(argument) = given.next() {
        match argument.as_str() {
            "--trials" => trials = given.next(),
            flag if flag.starts_with("--") => {} // meant for the usual harness
            _ => names.push(argument),
        }
    }
    (trials.map(|count| count.parse().expect("--trials takes a number")), names)
}

#[tokio::main]
async fn main() -> ExitCode {
    let (trials, names) = arguments();
    let started = Instant::now();
    println!("{}", header());
    let mut verdicts = Vec::new();
    for row in ROWS {
        if names.is_empty() || names.iter().any(|name| row.fault.contains(name.as_str())) {
            let running = tokio::spawn((row.run)(trials.unwrap_or(row.trials)));
            verdicts.push(report(row, running.await.unwrap_or_else(|panic| Err(panic.to_string()))));
        }
    }
    println!("{} rows in {} s", verdicts.len(), started.elapsed().as_secs());
    if !verdicts.iter().any(|&verdict| verdict != Verdict::LeftOut) {
        println!("FAILED: no row ran; there are {}", ROWS.iter().map(|row| row.fault).collect::<Vec<_>>().join("; "));
        return ExitCode::FAILURE;
    }
    if verdicts.contains(&Verdict::Unsound) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// The outcome is as required.
    Sound,
    Unsound,
    LeftOut,
}

fn header() -> String {
    let [trials, faults, acknowledged, lost] = ["trials", "faults", "acknowledged", "lost"];
    let [doubled, stale, panics, ready] = ["doubled", "stale", "panics", "ready in"];
    let counts = format!("{acknowledged:>14}{lost:>6}{doubled:>9}{stale:>7}{panics:>8}");
    format!("{:<30}{trials:>7}{faults:>8}{counts}{ready:>11}", "fault")
}

/// Prints the row and returns its verdict.
fn report(row: &Row, outcome: Outcome) -> Verdict {
    let tally = match outcome {
        Ok(Some(tally)) => tally,
        Ok(None) => return Verdict::LeftOut,
        Err(reason) => {
            println!("{:<30} FAILED: {reason}", row.fault);
            return Verdict::Unsound;
        }
    };
    let Tally { trials, faults, audit, stale, panics, ready, complaints, note, .. } = &tally;
    println!(
        "{:<30}{trials:>7}{faults:>8}{:>14}{:>6}{:>9}{stale:>7}{panics:>8}{:>8} ms  {note}",
        row.fault,
        audit.acknowledged,
        audit.lost,
        audit.doubled,
        ready.as_millis(),
    );
    complaints.iter().take(COMPLAINTS).for_each(|complaint| println!("    {complaint:.300}"));
    let sound = if row.control { audit.lost > 0 } else { tally.is_sound() };
    if sound { Verdict::Sound } else { Verdict::Unsound }
}
