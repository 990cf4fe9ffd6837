//! The share of the capital that a record supports: the Kelly share in closed form, and the robust share beside the advice of
//! the same record.

use ballast::control::sleeve::kelly;
use ballast::control::sleeve::report::SleeveReport;
use ballast::service::advice::advise::{Advise, Advised};
use ballast::service::advice::advise_assets::{AdviseAssets, AssetsAdvised};
use ballast::service::advice::sleeve::SleeveRequest;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

fn sleeve(problem: &Value) -> SleeveReport {
    let question = json!({ "problem": problem });
    match problem.get("assets") {
        None => SleeveRequest::Strategy(serde_json::from_value(question).unwrap()),
        Some(_) => SleeveRequest::Strategies(serde_json::from_value(question).unwrap()),
    }
    .answer()
    .unwrap()
}

fn with(problem: &Value, field: &str, value: Value) -> Value {
    let mut problem = problem.clone();
    problem[field] = value;
    problem
}

fn advised(problem: &Value) -> Advised {
    let problem = with(&with(problem, "utility", json!({ "kind": "log" })), "caution", json!("paper"));
    serde_json::from_value::<Advise>(json!({ "problem": problem })).unwrap().answer().unwrap()
}

fn problem(history: &[f64], rate: f64) -> Value {
    json!({ "horizon": 1, "history": history, "rate_per_step": rate })
}

/// Log-returns with this mean and spread.
fn drawn(random: &mut ChaCha8Rng, count: usize, mean: f64, spread: f64) -> Vec<f64> {
    (0..count).map(|_| mean + spread * (random.random::<f64>() + random.random::<f64>() - 1.0)).collect()
}

/// A bet that pays b times the stake with probability p and loses the share l of it otherwise is worth staking p / l - q / b.
#[test]
fn the_kelly_share_of_a_bet_has_its_closed_form() {
    for (wins, losses, b, l) in
        [(12, 8, 1.0, 0.9), (11, 9, 0.5, 0.5), (3, 17, 8.0, 0.99), (14, 6, 0.2, 0.25), (6, 14, 1.0, 0.6)]
    {
        let (p, q) = (f64::from(wins) / f64::from(wins + losses), f64::from(losses) / f64::from(wins + losses));
        let outcomes: Vec<f64> = (0..wins).map(|_| f64::ln_1p(b)).chain((0..losses).map(|_| f64::ln_1p(-l))).collect();
        let exact = (p / l - q / b).max(0.0);
        let certain = json!({ "rule": "fixed", "radius": 0.0 });
        let report = sleeve(&with(&problem(&outcomes, 0.0), "radius", certain));
        assert!((report.kelly.unwrap() - exact).abs() < 1e-9, "{report:?} {exact}");
        assert!((report.share - exact.min(1.0)).abs() < 1e-6, "{report:?} {exact}");
        let growth = (p * (b * exact).ln_1p() + q * (-l * exact).ln_1p()).exp_m1();
        assert!((report.growth.kelly.unwrap().record - growth).abs() < 1e-9, "{report:?} {growth}");
        let doubted = sleeve(&problem(&outcomes, 0.0));
        assert!(doubted.share <= report.share, "{doubted:?}");
    }
}

/// The share lies between nothing and the Kelly share, is that of the advice, and promises no less than the bank.
#[test]
fn the_share_is_that_of_the_advice_and_at_most_kelly() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let (mut given, mut borrowed) = (0, 0);
    for round in 0..24 {
        let count = [12, 40, 120, 300][round % 4];
        let mean = [-0.01, 0.004, 0.012, 0.03][(round / 4) % 4];
        let record = problem(&drawn(&mut random, count, mean, 0.06), 0.002);
        let (report, advised) = (sleeve(&record), advised(&record));
        assert_eq!(report.share, advised.advice.allocation);
        assert_eq!(report.radius, advised.advice.radius);
        assert_eq!(report.worst_case.as_ref().unwrap(), &advised.worst_case);
        let kelly = report.kelly.unwrap();
        assert!(report.share >= 0.0 && report.share <= kelly + 1e-6, "{report:?}");
        let (growth, seen) = (report.growth, report.record.unwrap());
        assert_eq!(kelly > 0.0, seen.mean > 0.002, "{report:?}");
        let of_kelly = growth.kelly.unwrap();
        assert!(growth.share.worst.unwrap() >= growth.bank - 1e-12, "{report:?}");
        assert!(growth.share.record <= of_kelly.record + 1e-9, "{report:?}");
        if let Some(worst) = report.worst {
            given += 1;
            assert!(worst.mean < seen.mean, "{report:?}");
            // Under the worst law for the share no other share of the capital does better than it promises.
            assert!(kelly > 1.0 || of_kelly.worst.unwrap() <= growth.share.worst.unwrap() + 1e-7, "{report:?}");
        }
        borrowed += usize::from(kelly > 1.0);
        assert!(
            report.sentences.len() >= 2 && report.sentences.iter().all(|sentence| sentence.ends_with('.')),
            "{report:?}"
        );
    }
    assert!(given >= 6 && borrowed >= 6, "{given} {borrowed}");
}

