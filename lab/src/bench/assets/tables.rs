//! Tables of returns drawn at random, and the robust steps over them.

use ballast::control::assets::advising::floors;
use ballast::control::assets::{PortfolioStep, ReturnScenarios};
use ballast::control::problem::actions::ActionInterval;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::specification::UtilitySpecification;
use ballast::control::request::support::Support;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::transport::water_filling::{GroundMetric, inverse_volatility};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal, StudentT};

use super::{RATE, RISK_AVERSION, norm_name};

/// Purposes of the random streams.
const ORDINARY: &str = "ordinary tables";
const HOSTILE: &str = "hostile tables";
/// Most numbers of a hostile table.
const MOST_RETURNS: usize = 60_000;

/// Monthly returns of these mean and deviation, about those of stocks.
const MEAN: f64 = 0.006;
const DEVIATION: f64 = 0.04;

/// A robust step, and what it was drawn from.
pub struct RandomStep {
    pub step: PortfolioStep,
    pub assets: usize,
    pub dates: usize,
    /// The least sum of the shares.
    pub lowest: f64,
    /// The draws that make it special, in words.
    pub drawn: String,
}

/// Draws a number whose logarithm is uniform.
fn log_uniform(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.random::<f64>())
}

/// Draws normal log-returns of equal correlation between any two assets, date by date.
fn normal(random: &mut impl Rng, assets: usize, dates: usize, correlation: f64) -> Vec<Vec<f64>> {
    let mut draw = || -> f64 { StandardNormal.sample(random) };
    let mut row = || {
        let common = correlation.sqrt() * draw();
        (0..assets).map(|_| MEAN + DEVIATION * (common + (1.0 - correlation).sqrt() * draw())).collect()
    };
    (0..dates).map(|_| row()).collect()
}

/// Returns a radius of `scale` times the mean of the columns' deviations over the root of the number of dates, which is
/// about the radius that `bridge` has for one fund.
fn radius(rows: &[Vec<f64>], scale: f64) -> f64 {
    let (dates, assets) = (rows.len() as f64, rows.first().map_or(0, Vec::len));
    let deviation = |asset: usize| {
        let mean = rows.iter().map(|row| row[asset]).sum::<f64>() / dates;
        (rows.iter().map(|row| (row[asset] - mean).powi(2)).sum::<f64>() / dates).sqrt()
    };
    scale * (0..assets).map(deviation).sum::<f64>() / assets as f64 / dates.sqrt()
}

/// Returns the ground cost by its name on the wire: `sup`, or `scaled_one` with weights that are inverse volatilities.
fn ground(rows: &[Vec<f64>], sup: bool) -> GroundMetric {
    if sup { GroundMetric::Sup } else { GroundMetric::Weighted(inverse_volatility(rows)) }
}

fn whole_wealth() -> ActionInterval {
    ActionInterval { lowest: 0.0, highest: 1.0 }
}

/// Returns the step of an ordinary investor over a record and its radius, which is `scale` times that of [`radius`].
pub fn ordinary_step(rows: &[Vec<f64>], sup: bool, support: Support, scale: f64) -> (PortfolioStep, f64) {
    let radius = radius(rows, scale);
    let law = ReturnScenarios { returns: rows, radius, floors: floors(support, rows) };
    let utility = RelativeUtility::new(UtilitySpecification::relative(RISK_AVERSION), 1.0);
    (PortfolioStep::new(law, ground(rows, sup), utility, RATE, whole_wealth()), radius)
}

/// Draws table `number` of a size, one date longer than `dates`, with a correlation up to 0.9.
pub fn ordinary(number: usize, assets: usize, dates: usize) -> Vec<Vec<f64>> {
    let mut random = stream(1, ORDINARY, assets * 100_000 + dates, number);
    let correlation = 0.9 * random.random::<f64>();
    normal(&mut random, assets, dates + 1, correlation)
}

