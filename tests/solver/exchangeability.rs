//! The bet against exchangeability: its p-values and its capital against their definitions, its false alarms against Ville's
//! bound, and how soon it tells a doubled volatility.

use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::exchangeability::{TestMartingale, p_value};
use rand::{Rng, RngExt};

fn normal(random: &mut impl Rng) -> f64 {
    let (radius, angle): (f64, f64) = (random.random_range(f64::MIN_POSITIVE..1.0), random.random_range(0.0..1.0));
    (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
}

/// By counting, with many ties.
#[test]
fn a_p_value_counts_what_lies_as_far_from_the_median() {
    let mut random = stream(1, "p values", 0, 0);
    for trial in 0..2000 {
        let size = random.random_range(1..12);
        let sample: Vec<f64> = (0..size).map(|_| f64::from(random.random_range(-3..4)) / 2.0).collect();
        let law = EmpiricalDistribution::new(&sample);
        let sorted = law.atoms();
        let median = 0.5 * (sorted[(size - 1) / 2] + sorted[size / 2]);
        for &value in &sample {
            let distance = |atom: &f64| (atom - median).abs();
            let further = sample.iter().filter(|atom| distance(atom) > distance(&value)).count();
            let as_far = sample.iter().filter(|atom| distance(atom) == distance(&value)).count();
            for tie in [0.25, 1.0] {
                let expected = (further as f64 + tie * as_far as f64) / size as f64;
                assert_eq!(p_value(&law, value, tie), expected, "trial {trial}: {value} of {sample:?}");
            }
        }
    }
}

/// Simpson's rule over e, with 20,000 cells.
#[test]
fn the_capital_is_the_integral_of_the_bets() {
    let mut random = stream(1, "capital", 0, 0);
    for bets in [0_usize, 1, 3, 40, 400] {
        for power in [0.3, 1.0, 4.0] {
            let values: Vec<f64> = (0..bets).map(|_| random.random_range(1e-9..1.0_f64).powf(power)).collect();
            let capital = values.iter().fold(TestMartingale::default(), |capital, &p| capital.after(p));
            let surprise: f64 = -values.iter().map(|p| p.ln()).sum::<f64>();
            let at = |e: f64| if bets == 0 { 0.0 } else { bets as f64 * e.ln() } + (1.0 - e) * surprise;
            let nodes: Vec<f64> = (0..=20_000).map(|k| at(f64::from(k) / 20_000.0)).collect();
            let largest = nodes.iter().copied().fold(f64::MIN, f64::max);
            let weight = |k: usize| if k == 0 || k == 20_000 { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
            let sum: f64 = nodes.iter().enumerate().map(|(k, log)| weight(k) * (log - largest).exp()).sum();
            let expected = (sum / 60_000.0).ln() + largest;
            // The rule's error for a peak some hundred cells wide.
            assert!((capital.log() - expected).abs() < 1e-8, "{bets} bets: {} for {expected}", capital.log());
            assert!(capital.log_highest() >= capital.log().max(0.0));
        }
    }
}

/// The largest log capital over `periods` returns after `known` others, and the period in which it first reached 100; each
/// return is drawn by `shape` from its period and a normal number.
fn bet(seed: u64, known: usize, periods: usize, shape: impl Fn(usize, f64) -> f64) -> (f64, Option<usize>) {
    let mut random = stream(seed, "sessions", 0, 0);
    let sample: Vec<f64> = (0..known).map(|_| shape(0, normal(&mut random))).collect();
    let (mut law, mut capital, mut alarm) = (EmpiricalDistribution::new(&sample), TestMartingale::default(), None);
    for period in 1..=periods {
        let value = shape(period, normal(&mut random));
        law.push(value);
        capital = capital.after(p_value(&law, value, 1.0 - random.random::<f64>()));
        if capital.log() >= 100.0_f64.ln() {
            alarm.get_or_insert(period);
        }
    }
    (capital.log_highest(), alarm)
}

/// Ville: at most 1 % of the sessions whose returns stay as they are ever see 100. 2,000 sessions of 240 periods, with heavy
/// tails and with ties: at a true chance of 1 %, more than 34 of 2,000 have a chance of one in a thousand.
#[test]
fn where_nothing_changes_hardly_any_session_is_alarmed() {
    type Shape = fn(f64) -> f64;
    let shapes: [Shape; 3] = [|z| z, |z| z.powi(3), f64::round];
    for (name, shape) in ["normal", "heavy tails", "ties"].into_iter().zip(shapes) {
        let is_alarmed = |seed: &u64| bet(*seed, 60, 240, |_, z| shape(z)).0 >= 100.0_f64.ln();
        let alarmed = (0..2000).filter(is_alarmed).count();
        println!("{name}: {alarmed} of 2000 alarmed");
        assert!(alarmed <= 34, "{name}: {alarmed} of 2000");
    }
}

/// Returns whose mean falls from the first reported on: the share of 400 sessions that are alarmed within 240 periods. A fall by two
/// deviations is seen by most, one by a deviation by few where the record is short, and a premium that goes by none.
#[test]
fn a_lower_mean_is_seen_only_if_it_is_lower_by_far() {
    for known in [36, 60, 120, 240] {
        let share = |fall: f64| {
            let lower = |period: usize, z: f64| if period > 0 { z - fall } else { z };
            (0..400).filter(|&seed| bet(seed, known, 240, lower).1.is_some()).count() as f64 / 4.0
        };
        let [premium, half, one, two] = [0.125, 0.5, 1.0, 2.0].map(share);
        println!("{known} returns known, mean lower by an eighth, a half, one and two: {premium} {half} {one} {two} %");
        assert!(premium < 2.5 && half < 12.0 && two > 50.0, "{known}: {premium} {half} {one} {two}");
        assert!(known > 60 || one < 25.0, "{known}: {one}");
    }
}

/// Returns that are wider from the 25th on: how many of 400 sessions tell it within 240 periods, and after how many. Twice as
/// wide ones are told by nearly all, in the median within 40 periods.
#[test]
fn a_larger_volatility_is_told() {
    for known in [60, 120, 240] {
        for factor in [1.5, 2.0, 3.0] {
            let wider = |period: usize, z: f64| if period > 24 { factor * z } else { z };
            let mut delays: Vec<usize> =
                (0..400).filter_map(|seed| bet(seed, known, 240, wider).1?.checked_sub(24)).collect();
            delays.sort_unstable();
            let quantile = |share: usize| delays.get(delays.len() * share / 100).copied().unwrap_or_default();
            let [median, late] = [50, 90].map(quantile);
            println!(
                "{known} returns known, {factor} times as wide: {} of 400 detect it, median {median}, 90 % by {late}",
                delays.len()
            );
            assert!(factor != 2.0 || (delays.len() >= 380 && median <= 40), "{delays:?}");
        }
    }
}

/// The US market: a session opened each January from 1947 on with the 240 months before as its record, and followed to the end
/// of 2018. Those alarmed are alarmed in the great falls after the war, and in no other year.
#[test]
fn the_alarms_of_the_us_market() {
    let rows: Vec<(&str, f64)> = include_str!("../../data/us_market_monthly.csv")
        .lines()
        .skip(1)
        .filter_map(|line| line.split_once(','))
        .map(|(month, rest)| (month, rest.split(',').next().unwrap().parse::<f64>().unwrap().ln_1p()))
        .collect();
    let first = rows.iter().position(|(month, _)| *month == "1947-01").unwrap();
    let (mut alarms, mut sessions) = (Vec::new(), 0);
    for start in (first..rows.len() - 12).step_by(12) {
        let record: Vec<f64> = rows[start - 240..start].iter().map(|row| row.1).collect();
        let (mut law, mut capital) = (EmpiricalDistribution::new(&record), TestMartingale::default());
        let mut random = stream(1, "market", start, 0);
        sessions += 1;
        for &(month, log_return) in &rows[start..] {
            law.push(log_return);
            capital = capital.after(p_value(&law, log_return, 1.0 - random.random::<f64>()));
            if capital.log() >= 100.0_f64.ln() {
                alarms.push((rows[start].0, month));
                break;
            }
        }
    }
    let falls = ["1970", "1974", "1975", "2002", "2009"];
    assert!(alarms.iter().all(|(_, month)| falls.iter().any(|year| month.starts_with(year))), "{alarms:?}");
    assert!(alarms.len() >= 8, "{alarms:?}");
    println!("{} of {sessions} sessions alarmed, by start and month: {alarms:?}", alarms.len());
}
