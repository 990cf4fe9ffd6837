//! The story that the demo tells: the information before 2008, the advice, and its results.

use ballast::control::evaluation::names::StrategyKind;
use serde_json::json;

use super::DemoError;
use super::calls::{DemoAdvice, DemoMove, DemoWorstCase, advice, observe, open_session, train};
use super::past::{ALPHA, HISTORY, INITIAL_WEALTH, Past, RISK_AVERSION};
use crate::command::returns::{Returns, Row};
use ballast::http::api_client::ApiClient;

pub const YEAR: &str = "2008";
pub const FIRST_MONTH: &str = "2008-01";
/// Januaries in which the same rule, looking one month ahead, is computed for comparison.
const JANUARIES: [&str; 4] = ["1947-01", "1975-01", "1987-01", FIRST_MONTH];
pub const HORIZON: usize = 12;
const LINE_WIDTH: usize = 108;
/// Number of moves of the worst-case law that are listed singly.
const MOVES_TOLD: usize = 3;

/// Trains, explains the advice, and goes through the year.
pub async fn narrate(api: &ApiClient, count: usize) -> Result<(), DemoError> {
    let market = Returns::bundled()?;
    let past = Past::before(&market, FIRST_MONTH)?;
    println!(
        "\nTraining on the US stock market of the {HISTORY} months before {FIRST_MONTH} for the {HORIZON} months after:"
    );
    println!(
        "power utility, risk aversion {RISK_AVERSION}, bridge radius at alpha {ALPHA}, {count} design points a step."
    );
    let policy = train(api, past.record(), HORIZON, count).await?;
    let session = open_session(api, &policy).await?;
    println!("Policy {policy:.12} is trained; session {session} starts with wealth {INITIAL_WEALTH}.");
    let first: DemoAdvice = advice(api, &session, true).await?;
    tell_why(&past, &first);
    tell_worst_case("this", first.worst_case.as_ref());
    compare_januaries(api, &market, count).await?;
    let last = live_through(api, &session, &past, market.year(YEAR)).await?;
    if let Some(last) = last {
        println!();
        tell_worst_case("December's", last.worst_case.as_ref());
    }
    Ok(())
}

fn tell_why(past: &Past, advice: &DemoAdvice) {
    println!(
        "\nAdvice for {}: hold {:.0} % in stocks (allocation {:.2}, radius {:.4}).",
        past.month,
        100.0 * advice.allocation,
        advice.allocation,
        advice.radius
    );
    println!(
        "Why: over {} months stocks paid {:.2} % a month beyond the bank. The ball at a nominal 90 % holds laws",
        advice.sample_size,
        100.0 * past.edge()
    );
    println!(
        "that move the average log-return by {:.2} %, the radius. The advice is the best one against the worst of them,",
        100.0 * advice.radius
    );
    println!(
        "and is worth {:.2} for certain at the horizon; the bank alone pays {:.2}.",
        advice.certainty_equivalent, advice.floor
    );
}

/// Returns the reason for a month's allocation, from the figures of its line.
fn reason(edge: f64, radius: f64) -> &'static str {
    match () {
        () if edge <= 0.0 => "stocks paid less than the bank",
        () if edge <= radius => "no more than the radius",
        () => "more than the radius",
    }
}

/// Computes the one-month-ahead advice in several Januaries. Cheap: each is a single robust solve.
async fn compare_januaries(api: &ApiClient, market: &Returns, count: usize) -> Result<(), DemoError> {
    println!("\nThe same rule, looking one month ahead, in four Januaries:");
    println!("{:<8} {:>8} {:>11}  stocks beyond the bank", "month", "radius", "allocation");
    for month in JANUARIES {
        let past = Past::before(market, month)?;
        let policy = train(api, past.record(), 1, count).await?;
        let session = open_session(api, &policy).await?;
        let DemoAdvice { radius, allocation, .. } = advice(api, &session, false).await?;
        let (edge, reason) = (past.edge(), reason(past.edge(), radius));
        println!("{month:<8} {radius:>8.4} {allocation:>11.3}  {:.2} % a month: {reason}", 100.0 * edge);
    }
    Ok(())
}

/// Prints one line per month, and returns the explained advice of the last month.
async fn live_through(
    api: &ApiClient,
    session: &str,
    past: &Past,
    year: &[Row],
) -> Result<Option<DemoAdvice>, DemoError> {
    println!("\nThe year {YEAR}, month by month (the bank pays {:.2} % throughout):", 100.0 * past.rate);
    println!(
        "{:<8} {:>8} {:>11} {:>10} {:>9} {:>16} {:>14}",
        "month",
        "radius",
        "allocation",
        "return",
        "wealth",
        StrategyKind::AllBank.name(),
        StrategyKind::AllStock.name()
    );
    let (mut all_bank, mut all_stock, mut last) = (INITIAL_WEALTH, INITIAL_WEALTH, None);
    for (index, month) in year.iter().enumerate() {
        let advised: DemoAdvice = advice(api, session, index + 1 == year.len()).await?;
        let wealth = observe(api, session, advised.period, ("simple_return", json!(month.risky_return))).await?;
        all_bank *= 1.0 + past.rate;
        all_stock *= 1.0 + month.risky_return;
        println!(
            "{:<8} {:>8.4} {:>11.3} {:>8.2} % {wealth:>9.2} {all_bank:>16.2} {all_stock:>14.2}",
            month.date,
            advised.radius,
            advised.allocation,
            100.0 * month.risky_return
        );
        last = Some(advised);
    }
    Ok(last)
}

/// Prints the worst law behind an advice in words, with its largest moves.
pub fn tell_worst_case(whose: &str, worst_case: Option<&DemoWorstCase>) {
    let Some(worst_case) = worst_case else { return };
    println!("The worst law for {whose} advice:");
    wrapped(&worst_case.sentence, LINE_WIDTH).iter().for_each(|line| println!("{line}"));
    for DemoMove { atom, moved_to, mass } in largest_moves(&worst_case.transport) {
        println!(
            "  a month of {:+.2} % turns into one of {:+.2} %, with probability {:.2} %",
            100.0 * atom.exp_m1(),
            100.0 * moved_to.exp_m1(),
            100.0 * mass
        );
    }
}

/// Breaks a sentence into lines of at most `width` characters, unless a word is longer.
fn wrapped(sentence: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in sentence.split_whitespace() {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= width) {
            Some(line) => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Returns the moves that use most of the radius, largest first.
fn largest_moves(transport: &[DemoMove]) -> Vec<DemoMove> {
    let mut moves: Vec<DemoMove> = transport.iter().filter(|one| one.cost() > 0.0).cloned().collect();
    moves.sort_by(|one, other| other.cost().total_cmp(&one.cost()));
    moves.truncate(MOVES_TOLD);
    moves
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_moves_are_told_first_and_still_mass_not_at_all() {
        let one = |atom, moved_to, mass| DemoMove { atom, moved_to, mass };
        let transport =
            [one(0.1, 0.1, 0.5), one(0.1, 0.0, 0.1), one(0.2, -0.6, 0.1), one(0.0, -0.1, 0.2), one(0.1, 0.05, 0.1)];
        let ends: Vec<f64> = largest_moves(&transport).iter().map(|one| one.moved_to).collect();
        assert_eq!(ends, [-0.6, -0.1, 0.0]);
    }

    #[test]
    fn a_sentence_is_cut_between_words() {
        assert_eq!(wrapped("one two  three overlong", 7), ["one two", "three", "overlong"]);
    }
}
