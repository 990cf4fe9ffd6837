//! The state of an investor's session, and the transition that a report causes.

use std::sync::Arc;

use crate::control::assets::advice::named;
use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::state::{PeriodOutcome, State};
use crate::control::request::assets::check_rows;
use crate::control::request::learning::Learning;
use crate::control::request::rules;
use crate::control::request::support::LawExtent;
use crate::control::request::terms::Terms;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::service::entries::days::Days;
use crate::service::entries::doubts::{self, Doubt};
use crate::service::entries::drift::DriftTest;
use crate::service::entries::record::{PeriodNoise, SessionRecord};
use crate::service::entries::report::{OF_DECLARED, Report, none_of};
use crate::service::error::ServiceError;
use crate::service::sessions::advised::AdvisedShares;
use crate::service::sessions::asset_change::AssetChange;
use crate::service::sessions::assets::{Assets, Composition, PlannedAssets, mean};
use crate::service::sessions::plan::SessionPlan;
use crate::service::sessions::transition::Transition;
use crate::store::{InitialAccount, SessionRow};

/// The state of an investor's session between two periods.
#[derive(Debug, Clone, PartialEq)]
pub struct AccountState {
    /// For several assets, the state of their fund.
    pub state: State,
    /// The assets, if there are several.
    pub assets: Option<Box<Assets>>,
    /// The price reported for the last period, if one was.
    pub price: Option<f64>,
    /// The last days of the periods.
    pub days: Days,
    /// The test of whether returns still come from the same law.
    pub bet: DriftTest,
    /// All observed returns, if the law holds only the last ones. For several assets always present: the mean of each
    /// date.
    seen: Option<EmpiricalDistribution>,
    session: Arc<str>,
}

/// A period of an investor, as a report moved it.
#[derive(Debug, Clone, PartialEq)]
pub struct AccountPeriod {
    /// For several assets, the log-return of the holdings; minus infinity if they lost everything.
    pub log_return: Option<f64>,
    pub executed_allocation: f64,
    /// Shares of wealth held in several assets; empty for one asset.
    pub executed: Vec<f64>,
    /// Share of wealth bought and sold for them.
    pub turnover: f64,
    /// Money spent at its start.
    pub spent: f64,
    /// The dynamics of the period, with the rate and the flow reported.
    pub dynamics: Dynamics,
}

impl AccountPeriod {
    /// Returns the money spent, `None` if it is none.
    pub fn reported_spending(&self) -> Option<f64> {
        Some(self.spent).filter(|spent| *spent > 0.0)
    }
}

impl AccountState {
    /// Returns the state before the first period, and the record that its law is made of.
    ///
    /// # Errors
    /// The row is not that of an investor's session.
    pub(in crate::service) fn start(
        row: &SessionRow,
        plan: &SessionPlan,
    ) -> Result<(Self, SessionRecord), ServiceError> {
        let history = row.initial_history.clone();
        let record = match &plan.assets {
            Some(assets) => SessionRecord::of_assets(history, assets.missing()),
            None => SessionRecord::new(history),
        };
        let assets = plan.assets.as_ref().map(|PlannedAssets { names, composed, .. }| {
            Assets::with_composition(names, record.returns(), plan.terms.means, composed).map(Box::new)
        });
        let assets = assets.transpose()?;
        let learning = plan.terms.learning;
        let InitialAccount { wealth, holding } =
            row.account.ok_or_else(|| ServiceError::internal("a session of an investor has no wealth"))?;
        let state = match &assets {
            // The returns of a fund may vary less than those of a history must.
            Some(assets) => State { wealth, holding: 0.0, law: learning.law(&assets.fund.returns()) },
            None => State::new(record.all(), wealth, learning)?,
        };
        Ok((AccountState::at(&row.session, state.with_holding(holding)?, assets), record))
    }

    /// Returns the state at the start of `session`.
    pub(in crate::service) fn at(session: &str, state: State, assets: Option<Box<Assets>>) -> Self {
        let seen = assets.as_ref().map(|assets| Assets::means(&assets.fund.rows));
        AccountState {
            state,
            assets,
            price: None,
            days: Days::default(),
            bet: DriftTest::default(),
            seen,
            session: session.into(),
        }
    }

