//! Gaussian process regression against scikit-learn (tests/data/gp.json) and against brute force.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use ballast::numerics::gp::fit::{self, Bounds, Fit, FitError};
use ballast::numerics::gp::likelihood::log_likelihood_and_gradient;
use ballast::numerics::gp::{GaussianProcess, GpMean, Hyperparameters};
use ballast::numerics::search::minimise::{SearchOutcome, minimise_bounded};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    inputs: Vec<Vec<f64>>,
    targets: Vec<f64>,
    #[serde(flatten)]
    hyper: Hyperparameters,
    test_inputs: Vec<Vec<f64>>,
    mean: Vec<f64>,
    latent_variance: Vec<f64>,
    log_marginal_likelihood: f64,
    gradient_log_signal_variance: f64,
    gradient_log_lengthscales: Vec<f64>,
    gradient_log_noise_variance: f64,
}

fn cases() -> Vec<Case> {
    let oracle: Oracle = serde_json::from_str(include_str!("../data/gp.json")).unwrap();
    assert_eq!(oracle.cases.len(), 3);
    oracle.cases
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

#[track_caller]
fn assert_close(actual: f64, expected: f64) {
    let error = (actual - expected).abs() / expected.abs();
    assert!(error < 1e-8, "{actual} is not {expected}: relative error {error:e}");
}

/// A smooth function of `d` inputs spread by an irrational rotation, with a noise of the same kind.
fn smooth_sample(n: usize, d: usize) -> (DMatrix<f64>, Vec<f64>) {
    let inputs = DMatrix::from_fn(n, d, |i, j| {
        4.0 * (((i + 1) as f64) * [2.0_f64, 3.0, 5.0, 7.0, 11.0][j].sqrt()).fract() - 2.0
    });
    let targets = (0..n)
        .map(|i| {
            let noise = ((i * i) as f64 * 0.754_877_666).fract() - 0.5;
            let signal: f64 = (0..d).map(|j| (inputs[(i, j)] * (1.0 + 0.4 * j as f64)).sin() / (j + 1) as f64).sum();
            signal + 0.1 * noise
        })
        .collect();
    (inputs, targets)
}

fn wide_bounds() -> Bounds {
    Bounds { lengthscale: [1e-2, 1e2], signal_variance: [1e-4, 1e4], noise_variance: [1e-6, 1e2] }
}

fn log_scales(hyper: &Hyperparameters) -> Vec<f64> {
    let variances = [hyper.signal_variance, hyper.noise_variance];
    hyper.lengthscales.iter().chain(&variances).map(|scale| scale.ln()).collect()
}

#[test]
fn predictions_equal_those_of_scikit_learn() {
    for case in cases() {
        let process = GaussianProcess::condition(&matrix(&case.inputs), &case.targets, &case.hyper).unwrap();
        assert_eq!(process.jitter(), 0.0);
        assert_eq!((case.mean.len(), case.latent_variance.len()), (5, 5));
        for ((query, &mean), &variance) in case.test_inputs.iter().zip(&case.mean).zip(&case.latent_variance) {
            assert_close(process.mean(query), mean);
            assert_close(process.latent_variance(query), variance);
        }
    }
}

#[test]
fn gradients_equal_those_of_scikit_learn() {
    for case in cases() {
        let (value, gradient) = one_likelihood(&matrix(&case.inputs), &case.targets, &case.hyper).unwrap();
        assert_close(value, case.log_marginal_likelihood);
        let mut expected = case.gradient_log_lengthscales.clone();
        expected.extend([case.gradient_log_signal_variance, case.gradient_log_noise_variance]);
        assert_eq!(gradient.len(), expected.len());
        for (&actual, &expected) in gradient.iter().zip(&expected) {
            assert_close(actual, expected);
        }
    }
}

#[test]
fn gradients_equal_finite_differences_when_the_factorisation_is_blocked() {
    let (inputs, targets) = smooth_sample(131, 3);
    let hyper = Hyperparameters { lengthscales: vec![1.1, 0.8, 2.0], signal_variance: 1.3, noise_variance: 0.02 };
    let (_, gradient) = one_likelihood(&inputs, &targets, &hyper).unwrap();
    let at = |index: usize, shift: f64| {
        let mut moved = hyper.clone();
        let (lengthscales, others) = (&mut moved.lengthscales, [&mut moved.signal_variance, &mut moved.noise_variance]);
        *lengthscales.iter_mut().chain(others).nth(index).unwrap() *= shift.exp();
        one_likelihood(&inputs, &targets, &moved).unwrap().0
    };
    for (index, slope) in gradient.iter().enumerate() {
        let numeric = (at(index, 1e-4) - at(index, -1e-4)) / 2e-4;
        assert!((slope - numeric).abs() < 1e-5 * (1.0 + slope.abs()), "{index}: {slope} against {numeric}");
    }
}

#[test]
fn means_of_several_functions_are_those_of_scikit_learn_and_of_their_sum() {
    for case in cases() {
        let (inputs, count) = (matrix(&case.inputs), case.targets.len());
        let process = GaussianProcess::condition(&inputs, &case.targets, &case.hyper).unwrap();
        let (own, ones) = (process.weights().to_vec(), process.weights_of(&vec![1.0; count]));
        let sum: Vec<f64> = own.iter().zip(&ones).map(|(one, other)| one + other).collect();
        let mean = GpMean::new(&inputs, &[own, ones, sum], &case.hyper);
        for (query, expected) in case.test_inputs.iter().zip(&case.mean) {
            let means = mean.means(query);
            assert_close(means[0], *expected);
            assert!((means[2] - means[0] - means[1]).abs() < 1e-9 * (means[0].abs() + means[1].abs()), "{means:?}");
        }
    }
}

/// By Bochner's theorem no fourth derivative of the kernel along an input exceeds that at distance 0, which is 25 s2.
#[test]
fn means_along_an_input_are_those_at_its_points() {
    let (inputs, targets) = smooth_sample(131, 3);
    let hyper = Hyperparameters { lengthscales: vec![1.1, 0.8, 2.0], signal_variance: 1.3, noise_variance: 0.02 };
    let process = GaussianProcess::condition(&inputs, &targets, &hyper).unwrap();
    let weights = [process.weights().to_vec(), process.weights_of(&[1.0; 131])];
    let mean = GpMean::new(&inputs, &weights, &hyper);
    let mut draws = ChaCha8Rng::seed_from_u64(44);
    let mut drawn = |low: f64, high: f64| draws.random_range(low..high);
    for _ in 0..2000 {
        let query = [drawn(-3.0, 3.0), drawn(-3.0, 3.0), drawn(-3.0, 3.0)];
        let range = 10_f64.powf(drawn(-12.0, 0.5));
        let firsts: Vec<f64> = (0..drawn(1.0, 9.0) as usize).map(|_| query[0] + drawn(0.0, range)).collect();
        let [low, high] = [f64::min, f64::max].map(|of| firsts.iter().copied().reduce(of).unwrap());
        let distance = (high - low) / hyper.lengthscales[0];
        let fourth_power = if firsts.len() > 2 && distance < 0.51 { distance.powi(4) } else { 0.0 };
        let found = mean.means_along_first(&query, &firsts);
        assert_eq!(found.len(), 2 * firsts.len());
        for (first, found) in firsts.iter().zip(found.chunks_exact(2)) {
            let expected = mean.means(&[*first, query[1], query[2]]);
            for ((found, expected), weights) in found.iter().zip(expected).zip(&weights) {
                let size = hyper.signal_variance * weights.iter().map(|weight| weight.abs()).sum::<f64>();
                // The exponential errs by 1e-14.
                let bound = (25.0 / 1536.0 * fourth_power + 4e-14) * size;
                assert!((found - expected).abs() <= bound, "{found} is not {expected} within {bound}");
            }
        }
    }
}

#[test]
fn leave_one_out_equals_conditioning_without_the_point() {
    let (inputs, targets) = smooth_sample(70, 2);
    let hyper = Hyperparameters { lengthscales: vec![1.5, 1.0], signal_variance: 2.0, noise_variance: 0.01 };
    let rows: Vec<usize> = (0..targets.len()).filter(|row| row % 3 != 1).collect();
    let process = GaussianProcess::condition(&inputs, &targets, &hyper).unwrap();
    let left_out = process.leave_one_out(std::slice::from_ref(&targets), &rows);
    for (place, &i) in rows.iter().enumerate() {
        let mut others = targets.clone();
        others.remove(i);
        let process = GaussianProcess::condition(&inputs.clone().remove_row(i), &others, &hyper).unwrap();
        let query: Vec<f64> = inputs.row(i).iter().copied().collect();
        assert!((left_out.errors[0][place] - (targets[i] - process.mean(&query))).abs() < 1e-9);
        assert!((left_out.latent_sd[place].powi(2) - process.latent_variance(&query)).abs() < 1e-9);
    }
}

#[test]
fn a_fit_climbs_to_a_point_where_the_projected_gradient_vanishes() {
    let (inputs, targets) = smooth_sample(120, 2);
    let start = Hyperparameters { lengthscales: vec![0.3, 5.0], signal_variance: 0.2, noise_variance: 0.5 };
    let before = one_likelihood(&inputs, &targets, &start).unwrap().0;
    let bounds = wide_bounds();
    for start in [Some(&start), None] {
        let found = fit(&inputs, &targets, &bounds, start).unwrap();
        assert_eq!(found.outcome, SearchOutcome::Converged);
        assert!(found.log_likelihood > before + 10.0);
        let (value, gradient) = one_likelihood(&inputs, &targets, found.process.hyperparameters()).unwrap();
        assert_close(value, found.log_likelihood);
        let point = log_scales(found.process.hyperparameters());
        let boxes = [bounds.lengthscale, bounds.lengthscale, bounds.signal_variance, bounds.noise_variance];
        for ((x, slope), [low, high]) in point.iter().zip(&gradient).zip(boxes) {
            let projected = (x + slope).clamp(low.ln(), high.ln()) - x;
            assert!(projected.abs() < 1e-3, "projected slope {projected} at {:?}", found.process.hyperparameters());
        }
    }
}

#[test]
fn a_fit_ends_at_the_bounds_that_the_data_lie_beyond() {
    let (inputs, targets) = smooth_sample(120, 2);
    let free = fit(&inputs, &targets, &wide_bounds(), None).unwrap().process;
    let free = free.hyperparameters();
    let least = free.lengthscales.iter().copied().fold(f64::INFINITY, f64::min);
    let most = free.lengthscales.iter().copied().fold(0.0, f64::max);
    for (lengthscale, bound) in [([1e-2, 0.5 * least], 0.5 * least), ([2.0 * most, 1e2], 2.0 * most)] {
        let found = fit(&inputs, &targets, &Bounds { lengthscale, ..wide_bounds() }, None).unwrap();
        for length in &found.process.hyperparameters().lengthscales {
            // The search is over logarithms: a bound is met to rounding.
            assert!((length / bound - 1.0).abs() < 1e-12, "{length} and not {bound}");
        }
    }
}

/// A fit that nobody stops.
fn fit(
    inputs: &DMatrix<f64>,
    targets: &[f64],
    bounds: &Bounds,
    start: Option<&Hyperparameters>,
) -> Result<Fit, FitError> {
    fit::fit(inputs, &[targets.to_vec()], bounds, start, &AtomicBool::new(false))
}

/// Returns the likelihood of one function of the inputs.
fn one_likelihood(inputs: &DMatrix<f64>, targets: &[f64], hyper: &Hyperparameters) -> Option<(f64, Vec<f64>)> {
    log_likelihood_and_gradient(inputs, &[targets.to_vec()], hyper)
}

#[test]
fn the_likelihood_of_several_functions_is_the_sum_of_theirs() {
    let (inputs, first) = smooth_sample(40, 2);
    let second: Vec<f64> = first.iter().map(|value| value * value - 0.3).collect();
    let hyper = Hyperparameters { lengthscales: vec![0.9, 1.4], signal_variance: 1.3, noise_variance: 0.02 };
    let (together, slopes) = log_likelihood_and_gradient(&inputs, &[first.clone(), second.clone()], &hyper).unwrap();
    let [one, other] = [first, second].map(|targets| one_likelihood(&inputs, &targets, &hyper).unwrap());
    assert!((together - one.0 - other.0).abs() < 1e-9 * together.abs());
    for (slope, (one, other)) in slopes.iter().zip(one.1.iter().zip(&other.1)) {
        assert!((slope - one - other).abs() < 1e-9 * (one.abs() + other.abs()), "{slope} {one} {other}");
    }
}

#[test]
fn a_fit_asked_to_stop_says_so() {
    let (inputs, targets) = smooth_sample(50, 2);
    let stopped = fit::fit(&inputs, &[targets], &wide_bounds(), None, &AtomicBool::new(true));
    assert_eq!(stopped, Err(FitError::Stopped));
}

/// The search through subsets, in its own coordinates, against the crate's L-BFGS-B on all rows and all scales.
#[test]
fn a_fit_through_subsets_ends_as_high_as_an_independent_search_over_all_rows() {
    for (rows, lost) in [(400, 1e-3), (420, 0.5), (1200, 18.5)] {
        ends_as_high(rows, lost);
    }
}

/// With up to 400 rows the fit ends at the optimum of all rows. Of more rows n the scales are those of m = 400: by the
/// normal law of estimates, ln p of all rows is lower by (n / m - 1) / 2 times a chi-squared variable with 4 degrees of
/// freedom, one for each scale, which exceeds 18.5 once in a thousand.
fn ends_as_high(rows: usize, lost: f64) {
    let (inputs, targets) = smooth_sample(rows, 2);
    let bounds = wide_bounds();
    let found = fit(&inputs, &targets, &bounds, None).unwrap();
    assert_eq!(found.outcome, SearchOutcome::Converged);
    let objective = |logs: &[f64]| {
        let scales: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
        let hyper = Hyperparameters {
            lengthscales: scales[..2].to_vec(),
            signal_variance: scales[2],
            noise_variance: scales[3],
        };
        match one_likelihood(&inputs, &targets, &hyper) {
            Some((value, gradient)) => (-value, gradient.into_iter().map(|slope| -slope).collect()),
            None => (f64::INFINITY, vec![0.0; 4]),
        }
    };
    let boxes = [bounds.lengthscale, bounds.lengthscale, bounds.signal_variance, bounds.noise_variance];
    let [lower, upper] = [0, 1].map(|side| boxes.map(|bounds| bounds[side].ln()));
    let searched = minimise_bounded(objective, &[0.0, 0.0, 0.0, -4.0], &lower, &upper, 200);
    assert!(found.log_likelihood > -searched.value - lost, "{found:?} {searched:?}");
    assert_eq!(found, fit(&inputs, &targets, &bounds, None).unwrap());
}

/// The length scales of nearly linear functions are far beyond those at which searches start. The search on 400 of the rows
/// must not lose what that on 200 found.
#[test]
fn nearly_linear_functions_of_many_rows_get_long_scales() {
    let bounds = Bounds { lengthscale: [0.05, 1e3], signal_variance: [1e-3, 1e5], noise_variance: [1e-10, 1.0] };
    for seed in 1..=3 {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let slopes: Vec<f64> = (0..8).map(|_| generator.random_range(-1.0..1.0)).collect();
        let inputs = DMatrix::from_fn(900, 8, |_, _| generator.random_range(-2.0..2.0));
        let function = |row: usize| {
            let linear: f64 = slopes.iter().zip(inputs.row(row).iter()).map(|(slope, x)| slope * x).sum();
            linear + 0.01 * linear * linear
        };
        let targets: Vec<f64> = (0..inputs.nrows()).map(function).collect();
        let found = fit(&inputs, &targets, &bounds, None).unwrap();
        let some = fit::evenly_spaced(200, inputs.nrows());
        let of_some: Vec<f64> = some.iter().map(|&row| targets[row]).collect();
        let before = fit(&inputs.select_rows(&some), &of_some, &bounds, None).unwrap();
        let (before, _) = one_likelihood(&inputs, &targets, before.process.hyperparameters()).unwrap();
        // Found on 400 of 900 rows: by the normal law of estimates ln p of all is below the highest by (900 / 400 - 1) / 2
        // times a chi-squared variable with 10 degrees of freedom, which exceeds 29.6 once in a thousand.
        assert!(found.log_likelihood > before - 18.5, "{} after {before}", found.log_likelihood);
    }
}

#[test]
fn repeated_inputs_without_noise_need_jitter_and_say_so() {
    let inputs = DMatrix::from_element(10, 1, 0.5);
    let hyper = Hyperparameters { lengthscales: vec![1.0], signal_variance: 1.0, noise_variance: 0.0 };
    let process = GaussianProcess::condition(&inputs, &[2.0; 10], &hyper).unwrap();
    assert!(process.jitter() > 0.0 && process.jitter() <= 1e-6);
    assert!((process.mean(&[0.5]) - 2.0).abs() < 1e-3);
    let bounds = Bounds { noise_variance: [1e-300, 1.0], ..wide_bounds() };
    let start = Hyperparameters { noise_variance: 1e-300, ..hyper };
    assert!(fit(&inputs, &[2.0; 10], &bounds, Some(&start)).is_ok());
}

/// `cargo test --release --test solver gp:: -- --ignored --nocapture`
#[test]
#[ignore = "prints timings, which mean something in release only"]
fn timings_at_a_thousand_rows() {
    let (inputs, targets) = smooth_sample(1000, 5);
    let clock = Instant::now();
    let found = fit(&inputs, &targets, &wide_bounds(), None).unwrap();
    println!("fit: {:?}, {found:?}", clock.elapsed());
    let clock = Instant::now();
    one_likelihood(&inputs, &targets, found.process.hyperparameters()).unwrap();
    println!("one evaluation: {:?}", clock.elapsed());
    let clock = Instant::now();
    let process = GaussianProcess::condition(&inputs, &targets, found.process.hyperparameters()).unwrap();
    println!("condition: {:?}", clock.elapsed());
    let queries: Vec<[f64; 5]> = (0..1000).map(|k| [0.001 * f64::from(k); 5]).collect();
    let clock = Instant::now();
    let variances: f64 = queries.iter().map(|query| process.latent_variance(query)).sum();
    println!("latent variance: {:?} each ({variances})", clock.elapsed() / 1000);
    let mut scratch = Vec::new();
    let clock = Instant::now();
    let means: f64 = queries.iter().map(|query| process.posterior_mean().mean_with(query, &mut scratch)).sum();
    println!("mean: {:?} each ({means})", clock.elapsed() / 1000);
}
