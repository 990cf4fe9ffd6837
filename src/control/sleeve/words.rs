//! The answer in sentences.

use super::report::{GrowthInBothLaws, Refutation, SleeveReport};
use crate::control::policy::sensitivity::MOST_PERIODS;
use crate::control::request::sleeve::RecordUnit;
use crate::numerics::machine::digits::{deciding, percent};

/// Returns the answer, the most important first; `highest` is the most that may be given.
pub(super) fn sentences(report: &SleeveReport, unit: RecordUnit, periods: Option<f64>, highest: f64) -> Vec<String> {
    let noun = unit.noun(periods);
    let mut sentences = vec![share(report, unit, noun, highest)];
    sentences.push(growth(report, noun));
    sentences.extend(moments(report, noun));
    if let Some(refutation) = &report.refutation {
        sentences.extend(break_even(report, refutation, noun));
        sentences.extend(more(report, refutation, noun, highest));
        sentences.extend(losses(refutation, noun));
    }
    sentences
}

/// Means closer than this are those of one law.
const ALIKE: f64 = 1e-6;

/// Formats a share of the capital.
fn of_capital(share: f64) -> String {
    percent(share, usize::from(share < 1.0 && share > 0.0))
}

fn share(report: &SleeveReport, unit: RecordUnit, noun: &str, highest: f64) -> String {
    let several = report.strategies.as_ref();
    let strategies = if several.is_some() { "the strategies" } else { "the strategy" };
    let trusting = match (report.kelly, several.is_some()) {
        (None, false) => format!(
            "The Kelly share, which takes the record as the truth, has no limit: no {noun} lost against the bank."
        ),
        (None, true) => "No limit to the Kelly shares, which take the record as the truth, was found.".to_owned(),
        (Some(kelly), _) => {
            let borrows = if kelly > 1.0 { " and borrows at the bank's rate" } else { "" };
            format!("the Kelly share of {}, which takes the record as the truth{borrows}.", of_capital(kelly))
        }
    };
    if report.share == 0.0 {
        return match report.kelly {
            Some(0.0) => format!(
                "Give {strategies} nothing: on average the record pays no more than the bank, so the Kelly share is 0 as well."
            ),
            Some(_) => format!(
                "Give {strategies} nothing: at this caution, what the record gained over the bank may be chance. That is 0 % of {trusting}"
            ),
            None => format!(
                "Give {strategies} nothing: at this caution, what the record gained over the bank may be chance. {trusting}"
            ),
        };
    }
    let given = of_capital(report.share);
    let each = match several {
        None => String::new(),
        Some(shares) => {
            let of =
                |(name, one): (&String, &super::report::StrategyShare)| format!("{} {name}", of_capital(one.share));
            let shares: Vec<String> = shares.iter().filter(|(_, one)| one.share > 0.0).map(of).collect();
            format!(": {}", shares.join(", "))
        }
    };
    let now = match (unit, several.is_some()) {
        (RecordUnit::Periods, _) => format!("Give {strategies} {given} of the capital{each}."),
        (RecordUnit::Trades, false) => format!("Stake {given} of the capital on each trade."),
        (RecordUnit::Trades, true) => format!("Stake {given} of the capital on each round of trades{each}."),
    };
    let now = match report.share >= highest {
        true => format!("{now} No more may be given, whatever the record supports."),
        false => now,
    };
    match report.fraction {
        Some(fraction) => format!("{now} That is {} of {trusting}", percent(fraction, 0)),
        None => format!("{now} {trusting}"),
    }
}

