//! How close an advice is to changing, in sentences.

use super::{AT_AN_END, LeftOut, MOST_PERIODS, NextReturn, Premium, WithoutOne, is_invested};
use crate::numerics::machine::digits::{self, percent};

/// An advice that an unusual return moves by less than this is steady.
const STEADY: f64 = 0.02;
/// An advice that an unusual return moves by more than this is close to changing.
const CLOSE: f64 = 0.1;

/// The beginning of the sentence on two next returns. The sentences on crossings follow it.
pub(super) const AFTER: &str = "After a return of ";

/// The advice whose sensitivity is described.
pub(super) struct SensitivityText {
    /// The share of wealth advised.
    pub allocation: f64,
    /// The highest that may be advised.
    pub highest: f64,
    /// Number of returns in its record.
    pub returns: usize,
    /// True if only some of them were left out, one at a time.
    pub selected: bool,
    /// The noun for a period, such as `month`.
    pub noun: &'static str,
}

impl SensitivityText {
    /// Returns the sentences. The first says how far an unusual next return would move the advice.
    pub(super) fn sentences(
        &self,
        without_one: Option<&WithoutOne>,
        next_return: &NextReturn,
        premium: &Premium,
    ) -> Vec<String> {
        let mut sentences = vec![self.moved(next_return)];
        sentences.extend(without_one.into_iter().flat_map(|range| self.without_one(range)));
        sentences.extend(self.next_return(next_return));
        sentences.extend(self.premium(premium));
        sentences
    }

    fn moved(&self, NextReturn { low, high, .. }: &NextReturn) -> String {
        let moved = [low, high].map(|next| (next.allocation - self.allocation).abs());
        let (moved, noun) = (moved[0].max(moved[1]), self.noun);
        if moved < STEADY {
            let steady = digits::fixed(100.0 * STEADY, 0);
            return format!("Nine in ten {noun}s would move the advice by less than {steady} points.");
        }
        let points = digits::fixed(100.0 * moved, usize::from(moved < CLOSE));
        match moved < CLOSE {
            true => format!("An unusual {noun} would move the advice by up to {points} points."),
            false => format!("The advice is close to changing: an unusual {noun} would move it by {points} points."),
        }
    }

    fn without_one(&self, &WithoutOne { lowest, highest, tried }: &WithoutOne) -> Vec<String> {
        let changes = |end: &LeftOut| allocation(end.allocation) != allocation(self.allocation);
        let of = |end: LeftOut| (percent(end.simple_return, 1), allocation(end.allocation));
        let mut sentences = vec![match (changes(&lowest), changes(&highest)) {
            (false, false) => {
                "No single return of the record matters: without any one of them the advice stays the same.".into()
            }
            (true, true) if lowest.index != highest.index => {
                let ((low, low_advice), (high, high_advice)) = (of(lowest), of(highest));
                format!(
                    "Without its return of {low} the record would lead to an advice of {low_advice}, without that of \
                     {high} to one of {high_advice}; no other return matters more."
                )
            }
            (is_lowest, _) => {
                let (left_out, then) = of(if is_lowest { lowest } else { highest });
                format!(
                    "Without its return of {left_out} the record would lead to an advice of {then}; no other return \
                     matters more."
                )
            }
        }];
        if self.selected {
            let returns = self.returns;
            sentences.push(format!(
                "Of its {returns} returns the {tried} likely to matter most were left out, one at a time."
            ));
        }
        sentences
    }

    fn next_return(&self, next: &NextReturn) -> Vec<String> {
        let noun = self.noun;
        let [now, after_low, after_high] = [self.allocation, next.low.allocation, next.high.allocation].map(allocation);
        let [low, high] = [next.low, next.high].map(|next| percent(next.simple_return, 1));
        let mut sentences = vec![match now == after_low && now == after_high {
            true => format!("{AFTER}{low} or of {high} the advice would stay at {now}."),
            false => {
                format!("{AFTER}{low} the advice would be {after_low}; after one of {high} it would be {after_high}.")
            }
        }];
        sentences.extend(next.to_bank.map(|to| match (is_invested(self.allocation), percent(to.simple_return, 1)) {
            (false, to) => format!("The advice leaves the bank only if the next {noun} returns more than {to}."),
            (true, to) => format!("A return of {to} next {noun} would move the advice fully into the bank."),
        }));
        let is_highest = self.allocation >= self.highest - AT_AN_END;
        sentences.extend(next.to_highest.map(|to| match (is_highest, percent(to.simple_return, 1)) {
            (true, to) => format!("The advice stays at {now} unless the next {noun} returns less than {to}."),
            (false, to) => {
                let highest = allocation(self.highest);
                format!("A return of {to} next {noun} would move the advice to {highest}, the highest.")
            }
        }));
        sentences
    }

