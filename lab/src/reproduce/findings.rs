//! Statements of the paper's section 3 and whether they hold here, decided by the figures.

use std::fmt;

use ballast::control::evaluation::report::{EvaluationReport, StrategyReport, UtilityReport};
use ballast::control::request::framework::Framework;
use ballast::numerics::machine::digits::fixed;
use ballast::numerics::statistics::summary::Estimate;
use serde::Serialize;

use super::printed::{LOW_QUANTILE, MEAN_QUANTILE, QUANTILES, TABLES};
use super::radius::apart;
use super::runs::{CLOSENESS, Quantiles, Section, Slope, Study};
use super::{Reproduction, runs};

mod learning;

/// Terminal utility of all wealth in the bank, 100 (1 - exp(-1.002^10)).
const ALL_BANK: f64 = 63.947_03;

/// Number of paths behind the paper's own figures, whose sampling error counts also.
const PRINTED_PATHS: f64 = 1000.0;
/// Largest informative reach of a variance's interval, as a share of the figure compared with.
const TELLING: f64 = 0.25;

/// The verdict of the figures on a statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Agrees,
    Differs,
    /// Undecided: the intervals allow both.
    Undecided,
    /// The run is too small for a verdict.
    TooSmall,
}

/// A statement of the paper, and the result here.
#[derive(Debug, Serialize)]
pub struct Finding {
    pub verdict: Verdict,
    pub statement: String,
    pub found: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let verdict = match self.verdict {
            Verdict::Agrees => "Agrees",
            Verdict::Differs => "Differs",
            Verdict::Undecided => "Not enough to tell",
            Verdict::TooSmall => "Too small a run to tell",
        };
        write!(f, "{verdict}: {} {}", self.statement, self.found)
    }
}

/// Combines the parts of a statement: all must hold, and one that does not decides.
fn together(parts: &[Verdict]) -> Verdict {
    match () {
        () if parts.contains(&Verdict::Differs) => Verdict::Differs,
        () if parts.contains(&Verdict::Undecided) => Verdict::Undecided,
        () => Verdict::Agrees,
    }
}

/// Decides whether an estimate lies above 0.
fn positive(estimate: Estimate) -> Verdict {
    match () {
        () if estimate.low > 0.0 => Verdict::Agrees,
        () if estimate.high < 0.0 => Verdict::Differs,
        () => Verdict::Undecided,
    }
}

/// Decides whether one estimate lies above another, by intervals that do not overlap.
fn above(one: Estimate, other: Estimate) -> Verdict {
    let apart = Estimate { value: one.value - other.value, low: one.low - other.high, high: one.high - other.low };
    positive(apart)
}

/// Decides whether an estimate equals a figure with standard error `error`. An interval that reaches further than
/// `within` shows nothing.
fn equals(estimate: Estimate, figure: f64, error: f64, within: f64) -> Verdict {
    let reach = 0.5 * (estimate.high - estimate.low);
    match () {
        () if (estimate.value - figure).abs() > reach.hypot(2.0 * error) => Verdict::Differs,
        () if reach > within => Verdict::Undecided,
        () => Verdict::Agrees,
    }
}

/// Decides whether adaptive earns what the paper prints. Intervals may reach a quarter of the figure, or of the
/// deviation for the mean.
fn mean_and_variance(ours: &UtilityReport, paper: &[f64; 6]) -> Verdict {
    let [mean, variance, ..] = *paper;
    let error = (variance / PRINTED_PATHS).sqrt();
    // For normal utilities the squared error is 2 variance^2 / N.
    let error_of_variance = variance * (2.0 / PRINTED_PATHS).sqrt();
    together(&[
        equals(ours.mean, mean, error, TELLING * variance.sqrt()),
        equals(ours.variance, variance, error_of_variance, TELLING * variance),
    ])
}

fn shown(estimate: Estimate) -> String {
    let [value, low, high] = [estimate.value, estimate.low, estimate.high].map(|figure| fixed(figure, 4));
    format!("{value} [{low}, {high}]")
}

/// Returns every statement, in the order of section 3, and that of section 2.4. None has a verdict if the run is too
/// small for one.
pub fn all(whole: &Reproduction) -> Vec<Finding> {
    let mut findings = compared(&whole.section);
    findings.extend(learning::all(whole));
    findings.extend(slopes(&whole.study));
    if !whole.plan.decides() {
        findings.iter_mut().for_each(|finding| finding.verdict = Verdict::TooSmall);
    }
    findings
}

