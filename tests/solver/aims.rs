//! Plans that aim at a goal or limit the drawdown: against independent references, brute force and what they promise.

use std::fs;

use ballast::control::error::TrainError;
use ballast::control::evaluation::plan::report::{PlanReport, PlanRule};
use ballast::numerics::machine::streams::stream;
use ballast::service::advice::plan::PlanAsked;
use rand::RngExt;
use serde_json::{Value, json};

const HISTORY: [f64; 12] = [0.12, -0.09, 0.21, 0.03, -0.18, 0.24, 0.11, 0.07, -0.05, 0.16, 0.02, 0.09];

fn asked(question: &Value) -> Result<PlanReport, TrainError> {
    PlanAsked::Asset(serde_json::from_value(question.clone()).unwrap()).answer()
}

fn plan(question: &Value) -> PlanReport {
    asked(question).unwrap_or_else(|error| panic!("{question}: {error}"))
}

/// Shortfalls and holdings of one and two periods are those of exact nested enumeration, which was computed elsewhere.
#[test]
fn a_goal_agrees_with_an_independent_reference() {
    let text = fs::read_to_string(format!("{}/tests/data/general.json", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let of_goal = |case: &&Value| {
        case["problem"] == "goal" && (case["framework"] == "static" || case["horizon"].as_u64() == Some(1))
    };
    let cases: Vec<&Value> = file["cases"].as_array().unwrap().iter().filter(of_goal).collect();
    assert!(cases.len() >= 4, "{}", cases.len());
    for case in cases {
        let (goal, support) = (case["parameters"]["goal"].as_f64().unwrap(), &case["support"]);
        let report = plan(&json!({
            "problem": { "horizon": case["horizon"], "history": case["history"], "initial_wealth": case["state"]["x"],
                "rate_per_step": case["parameters"]["rate"],
                "radius": { "rule": "root_n", "kappa": case["radius_times_sqrt_sample_size"] },
                "support": { "rule": "between", "min": support[0], "max": support[1] } },
            "aim": "goal", "goal": goal, "paths": 200 }));
        let (value, action) = (report.advice.certainty_equivalent - goal, report.advice.allocation);
        let [expected, other, held] =
            ["value", "value_on_another_grid", "action"].map(|name| case[name].as_f64().unwrap());
        // The reference itself errs by about what two of its grids differ by. With seven returns a worth has kinks, between
        // which cubics err by a two-hundredth of a percent of the goal.
        let reach = 5e-5 * goal + 2.0 * (expected - other).abs();
        assert!((value - expected).abs() < reach, "{case}: {value}");
        assert!((action - held).abs() < 2e-3, "{case}: {action}");
    }
}

/// The paper's section 2.3 for a shortfall: under the worst law of every state the mean of what is missing on simulated paths
/// is what the plan promises, within intervals that hold as often as they say.
#[test]
fn a_goal_and_a_limit_keep_their_promises() {
    let (mut held, mut asked) = (0, 0);
    for seed in 1..=8 {
        for (goal, wanted, saved) in
            [(130.0, None, None), (90.0, Some(3.0), None), (180.0, None, None), (170.0, None, Some(3.0))]
        {
            let report = plan(&json!({
                "problem": { "horizon": 15, "history": HISTORY, "rate_per_step": 0.01,
                    "radius": { "rule": "fixed", "radius": 0.02 }, "spending": { "inflation": 0.01 } },
                "aim": "goal", "goal": goal, "wanted": wanted, "saved": saved, "paths": 1000, "seed": seed }));
            let found = report.strategies[0].shortfall.unwrap();
            let promised = goal - report.advice.certainty_equivalent;
            held += usize::from((found.worst.low..=found.worst.high).contains(&promised));
            asked += 1;
            assert!(found.record.value < found.worst.value && report.advice.certainty_equivalent > report.advice.floor);
            // No rule misses less against the law that is worst for the plan, but for what paths err by.
            for other in &report.strategies[1..3] {
                let missed = other.shortfall.unwrap().worst;
                assert!(missed.high > found.worst.low, "{goal}: {:?} misses {missed:?}, not {found:?}", other.rule);
            }
        }
        let report = plan(&json!({
            "problem": { "horizon": 15, "history": HISTORY, "rate_per_step": 0.01, "risk_aversion": 2.0,
                "radius": { "rule": "fixed", "radius": 0.02 }, "spending": { "inflation": 0.01, "bequest": 3.0 } },
            "drawdown_limit": 0.15, "drawdown": 0.05, "paths": 1000, "seed": seed }));
        let (found, promised) =
            (report.strategies[0].certainty_equivalent.unwrap(), report.advice.certainty_equivalent);
        held += usize::from((found.worst.low..=found.worst.high).contains(&promised));
        asked += 1;
    }
    // 95 % of the intervals hold it: of 40 at least 34 do, except in one case of a hundred.
    assert!(held >= 34, "{held} of {asked}");
}

/// A goal that the bank reaches is left to the bank, and what is out of reach is still approached.
#[test]
fn a_goal_that_the_bank_pays_for_is_left_to_it() {
    let of = |goal: f64| {
        plan(&json!({ "problem": { "horizon": 10, "history": HISTORY, "rate_per_step": 0.01,
            "radius": { "rule": "fixed", "radius": 0.01 } }, "aim": "goal", "goal": goal, "wanted": 2.0, "paths": 400 }))
    };
    // 100 pays 2 at the start of each of ten periods, and leaves this.
    let left = (0..10).fold(100.0_f64, |wealth, _| (wealth - 2.0) * 1.01);
    let reached = of(left * (1.0 - 1e-9));
    assert_eq!(reached.advice.allocation, 0.0);
    assert!(reached.strategies[0].shortfall.unwrap().worst.value < 1e-6, "{:?}", reached.strategies[0]);
    assert_eq!(reached.strategies[0].reaches_goal.unwrap().worst.value, 1.0);
    // The less there is, the more of it is held, but for the kinks of a worth after twelve returns.
    for period in &reached.states.unwrap().periods[1..] {
        let falls = period.held.is_sorted_by(|one, other| other - one <= 0.05);
        assert!(period.held[0] == 1.0 && falls && period.held.last() == Some(&0.0), "{period:?}");
    }
    let far = of(500.0);
    assert!(
        far.advice.allocation > 0.9 && far.strategies[0].shortfall.unwrap().worst.value > 100.0,
        "{:?}",
        far.advice
    );
}

/// Money put in at the start of the only period is wealth, and a goal that the bank reaches with what is put in is left to it,
/// also with nothing at the start.
#[test]
fn money_that_is_put_in_counts() {
    let of = |wealth: f64, saved: Option<f64>, horizon: usize, goal: f64| {
        plan(
            &json!({ "problem": { "horizon": horizon, "history": HISTORY, "rate_per_step": 0.01, "initial_wealth": wealth,
            "radius": { "rule": "fixed", "radius": 0.01 } }, "aim": "goal", "goal": goal, "saved": saved, "paths": 400 }),
        )
    };
    let (put_in, there) = (of(80.0, Some(20.0), 1, 108.0), of(100.0, None, 1, 108.0));
    assert!((put_in.advice.allocation - there.advice.allocation).abs() < 1e-9, "{put_in:?}");
    assert!((put_in.advice.certainty_equivalent - there.advice.certainty_equivalent).abs() < 1e-9);
    let saved = (0..10).fold(0.0_f64, |wealth, _| (wealth + 5.0) * 1.01);
    let reached = of(1e-3, Some(5.0), 10, saved);
    assert!(reached.advice.allocation == 0.0 && reached.strategies[0].reaches_goal.unwrap().worst.value == 1.0);
    let (more, none) = (of(50.0, Some(5.0), 10, 150.0), of(50.0, None, 10, 150.0));
    assert!(
        more.strategies[0].shortfall.unwrap().worst.value < none.strategies[0].shortfall.unwrap().worst.value - 10.0
    );
    assert!(more.sentences[0].starts_with("Put in 5 this period. Of the 55 then, hold"), "{:?}", more.sentences);
}

/// The worth of a goal with a known law, on even wealth with lines between, where every holding is searched: an amount at the
/// start, negative, of what is missing.
fn missing_by_grid(history: &[f64], growth: [f64; 2], [wealth, amount, goal, most]: [f64; 4], horizon: usize) -> f64 {
    const POINTS: usize = 1500;
    let [bank, prices] = growth;
    let mut reserve = goal;
    let mut after: Option<(f64, Vec<f64>)> = None;
    for step in (0..horizon).rev() {
        reserve = amount + reserve * prices / bank;
        let top = if step == 0 { wealth } else { reserve.max(1e-9) };
        let states =
            if step == 0 { vec![wealth] } else { (0..=POINTS).map(|at| top * at as f64 / POINTS as f64).collect() };
        let worth = |wealth: f64| match &after {
            None => -(goal - wealth).max(0.0),
            Some((top, worths)) => {
                let place = (wealth / top).clamp(0.0, 1.0) * POINTS as f64;
                let below = (place as usize).min(POINTS - 1);
                worths[below] + (place - below as f64) * (worths[below + 1] - worths[below])
            }
        };
        let best = |state: &f64| {
            let (spent, mut ends) = (state.min(amount), [0.0, most]);
            let of = |held: f64| {
                let next = |z: &f64| (state - spent) * ((1.0 - held) * bank + held * z.exp()) / prices;
                history.iter().map(|z| worth(next(z))).sum::<f64>() / history.len() as f64
            };
            // Concave in what is held.
            for _ in 0..40 {
                let [low, high] = ends;
                let [one, other] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
                if of(one) < of(other) { ends[0] = one } else { ends[1] = other }
            }
            [0.0, most, ends[0]].map(of).into_iter().fold(f64::MIN, f64::max) - (amount - spent)
        };
        after = Some((top, states.iter().map(best).collect()));
    }
    after.map_or(0.0, |(_, worths)| worths[0])
}

/// Over random legal problems the shortfall of a known law is that of a fine grid: to a thousandth of all that is wanted in
/// each of 60, and to 5 in 100,000 in 54 of them. Worths have kinks where there are few returns.
#[test]
fn a_goal_agrees_with_a_fine_grid() {
    let (mut close, mut interior) = (0, 0);
    for case in 0..60 {
        let mut random = stream(20_261_130, "goals", case, 0);
        let horizon = random.random_range(1..=4);
        let deviation = 10.0_f64.powf(random.random_range(-2.5..-0.5));
        let mean = random.random_range(-0.2..0.7) * deviation;
        let draw = |_| mean + deviation * random.random_range(-1.7..1.7);
        let history: Vec<f64> = (0..2 + case % 19).map(draw).collect();
        let (rate, inflation) = (random.random_range(-0.03..0.06), random.random_range(-0.08..0.08));
        let amount = [0.0, 1.0, -1.0][case % 3] * 10.0_f64.powf(random.random_range(-0.5..1.7));
        // Near what the bank reaches, there is something to decide.
        let in_bank = |wealth: f64, _| (wealth - amount).max(0.0) * (1.0 + rate) / (1.0 + inflation);
        let goal = (0..horizon).fold(100.0, in_bank).max(10.0) * random.random_range(0.98..1.3);
        let most = random.random_range(0.2..1.0);
        let (wanted, saved) = ((amount > 0.0).then_some(amount), (amount < 0.0).then_some(-amount));
        let question = json!({
            "problem": { "horizon": horizon, "history": history, "rate_per_step": rate, "action_interval": [0.0, most],
                "radius": { "rule": "fixed", "radius": 0.0 }, "spending": { "inflation": inflation } },
            "aim": "goal", "goal": goal, "wanted": wanted, "saved": saved, "paths": 200 });
        let found = plan(&question).advice;
        let expected = missing_by_grid(&history, [1.0 + rate, 1.0 + inflation], [100.0, amount, goal, most], horizon);
        let error = (found.certainty_equivalent - goal - expected).abs() / (goal + horizon as f64 * amount.max(0.0));
        assert!(error < 1e-3, "{error}: {expected} and {found:?} of {question}");
        close += usize::from(error < 5e-5);
        interior += usize::from(found.allocation > 1e-6 && found.allocation < most - 1e-6);
    }
    assert!(close >= 54 && interior >= 8, "{close} {interior}");
}

/// Whatever is legal, a plan is worth no less than the bank, which it may always choose.
#[test]
fn no_aimed_plan_is_worth_less_than_the_bank() {
    for case in 0..60 {
        let mut random = stream(20_261_130, "banks", case, 0);
        let mut power = |low: f64, high: f64| 10.0_f64.powf(random.random_range(low..high));
        let (wealth, deviation) = (power(-3.0, 9.0), power(-4.0, -0.3));
        let (goal, amount) = (wealth * power(-2.0, 2.0), wealth * power(-3.0, 0.5));
        let (risk_aversion, bequest) = (1.0 + power(-1.0, 2.0), power(-6.0, 4.0));
        let history: Vec<f64> = (0..20).map(|_| deviation * random.random_range(-1.6..1.8)).collect();
        let mut problem = json!({ "horizon": random.random_range(1..=24), "history": history, "initial_wealth": wealth,
            "rate_per_step": random.random_range(0.0..0.1), "radius": { "rule": "fixed", "radius": 0.1 * deviation },
            "spending": { "inflation": random.random_range(-0.2..0.2) } });
        let question = if case % 2 == 0 {
            problem["rate_per_step"] = json!(random.random_range(-0.05..0.1));
            let each = ["wanted", "saved"][case / 2 % 2];
            json!({ "problem": problem, "aim": "goal", "goal": goal, each: amount, "paths": 200 })
        } else {
            problem["risk_aversion"] = json!(risk_aversion);
            problem["spending"]["bequest"] = json!(bequest);
            problem["spending"]["discount"] = json!(random.random_range(0.5..1.5));
            json!({ "problem": problem, "drawdown_limit": random.random_range(0.01..0.99), "paths": 200 })
        };
        let advice = plan(&question).advice;
        let scale = advice.floor.abs() + if case % 2 == 0 { goal + amount } else { 0.0 };
        assert!(advice.certainty_equivalent >= advice.floor - 1e-9 * scale, "{question}: {advice:?}");
    }
}

/// With log utility and a known law, what to hold over two periods is found by trying.
#[test]
fn a_limit_agrees_with_brute_force_over_two_periods() {
    let (bank, lowest) = (1.01_f64, -0.3_f64);
    for (limit, drawdown, bequest) in
        [(0.1, 0.0, 1.0), (0.1, 0.04, 4.0), (0.2, 0.0, 2.0), (0.05, 0.0, 1.0), (0.25, 0.1, 1.0), (0.6, 0.0, 1.0)]
    {
        let report = plan(&json!({
            "problem": { "horizon": 2, "history": HISTORY, "rate_per_step": 0.01, "utility": { "kind": "log" },
                "radius": { "rule": "fixed", "radius": 0.0 }, "spending": { "bequest": bequest },
                "support": { "rule": "between", "min": lowest, "max": 0.3 } },
            "drawdown_limit": limit, "drawdown": drawdown, "paths": 200 }));
        let most = |of_peak: f64| ((bank - (1.0 - limit) / of_peak) / (bank - lowest.exp())).clamp(0.0, 1.0);
        let growth = |held: f64, z: f64| (1.0 - held) * bank + held * z.exp();
        let mean = |of: &dyn Fn(f64) -> f64| HISTORY.iter().map(|z| of(*z)).sum::<f64>() / HISTORY.len() as f64;
        let best = |most: f64, worth: &dyn Fn(f64) -> f64| {
            (0..=400).map(|part| most * f64::from(part) / 400.0).map(|held| (worth(held), held)).fold(
                (f64::MIN, 0.0),
                |a, b| {
                    if b.0 > a.0 { b } else { a }
                },
            )
        };
        let second = |of_peak: f64| best(most(of_peak), &|held| mean(&|z| growth(held, z).ln())).0;
        let first = |held: f64| {
            mean(&|z| {
                let grown = growth(held, z);
                (1.0 + bequest) * grown.ln() + bequest * second(((1.0 - drawdown) * grown).min(1.0))
            })
        };
        let (worth, held) = best(most(1.0 - drawdown), &first);
        // The worth of what is held instead, over the weight of all: the log of a sure level.
        let lost = (worth - first(report.advice.allocation)) / (2.0 + bequest);
        assert!(lost.abs() < 2e-6, "{limit} {drawdown}: {lost}, {} and not {held}", report.advice.allocation);
        let spent = [1.0 / (2.0 + bequest), 1.0 / (1.0 + bequest)];
        let logs = [100.0 * spent[0], 100.0 * (1.0 - spent[0]) * spent[1]].map(f64::ln);
        let left = (100.0 * (1.0 - spent[0]) * (1.0 - spent[1])).ln();
        let sure = ((logs[0] + logs[1] + bequest * left + worth) / (2.0 + bequest)).exp();
        assert!((report.advice.certainty_equivalent / sure - 1.0).abs() < 5e-6, "{sure} {:?}", report.advice);
    }
}

/// A limit so wide that it never binds changes nothing, a tighter one is worth less, and none is broken on any path.
#[test]
fn no_path_falls_below_a_limit() {
    let mut random = stream(20_261_130, "limits", 0, 0);
    for _ in 0..25 {
        let horizon = random.random_range(1..=12);
        let history: Vec<f64> = (0..random.random_range(3..=30)).map(|_| random.random_range(-0.2..0.3)).collect();
        let risk_aversion = 10.0_f64.powf(random.random_range(0.0..1.3));
        let utility = if risk_aversion < 1.2 {
            json!({ "kind": "log" })
        } else {
            json!({ "kind": "power", "risk_aversion": risk_aversion })
        };
        let question = |limit: Option<f64>, drawdown: f64| {
            let mut question = json!({
                "problem": { "horizon": horizon, "history": history, "rate_per_step": 0.01, "utility": utility,
                    "periods_per_year": 1, "radius": { "rule": "fixed", "radius": 0.01 }, "spending": { "inflation": 0.02 } },
                "paths": 400 });
            if let Some(limit) = limit {
                (question["drawdown_limit"], question["drawdown"]) = (json!(limit), json!(drawdown));
            }
            question
        };
        let (limit, drawdown) = (random.random_range(0.02..0.5), random.random_range(0.0..0.02));
        let (tight, free, wide) =
            (plan(&question(Some(limit), drawdown)), plan(&question(None, 0.0)), plan(&question(Some(0.99), 0.0)));
        let sure = |report: &PlanReport| report.advice.certainty_equivalent;
        assert!(sure(&tight) <= sure(&wide) * (1.0 + 1e-7) && sure(&tight) >= tight.advice.floor * (1.0 - 1e-9));
        // A period that loses nearly all is beyond any limit, so only supports that end before are compared.
        assert!((sure(&wide) / sure(&free) - 1.0).abs() < 1e-6, "{} {}", sure(&wide), sure(&free));
        for rule in [PlanRule::Plan, PlanRule::Trusting] {
            let of = tight.strategies.iter().find(|strategy| strategy.rule == rule).unwrap().max_drawdown;
            // The 95 % quantile with its interval; the bank grows, so rounding alone can exceed the limit.
            assert!(of.worst.high <= limit + 1e-9 && of.record.high <= limit + 1e-9, "{limit}: {of:?}");
        }
        assert!(tight.worst_case.is_none() && tight.periods.is_empty() && tight.states.is_some());
    }
}

#[test]
fn what_a_plan_cannot_keep_to_is_named() {
    let question = |changes: Value| {
        let mut question =
            json!({ "problem": { "horizon": 5, "history": HISTORY, "rate_per_step": 0.01 }, "paths": 200 });
        for (name, value) in changes.as_object().unwrap() {
            if name == "spending" || name == "rate_per_step" {
                question["problem"][name] = value.clone();
            } else {
                question[name] = value.clone();
            }
        }
        question
    };
    for (changes, field) in [
        (json!({ "aim": "goal" }), "aim"),
        (json!({ "aim": "goal", "goal": 120.0, "spending": { "bequest": 2.0 } }), "problem.spending"),
        (json!({ "aim": "goal", "goal": 120.0, "drawdown_limit": 0.2 }), "drawdown_limit"),
        (json!({ "drawdown_limit": 0.2, "spending": { "secured": 1.0 } }), "drawdown_limit"),
        (json!({ "drawdown_limit": 0.2, "rate_per_step": -0.01 }), "drawdown_limit"),
        (json!({ "drawdown_limit": 20.0 }), "drawdown_limit"),
        (json!({ "saved": 1.0 }), "saved"),
        (json!({ "saved": 1.0, "wanted": 1.0, "aim": "goal", "goal": 120.0 }), "saved"),
        (json!({ "drawdown_limit": 0.2, "drawdown": 0.2 }), "drawdown"),
        (json!({ "drawdown": 0.1 }), "drawdown"),
    ] {
        match asked(&question(changes.clone())) {
            Err(TrainError::Specification(error)) => assert_eq!(error.field, field, "{changes}"),
            other => panic!("{changes}: {:?}", other.map(|report| report.sentences)),
        }
    }
}
