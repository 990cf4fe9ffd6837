//! The frontier of caution: for multiples of the radius, the cost of following the robust advice on records like the
//! given one, on average and from record to record.
//!
//! Three laws stand for the unknown one:
//!   smoothed         every past return, spread by a kernel (`laws`); records are independent draws of it,
//!   block            the past returns; records are blocks of consecutive returns, which keeps their dependence,
//!   without premium  the smoothed law moved down to the bank's mean, because the record may have been luck.
//! A record as long as the given one is drawn, and the advice at each multiple is solved on it. The law that the record
//! was drawn from scores the advice. The reported figure is the loss against the best allocation for that law,
//!
//!   lost(a) = 1e4 (ln CE(a*) - ln CE(a)),   CE(a) = U^-1( E[ U(w(a, Z)) ] ),
//!
//! in basis points, times the periods per year if they are known. For penalties by smooth divergences, a little
//! robustness costs the mean at second order and reduces the deviation at first (Gotoh, Kim and Lim 2021, Calibration
//! of distributionally robust empirical optimization models, Operations Research 69). For this ball neither holds: its
//! price is of first order.

mod laws;
pub mod report;
mod words;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use self::laws::RecordLaw;
use self::report::{Bootstrap, FORMAT, FrontierPoint, FrontierReport, ResampledFrontier};
use crate::control::assets::{PortfolioStep, advising};
use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::problem::utility::RelativeUtility;
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::annualised::premium;
use crate::control::request::frontier::FrontierQuestion;
use crate::control::uncertainty::joint::radius_factor;
use crate::control::uncertainty::radius::RadiusEstimator;
use crate::numerics::bridge::funds::fund_returns;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::statistics::summary::{Clustered, Estimate};
use crate::numerics::transport::water_filling::inverse_volatility;

/// Confidence level of all intervals.
const LEVEL: f64 = 0.9;
/// Basis points in one.
const BASIS_POINTS: f64 = 1e4;
/// Number of laws that records are drawn from.
const LAWS: usize = 3;
/// Step of a share in a finite difference of the worth.
const SHARE_STEP: f64 = 1e-5;
/// Number of progress reports.
const REPORTS: usize = 100;

/// A question, with everything that its answer needs prepared.
pub struct Frontier {
    question: FrontierQuestion,
    radii: RadiusEstimator,
    /// The radius for all funds at once divided by that for one, on the given record. Records drawn from it use the
    /// same factor, and also the same factor of a calibrated radius.
    factor: f64,
    utility: RelativeUtility,
}

/// The decisions on one record at every scale.
struct RecordDecisions {
    /// Loss at each scale, in the unit of the report.
    lost: Vec<f64>,
    /// Shares of wealth in the assets, at each scale.
    allocations: Vec<Vec<f64>>,
}

impl Frontier {
    /// Prepares the answer, with the cache `kept`.
    pub fn new(question: FrontierQuestion, kept: Cache) -> Self {
        let fund = &question.fund.problem;
        let factor = radius_factor(&question.assets.history, fund.radius_rule(), question.request.seed);
        let utility = advising::utility(fund);
        let radii = RadiusEstimator::new(&question.fund.clone().resolved(&kept), kept);
        Frontier { radii, factor, utility, question }
    }

