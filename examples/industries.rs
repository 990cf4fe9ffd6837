//! Does robustness pay among several assets? Twelve US industries and bills, 1969 to 2016.
//!
//!     cargo run --release --example industries [COST]
//!
//! Every month a strategy chooses shares of wealth in twelve industries, the rest in bills, from the returns of the last 10 years,
//! of the last 20, or of all months since 1949, and they are held for a month. `COST` is lost of all that is traded (0.002 is 0.2 %);
//! no strategy knows of it. *Robust* is the one-step problem of `POST /advise` under power utility with risk aversion 3, its radius
//! that of all funds at once at alpha = 0.1, times a scale; the radius is measured once a year. *Static* solves once a year, *plug-in*
//! has the radius 0. *Minimum variance* and *inverse volatility* are fully in the industries. What a year that starts with 100 is
//! worth for certain is that of power utility over the 48 years; intervals of 90 % resample blocks of three years, the same for all.

use std::collections::BTreeMap;
use std::error::Error;

use ballast::control::assets::{AssetsLaw, AssetsSolution, AssetsStep};
use ballast::control::evaluation::account::{Account, Annual, yearly_certainty_equivalent};
use ballast::control::problem::actions::ActionInterval;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::specification::UtilitySpecification;
use ballast::numerics::block_bootstrap::circular_blocks;
use ballast::numerics::fund_bridges::FundBridges;
use ballast::numerics::levelling::{Ground, inverse_volatility};
use ballast::numerics::streams::stream;
use ballast::numerics::summary::quantile;
use rayon::prelude::*;

const FILE: &str = "data/us_industries_monthly.csv";
const MONTHS: usize = 12;
/// Twenty years: all strategies live through the months after them.
const FIRST: usize = 240;
const WINDOWS: [(usize, &str); 3] = [(120, "10 years"), (240, "20 years"), (usize::MAX, "all")];
const ALPHA: f64 = 0.1;
const PATHS: usize = 500;
const UTILITY: UtilitySpecification = UtilitySpecification::Power { risk_aversion: 3.0 };
const WEALTH: f64 = 100.0;
const RESAMPLES: usize = 2000;
const YEARS_OF_A_BLOCK: usize = 3;

/// Months of log-returns, and what bills paid.
struct Record {
    rows: Vec<Vec<f64>>,
    bills: Vec<f64>,
}

#[derive(Clone, Copy)]
enum Rule {
    Robust { sup: bool, scale: f64, is_static: bool },
    MinimumVariance,
    InverseVolatility,
    Equal { share: f64 },
}

/// A strategy, and how many of the last months it knows.
struct Strategy {
    name: String,
    rule: Rule,
    window: usize,
}

/// What became of a strategy.
struct Books {
    /// Its allocations are those in all industries together.
    account: Account,
    /// Shares of wealth, month by month.
    held: Vec<Vec<f64>>,
}

impl Record {
    /// The returns before `month` that a strategy of this window knows.
    fn known(&self, month: usize, window: usize) -> &[Vec<f64>] {
        &self.rows[month.saturating_sub(window)..month]
    }

    /// The radius of all funds at once at the start of every year.
    fn radii(&self, window: usize) -> Vec<f64> {
        let years: Vec<usize> = (FIRST..self.rows.len()).step_by(MONTHS).collect();
        years.into_par_iter().map(|month| joint_radius(self.known(month, window))).collect()
    }
}

fn read() -> Result<Record, Box<dyn Error>> {
    let (mut rows, mut bills) = (Vec::new(), Vec::new());
    for record in csv::Reader::from_path(FILE)?.records() {
        let mut numbers = record?.iter().skip(1).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        bills.extend(numbers.pop());
        rows.push(numbers.into_iter().map(f64::ln_1p).collect());
    }
    Ok(Record { rows, bills })
}

