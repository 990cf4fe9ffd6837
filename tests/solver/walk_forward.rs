//! The walk-forward equals what a session would have done, and itself.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use ballast::control::cache::Cache;
use ballast::control::error::TrainError;
use ballast::control::evaluation::account::keep;
use ballast::control::evaluation::walk_forward::{ActualPeriod, Decision, Strategy, WalkForward};
use ballast::control::policy::advisor::Advisor;
use ballast::control::policy::one_period::OnePeriod;
use ballast::control::pool::TrainingPool;
use ballast::control::progress::Watch;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::framework::Framework;
use ballast::control::request::support::Support;
use ballast::control::training::Training;

const YEAR: usize = 4;
const WALK: WalkForward = WalkForward {
    window: 24,
    every: YEAR,
    horizon: YEAR,
    scale: 1.0,
    caution: CautionLevel::Paper,
    support: Support::None {},
    centre: CentreSpecification::Empirical {},
    risk_aversion: 3.0,
    trading_cost: 0.0,
    count: 20,
    seed: 5,
};

/// Returns that pay enough beyond the bank to be held at a wide level.
fn periods(count: usize) -> Vec<ActualPeriod> {
    let log_return = |k: usize| 0.02 + 0.03 * (1.7 * k as f64).sin();
    (0..count).map(|k| ActualPeriod { log_return: log_return(k), bank_return: 0.002 }).collect()
}

fn decide(walk: &WalkForward, strategies: &[Strategy], periods: &[ActualPeriod], threads: usize) -> Vec<Vec<Decision>> {
    let watch = Watch::unwatched();
    let solved = AtomicUsize::new(0);
    let pool = TrainingPool::new(threads).unwrap();
    let count = || {
        solved.fetch_add(1, Ordering::Relaxed);
    };
    let decisions = pool.install(|| walk.decide(strategies, periods, &watch, &count)).unwrap();
    // Progress moves with every step of a training, not only at its end.
    assert_eq!(solved.into_inner(), walk.steps(strategies, periods));
    decisions
}

/// With every centre: what is held through a year is what a session of the same policy is told.
#[test]
fn a_year_equals_the_session_that_lives_it() {
    let mut radii = Vec::new();
    for centre in [
        CentreSpecification::Empirical {},
        CentreSpecification::Smoothed { bandwidth: 0.02 },
        CentreSpecification::Mixed { law: None, history: Some(vec![-0.02, 0.05]), weight: 12.0 },
    ] {
        let walk = WalkForward { centre, ..WALK };
        for (strategy, framework, alpha) in [
            (Strategy::Adaptive { alpha: 0.9 }, Framework::Adaptive, 0.9),
            (Strategy::Static { alpha: 0.9 }, Framework::Static, 0.9),
            (Strategy::PlugIn, Framework::PlugIn, 0.1),
        ] {
            radii.push(lived_as_told(&walk, strategy, framework, alpha));
        }
    }
    // Smoothing moves no radius, 12 returns assumed beside 24 seen take a third of it.
    assert_eq!(radii[3], radii[0]);
    assert!((radii[6] / radii[0] - 2.0 / 3.0).abs() < 1e-12, "{radii:?}");
    let scaled = WalkForward { centre: CentreSpecification::VolatilityScaled { half_life: 3.0 }, scale: 0.5, ..WALK };
    let radius = lived_as_told(&scaled, Strategy::Static { alpha: 0.9 }, Framework::Static, 0.9);
    let whole = WalkForward { scale: 1.0, ..scaled };
    assert!(
        (lived_as_told(&whole, Strategy::Static { alpha: 0.9 }, Framework::Static, 0.9) / radius - 2.0).abs() < 1e-12
    );
}