    /// Returns the state with the law of the last `window` dates of `record`, which holds all observed returns, as the
    /// next policy with these terms learns it, and with changed assets if there is a change.
    ///
    /// # Errors
    /// They are not a valid history.
    pub(in crate::service) fn renewed(
        &self,
        record: &SessionRecord,
        window: Option<usize>,
        terms: &Terms,
        change: Option<&AssetChange>,
    ) -> Result<Self, FieldError> {
        let last = record.last(window);
        let mut assets = self.assets.clone();
        let state = match &mut assets {
            Some(assets) => {
                let rows = record.last_returns(window);
                check_rows(
                    change.map_or("history", |_| "records"),
                    &rows,
                    change.map_or(&assets.names, |change| &change.names),
                    None,
                )?;
                let mut holding = self.state.holding;
                if let Some(change) = change {
                    **assets = change.assets(assets, &rows);
                    holding = assets.fund.holding();
                }
                assets.fund.means = terms.means;
                assets.fund.renew(rows, terms.learning, self.state.wealth, holding)
            }
            None => State::new(&last, self.state.wealth, terms.learning)?.with_holding(self.state.holding)?,
        };
        let seen = match &assets {
            Some(_) => Some(Assets::means(&record.returns())),
            None => (last.len() < record.all().len()).then(|| EmpiricalDistribution::new(record.all())),
        };
        let AccountState { price, days, bet, .. } = *self;
        Ok(AccountState { state, assets, price, days, bet, seen, session: self.session.clone() })
    }

    /// Returns the names of the assets if there are several; empty for one asset.
    pub(in crate::service) fn names(&self) -> &[String] {
        self.assets.as_ref().map_or(&[][..], |assets| &assets.names)
    }

    /// Reads the returns of the coming period from `report`.
    ///
    /// # Errors
    /// A field breaks a rule, or the date is not after the last one.
    pub(in crate::service) fn read(&self, report: &Report) -> Result<PeriodNoise, FieldError> {
        none_of(&report.of_declared(), OF_DECLARED)?;
        report.check()?;
        self.days.check_later(report.date)?;
        match &self.assets {
            Some(assets) => assets.read(report),
            None => Ok(PeriodNoise::of(report.log_return(self.price)?)),
        }
    }

    /// Returns the effect of `report` on `period`, for which `advised` was advised. A report without a day
    /// takes the next one due, if `periods_per_year` is known.
    ///
    /// # Errors
    /// As [`AccountState::read`], or wealth leaves the permitted range.
    pub(in crate::service) fn after(
        &self,
        dynamics: Dynamics,
        period: usize,
        report: &Report,
        (advised, periods_per_year): (AdvisedShares, Option<f64>),
    ) -> Result<Transition<AccountState, AccountPeriod>, FieldError> {
        let seen = self.read(report)?;
        let Report { rate, flow, .. } = *report;
        let spent = self.share_spent(report)?.unwrap_or(advised.spent);
        let moves = (!seen.is_missing()).then(|| seen.moves());
        let (executed, realised) = match &self.assets {
            Some(assets) => {
                let executed = assets.executed(report, advised.held)?;
                let of_wealth: Vec<f64> = executed.iter().map(|share| share * (1.0 - spent)).collect();
                let traded = Some(assets.traded(&of_wealth));
                let realised = assets.fund.outcome(&executed, moves.as_deref(), rate, flow);
                (executed, PeriodOutcome { traded, spent, ..realised })
            }
            None => {
                let action = report.executed_allocation.unwrap_or(advised.held);
                let log_return = moves.map(|moves| moves[0]);
                (Vec::new(), PeriodOutcome { action, log_return, rate, flow, traded: None, spent })
            }
        };
        let turnover = realised.turnover(self.state.holding);
        let mut state = self.state.next_state(dynamics, &realised);
        state.wealth = match report.wealth {
            Some(reported) => reported,
            None => check_wealth_range(state.wealth, report)?,
        };
        let AccountState { assets, bet, seen: known, session, .. } = self;
        let (assets, seen_before, session) = (assets.clone(), known.clone(), session.clone());
        let days = self.days.after(report.date, periods_per_year);
        let mut standing = AccountState { state, assets, price: None, days, bet: *bet, seen: seen_before, session };
        standing.learn(&seen, &executed, period);
        standing.price_as(report);
        let dynamics = realised.dynamics(dynamics);
        let PeriodOutcome { action: executed_allocation, log_return, .. } = realised;
        let spent = spent * self.state.wealth;
        let moved = AccountPeriod { log_return, executed_allocation, executed, turnover, spent, dynamics };
        Ok(Transition { seen, moved, standing })
    }

    /// Returns the share of wealth that was spent, if the report says how much.
    ///
    /// # Errors
    /// It is not less than wealth.
    fn share_spent(&self, report: &Report) -> Result<Option<f64>, FieldError> {
        match report.spent {
            Some(spent) if spent >= self.state.wealth => {
                let rule = format!("must be less than the wealth at the start of the period, {}", self.state.wealth);
                Err(FieldError::new("spent", spent, rule))
            }
            spent => Ok(spent.map(|spent| spent / self.state.wealth)),
        }
    }

