//! The policy of a fund of several assets, walked through a record as a live session follows it.
//!
//! Every `every` periods the next policy is trained on the returns known by then, with the present wealth and the bank's
//! last rate ([`Specification::next`]). The fund keeps its holdings and its composition, as a session does that is
//! renewed. A session calls the same functions: [`Fund::begin`], [`Fund::enter`], [`Advisor::advise`], [`Fund::shares`],
//! [`Fund::outcome`], [`State::next_state`], [`Fund::passed`] and [`Fund::renew`]. So the shares held and the wealth are
//! those of a session, bit for bit. Checked by:
//! `tests/service/fund_renewal.rs::ten_years_of_a_live_session_of_twelve_industries_equal_the_walk`.

use serde::{Deserialize, Serialize};

use super::AssetsRecord;
use crate::control::assets::fund::Fund;
use crate::control::cache::Cache;
use crate::control::error::{FieldError, TrainError};
use crate::control::evaluation::account::Account;
use crate::control::evaluation::yearly_worth::INITIAL_WEALTH;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::problem::state::State;
use crate::control::progress::Watch;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::specification::{DesignSpecification, InitialLaws, Specification, SurrogateSpecification};
use crate::control::request::terms::Terms;
use crate::control::training::Training;

/// The walk of one policy after another through a record.
#[derive(Debug, Clone)]
pub struct FundWalk<'a> {
    /// The record that is walked through.
    pub record: &'a AssetsRecord,
    /// The first period that is decided.
    pub first: usize,
    /// Number of past periods that each policy is trained on; none means all since the first.
    pub window: Option<usize>,
    /// Periods from one training to the next, at most the horizon.
    pub every: usize,
    /// The problem of the first policy, with the returns that it knows.
    pub problem: AssetsProblem,
    /// The design of every training.
    pub design: DesignSpecification,
    /// Seed of every training.
    pub seed: u64,
}

/// The holdings of a period, and their result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldPeriod {
    /// Shares of wealth in the assets.
    pub shares: Vec<f64>,
    /// Radius of the ball around the law of the fund.
    pub radius: f64,
    /// Share of wealth that was bought and sold at the start.
    pub traded: f64,
    /// Wealth at the end.
    pub wealth: f64,
}

/// The periods of one policy, and the state after them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WalkedTenure {
    /// The periods, in order.
    pub periods: Vec<HeldPeriod>,
    /// The state from which the next policy continues.
    pub after: WalkState,
}

/// The investor between two policies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WalkState {
    /// The specification of the last policy.
    specification: Specification,
    composition: Vec<f64>,
    holdings: Vec<f64>,
    wealth: f64,
    holding: f64,
}

impl Account {
    /// Returns the account of a policy that was followed through `periods`, from the usual wealth.
    pub(super) fn of_policy(periods: &[HeldPeriod]) -> Self {
        Account {
            wealth: [INITIAL_WEALTH].into_iter().chain(periods.iter().map(|held| held.wealth)).collect(),
            allocations: periods.iter().map(|held| held.shares.iter().sum()).collect(),
            traded: periods.iter().map(|held| held.traded).collect(),
        }
    }
}

impl WalkState {
    fn of(specification: &Specification, fund: Fund, state: &State) -> Self {
        let Fund { composition, holdings, .. } = fund;
        let State { wealth, holding, .. } = *state;
        WalkState { specification: specification.clone(), composition, holdings, wealth, holding }
    }

    /// Returns the fund and the state, renewed with the returns `rows`.
    fn renewed(&self, rows: AssetHistory) -> (Fund, State) {
        let (composition, holdings) = (self.composition.clone(), self.holdings.clone());
        let means = self.specification.means();
        let mut fund =
            Fund { rows: AssetHistory::default(), means, before: composition.clone(), composition, holdings };
        let state = fund.renew(rows, self.specification.problem.learning, self.wealth, self.holding);
        (fund, state)
    }
}

