//! How near an advice is to changing, against asking again: with the record changed by hand, and by closed forms.

use crate::support::values::number;
use crate::support::{App, policies, specification};
use ballast::control::cache::Cache;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::policy::one_period::OnePeriod;
use ballast::control::problem::state::State;
use ballast::control::request::specification::{ProblemSpecification, Specification, default_seed};
use ballast::numerics::law::empirical::EmpiricalDistribution;
use serde_json::{Value, json};

const HISTORY: [f64; 12] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037, 0.013, -0.067, 0.052, 0.029];
/// To which returns and shifts are told.
const RESOLUTION: f64 = 1e-6;
/// An allocation up to here is the bank's, and one as near to the highest is that.
const AT_AN_END: f64 = 1e-6;

/// Problems whose advice is near to changing, of one period each.
fn problems() -> Vec<Value> {
    let power = |risk_aversion: f64| json!({ "kind": "power", "risk_aversion": risk_aversion });
    let bridge = |scale: f64| json!({ "rule": "bridge", "alpha": 0.5, "paths": 300, "scale": scale });
    vec![
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": power(4.0), "radius": bridge(0.5) }),
        json!({ "history": HISTORY, "utility": power(4.0), "radius": bridge(0.8), "rate_per_step": 0.006 }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": power(9.0), "radius": { "rule": "root_n", "kappa": 0.03 },
            "framework": "static", "support": { "rule": "between", "min": -0.11, "max": 0.1 }, "action_interval": [0.0, 0.6] }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": { "kind": "exponential", "risk_aversion": 0.03 }, "contributions": -3.0,
            "radius": { "rule": "root_n", "kappa": 0.0366 }, "trading_cost": 0.004 }),
        json!({ "rate_per_step": 0.002, "history": HISTORY, "utility": power(5.0), "framework": "parametric_static",
            "radius": { "rule": "chi_square", "alpha": 0.8 } }),
        json!({ "history": HISTORY, "utility": power(6.0), "framework": "plug_in", "rate_per_step": 0.01 }),
    ]
}

async fn advise(app: &App, question: &Value) -> Value {
    let (status, advised) = app.post("/advise", question).await;
    assert_eq!(status, 200, "{question} {advised}");
    advised
}

