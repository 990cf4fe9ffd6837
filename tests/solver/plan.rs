//! A plan on simulated paths: what it promises under the worst law, and amounts that last in closed form.

use ballast::control::evaluation::plan::report::{PlanReport, PlanRule, PlanStrategy};
use ballast::control::request::spending::Spending;
use ballast::service::advice::plan::PlanAsked;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Gamma, Normal};

const HISTORY: [f64; 12] = [0.12, -0.09, 0.21, 0.03, -0.18, 0.24, 0.11, 0.07, -0.05, 0.16, 0.02, 0.09];

/// Mean and deviation of the yearly return of a published table.
const MEAN: f64 = 0.07;
const DEVIATION: f64 = 0.2;

fn plan(question: Value) -> PlanReport {
    PlanAsked::Asset(serde_json::from_value(question).unwrap()).answer().unwrap()
}

fn strategy(report: &PlanReport, rule: PlanRule) -> &PlanStrategy {
    report.strategies.iter().find(|strategy| strategy.rule == rule).unwrap()
}

/// The paper's section 2.3 with spending: under the plan and the worst law of every period, the mean utility of a path is the
/// value of the problem. So the intervals of the simulation hold the promised level as often as they say. Under the record
/// more is spent, and somebody who trusts it does worse under the worst law.
#[test]
fn the_plan_keeps_its_promise_under_the_worst_law() {
    let (mut held, mut asked, mut better) = (0, 0, 0);
    for (risk_aversion, radius, secured) in [(1.0, 0.02, 0.0), (3.0, 0.03, 0.0), (6.0, 0.01, 0.0), (2.5, 0.02, 1.5)] {
        for seed in 1..=20 {
            let report = plan(json!({
                "problem": { "horizon": 25, "history": HISTORY, "rate_per_step": 0.01, "risk_aversion": risk_aversion,
                    "radius": { "rule": "fixed", "radius": radius },
                    "spending": { "inflation": 0.02, "discount": 0.97, "bequest": 2.0, "secured": secured,
                        "secured_left": 10.0 * secured } },
                "paths": 1000, "seed": seed }));
            let (own, trusting) = (strategy(&report, PlanRule::Plan), strategy(&report, PlanRule::Trusting));
            let (promised, found) = (report.advice.certainty_equivalent, own.certainty_equivalent.unwrap().worst);
            assert!((found.value / promised - 1.0).abs() < 0.1, "{found:?} {promised}");
            held += usize::from((found.low..=found.high).contains(&promised));
            asked += 1;
            assert!(own.certainty_equivalent.unwrap().record.value > found.value);
            // Where both hold all they may, they are one.
            let trusted = trusting.certainty_equivalent.unwrap().worst.value;
            assert!(trusted <= found.value && report.advice.allocation > 0.05, "{trusted} {found:?}");
            better += usize::from(trusted < found.value);
            for floor in [own.poor_spending, trusting.poor_spending] {
                assert!(floor.worst.value >= secured && own.ruin.worst.value == 0.0, "{own:?}");
            }
        }
    }
    // 95 % of the intervals hold it: of 80 at least 71 do, except in one case of a hundred.
    assert!(held >= 71 && better >= 55, "{held} of {asked}, {better} better");
}

/// With everything in the bank at no interest, and no rise of prices, wealth over the number of periods lasts exactly.
#[test]
fn an_amount_that_lasts_in_the_bank_is_wealth_over_the_periods() {
    let report = plan(json!({
        "problem": { "horizon": 20, "history": [-0.1, 0.05, -0.02], "rate_per_step": 0.0, "risk_aversion": 3.0,
            "initial_wealth": 240.0, "radius": { "rule": "fixed", "radius": 0.0 } },
        "wanted": 12.0, "goal": 1.0, "paths": 200 }));
    let [bank, _] = &report.sustainable[..] else { panic!("two holdings") };
    assert_eq!(report.advice.allocation, 0.0);
    assert!((bank.amount.record.value - 12.0).abs() < 1e-12 && bank.amount.worst.value == bank.amount.record.value);
    assert!(report.breaking.is_none(), "{:?}", report.breaking);
    // Spending is wealth over the 21 periods, one of which is what is left.
    let own = strategy(&report, PlanRule::Plan);
    for sure in [own.mean_spending, own.lowest_spending, own.bequest, own.certainty_equivalent.unwrap()] {
        assert!((sure.record.value - 240.0 / 21.0).abs() < 1e-9, "{sure:?}");
    }
}