/// Shares that sum to 1, none below 0, of least variance: weight moves from the dearest asset held to the cheapest, as far as
/// the variance falls, until no move gains.
fn minimum_variance(rows: &[Vec<f64>]) -> Vec<f64> {
    let (count, width) = (rows.len() as f64, rows[0].len());
    let mean = |asset: usize| rows.iter().map(|row| row[asset]).sum::<f64>() / count;
    let means: Vec<f64> = (0..width).map(mean).collect();
    let covariance =
        |i: usize, j: usize| rows.iter().map(|row| (row[i] - means[i]) * (row[j] - means[j])).sum::<f64>() / count;
    let matrix: Vec<Vec<f64>> = (0..width).map(|i| (0..width).map(|j| covariance(i, j)).collect()).collect();
    let mut shares = vec![1.0 / width as f64; width];
    loop {
        let slopes: Vec<f64> =
            matrix.iter().map(|row| row.iter().zip(&shares).map(|(c, share)| c * share).sum()).collect();
        let by_slope = |a: &usize, b: &usize| slopes[*a].total_cmp(&slopes[*b]);
        let (Some(to), Some(from)) =
            ((0..width).min_by(by_slope), (0..width).filter(|asset| shares[*asset] > 0.0).max_by(by_slope))
        else {
            return shares;
        };
        let gain = slopes[from] - slopes[to];
        if gain < 1e-12 {
            return shares;
        }
        let curvature = matrix[from][from] + matrix[to][to] - 2.0 * matrix[from][to];
        let moved = (gain / curvature).min(shares[from]);
        shares[from] -= moved;
        shares[to] += moved;
    }
}

/// The radius of all funds at once.
fn joint_radius(rows: &[Vec<f64>]) -> f64 {
    let bridges = FundBridges::simulate(rows, PATHS, 1);
    let own = bridges.quantile(&inverse_volatility(rows), ALPHA).value;
    bridges.joint_factor(ALPHA).value * own / (rows.len() as f64).sqrt()
}

/// Shares that are the same in every industry.
fn equal(width: usize, share: f64) -> Vec<f64> {
    vec![share / width as f64; width]
}

/// The shares of wealth of every month from [`FIRST`] on; `radii` are those of the years.
fn decide(record: &Record, strategy: &Strategy, radii: &[f64]) -> Vec<Vec<f64>> {
    let mut last: Option<AssetsSolution> = None;
    let decide = |month: usize| {
        let rows = record.known(month, strategy.window);
        match strategy.rule {
            Rule::MinimumVariance => minimum_variance(rows),
            Rule::InverseVolatility => inverse_volatility(rows),
            Rule::Equal { share } => equal(rows[0].len(), share),
            Rule::Robust { sup, scale, is_static } => {
                let months = month - FIRST;
                if let Some(last) = last.as_ref().filter(|_| is_static && !months.is_multiple_of(MONTHS)) {
                    return last.allocation.clone();
                }
                let ground = if sup { Ground::Sup } else { Ground::Weighted(inverse_volatility(rows)) };
                let rate = record.bills[month - 1];
                let utility = RelativeUtility::new(UTILITY, WEALTH * (1.0 + rate));
                let radius = scale * radii[months / MONTHS];
                let law = AssetsLaw { returns: rows, radius, floor: f64::NEG_INFINITY };
                let whole = ActionInterval { lowest: 0.0, highest: 1.0 };
                let solution = AssetsStep::new(law, ground, utility, rate, whole).solve(last.as_ref());
                let allocation = solution.allocation.clone();
                last = Some(solution);
                allocation
            }
        }
    };
    (FIRST..record.rows.len()).map(decide).collect()
}

/// Brings holdings to what was decided, month by month; `cost` is lost of what is traded.
fn keep(record: &Record, held: Vec<Vec<f64>>, cost: f64) -> Books {
    let (mut wealth, mut traded) = (vec![WEALTH], Vec::new());
    let mut drifted = vec![0.0; held[0].len()];
    for (month, shares) in (FIRST..).zip(&held) {
        let moved: f64 = shares.iter().zip(&drifted).map(|(share, had)| (share - had).abs()).sum();
        let grown: Vec<f64> = shares.iter().zip(&record.rows[month]).map(|(share, z)| share * z.exp()).collect();
        let bank = (1.0 - total(shares)) * (1.0 + record.bills[month]);
        let growth = bank + grown.iter().sum::<f64>();
        traded.push(moved);
        wealth.push(wealth[wealth.len() - 1] * (1.0 - cost * moved) * growth);
        drifted = grown.into_iter().map(|position| position / growth).collect();
    }
    let allocations = held.iter().map(|shares| total(shares)).collect();
    Books { account: Account { wealth, allocations, traded }, held }
}

fn total(shares: &[f64]) -> f64 {
    shares.iter().sum()
}

fn mean(values: &[f64]) -> f64 {
    total(values) / values.len() as f64
}

