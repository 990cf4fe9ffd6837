//! What of the paper's section 3 holds here and what does not, as statements decided by the figures.

use std::fmt;

use ballast::control::evaluation::report::StrategyReport;
use ballast::numerics::summary::Estimate;
use serde::Serialize;

use super::printed::{LOW_QUANTILE, MEAN_QUANTILE, TABLES};
use super::runs::{CLOSENESS, Section, Study};

/// Terminal utility of all-bank, 100 (1 - exp(-1.002^10)).
const ALL_BANK: f64 = 63.947_03;

/// A statement of the paper, and what was found.
#[derive(Debug, Serialize)]
pub struct Finding {
    pub agrees: bool,
    pub statement: String,
    pub found: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let verdict = if self.agrees { "Agrees" } else { "Differs" };
        write!(f, "{verdict}: {} {}", self.statement, self.found)
    }
}

fn shown(estimate: Estimate) -> String {
    format!("{:.4} [{:.4}, {:.4}]", estimate.value, estimate.low, estimate.high)
}

fn holds(estimate: Estimate, figure: f64) -> bool {
    estimate.low <= figure && figure <= estimate.high
}

/// Every statement, in the order of the paper.
pub fn all(section: &Section, study: &Study) -> Vec<Finding> {
    let mut findings = quantiles(section);
    for (index, case) in section.cases.iter().enumerate() {
        let Some(report) = &case.report else {
            findings.push(Finding {
                agrees: false,
                statement: format!("Table {} is for a history whose Q is {}.", index + 1, case.quantile),
                found: format!(
                    "Of {} histories {} came within 2 %: too few to compare.",
                    section.quantiles.drawn, case.found
                ),
            });
            continue;
        };
        let strategy = |name| report.strategy(name);
        if let (Some(adaptive), Some(known), Some(fixed), Some(half)) =
            (strategy("adaptive"), strategy("known_law"), strategy("static"), strategy("mix_0.5"))
        {
            findings.extend(table(index, adaptive, known, fixed));
            findings.push(dominated(index, half));
        }
    }
    findings.extend(slopes(study));
    findings
}

fn quantiles(section: &Section) -> Vec<Finding> {
    let found = &section.quantiles;
    vec![
        Finding {
            agrees: holds(found.mean, MEAN_QUANTILE),
            statement: format!("Over simulated histories Q has the mean {MEAN_QUANTILE}."),
            found: format!(
                "Here {} over {} histories. The paper's formula fixes it: this is the formula, by simulation.",
                shown(found.mean),
                found.drawn
            ),
        },
        Finding {
            agrees: holds(found.low, LOW_QUANTILE),
            statement: format!("The 1 % quantile of Q is {LOW_QUANTILE}."),
            found: format!("Here {}.", shown(found.low)),
        },
    ]
}

fn table(index: usize, adaptive: &StrategyReport, known: &StrategyReport, fixed: &StrategyReport) -> Vec<Finding> {
    let number = index + 1;
    let (paper, ours) = (&TABLES[index].adaptive, &adaptive.utility);
    let ordered = |estimate: &dyn Fn(&StrategyReport) -> f64| (estimate(adaptive), estimate(known), estimate(fixed));
    let (mean, variance) = (ordered(&|of| of.utility.mean.value), ordered(&|of| of.utility.variance.value));
    let (low, least) = (ordered(&|of| of.utility.quantile_20.value), ordered(&|of| of.utility.min.value));
    vec![
        Finding {
            agrees: (fixed.utility.mean.value - ALL_BANK).abs() < 1e-4 && fixed.utility.variance.value < 1e-6,
            statement: format!("Table {number}: static robust is all-bank, {ALL_BANK:.5} without variance."),
            found: format!("Here {} with variance {:.1e}.", shown(fixed.utility.mean), fixed.utility.variance.value),
        },
        Finding {
            agrees: mean.1 > mean.0 && mean.0 >= mean.2 - 1e-4,
            statement: format!("Table {number}: in the mean the known law beats adaptive, and adaptive beats static."),
            found: format!("Here {:.4}, {:.4}, {:.4}.", mean.1, mean.0, mean.2),
        },
        Finding {
            agrees: variance.0 < variance.1 && low.0 > low.1 && least.0 > least.1,
            statement: format!(
                "Table {number}: adaptive has less variance, a higher 20 % quantile and a higher minimum than the known law."
            ),
            found: format!(
                "Here variances {:.3} and {:.3}, 20 % quantiles {:.3} and {:.3}, minima {:.3} and {:.3}.",
                variance.0, variance.1, low.0, low.1, least.0, least.1
            ),
        },
        Finding {
            agrees: holds(ours.mean, paper[0]) && holds(ours.variance, paper[1]),
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

/// The paper's adaptive row against a constant mix.
fn dominated(index: usize, half: &StrategyReport) -> Finding {
    let paper = &TABLES[index].adaptive;
    let (mean, variance) = (half.utility.mean, half.utility.variance);
    Finding {
        agrees: !(mean.low > paper[0] && variance.high < paper[1]),
        statement: format!("Table {}: no constant mix earns more than its adaptive row at less variance.", index + 1),
        found: format!("A constant half in stocks has mean {} and variance {}.", shown(mean), shown(variance)),
    }
}

fn slopes(study: &Study) -> Vec<Finding> {
    let finding = |slope: &super::runs::Slope| Finding {
        agrees: (slope.last + 0.5).abs() < 0.15,
        statement: format!(
            "Section 2.4: the {} gap of {} to the known law closes like t0 to the power -1/2.",
            slope.gap, slope.strategy
        ),
        found: format!(
            "Here the fitted power is {:.2}, and {:.2} between the two longest histories. While the ball keeps the investor \
             in the bank the gap stands still, so short histories flatten the fit.",
            slope.all, slope.last
        ),
    };
    study.slopes.iter().map(finding).collect()
}
