//! The closing statements of section 3.2: a smaller set, a longer history or horizon, a wrong first guess, and the last
//! periods.

use ballast::control::request::framework::Framework::{Adaptive, Static};
use ballast::numerics::machine::digits::{self, fixed};
use ballast::numerics::statistics::summary::Estimate;

use super::Verdict::Undecided;
use super::{Finding, Verdict, above, apart, positive, shown, together};
use crate::reproduce::Reproduction;
use crate::reproduce::first_guess::{GuessRow, RIGHT, SMALL};
use crate::reproduce::radius::{ChangeRow, ShrunkRow};
use crate::reproduce::runs::{Section, StudyRow};

/// A share in stocks this close to the known law's counts as almost optimal: one step of the constant mixes that the
/// report compares.
const ALMOST: f64 = 0.1;
/// Returns the statements, in the order of the paper.
pub fn all(whole: &Reproduction) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(smaller_quantile(&whole.section));
    findings.extend(larger(&whole.changes));
    findings.extend(shrunk(&whole.section.shrunk));
    findings.extend(sufficient(&whole.study.rows));
    findings.extend(biased(&whole.guesses));
    findings.extend([1.0, SMALL].into_iter().filter_map(|share| almost_optimal(&whole.guesses, share)));
    findings
}

fn percent(share: f64) -> String {
    digits::percent(share, 0)
}

fn percents(estimate: Estimate) -> String {
    let [value, low, high] = [estimate.value, estimate.low, estimate.high].map(|share| fixed(100.0 * share, 0));
    format!("{value} [{low}, {high}] %")
}

/// Returns the finding on a small Q against the average one: adaptive is bolder.
fn smaller_quantile(section: &Section) -> Option<Finding> {
    let adaptive = |index: usize| section.cases[index].report.as_ref()?.framework(Adaptive);
    let [average, small] = [adaptive(0)?, adaptive(1)?].map(|strategy| &strategy.utility);
    Some(Finding {
        verdict: together(&[
            positive(apart([average.variance, small.variance])),
            positive(apart([average.mean, small.mean])),
            positive(apart([average.quantile_90, small.quantile_90])),
            positive(apart([small.quantile_20, average.quantile_20])),
        ]),
        statement: "With the small Q adaptive is bolder: mean, 90 % quantile and variance are larger, and the 20 % \
                    quantile is smaller."
            .to_owned(),
        found: format!(
            "Here the mean changes by {}, the 90 % quantile by {}, the variance by {} and the 20 % quantile by {}.",
            shown(apart([average.mean, small.mean])),
            shown(apart([average.quantile_90, small.quantile_90])),
            shown(apart([average.variance, small.variance])),
            shown(apart([average.quantile_20, small.quantile_20]))
        ),
    })
}

/// Returns the finding on the change that a small Q makes, at the smallest and the largest t0 and T.
fn larger(rows: &[ChangeRow]) -> Option<Finding> {
    let (first, last) = (rows.first()?, rows.last()?);
    let each = rows.iter().map(|row| {
        let (size, horizon) = (row.sample_size, row.horizon);
        format!("{} at t0 = {size} and T = {horizon}", shown(row.change_of_variance))
    });
    Some(Finding {
        verdict: positive(apart([first.change_of_variance, last.change_of_variance])),
        statement: "That change is more significant for larger t0 and T.".to_owned(),
        found: format!("Here the variance grows by {}.", each.collect::<Vec<String>>().join("; ")),
    })
}