/// The radius of the first period.
fn lived_as_told(walk: &WalkForward, strategy: Strategy, framework: Framework, alpha: f64) -> f64 {
    let periods = periods(walk.window + YEAR);
    let decisions = &decide(walk, &[strategy], &periods, 1)[0];
    let specification = walk.specification(framework, alpha, &periods[..walk.window]);
    let watch = Watch::unwatched();
    let advisor = Advisor::new(Training::new(&specification).unwrap().run(&watch).unwrap());
    let returns: Vec<f64> = periods[walk.window..].iter().map(|period| period.log_return).collect();
    let mut session = advisor.walk(advisor.initial_state(None, None).unwrap(), &returns);
    let advices: Vec<_> = session.by_ref().collect();
    let end = session.state;
    assert_eq!((decisions.len(), advices.len()), (YEAR, YEAR));
    for (decision, advice) in decisions.iter().zip(&advices) {
        let expected = Decision { band: advice.band, radius: advice.radius, source: Some(advice.source) };
        assert_eq!(*decision, expected);
    }
    assert!(decisions.iter().any(|decision| decision.band.high > 0.0), "{strategy:?} {:?} shows nothing", walk.centre);
    // The bank paid what the policy took it to pay, and nothing was charged.
    let bands = decisions.iter().map(|decision| decision.band);
    let account = keep(bands, &periods[walk.window..], 0.0, 100.0);
    assert_eq!(account.wealth.last(), Some(&end.wealth));
    decisions[0].radius
}

/// At the volatility of now, where every period has a policy of its own: as `/advise` tells of the window before.
#[test]
fn a_period_at_the_volatility_of_now_is_that_of_advice_alone() {
    let centre = CentreSpecification::VolatilityScaled { half_life: 3.0 };
    let walk = WalkForward { every: 1, horizon: 1, centre, ..WALK };
    let periods = periods(walk.window + YEAR);
    let decisions = &decide(&walk, &[Strategy::Adaptive { alpha: 0.9 }], &periods, 1)[0];
    for (start, decision) in decisions.iter().enumerate() {
        let past = &periods[start..start + walk.window];
        let specification = walk.specification(Framework::Adaptive, 0.9, past).completed().unwrap();
        let (advice, _) = OnePeriod::new(&specification, Cache::default()).resolved().advise(0.0).unwrap();
        assert!(
            (decision.band.high - advice.allocation).abs() < 1e-9 && decision.radius == advice.radius,
            "{decision:?} {advice:?}"
        );
    }
    assert!(decisions.iter().any(|decision| decision.band.high != decisions[0].band.high), "{decisions:?}");
}

#[test]
fn the_same_on_any_number_of_threads_and_blind_to_the_future() {
    let all = periods(WALK.window + 2 * YEAR + 2);
    let strategies = [Strategy::Adaptive { alpha: 0.9 }, Strategy::Mix { share: 0.6 }, Strategy::PlugIn];
    let decisions = decide(&WALK, &strategies, &all, 1);
    assert!(decisions.iter().all(|line| line.len() == 2 * YEAR + 2), "{decisions:?}");
    assert_eq!(decisions, decide(&WALK, &strategies, &all, 3));
    let mut other = all.clone();
    let changed = WALK.window + YEAR + 1;
    other[changed].log_return = -0.3;
    let changed_lines = decide(&WALK, &strategies, &other, 2);
    let until = changed + 1 - WALK.window;
    for (line, other) in decisions.iter().zip(&changed_lines) {
        assert_eq!(line[..until], other[..until]);
    }
    assert_ne!(decisions[0][until..], changed_lines[0][until..], "the change was never felt");
}

#[test]
fn a_stop_and_a_bad_past_are_errors() {
    let stopped = Watch { stop: &AtomicBool::new(true), progress: &|_| {} };
    let outcome = WALK.decide(&[Strategy::PlugIn], &periods(40), &stopped, &|| {});
    assert_eq!(outcome, Err(TrainError::Stopped));
    let constant = vec![ActualPeriod { log_return: 0.01, bank_return: 0.0 }; 40];
    let watch = Watch::unwatched();
    let refused = WALK.decide(&[Strategy::PlugIn], &constant, &watch, &|| {});
    assert!(
        matches!(&refused, Err(TrainError::Specification(field)) if field.field == "problem.history"),
        "{refused:?}"
    );
}