impl Books {
    /// `(sum a)^2 / sum a^2`, the mean over the months in which anything is held.
    fn effective_assets(&self) -> f64 {
        let of = |shares: &Vec<f64>| {
            let squares = shares.iter().map(|share| share * share).sum::<f64>();
            (squares > 0.0).then(|| total(shares).powi(2) / squares)
        };
        mean(&self.held.iter().filter_map(of).collect::<Vec<f64>>())
    }
}

/// `value [low, high]` of a figure of the years, over the same resamples for all.
fn estimate(years: usize, of: impl Fn(&[usize]) -> f64) -> String {
    let whole: Vec<usize> = (0..years).collect();
    let draw = |index| of(&circular_blocks(years, YEARS_OF_A_BLOCK, &mut stream(1, "industry years", 0, index)));
    let drawn: Vec<f64> = (0..RESAMPLES).map(draw).collect();
    format!("{:.2} [{:.2}, {:.2}]", of(&whole), quantile(&drawn, 0.05), quantile(&drawn, 0.95))
}

fn strategies() -> Vec<Strategy> {
    let mut all = Vec::new();
    for (window, words) in WINDOWS {
        let mut add = |name: String, rule| all.push(Strategy { name: format!("{name}, {words}"), rule, window });
        for (sup, norm) in [(false, "scaled_one"), (true, "sup")] {
            for scale in [0.5, 1.0] {
                add(format!("robust {norm}, scale {scale}"), Rule::Robust { sup, scale, is_static: false });
            }
        }
        add("static scaled_one, scale 0.5".into(), Rule::Robust { sup: false, scale: 0.5, is_static: true });
        add("plug-in".into(), Rule::Robust { sup: true, scale: 0.0, is_static: false });
        add("minimum variance".into(), Rule::MinimumVariance);
        add("inverse volatility".into(), Rule::InverseVolatility);
    }
    for (name, share) in [("1/N", 1.0), ("60 % 1/N", 0.6)] {
        all.push(Strategy { name: name.into(), rule: Rule::Equal { share }, window: MONTHS });
    }
    all
}

fn main() -> Result<(), Box<dyn Error>> {
    let cost: f64 = std::env::args().nth(1).map_or(Ok(0.0), |text| text.parse())?;
    let record = read()?;
    let strategies = strategies();
    let radii = BTreeMap::from(WINDOWS.map(|(window, _)| (window, record.radii(window))));
    let live = |strategy: &Strategy| {
        let radii = radii.get(&strategy.window).map_or(&[][..], Vec::as_slice);
        keep(&record, decide(&record, strategy, radii), cost)
    };
    let books: Vec<Books> = strategies.par_iter().map(live).collect();
    let months = record.rows.len() - FIRST;
    let of_equal = |share: f64| {
        keep(&record, vec![equal(record.rows[0].len(), share); months], cost).account.yearly_growth(MONTHS)
    };
    let all_equal = of_equal(1.0);
    let years = all_equal.len();
    println!(
        "| strategy | certainty equivalent of a year from 100 | less 1/N | less 1/N at its own mean share | volatility | largest fall | in industries | effective number | traded a year |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (strategy, books) in strategies.iter().zip(&books) {
        let account = &books.account;
        let share = mean(&account.allocations);
        let (own, alike) = (account.yearly_growth(MONTHS), of_equal(share));
        let annual = Annual::of(&account.returns(), &record.bills[FIRST..], MONTHS as f64);
        let worth = |growth: &[f64], years: &[usize]| {
            let picked: Vec<f64> = years.iter().map(|&year| growth[year]).collect();
            yearly_certainty_equivalent(UTILITY, &picked, WEALTH)
        };
        println!(
            "| {} | {} | {} | {} | {:.1} % | {:.0} % | {:.0} % | {:.1} | {:.2} |",
            strategy.name,
            estimate(years, |picked| worth(&own, picked)),
            estimate(years, |picked| worth(&own, picked) - worth(&all_equal, picked)),
            estimate(years, |picked| worth(&own, picked) - worth(&alike, picked)),
            100.0 * annual.volatility,
            100.0 * account.drawdowns().into_iter().fold(0.0, f64::max),
            100.0 * share,
            books.effective_assets(),
            MONTHS as f64 * mean(&account.traded),
        );
    }
    Ok(())
}
