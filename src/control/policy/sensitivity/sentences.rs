//! How close an advice is to changing, in sentences.

use super::{LeftOut, NextReturn, Premium, WithoutOne};
use crate::numerics::machine::digits;

/// An advice that an unusual return moves by less than this is steady.
const STEADY: f64 = 0.02;
/// An advice that an unusual return moves by more than this is close to changing.
const CLOSE: f64 = 0.1;

/// The advice whose sensitivity is described.
pub(super) struct Described {
    /// The share of wealth advised.
    pub allocation: f64,
    /// Number of returns in its record.
    pub returns: usize,
    /// The noun for a period, such as `month`.
    pub noun: &'static str,
}

impl Described {
    /// Returns the sentences, of which the first sums up the others.
    pub(super) fn sentences(
        &self,
        without_one: Option<&WithoutOne>,
        next_return: &NextReturn,
        premium: &Premium,
    ) -> Vec<String> {
        let mut sentences = vec![self.summary(next_return)];
        sentences.extend(without_one.into_iter().flat_map(|range| self.without_one(range)));
        sentences.extend(self.next_return(next_return));
        sentences.extend(self.premium(premium));
        sentences
    }

    fn summary(&self, NextReturn { low, high, .. }: &NextReturn) -> String {
        let moved = [low, high].map(|next| (next.allocation - self.allocation).abs());
        let (moved, noun) = (moved[0].max(moved[1]), self.noun);
        if moved < STEADY {
            return format!("The advice is steady: nine in ten {noun}s would move it by less than 2 points.");
        }
        let points = digits::fixed(100.0 * moved, usize::from(moved < CLOSE));
        match moved < CLOSE {
            true => format!("The advice moves a little: an unusual {noun} would move it by up to {points} points."),
            false => format!("The advice is close to changing: an unusual {noun} would move it by {points} points."),
        }
    }

    fn without_one(&self, range: &WithoutOne) -> Vec<String> {
        let changed = |end: &LeftOut| allocation(end.allocation) != allocation(self.allocation);
        let without = |end: LeftOut| {
            let (left_out, then) = (percent(end.simple_return, 1), allocation(end.allocation));
            format!("Without its return of {left_out} the advice would be {then}.")
        };
        let mut sentences: Vec<String> = Vec::new();
        sentences.extend([range.lowest, range.highest].into_iter().filter(changed).map(without));
        if sentences.is_empty() {
            let stays = "No single return of the record matters: without any one of them the advice stays the same.";
            sentences.push(stays.to_owned());
        }
        if range.tried < self.returns {
            sentences.push(format!("For this, {} of its {} returns were left out.", range.tried, self.returns));
        }
        sentences
    }

    fn next_return(&self, next: &NextReturn) -> Vec<String> {
        let noun = self.noun;
        let [now, after_low, after_high] = [self.allocation, next.low.allocation, next.high.allocation].map(allocation);
        let [low, high] = [next.low, next.high].map(|next| percent(next.simple_return, 1));
        let mut sentences = vec![match now == after_low && now == after_high {
            true => format!("After a return of {low} or of {high} it would stay at {now}."),
            false => format!("After a return of {low} it would be {after_low}, after one of {high} {after_high}."),
        }];
        sentences.extend(next.to_bank.map(|to| match (now == allocation(0.0), percent(to.simple_return, 1)) {
            (true, to) => format!("The advice leaves the bank only if the next {noun} returns more than {to}."),
            (false, to) => format!("A return of {to} next {noun} would move the advice fully into the bank."),
        }));
        sentences.extend(next.to_highest.map(|to| match (now == allocation(1.0), percent(to.simple_return, 1)) {
            (true, to) => format!("It stays there unless the next {noun} returns less than {to}."),
            (false, to) => format!("A return of {to} next {noun} would move it to the highest allocation."),
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
            None => Some(format!("No number of {noun}s like those seen, up to 10,000, would be enough.")),
        });
        sentences
    }
}

/// Formats a share of wealth; nothing and everything have no decimals.
fn allocation(share: f64) -> String {
    let rounded = digits::fixed(100.0 * share, 1);
    format!("{} %", rounded.strip_suffix(".0").filter(|whole| ["0", "100"].contains(whole)).unwrap_or(&rounded))
}

fn percent(share: f64, decimals: usize) -> String {
    format!("{} %", digits::fixed(100.0 * share, decimals))
}

#[cfg(test)]
mod tests {
    use super::super::{NextAdvice, ReturnAndLog};
    use super::*;

