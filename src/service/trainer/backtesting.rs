//! Walk-forward jobs: the trainings from one stretch to the next, a checkpoint each; then the books.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use super::{Ended, Worker, failed, reported, requested};
use crate::control::estimate;
use crate::control::evaluation::backtest::Backtest;
use crate::control::evaluation::backtest_report::BacktestReport;
use crate::control::evaluation::rolling::{Common, Decision};
use crate::control::kept::Kept;
use crate::control::pool;
use crate::control::progress::Watch;
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn backtest(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, Ended> {
        let backtest = Backtest::new(requested(claimed)?).map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&estimate::backtest(&backtest, self.threads))?;
        let decisions = self.decided(claimed, &backtest, stop)?;
        reported(&BacktestReport::new(&backtest.walked(decisions)))
    }

    /// What each strategy decided in every period. The trainings of a stretch run side by side: policy `index` of them is
    /// checkpoint `stretch * policies + index` of the job.
    fn decided(
        &self,
        claimed: &ClaimedJob,
        backtest: &Backtest,
        stop: &AtomicBool,
    ) -> Result<Vec<Vec<Decision>>, Ended> {
        let job = claimed.row.job.as_str();
        let kept = Kept::new(estimate::kept_by_backtest(backtest, self.threads));
        let found = self.runtime.block_on(self.store.checkpoints(job))?;
        let checkpoints: BTreeMap<usize, Vec<u8>> = found.into_iter().collect();
        self.board.resume(job, checkpoints.len());
        // Progress within one of several trainings says nothing of the others.
        let watch = Watch { stop, progress: &|_| {} };
        let strategies = backtest.plain_strategies();
        // They stand first.
        let policies = strategies.iter().filter(|strategy| strategy.is_trained()).count();
        let mut decisions: Vec<Vec<Decision>> = vec![Vec::new(); strategies.len()];
        for stretch in 0..backtest.walk.stretches(backtest.periods.len()) {
            let common = Common::of(&strategies, kept.clone());
            let decide = |(index, strategy)| -> Result<Vec<Decision>, Ended> {
                let step = (index < policies).then_some(stretch * policies + index);
                let before = step.and_then(|step| checkpoints.get(&step));
                if let Some(decided) = before.and_then(|bytes| serde_json::from_slice(bytes).ok()) {
                    return Ok(decided);
                }
                let decided = backtest.walk.decide_stretch(strategy, &backtest.periods, stretch, &common, &watch)?;
                step.map_or(Ok(()), |step| self.keep(claimed, step, &decided))?;
                Ok(decided)
            };
            let numbered = strategies.iter().copied().enumerate().collect();
            let found = self.pool.install(|| pool::map(numbered, decide));
            for (all, decided) in decisions.iter_mut().zip(found) {
                all.extend(decided?);
            }
        }
        Ok(decisions)
    }

    fn keep(&self, claimed: &ClaimedJob, step: usize, decided: &[Decision]) -> Result<(), Ended> {
        let bytes = serde_json::to_vec(decided)
            .map_err(|error| failed(format!("what was decided cannot be written as JSON: {error}")))?;
        let saving = self.store.save_checkpoint(&claimed.row.job, claimed.attempt, step, &bytes);
        if !self.runtime.block_on(saving)? {
            return Err(Ended::Fenced);
        }
        self.board.finish_step(&claimed.row.job);
        Ok(())
    }
}
