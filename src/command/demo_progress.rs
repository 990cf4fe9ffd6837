//! A training's progress on the screen: a bar on a terminal, a line a step elsewhere.

use std::io::{IsTerminal, stderr};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Deserialize;
use serde_json::Value;

/// What the demo reads of a job, from `GET /jobs/{id}` and from each of its events.
#[derive(Debug, Clone, Deserialize)]
pub struct Job {
    pub job: String,
    pub state: String,
    pub progress: Option<Progress>,
    pub policy: Option<String>,
    pub error: Option<Value>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct Progress {
    pub step: usize,
    pub done: usize,
    pub total: usize,
    pub seconds_left: Option<f64>,
}

impl Job {
    pub fn is_over(&self) -> bool {
        matches!(self.state.as_str(), "succeeded" | "failed" | "cancelled")
    }
}

/// Positions of the bar per backward step.
const TICKS_PER_STEP: usize = 1000;

pub enum ProgressView {
    Bar { bar: ProgressBar, horizon: usize },
    Lines { last_step: Option<usize> },
}

impl ProgressView {
    pub fn new(horizon: usize) -> Self {
        if !stderr().is_terminal() {
            return ProgressView::Lines { last_step: None };
        }
        let bar = ProgressBar::new((horizon * TICKS_PER_STEP) as u64);
        if let Ok(style) = ProgressStyle::with_template("  [{bar:32}] {percent:>3} %  {msg}") {
            bar.set_style(style.progress_chars("=> "));
        }
        ProgressView::Bar { bar, horizon }
    }

    /// Shows one event. Steps run backwards, from `horizon - 1` to 0.
    pub fn show(&mut self, progress: &Progress) {
        match self {
            ProgressView::Bar { bar, horizon } => {
                bar.set_position(position(*horizon, progress) as u64);
                bar.set_message(sentence(progress));
            }
            ProgressView::Lines { last_step } if *last_step != Some(progress.step) => {
                *last_step = Some(progress.step);
                eprintln!("  {}", sentence(progress));
            }
            ProgressView::Lines { .. } => {}
        }
    }

    pub fn finish(self) {
        if let ProgressView::Bar { bar, .. } = self {
            bar.finish_and_clear();
        }
    }
}

fn position(horizon: usize, progress: &Progress) -> usize {
    let steps_done = horizon.saturating_sub(progress.step + 1);
    steps_done * TICKS_PER_STEP + progress.done * TICKS_PER_STEP / progress.total.max(1)
}

fn sentence(progress: &Progress) -> String {
    let Progress { step, done, total, seconds_left } = progress;
    let left = seconds_left.map_or(String::new(), |seconds| format!(", about {seconds:.0} s left"));
    format!("step {step}, design point {done} of {total}{left}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_starts_at_the_horizon_and_ends_at_step_zero() {
        let at = |step, done| position(12, &Progress { step, done, total: 60, seconds_left: None });
        assert_eq!((at(11, 0), at(11, 60), at(10, 0), at(0, 60)), (0, 1000, 1000, 12_000));
    }
}