fn compared(section: &Section) -> Vec<Finding> {
    let mut findings = quantiles(section);
    for (index, case) in section.cases.iter().enumerate() {
        let Some(report) = &case.report else {
            findings.push(Finding {
                verdict: Verdict::Undecided,
                statement: format!("Table {} is for a history whose Q is {}.", index + 1, case.quantile),
                found: format!(
                    "Of {} histories {} came within 2 %: too few to compare.",
                    section.quantiles.drawn, case.found
                ),
            });
            continue;
        };
        let followed = |framework| report.framework(framework);
        if let (Some(adaptive), Some(known), Some(fixed)) =
            (followed(Framework::Adaptive), followed(Framework::KnownLaw), followed(Framework::Static))
        {
            findings.extend(table(index, adaptive, known, fixed));
            findings.extend(parametric(index, report));
        }
    }
    findings
}

/// Returns the finding on the fourth framework of the paper, for which it prints no figures.
fn parametric(index: usize, report: &EvaluationReport) -> Option<Finding> {
    let (known, own) = (report.framework(Framework::KnownLaw)?, report.framework(Framework::ParametricStatic)?);
    let ahead = runs::mean_gap(report, Framework::KnownLaw, Framework::ParametricStatic)?;
    Some(Finding {
        verdict: together(&[positive(ahead), above(known.utility.variance, own.utility.variance)]),
        statement: format!(
            "Table {}: parametric static is the fourth framework, without printed figures; the known law beats every other \
             in the mean, and those are robust against more.",
            index + 1
        ),
        found: format!(
            "Here parametric static earns {} with variance {:.3}, against {:.4} and {:.3} with the known law.",
            shown(own.utility.mean),
            own.utility.variance.value,
            known.utility.mean.value,
            known.utility.variance.value
        ),
    })
}

fn quantiles(section: &Section) -> Vec<Finding> {
    let found = &section.quantiles;
    vec![
        Finding {
            verdict: equals(found.mean, MEAN_QUANTILE, printed_error(found), TELLING * MEAN_QUANTILE),
            statement: format!("Over simulated histories Q has the mean {MEAN_QUANTILE}."),
            found: format!(
                "Here {} over {} histories. The paper's formula fixes it: this is the formula, by simulation.",
                shown(found.mean),
                found.drawn
            ),
        },
        Finding {
            verdict: equals(found.low, LOW_QUANTILE, printed_error_of_low(found), TELLING * LOW_QUANTILE),
            statement: format!("The 1 % quantile of Q is {LOW_QUANTILE}."),
            found: format!("Here {}.", shown(found.low)),
        },
    ]
}

/// Returns the standard error of the paper's mean over as many histories as its figure shows, from the interval here.
fn printed_error(found: &Quantiles) -> f64 {
    0.25 * (found.mean.high - found.mean.low) * (found.drawn as f64 / QUANTILES as f64).sqrt()
}

/// Returns the standard error of the paper's 1 % quantile in the same way.
fn printed_error_of_low(found: &Quantiles) -> f64 {
    0.25 * (found.low.high - found.low.low) * (found.drawn as f64 / QUANTILES as f64).sqrt()
}

fn table(index: usize, adaptive: &StrategyReport, known: &StrategyReport, fixed: &StrategyReport) -> Vec<Finding> {
    let number = index + 1;
    let (paper, ours) = (&TABLES[index].adaptive, &adaptive.utility);
    let ordered = |estimate: &dyn Fn(&StrategyReport) -> f64| (estimate(adaptive), estimate(known), estimate(fixed));
    let (mean, variance) = (ordered(&|of| of.utility.mean.value), ordered(&|of| of.utility.variance.value));
    let (low, least) = (ordered(&|of| of.utility.quantile_20.value), ordered(&|of| of.utility.min));
    // Differences are taken from adaptive, on the same returns.
    let more_than_adaptive = |strategy: &StrategyReport| {
        strategy.difference.as_ref().map_or(Verdict::Undecided, |difference| positive(difference.utility))
    };
    let beyond_static = fixed.difference.as_ref().map(|difference| reversed(difference.utility));
    let static_behind = beyond_static.map_or(Verdict::Undecided, positive);
    vec![
        Finding {
            verdict: all_bank(&fixed.utility),
            statement: format!(
                "Table {number}: the static robust investor stays in the bank and earns {ALL_BANK:.5} without variance."
            ),
            found: format!("Here {} with variance {:.1e}.", shown(fixed.utility.mean), fixed.utility.variance.value),
        },
        Finding {
            verdict: together(&[more_than_adaptive(known), static_behind]),
            statement: format!("Table {number}: in the mean the known law beats adaptive, and adaptive beats static."),
            found: format!("Here {:.4}, {:.4}, {:.4}.", mean.1, mean.0, mean.2),
        },
        Finding {
            verdict: together(&[static_behind, above(ours.quantile_90, fixed.utility.quantile_90)]),
            statement: format!(
                "Table {number}: adaptive beats static significantly in the mean and the 90 % quantile."
            ),
            found: format!(
                "Here adaptive is ahead by {} in the mean; the 90 % quantiles are {} and {}.",
                beyond_static.map_or_else(String::new, shown),
                shown(ours.quantile_90),
                shown(fixed.utility.quantile_90)
            ),
        },
        Finding {
            verdict: together(&[
                above(known.utility.variance, ours.variance),
                above(ours.quantile_20, known.utility.quantile_20),
            ]),
            statement: format!(
                "Table {number}: adaptive has less variance, a higher 20 % quantile and a higher minimum than the known law."
            ),
            found: format!(
                "Here variances {:.3} and {:.3}, 20 % quantiles {:.3} and {:.3}, minima {:.3} and {:.3}; a minimum has no \
                 interval and decides nothing.",
                variance.0, variance.1, low.0, low.1, least.0, least.1
            ),
        },
        Finding {
            verdict: mean_and_variance(ours, paper),
            statement: format!("Table {number}: adaptive earns {} with variance {}.", paper[0], paper[1]),
            found: format!(
                "Here {} with variance {}, over histories within {} % of that Q. Solved exactly, the robust allocation is 0 \
                 wherever the radius exceeds what stocks earn beyond the bank by the sample, and at 20 returns it mostly does.",
                shown(ours.mean),
                shown(ours.variance),
                100.0 * CLOSENESS
            ),
        },
    ]
}

