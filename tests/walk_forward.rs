//! The walk-forward equals what a session would have done, and itself.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use ballast::control::error::TrainError;
use ballast::control::evaluation::account::keep;
use ballast::control::evaluation::rolling::{Decision, Period, Strategy, WalkForward};
use ballast::control::policy::advisor::Advisor;
use ballast::control::pool::TrainingPool;
use ballast::control::progress::Watch;
use ballast::control::request::framework::Framework;
use ballast::control::training::Training;

const YEAR: usize = 4;
const WALK: WalkForward =
    WalkForward { window: 24, every: YEAR, horizon: YEAR, risk_aversion: 3.0, trading_cost: 0.0, count: 20, seed: 5 };

/// Returns that pay enough beyond the bank to be held at a wide level.
fn periods(count: usize) -> Vec<Period> {
    let log_return = |k: usize| 0.02 + 0.03 * (1.7 * k as f64).sin();
    (0..count).map(|k| Period { log_return: log_return(k), bank_return: 0.002 }).collect()
}

fn decide(walk: &WalkForward, strategies: &[Strategy], periods: &[Period], threads: usize) -> Vec<Vec<Decision>> {
    let watch = Watch::unwatched();
    let trained = AtomicUsize::new(0);
    let pool = TrainingPool::new(threads).unwrap();
    let count = || {
        trained.fetch_add(1, Ordering::Relaxed);
    };
    let decisions = pool.install(|| walk.decide(strategies, periods, &watch, &count)).unwrap();
    assert_eq!(trained.into_inner(), walk.trainings(strategies, periods));
    decisions
}

#[test]
fn a_year_equals_the_session_that_lives_it() {
    let periods = periods(WALK.window + YEAR);
    for (strategy, framework, alpha) in [
        (Strategy::Adaptive { alpha: 0.9 }, Framework::Adaptive, 0.9),
        (Strategy::Static { alpha: 0.9 }, Framework::Static, 0.9),
        (Strategy::PlugIn, Framework::PlugIn, 0.1),
    ] {
        let decisions = &decide(&WALK, &[strategy], &periods, 1)[0];
        let specification = WALK.specification(framework, alpha, &periods[..WALK.window]);
        let watch = Watch::unwatched();
        let advisor = Advisor::new(Training::new(&specification).unwrap().run(&watch).unwrap());
        let returns: Vec<f64> = periods[WALK.window..].iter().map(|period| period.log_return).collect();
        let mut walk = advisor.walk(advisor.initial_state(None, None).unwrap(), &returns);
        let advices: Vec<_> = walk.by_ref().collect();
        let end = walk.state;
        assert_eq!((decisions.len(), advices.len()), (YEAR, YEAR));
        for (decision, advice) in decisions.iter().zip(&advices) {
            let expected = Decision { band: advice.band, radius: advice.radius, source: Some(advice.source) };
            assert_eq!(*decision, expected);
        }
        assert!(decisions.iter().any(|decision| decision.band.high > 0.0), "{strategy:?} shows nothing");
        // The bank paid what the policy took it to pay, and nothing was charged.
        let bands = decisions.iter().map(|decision| decision.band);
        let account = keep(bands, &periods[WALK.window..], 0.0, 100.0);
        assert_eq!(account.wealth.last(), Some(&end.wealth));
    }
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
    let constant = vec![Period { log_return: 0.01, bank_return: 0.0 }; 40];
    let watch = Watch::unwatched();
    let refused = WALK.decide(&[Strategy::PlugIn], &constant, &watch, &|| {});
    assert!(
        matches!(&refused, Err(TrainError::Specification(field)) if field.field == "problem.history"),
        "{refused:?}"
    );
}
