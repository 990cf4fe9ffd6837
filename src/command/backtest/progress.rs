//! How many parts of the work are done: a bar on a terminal, elsewhere a line now and then.

use std::io::{IsTerminal, stderr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// From one line to the next.
const PAUSE: Duration = Duration::from_secs(30);

pub struct Parts {
    /// Draws itself on a terminal alone.
    bar: ProgressBar,
    /// What the parts are.
    noun: &'static str,
    is_terminal: bool,
    started: Instant,
    /// When the last line was written.
    told: Mutex<Option<Instant>>,
}

impl Parts {
    pub fn new(count: usize, noun: &'static str) -> Self {
        let bar = ProgressBar::new(count as u64);
        if let Ok(style) =
            ProgressStyle::with_template(&format!("  [{{bar:32}}] {{pos}} of {{len}} {noun}, {{eta}} left"))
        {
            bar.set_style(style.progress_chars("=> "));
        }
        Parts { bar, noun, is_terminal: stderr().is_terminal(), started: Instant::now(), told: Mutex::new(None) }
    }

    pub fn one_more(&self) {
        self.bar.inc(1);
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_terminal || told.is_some_and(|at| at.elapsed() < PAUSE) {
            return;
        }
        *told = Some(Instant::now());
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
        eprintln!("  {:>6.0} s  {done} of {all} {}", self.started.elapsed().as_secs_f64(), self.noun);
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
