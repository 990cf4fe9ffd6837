//! A client's letter: what to hold and to trade, how it went, and why, in the words and figures of one page.
//!
//! A letter computes nothing that the service answers elsewhere: advice is that of `/action`, and wealth, money and
//! benchmarks are those of the history. Its modules put these into words, and nothing here knows how they are laid out.

pub mod content;
mod course;
pub mod figures;
pub mod links;
mod order;
mod periods;
mod reasons;
pub mod request;
mod track;

use crate::control::error::FieldError;
use crate::control::policy::advisor::AdviceMode;
use crate::control::request::framework::Framework;
use crate::service::Service;
use crate::service::advice::action::{AccountAdvice, AdviceKind, AdviceOptions};
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::history::{History, HistoryAnswer};
use crate::service::error::ServiceError;
use crate::service::letter::content::{Letter, LetterOrder, Phrase, plain, strong};
use crate::service::letter::course::{SessionCourse, last_days};
use crate::service::letter::figures::{MoneyFormat, with_minus};
use crate::service::letter::order::{AdviceOrders, OrderContext};
use crate::service::letter::periods::{PeriodNames, day};
use crate::service::letter::request::LetterRequest;
use crate::service::process::memory::Large;
use crate::service::sessions::live::LiveSession;
use crate::store::Tenant;

/// Up to so many assets stand in one table with their amounts. A letter of more is set smaller.
pub const FEW: usize = 8;
/// Up to so many assets are named below the client's name.
const NAMED: usize = 3;
/// Readings of a session that changes meanwhile, until the caller is asked to come again.
const READINGS: usize = 3;
/// Letters of a session's identifier in the place of a name.
const SHORT: usize = 10;
/// The sentence on what would change the advice of a policy that does not learn.
const FIXED: &str = "No return changes the advice, because the policy does not learn from new returns.";

/// How much a letter says on why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LetterReasons {
    /// The worth of the advice.
    Worth,
    /// Also what would change it, which takes about a hundred robust steps.
    WorthAndChange,
}

/// The facts of one reading of a session.
struct SessionReading {
    live: LiveSession,
    history: Box<History>,
    /// The advice, and the sentence on what would change it; `None` if the session is completed.
    advice: Option<(AccountAdvice, Option<String>)>,
    framework: Framework,
}

impl Service {
    /// Writes the letter of a session.
    ///
    /// # Errors
    /// A field breaks its rule, there is no such session, it is of a declared problem, or it cannot be advised now.
    pub async fn letter(
        &self,
        tenant: &Tenant,
        session: &str,
        (request, reasons): (LetterRequest, LetterReasons),
        turn: &HeavyPermit,
    ) -> Result<Letter, ServiceError> {
        request.check()?;
        let Large { value: reading, room: _room } = self.reading(tenant, session, reasons, turn).await?;
        let name = self.names.of(tenant, session).await?.name;
        let policy = self.names.of(tenant, &reading.live.current.policy).await?.name;
        let recipient = if name.is_empty() { client(session) } else { name };
        reading.letter(request, recipient, &policy, day(self.clock.today()))
    }

    /// Reads a session as of one state of it.
    async fn reading(
        &self,
        tenant: &Tenant,
        session: &str,
        reasons: LetterReasons,
        turn: &HeavyPermit,
    ) -> Result<Large<SessionReading>, ServiceError> {
        for _ in 0..READINGS {
            let live = self.sessions.get(tenant, session).await?;
            if live.standing.account().is_err() {
                return Err(declared(session));
            }
            let Large { value: history, room } = self.sessions.history(tenant, session, turn).await?;
            let HistoryAnswer::Account(history) = history else {
                return Err(ServiceError::internal("the history of another problem than the session"));
            };
            let advisor = self.policies.advisor(tenant, &live.current.policy).await?;
            let framework = advisor.specification().problem.framework;
            let advice = match live.check_active() {
                Ok(()) => Some(self.advice_in_letter(tenant, &live, (framework, reasons), turn).await?),
                Err(_) => None,
            };
            if self.sessions.get(tenant, session).await?.seen.entries() == live.seen.entries() {
                return Ok(Large { value: SessionReading { live, history, advice, framework }, room });
            }
        }
        Err(ServiceError::Busy)
    }

    /// Returns the advice of a session, and the sentence on what would change it if there is one.
    async fn advice_in_letter(
        &self,
        tenant: &Tenant,
        live: &LiveSession,
        (framework, reasons): (Framework, LetterReasons),
        turn: &HeavyPermit,
    ) -> Result<(AccountAdvice, Option<String>), ServiceError> {
        let is_one = live.standing.account()?.assets.is_none();
        let ask = async |sensitivity| {
            let options = AdviceOptions { mode: AdviceMode::Surrogate, explain: false, sensitivity };
            match self.sessions.action(tenant, &live.row.session, options, turn).await?.value.kind {
                AdviceKind::Account(advice) => Ok(*advice),
                AdviceKind::Declared(..) => Err(ServiceError::internal("the advice of another problem")),
            }
        };
        if is_one && framework.learns() && reasons == LetterReasons::WorthAndChange {
            match ask(true).await {
                // The sensitivity would take too long: the letter stands without it.
                Err(ServiceError::Field(_)) => {}
                found => {
                    let advice = found?;
                    let change = advice.sensitivity.as_ref().and_then(|sensitivity| sensitivity.change());
                    let change = change.map(with_minus);
                    return Ok((advice, change));
                }
            }
        }
        let fixed = (is_one && !framework.learns()).then(|| FIXED.to_owned());
        Ok((ask(false).await?, fixed))
    }
}

