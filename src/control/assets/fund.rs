//! A fund of several assets that one policy manages: its composition is chosen first, then the policy decides which
//! share of wealth is in the fund.
//!
//! A rule proposes the composition theta from the returns seen. The policy knows the assets only through the log-return
//! of the fund, `zeta = ln sum_i theta_i e^(z_i)`. The state's law is that of the zetas of all dates, its radius holds
//! for all funds at once, and the advice is the policy's share times theta. A proposal replaces the composition held
//! only if the policy values it as much (see [`accept_if_no_worse`]). The policy's certainty equivalent at the fund held then
//! stays a valid promise for any proposal rule. Checked by:
//! `tests/service/funds.rs::the_promise_at_the_fund_held_is_kept_and_broken_without_the_guard`.
//!
//! With limits, both compositions are the nearest ones that keep them. The limits come before the promise: it is kept as
//! long as the composition held keeps them. Checked by:
//! `tests/service/fund_limits.rs::a_session_keeps_the_limits_of_its_fund`.
//!
//! If trading costs, a proposal must also pay for its trade, by a rule that is not an optimum. The policy's gain from
//! it is spread equally over the periods left. One period's part must exceed the extra cost of the trade compared with
//! staying.

use std::borrow::Cow;

use super::advice::{OneStep, named, worst_means};
use super::advising::floors;
use super::composition::accept_if_no_worse;
use super::{AssetsSolution, PortfolioStep, ReturnScenarios};
use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::state::{PeriodOutcome, State};
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::fund::FundSpecification;
use crate::control::request::learning::Learning;
use crate::control::request::means::MeansRule;
use crate::control::request::specification::{DesignSpecification, InitialLaws, Specification, SurrogateSpecification};
use crate::numerics::bridge::funds::fund_returns;
use crate::numerics::transport::water_filling::inverse_volatility;

/// The assets of a session's fund, with its composition and holdings.
#[derive(Debug, Clone, PartialEq)]
pub struct Fund {
    /// Log-returns that make up the law, date by date.
    pub rows: AssetHistory,
    /// The means that the law gives the assets.
    pub means: MeansRule,
    /// Share of each asset in the fund; they sum to 1.
    pub composition: Vec<f64>,
    /// The composition held before this one was chosen.
    pub before: Vec<f64>,
    /// Share of wealth in each asset, before trading.
    pub holdings: Vec<f64>,
}

impl AssetsProblem {
    /// Returns the training of a policy for a fund of these assets. The training finds the joint factor of the radius.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn training(
        &self,
        design: DesignSpecification,
        surrogate: SurrogateSpecification,
        seed: u64,
    ) -> Result<Specification, FieldError> {
        self.check()?;
        let fund = FundSpecification {
            assets: self.assets.clone(),
            ground_norm: self.ground_norm,
            composition: self.composition.clone(),
            limits: self.limits.clone(),
            means: self.means,
            radius_factor: None,
            history: self.history.clone(),
        };
        let design = DesignSpecification { initial_laws: InitialLaws::Resampled, ..design };
        Specification { problem: self.of_fund(), fund: Some(Box::new(fund)), design, surrogate, seed }.completed()
    }

    /// Returns the problem that a policy was trained for, with `history` as its record; `None` if it has one asset.
    pub fn of(specification: &Specification, history: AssetHistory) -> Option<Self> {
        let Specification { problem, fund, .. } = specification;
        let fund = fund.as_deref()?;
        Some(AssetsProblem {
            assets: fund.assets.clone(),
            ground_norm: fund.ground_norm,
            composition: fund.composition.clone(),
            limits: fund.limits.clone(),
            means: fund.means,
            horizon: Some(problem.horizon),
            rate_per_step: problem.rate_per_step,
            periods_per_year: problem.periods_per_year,
            initial_wealth: problem.initial_wealth,
            action_interval: problem.action_interval,
            trading_cost: problem.trading_cost,
            contributions: problem.contributions.clone(),
            spending: problem.spending.clone(),
            risk_aversion: None,
            utility: problem.utility,
            radius: Some(problem.radius_rule().scaled(fund.radius_factor.unwrap_or(1.0).recip())),
            caution: problem.caution,
            support: problem.support,
            history,
        })
    }
}