    fn premium(&self, &Premium { present, needed, periods_more }: &Premium) -> Vec<String> {
        let noun = self.noun;
        let decimals = needed.map_or(2, |needed| digits::deciding(100.0 * present, 100.0 * needed, 2));
        let paid = percent(present, decimals);
        let paid = format!("The record has paid {paid} a {noun} more than the bank pays now");
        let Some(needed) = needed else {
            return vec![format!("{paid}; at no similar average does the advice enter or leave the bank.")];
        };
        let mut sentences = vec![format!("{paid}; the advice leaves the bank at {}.", percent(needed, decimals))];
        sentences.extend(match periods_more {
            Some(0) => None,
            Some(1) => Some(format!("About 1 more {noun} like those seen would also be enough.")),
            Some(more) => Some(format!("About {more} more {noun}s like those seen would also be enough.")),
            None => Some(format!("No number of {noun}s like those seen, up to {MOST_PERIODS}, would be enough.")),
        });
        sentences
    }
}

/// Formats a share of wealth; nothing and everything, after rounding, have no decimals.
fn allocation(share: f64) -> String {
    let is_end = ["0.0", "100.0"].contains(&digits::fixed(100.0 * share, 1).as_str());
    percent(share, usize::from(!is_end))
}

#[cfg(test)]
mod tests {
    use super::super::{NextAdvice, ReturnAndLog, Sensitivity};
    use super::*;

    fn left_out(index: usize, simple_return: f64, allocation: f64) -> LeftOut {
        LeftOut { index, log_return: simple_return.ln_1p(), simple_return, allocation }
    }

    fn next(simple_return: f64, allocation: f64) -> NextAdvice {
        NextAdvice { quantile: 0.05, log_return: simple_return.ln_1p(), simple_return, allocation }
    }

    fn crossing(simple_return: f64) -> Option<ReturnAndLog> {
        Some(ReturnAndLog { log_return: simple_return.ln_1p(), simple_return })
    }

    fn after(low: f64, high: f64) -> NextReturn {
        NextReturn {
            range: [-0.1, 0.1],
            to_bank: None,
            to_highest: None,
            low: next(-0.07, low),
            high: next(0.06, high),
        }
    }

    fn described(allocation: f64, noun: &'static str) -> SensitivityText {
        SensitivityText { allocation, highest: 1.0, returns: 12, selected: false, noun }
    }

    const PAID: Premium = Premium { present: 0.0051, needed: Some(0.0044), periods_more: Some(0) };

    #[test]
    fn the_sentences_say_what_changes_in_percent() {
        let range = WithoutOne { lowest: left_out(3, 0.03, 0.4304), highest: left_out(7, -0.086, 1.0), tried: 12 };
        let next = NextReturn { to_bank: crossing(-0.062), to_highest: crossing(0.08), ..after(0.0, 0.612) };
        assert_eq!(
            described(0.43, "period").sentences(Some(&range), &next, &PAID),
            [
                "The advice is close to changing: an unusual period would move it by 43 points.",
                "Without its return of -8.6 % the record would lead to an advice of 100 %; no other return matters more.",
                "After a return of -7.0 % the advice would be 0 %; after one of 6.0 % it would be 61.2 %.",
                "A return of -6.2 % next period would move the advice fully into the bank.",
                "A return of 8.0 % next period would move the advice to 100 %, the highest.",
                "The record has paid 0.51 % a period more than the bank pays now; the advice leaves the bank at 0.44 %.",
            ]
        );
        let close = Premium { present: 0.00021, needed: Some(0.000198), ..PAID };
        assert!(
            described(0.43, "day").premium(&close)[0]
                .ends_with("paid 0.0210 % a day more than the bank pays now; the advice leaves the bank at 0.0198 %.")
        );
    }