    /// Computes the report. Cost: a robust step for each scale and resample.
    /// Checked by: `tests/service/frontier.rs`.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal; an asset that moves too rarely to be drawn.
    pub fn run(&self, watch: &Watch) -> Result<FrontierReport, TrainError> {
        let (request, assets) = (&self.question.request, &self.question.assets);
        let own = self.decide(&assets.history, watch)?;
        let smoothed = RecordLaw::smoothed(&assets.history, self.question.support, request.seed);
        let without = smoothed.without_premium(1.0 + self.question.fund.problem.rate_per_step);
        let (bandwidth, length) = (smoothed.bandwidth, self.question.block);
        let resampled: [(Bootstrap, RecordLaw); LAWS] = [
            (Bootstrap::Smoothed { bandwidth }, smoothed),
            (Bootstrap::Block { length }, RecordLaw::of(&assets.history)),
            (Bootstrap::WithoutPremium { bandwidth }, without),
        ];
        let done = AtomicUsize::new(0);
        let drawn = resampled.into_iter().map(|(kind, law)| self.resampled(kind, &law, &done, watch));
        let resampled = drawn.collect::<Result<Vec<ResampledFrontier>, TrainError>>()?;
        let (evidence, per_year) = (self.evidence(), assets.periods_per_year.is_some());
        Ok(FrontierReport {
            format: FORMAT.to_owned(),
            request: request.clone(),
            level: LEVEL,
            per_year,
            radius: self.radius(&assets.history),
            own,
            evidence,
            sentences: words::sentences(&resampled, evidence, per_year),
            resampled,
        })
    }

    /// Draws records from one law and scores the advice on them. `done` counts the records of all laws.
    fn resampled(
        &self,
        kind: Bootstrap,
        law: &RecordLaw,
        done: &AtomicUsize,
        watch: &Watch,
    ) -> Result<ResampledFrontier, TrainError> {
        let request = &self.question.request;
        let best = self.step(&law.rows, 0.0).solve(None).allocation;
        let best_worth = self.worth(law, &best);
        let resamples = self.question.resamples;
        let total = LAWS * resamples;
        let every = (total / REPORTS).max(1);
        let decide = |index: usize| {
            let rows = law.record(kind, self.question.assets.history.len(), request.seed, index)?;
            let allocations = self.decide(&rows, watch)?;
            let lost = allocations.iter().map(|allocation| self.unit() * (best_worth - self.worth(law, allocation)));
            let decided = RecordDecisions { lost: lost.collect(), allocations };
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if done.is_multiple_of(every) || done == total {
                (watch.progress)(StepProgress { step: 0, phase: Phase::Simulating, done, total });
            }
            Ok(decided)
        };
        let decided =
            (0..resamples).into_par_iter().map(decide).collect::<Result<Vec<RecordDecisions>, TrainError>>()?;
        let sample = Clustered::new(resamples, 1, LEVEL);
        let least = least_on_average(&decided);
        let points = request.scales.iter().enumerate().map(|(index, &scale)| {
            let lost: Vec<f64> = decided.iter().map(|decided| decided.lost[index]).collect();
            let apart: Vec<f64> = decided.iter().map(|decided| decided.lost[index] - decided.lost[least]).collect();
            let average = average(decided.iter().map(|decided| decided.allocations[index].as_slice()));
            let beyond =
                self.beyond_own_mix(law, &average, decided.iter().map(|one| one.allocations[index].as_slice()));
            let beyond_own_mix = sample.mean(&beyond);
            FrontierPoint {
                scale,
                lost: sample.mean(&lost),
                deviation: sample.variance(&lost).mapped(|variance| variance.max(0.0).sqrt()),
                beyond_least: (index != least).then(|| sample.mean(&apart)),
                // The worth is concave, so an average allocation is worth at least the average of the worths.
                beyond_own_mix: Estimate { high: beyond_own_mix.high.min(0.0), ..beyond_own_mix },
                total: average.iter().sum(),
            }
        });
        Ok(ResampledFrontier { bootstrap: kind, best, points: points.collect() })
    }