/// Returns the findings on static with less and less of its radius.
fn shrunk(rows: &[ShrunkRow]) -> Vec<Finding> {
    let of_static = rows.iter().filter(|row| row.framework == Static).collect::<Vec<&ShrunkRow>>();
    let (Some(whole), Some(least)) = (of_static.first(), of_static.last()) else { return Vec::new() };
    let all = |figure: &dyn Fn(&ShrunkRow) -> String| {
        let each = of_static.iter().map(|row| format!("{} at {}", figure(row), percent(row.radius_share)));
        each.collect::<Vec<String>>().join(", ")
    };
    vec![
        Finding {
            verdict: above(whole.trivial, least.trivial),
            statement: "Static is trivial, and Q must be reduced further for static to hold stocks.".to_owned(),
            found: format!(
                "Here, with Q near the average, static never holds stocks after {} of the radius.",
                all(&|row| format!("{} of histories", percent(row.trivial.value)))
            ),
        },
        Finding {
            verdict: positive(apart([whole.first_variance, least.first_variance])),
            statement: "With a small set, static depends heavily on the initial guess.".to_owned(),
            found: format!(
                "Here the standard deviation over histories of its first share in stocks is {} of the radius.",
                all(&|row| format!("{:.2}", row.first_variance.value.sqrt()))
            ),
        },
    ]
}

/// Returns the finding on static with more data: its loss shrinks as histories grow.
fn sufficient(rows: &[StudyRow]) -> Option<Finding> {
    let mut of_static = rows.iter().filter(|row| row.framework == Static);
    let (first, last) = (of_static.next()?, of_static.next_back()?);
    Some(Finding {
        verdict: positive(apart([last.realised_gap, first.realised_gap])),
        statement: "Static should only be used with sufficient historical data.".to_owned(),
        found: format!(
            "Here its utility is behind the known law's by {} after {} returns, and by {} after {}.",
            shown(first.realised_gap),
            first.sample_size,
            shown(last.realised_gap),
            last.sample_size
        ),
    })
}

/// Returns adaptive and static after each guess with the shortest histories and the longest horizon, where learning has
/// most to do.
fn hardest(rows: &[GuessRow], radius_share: f64) -> Vec<(&GuessRow, &GuessRow)> {
    let size = rows.iter().map(|row| row.sample_size).min();
    let horizon = rows.iter().map(|row| row.horizon).max();
    let at = move |row: &&GuessRow| Some(row.sample_size) == size && Some(row.horizon) == horizon;
    let find = |framework| rows.iter().filter(at).filter(move |row| row.follows(framework, Some(radius_share)));
    find(Adaptive).zip(find(Static)).collect()
}

/// Returns a finding for each wrong guess: static with a small set stays biased, and learning mends it.
fn biased(rows: &[GuessRow]) -> Vec<Finding> {
    let ahead = |row: &GuessRow| row.beyond_static.map_or_else(String::new, shown);
    let finding = |((adaptive, frozen), (bold, _)): ((&GuessRow, &GuessRow), (&GuessRow, &GuessRow))| {
        let ends = |row: &GuessRow| row.distance.last().map_or_else(String::new, |last| percents(*last));
        let decided =
            [adaptive.nearer_than_static, adaptive.beyond_static].map(|found| found.map_or(Undecided, positive));
        Finding {
            verdict: together(&decided),
            statement: format!(
                "With a small set, static stays biased after a wrong first guess and adaptive mends it: {}.",
                adaptive.guess
            ),
            found: format!(
                "Here, with {} of the radius after {} returns and over {} periods, the bias of utility is {} for static and {} \
                 for adaptive, which is ahead by {}. In the last period static holds {} of wealth more or less than the known \
                 law, and adaptive {}. With the whole radius adaptive is ahead by {}.",
                percent(SMALL),
                adaptive.sample_size,
                adaptive.horizon,
                fixed(frozen.bias.value, 2),
                fixed(adaptive.bias.value, 2),
                ahead(adaptive),
                ends(frozen),
                ends(adaptive),
                ahead(bold)
            ),
        }
    };
    let both = hardest(rows, SMALL).into_iter().zip(hardest(rows, 1.0));
    both.filter(|((adaptive, _), _)| adaptive.guess != RIGHT).map(finding).collect()
}