/// Returns the share of wealth in all assets together.
fn total(shares: &[f64]) -> f64 {
    shares.iter().sum::<f64>().min(1.0)
}

impl Fund {
    /// Starts a fund from the returns `rows` and these shares of wealth, before a composition is chosen.
    pub fn at(rows: AssetHistory, means: MeansRule, holdings: Vec<f64>) -> Self {
        let composition = inverse_volatility(&rows);
        Fund { rows, means, before: composition.clone(), composition, holdings }
    }

    /// Returns the state at the start of a session with this fund; `wealth` defaults to that of the policy.
    ///
    /// # Errors
    /// The wealth breaks a rule, or the returns of the fund are not a valid history.
    pub fn begin(&self, advisor: &Advisor, wealth: Option<f64>) -> Result<State, FieldError> {
        advisor.initial_state(Some(&self.returns()), wealth)?.with_holding(self.holding())
    }

    /// Makes `rows` with these means the returns of the law, as a renewal does, and returns the state with the law of the
    /// fund.
    pub fn renew(&mut self, rows: AssetHistory, learning: Learning, wealth: f64, holding: f64) -> State {
        self.rows = rows;
        State { law: learning.law(&self.returns()), wealth, holding }
    }

    /// Returns the share of wealth held in all assets together.
    pub fn holding(&self) -> f64 {
        total(&self.holdings)
    }

    /// Replaces the composition by this one.
    pub fn take(&mut self, composition: Vec<f64>) {
        self.before = std::mem::replace(&mut self.composition, composition);
    }

