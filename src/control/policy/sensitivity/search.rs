//! Computes the advice for other records, and finds the changes of advice between them.

use super::bisection::{least_count, parted};
use super::sentences::SensitivityText;
use super::{
    AT_AN_END, AdviceByRecord, LeftOut, MOST_PERIODS, NextAdvice, NextReturn, Premium, ReturnAndLog, Sensitivity,
    WithoutOne, is_invested,
};
use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::caution::Caution;
use crate::control::pool;
use crate::control::problem::state::State;
use crate::control::request::frequency::Frequency;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::rules;
use crate::control::request::specification::{ProblemSpecification, Specification};
use crate::control::request::support::Interval;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::statistics::summary::interpolated_quantile;

/// Most returns that are left out in turn: all of thirty years of months.
const MOST_LEFT_OUT: usize = 360;
/// Fewest returns that are left out in turn, however long a step takes.
const FEWEST_LEFT_OUT: usize = 32;
/// Largest product of the numbers of returns and of simulated bridges at which [`MOST_LEFT_OUT`] returns are left out.
/// A step then takes about 10 ms. If a step takes longer, fewer returns are left out.
const CHEAP_BRIDGED: usize = 2_880_000;
/// The product of the numbers of returns and of design points that is as cheap: that of 250 returns at the default.
const CHEAP_DESIGNED: usize = 250_000;
/// Largest product of the numbers of returns and of design points: three times the cheap one.
pub const MOST_DESIGNED: usize = 750_000;
/// Quantiles of the record at which a next return is tried.
const QUANTILES: [f64; 2] = [0.05, 0.95];
/// Distance of a next return beyond the extremes of the record, at most, as a share of the distance between them.
const WIDENED: f64 = 0.5;
/// Number of equal parts of the range of next returns.
const PARTS: usize = 48;
/// Share of the action interval beyond which a change of the advice counts as large.
const FAR: f64 = 0.5;

/// An advice, and functions that compute the advice in other cases.
pub(in crate::control::policy) struct AdviceVariants<'a> {
    /// The record, in the order in which the returns came.
    record: &'a [f64],
    advice: &'a Advice,
    problem: &'a ProblemSpecification,
    /// The highest allocation that may be advised.
    highest: f64,
    /// Number of design points of the next step's value.
    design: usize,
    /// Returns the allocation for another record.
    of: AdviceByRecord<'a>,
    /// Returns the allocation for another radius.
    within: &'a (dyn Fn(f64) -> f64 + Sync),
}

impl Advisor {
    /// Returns the sensitivity of `advice`, which was found by `mode` for the period after `step` observed periods in
    /// `state`, whose law is that of `record`. Cost: one advice for each return left out, at most 360, and some 130
    /// more, on the rayon pool this is called from.
    pub fn sensitivity(
        &self,
        step: usize,
        state: &State,
        record: &[f64],
        (advice, mode): (&Advice, AdviceMode),
    ) -> Sensitivity {
        let of = |record: &[f64]| {
            let state = State { law: self.specification().problem.learning.law(record), ..*state };
            self.advise(step, &state, mode).allocation
        };
        self.with_variants(step, state, record, (advice, &of), |variants| variants.sensitivity())
    }

