//! `ballast-lab fund-coverage`: counts how often the balls of all funds of several assets contain the true laws of the
//! funds at once.
//!
//! The assets have normal log-returns with deviations of 4 to 7 % a period and pairwise correlations of 0 or 0.6. For each sample of n
//! dates every fund gets the ball of radius `rho Q / sqrt n` at alpha = 0.1, where Q is its own bridge quantile and rho the joint
//! factor. The table shows the share of samples in which the balls of all tested funds contain their laws. The tested funds are
//! the single assets, equal shares, and random funds, which differ from those that rho was computed from. The true laws are
//! those of 20,000 other dates.

use ballast::numerics::bridge::funds::{FundBridges, fund_returns};
use ballast::numerics::machine::streams::stream;
use clap::Args;
use rand::RngExt;
use rand_distr::StandardNormal;

const ALPHA: f64 = 0.1;
const CORRELATIONS: [f64; 2] = [0.0, 0.6];
const PATHS: usize = 500;
const TRUE_DATES: usize = 20_000;
const DRAWN: usize = 40;

#[derive(Debug, Args)]
pub struct FundCoverage {
    /// Samples of dates drawn for each number of assets and of dates
    #[arg(default_value_t = 400)]
    samples: usize,
}

fn sample(assets: usize, correlation: f64, dates: usize, purpose: &str, index: usize) -> Vec<Vec<f64>> {
    let mut generator = stream(1, purpose, dates, index);
    let mut normal = || generator.sample::<f64, _>(StandardNormal);
    let row = |_| {
        let common = normal();
        let deviation = |asset: usize| 0.04 + 0.03 * asset as f64 / (assets - 1) as f64;
        let own =
            |asset| 0.01 + deviation(asset) * (correlation.sqrt() * common + (1.0 - correlation).sqrt() * normal());
        (0..assets).map(own).collect()
    };
    (0..dates).map(row).collect()
}

/// Returns the single assets, equal shares, and random funds, of which every other one is concentrated in few assets.
fn looked_at(assets: usize) -> Vec<Vec<f64>> {
    let mut funds: Vec<Vec<f64>> =
        (0..assets).map(|asset| (0..assets).map(|index| f64::from(u8::from(index == asset))).collect()).collect();
    funds.push(vec![1.0 / assets as f64; assets]);
    for index in 0..DRAWN {
        let mut generator = stream(2, "coverage funds", assets, index);
        let power = if index % 2 == 0 { 1 } else { 4 };
        let draws: Vec<f64> = (0..assets).map(|_| (-(1.0 - generator.random::<f64>()).ln()).powi(power)).collect();
        let whole: f64 = draws.iter().sum();
        funds.push(draws.iter().map(|draw| draw / whole).collect());
    }
    funds
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// Returns the distance W1 between the laws of two ascending samples, if the size of the first divides that of the second.
fn distance(few: &[f64], many: &[f64]) -> f64 {
    let each = many.len() / few.len();
    let apart = |(value, others): (&f64, &[f64])| others.iter().map(|other| (value - other).abs()).sum::<f64>();
    few.iter().zip(many.chunks_exact(each)).map(apart).sum::<f64>() / (each * few.len()) as f64
}

pub fn run(arguments: &FundCoverage) {
    let samples = arguments.samples;
    println!("| assets | correlation | dates | joint factor, mean | all balls hold | without the factor |");
    println!("|---|---|---|---|---|---|");
    for (assets, correlation) in [2, 5, 10].into_iter().flat_map(|assets| CORRELATIONS.map(|each| (assets, each))) {
        let funds = looked_at(assets);
        for dates in [60, 240] {
            // A multiple of the dates, so that the two samples can be matched rank by rank.
            let truth = sample(assets, correlation, TRUE_DATES / dates * dates, "coverage truth", 0);
            let laws: Vec<Vec<f64>> = funds.iter().map(|fund| sorted(fund_returns(&truth, fund))).collect();
            let (mut factors, mut held, mut held_alone) = (0.0, 0, 0);
            for index in 0..samples {
                let rows = sample(assets, correlation, dates, "coverage", index);
                let bridges = FundBridges::simulate(&rows, PATHS, index as u64);
                let factor = bridges.joint_factor(ALPHA).value;
                let ratio = |(fund, law): (&Vec<f64>, &Vec<f64>)| {
                    let radius = bridges.quantile(fund, ALPHA).value / (dates as f64).sqrt();
                    distance(&sorted(fund_returns(&rows, fund)), law) / radius
                };
                let largest = funds.iter().zip(&laws).map(ratio).fold(0.0, f64::max);
                factors += factor / samples as f64;
                held += usize::from(largest <= factor);
                held_alone += usize::from(largest <= 1.0);
            }
            let percent = |count: usize| 100.0 * count as f64 / samples as f64;
            let [held, alone] = [held, held_alone].map(percent);
            println!("| {assets} | {correlation} | {dates} | {factors:.3} | {held:.1} % | {alone:.1} % |");
        }
    }
}