fn growth(report: &SleeveReport, noun: &str) -> String {
    let (growth, a_year) = match &report.growth_a_year {
        Some(growth) => (growth, "year"),
        None => (&report.growth, noun),
    };
    let decimals = if a_year == "year" { 1 } else { 2 };
    let percent = |value: f64| percent(value, decimals);
    let lost = |worst: f64| if worst <= -1.0 { "loses everything".to_owned() } else { percent(worst) };
    let bank = percent(growth.bank);
    let GrowthInBothLaws { record, worst } = growth.share;
    let own = match worst {
        _ if report.share == 0.0 => format!("The capital in the bank grows by {bank} a {a_year}"),
        Some(worst) => format!(
            "If the record is the truth, the capital grows by {} a {a_year}; under the worst law that the record does not \
             reject, by {}; the bank pays {bank}",
            percent(record),
            percent(worst)
        ),
        None => format!(
            "If the record is the truth, the capital grows by {} a {a_year}; the bank pays {bank}",
            percent(record)
        ),
    };
    let kelly = growth.kelly.filter(|_| report.kelly.is_some_and(|kelly| kelly > 0.0));
    let kelly = kelly.map(|GrowthInBothLaws { record, worst }| match worst {
        Some(worst) => format!(" The Kelly share gives {} and {}.", percent(record), lost(worst)),
        None => format!(" The Kelly share gives {} if the record is the truth.", percent(record)),
    });
    format!("{own}.{}", kelly.unwrap_or_default())
}

fn moments(report: &SleeveReport, noun: &str) -> Option<String> {
    let (record, worst) = (report.record?, report.worst?);
    if (record.mean - worst.mean).abs() < ALIKE {
        return None;
    }
    let decimals = deciding(100.0 * record.mean, 100.0 * worst.mean, 2);
    Some(format!(
        "The worst law has a mean of {} a {noun} and a standard deviation of {}; the record has {} and {}.",
        percent(worst.mean, decimals),
        percent(worst.standard_deviation, 1),
        percent(record.mean, decimals),
        percent(record.standard_deviation, 1)
    ))
}

fn break_even(report: &SleeveReport, refutation: &Refutation, noun: &str) -> Option<String> {
    let is_given = report.share > 0.0;
    if let (Some(mean), Some(record)) = (refutation.break_even_mean, report.record) {
        let decimals = deciding(100.0 * mean, 100.0 * record.mean, 2);
        let (mean, seen) = (percent(mean, decimals), percent(record.mean, decimals));
        return Some(match is_given {
            true => format!("With a mean of {mean} a {noun} in the record instead of {seen}, the share would be 0."),
            false => {
                format!("The share would leave 0 with a mean above {mean} a {noun} in the record instead of {seen}.")
            }
        });
    }
    let shift = refutation.break_even_shift?;
    let by = percent(shift.abs(), deciding(100.0 * shift, 0.0, 2));
    Some(match is_given {
        true => format!("If all returns of the record were lower by {by} a {noun}, the share would be 0."),
        false => {
            format!("The share would leave 0 if all returns of the record were higher by more than {by} a {noun}.")
        }
    })
}

fn more(report: &SleeveReport, refutation: &Refutation, noun: &str, highest: f64) -> Option<String> {
    let kelly = report.kelly.filter(|kelly| *kelly > 0.0)?;
    let after = |part: &str, share: f64, until: Option<usize>| match until {
        _ if share > highest => Some(format!("{part} is more than the {} that may be given", of_capital(highest))),
        Some(0) => None,
        Some(1) => Some(format!("{part} takes 1 more {noun}")),
        Some(more) => Some(format!("{part} takes {more} more {noun}s")),
        None => Some(format!("{part} is out of reach within {MOST_PERIODS}")),
    };
    let Refutation { until_any, until_half_kelly, until_three_quarters_kelly, .. } = *refutation;
    let parts = [
        after("a share above 0", 0.0, until_any),
        after("half of Kelly", 0.5 * kelly, until_half_kelly),
        // A part that is out of reach leaves the larger one unsaid.
        (0.5 * kelly <= highest)
            .then(|| after("three quarters of Kelly", 0.75 * kelly, until_three_quarters_kelly))
            .flatten(),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    let Some((last, first)) = parts.split_last() else {
        return Some("The record supports three quarters of Kelly already.".to_owned());
    };
    let listed = if first.is_empty() { last.clone() } else { format!("{}, and {last}", first.join(", ")) };
    Some(format!("If what comes is like the record, {listed}."))
}

fn losses(refutation: &Refutation, noun: &str) -> Option<String> {
    let (count, loss) = (refutation.losses_in_a_row?, refutation.mean_loss?);
    let loss = percent(-loss, 1);
    Some(match count {
        1 => format!("After one more {noun} that loses {loss}, the mean loss of the record, the share would be 0."),
        count => {
            format!(
                "After {count} {noun}s in a row that lose {loss} each, the mean loss of the record, the share would be 0."
            )
        }
    })
}
