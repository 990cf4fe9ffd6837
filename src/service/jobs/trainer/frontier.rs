//! Jobs that try radii on resampled records: one step, without a checkpoint.

use std::sync::atomic::AtomicBool;

use super::{JobEnd, Worker, failed, reported, requested};
use crate::control::cache::Cache;
use crate::control::estimate;
use crate::control::evaluation::frontier::Frontier;
use crate::control::progress::Watch;
use crate::control::request::frontier::FrontierRequest;
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn frontier(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, JobEnd> {
        let question = requested::<FrontierRequest>(claimed)?.question().map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&estimate::frontier(&question, self.threads))?;
        let kept = Cache::new(estimate::kept_by_frontier(&question));
        let frontier = Frontier::new(question, kept);
        let watch = Watch { stop, progress: &|progress| self.board.advance(&claimed.row.job, progress) };
        let report = self.pool.install(|| frontier.run(&watch))?;
        reported(&report)
    }
}