/// Quarters of a log-normal year of 7 % and 20 % with everything held, and no bank that pays.
fn lasting(quarters: usize, spent: f64) -> f64 {
    let (mean, deviation) = (MEAN, DEVIATION);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let quantile = |place: usize| {
        let z = normal.inverse_cdf((place as f64 + 0.5) / 250.0);
        (mean - 0.5 * deviation * deviation) / 4.0 + deviation / 2.0 * z
    };
    let history: Vec<f64> = (0..250).map(quantile).collect();
    let report = plan(json!({
        "problem": { "horizon": quarters, "history": history, "rate_per_step": 0.0, "risk_aversion": 1.0, "periods_per_year": 4,
            "initial_wealth": 100.0, "radius": { "rule": "fixed", "radius": 0.0 }, "support": { "rule": "none" } },
        "wanted": 100.0 * spent / 4.0, "paths": 5000 }));
    assert_eq!(report.periods.iter().filter(|period| period.held == 1.0).count(), quarters);
    report.wanted.lasts.record.value
}

/// Dufresne (1990), The distribution of a perpetuity: with returns m dt + s dB, one over what an endless payment of 1 a year
/// costs is gamma with shape 2 m / s^2 - 1 and scale s^2 / 2. Milevsky and Robinson (2005), A sustainable spending rate
/// without simulation, build their table of ruin on it. Quarters for 130 years come near: payments at the start of each
/// quarter cost more, and the years that are left out cost little.
#[test]
fn the_chance_of_ruin_is_that_of_the_perpetuity() {
    let variance = DEVIATION * DEVIATION;
    let exact = Gamma::new(2.0 * MEAN / variance - 1.0, 2.0 / variance).unwrap();
    for spent in [0.03, 0.05, 0.07] {
        let ruin = 1.0 - lasting(520, spent);
        // Payments at the start of a quarter are worth half a quarter's growth more; 5000 paths err by 0.02 at most.
        let expected = exact.cdf(spent * (1.0 + MEAN / 8.0));
        assert!((ruin - expected).abs() < 0.03, "{spent}: {ruin} {expected}");
    }
}

/// An example of Milevsky and Robinson (2005): somebody of fifty, who lives for another 28.1 years in the middle case and
/// is as likely to die in any year, spends 1 a year of 20. They print that the money runs out within this life with a
/// probability of 26.8 %, from the first two moments of what the life costs. By its law it is 29.3 %: Yor (1992), On some
/// exponential functionals of Brownian motion. Here lives of five lengths stand for all, each for a fifth.
#[test]
fn the_chance_of_ruin_within_a_life_is_that_of_its_law() {
    let (mortality, variance) = (2.0_f64.ln() / 28.1, DEVIATION * DEVIATION);
    // Over time 4 t / s^2 the cost is 4 / s^2 times the integral of exp(2 (B - n t)) to the end, which is Z / (2 G).
    let n = (2.0 * MEAN - variance) / variance;
    let root = (8.0 * mortality / variance + n * n).sqrt();
    let [beta, gamma] = [root - n, root + n].map(|twice| 0.5 * twice);
    let gamma = Gamma::new(gamma, 1.0).unwrap();
    let exact = |spent: f64| {
        let cost = 0.25 * variance / spent;
        let ruined = |place: usize| {
            let share = (place as f64 + 0.5) / 4000.0;
            gamma.cdf((1.0 - (1.0 - share).powf(1.0 / beta)) / (2.0 * cost))
        };
        (0..4000).map(ruined).sum::<f64>() / 4000.0
    };
    assert!((exact(0.05) - 0.2933).abs() < 1e-4, "{}", exact(0.05));
    // The printed figure, by their formula.
    let shape = (2.0 * MEAN + 4.0 * mortality) / (variance + mortality) - 1.0;
    let printed = Gamma::new(shape, 2.0 / (variance + mortality)).unwrap().cdf(0.05);
    assert!((printed - 0.268).abs() < 5e-4, "{printed}");
    let years = |share: f64| -(-share).ln_1p() / mortality;
    let ruin = |share: f64| 1.0 - lasting((4.0 * years(share)).round() as usize, 0.05);
    let found = [0.1, 0.3, 0.5, 0.7, 0.9].map(ruin).iter().sum::<f64>() / 5.0;
    // Payments at the start of a quarter, as above; 5000 paths of each of five lives err by 0.01 at most.
    let expected = exact(0.05 * (1.0 + MEAN / 8.0));
    assert!((found - expected).abs() < 0.015, "{found} {expected}");
}

