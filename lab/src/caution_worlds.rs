//! `ballast-lab caution-worlds`: measures what each level of caution costs when the true law is known.
//!
//! There are three worlds. The true law of each is that of the bundled months of the US market, shifted so that the premium over
//! the bank is zero, half or all of the observed one. Records of 60 to 480 months are drawn from each world in circular blocks of
//! a year. On each record every rule says what to hold for a month, and the true law scores it. The table shows the certainty
//! equivalent lost against the best allocation under that law, with its standard error over the records, in basis points a year.
//! *Worst regret* is the largest excess loss over the three worlds, compared with the share of the radius that loses least in each.
//! *Shrunk* treats the record as the true law, with half of its premium.

use std::error::Error;

use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::annualised::premium;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification};
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::block_bootstrap::circular_blocks;
use ballast::service::advice::advise::Advise;
use clap::Args;

use super::market::Market;

const MONTHS: [usize; 4] = [60, 120, 240, 480];
const PARTS: [f64; 3] = [0.0, 0.5, 1.0];
const BLOCK: usize = 12;
const SHARES: [f64; 7] = [0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0];
const LEVELS: [CautionLevel; 3] = CautionLevel::FOUND;
const RULES: usize = SHARES.len() + LEVELS.len() + 1;
/// Basis points of log certainty equivalent a month, in a year.
const YEARLY: f64 = 12e4;
/// Number of steps in the grid of allocations.
const GRID: usize = 1000;

#[derive(Debug, Args)]
pub struct CautionWorlds {
    /// Records drawn from each world at each length
    #[arg(default_value_t = 200)]
    records: usize,
}

/// The true law of a world.
struct Truth {
    growths: Vec<f64>,
    utility: RelativeUtility,
    best: f64,
}

impl Truth {
    fn of(log_returns: &[f64], bank: f64) -> Self {
        let growths = log_returns.iter().map(|z| z.exp() / (1.0 + bank)).collect();
        let utility = RelativeUtility::new(UtilitySpecification::default(), 1.0 + bank);
        let truth = Truth { growths, utility, best: 0.0 };
        let best = (0..=GRID).map(|part| truth.worth(part as f64 / GRID as f64)).fold(f64::NEG_INFINITY, f64::max);
        Truth { best, ..truth }
    }

    fn worth(&self, allocation: f64) -> f64 {
        let total: f64 = self.growths.iter().map(|growth| self.utility.at(1.0 + allocation * (growth - 1.0)).0).sum();
        self.utility.inverse(total / self.growths.len() as f64)
    }

    /// Returns the loss of an allocation in basis points a year.
    fn lost(&self, allocation: f64) -> f64 {
        YEARLY * (self.best - self.worth(allocation))
    }
}

/// Shifts log-returns so that their premium over the bank is `mean_beyond`.
fn shifted(log_returns: &[f64], bank: f64, mean_beyond: f64) -> Vec<f64> {
    let (seen, _) = premium(log_returns, bank);
    let shift = ((1.0 + bank + mean_beyond) / (1.0 + bank + seen)).ln();
    log_returns.iter().map(|z| z + shift).collect()
}

/// Returns what each rule holds: the shares of the radius, the levels, and the record with half of its premium.
fn held(record: Vec<f64>, bank: f64) -> Result<[f64; RULES], Box<dyn Error>> {
    let advise = |record: Vec<f64>, caution: CautionLevel| {
        let problem =
            ProblemSpecification { horizon: 1, caution: Some(caution), ..ProblemSpecification::of(record, bank) };
        Advise { problem, wealth: None, holding: None, seed: 1, sensitivity: false }.answer()
    };
    let (seen, _) = premium(&record, bank);
    let mut held = [0.0; RULES];
    for (held, share) in held.iter_mut().zip(SHARES) {
        *held = advise(record.clone(), CautionLevel::Scale(share))?.advice.allocation;
    }
    held[RULES - 1] = advise(shifted(&record, bank, 0.5 * seen), CautionLevel::Scale(0.0))?.advice.allocation;
    let levels = advise(record, CautionLevel::Balanced)?.levels.ok_or("a level is followed")?.levels;
    for (held, level) in held[SHARES.len()..].iter_mut().zip(LEVELS) {
        let found = levels.iter().find(|found| found.level == level);
        *held = found.and_then(|found| found.allocation).ok_or("a short record is solved")?;
    }
    Ok(held)
}

fn mean_and_error(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    [mean, (square / count).sqrt()]
}

pub fn run(arguments: &CautionWorlds) -> Result<(), Box<dyn Error>> {
    let records = arguments.records;
    let Market { log_returns: market, bank } = Market::bundled()?;
    let (whole, _) = premium(&market, bank);
    let names: Vec<String> = SHARES
        .iter()
        .map(|share| format!("share {share}"))
        .chain(LEVELS.iter().map(|level| level.name().to_owned()))
        .chain(["shrunk".to_owned()])
        .collect();
    println!("| months | rule | no premium | half | whole | worst regret |");
    println!("|---|---|---|---|---|---|");
    for count in MONTHS {
        // Mean loss and standard error by rule and world.
        let mut lost: Vec<[[f64; 2]; 3]> = vec![[[0.0; 2]; 3]; RULES];
        for (world, part) in PARTS.iter().enumerate() {
            let law = shifted(&market, bank, part * whole);
            let truth = Truth::of(&law, bank);
            let mut losses: Vec<Vec<f64>> = vec![Vec::new(); RULES];
            for index in 0..records {
                let places = circular_blocks(law.len(), BLOCK, &mut stream(1, "caution worlds", count, index));
                let record = places.into_iter().take(count).map(|place| law[place]).collect();
                let held = held(record, bank)?;
                losses.iter_mut().zip(held).for_each(|(losses, share)| losses.push(truth.lost(share)));
            }
            lost.iter_mut().zip(&losses).for_each(|(lost, losses)| lost[world] = mean_and_error(losses));
        }
        let least: Vec<f64> = (0..PARTS.len())
            .map(|world| lost[..SHARES.len()].iter().map(|lost| lost[world][0]).fold(f64::INFINITY, f64::min))
            .collect();
        for (name, lost) in names.iter().zip(&lost) {
            let cells: Vec<String> = lost.iter().map(|[mean, error]| format!("{mean:.0} ± {error:.0}")).collect();
            let regret = |(lost, least): (&[f64; 2], &f64)| lost[0] - least;
            let worst = lost.iter().zip(&least).map(regret).fold(f64::NEG_INFINITY, f64::max);
            println!("| {count} | {name} | {} | {worst:.0} |", cells.join(" | "));
        }
    }
    Ok(())
}