/// Returns the finding on the last periods: adaptive holds almost the optimal share.
fn almost_optimal(rows: &[GuessRow], radius_share: f64) -> Option<Finding> {
    let rows = hardest(rows, radius_share);
    let (first, _) = rows.first()?;
    let within = |estimate: &Estimate| match () {
        () if estimate.high <= ALMOST => Verdict::Agrees,
        () if estimate.low > ALMOST => Verdict::Differs,
        () => Verdict::Undecided,
    };
    let decided: Vec<Verdict> = rows.iter().filter_map(|(adaptive, _)| adaptive.distance.last()).map(within).collect();
    let each = rows.iter().filter_map(|(adaptive, frozen)| {
        let ends = |row: &GuessRow| Some([*row.distance.first()?, *row.distance.last()?]);
        let ([at_first, at_last], [_, unchanged]) = (ends(adaptive)?, ends(frozen)?);
        let guess = adaptive.guess;
        Some(format!(
            "{guess}: {} to {} (static {})",
            percent(at_first.value),
            percents(at_last),
            percent(unchanged.value)
        ))
    });
    Some(Finding {
        verdict: together(&decided),
        statement: format!(
            "Adaptive is almost optimal in the periods near T: its share in stocks is within {} of the known law's ({} of \
             the radius, t0 = {}, T = {}).",
            percent(ALMOST),
            percent(radius_share),
            first.sample_size,
            first.horizon
        ),
        found: format!(
            "Here the mean distance goes from the first period to the last, after a guess of {}.",
            each.collect::<Vec<String>>().join("; ")
        ),
    })
}

#[cfg(test)]
mod tests {
    use ballast::control::evaluation::report::Spread;
    use ballast::control::request::framework::Framework;

    use super::*;

    fn at(value: f64) -> Estimate {
        Estimate { value, low: value - 0.05, high: value + 0.05 }
    }

    /// A strategy after 20 returns that ends `off` the known share, and is `ahead` of static.
    fn row(guess: &'static str, framework: Framework, horizon: usize, off: f64, ahead: f64) -> GuessRow {
        let is_adaptive = framework == Adaptive;
        GuessRow {
            guess,
            sample_size: 20,
            horizon,
            framework,
            radius_share: Some(SMALL),
            bias: at(-1.0),
            variance: at(1.0),
            quantile_20: at(1.0),
            held: vec![Spread { mean: 0.5, quantile_10: 0.0, quantile_90: 1.0 }],
            distance: vec![at(0.5), at(off)],
            beyond_static: is_adaptive.then(|| at(ahead)),
            nearer_than_static: is_adaptive.then(|| at(0.5 - off)),
        }
    }

    fn rows(guess: &'static str, off: f64, ahead: f64) -> Vec<GuessRow> {
        let with = |framework, horizon| row(guess, framework, horizon, off, ahead);
        let mut rows = vec![with(Adaptive, 40), with(Static, 40), with(Adaptive, 5), with(Static, 5)];
        let whole: Vec<GuessRow> = rows.iter().map(|row| GuessRow { radius_share: Some(1.0), ..row.clone() }).collect();
        rows.extend(whole);
        rows
    }

    #[test]
    fn a_guess_is_mended_if_adaptive_is_both_nearer_and_ahead() {
        let verdicts = |off, ahead| biased(&rows("low", off, ahead)).iter().map(|one| one.verdict).collect::<Vec<_>>();
        assert_eq!(verdicts(0.2, 1.0), [Verdict::Agrees]);
        assert_eq!(verdicts(0.2, 0.01), [Undecided]);
        assert_eq!(verdicts(0.8, 1.0), [Verdict::Differs]);
        assert!(biased(&rows(RIGHT, 0.2, 1.0)).is_empty());
    }

    #[test]
    fn the_last_period_is_almost_optimal_within_a_tenth() {
        let verdict = |off| almost_optimal(&rows(RIGHT, off, 0.0), SMALL).map(|finding| finding.verdict);
        assert_eq!(
            [verdict(0.04), verdict(0.1), verdict(0.2)],
            [Verdict::Agrees, Undecided, Verdict::Differs].map(Some)
        );
    }
}