/// The breaking return is the one with which the amount lasts just as often as asked: with it as the record, it does.
#[test]
fn the_breaking_return_breaks() {
    let question = |history: &[f64]| {
        json!({ "problem": { "horizon": 30, "history": history, "rate_per_step": 0.01, "risk_aversion": 2.0,
            "radius": { "rule": "fixed", "radius": 0.0 } }, "wanted": 5.0, "certainty": 0.8, "paths": 4000 })
    };
    let report = plan(question(&HISTORY));
    let breaking = report.breaking.unwrap();
    let shift = ((1.0 + breaking.mean_return) / (1.0 + breaking.mean_seen)).ln();
    assert!((breaking.standard_errors < 0.0) == (report.wanted.lasts.record.value > 0.8), "{breaking:?}");
    // Another record would be planned for otherwise, so the same holding is followed: by the shares of the plan itself.
    let held: Vec<f64> = report.periods.iter().map(|period| period.held).collect();
    let lasts = |shift: f64| {
        let mut seed = 12345_u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            HISTORY[((seed >> 33) % 12) as usize]
        };
        let lasting = (0..20_000).filter(|_| {
            let mut wealth = 100.0_f64;
            held.iter().all(|held| {
                wealth -= 5.0;
                let enough = wealth >= 0.0;
                wealth *= (1.0 - held) * 1.01 + held * (draw() + shift).exp();
                enough
            })
        });
        lasting.count() as f64 / 20_000.0
    };
    // Twice three standard errors of a share of 0.8: of 4000 paths and of 20,000.
    assert!((lasts(shift) - 0.8).abs() < 0.03, "{breaking:?} {}", lasts(shift));
    assert!((lasts(0.0) - report.wanted.lasts.record.value).abs() < 0.03);
}

/// Two assets that are one are planned for as that one, and a plan of several holds the composition of their advice.
#[test]
fn several_assets_are_planned_for_as_their_fund() {
    let investor = json!({ "horizon": 20, "rate_per_step": 0.01, "risk_aversion": 4.0, "periods_per_year": 1,
        "radius": { "rule": "fixed", "radius": 0.02 }, "spending": { "inflation": 0.01 } });
    let of = |assets: &[&str], rows: Vec<Vec<f64>>| {
        let mut problem = investor.clone();
        (problem["assets"], problem["history"]) = (json!(assets), json!(rows));
        let asked = json!({ "problem": problem, "paths": 400 });
        PlanAsked::Assets(serde_json::from_value(asked).unwrap()).answer().unwrap()
    };
    let twins = of(&["one", "other"], HISTORY.iter().map(|z| vec![*z; 2]).collect());
    let mut single = investor.clone();
    single["history"] = json!(HISTORY);
    let single = plan(json!({ "problem": single, "paths": 400 }));
    for (one, other) in twins.periods.iter().zip(&single.periods) {
        // Half of a return and half of it again may differ from it in the last digit.
        assert!((one.held - other.held).abs() < 1e-6 && (one.spent - other.spent).abs() < 1e-9, "{one:?} {other:?}");
    }
    let sure = |report: &PlanReport| report.advice.certainty_equivalent;
    assert!((sure(&twins) / sure(&single) - 1.0).abs() < 1e-9);
    // A second asset that mostly moves against the first is held beside it, and more is spent for certain.
    let rows =
        HISTORY.iter().enumerate().map(|(year, z)| vec![*z, 0.08 - 0.6 * z + if year % 2 == 0 { 0.02 } else { -0.02 }]);
    let hedged = of(&["stocks", "hedge"], rows.collect());
    let composition = hedged.composition.clone().unwrap();
    assert!((composition.values().sum::<f64>() - 1.0).abs() < 1e-9 && composition["hedge"] > 0.2, "{composition:?}");
    assert!(sure(&hedged) > 1.02 * sure(&single) && hedged.sentences[0].contains("hedge"), "{:?}", hedged.sentences);
}

