//! An advice for one period in plain words and a small table.

mod caution;
mod several;

use std::fmt::Write;

use ballast::control::error::FieldError;
use ballast::control::policy::advice::{Advice, AdviceSource};
use ballast::control::policy::worst_case::WorstCase;
use ballast::numerics::machine::digits::{fixed, grouped, percent};
use ballast::service::advice::advise::Advised;

pub use several::describe_several;

/// Smallest trade worth doing: the printed digits would not show a smaller one.
const SMALLEST_TRADE: f64 = 5e-4;

/// Describes the trade, the reason and the figures. The figures of the caution are per year of `periods` periods.
pub fn describe(advised: &Advised, wealth: f64, noun: &str, periods: f64) -> String {
    let advice = &advised.advice;
    let mut text = format!("{} {}\n", hold(advice, noun), trade(advice, wealth));
    if advice.source == AdviceSource::Unsolved {
        return text + &advised.worst_case.sentence;
    }
    text += &format!("{}\n\n", why(advised, noun));
    for (name, figure, meaning) in figures(advised, wealth, noun) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<22}{figure:>14}  {meaning}");
    }
    if let Some(levels) = &advised.levels {
        text += &format!("\n{}", caution::describe(levels, periods));
    }
    for sentence in near(advised) {
        text += &format!("\n{sentence}");
    }
    text.trim_end().to_owned()
}

/// Appends the advice by longer periods if it was computed, or why there is none.
pub fn append_coarser(text: String, coarser: &[(&str, Result<f64, FieldError>)]) -> String {
    if coarser.is_empty() {
        return text;
    }
    let of = |(noun, share): &(&str, Result<f64, FieldError>)| match share {
        Ok(share) => format!("{} by {noun}s", percent(*share, 1)),
        Err(FieldError { rule, .. }) => format!("not available by {noun}s (their returns {rule})"),
    };
    let shares: Vec<String> = coarser.iter().map(of).collect();
    format!(
        "{text}\n\nWith longer periods the advice from this record is {}. Give returns as far apart as you decide.",
        shares.join(", ")
    )
}

/// Lists the warnings and, if requested, how close the advice is to changing.
fn near(Advised { caution, sensitivity, warnings, .. }: &Advised) -> impl Iterator<Item = &String> {
    let warnings = warnings.iter().map(|warning| &warning.message);
    let cautions = caution.iter().map(|caution| &caution.sentence);
    warnings.chain(cautions).chain(sensitivity.iter().flat_map(|sensitivity| &sensitivity.sentences))
}

fn hold(advice: &Advice, noun: &str) -> String {
    match advice.allocation {
        0.0 => format!("Hold nothing in the risky asset through the coming {noun}: keep all wealth in the bank."),
        share if share >= 1.0 => format!("Hold all wealth in the risky asset through the coming {noun}."),
        share => {
            let share = percent(share, 1);
            format!("Hold {share} of wealth in the risky asset through the coming {noun}, the rest in the bank.")
        }
    }
}

fn trade(advice: &Advice, wealth: f64) -> String {
    let (verb, change) = (if advice.trade > 0.0 { "Buy" } else { "Sell" }, advice.trade.abs());
    let held = if advice.holding > 0.0 { percent(advice.holding, 1) } else { "nothing".into() };
    if change < SMALLEST_TRADE {
        return format!("Nothing is to be traded: {held} is held now.");
    }
    format!("{verb} for {}: {held} is held now.", money(change * wealth))
}

fn why(Advised { advice, worst_case, why_nothing, .. }: &Advised, noun: &str) -> String {
    let among = format!("Against the worst law in the ball around the {} returns", advice.sample_size);
    if advice.allocation <= 0.0 {
        let why = why_nothing
            .as_ref()
            .map_or(String::new(), |why| format!("\n{}", caution::why_nothing("The record", why, noun)));
        return format!("{among}, nothing beats the bank.{why}");
    }
    format!(
        "{among}, that is worth {} for certain at the end of the {noun};\nthe bank alone reaches {}. {}",
        money(advice.certainty_equivalent),
        money(advice.floor),
        worst(worst_case, noun)
    )
}

/// Describes how the worst law changes the observed returns.
fn worst(worst: &WorstCase, noun: &str) -> String {
    let moved = worst.summary().and_then(|summary| Some((summary.share_moved?, summary.lowest_destination?)));
    let Some((share, lowest)) = moved.filter(|(share, _)| *share > 0.0) else {
        return "No law among them does worse than the returns seen.".into();
    };
    let (one_in, size) = (grouped(&fixed(1.0 / share, 0)), percent(lowest.exp_m1().abs(), 0));
    let is_many = 1.0 / share < 2.5;
    if lowest >= 0.0 {
        let best = if is_many { format!("{} of {noun}s", percent(share, 0)) } else { format!("{noun} in {one_in}") };
        return format!("That law counts the best {best} as only {size}.");
    }
    let often =
        if is_many { format!("{} of all {noun}s", percent(share, 0)) } else { format!("one {noun} in {one_in}") };
    format!("That law makes {often} worse than it was: the worst of them loses {size}.")
}

