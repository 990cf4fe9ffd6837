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

use std::error::Error;

use ballast::control::assets::{AssetsLaw, AssetsSolution, AssetsStep};
use ballast::control::evaluation::account::yearly_certainty_equivalent;
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
const ALPHA: f64 = 0.1;
const PATHS: usize = 500;
const RISK_AVERSION: f64 = 3.0;
const UTILITY: UtilitySpecification = UtilitySpecification::Power { risk_aversion: RISK_AVERSION };
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
    /// At the start, and after each month.
    wealth: Vec<f64>,
    /// Shares of wealth, month by month.
    held: Vec<Vec<f64>>,
    traded: f64,
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

/// The shares of wealth of every month from [`FIRST`] on.
fn decide(record: &Record, strategy: &Strategy) -> Vec<Vec<f64>> {
    let (mut radius, mut last): (f64, Option<AssetsSolution>) = (0.0, None);
    let decide = |month: usize| {
        let rows = &record.rows[month.saturating_sub(strategy.window)..month];
        match strategy.rule {
            Rule::MinimumVariance => minimum_variance(rows),
            Rule::InverseVolatility => inverse_volatility(rows),
            Rule::Equal { share } => vec![share / rows[0].len() as f64; rows[0].len()],
            Rule::Robust { sup, scale, is_static } => {
                let is_new_year = (month - FIRST).is_multiple_of(MONTHS);
                if is_new_year && scale > 0.0 {
                    radius = scale * joint_radius(rows);
                }
                if let Some(last) = last.as_ref().filter(|_| is_static && !is_new_year) {
                    return last.allocation.clone();
                }
                let ground = if sup { Ground::Sup } else { Ground::Weighted(inverse_volatility(rows)) };
                let rate = record.bills[month - 1];
                let utility = RelativeUtility::new(UTILITY, WEALTH * (1.0 + rate));
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
    let (mut wealth, mut traded) = (vec![WEALTH], 0.0);
    let mut drifted = vec![0.0; held[0].len()];
    for (month, shares) in (FIRST..).zip(&held) {
        let moved: f64 = shares.iter().zip(&drifted).map(|(share, had)| (share - had).abs()).sum();
        let grown: Vec<f64> = shares.iter().zip(&record.rows[month]).map(|(share, z)| share * z.exp()).collect();
        let bank = (1.0 - shares.iter().sum::<f64>()) * (1.0 + record.bills[month]);
        let growth = bank + grown.iter().sum::<f64>();
        traded += moved;
        wealth.push(wealth[wealth.len() - 1] * (1.0 - cost * moved) * growth);
        drifted = grown.into_iter().map(|position| position / growth).collect();
    }
    Books { wealth, held, traded }
}

impl Books {
    fn yearly_growth(&self) -> Vec<f64> {
        self.wealth.windows(MONTHS + 1).step_by(MONTHS).map(|year| year[MONTHS] / year[0]).collect()
    }

    fn mean_share(&self) -> f64 {
        self.held.iter().map(|shares| shares.iter().sum::<f64>()).sum::<f64>() / self.held.len() as f64
    }

    /// `(sum a)^2 / sum a^2`, the mean over the months in which anything is held.
    fn effective_assets(&self) -> f64 {
        let of = |shares: &Vec<f64>| {
            let (sum, squares) = (shares.iter().sum::<f64>(), shares.iter().map(|share| share * share).sum::<f64>());
            (squares > 0.0).then(|| sum * sum / squares)
        };
        let all: Vec<f64> = self.held.iter().filter_map(of).collect();
        all.iter().sum::<f64>() / all.len() as f64
    }

    fn volatility(&self) -> f64 {
        let returns: Vec<f64> = self.wealth.windows(2).map(|pair| pair[1] / pair[0] - 1.0).collect();
        let mean = returns.iter().sum::<f64>() / returns.len() as f64;
        let variance = returns.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / returns.len() as f64;
        (MONTHS as f64 * variance).sqrt()
    }

    fn largest_fall(&self) -> f64 {
        let mut highest = 0.0_f64;
        let below = |&wealth: &f64| {
            highest = highest.max(wealth);
            1.0 - wealth / highest
        };
        self.wealth.iter().map(below).fold(0.0, f64::max)
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
    for (window, words) in [(120, "10 years"), (240, "20 years"), (usize::MAX, "all")] {
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
    let width = record.rows[0].len();
    let strategies = strategies();
    let books: Vec<Books> =
        strategies.par_iter().map(|strategy| keep(&record, decide(&record, strategy), cost)).collect();
    let equal = |share: f64| keep(&record, vec![vec![share / width as f64; width]; record.rows.len() - FIRST], cost);
    let all_equal = equal(1.0).yearly_growth();
    let years = all_equal.len();
    println!(
        "| strategy | certainty equivalent of a year from 100 | less 1/N | less 1/N at its own mean share | volatility | largest fall | in industries | effective number | traded a year |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (strategy, books) in strategies.iter().zip(&books) {
        let (own, alike) = (books.yearly_growth(), equal(books.mean_share()).yearly_growth());
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
            100.0 * books.volatility(),
            100.0 * books.largest_fall(),
            100.0 * books.mean_share(),
            books.effective_assets(),
            books.traded * MONTHS as f64 / books.held.len() as f64,
        );
    }
    Ok(())
}
