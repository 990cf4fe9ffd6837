//! Spending: closed forms where the law is known or does not matter, and brute force where it is in a ball.

use ballast::control::policy::advice::Advice;
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::problem::spending::PeriodSpending;
use ballast::control::problem::state::State;
use ballast::control::request::learning::Learning;
use ballast::control::request::specification::ProblemSpecification;
use ballast::control::request::spending::Spending;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::support::policies::advisor;

const HISTORY: [f64; 8] = [0.061, -0.034, 0.052, 0.013, -0.041, 0.083, -0.022, 0.037];

fn advice(solved: &Advisor, step: usize, history: &[f64], wealth: f64) -> Advice {
    let state = State::new(history, wealth, Learning::default()).unwrap();
    solved.advise(step, &state, AdviceMode::Surrogate)
}

fn share(advice: &Advice) -> f64 {
    advice.spending.unwrap().share
}

/// Under log utility the share spent depends on no law and no radius: with weights b of each later period, and wealth at
/// the horizon that counts as one more, it is (1 - b) / (1 - b^(T - t + 1)) of any wealth.
#[test]
fn log_utility_spends_by_the_closed_form_at_every_state() {
    let (discount, horizon) = (0.9_f64, 4);
    for framework in ["adaptive", "static", "plug_in", "parametric_adaptive"] {
        let mut request = json!({
            "problem": { "framework": framework, "horizon": horizon, "history": HISTORY, "utility": { "kind": "log" },
                "rate_per_step": 0.002, "spending": { "discount": discount } },
            "design": { "count": 40 } });
        if framework != "parametric_adaptive" {
            request["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.01 });
        }
        let solved = advisor(request);
        let mut seen = HISTORY.to_vec();
        for step in 0..horizon {
            let left = i32::try_from(horizon - step).unwrap();
            let expected = (1.0 - discount) / (1.0 - discount.powi(left + 1));
            for wealth in [1.0, 250.0] {
                let found = advice(&solved, step, &seen, wealth);
                assert!((share(&found) - expected).abs() < 1e-14, "{framework} {step}: {} {expected}", share(&found));
                assert!((found.spending.unwrap().amount - wealth * expected).abs() < 1e-12 * wealth);
            }
            if !["static"].contains(&framework) {
                seen.push([0.02, -0.05, 0.07, 0.01][step]);
            }
        }
    }
}

/// Samuelson (1969): with a known law the allocation is that of one period at every date, and the share spent follows by
/// 1 / c_t = 1 + (b R)^(1 / eta) / c_(t+1), R the mean of the best growth to the power 1 - eta, c_T = 1.
#[test]
fn a_known_law_spends_by_samuelsons_recursion() {
    let (up, down, rate) = (0.25_f64, -0.12_f64, 0.01_f64);
    let (discount, inflation, horizon) = (0.97_f64, 0.02_f64, 30);
    for eta in [1.5_f64, 3.0, 8.0] {
        let moment = |share: f64| {
            let growth = |z: f64| (1.0 - share) * (1.0 + rate) + share * z.exp();
            0.5 * (growth(up).powf(1.0 - eta) + growth(down).powf(1.0 - eta))
        };
        // The best share is the least moment, on a grid and then by thirds.
        let (mut low, mut high) = (0.0, 1.0);
        while high - low > 1e-12 {
            let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if moment(left) < moment(right) { high = right } else { low = left }
        }
        let held = 0.5 * (low + high);
        // A rise of prices makes later money worth less: the weight of money is b (1 + i)^(eta - 1).
        let weight = discount * (1.0 + inflation).powf(eta - 1.0) * moment(held);
        let mut expected = vec![1.0];
        for _ in 0..horizon {
            let after = expected.last().unwrap();
            expected.push(1.0 / (1.0 + weight.powf(1.0 / eta) / after));
        }
        expected.reverse();
        let solved = advisor(json!({
            "problem": { "framework": "static", "horizon": horizon, "history": [up, down], "rate_per_step": rate,
                "radius": { "rule": "fixed", "radius": 0.0 }, "utility": { "kind": "power", "risk_aversion": eta },
                "spending": { "discount": discount, "inflation": inflation } } }));
        for (step, expected) in expected[..horizon].iter().enumerate() {
            let found = advice(&solved, step, &[up, down], 100.0);
            // The search for the action stops at 1e-7, and the moment is flat there.
            assert!((found.allocation - held).abs() < 1e-5, "{eta} {step}: {} {held}", found.allocation);
            assert!((share(&found) / expected - 1.0).abs() < 1e-9, "{eta} {step}: {found:?} {expected}");
        }
        // The worth is the sure level that has the same utility: c_0^-eta is the utility of one unit of wealth.
        let weights: f64 = (0..=horizon).map(|period| discount.powi(period as i32)).sum();
        let level = (expected[0].powf(-eta) / weights).powf(1.0 / (1.0 - eta));
        let found = advice(&solved, 0, &[up, down], 100.0).certainty_equivalent;
        assert!((found / (100.0 * level) - 1.0).abs() < 1e-9, "{eta}: {found} {level}");
    }
}

/// Merton (1969): in the limit of short periods and a far horizon, wealth (1 - c) of which is kept, an investor with
/// patience rho spends (rho - (1 - eta) (r + m^2 / (2 eta s^2))) / eta of wealth a year, m the premium and s the
/// deviation.
#[test]
fn short_periods_spend_as_mertons_investor_does() {
    let (rho, rate, premium, deviation, eta) = (0.06_f64, 0.02_f64, 0.04_f64, 0.2_f64, 3.0_f64);
    let expected = (rho - (1.0 - eta) * (rate + premium * premium / (2.0 * eta * deviation * deviation))) / eta;
    let errors = [1.0, 4.0].map(|periods_per_year: f64| {
        let step = 1.0 / periods_per_year;
        let (up, down) = (
            rate * step + premium * step + deviation * step.sqrt(),
            rate * step + premium * step - deviation * step.sqrt(),
        );
        let history = [up.ln_1p(), down.ln_1p()];
        let solved = advisor(json!({
            "problem": { "framework": "static", "horizon": 500, "history": history, "rate_per_step": rate * step,
                "radius": { "rule": "fixed", "radius": 0.0 }, "utility": { "kind": "power", "risk_aversion": eta },
                "spending": { "discount": (-rho * step).exp() } } }));
        share(&advice(&solved, 0, &history, 1.0)) / step - expected
    });
    // The error falls with the length of a period.
    assert!(errors[0].abs() < 0.004 && errors[1].abs() < 0.3 * errors[0].abs() + 5e-5, "{errors:?} of {expected}");
}

/// Two periods against the worst law in a ball, by brute force: moves of the mass to a fine grid, priced by the dual of
/// the budget for moves, at actions and shares spent on grids that close in on the best.
struct BruteForce {
    radius: f64,
    ends: [f64; 2],
    grid: usize,
    rate: f64,
    eta: f64,
    weight: f64,
    learns: bool,
}

/// Maximises a function that rises and then falls, from `low` to `high`.
fn highest(low: f64, high: f64, tolerance: f64, of: &dyn Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (low, high);
    while high - low > tolerance {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if of(left) < of(right) { low = left } else { high = right }
    }
    of(0.5 * (low + high))
}

impl BruteForce {
    /// The utility of a unit of wealth with `periods` to go, and the best share spent.
    fn value(&self, history: &[f64], periods: usize) -> (f64, f64) {
        let utility = |level: f64| level.powf(1.0 - self.eta) / (1.0 - self.eta);
        if periods == 0 {
            return (utility(1.0), 0.0);
        }
        let moves: Vec<f64> = (0..=self.grid)
            .map(|place| self.ends[0] + (self.ends[1] - self.ends[0]) * place as f64 / self.grid as f64)
            .chain(history.iter().copied())
            .collect();
        let after: Vec<f64> = moves
            .iter()
            .map(|&z| {
                let learned = if self.learns { [history, &[z]].concat() } else { history.to_vec() };
                self.value(&learned, periods - 1).0
            })
            .collect();
        let worst = |held: f64| {
            let priced: Vec<f64> = moves
                .iter()
                .zip(&after)
                .map(|(z, after)| ((1.0 - held) * (1.0 + self.rate) + held * z.exp()).powf(1.0 - self.eta) * after)
                .collect();
            let dual = |multiplier: f64| {
                let least = |from: f64| {
                    let price = |(z, priced): (&f64, &f64)| priced + multiplier * f64::abs(z - from);
                    moves.iter().zip(&priced).map(price).fold(f64::INFINITY, f64::min)
                };
                history.iter().map(|&from| least(from)).sum::<f64>() / history.len() as f64 - multiplier * self.radius
            };
            highest(0.0, 20.0, 1e-3, &dual)
        };
        let left = highest(0.0, 1.0, 5e-4, &worst);
        // The share spent: utility now, and the rest to the power 1 - eta times the value of a unit left.
        let total = |spent: f64| utility(spent) + self.weight * (1.0 - spent).powf(1.0 - self.eta) * left;
        let value = highest(1e-4, 1.0 - 1e-4, 1e-7, &total);
        let best = (-value * (self.eta - 1.0)).powf(-1.0 / self.eta);
        (value, best)
    }
}

#[test]
fn two_periods_against_a_ball_agree_with_brute_force() {
    let history = [0.12, -0.09, 0.21, 0.03];
    let (rate, weight, eta, radius) = (0.01, 0.95, 2.5, 0.025);
    for (framework, learns) in [("static", false), ("adaptive", true)] {
        let solved = advisor(json!({
            "problem": { "framework": framework, "horizon": 2, "history": history, "rate_per_step": rate,
                "radius": { "rule": "fixed", "radius": radius }, "support": { "rule": "between", "min": -0.3, "max": 0.4 },
                "utility": { "kind": "power", "risk_aversion": eta }, "spending": { "discount": weight } },
            "design": { "count": 300 } }));
        let found = advice(&solved, 0, &history, 1.0);
        let ends = [-0.3, 0.4];
        let (value, spent) = BruteForce { radius, ends, grid: 40, rate, eta, weight, learns }.value(&history, 2);
        let weights = 1.0 + weight + weight * weight;
        let level = (value * (1.0 - eta) / weights).powf(1.0 / (1.0 - eta));
        let off = 1e4 * (found.certainty_equivalent / level).ln();
        // The grid of moves and the surrogate of the second period are each good to some tenths of a basis point.
        assert!(off.abs() < 1.0, "{framework}: {off} bp of {level}");
        assert!((share(&found) - spent).abs() < 1e-4, "{framework}: {} {spent}", share(&found));
        assert!(found.allocation > 0.05 && found.allocation < 0.95, "{framework}: {found:?}");
    }
}

fn random_problem(random: &mut impl RngExt) -> ProblemSpecification {
    let horizon = random.random_range(1..12);
    let lowest: f64 = random.random_range(-0.3..0.4_f64).max(0.0);
    let survival =
        (random.random::<f64>() < 0.5).then(|| (0..horizon).map(|_| random.random_range(0.001..=1.0)).collect());
    let spending = Spending {
        lowest,
        highest: if random.random::<f64>() < 0.5 { 1.0 } else { random.random_range(lowest.max(1e-6)..=1.0) },
        discount: random.random_range(0.5..=1.5),
        inflation: random.random_range(-0.2..=0.2),
        survival,
        bequest: 10.0_f64.powf(random.random_range(-6.0..=6.0)),
        ..Spending::default()
    };
    let eta = if random.random::<f64>() < 0.3 { 1.0 } else { 1.0 + 99.0 * random.random::<f64>().powi(3) + 1e-9 };
    let mut problem: ProblemSpecification = serde_json::from_value(json!({
        "horizon": horizon, "history": HISTORY, "rate_per_step": random.random_range(-0.5..=0.5),
        "utility": if eta == 1.0 { json!({ "kind": "log" }) } else { json!({ "kind": "power", "risk_aversion": eta }) } }))
    .unwrap();
    problem.spending = Some(spending.into());
    problem
}

/// Over all that is legal: the share keeps its bounds, nothing within them is worth more, a gain of nothing is none, and
/// the slope is the derivative.
#[test]
fn the_share_spent_is_the_best_within_its_bounds() {
    let mut random = ChaCha8Rng::seed_from_u64(0x5e4d);
    for _ in 0..2000 {
        let problem = random_problem(&mut random);
        let (spending, eta) = (
            problem.spending.clone().unwrap(),
            match problem.utility {
                ballast::control::request::specification::UtilitySpecification::Power { risk_aversion } => {
                    risk_aversion
                }
                _ => 1.0,
            },
        );
        let periods = PeriodSpending::of(&problem);
        let mut weight = spending.bequest;
        for (step, period) in periods.iter().enumerate().rev() {
            weight = 1.0 + spending.weight_after(step) * weight;
            assert!(period.gain(0.0).abs() == 0.0);
            let left: f64 = random.random_range(0.0..2.0);
            let gain = period.gain(left);
            let share = period.share(gain);
            assert!((spending.lowest..=spending.highest).contains(&share) && (0.0..=left + 1e-12).contains(&gain));
            let around = (period.gain(left + 1e-6) - period.gain(left - 1e-6)) / 2e-6;
            assert!((around - period.slope(left)).abs() < 1e-5, "{problem:?} {step}: {around} {}", period.slope(left));
            // The worth of a unit left in the bank is that of the next period, or 1 at the horizon.
            let next = periods.get(step + 1).map_or(0.0, |next| next.safe_worth().ln());
            let rest = problem.rate_per_step.ln_1p() - spending.inflation.ln_1p() + next + left;
            let worth = |spent: f64| {
                let logs = [spent.ln(), (1.0 - spent).ln() + rest];
                let weights = [1.0 / weight, 1.0 - 1.0 / weight];
                if eta == 1.0 {
                    return weights[0] * logs[0] + weights[1] * logs[1];
                }
                let powers = [0, 1].map(|index| weights[index].ln() + (1.0 - eta) * logs[index]);
                let largest = powers[0].max(powers[1]);
                (largest + powers.map(|power| (power - largest).exp()).iter().sum::<f64>().ln()) / (1.0 - eta)
            };
            let best = period.safe_worth().ln() + gain;
            // The logarithm of a sum near 1 is divided by the power here.
            let rounding = 1e-9 + if eta == 1.0 { 0.0 } else { 1e-14 / (eta - 1.0) };
            for place in 0..=40 {
                let spent = spending.lowest + (spending.highest - spending.lowest) * f64::from(place) / 40.0;
                if spent > 0.0 && spent < 1.0 {
                    let other = worth(spent);
                    assert!(
                        other <= best + rounding * (1.0 + best.abs()),
                        "{problem:?} {step}: {spent} {other} {share} {best}"
                    );
                }
            }
        }
    }
}

/// A problem with spending may not have what spending excludes.
#[test]
fn what_spending_excludes_is_refused() {
    let faults: [(&str, Value, &str); 13] = [
        ("utility", json!({ "kind": "exponential", "risk_aversion": 0.01 }), "problem.utility.kind"),
        ("trading_cost", json!(0.01), "problem.trading_cost"),
        ("contributions", json!(1.0), "problem.contributions"),
        ("spending", json!({ "lowest": 0.3, "highest": 0.2 }), "problem.spending.highest"),
        ("spending", json!({ "discount": 0.4 }), "problem.spending.discount"),
        ("spending", json!({ "inflation": 0.3 }), "problem.spending.inflation"),
        ("spending", json!({ "survival": [1.0] }), "problem.spending.survival"),
        ("spending", json!({ "survival": [1.0, 0.0] }), "problem.spending.survival[1]"),
        ("spending", json!({ "bequest": 0.0 }), "problem.spending.bequest"),
        ("spending", json!({ "secured": -1.0 }), "problem.spending.secured"),
        // The wealth of 100 pays for two periods, the first at once.
        ("spending", json!({ "secured": 50.0 }), "problem.spending.secured"),
        ("spending", json!({ "secured": 30.0, "secured_left": 40.0 }), "problem.spending.secured"),
        ("spending", json!({ "secured_left": 100.0 }), "problem.spending.secured_left"),
    ];
    for (field, value, named) in faults {
        let mut request = json!({ "problem": {
            "horizon": 2, "history": HISTORY, "rate_per_step": 0.0, "spending": {} } });
        request["problem"][field] = value;
        let specification: ballast::control::request::specification::Specification =
            serde_json::from_value(request).unwrap();
        assert_eq!(specification.completed().unwrap_err().field, named);
    }
}

/// Merton (1971), section 6, and Black and Perold (1992): with a known law and utility of what exceeds a floor, a fixed
/// multiple of the cushion is held, wealth above what the floor costs in the bank. The multiple is the share of one
/// period without a floor.
#[test]
fn a_known_law_holds_a_constant_multiple_of_the_cushion() {
    let (up, down, rate, eta, horizon) = (0.25_f64, -0.12_f64, 0.01_f64, 4.0_f64, 10);
    // The derivative of the mean utility of growth is 0 at the best share: a ratio of marginal utilities in closed form.
    let excess = [up, down].map(|z| z.exp() - 1.0 - rate);
    let ratio = (excess[0] / -excess[1]).powf(1.0 / eta);
    let multiple = (1.0 + rate) * (ratio - 1.0) / (excess[0] - ratio * excess[1]);
    let (level, left, inflation) = (1.5, 30.0, 0.02_f64);
    let solved = advisor(json!({
        "problem": { "framework": "static", "horizon": horizon, "history": [up, down], "rate_per_step": rate,
            "radius": { "rule": "fixed", "radius": 0.0 }, "utility": { "kind": "power", "risk_aversion": eta },
            "spending": { "secured": level, "secured_left": left, "inflation": inflation, "highest": 1e-6 } } }));
    for step in 0..horizon {
        let nominal = |period: usize| (1.0 + inflation).powi(period as i32);
        let discount = |period: usize| (1.0 + rate).powi(-((period - step) as i32));
        let paid: f64 = (step..horizon).map(|period| level * nominal(period) * discount(period)).sum();
        let reserve = paid + left * nominal(horizon) * discount(horizon);
        for wealth in [reserve * 1.0001, reserve + 20.0, 500.0, 1e6] {
            let found = advice(&solved, step, &[up, down], wealth);
            let spending = found.spending.unwrap();
            assert!((spending.reserve / reserve - 1.0).abs() < 1e-12, "{step}: {spending:?} {reserve}");
            let cushion = (wealth - reserve) * (1.0 - 1e-6);
            let held = found.allocation * (wealth - spending.amount);
            // The search for the action stops at 1e-7.
            assert!((held / cushion - multiple).abs() < 1e-5, "{step} {wealth}: {held} {cushion} {multiple}");
        }
    }
}

/// Whatever is legal and whatever returns do, a total loss in every period too, what is secured is spent and left.
#[test]
fn no_return_touches_what_is_secured() {
    let mut random = ChaCha8Rng::seed_from_u64(0xf1008);
    for _ in 0..60 {
        let mut problem = random_problem(&mut random);
        problem.framework = serde_json::from_value(json!("static")).unwrap();
        problem.initial_wealth = 10.0_f64.powf(random.random_range(-3.0..6.0));
        problem.radius =
            serde_json::from_value(json!({ "rule": "fixed", "radius": random.random_range(0.0..0.05) })).unwrap();
        let mut spending = *problem.spending.clone().unwrap();
        let whole = Spending { secured: 1.0, secured_left: random.random_range(0.0..20.0), ..spending.clone() };
        let [_, reserve] = whole.reserves(problem.rate_per_step, problem.horizon)[0];
        let unit = problem.initial_wealth / reserve * random.random_range(0.01..0.999);
        (spending.secured, spending.secured_left) = (unit, unit * whole.secured_left);
        problem.spending = Some(spending.clone().into());
        let solved = advisor(json!({ "problem": problem }));
        for loses in [false, true] {
            let mut state = State::new(&HISTORY, problem.initial_wealth, Learning::default()).unwrap();
            for step in 0..problem.horizon {
                let prices = (1.0 + spending.inflation).powi(step as i32);
                let found = solved.advise(step, &state, AdviceMode::Surrogate);
                let spent = found.spending.unwrap().amount;
                assert!(spent >= spending.secured * prices * (1.0 - 1e-9), "{problem:?} {step}: {found:?}");
                let moved = if loses { f64::NEG_INFINITY } else { random.random_range(-1.0..1.0) };
                state = solved.advance(step, &state, &found.followed(moved));
            }
            let floor = spending.secured_left * (1.0 + spending.inflation).powi(problem.horizon as i32);
            // Rounding of what stays in the bank, in every period.
            let rounding = 1e-9 * problem.initial_wealth * (1.0 + problem.rate_per_step).powi(problem.horizon as i32);
            assert!(state.wealth >= floor - rounding, "{problem:?} {}: {floor}", state.wealth);
        }
    }
}

/// Two periods with floors against the worst law in a ball, by brute force over spending, holding and moves of the mass,
/// with the value of the second period on a grid of wealth.
#[test]
fn floors_against_a_ball_agree_with_brute_force() {
    let (rate, eta, weight, radius) = (0.01_f64, 2.5_f64, 0.95_f64, 0.025_f64);
    let (level, left) = (20.0, 40.0);
    let ends = [-0.3, 0.4];
    let history = [0.12, -0.09, 0.21, 0.03];
    let moves: Vec<f64> =
        (0..=28).map(|place| ends[0] + (ends[1] - ends[0]) * f64::from(place) / 28.0).chain(history).collect();
    let growths: Vec<f64> = moves.iter().map(|z| z.exp()).collect();
    let utility = |level: f64| if level > 0.0 { level.powf(1.0 - eta) / (1.0 - eta) } else { f64::NEG_INFINITY };
    // The worst mean of a value after a period, if `held` is held of `wealth`.
    let worst = |wealth: f64, held: f64, value: &dyn Fn(f64) -> f64| {
        let values: Vec<f64> =
            growths.iter().map(|growth| value(wealth * ((1.0 - held) * (1.0 + rate) + held * growth))).collect();
        if values.iter().any(|value| !value.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let dual = |multiplier: f64| {
            let least = |from: f64| {
                let price = |(z, value): (&f64, &f64)| value + multiplier * f64::abs(z - from);
                moves.iter().zip(&values).map(price).fold(f64::INFINITY, f64::min)
            };
            history.iter().map(|&from| least(from)).sum::<f64>() / history.len() as f64 - multiplier * radius
        };
        // In units of the utility at this wealth.
        let scale = wealth * f64::abs(value(wealth * 1.05) - value(wealth * 0.999)) / (0.051 * wealth) + 1e-30;
        highest(0.0, 20.0 * scale, 1e-3 * scale, &dual)
    };
    let best = |wealth: f64, value: &dyn Fn(f64) -> f64, reserve: f64| {
        let of_spending = |spent: f64| {
            let kept = wealth - spent;
            // The reserve is kept through a total loss, which lies beyond this support.
            let most = (1.0 - reserve / kept).max(0.0);
            let held = highest(0.0, most, 1e-3, &|held| worst(kept, held, value));
            utility(spent - level) + weight * held
        };
        highest(level + 1e-3, wealth - reserve - 1e-3, 1e-3 * (wealth - reserve - level), &of_spending)
    };
    let last = |wealth: f64| utility(wealth - left);
    let reserve = left / (1.0 + rate);
    // The value of the second period as a level of utility, on a grid that is dense near the floor.
    let floor = level + reserve;
    let grid: Vec<f64> = (0..=40).map(|place| floor + 1.0 + 79.0 * (f64::from(place) / 40.0).powi(2)).collect();
    let levels: Vec<f64> =
        grid.iter().map(|&wealth| ((1.0 - eta) * best(wealth, &last, reserve)).powf(1.0 / (1.0 - eta))).collect();
    let second = |wealth: f64| {
        if wealth <= floor {
            return f64::NEG_INFINITY;
        }
        let place = grid.partition_point(|node| *node <= wealth).clamp(1, grid.len() - 1);
        let share = (wealth - grid[place - 1]) / (grid[place] - grid[place - 1]);
        utility((1.0 - share) * levels[place - 1] + share * levels[place])
    };
    let wealth = 120.0;
    let value = best(wealth, &second, floor / (1.0 + rate));
    let weights = 1.0 + weight + weight * weight;
    let expected = level + (value * (1.0 - eta) / weights).powf(1.0 / (1.0 - eta));
    let solved = advisor(json!({
        "problem": { "framework": "static", "horizon": 2, "history": history, "rate_per_step": rate, "initial_wealth": wealth,
            "radius": { "rule": "fixed", "radius": radius }, "support": { "rule": "between", "min": ends[0], "max": ends[1] },
            "utility": { "kind": "power", "risk_aversion": eta },
            "spending": { "discount": weight, "secured": level, "secured_left": left } } }));
    let found = advice(&solved, 0, &history, wealth);
    // The grids are good to some tenths of a basis point of the surplus.
    let off = 1e4 * ((found.certainty_equivalent - level) / (expected - level)).ln();
    assert!(off.abs() < 3.0, "{off} bp: {} {expected} {found:?}", found.certainty_equivalent);
}
