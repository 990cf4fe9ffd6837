//! Time of the robust step on random tables of several sizes: normal months, correlations up to 0.9.

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use ballast::control::request::support::Support;

use super::super::summary::median;
use super::gap;
use super::tables::{ordinary, ordinary_step};

/// Assets and dates.
const SIZES: [(usize, usize); 7] = [(5, 240), (20, 120), (10, 500), (12, 1000), (30, 500), (30, 2000), (20, 8312)];
/// Radius in units of the deviation over the root of the dates: about that of the levels of caution, and the whole one.
const SCALES: [f64; 2] = [0.15, 1.0];

pub fn run(tables: usize) -> Result<(), Box<dyn Error>> {
    let [assets, dates, scale, cold, worst, warm] =
        ["assets", "dates", "radius", "median, ms", "worst (table)", "a date later"];
    println!("{assets:>8}{dates:>8}{scale:>8}{cold:>12}{worst:>15}{warm:>14}{:>18}", "widest gap, bp");
    for (assets, dates) in SIZES {
        for scale in SCALES {
            let (mut cold, mut warm, mut widest): (Vec<f64>, Vec<f64>, f64) = (Vec::new(), Vec::new(), 0.0);
            for number in 0..tables {
                let rows = ordinary(number, assets, dates);
                let (step, _) = ordinary_step(&rows[..dates], false, Support::default(), scale);
                let started = Instant::now();
                let found = black_box(step.solve(None));
                cold.push(1e3 * started.elapsed().as_secs_f64());
                let (later, _) = ordinary_step(&rows[1..], false, Support::default(), scale);
                let started = Instant::now();
                let next = black_box(later.solve(Some(&found)));
                warm.push(1e3 * started.elapsed().as_secs_f64());
                widest = [found, next].iter().map(gap).fold(widest, f64::max);
            }
            let (worst, table) =
                cold.iter().copied().zip(0..).fold((0.0, 0), |worst, found| if found > worst { found } else { worst });
            println!(
                "{assets:>8}{dates:>8}{scale:>8}{:>12.1}{:>15}{:>14.1}{widest:>18.4}",
                median(&cold),
                format!("{worst:.1} ({table})"),
                median(&warm)
            );
        }
    }
    Ok(())
}