/// Each finding that would change the answer is one: the record with that change has another advice.
#[test]
fn what_would_refute_the_share_does() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut checked = 0;
    // The wide ones have a Kelly share of which half is less than the whole capital.
    for (count, mean, spread) in [
        (60, 0.012, 0.09),
        (150, 0.012, 0.2),
        (300, 0.012, 0.22),
        (400, 0.012, 0.2),
        (200, 0.01, 0.2),
        (90, 0.002, 0.09),
    ] {
        let history = drawn(&mut random, count, mean, spread);
        let record = with(&problem(&history, 0.001), "caution", json!("paper"));
        let report = sleeve(&record);
        let (refutation, kelly) = (report.refutation.unwrap(), report.kelly.unwrap());
        let shifted = |by: f64| {
            let shift = (refutation.break_even_shift.unwrap() + by).ln_1p();
            let history: Vec<f64> = history.iter().map(|z| z + shift).collect();
            let mean = history.iter().map(|z| z.exp_m1()).sum::<f64>() / count as f64;
            (advised(&with(&record, "history", json!(history))).advice.allocation, mean)
        };
        assert!((shifted(0.0).1 - refutation.break_even_mean.unwrap()).abs() < 1e-12);
        assert!(shifted(-1e-5).0 <= 1e-6 && shifted(1e-5).0 > 1e-6, "{report:?}");
        assert_eq!(report.share > 0.0, refutation.break_even_mean.unwrap() < report.record.unwrap().mean);
        for (part, until) in [(0.5, refutation.until_half_kelly), (0.75, refutation.until_three_quarters_kelly)] {
            let after = |more: usize| {
                let radius = report.radius * (count as f64 / (count + more) as f64).sqrt();
                let fixed = json!({ "rule": "fixed", "radius": radius });
                advised(&with(&record, "radius", fixed)).advice.allocation / kelly
            };
            match until {
                Some(0) => assert!(report.fraction.unwrap() >= part - 1e-5),
                Some(more) => {
                    assert!(after(more) >= part - 1e-4 && after(more - 1) < part + 1e-4, "{more} {report:?}");
                    checked += 1;
                }
                None => assert!(part * kelly > 1.0 || kelly == 0.0 || after(10_000) < part, "{report:?}"),
            }
        }
        let Some(losses) = refutation.losses_in_a_row else { continue };
        let after = |count: usize| {
            let more = vec![refutation.mean_loss.unwrap().ln_1p(); count];
            advised(&with(&record, "history", json!([&history[..], &more].concat()))).advice.allocation
        };
        assert!(report.share > 0.0 && after(losses) <= 1e-5 && after(losses - 1) > 0.0, "{losses} {report:?}");
        checked += 1;
    }
    assert!(checked >= 4, "{checked} are checked");
}