impl FundWalk<'_> {
    /// Returns the first period of each policy.
    fn starts(&self) -> impl Iterator<Item = usize> + use<> {
        (self.first..self.record.rows.len()).step_by(self.every)
    }

    /// Returns the training of the last policy as if the fund of inverse volatilities were its only asset, for estimates
    /// of its size.
    pub fn last_of_fund(&self) -> Option<Specification> {
        let history = self.record.known(self.starts().last()?, self.window);
        let problem = AssetsProblem { history, ..self.problem.clone() }.of_fund();
        let design = DesignSpecification { initial_laws: InitialLaws::Resampled, ..self.design.clone() };
        Specification { design, ..Specification::of(problem, self.seed) }.completed().ok()
    }

    /// Walks through all periods on the current pool. `lived` gets the number of each policy, from 0, and a function that
    /// trains and follows that policy. It may store the result, or return a stored one without calling the function.
    ///
    /// # Errors
    /// The errors of `lived`.
    pub fn run<E>(
        &self,
        watch: &Watch,
        kept: &Cache,
        lived: impl Fn(usize, &dyn Fn() -> Result<WalkedTenure, TrainError>) -> Result<WalkedTenure, E>,
    ) -> Result<Vec<HeldPeriod>, E> {
        let (mut periods, mut before) = (Vec::new(), None);
        for (index, start) in self.starts().enumerate() {
            let tenure = lived(index, &|| self.tenure(start, before.as_ref(), (watch, kept.clone())))?;
            periods.extend(tenure.periods);
            before = Some(tenure.after);
        }
        Ok(periods)
    }

    /// Trains the policy of the periods from `start` on and follows it to the next training. `before` is the state after
    /// the policy before; the first one starts with all wealth in the bank.
    ///
    /// # Errors
    /// A window or a wealth that breaks a rule of the specification; a training that fails; the stop signal.
    pub fn tenure(
        &self,
        start: usize,
        before: Option<&WalkState>,
        (watch, kept): (&Watch, Cache),
    ) -> Result<WalkedTenure, TrainError> {
        let rows = self.record.known(start, self.window);
        let specification = self.specification(start, before, &rows)?;
        let policy = Training::with(&specification, kept.clone())?.run(watch)?;
        let advisor = Advisor::with(policy, kept);
        let (mut fund, mut state) = match before {
            Some(before) => before.renewed(rows),
            None => {
                let fund = Fund::at(rows, advisor.specification().means(), vec![0.0; self.record.assets.len()]);
                let state = fund.begin(&advisor, None)?;
                (fund, state)
            }
        };
        let terms = Terms::of(advisor.specification());
        let mut periods = Vec::with_capacity(self.every);
        (state, _) = fund.enter(&advisor, 0, &state);
        for (step, period) in (start..self.record.rows.len().min(start + self.every)).enumerate() {
            watch.go_on()?;
            let advice = advisor.advise(step, &state, AdviceMode::Surrogate);
            let shares = fund.shares(advice.allocation);
            let row = &self.record.rows[period];
            let outcome = fund.outcome(&shares, Some(row), Some(self.record.bank[period]), None);
            state = state.next_state(terms.period(step), &outcome);
            fund.passed(&shares, row, Some(row.clone()), state.holding);
            (state, _) = fund.enter(&advisor, step + 1, &state);
            let traded = outcome.traded.unwrap_or_default();
            periods.push(HeldPeriod { shares, radius: advice.radius, traded, wealth: state.wealth });
        }
        Ok(WalkedTenure { periods, after: WalkState::of(advisor.specification(), fund, &state) })
    }

    /// Returns the specification of the policy from `start` on, which knows `rows`.
    fn specification(
        &self,
        start: usize,
        before: Option<&WalkState>,
        rows: &AssetHistory,
    ) -> Result<Specification, FieldError> {
        match before {
            Some(WalkState { specification, wealth, .. }) => {
                specification.next(&rows.as_given().concat(), Some(self.record.bank[start - 1]), *wealth, 0)
            }
            None => self.problem.training(self.design.clone(), SurrogateSpecification::default(), self.seed),
        }
    }
}
