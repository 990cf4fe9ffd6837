//! A training's progress on the screen: a bar on a terminal, a line per step elsewhere.

use std::io::{IsTerminal, stderr};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Deserialize;
use serde_json::Value;

/// Fields that the demo reads of a job, from `GET /jobs/{id}` and from each of its events.
#[derive(Debug, Clone, Deserialize)]
pub struct DemoJob {
    pub job: String,
    pub state: String,
    pub progress: Option<DemoProgress>,
    pub policy: Option<String>,
    pub error: Option<Value>,
}

/// Steps finished, and progress of the running one, which is absent between two steps.
#[derive(Debug, Clone, Deserialize)]
pub struct DemoProgress {
    pub steps_done: usize,
    pub step: Option<usize>,
    pub points_done: Option<usize>,
    pub points_total: Option<usize>,
    pub seconds_left: Option<f64>,
}

impl DemoJob {
    pub fn is_over(&self) -> bool {
        matches!(self.state.as_str(), "succeeded" | "failed" | "cancelled")
    }
}

/// Positions of the bar per backward step.
const TICKS_PER_STEP: usize = 1000;

pub enum ProgressView {
    Bar(ProgressBar),
    Lines {
        last_step: Option<usize>,
    },
    /// Shows nothing, for a training too short to watch.
    Nothing,
}

impl ProgressView {
    pub fn new(horizon: usize) -> Self {
        if horizon == 1 {
            return ProgressView::Nothing;
        }
        if !stderr().is_terminal() {
            return ProgressView::Lines { last_step: None };
        }
        let bar = ProgressBar::new((horizon * TICKS_PER_STEP) as u64);
        if let Ok(style) = ProgressStyle::with_template("  [{bar:32}] {percent:>3} %  {msg}") {
            bar.set_style(style.progress_chars("=> "));
        }
        ProgressView::Bar(bar)
    }

    /// Shows one event.
    pub fn show(&mut self, progress: &DemoProgress) {
        match self {
            ProgressView::Bar(bar) => {
                bar.set_position(position(progress) as u64);
                bar.set_message(sentence(progress).unwrap_or_default());
            }
            ProgressView::Lines { last_step } if *last_step != progress.step => {
                *last_step = progress.step;
                sentence(progress).into_iter().for_each(|sentence| eprintln!("  {sentence}"));
            }
            ProgressView::Lines { .. } | ProgressView::Nothing => {}
        }
    }

    pub fn finish(self) {
        if let ProgressView::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

fn position(progress: &DemoProgress) -> usize {
    let (done, total) = (progress.points_done.unwrap_or(0), progress.points_total.unwrap_or(1));
    progress.steps_done * TICKS_PER_STEP + done * TICKS_PER_STEP / total.max(1)
}

/// Describes the progress of the running step; `None` between two steps.
fn sentence(progress: &DemoProgress) -> Option<String> {
    let DemoProgress { step, seconds_left, .. } = progress;
    let (done, total) = (progress.points_done.unwrap_or(0), progress.points_total.unwrap_or(0));
    let left = seconds_left.map_or(String::new(), |seconds| format!(", about {seconds:.0} s left"));
    step.map(|step| format!("step {step}, design point {done} of {total}{left}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_moves_by_steps_and_by_design_points_within() {
        let at = |steps_done, step, done, total| {
            position(&DemoProgress {
                steps_done,
                step,
                points_done: Some(done),
                points_total: Some(total),
                seconds_left: None,
            })
        };
        assert_eq!((at(0, None, 0, 0), at(0, Some(11), 30, 60)), (0, 500));
        assert_eq!((at(1, None, 0, 0), at(11, Some(0), 60, 60)), (1000, 12_000));
    }
}