/// Draws step `number` from all that may be asked: sizes, tails, copies, near copies and constants among the columns,
/// ties, correlations, premiums, utilities, norms, radii, supports and bounds of the total.
pub fn hostile(number: usize) -> RandomStep {
    let random = &mut stream(1, HOSTILE, 0, number);
    let assets = (log_uniform(random, 1.0, 30.999)) as usize;
    let most = (MOST_RETURNS / assets).min(2000);
    let dates = (log_uniform(random, 2.0, most as f64 + 0.999)) as usize;
    let correlation = if random.random_bool(0.3) { 0.0 } else { 0.99 * random.random::<f64>() };
    let (rows, columns) = columns(random, assets, dates, correlation);
    let utility = match random.random_range(0..5) {
        0 => RelativeUtility::Log,
        1 | 2 => RelativeUtility::Exponential { k: log_uniform(random, 0.2, 200.0) },
        _ => RelativeUtility::Power { eta: 1.0 + log_uniform(random, 0.001, 99.0) },
    };
    let sup = random.random_bool(0.5);
    let scale = if random.random_bool(0.1) { 0.0 } else { log_uniform(random, 0.01, 10.0) };
    let support = match random.random_range(0..4) {
        0 => Support::None {},
        1 => Support::Between { min: -20.0, max: 20.0 },
        _ => Support::WorstSeen { factor: log_uniform(random, 1.0, 10.0) },
    };
    let total = match random.random_range(0..8) {
        0 => ActionInterval { lowest: 0.3, highest: 1.0 },
        1 => ActionInterval { lowest: 0.0, highest: random.random() },
        2 => ActionInterval { lowest: 1.0, highest: 1.0 },
        _ => whole_wealth(),
    };
    let law = ReturnScenarios { returns: &rows, radius: radius(&rows, scale), floors: floors(support, &rows) };
    let drawn = format!(
        "{utility:?}, {}, radius {scale:.3} units, correlation {correlation:.2}, {support:?}, total {} to {:.2}, columns {columns}",
        norm_name(sup),
        total.lowest,
        total.highest
    );
    RandomStep {
        step: PortfolioStep::new(law, ground(&rows, sup), utility, RATE, total),
        assets,
        dates,
        lowest: total.lowest,
        drawn,
    }
}

/// Draws the columns of a hostile table, and names their kinds by a letter each.
fn columns(random: &mut impl Rng, assets: usize, dates: usize, correlation: f64) -> (Vec<Vec<f64>>, String) {
    let common: Vec<f64> = (0..dates).map(|_| StandardNormal.sample(random)).collect();
    let scale = log_uniform(random, 0.001, 0.2);
    let (mut all, mut kinds): (Vec<Vec<f64>>, String) = (Vec::new(), String::new());
    for asset in 0..assets {
        let deviation = scale * log_uniform(random, 0.3, 3.0);
        let premium = random.random_range(-1.0..2.0) * if random.random_bool(0.8) { 0.15 } else { 1.0 };
        let kind = random.random_range(0..12);
        let mut noise = |tails: bool| -> f64 {
            if tails { StudentT::new(3.0).map_or(0.0, |law| law.sample(random)) } else { StandardNormal.sample(random) }
        };
        let mut joint = |tails: bool| -> Vec<f64> {
            common
                .iter()
                .map(|&common| correlation.sqrt() * common + (1.0 - correlation).sqrt() * noise(tails))
                .collect()
        };
        let standard: Vec<f64> = match kind {
            0 | 1 => joint(true),
            2 => joint(false).into_iter().map(|value| (0.8 * value).exp() - 1.4).collect(),
            3 => vec![0.0; dates],
            4 => joint(false).into_iter().map(|value| value.round()).collect(),
            _ => joint(false),
        };
        let column = match kind {
            5 if asset > 0 => all[asset - 1].clone(),
            6 if asset > 0 => {
                let error = log_uniform(random, 1e-9, 1e-3);
                all[0].iter().zip(&standard).map(|(value, draw)| value + error * deviation * draw).collect()
            }
            _ => standard.iter().map(|value| (RATE + deviation * (premium + value)).clamp(-5.0, 5.0)).collect(),
        };
        kinds.push(match kind {
            0 | 1 => 't',
            2 => 'l',
            3 => 'c',
            4 => 'r',
            5 if asset > 0 => '=',
            6 if asset > 0 => '~',
            _ => 'n',
        });
        all.push(column);
    }
    ((0..dates).map(|date| all.iter().map(|column| column[date]).collect()).collect(), kinds)
}
