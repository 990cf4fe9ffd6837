//! Progress of the work, with an estimate of the time left: a bar on a terminal, elsewhere a line now and then.

use std::io::{IsTerminal, stderr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Time until the first line, so that its estimate rests on finished parts.
const FIRST: Duration = Duration::from_secs(5);
/// Time from one line to the next.
const PAUSE: Duration = Duration::from_secs(30);

pub struct Parts {
    /// The bar, which draws only on a terminal.
    bar: ProgressBar,
    /// Noun for the parts.
    noun: &'static str,
    is_terminal: bool,
    started: Instant,
    /// Time at which the next line is written.
    next: Mutex<Instant>,
}

impl Parts {
    pub fn new(count: usize, noun: &'static str) -> Self {
        let bar = ProgressBar::new(count as u64);
        if let Ok(style) =
            ProgressStyle::with_template(&format!("  [{{bar:32}}] {{pos}} of {{len}} {noun}, {{eta}} left"))
        {
            bar.set_style(style.progress_chars("=> "));
        }
        let started = Instant::now();
        Parts { bar, noun, is_terminal: stderr().is_terminal(), started, next: Mutex::new(started + FIRST) }
    }

    pub fn one_more(&self) {
        self.bar.inc(1);
        self.say();
    }

    /// Shows that so many parts are done.
    pub fn reached(&self, done: usize) {
        self.bar.set_position(done as u64);
        self.say();
    }

    fn say(&self) {
        let mut next = self.next.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_terminal || Instant::now() < *next {
            return;
        }
        *next = Instant::now() + PAUSE;
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
        eprintln!("  {}", line(self.started.elapsed(), done, all, self.noun));
    }

    /// Removes the bar from the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Returns the time spent, the number of parts done, and the time left if the others take as long each.
fn line(spent: Duration, done: u64, all: u64, noun: &str) -> String {
    let left = spent.as_secs_f64() / done.max(1) as f64 * all.saturating_sub(done) as f64;
    format!("{:>6.0} s  {done} of {all} {noun}, about {} left", spent.as_secs_f64(), in_words(left))
}

fn in_words(seconds: f64) -> String {
    match seconds {
        _ if seconds < 100.0 => format!("{seconds:.0} s"),
        _ if seconds < 6000.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_estimated_from_what_is_done() {
        let shown = |seconds, done, all| line(Duration::from_secs(seconds), done, all, "steps");
        assert_eq!(shown(5, 10, 30), "     5 s  10 of 30 steps, about 10 s left");
        assert_eq!(shown(60, 12, 252), "    60 s  12 of 252 steps, about 20 min left");
        assert_eq!(shown(60, 12, 16_380), "    60 s  12 of 16380 steps, about 22.7 h left");
    }
}
