//! The words on how a session went: wealth, returns, the worst fall, and the comparators.

use jiff::civil::Date;

use crate::control::request::terms::Terms;
use crate::service::entries::history::{History, Observation};
use crate::service::entries::notes::{NoteReason, PeriodNote};
use crate::service::letter::content::{LetterCourse, LetterFact, LivedCourse, WealthChart, WealthLine};
use crate::service::letter::figures::{MoneyFormat, known, percent, signed};
use crate::service::letter::periods::PeriodNames;
use crate::service::letter::track::{
    LevelFall, LivedPeriod, NamedReturn, fixed_share, levels, returns_so_far, worst_fall,
};

/// The share in stocks of the mix that people know.
const MIX: f64 = 0.6;

/// The observed periods of a session, with corrections applied, and wealth had simple rules been followed.
pub(super) struct SessionCourse<'a> {
    history: &'a History,
    periods: Vec<LivedPeriod>,
}

impl<'a> SessionCourse<'a> {
    pub fn new(history: &'a History) -> Self {
        let lived = |row: &Observation| {
            let (log_return, notes, wealth) = standing(row);
            LivedPeriod {
                wealth,
                flow: row.account.flow,
                spent: row.account.spent.unwrap_or(0.0),
                rate: row.account.rate,
                trading_cost: terms_of(history, row.answered.period).trading_cost,
                growth: growth(log_return, notes),
            }
        };
        SessionCourse { history, periods: history.observations.iter().map(lived).collect() }
    }

    /// Returns wealth at the start and after each period.
    fn wealths(&self) -> Vec<Option<f64>> {
        let after = self.periods.iter().map(|period| period.wealth);
        std::iter::once(self.history.initial_wealth).chain(after).map(Some).collect()
    }

    /// Returns the wealth of a rule at the start and after each period, as the accounts of the periods have it.
    fn benchmark(&self, of: fn(&Observation) -> Option<f64>) -> Vec<Option<f64>> {
        std::iter::once(Some(self.history.initial_wealth)).chain(self.history.observations.iter().map(of)).collect()
    }

    fn mix(&self, share: f64) -> Vec<Option<f64>> {
        fixed_share((self.history.initial_wealth, self.history.initial_holding), &self.periods, share)
    }

    /// Returns wealth with everything in the bank, after the last period.
    pub fn bank(&self) -> Option<f64> {
        self.benchmark(|row| row.account.benchmarks.bank).last().copied().flatten()
    }

    /// Returns the name of what is held besides the bank.
    fn risky(&self) -> &'static str {
        if self.history.assets.is_some() { "the assets" } else { "stocks" }
    }

    /// Returns the lines of the bank, of the mix and of all in the risky holdings, in this order, and then all others.
    fn comparators(&self, money: &MoneyFormat) -> ([WealthLine; 3], Vec<WealthLine>) {
        let line = |name, values| wealth_line(money, name, values);
        let equal_weights = || self.benchmark(|row| row.account.benchmarks.equal_weights);
        let bank = line("All in the bank", self.benchmark(|row| row.account.benchmarks.bank));
        let mix = line("60/40", self.mix(MIX));
        if self.history.assets.is_none() {
            // Equal shares of one asset are all of it.
            return ([bank, mix, line("All in stocks", equal_weights())], Vec::new());
        }
        let first = self.benchmark(|row| row.account.benchmarks.initial_composition);
        let others = vec![line("Equal weights", equal_weights()), line("First composition", first)];
        ([bank, mix, line("All in the assets", self.mix(1.0))], others)
    }

    /// Says how the session went.
    pub fn in_words(&self, money: &MoneyFormat, names: &PeriodNames, periods_per_year: Option<f64>) -> LetterCourse {
        let lived = self.periods.len();
        let Some(LivedPeriod { wealth, .. }) = self.periods.last() else {
            let start = money.amount(self.history.initial_wealth);
            return LetterCourse::New(format!("No return is reported yet. The start is {start}."));
        };
        let levels = levels(self.history.initial_wealth, &self.periods);
        let mut facts = vec![fact("Wealth", money.amount(*wealth), format!("at the end of {}", names.in_text(lived)))];
        facts.extend(returns_so_far(&levels, names, periods_per_year).into_iter().map(return_fact));
        facts.push(fall_fact(worst_fall(&levels), names));
        facts.extend(self.moved_facts(money));
        let (comparators, others) = self.comparators(money);
        let [bank, mix, risky] = &comparators;
        let comparison = format!(
            "It is worth {} now. The same start would have come to {} all in the bank, {} at 60/40 and {} all in {}.",
            money.amount(*wealth),
            bank.last,
            mix.last,
            risky.last,
            self.risky()
        );
        let positions = (0..=lived).map(|period| names.brief(period)).collect();
        let here = format!("After {}", names.in_text(lived));
        let own = wealth_line(money, "You", self.wealths());
        let lines = std::iter::once(own).chain(comparators).chain(others).collect();
        LetterCourse::Lived(LivedCourse { facts, chart: WealthChart { positions, here, lines }, comparison })
    }

    /// Returns the facts on the money that came and went.
    fn moved_facts(&self, money: &MoneyFormat) -> Vec<LetterFact> {
        let sum = |amount: fn(&LivedPeriod) -> f64| self.periods.iter().map(amount).sum::<f64>();
        let (added, withdrawn) = (sum(|period| period.flow.max(0.0)), sum(|period| (-period.flow).max(0.0)));
        let spent = sum(|period| period.spent);
        let bare = |name: &str, amount: f64| fact(name, money.amount(amount), String::new());
        let mut facts = vec![match (added > 0.0, withdrawn > 0.0) {
            (false, false) => fact("Added or withdrawn", "Nothing".to_owned(), String::new()),
            (true, false) => bare("Added", added),
            (false, true) => bare("Withdrawn", withdrawn),
            (true, true) => {
                let note = format!("{} added, {} withdrawn", money.amount(added), money.amount(withdrawn));
                fact("Added, less withdrawn", money.amount(added - withdrawn), note)
            }
        }];
        facts.extend((spent > 0.0).then(|| bare("Spent", spent)));
        facts
    }
}