    fn left_out(simple_return: f64, allocation: f64) -> LeftOut {
        LeftOut { index: 0, log_return: simple_return.ln_1p(), simple_return, allocation }
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

    fn described(allocation: f64, noun: &'static str) -> Described {
        Described { allocation, returns: 12, noun }
    }

    const PAID: Premium = Premium { present: 0.0051, needed: Some(0.0044), periods_more: Some(0) };

    #[test]
    fn the_sentences_say_what_changes_in_percent() {
        let range = WithoutOne { lowest: left_out(0.03, 0.4304), highest: left_out(-0.086, 1.0), tried: 12 };
        let next = NextReturn { to_bank: crossing(-0.062), ..after(0.0, 0.612) };
        assert_eq!(
            described(0.43, "period").sentences(Some(&range), &next, &PAID),
            [
                "The advice is close to changing: an unusual period would move it by 43 points.",
                "Without its return of -8.6 % the advice would be 100 %.",
                "After a return of -7.0 % it would be 0 %, after one of 6.0 % 61.2 %.",
                "A return of -6.2 % next period would move the advice fully into the bank.",
                "The record has paid 0.51 % a period more than the bank pays now; the advice leaves the bank at 0.44 %.",
            ]
        );
        let fewer = described(0.43, "day").without_one(&WithoutOne { tried: 5, ..range });
        assert_eq!(fewer[1..], ["For this, 5 of its 12 returns were left out."]);
        let close = Premium { present: 0.00021, needed: Some(0.000198), ..PAID };
        assert!(
            described(0.43, "day").premium(&close)[0]
                .ends_with("paid 0.0210 % a day more than the bank pays now; the advice leaves the bank at 0.0198 %.")
        );
    }

    #[test]
    fn the_first_says_what_an_unusual_period_would_do() {
        let first = |low, high| described(0.43, "month").sentences(None, &after(low, high), &PAID).swap_remove(0);
        assert!(first(0.4, 0.48).ends_with("moves a little: an unusual month would move it by up to 5.0 points."));
        assert!(first(0.425, 0.44).ends_with("is steady: nine in ten months would move it by less than 2 points."));
    }

    #[test]
    fn in_the_bank_they_say_what_it_would_take_to_leave() {
        let range = WithoutOne { lowest: left_out(0.03, 0.0), highest: left_out(0.03, 0.0), tried: 12 };
        let banked = |periods_more, needed| {
            let premium = Premium { needed, periods_more, ..PAID };
            described(0.0, "period").sentences(Some(&range), &after(0.0, 0.0), &premium)
        };
        let enough = banked(Some(37), Some(0.0061));
        assert!(enough[1].starts_with("No single return of the record matters"), "{enough:?}");
        assert_eq!(enough[2], "After a return of -7.0 % or of 6.0 % it would stay at 0 %.");
        assert!(enough[3].ends_with("leaves the bank at 0.61 %."), "{enough:?}");
        assert_eq!(enough[4], "About 37 more periods like those seen would also be enough.");
        assert!(banked(Some(1), Some(0.0061))[4].starts_with("About 1 more period like"));
        assert!(banked(None, Some(0.0061))[4].starts_with("No number of periods like those seen, up to 10,000,"));
        assert!(banked(None, None)[3].contains("at no similar average"));
        let crossed = |allocation, next| described(allocation, "period").next_return(&next).swap_remove(1);
        assert_eq!(
            crossed(0.0, NextReturn { to_bank: crossing(0.103), ..after(0.0, 0.5) }),
            "The advice leaves the bank only if the next period returns more than 10.3 %."
        );
        assert_eq!(
            crossed(1.0, NextReturn { to_highest: crossing(-0.02), ..after(0.0, 1.0) }),
            "It stays there unless the next period returns less than -2.0 %."
        );
    }
}