    /// Answers from the variants of `advice`, with `of` computing the allocation for another record.
    pub(in crate::control::policy) fn with_variants<T>(
        &self,
        step: usize,
        state: &State,
        record: &[f64],
        (advice, of): (&Advice, AdviceByRecord<'_>),
        answer: impl FnOnce(&AdviceVariants<'_>) -> T,
    ) -> T {
        let within = |radius: f64| self.explain_within(step, state, radius).0.allocation;
        let problem = &self.specification().problem;
        let (highest, design) = (self.highest_action(step, state), self.designed());
        answer(&AdviceVariants { record, advice, problem, highest, design, of, within: &within })
    }

    /// Returns the number of design points of the value after a step; 0 if the step is the last.
    fn designed(&self) -> usize {
        let Specification { problem, design, .. } = self.specification();
        if problem.horizon == 1 { 0 } else { design.count.unwrap_or_default() }
    }

    /// Checks that the sensitivity of advice from so many `returns` may be computed: its cost must be bounded.
    ///
    /// # Errors
    /// The framework does not learn from returns, or the number of returns times that of design points is too large.
    /// The error names the field `sensitivity`.
    pub fn check_sensitivity(&self, returns: usize) -> Result<(), FieldError> {
        let problem = &self.specification().problem;
        check_learning(problem, problem.framework.learns())?;
        let found = returns.saturating_mul(self.designed());
        if found <= MOST_DESIGNED {
            return Ok(());
        }
        let rule = format!(
            "must be left out if returns times design.count exceeds {MOST_DESIGNED}: here it is {found}. Use POST \
             /advise for the \
             sensitivity over the same returns, or train with a smaller design.count"
        );
        Err(FieldError::new("sensitivity", true, rule))
    }
}

/// Checks that some return changes the advice.
pub(in crate::control::policy) fn check_learning(
    problem: &ProblemSpecification,
    learns: bool,
) -> Result<(), FieldError> {
    if learns {
        return Ok(());
    }
    let rule =
        format!("must be left out: under the framework {} no return changes the advice", problem.framework.name());
    Err(FieldError::new("sensitivity", true, rule))
}

impl AdviceVariants<'_> {
    pub(in crate::control::policy) fn sensitivity(&self) -> Sensitivity {
        let without_one = self.without_one();
        let next_return = self.next_return();
        let premium = self.premium_now();
        let caution = without_one.and_then(|range| self.hangs_on_one(range));
        let text = SensitivityText {
            allocation: self.advice.allocation,
            highest: self.highest,
            returns: self.record.len(),
            selected: without_one.is_some_and(|range| range.tried == self.most_left_out()),
            noun: Frequency::noun_for(self.problem.periods_per_year),
        };
        let sentences = text.sentences(without_one.as_ref(), &next_return, &premium);
        Sensitivity { without_one, next_return, premium, sentences, caution }
    }

    /// Returns the premium at which the advice leaves the bank.
    pub(in crate::control::policy) fn premium_now(&self) -> Premium {
        let (needed, periods_more) = pool::join(|| self.needed(), || self.periods_until(AT_AN_END));
        Premium { present: self.present(), needed, periods_more }
    }

    /// Leaves out each return in turn. With equal weights, equal returns leave equal records and are left out once.
    fn without_one(&self) -> Option<WithoutOne> {
        let mut order: Vec<usize> = (0..self.record.len()).collect();
        order.sort_by(|&one, &other| self.record[one].total_cmp(&self.record[other]).then(one.cmp(&other)));
        let alike =
            |one: usize, other: usize| !self.problem.learning.decays() && self.record[one] == self.record[other];
        order.dedup_by(|later, first| alike(*later, *first));
        let order = self.telling(order);
        let tried = order.len();
        let found = pool::map(order, |index| {
            let rest = [&self.record[..index], &self.record[index + 1..]].concat();
            rules::history("history", &rest, self.problem.learning).ok()?;
            let ReturnAndLog { log_return, simple_return } = ReturnAndLog::of(self.record[index]);
            Some(LeftOut { index, log_return, simple_return, allocation: (self.of)(&rest) })
        });
        let by_allocation = |one: &&LeftOut, other: &&LeftOut| one.allocation.total_cmp(&other.allocation);
        let left_out = || found.iter().flatten();
        let (lowest, highest) = (*left_out().min_by(by_allocation)?, *left_out().max_by(by_allocation)?);
        Some(WithoutOne { lowest, highest, tried })
    }

    /// Picks the returns that move the advice the most, if leaving out each would take too long. Half of them are
    /// furthest from the mean by their weight. The others are spread evenly by rank, because the advice changes
    /// smoothly with the return left out. `order` is ascending by return, and so is the result.
    fn telling(&self, order: Vec<usize>) -> Vec<usize> {
        let most = self.most_left_out();
        if order.len() <= most {
            return order;
        }
        let (weights, mean) = (self.problem.learning.weights(self.record.len()), self.mean());
        let pull = |rank: &usize| weights[order[*rank]] * (self.record[order[*rank]] - mean).abs();
        let mut ranks: Vec<usize> = (0..order.len()).collect();
        ranks.sort_by(|one, other| pull(other).total_cmp(&pull(one)));
        let mut between = ranks.split_off(most.div_ceil(2));
        between.sort_unstable();
        let evenly = most - ranks.len();
        ranks.extend((0..evenly).map(|index| between[index * (between.len() - 1) / (evenly - 1)]));
        ranks.sort_unstable();
        ranks.into_iter().map(|rank| order[rank]).collect()
    }

    /// Returns how many returns are left out in turn: fewer if a step takes longer.
    fn most_left_out(&self) -> usize {
        let returns = self.record.len() as f64;
        let bridged = returns * self.problem.radius_rule().paths() as f64 / CHEAP_BRIDGED as f64;
        let designed = returns * self.design as f64 / CHEAP_DESIGNED as f64;
        let most = MOST_LEFT_OUT as f64 / bridged.max(designed).max(1.0);
        (most as usize).max(FEWEST_LEFT_OUT)
    }

    fn mean(&self) -> f64 {
        self.problem.learning.mean(self.record, |log_return| log_return)
    }

    /// Warns of the end of the range that is further from the advice, if it is far, or if exactly one of the two is the
    /// bank alone.
    fn hangs_on_one(&self, WithoutOne { lowest, highest, .. }: WithoutOne) -> Option<Caution> {
        let present = self.advice.allocation;
        let change = |left_out: &LeftOut| (left_out.allocation - present).abs();
        let is_another = |left_out: &LeftOut| {
            is_invested(left_out.allocation) != is_invested(present) || change(left_out) > FAR * self.highest
        };
        let ends = [lowest, highest].into_iter().filter(is_another);
        let worst = ends.max_by(|one, other| change(one).total_cmp(&change(other)))?;
        Some(Caution::one_return(worst.simple_return, worst.allocation, present))
    }

    fn next_return(&self) -> NextReturn {
        let ([lowest, highest], [low, high]) = (self.extremes(), self.bounds());
        let widened = WIDENED * (highest - lowest);
        let range = [(lowest - widened).max(low), (highest + widened).min(high)];
        let sorted = EmpiricalDistribution::new(self.record);
        let quantile = |share| interpolated_quantile(sorted.atoms(), share);
        let part = (range[1] - range[0]) / PARTS as f64;
        let grid: Vec<f64> = (0..=PARTS).map(|index| (range[0] + part * index as f64).min(range[1])).collect();
        let tried = grid.iter().copied().chain(QUANTILES.map(quantile)).collect();
        let allocations = pool::map(tried, |log_return| self.after(log_return));
        let crossing = |is_above: &(dyn Fn(f64) -> bool + Sync)| {
            let pairs = grid.windows(2).zip(allocations.windows(2));
            let crossed = pairs
                .filter(|(_, allocations)| !is_above(allocations[0]) && is_above(allocations[1]))
                .map(|(ends, _)| ends);
            let median = quantile(0.5);
            let away = |ends: &&[f64]| (ends[0] - median).max(median - ends[1]).max(0.0);
            let nearest = crossed.min_by(|one, other| away(one).total_cmp(&away(other)))?;
            Some(parted([nearest[0], nearest[1]], |log_return| is_above(self.after(log_return))))
        };
        let (bank, top) =
            pool::join(|| crossing(&is_invested), || crossing(&|allocation| allocation >= self.highest - AT_AN_END));
        let next = |index: usize| {
            let ReturnAndLog { log_return, simple_return } = ReturnAndLog::of(quantile(QUANTILES[index]));
            let allocation = allocations[grid.len() + index];
            NextAdvice { quantile: QUANTILES[index], log_return, simple_return, allocation }
        };
        NextReturn {
            range,
            to_bank: bank.map(|[below, _]| ReturnAndLog::of(below)),
            to_highest: top.map(|[_, above]| ReturnAndLog::of(above)),
            low: next(0),
            high: next(1),
        }
    }

    /// Returns the allocation after one more return, `log_return`.
    fn after(&self, log_return: f64) -> f64 {
        (self.of)(&[self.record, &[log_return]].concat())
    }

    fn present(&self) -> f64 {
        self.premium(0.0)
    }

    /// Returns the mean simple return of the record with every log-return shifted by `shift`, less the bank's rate.
    fn premium(&self, shift: f64) -> f64 {
        self.problem.learning.mean(self.record, |log_return| (log_return + shift).exp_m1()) - self.problem.rate_per_step
    }

    fn needed(&self) -> Option<f64> {
        let ([lowest, highest], [low, high]) = (self.extremes(), self.bounds());
        let width = highest - lowest;
        let leaves = |shift: f64| {
            let shifted: Vec<f64> = self.record.iter().map(|log_return| log_return + shift).collect();
            is_invested((self.of)(&shifted))
        };
        let far =
            if is_invested(self.advice.allocation) { (low - lowest).max(-width) } else { width.min(high - highest) };
        if is_invested(self.advice.allocation) == leaves(far) {
            return None;
        }
        let [_, shift] = parted([far.min(0.0), far.max(0.0)], leaves);
        Some(self.premium(shift))
    }

    /// Returns the number of further returns after which more than `share` is advised.
    pub(in crate::control::policy) fn periods_until(&self, share: f64) -> Option<usize> {
        if self.advice.allocation > share {
            return Some(0);
        }
        if let RadiusRule::Fixed { .. } = self.problem.radius_rule() {
            return None;
        }
        let size = |more: usize| self.problem.learning.effective_size(self.record.len() + more);
        least_count(MOST_PERIODS, |more| (self.within)(self.advice.radius * (size(0) / size(more)).sqrt()) > share)
    }

    fn extremes(&self) -> [f64; 2] {
        let of = |pick: fn(f64, f64) -> f64| self.record.iter().copied().reduce(pick).unwrap_or_default();
        [of(f64::min), of(f64::max)]
    }

    /// Returns the interval of admissible returns.
    fn bounds(&self) -> [f64; 2] {
        let Interval { min, max } =
            self.problem.support_rule().given().unwrap_or(Interval { min: f64::NEG_INFINITY, max: f64::INFINITY });
        [min.max(-rules::LOG_RETURN), max.min(rules::LOG_RETURN)]
    }
}

impl ReturnAndLog {
    fn of(log_return: f64) -> Self {
        ReturnAndLog { log_return, simple_return: log_return.exp_m1() }
    }
}
