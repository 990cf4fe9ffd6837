//! An advice for one period in plain words and a small table.

use std::fmt::Write;

use ballast::control::policy::advice::{Advice, AdviceSource};
use ballast::control::policy::worst_case::WorstCase;
use ballast::service::advise::Advised;

use crate::command::returns::Frequency;

/// Less than this is not traded: what is printed would not show it.
const SMALLEST_TRADE: f64 = 5e-4;

/// What to do, why, and the figures.
pub fn told(advised: &Advised, wealth: f64, frequency: Frequency) -> String {
    let (advice, noun) = (&advised.advice, frequency.noun());
    let mut text = format!("{} {}\n", hold(advice, noun), trade(advice, wealth));
    if advice.source == AdviceSource::Unsolved {
        return text + &advised.worst_case.sentence + "\n";
    }
    text += &format!("{}\n{}\n\n", worth(advice, noun), worst(&advised.worst_case, frequency));
    for (name, figure, meaning) in figures(advice, wealth, noun) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<22}{figure:>14}  {meaning}");
    }
    text
}

fn hold(advice: &Advice, noun: &str) -> String {
    match advice.allocation {
        0.0 => format!("Hold nothing in the risky asset through the coming {noun}, and all wealth in the bank."),
        share if share >= 1.0 => format!("Hold all wealth in the risky asset through the coming {noun}."),
        share => format!(
            "Hold {} of wealth in the risky asset through the coming {noun}, the rest in the bank.",
            percent(share, 1)
        ),
    }
}

fn trade(advice: &Advice, wealth: f64) -> String {
    let (verb, amount) = (if advice.trade > 0.0 { "Buy" } else { "Sell" }, advice.trade.abs());
    if amount < SMALLEST_TRADE {
        return format!("{} is held now: nothing to trade.", percent(advice.holding, 1));
    }
    format!(
        "{} is held now: {} {} of wealth, {:.2}.",
        percent(advice.holding, 1),
        verb.to_lowercase(),
        percent(amount, 1),
        amount * wealth
    )
}

fn worth(advice: &Advice, noun: &str) -> String {
    let returns = advice.sample_size;
    let among = format!("Against the worst law that these {returns} returns do not rule out");
    if advice.allocation <= 0.0 {
        return format!("{among}, nothing beats the bank.");
    }
    format!(
        "{among}, that is worth {:.2} for certain at the end of the {noun}, where the bank alone reaches {:.2}.",
        advice.certainty_equivalent, advice.floor
    )
}

/// What the worst law makes of the returns seen.
fn worst(worst: &WorstCase, frequency: Frequency) -> String {
    let noun = frequency.noun();
    let summary = worst.summary();
    let moved = summary.and_then(|summary| Some((summary.share_moved?, summary.lowest_destination?)));
    match moved {
        Some((share, lowest)) if share > 0.0 => {
            let often = (1.0 / share).round();
            let often = if often <= 1.0 { format!("every {noun}") } else { format!("one {noun} in {often}") };
            let lowest = lowest.exp_m1();
            let change = if lowest < 0.0 { "loses" } else { "gains" };
            format!("That law worsens {often}: the worst of them {change} {}.", percent(lowest.abs(), 1))
        }
        _ => "No such law does worse than the returns seen.".into(),
    }
}

/// Name, figure and meaning.
fn figures(advice: &Advice, wealth: f64, noun: &str) -> Vec<(&'static str, String, String)> {
    let mut rows = vec![("allocation", percent(advice.allocation, 2), "of wealth in the risky asset".to_owned())];
    if advice.band.low < advice.band.high {
        let (low, high) = (percent(advice.band.low, 1), percent(advice.band.high, 1));
        rows.push(("band", format!("{low} to {high}"), "a share held between is best kept as it is".into()));
    }
    let ahead = advice.certainty_equivalent - advice.floor;
    rows.extend([
        ("trade", signed(advice.trade), format!("of wealth; {} is held", percent(advice.holding, 2))),
        (
            "certainty equivalent",
            format!("{:.4}", advice.certainty_equivalent),
            format!("the sure wealth after the {noun} that the advice is worth"),
        ),
        ("floor", format!("{:.4}", advice.floor), "wealth after it with all in the bank".into()),
        ("above the floor", format!("{ahead:.4}"), format!("{:.2} basis points of wealth now", 1e4 * ahead / wealth)),
        (
            "radius",
            percent(advice.radius, 3),
            format!("of log-return a {noun}: how far the true law may be from what was seen"),
        ),
    ]);
    rows
}

fn percent(share: f64, decimals: usize) -> String {
    format!("{:.decimals$} %", 100.0 * share)
}

fn signed(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}