impl SessionReading {
    fn letter(
        self,
        request: LetterRequest,
        recipient: String,
        policy: &str,
        today: String,
    ) -> Result<Letter, ServiceError> {
        let LetterRequest { firm, currency, smallest_trade, date } = request;
        let money = MoneyFormat { code: currency };
        let SessionReading { live, history, advice, framework } = &self;
        let (account, terms) = (live.standing.account()?, &live.current.terms);
        let calendar = live.standing.days().periods_per_year(terms.periods_per_year);
        let names = PeriodNames::new(last_days(history), calendar);
        let assets = account.assets.as_ref().map(|assets| &assets.names[..]).unwrap_or_default();
        let course = SessionCourse::new(history);
        let context = OrderContext {
            money: &money,
            period: names.in_text(live.observed + 1),
            wealth: account.state.wealth,
            trading_cost: terms.trading_cost,
            smallest: smallest_trade.unwrap_or_default(),
        };
        let orders = advice.as_ref().map(|(advice, _)| AdviceOrders::of(advice, &context));
        let mut reasons: Vec<Vec<Phrase>> = Vec::new();
        if let Some((found, change)) = advice {
            let mut worth = reasons::worth(&found.advice, &money, &self.end(&names), *framework);
            let spent = found.advice.spending.as_ref().map_or(0.0, |spending| spending.amount);
            let places = (account.state.wealth - spent, terms.rate_per_step);
            worth.extend(reasons::may_lose(
                &found.advice,
                reasons::worst_seen(account),
                places,
                (&money, names.unit()),
            ));
            reasons.push(worth);
            let one_step = found.assets.as_ref().and_then(|assets| assets.one_step.as_ref());
            let worst = one_step.and_then(|one_step| reasons::worst_market(one_step, assets, names.unit()));
            reasons.extend(worst.or_else(|| change.clone()).map(|sentence| vec![plain(sentence)]));
        }
        Ok(Letter {
            firm: firm.unwrap_or_default(),
            recipient,
            day: date.map_or(today, day),
            about: about(policy, assets, &money),
            order: match &orders {
                Some(orders) => orders.in_words(&context),
                None => ended(account.state.wealth, course.bank(), &money),
            },
            course: course.in_words(&money, &names, terms.periods_per_year),
            reasons,
            trades: orders.map_or_else(|| "Nothing".to_owned(), |orders| orders.trades(&money)),
            is_dense: assets.len() > FEW,
        })
    }

    /// Says when a sure amount is had.
    fn end(&self, names: &PeriodNames) -> String {
        let (tenure, unit) = (&self.live.current, names.unit());
        let periods = tenure.terms.horizon;
        match () {
            () if tenure.terms.ends => format!("spent every {unit}, in money of now"),
            () if tenure.is_rolling() && periods == 1 => format!("1 {unit} from now"),
            () if tenure.is_rolling() => format!("{} {unit}s from now", figures::grouped(periods as f64, 0)),
            () => format!("at the end of {}", names.in_text(self.live.horizon())),
        }
    }
}

/// Builds the refusal of a session without an investor.
fn declared(session: &str) -> ServiceError {
    let rule = "must be of an investor: a session of a declared problem has no letter";
    FieldError::new("session", session, rule).into()
}

/// Returns the name of a client whose session has none.
fn client(session: &str) -> String {
    let distinct: String = session.trim_start_matches("session_").chars().take(SHORT).collect();
    format!("Client {distinct}")
}

/// Says which policy is followed, for which assets, and in which currency.
fn about(policy: &str, assets: &[String], money: &MoneyFormat) -> String {
    let fund = match assets.len() {
        0 => None,
        count if count > NAMED => Some(format!("Fund of {count} assets.")),
        _ => Some(format!("Fund of {}.", assets.join(", "))),
    };
    let policy = (!policy.is_empty()).then(|| format!("Policy: {policy}."));
    let currency = money.code.as_ref().map(|code| format!("Amounts in {code}."));
    [policy, fund, currency].into_iter().flatten().collect::<Vec<String>>().join(" ")
}

/// Says how a completed session ended.
fn ended(wealth: f64, bank: Option<f64>, money: &MoneyFormat) -> LetterOrder {
    let bank = format!("The bank alone would have reached {}.", figures::known(money, bank));
    LetterOrder {
        title: "Completed".to_owned(),
        order: vec![plain("It ended with "), strong(money.amount(wealth)), plain(".")],
        assets: Vec::new(),
        sentences: vec![vec![plain(bank)]],
    }
}