/// Returns the advice for other records, with the correction of the radius that belongs to the problem's own record.
fn by_record(problem: &Value) -> impl Fn(&[f64]) -> f64 {
    let own: ProblemSpecification = serde_json::from_value(problem.clone()).unwrap();
    let own = ProblemSpecification { horizon: 1, ..own };
    let completed = |problem| Specification::of(problem, default_seed()).completed().unwrap();
    let radius = completed(own.clone()).resolved(&Cache::default()).problem.radius;
    move |record| {
        let other = completed(ProblemSpecification { history: record.to_vec(), radius, ..own.clone() });
        OnePeriod::new(&other, Cache::default()).advise(0.1).unwrap().0.allocation
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_range_without_one_is_that_of_asking_again_without_each() {
    let app = App::start().await;
    for problem in problems() {
        let plain = advise(&app, &json!({ "problem": problem, "holding": 0.1 })).await;
        let mut advised = advise(&app, &json!({ "problem": problem, "holding": 0.1, "sensitivity": true })).await;
        let range = advised["sensitivity"]["without_one"].clone();
        let (mut again, of_record) = (Vec::new(), by_record(&problem));
        for index in 0..HISTORY.len() {
            let rest = [&HISTORY[..index], &HISTORY[index + 1..]].concat();
            again.push(of_record(&rest));
        }
        let lowest = again.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = again.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!(lowest < highest, "the test shows nothing: {problem} {again:?}");
        for (end, expected) in [("lowest", lowest), ("highest", highest)] {
            let found = &range[end];
            assert_eq!(found["allocation"], expected, "{end} of {problem}");
            let index = found["index"].as_u64().unwrap() as usize;
            assert_eq!((found["log_return"].as_f64(), again[index]), (Some(HISTORY[index]), expected));
            assert_eq!(HISTORY.iter().position(|log_return| *log_return == HISTORY[index]), Some(index));
            assert!((number(&found["simple_return"]) - HISTORY[index].exp_m1()).abs() < 1e-15);
        }
        // Beside it stands the same advice.
        advised.as_object_mut().unwrap().remove("sensitivity");
        advised["caution"].as_array_mut().unwrap().retain(|caution| caution["code"] != "one_return");
        assert_eq!(advised, plain);
    }
}

/// Which ends are told, and that what is told is the crossing nearest to the median on a grid finer than the service's.
#[tokio::test(flavor = "multi_thread")]
async fn the_next_return_that_changes_the_advice_is_found_on_a_finer_grid_too() {
    let app = App::start().await;
    let (mut crossings, mut silent) = (0, 0);
    for problem in problems() {
        let advised = advise(&app, &json!({ "problem": problem, "holding": 0.1, "sensitivity": true })).await;
        let next = &advised["sensitivity"]["next_return"];
        let [low, high] = [0, 1].map(|end| number(&next["range"][end]));
        // The extremes are 0.15 apart.
        let wide = if problem["support"].is_null() { [-0.067 - 0.075, 0.083 + 0.075] } else { [-0.11, 0.1] };
        assert!((low - wide[0]).abs() + (high - wide[1]).abs() < 1e-12, "{next}");
        let of_record = by_record(&problem);
        let after = |log_return: f64| of_record(&[&HISTORY[..], &[log_return]].concat());
        let parts = 150;
        let mut grid = Vec::new();
        for index in 0..=parts {
            let log_return = (low + (high - low) * f64::from(index) / f64::from(parts)).min(high);
            grid.push((log_return, after(log_return)));
        }
        let top = problem["action_interval"][1].as_f64().unwrap_or(1.0);
        let invested = |allocation: f64| allocation > AT_AN_END;
        let full = |allocation: f64| allocation >= top - AT_AN_END;
        let is_above: [&dyn Fn(f64) -> bool; 2] = [&invested, &full];
        let ends = [("to_bank", RESOLUTION), ("to_highest", -RESOLUTION)];
        for ((name, across), is_above) in ends.into_iter().zip(is_above) {
            let crossed = grid.windows(2).filter(|pair| !is_above(pair[0].1) && is_above(pair[1].1));
            // The median lies between 0.013 and 0.029.
            let away = |pair: &&[(f64, f64)]| (pair[0].0 - 0.021).max(0.021 - pair[1].0);
            match crossed.min_by(|one, other| away(one).total_cmp(&away(other))) {
                None => {
                    assert!(next[name].is_null(), "{name} of {problem}: {next}");
                    silent += 1;
                }
                Some(pair) => {
                    let found = number(&next[name]["log_return"]);
                    assert!((pair[0].0..=pair[1].0).contains(&found), "{name} of {problem}: {found} not in {pair:?}");
                    let [own, beyond] = [after(found), after(found + across)].map(is_above);
                    assert_eq!((own, beyond), (across < 0.0, across > 0.0), "{name} of {problem}");
                    crossings += 1;
                }
            }
        }
        for (name, quantile) in [("low", 0.05), ("high", 0.95)] {
            // Of 12 returns 0.05 lies at 0.55 between the first two, and 0.95 at 0.45 between the last two.
            let expected = if name == "low" { 0.45 * -0.067 + 0.55 * -0.041 } else { 0.55 * 0.061 + 0.45 * 0.083 };
            let found = number(&next[name]["log_return"]);
            assert!((found - expected).abs() < 1e-15 && next[name]["quantile"] == quantile, "{next}");
            assert_eq!(next[name]["allocation"], after(found));
        }
    }
    assert!(crossings >= 6 && silent >= 2, "{crossings} crossings, {silent} ends without one");
}

/// The least mean of e^Z within `radius` of the law of `record`: the largest returns are cut off at a cap.
fn least_mean(record: &[f64], radius: f64) -> f64 {
    let mean = |of: &dyn Fn(f64) -> f64| record.iter().map(|&z| of(z)).sum::<f64>() / record.len() as f64;
    let (mut low, mut high) = (-10.0, 10.0);
    for _ in 0..100 {
        let cap = f64::midpoint(low, high);
        if mean(&|z| (z - cap).max(0.0)) > radius { low = cap } else { high = cap }
    }
    mean(&|z| z.min(low).exp())
}

/// Without trading costs something is held exactly where the worst law's mean of e^Z is above the bank's.
#[tokio::test(flavor = "multi_thread")]
async fn the_premium_is_the_one_at_which_the_worst_mean_is_the_banks() {
    let app = App::start().await;
    let mean = HISTORY.iter().map(|z| z.exp()).sum::<f64>() / 12.0;
    let (mut later, mut sides) = (0, [0, 0]);
    for (scale, rate) in [(0.5, 0.002), (1.0, 0.002), (1.0, 0.0), (1.5, 0.006), (1.0, 0.01), (1.0, 0.012), (0.4, 0.02)]
    {
        let radius = json!({ "rule": "bridge", "alpha": 0.5, "paths": 300, "scale": scale });
        let utility = json!({ "kind": "power", "risk_aversion": 4.0 });
        let problem = json!({ "history": HISTORY, "utility": utility, "radius": radius, "rate_per_step": rate });
        let advised = advise(&app, &json!({ "problem": problem, "sensitivity": true })).await;
        let (premium, radius) = (&advised["sensitivity"]["premium"], number(&advised["radius"]));
        let bank: f64 = 1.0 + rate;
        let worst = least_mean(&HISTORY, radius);
        assert!((number(&premium["present"]) - (mean - bank)).abs() < 1e-15);
        let needed = number(&premium["needed"]);
        // The resolution, and as much for what the investor holds before it counts as holding.
        assert!((needed - (mean * bank / worst - bank)).abs() < 2.1 * RESOLUTION, "{advised}");
        let invested = worst > bank;
        assert_eq!(invested, number(&advised["allocation"]) > 0.0, "{advised}");
        sides[usize::from(invested)] += 1;
        let leaves = |more: u32| least_mean(&HISTORY, radius * (12.0 / (12.0 + f64::from(more))).sqrt()) > bank;
        let expected = if invested { Some(0) } else { (1..=10_000).find(|&more| leaves(more)) };
        let found = premium["periods_more"].as_u64().map(|more| more as u32);
        assert_eq!(found, expected, "{advised}");
        later += u32::from(found.is_some_and(|found| found > 0));
    }
    assert!(later >= 2 && sides.iter().all(|count| *count >= 2), "{later} {sides:?}");
}

fn told_by(advisor: &Advisor, step: usize, state: &State, mode: AdviceMode) -> f64 {
    advisor.advise(step, state, mode).allocation
}

/// A session asks its policy, at the period it is in; in the last one too.
#[test]
fn a_session_is_as_sensitive_as_its_policy_says() {
    let mut request = specification(3);
    request["problem"]["radius"]["scale"] = json!(0.2);
    let advisor = policies::advisor(request.clone());
    let history: Vec<f64> = serde_json::from_value(request["problem"]["history"].clone()).unwrap();
    for (observed, mode) in [(0, AdviceMode::Surrogate), (2, AdviceMode::Surrogate), (1, AdviceMode::Resolve)] {
        let record = [&history[..], &[0.012, -0.02][..observed]].concat();
        let of = |record: &[f64]| State { wealth: 90.0, holding: 0.2, law: EmpiricalDistribution::new(record) };
        let state = of(&record);
        let advice = advisor.advise(observed, &state, mode);
        let found = advisor.sensitivity(observed, &state, &record, (&advice, mode));
        let without = |index: usize| {
            let rest = [&record[..index], &record[index + 1..]].concat();
            told_by(&advisor, observed, &of(&rest), mode)
        };
        let range = found.without_one.unwrap();
        let again: Vec<f64> = (0..record.len()).map(without).collect();
        assert_eq!(range.lowest.allocation, again.iter().copied().fold(f64::INFINITY, f64::min));
        assert_eq!(range.highest.allocation, again.iter().copied().fold(0.0, f64::max));
        assert_eq!(again[range.lowest.index], range.lowest.allocation);
        let next = [found.next_return.low, found.next_return.high];
        for supposed in next {
            let longer = of(&[&record[..], &[supposed.log_return]].concat());
            assert_eq!(supposed.allocation, told_by(&advisor, observed, &longer, mode));
        }
        assert!(next[0].allocation != next[1].allocation, "the test shows nothing: {found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_action_of_one_period_is_as_sensitive_as_the_advice_without_a_policy() {
    let mut app = App::start().await;
    let mut problem = problems()[0].clone();
    problem["horizon"] = json!(1);
    app.train(&json!({ "problem": problem, "design": { "count": 20 } })).await;
    app.open_with(json!({ "holding": 0.1 })).await;
    let path = format!("/action?session={}&sensitivity=true", app.session);
    let advised = advise(&app, &json!({ "problem": problem, "holding": 0.1, "sensitivity": true })).await;
    for query in ["&mode=resolve", "&explain=worst_case"] {
        let (status, action) = app.get(&format!("{path}{query}")).await;
        assert_eq!(status, 200, "{action}");
        assert_eq!((&action["sensitivity"], &action["caution"]), (&advised["sensitivity"], &advised["caution"]));
        assert_eq!(action["worst_case"].is_null(), query == "&mode=resolve");
    }
    // What is not asked for is not told, and the session stays as it is.
    let (_, plain) = app.action().await;
    assert_eq!((plain.get("sensitivity"), plain["caution"][0]["code"].as_str()), (None, Some("short_record")));
    assert_eq!(app.get(&format!("/sessions/{}", app.session)).await.1["period"], 1);
    // After a return the record is longer by it, and its index is the last.
    app.observe(1, 0.2).await;
    assert_eq!(app.get(&path).await.0, 409);
}

/// Returns of US stocks in the `count` months from the one that starts with `first` on, and the bank's mean rate.
fn months(first: &str, count: usize) -> Vec<f64> {
    let text = include_str!("../../data/us_market_monthly.csv");
    let rows = text.lines().skip_while(|line| !line.starts_with(first)).take(count);
    let simple = rows.map(|line| line.split(',').nth(1).unwrap().parse::<f64>().unwrap());
    simple.map(f64::ln_1p).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn who_may_read_may_ask_how_near_it_is() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    let problem = json!({ "rate_per_step": 0.002, "history": HISTORY });
    let path = format!("/action?session={}&sensitivity=true", app.session);
    let (_, own) = app.get(&path).await;
    let [north, south] = [app.key("default", "read").await, app.key("south", "read").await];
    app.restart().await;
    for (held, statuses) in [(north.as_str(), (200, 200)), (&south, (200, 404)), ("", (401, 401))] {
        app.hold(held);
        let advised = app.post("/advise", &json!({ "problem": problem, "sensitivity": true })).await.0;
        let (status, action) = app.get(&path).await;
        assert_eq!((advised.as_u16(), status.as_u16()), statuses, "{held}");
        assert!(status != 200 || action["sensitivity"] == own["sensitivity"]);
    }
}

fn codes(answer: &Value) -> Vec<&str> {
    answer["caution"].as_array().unwrap().iter().map(|caution| caution["code"].as_str().unwrap()).collect()
}

/// Ten years of months, of which a single one decides.
#[tokio::test(flavor = "multi_thread")]
async fn a_record_of_ten_years_may_hang_on_one_month() {
    let app = App::start().await;
    let record = months("1962-07", 120);
    let problem = json!({ "history": record, "rate_per_step": 0.002, "caution": "paper",
        "support": { "rule": "none" }, "utility": { "kind": "exponential", "risk_aversion": 0.01 } });
    let advised = advise(&app, &json!({ "problem": problem, "sensitivity": true })).await;
    let range = &advised["sensitivity"]["without_one"];
    let allocation = number(&advised["allocation"]);
    assert!(allocation > 0.5 && allocation < 0.9, "{advised}");
    assert_eq!(
        [&range["lowest"]["allocation"], &range["highest"]["allocation"]],
        [&json!(0.0), &json!(1.0)],
        "{range}"
    );
    assert_eq!(codes(&advised), ["one_return"]);
    let sentence = advised["caution"][0]["sentence"].as_str().unwrap();
    // Without either of the best two all is in the bank.
    assert!(sentence.contains("Without the return of 8.6 % the advice would be 0.0 %"), "{sentence}");
    // Not asked, it is not known.
    assert_eq!(codes(&advise(&app, &json!({ "problem": problem })).await), [""; 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_short_record_is_said_to_be_short_and_a_steady_one_is_not_said_to_hang_on_a_return() {
    let app = App::start().await;
    // An advice of 0 that nothing near moves.
    for (count, expected) in [(23, vec!["short_record"]), (24, vec![])] {
        let record: Vec<f64> = (0..count).map(|index| if index % 2 == 0 { -0.02 } else { 0.01 }).collect();
        let question = json!({ "problem": { "rate_per_step": 0.002, "history": record, "radius": { "rule": "root_n", "kappa": 0.01 } }, "sensitivity": true });
        let advised = advise(&app, &question).await;
        assert_eq!((codes(&advised), &advised["allocation"]), (expected, &json!(0.0)));
        let sensitivity = &advised["sensitivity"];
        // Two returns apart by 0.03 leave two records, of which the first of each is told.
        assert_eq!(sensitivity["without_one"]["lowest"]["index"], 0);
        assert_eq!(sensitivity["next_return"]["to_bank"], Value::Null);
    }
    // Without the third nothing varies.
    let three = json!({ "problem": { "rate_per_step": 0.002, "history": [0.01, 0.01, 0.03] }, "sensitivity": true });
    assert_ne!(advise(&app, &three).await["sensitivity"]["without_one"]["lowest"]["index"], 2);
    let two = json!({ "problem": { "rate_per_step": 0.002, "history": [0.01, 0.03] }, "sensitivity": true });
    assert_eq!(advise(&app, &two).await["sensitivity"]["without_one"], Value::Null);
    // A radius that no number of returns makes narrower.
    let fixed = json!({ "problem": { "rate_per_step": 0.002, "history": HISTORY, "radius": { "rule": "fixed", "radius": 0.05 } }, "sensitivity": true });
    assert_eq!(advise(&app, &fixed).await["sensitivity"]["premium"]["periods_more"], Value::Null);
}

/// Leaves out 360 of 480 months in turn, whose range is that of leaving out every one; with as many bridges as there may be, few of the
/// days are left out.
#[tokio::test(flavor = "multi_thread")]
async fn records_of_any_length_are_told_and_the_range_is_that_of_every_return() {
    let app = App::start().await;
    let bridge = |paths: usize, scale: f64| json!({ "rule": "bridge", "alpha": 0.1, "paths": paths, "scale": scale });
    for (first, learning) in
        [("1926-07", json!({ "kind": "equal" })), ("1970-01", json!({ "kind": "decay", "half_life": 90.0 }))]
    {
        let record = months(first, 480);
        let problem = json!({ "rate_per_step": 0.003, "history": record, "learning": learning, "radius": bridge(100, 0.3),
            "utility": { "kind": "power", "risk_aversion": 6.0 } });
        let advised = advise(&app, &json!({ "problem": problem, "holding": 0.1, "sensitivity": true })).await;
        let range = &advised["sensitivity"]["without_one"];
        assert_eq!(range["tried"], 360, "{range}");
        let (mut lowest, mut highest, of_record) = (f64::INFINITY, f64::NEG_INFINITY, by_record(&problem));
        for index in 0..record.len() {
            let rest = [&record[..index], &record[index + 1..]].concat();
            let without = of_record(&rest);
            (lowest, highest) = (lowest.min(without), highest.max(without));
        }
        assert!(
            lowest > 0.0 && highest < 1.0 && highest - lowest > 0.005,
            "the test shows nothing: {lowest} {highest}"
        );
        let [low, high] = ["lowest", "highest"].map(|end| number(&range[end]["allocation"]));
        assert!(
            (low - lowest).abs().max((high - highest).abs()) < 0.01 * (highest - lowest),
            "{range} {lowest} {highest}"
        );
    }
    let days: Vec<f64> = (0..3000).map(|day| 0.0004 + 0.01 * (1.7 * f64::from(day)).sin()).collect();
    let problem = json!({ "rate_per_step": 0.0001, "history": days, "radius": bridge(9000, 1.0) });
    let advised = advise(&app, &json!({ "problem": problem, "sensitivity": true })).await;
    let tried = number(&advised["sensitivity"]["without_one"]["tried"]);
    assert!((32.0..=40.0).contains(&tried), "{tried}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_would_take_seconds_or_say_nothing_is_refused_by_name() {
    let mut app = App::start().await;
    let normal =
        json!({ "kind": "gaussian_mixture", "components": [{ "weight": 1.0, "mean": 0.0, "variance": 0.01 }] });
    for (problem, rule) in [(
        json!({ "rate_per_step": 0.002, "history": HISTORY, "framework": "known_law", "law": normal }),
        "under the framework known_law",
    )] {
        let (status, refused) = app.post("/advise", &json!({ "problem": problem, "sensitivity": true })).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("sensitivity")), "{refused}");
        assert!(refused["rule"].as_str().unwrap().contains(rule), "{refused}");
        assert_eq!(app.post("/advise", &json!({ "problem": problem })).await.0, 200);
    }
    let mut request = specification(2);
    request["problem"]["framework"] = json!("static");
    app.train(&request).await;
    app.open().await;
    let path = format!("/action?session={}&sensitivity", app.session);
    let (status, refused) = app.get(&format!("{path}=true")).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("sensitivity")), "{refused}");
    assert_eq!(app.get(&format!("{path}=false")).await.0, 200);
    let (status, refused) = app.get(&format!("{path}=perhaps")).await;
    assert_eq!((status.as_u16(), &refused["field"]), (400, &json!("sensitivity")), "{refused}");
}