    /// Returns the log-returns with the means that the law gives the assets.
    fn centred(&self) -> Cow<'_, [Vec<f64>]> {
        self.means.applied(&self.rows)
    }

    /// Returns the log-returns of the fund, date by date.
    pub fn returns(&self) -> Vec<f64> {
        fund_returns(&self.centred(), &self.composition)
    }

    /// Returns the log-return of the holdings in a period of these log-returns, if the shares of wealth are `executed`.
    pub fn log_return(&self, executed: &[f64], log_returns: &[f64]) -> f64 {
        let total: f64 = executed.iter().sum();
        let of = |shares: &[f64], whole: f64| {
            shares.iter().zip(log_returns).map(|(share, z)| share / whole * z.exp()).sum::<f64>().ln()
        };
        if total > 0.0 { of(executed, total) } else { of(&self.composition, 1.0) }
    }

    /// Returns the shares of wealth in the assets that sum to `total`.
    pub fn shares(&self, total: f64) -> Vec<f64> {
        self.composition.iter().map(|share| total * share).collect()
    }

    /// Returns the outcome of a period in which the shares of wealth `executed` were held and nothing was spent. `rate` and
    /// `flow` replace those of the policy's terms.
    pub fn outcome(
        &self,
        executed: &[f64],
        log_returns: Option<&[f64]>,
        rate: Option<f64>,
        flow: Option<f64>,
    ) -> PeriodOutcome {
        PeriodOutcome {
            action: total(executed),
            log_return: log_returns.map(|row| self.log_return(executed, row)),
            rate,
            flow,
            traded: Some(self.traded(executed)),
            spent: 0.0,
        }
    }

    /// Returns the share of wealth that is traded to reach `executed`.
    pub fn traded(&self, executed: &[f64]) -> f64 {
        self.holdings.iter().zip(executed).map(|(held, share)| f64::abs(share - held)).sum()
    }

    /// Updates the fund after a period in which `executed` was held, the assets moved by `log_returns` and the share
    /// `holding` was left in all of them. `learned` is the row that the law learns of it, if it learns one.
    pub fn passed(&mut self, executed: &[f64], log_returns: &[f64], learned: Option<Vec<f64>>, holding: f64) {
        let grown: Vec<f64> = executed.iter().zip(log_returns).map(|(share, z)| share * z.exp()).collect();
        let whole: f64 = grown.iter().sum();
        self.holdings = grown.iter().map(|share| if whole > 0.0 { share / whole * holding } else { 0.0 }).collect();
        learned.into_iter().for_each(|row| self.rows.push(row));
    }

    /// Prepares the period after `step`: chooses the composition if the policy advises that period, and returns the
    /// state of the fund, with the one-step solution if one made the proposal. Cost: that of [`Self::compose`].
    pub fn enter(&mut self, advisor: &Advisor, step: usize, state: &State) -> (State, Option<AssetsSolution>) {
        let Specification { problem, fund, .. } = advisor.specification();
        match fund.as_deref().filter(|_| step < problem.horizon) {
            Some(fund) => self.compose(advisor, fund, step, state),
            None => (State { law: problem.learning.law(&self.returns()), ..*state }, None),
        }
    }

    /// Chooses the composition before the period after `step`, which is below the horizon. Returns the state of its
    /// fund, and the one-step solution if one made the proposal. Cost: a one-step problem if the rule needs one, some
    /// policy values, and a law of n returns each.
    pub fn compose(
        &mut self,
        advisor: &Advisor,
        fund: &FundSpecification,
        step: usize,
        state: &State,
    ) -> (State, Option<AssetsSolution>) {
        let problem = &advisor.specification().problem;
        let (rows, mut solution) = (self.centred(), None);
        let of_fund = |composition: &[f64]| fund_returns(&rows, composition);
        let with = |returns: &[f64]| State { law: problem.learning.law(returns), ..*state };
        let compositions = fund.limits.as_ref().map(|limits| limits.compositions(&fund.assets, &self.holdings));
        let allowed = |composition: Vec<f64>| match &compositions {
            Some(compositions) => compositions.nearest(composition),
            None => composition,
        };
        let proposed = fund.composition.composition(&self.rows, || {
            let even = with(&of_fund(&inverse_volatility(&self.rows)));
            let law = ReturnScenarios {
                returns: &rows,
                radius: advisor.radius(&even),
                floors: floors(problem.support_rule(), &rows),
            };
            let utility = RelativeUtility::new(problem.utility, state.wealth * (1.0 + problem.rate_per_step));
            let [lowest, highest] = problem.action_interval;
            let total = ActionInterval { lowest, highest };
            let step = PortfolioStep::new(
                law,
                fund.ground_norm.at(&self.rows, &self.rows),
                utility,
                problem.rate_per_step,
                total,
            );
            // A cold start, so that the proposal depends on the returns seen alone.
            solution.insert(step.within(compositions.clone()).solve(None)).clone()
        });
        let left = (problem.horizon - step) as f64;
        // The policy's value of the fund, and that value less the cost of the trade.
        let value = |composition: &[f64]| {
            let returns = of_fund(composition);
            let varies = problem.learning.check_deviation("fund", &returns).is_ok();
            let (total, gain) = advisor.surrogate(step, &with(&returns));
            let executed: Vec<f64> = composition.iter().map(|share| total * share).collect();
            let net = gain / left - problem.trading_cost * self.traded(&executed);
            varies.then_some([gain, net])
        };
        let chosen = accept_if_no_worse(allowed(self.composition.clone()), allowed(proposed), value);
        let state = with(&of_fund(&chosen));
        self.take(chosen);
        (state, solution)
    }

    /// Reports a one-step solution in wealth, by the names of the assets; the bank alone makes `floor`.
    pub fn one_step(&self, names: &[String], solution: &AssetsSolution, floor: f64) -> OneStep {
        OneStep {
            allocation: named(names, &solution.allocation),
            certainty_equivalent: floor * solution.value.exp(),
            bound: floor * solution.bound.exp(),
            worst_means: worst_means(names, &self.rows, &self.centred(), solution),
            caution: solution.caution().into_iter().collect(),
        }
    }
}