/// Returns the last day of each observed period. A period without one repeats the day before it, so it counts as none.
pub(super) fn last_days(history: &History) -> Vec<Option<Date>> {
    let mut before = None;
    let day = |row: &Observation| {
        let date = row.now.as_ref().map_or(row.answered.date, |now| now.date);
        let own = date.filter(|_| date != before);
        before = date;
        own
    };
    history.observations.iter().map(day).collect()
}

/// Returns the log-return, the notes and the wealth of a period, with corrections applied.
fn standing(row: &Observation) -> (Option<f64>, &[PeriodNote], f64) {
    match &row.now {
        Some(now) => (now.log_return, &now.notes, now.wealth),
        None => (row.answered.log_return, &row.answered.notes, row.answered.wealth),
    }
}

/// Returns the growth of a period: none if the return is missing, and 0 after a total loss.
fn growth(log_return: Option<f64>, notes: &[PeriodNote]) -> f64 {
    let is_lost = notes.iter().any(|note| note.reason == NoteReason::TotalLoss);
    log_return.map_or(if is_lost { 0.0 } else { 1.0 }, f64::exp)
}

/// Returns the terms of a period.
fn terms_of(history: &History, period: usize) -> &Terms {
    let renewal = history.renewals.iter().rev().find(|renewal| renewal.answered.period <= period);
    renewal.map_or(&history.terms, |renewal| &renewal.answered.terms)
}

fn wealth_line(money: &MoneyFormat, name: &'static str, values: Vec<Option<f64>>) -> WealthLine {
    let last = known(money, values.last().copied().flatten());
    WealthLine { name, values, last }
}

fn fact(name: &str, value: String, note: String) -> LetterFact {
    LetterFact { name: name.to_owned(), value, note }
}

fn return_fact(NamedReturn { name, value, a_year }: NamedReturn) -> LetterFact {
    let note = a_year.map_or(String::new(), |a_year| format!("{} a year", signed(a_year)));
    fact(&name, signed(value), note)
}

fn fall_fact(worst: Option<LevelFall>, names: &PeriodNames) -> LetterFact {
    const NAME: &str = "Worst fall so far";
    let Some(LevelFall { depth, from, to }) = worst else {
        return fact(NAME, "None".to_owned(), "never below its highest".to_owned());
    };
    let from = if from == 0 { "the start".to_owned() } else { names.in_text(from) };
    fact(NAME, percent(depth, 1), format!("from {from} to {}", names.in_text(to)))
}