    #[test]
    fn the_change_is_a_crossing_if_there_is_one() {
        let bank = NextReturn { to_bank: crossing(-0.062), ..after(0.0, 0.612) };
        for (next_return, expected) in [
            (bank, "A return of -6.2 % next period would move the advice fully into the bank."),
            (
                after(0.1, 0.612),
                "After a return of -7.0 % the advice would be 10.0 %; after one of 6.0 % it would be 61.2 %.",
            ),
        ] {
            let sentences = described(0.43, "period").sentences(None, &next_return, &PAID);
            let found = Sensitivity { without_one: None, next_return, premium: PAID, sentences, caution: None };
            assert_eq!(found.change(), Some(expected));
        }
    }

    #[test]
    fn the_returns_that_matter_most_are_named_once() {
        let range = WithoutOne { lowest: left_out(3, 0.03, 0.2), highest: left_out(7, -0.086, 0.5), tried: 5 };
        let some = SensitivityText { selected: true, ..described(0.43, "day") };
        assert_eq!(
            some.without_one(&range),
            [
                "Without its return of 3.0 % the record would lead to an advice of 20.0 %, without that of -8.6 % to one of \
                 50.0 %; no other return matters more.",
                "Of its 12 returns the 5 likely to matter most were left out, one at a time.",
            ]
        );
        let only = WithoutOne { highest: range.lowest, ..range };
        let named = described(0.43, "day").without_one(&only);
        assert_eq!(named.len(), 1);
        assert_eq!(named[0].matches("3.0 %").count(), 1, "{named:?}");
    }

    #[test]
    fn the_first_says_what_an_unusual_period_would_do() {
        let first = |low, high| described(0.43, "month").sentences(None, &after(low, high), &PAID).swap_remove(0);
        assert_eq!(first(0.4, 0.48), "An unusual month would move the advice by up to 5.0 points.");
        assert_eq!(first(0.425, 0.44), "Nine in ten months would move the advice by less than 2 points.");
    }

    #[test]
    fn in_the_bank_they_say_what_it_would_take_to_leave() {
        let range = WithoutOne { lowest: left_out(3, 0.03, 0.0), highest: left_out(3, 0.03, 0.0), tried: 12 };
        let banked = |periods_more, needed| {
            let premium = Premium { needed, periods_more, ..PAID };
            described(0.0, "period").sentences(Some(&range), &after(0.0, 0.0), &premium)
        };
        let enough = banked(Some(37), Some(0.0061));
        assert!(enough[1].starts_with("No single return of the record matters"), "{enough:?}");
        assert_eq!(enough[2], "After a return of -7.0 % or of 6.0 % the advice would stay at 0 %.");
        assert!(enough[3].ends_with("leaves the bank at 0.61 %."), "{enough:?}");
        assert_eq!(enough[4], "About 37 more periods like those seen would also be enough.");
        assert!(banked(Some(1), Some(0.0061))[4].starts_with("About 1 more period like"));
        assert!(banked(None, Some(0.0061))[4].starts_with("No number of periods like those seen, up to 10000,"));
        assert!(banked(None, None)[3].contains("at no similar average"));
    }

    #[test]
    fn the_ends_are_those_of_the_advice_and_not_of_its_digits() {
        let ends = NextReturn { to_bank: crossing(0.103), to_highest: crossing(-0.02), ..after(0.0, 0.5) };
        let of =
            |allocation, highest| SensitivityText { highest, ..described(allocation, "period") }.next_return(&ends);
        let leaves = "The advice leaves the bank only if the next period returns more than 10.3 %.";
        assert_eq!(of(0.0, 1.0)[1], leaves);
        // It is invested, although it is printed as 0 %.
        assert_eq!(of(0.0004, 1.0)[1], "A return of 10.3 % next period would move the advice fully into the bank.");
        let stays = |share| format!("The advice stays at {share} unless the next period returns less than -2.0 %.");
        assert_eq!([of(1.0, 1.0)[2].clone(), of(0.6, 0.6)[2].clone()], [stays("100 %"), stays("60.0 %")]);
        assert_eq!(of(0.6, 0.8)[2], "A return of -2.0 % next period would move the advice to 80.0 %, the highest.");
    }
}