    /// Returns the report of a period without trades unless it gives holdings.
    pub(in crate::service) fn held_on(&self, reported: &Report) -> Report {
        let mut report = reported.clone();
        if let Some(assets) = &self.assets {
            report.executed_allocations.get_or_insert_with(|| named(&assets.names, &assets.fund.holdings));
        }
        report
    }

    /// Updates the record, the drift test and the holdings after a period.
    fn learn(&mut self, seen: &PeriodNoise, executed: &[f64], period: usize) {
        if let Some(assets) = &mut self.assets {
            assets.passed(executed, seen, self.state.holding);
        }
        let log_return = seen.learned().as_deref().map(mean);
        self.seen.iter_mut().zip(log_return).for_each(|(seen, log_return)| seen.push(log_return));
        self.bet = self.bet.after(self.seen.as_ref().unwrap_or(&self.state.law), log_return, &self.session, period);
    }

    /// Takes over the prices reported with the last period.
    pub(in crate::service) fn price_as(&mut self, report: &Report) {
        self.price = report.price;
        if let Some(assets) = &mut self.assets {
            assets.price_as(report);
        }
    }

    /// Applies a reported composition; the law must be rebuilt afterwards.
    ///
    /// # Errors
    /// It names other assets.
    pub(in crate::service) fn take(&mut self, reported: &Composition) -> Result<(), FieldError> {
        self.assets.as_mut().map_or(Ok(()), |assets| assets.take(reported))
    }

    /// Returns the state with the law of the fund rebuilt, if there are several assets.
    #[must_use]
    pub(in crate::service) fn with_law(mut self, learning: Learning) -> Self {
        if let Some(assets) = &self.assets {
            self.state.law = learning.law(&assets.fund.returns());
        }
        self
    }

    /// Chooses the composition before the period after `step`, if there are several assets.
    pub(in crate::service) fn compose(&mut self, advisor: &Advisor, step: usize) {
        let Some(assets) = &mut self.assets else { return };
        self.state = assets.compose(advisor, step, &self.state);
    }

    /// Replaces wealth, or the holdings of several assets, as of the last choice of the composition.
    pub(in crate::service) fn suppose(
        &mut self,
        advisor: &Advisor,
        step: usize,
        wealth: Option<f64>,
        holdings: Option<Vec<f64>>,
    ) {
        let Some(assets) = &mut self.assets else { return };
        self.state.wealth = wealth.unwrap_or(self.state.wealth);
        if let Some(holdings) = holdings {
            self.state.holding = holdings.iter().sum::<f64>().min(1.0);
            assets.fund.holdings = holdings;
        }
        self.state = assets.compose_anew(advisor, step, &self.state);
    }

    /// Returns the number of returns that the state holds.
    pub(in crate::service) fn returns(&self) -> usize {
        let seen = self.seen.as_ref().map_or(0, EmpiricalDistribution::sample_size);
        let of_assets = self.assets.as_ref().map_or(0, |assets| assets.fund.rows.len() * assets.names.len());
        self.state.law.sample_size() + seen + of_assets
    }

    /// Returns doubts about the returns of a report, each against the record of its asset.
    pub(in crate::service) fn return_doubts(&self, report: &Report, seen: &PeriodNoise) -> Vec<Doubt> {
        let of_asset = |(asset, log_return): (usize, &Option<f64>)| {
            let log_return = (*log_return)?;
            let (field, value, record) = match &self.assets {
                Some(assets) => {
                    let (field, value) = report.given_of(&assets.names[asset]);
                    (field, value.unwrap_or(log_return), assets.extent(asset))
                }
                None => {
                    let (field, value) = report.given();
                    (field.to_owned(), value, LawExtent::of_law(&self.state.law))
                }
            };
            doubts::of_return(&field, value, &record, log_return)
        };
        seen.values.iter().enumerate().filter_map(of_asset).collect()
    }
}

/// Returns wealth as computed from return, allocation and flow.
fn check_wealth_range(wealth: f64, report: &Report) -> Result<f64, FieldError> {
    let (low, high) = rules::WEALTH;
    if (low..=high).contains(&wealth) {
        return Ok(wealth);
    }
    let leaves = format!(
        "the return, the allocation and the amount added give a wealth of {wealth}, and wealth must lie in [{low}, {high}]"
    );
    Err(match report.flow {
        Some(flow) => FieldError::new("flow", flow, format!("must leave an allowed wealth: {leaves}")),
        None => FieldError::new("wealth", "null", format!("must be reported: {leaves}")),
    })
}