/// Growth is concave, so shares at which no small change raises it are the best.
#[test]
fn several_kelly_shares_meet_the_conditions_of_their_maximum() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut positive = 0;
    for count in [1, 2, 3, 5, 12] {
        let common = drawn(&mut random, 80, 0.0, 0.05);
        let excess: Vec<Vec<f64>> = (0..count)
            .map(|at| {
                let own = drawn(&mut random, 80, 0.006 - 0.004 * (at % 4) as f64, 0.05);
                own.iter().zip(&common).map(|(own, common)| own + 0.7 * common).collect()
            })
            .collect();
        let masses: Vec<f64> = (1..=80).map(|date| date as f64 / 3240.0).collect();
        let shares = kelly(&excess, &masses, 1.001).unwrap();
        let wealth = |date: usize| 1.001 + shares.iter().zip(&excess).map(|(share, x)| share * x[date]).sum::<f64>();
        for (share, returns) in shares.iter().zip(&excess) {
            let slope: f64 = (0..80).map(|date| masses[date] * returns[date] / wealth(date)).sum();
            assert!(slope < 1e-9 && (*share == 0.0 || slope > -1e-9), "{count} {shares:?} {slope}");
            positive += usize::from(*share > 0.0);
        }
        assert!((0..80).all(|date| wealth(date) > 0.0));
    }
    assert!(positive >= 4, "{positive}");
}

/// Without a loss there is no largest stake, also if two strategies only lose one at a time.
#[test]
fn a_record_without_a_loss_has_no_kelly_share() {
    let report = sleeve(&problem(&[0.03, 0.01, 0.02, 0.05, 0.01, 0.04], 0.0));
    assert!(report.kelly.is_none() && report.fraction.is_none() && report.growth.kelly.is_none(), "{report:?}");
    assert!(report.sentences[0].contains("has no limit"), "{:?}", report.sentences);
    let hedged = [vec![0.05, -0.02, 0.05, -0.02], vec![-0.02, 0.05, -0.02, 0.05]];
    assert!(kelly(&hedged, &[0.25; 4], 1.0).is_none());
    assert_eq!(kelly(&[vec![0.0; 4]], &[0.25; 4], 1.0), Some(vec![0.0]));
}

/// Several strategies get what they get as assets, and the break-even shift takes it all away.
#[test]
fn several_strategies_get_what_they_get_as_assets() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let columns = [0.012, 0.009, -0.004].map(|mean| drawn(&mut random, 90, mean, 0.05));
    let rows: Vec<Vec<f64>> = (0..90).map(|date| columns.iter().map(|column| column[date]).collect()).collect();
    let record = json!({ "assets": ["trend", "carry", "value"], "history": rows, "rate_per_step": 0.001,
        "periods_per_year": 12 });
    let advised = |record: &Value| -> AssetsAdvised {
        let problem = with(&with(record, "utility", json!({ "kind": "log" })), "caution", json!("paper"));
        serde_json::from_value::<AdviseAssets>(json!({ "problem": problem })).unwrap().answer().unwrap()
    };
    let (report, expected) = (sleeve(&record), advised(&record));
    assert_eq!(report.share, expected.advice.total);
    let shares = report.strategies.as_ref().unwrap();
    for (name, share) in &expected.advice.allocation {
        assert_eq!(shares[name].share, *share);
    }
    let kelly = report.kelly.unwrap();
    assert!(report.share > 0.0 && kelly > report.share, "{report:?}");
    let of_kelly: f64 = shares.values().map(|share| share.kelly.unwrap()).sum();
    assert!((of_kelly - kelly).abs() < 1e-12 && shares["value"].kelly == Some(0.0), "{report:?}");
    assert!(report.growth.share.worst.unwrap() >= 0.001 - 1e-9, "{report:?}");
    assert!(report.growth.share.record < report.growth.kelly.unwrap().record, "{report:?}");
    let yearly = report.growth_a_year.unwrap().share.record;
    assert!(((1.0 + report.growth.share.record).powi(12) - 1.0 - yearly).abs() < 1e-12);
    let fixed = |by: f64| {
        let shift = (report.refutation.unwrap().break_even_shift.unwrap() + by).ln_1p();
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|z| z + shift).collect()).collect();
        // The radius for all mixes is that of the mix by volatility times a factor, so it is set for both.
        let radius = json!({ "rule": "fixed", "radius": report.radius });
        let found = advised(&with(&with(&record, "history", json!(rows)), "radius", radius)).advice;
        assert!((found.radius / report.radius - 1.0).abs() < 1e-9, "{found:?}");
        found.total
    };
    assert!(fixed(-1e-4) <= 1e-6 && fixed(1e-4) > 0.0, "{report:?}");
}