    /// Returns, for each record, the worth of its allocation less that of the average allocation, linearised in the
    /// average:
    ///
    ///   worth(a_i) - worth(mean a) - worth'(mean a) (a_i - mean a).
    ///
    /// The average is taken over the same records. Without the last term it would be treated as known.
    /// Checked by: `tests/service/frontier.rs::intervals_beyond_the_own_mix_are_as_wide_as_seeds_differ`.
    fn beyond_own_mix<'a>(
        &self,
        law: &RecordLaw,
        average: &[f64],
        allocations: impl Iterator<Item = &'a [f64]>,
    ) -> Vec<f64> {
        let worth = self.worth(law, average);
        let slope = |asset: usize| {
            let step = if average[asset] > 0.5 { -SHARE_STEP } else { SHARE_STEP };
            let mut moved = average.to_vec();
            moved[asset] += step;
            (self.worth(law, &moved) - worth) / step
        };
        let slopes: Vec<f64> = (0..average.len()).map(slope).collect();
        let part = |allocation: &[f64]| {
            let apart = allocation.iter().zip(average).zip(&slopes).map(|((own, mean), slope)| slope * (own - mean));
            self.unit() * (self.worth(law, allocation) - worth - apart.sum::<f64>())
        };
        allocations.map(part).collect()
    }

    /// Returns the advice at every scale on a record.
    fn decide(&self, rows: &[Vec<f64>], watch: &Watch) -> Result<Vec<Vec<f64>>, TrainError> {
        let radius = self.radius(rows);
        let mut near = None;
        let advise = |&scale: &f64| {
            watch.go_on()?;
            let solution = self.step(rows, scale * radius).solve(near.as_ref());
            let allocation = solution.allocation.clone();
            near = Some(solution);
            Ok(allocation)
        };
        self.question.request.scales.iter().map(advise).collect()
    }

    /// Returns the radius that the rule gives for a record.
    fn radius(&self, rows: &[Vec<f64>]) -> f64 {
        let fund = fund_returns(rows, &inverse_volatility(rows));
        self.factor * self.radii.radius(&EmpiricalDistribution::new(&fund))
    }

    fn step(&self, rows: &[Vec<f64>], radius: f64) -> PortfolioStep {
        let assets = &self.question.assets;
        let step = advising::step(assets, &self.question.fund.problem, rows, radius);
        step.within(assets.compositions(&vec![0.0; assets.assets.len()]))
    }

    /// Returns the log certainty equivalent of an allocation under a law, relative to the bank.
    fn worth(&self, law: &RecordLaw, allocation: &[f64]) -> f64 {
        let bank = 1.0 + self.question.fund.problem.rate_per_step;
        let of_row = |row: &Vec<f64>| {
            let excess: f64 = row.iter().zip(allocation).map(|(z, share)| share * (z.exp() / bank - 1.0)).sum();
            self.utility.value(excess.ln_1p())
        };
        self.utility.inverse(law.rows.iter().map(of_row).sum::<f64>() / law.rows.len() as f64)
    }

    /// Returns the basis points of a log certainty equivalent, per year if the periods per year are known.
    fn unit(&self) -> f64 {
        BASIS_POINTS * self.question.assets.periods_per_year.unwrap_or(1.0)
    }

    /// Returns by how many standard errors the record's mean simple return exceeds the bank's, in the
    /// inverse-volatility fund: `(mean - r) sqrt(n) / s`, s the sample deviation.
    /// Checked by: `tests/service/frontier.rs::at_the_record_itself_it_advises_as_advise_does`.
    fn evidence(&self) -> f64 {
        let rows = &self.question.assets.history;
        let fund = fund_returns(rows, &inverse_volatility(rows));
        let (premium, error) = premium(&fund, self.question.fund.problem.rate_per_step);
        premium / error
    }
}

/// Returns the average of allocations to the same assets.
fn average<'a>(allocations: impl ExactSizeIterator<Item = &'a [f64]>) -> Vec<f64> {
    let count = allocations.len() as f64;
    let add = |mut sum: Vec<f64>, allocation: &[f64]| {
        sum.resize(allocation.len(), 0.0);
        sum.iter_mut().zip(allocation).for_each(|(sum, share)| *sum += share / count);
        sum
    };
    allocations.fold(Vec::new(), add)
}

fn least_on_average(decided: &[RecordDecisions]) -> usize {
    let scales = decided.first().map_or(0, |decided| decided.lost.len());
    let total = |index: usize| decided.iter().map(|decided| decided.lost[index]).sum::<f64>();
    (0..scales).min_by(|&one, &other| total(one).total_cmp(&total(other))).unwrap_or(0)
}
