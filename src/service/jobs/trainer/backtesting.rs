//! Walk-forward jobs: first the trainings of each stretch, or the strategies of several assets, with a checkpoint each;
//! then the books.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{JobEnd, Worker, failed, reported, requested};
use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::evaluation::assets::report::AssetsBacktestReport;
use crate::control::evaluation::assets::rules::AssetsStrategy;
use crate::control::evaluation::assets::{AssetsBacktest, AssetsDecisions};
use crate::control::evaluation::backtest::Backtest;
use crate::control::evaluation::backtest_report::BacktestReport;
use crate::control::evaluation::declared_walk::{DeclaredWalk, WalkedStretch};
use crate::control::evaluation::walk_forward::{Decision, SharedWork};
use crate::control::progress::Watch;
use crate::control::request::backtest_assets::{AssetsBacktestRequest, BacktestQuestion};
use crate::control::request::declared_backtest::DeclaredBacktest;
use crate::control::{estimate, pool};
use crate::store::{ClaimedJob, JobOutcome};

impl Worker {
    pub(super) fn backtest(&self, claimed: &ClaimedJob, stop: &AtomicBool) -> Result<JobOutcome, JobEnd> {
        let request = match requested(claimed)? {
            BacktestQuestion::Asset(request) => request,
            BacktestQuestion::Assets(request) => return self.backtest_of_assets(claimed, &request, stop),
            BacktestQuestion::Declared(request) => return self.walk_of_declared(claimed, request, stop),
        };
        let backtest = Backtest::new(request).map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&estimate::backtest(&backtest, self.threads))?;
        let decisions = self.decided(claimed, &backtest, stop)?;
        reported(&BacktestReport::new(&backtest.walked(decisions)))
    }

    /// Runs a walk-forward of several assets. A checkpoint holds the decisions of a strategy, or of one of its policies.
    fn backtest_of_assets(
        &self,
        claimed: &ClaimedJob,
        request: &AssetsBacktestRequest,
        stop: &AtomicBool,
    ) -> Result<JobOutcome, JobEnd> {
        let backtest = AssetsBacktest::from_request(request).map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&estimate::backtest_of_assets(&backtest, request.returns().0, self.threads))?;
        let kept = Cache::new(estimate::kept_by_backtest_of_assets(&backtest, self.threads));
        let checkpoints = self.checkpoints(claimed)?;
        let watch = Watch { stop, progress: &|_| {} };
        let report = self.pool.install(|| {
            let balls = backtest.balls(&watch, &|| {})?;
            let decide = |(step, strategy): (usize, AssetsStrategy)| {
                let Some(walk) = backtest.fund_walk(strategy) else {
                    let decided = || backtest.decide(strategy, &balls, &watch, &|| {});
                    return self.checkpointed(claimed, &checkpoints, Some(step), decided);
                };
                let lived = walk.run(&watch, &kept, |index, tenure| {
                    self.checkpointed(claimed, &checkpoints, Some(step + index), tenure)
                });
                lived.map(AssetsDecisions::Lived)
            };
            let decided = pool::map(backtest.steps(), decide);
            let decided = decided.into_iter().collect::<Result<_, JobEnd>>()?;
            Ok::<_, JobEnd>(AssetsBacktestReport::new(&backtest.walked(&balls, decided)))
        })?;
        reported(&report)
    }

    /// Runs a walk-forward of a declared problem. A checkpoint holds the periods of a strategy from one training to the next.
    fn walk_of_declared(
        &self,
        claimed: &ClaimedJob,
        request: DeclaredBacktest,
        stop: &AtomicBool,
    ) -> Result<JobOutcome, JobEnd> {
        let walk = DeclaredWalk::new(request).map_err(|error| failed(error.to_string()))?;
        let _reserved = self.reserve(&walk.footprint(self.threads))?;
        let trainings = walk.trainings().iter().map(|first| estimate::kept_by_training(first.specification()));
        let kept = Cache::new(trainings.fold(0, usize::saturating_add));
        let checkpoints = self.checkpoints(claimed)?;
        let watch = Watch { stop, progress: &|_| {} };
        let stretch = |step: usize, live: &dyn Fn() -> Result<WalkedStretch, TrainError>| {
            self.checkpointed(claimed, &checkpoints, Some(step), live)
        };
        reported(&self.pool.install(|| walk.run(&kept, &watch, stretch))?)
    }

    /// Returns the decisions of each strategy in every period. The trainings of a stretch run in parallel: policy
    /// `index` of
    /// them is checkpoint `stretch * policies + index` of the job.
    fn decided(
        &self,
        claimed: &ClaimedJob,
        backtest: &Backtest,
        stop: &AtomicBool,
    ) -> Result<Vec<Vec<Decision>>, JobEnd> {
        let kept = Cache::new(estimate::kept_by_backtest(backtest, self.threads));
        let checkpoints = self.checkpoints(claimed)?;
        // Progress within one of several trainings says nothing about the others.
        let watch = Watch { stop, progress: &|_| {} };
        let strategies = backtest.plain_strategies();
        // Trained strategies come first.
        let policies = strategies.iter().filter(|strategy| strategy.is_trained()).count();
        let mut decisions: Vec<Vec<Decision>> = vec![Vec::new(); strategies.len()];
        for stretch in 0..backtest.walk.stretches(backtest.periods.len()) {
            let common = SharedWork::of(&strategies, kept.clone());
            let decide = |(index, strategy)| {
                let step = (index < policies).then_some(stretch * policies + index);
                let decided =
                    || backtest.walk.decide_stretch(strategy, &backtest.periods, stretch, &common, (&watch, &|| {}));
                self.checkpointed(claimed, &checkpoints, step, decided)
            };
            let numbered = strategies.iter().copied().enumerate().collect();
            let found = self.pool.install(|| pool::map(numbered, decide));
            for (all, decided) in decisions.iter_mut().zip(found) {
                all.extend(decided?);
            }
        }
        Ok(decisions)
    }

    /// Returns the checkpoints by step.
    fn checkpoints(&self, claimed: &ClaimedJob) -> Result<BTreeMap<usize, Vec<u8>>, JobEnd> {
        let job = claimed.row.job.as_str();
        let found: BTreeMap<usize, Vec<u8>> = self.runtime.block_on(self.store.checkpoints(job))?.into_iter().collect();
        self.board.resume(job, found.len());
        Ok(found)
    }

    /// Returns the decision of a step from its checkpoint, or decides now and saves it; without a step nothing is
    /// saved.
    fn checkpointed<T: Serialize + DeserializeOwned>(
        &self,
        claimed: &ClaimedJob,
        checkpoints: &BTreeMap<usize, Vec<u8>>,
        step: Option<usize>,
        decide: impl FnOnce() -> Result<T, TrainError>,
    ) -> Result<T, JobEnd> {
        let before = step.and_then(|step| checkpoints.get(&step));
        if let Some(decided) = before.and_then(|bytes| serde_json::from_slice(bytes).ok()) {
            return Ok(decided);
        }
        let decided = decide()?;
        step.map_or(Ok(()), |step| self.keep(claimed, step, &decided))?;
        Ok(decided)
    }

    fn keep(&self, claimed: &ClaimedJob, step: usize, decided: &impl Serialize) -> Result<(), JobEnd> {
        let bytes = serde_json::to_vec(decided)
            .map_err(|error| failed(format!("what was decided cannot be written as JSON: {error}")))?;
        let saving = self.store.save_checkpoint(&claimed.row.job, claimed.attempt, step, &bytes);
        if !self.runtime.block_on(saving)? {
            return Err(JobEnd::Fenced);
        }
        self.board.finish_step(&claimed.row.job);
        Ok(())
    }
}