/// Whatever is legal is answered in numbers: intervals hold their values, what the bank does for certain is no better than
/// the plan, nobody spends more than there is, and what is secured is spent on every path of the plan.
#[test]
fn random_plans_are_answered_in_numbers() {
    let mut random = ChaCha8Rng::seed_from_u64(0x71a4);
    let mut floors = 0;
    for _ in 0..60 {
        let horizon = random.random_range(1..=40);
        let size = random.random_range(3..=60);
        let deviation = 10.0_f64.powf(random.random_range(-3.0..-0.5));
        let history: Vec<f64> = (0..size).map(|_| deviation * random.random_range(-1.5..1.8)).collect();
        let (inflation, rate) = (random.random_range(-0.05..0.1), random.random_range(-0.02..0.08));
        let wealth = 10.0_f64.powf(random.random_range(-3.0..9.0));
        let mut spending = json!({ "inflation": inflation, "bequest": 10.0_f64.powf(random.random_range(-6.0..4.0)),
            "discount": random.random_range(0.7..1.2) });
        if random.random::<bool>() {
            let of = Spending { secured: 1.0, secured_left: 1.0, inflation, ..Spending::default() };
            let unit = random.random_range(0.05..0.99) * wealth / of.reserves(rate, horizon)[0][1];
            (spending["secured"], spending["secured_left"]) = (json!(unit), json!(unit));
            floors += 1;
        }
        let utility = if random.random::<bool>() {
            json!({ "kind": "log" })
        } else {
            json!({ "kind": "power", "risk_aversion": 10.0_f64.powf(random.random_range(0.05..1.7)) })
        };
        let question = json!({ "problem": { "horizon": horizon, "history": history, "rate_per_step": rate,
            "periods_per_year": ([1, 4, 12][random.random_range(0..3)]), "initial_wealth": wealth, "utility": utility,
            "caution": (["bold", "balanced", "cautious"][random.random_range(0..3)]), "spending": spending },
            "wanted": wealth * random.random_range(0.001..0.5), "goal": wealth, "paths": 200,
            "certainty": random.random_range(0.5..0.999) });
        let report = plan(question.clone());
        let text = serde_json::to_value(&report).unwrap();
        let mut pending = vec![&text];
        while let Some(value) = pending.pop() {
            match value {
                Value::Array(values) => pending.extend(values),
                // No interval of a number is missing; what may be absent is left out or says why.
                Value::Object(fields) => {
                    assert!(fields.get("low").is_none_or(Value::is_number), "{question}: {fields:?}");
                    assert!(fields.get("value").is_none_or(Value::is_number), "{question}: {fields:?}");
                    pending.extend(fields.values());
                }
                _ => {}
            }
        }
        let advice = &report.advice;
        assert!(advice.certainty_equivalent >= advice.floor * (1.0 - 1e-12), "{question}: {advice:?}");
        let spent = advice.spending.unwrap();
        assert!((0.0..=wealth).contains(&spent.amount) && (0.0..=1.0).contains(&advice.allocation), "{advice:?}");
        let secured = spent.secured;
        for strategy in &report.strategies {
            for both in
                [strategy.ruin, strategy.mean_spending, strategy.bequest, strategy.certainty_equivalent.unwrap()]
            {
                for found in [both.record, both.worst] {
                    assert!(
                        found.low <= found.value && found.value <= found.high && found.low >= 0.0,
                        "{question}: {both:?}"
                    );
                }
            }
            if [PlanRule::Plan, PlanRule::Trusting].contains(&strategy.rule) {
                assert_eq!((strategy.ruin.record.value, strategy.ruin.worst.value), (0.0, 0.0), "{question}");
                let poor = strategy.poor_spending.worst.value;
                assert!(poor >= secured * (1.0 - 1e-9), "{question}: {poor} {secured}");
            }
        }
    }
    assert!(floors > 15);
}