/// Returns the estimate of the opposite difference.
fn reversed(estimate: Estimate) -> Estimate {
    Estimate { value: -estimate.value, low: -estimate.high, high: -estimate.low }
}

fn all_bank(utility: &UtilityReport) -> Verdict {
    match () {
        () if utility.mean.low > ALL_BANK + 1e-4 || utility.variance.low > 1e-6 => Verdict::Differs,
        () if utility.variance.value > 1e-6 => Verdict::Undecided,
        () => Verdict::Agrees,
    }
}

/// Returns the findings on speed. The paper states one for the value of the adaptive framework alone. Gaps of realised
/// utility, and those of static, are in the table of convergence without a verdict.
fn slopes(study: &Study) -> Vec<Finding> {
    let stated = study.slopes.iter().filter(|slope| slope.framework == Framework::Adaptive && slope.gap == "value");
    let finding = |slope: &Slope| Finding {
        verdict: equals(slope.last, -0.5, 0.0, TELLING),
        statement: "Section 2.4: the value of adaptive approaches that of the known law as t0 to the power -1/2."
            .to_owned(),
        found: format!(
            "Here the fitted power of its gap is {}, and {} [{}, {}] between the two longest histories. While the \
             ball keeps the investor in the bank the gap does not shrink, so short histories flatten the fit.",
            fixed(slope.all, 2),
            fixed(slope.last.value, 2),
            fixed(slope.last.low, 2),
            fixed(slope.last.high, 2)
        ),
    };
    stated.map(finding).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(value: f64, reach: f64) -> Estimate {
        Estimate { value, low: value - reach, high: value + reach }
    }

    #[test]
    fn what_the_intervals_do_not_decide_is_undecided() {
        assert_eq!(positive(at(-0.0023, 0.01)), Verdict::Undecided);
        assert_eq!([positive(at(1.0, 0.5)), positive(at(-1.0, 0.5))], [Verdict::Agrees, Verdict::Differs]);
        assert_eq!(
            [above(at(2.0, 0.4), at(1.0, 0.4)), above(at(2.0, 0.6), at(1.0, 0.6))],
            [Verdict::Agrees, Verdict::Undecided]
        );
        // A variance of 35 within 0 and 143 is no evidence of one of 41.9.
        assert_eq!(equals(at(35.0, 108.0), 41.9, 1.9, 10.5), Verdict::Undecided);
        assert_eq!(equals(at(40.0, 3.0), 41.9, 1.9, 10.5), Verdict::Agrees);
        // The paper's own error counts: the figures differ by 0.5, the interval here reaches 0.3, and the paper's
        // standard error is 0.2.
        assert_eq!(
            [equals(at(1.0, 0.3), 1.5, 0.2, 1.0), equals(at(1.0, 0.3), 1.5, 0.1, 1.0)],
            [Verdict::Agrees, Verdict::Differs]
        );
        assert_eq!(together(&[Verdict::Agrees, Verdict::Undecided]), Verdict::Undecided);
        assert_eq!(together(&[Verdict::Undecided, Verdict::Differs]), Verdict::Differs);
    }
}