/// Returns rows of name, figure and meaning.
fn figures(Advised { advice, levels, .. }: &Advised, wealth: f64, noun: &str) -> Vec<(&'static str, String, String)> {
    let error = levels.as_ref().and_then(|levels| levels.levels.iter().find_map(|level| level.allocation_error));
    let (decimals, known) = match error.filter(|error| *error >= 5e-5) {
        Some(error) => (1, format!(", give or take {:.1} by the simulation of its caution", 100.0 * error)),
        None => (2, String::new()),
    };
    let of_wealth = format!("of wealth in the risky asset{known}");
    let mut rows = vec![("allocation", percent(advice.allocation, decimals), of_wealth)];
    if advice.band.low < advice.band.high {
        let (low, high) = (percent(advice.band.low, 1), percent(advice.band.high, 1));
        rows.push(("band", format!("{low} to {high}"), "if you hold a share between these, keep it".into()));
    }
    let ahead = advice.certainty_equivalent - advice.floor;
    rows.extend([
        ("trade", signed(advice.trade), format!("of wealth; {} is held", percent(advice.holding, 2))),
        (
            "certainty equivalent",
            money(advice.certainty_equivalent),
            format!("the sure wealth after the {noun} that the advice is worth"),
        ),
        ("floor", money(advice.floor), "wealth after it with all in the bank".into()),
        ("above the floor", money(ahead), format!("{:.2} basis points of wealth now", 1e4 * ahead / wealth)),
        (
            "radius",
            percent(advice.radius, 3),
            format!("of log-return a {noun}: how far the true law may be from what was seen"),
        ),
    ]);
    rows
}

/// Formats an amount with four decimals if it is small, or else with two.
fn money(amount: f64) -> String {
    let decimals = if amount.abs() < 1000.0 { 4 } else { 2 };
    format!("{amount:.decimals$}")
}

fn signed(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use ballast::control::policy::worst_case::TransportedMass;
    use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification};
    use ballast::service::advice::advise::Advise;

    use super::*;

    fn law(transport: &[(f64, f64, f64)]) -> WorstCase {
        let mass = |&(atom, moved_to, mass)| TransportedMass { atom, moved_to, mass };
        WorstCase { transport: transport.iter().map(mass).collect(), ..WorstCase::unknown() }
    }

    #[test]
    fn the_worst_law_is_told_in_periods() {
        let stays = |share: f64| (0.01, 0.01, 1.0 - share);
        let one = law(&[stays(1.0 / 23.0), (0.04, 0.81_f64.ln(), 1.0 / 23.0)]);
        let words = "That law makes one month in 23 worse than it was: the worst of them loses 19 %.";
        assert_eq!(worst(&one, "month"), words);
        let two = law(&[stays(0.6), (0.04, -0.02, 0.4), (0.05, 1.03_f64.ln(), 0.2)]);
        let words = "That law makes 60 % of all days worse than it was: the worst of them loses 2 %.";
        assert_eq!(worst(&two, "day"), words);
        let gain = law(&[stays(0.25), (0.5, 1.03_f64.ln(), 0.25)]);
        assert_eq!(worst(&gain, "year"), "That law counts the best year in 4 as only 3 %.");
        let most = law(&[stays(0.5), (0.5, 1.03_f64.ln(), 0.5)]);
        assert_eq!(worst(&most, "day"), "That law counts the best 50 % of days as only 3 %.");
        assert_eq!(worst(&law(&[stays(0.0)]), "year"), "No law among them does worse than the returns seen.");
    }

    fn advised(history: &[f64], holding: f64, trading_cost: f64) -> Advised {
        let utility = UtilitySpecification::relative(3.0);
        let problem = ProblemSpecification {
            horizon: 1,
            utility,
            trading_cost,
            ..ProblemSpecification::of(history.to_vec(), 0.001)
        };
        Advise { problem, wealth: Some(2000.0), holding: Some(holding), seed: 1, sensitivity: false }.answer().unwrap()
    }

    #[test]
    fn what_to_do_stands_first() {
        let text = |history: &[f64], holding, cost| describe(&advised(history, holding, cost), 2000.0, "week", 52.0);
        let falling = text(&[-0.01, -0.03], 0.5, 0.0);
        let first = "Hold nothing in the risky asset through the coming week: keep all wealth in the bank. Sell for \
                     1000.00: 50.0 % is held now.\nAgainst the worst law in the ball around the 2 returns, nothing beats \
                     the bank.\nThe record paid 2.08 % a week less than the bank; the chance error of that is 0.98 %.\nHalf \
                     the caution would hold nothing either.\n\n";
        assert!(falling.starts_with(first), "{falling}");
        assert!(text(&[-0.01, -0.03], 0.0, 0.0).contains("bank. Nothing is to be traded: nothing is held now.\n"));
        assert!(!falling.contains("band"), "{falling}");
        assert!(text(&[-0.01, -0.03], 0.5, 0.05).contains("\n  band "));
        let Advised { advice, .. } = advised(&[0.100, 0.101], 0.25, 0.0);
        let all = Advice { allocation: 1.0, trade: 0.75, ..advice.clone() };
        assert_eq!(hold(&all, "day"), "Hold all wealth in the risky asset through the coming day.");
        assert_eq!(trade(&all, 200.0), "Buy for 150.0000: 25.0 % is held now.");
        let third = Advice { allocation: 1.0 / 3.0, ..advice };
        assert!(
            hold(&third, "day")
                .starts_with("Hold 33.3 % of wealth in the risky asset through the coming day, the rest")
        );
    }
}
