//! Trains a policy by hand, with two steps, a history of four returns and a design of four points.
//!
//!     cargo run --example train_offline
//!
//! The example uses only the two lower layers: `numerics` for the mathematics and `control` for the dynamics of wealth. It
//! prints each quantity with its formula. At the end the library's own backward induction solves the same problem, and the
//! three answers must agree. The utility is logarithmic, so wealth drops out of the state and the values are log gains.

use ballast::control::problem::dynamics::Dynamics;
use ballast::control::progress::Watch;
use ballast::control::request::specification::Specification;
use ballast::control::surrogate::stored::Solution;
use ballast::control::training::Training;
use ballast::numerics::gp::{GaussianProcess, Hyperparameters};
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::search::minimise::maximise_concave_scalar;
use ballast::numerics::transport::wasserstein::{WassersteinBall, WorstLaw};
use nalgebra::DMatrix;
use serde_json::json;

const HISTORY: [f64; 4] = [-0.20, -0.02, 0.06, 0.20];
const RATE: f64 = 0.002;
/// The radius shrinks as the sample grows: kappa / sqrt(n).
const KAPPA: f64 = 0.02;
/// Log-returns that the adversary may use.
const SUPPORT: (f64, f64) = (-0.5, 0.5);
const SUPPORT_POINTS: usize = 1001;

/// The ball of the empirical law on the support grid: its points and masses, and the radius.
struct Ball {
    support: Vec<f64>,
    masses: Vec<f64>,
    radius: f64,
}

impl Ball {
    fn around(law: &EmpiricalDistribution) -> Self {
        let spacing = (SUPPORT.1 - SUPPORT.0) / (SUPPORT_POINTS - 1) as f64;
        let mut support: Vec<f64> = (0..SUPPORT_POINTS).map(|k| SUPPORT.0 + k as f64 * spacing).collect();
        support.extend(law.atoms());
        support.sort_by(f64::total_cmp);
        support.dedup();
        let size = law.sample_size() as f64;
        let mass = |z: &f64| law.atoms().iter().filter(|atom| *atom == z).count() as f64 / size;
        Ball { masses: support.iter().map(mass).collect(), support, radius: KAPPA / size.sqrt() }
    }

    /// max_a min { E_F[ ln(((1-a)(1+r) + a e^z) / (1+r)) + next(z) ] : F in the ball }
    fn robust_step(&self, next: impl Fn(f64) -> f64) -> (f64, WorstLaw) {
        let ball = WassersteinBall { support: &self.support, masses: &self.masses, radius: self.radius };
        let later: Vec<f64> = self.support.iter().map(|&z| next(z)).collect();
        let payoff = |action: f64| -> Vec<f64> {
            let gain = |z: &f64| (Dynamics::plain(RATE, 0.0).growth(action, *z) / (1.0 + RATE)).ln();
            self.support.iter().zip(&later).map(|(z, later)| gain(z) + later).collect()
        };
        let (action, _) = maximise_concave_scalar(|a| ball.worst_expectation(&payoff(a)).0, 0.0, 1.0, 1e-9);
        (action, ball.worst_law(&payoff(action)))
    }
}

fn with(law: &EmpiricalDistribution, z: f64) -> EmpiricalDistribution {
    let mut larger = law.clone();
    larger.push(z);
    larger
}

/// Solves V_1, the last step, at the law that includes z.
fn last_step(law: &EmpiricalDistribution, z: f64) -> (f64, WorstLaw) {
    Ball::around(&with(law, z)).robust_step(|_| 0.0)
}

fn must(holds: bool, claim: &str) {
    assert!(holds, "does not hold: {claim}");
    println!("    holds: {claim}");
}

fn main() {
    let law = EmpiricalDistribution::new(&HISTORY);
    let ball = Ball::around(&law);
    println!("1. What is known");
    println!("    F^ puts 1/n on each of n = {} log-returns {HISTORY:?}", law.sample_size());
    println!("    mean = (1/n) sum z_j = {:.4}, bank ln(1+r) = {:.4}", law.raw_moments(1)[0], RATE.ln_1p());
    println!("    radius = kappa/sqrt(n) = {:.4}", ball.radius);

    println!("2. Optimise: the last step at the four design points, the laws that follow if a return comes again");
    println!("    g_1(z) = max_a min_F E_F[ln(growth(a, Z)/(1+r))], F within kappa/sqrt(5) of (4 F^ + delta_z)/5");
    let mut gains = Vec::new();
    for z in HISTORY {
        let (action, worst) = last_step(&law, z);
        println!(
            "    z = {z:>5.2}: action {action:.4}, gain {:.6}, multiplier {:.4}, primal - dual {:.1e}",
            worst.expectation,
            worst.multiplier,
            worst.expectation - worst.dual
        );
        // Both are sums of six numbers below 1.
        must(
            (worst.expectation - worst.dual).abs() < 1e-14,
            "the worst law and the multiplier prove each other optimal",
        );
        if action == 1.0 {
            let learned = with(&law, z);
            let closed = learned.raw_moments(1)[0] - Ball::around(&learned).radius - RATE.ln_1p();
            must((worst.expectation - closed).abs() < 1e-14, "all in stocks, the gain is mean - radius - ln(1+r)");
        }
        gains.push(worst.expectation);
    }

    println!("3. Train: a Gaussian process through the four points, over the mean of the law");
    println!("    m(x) = sum_j w_j k(x, x_j), k = s2 (1 + sqrt5 d + 5 d^2/3) exp(-sqrt5 d), d = |x - x_j| / l");
    let mean_after = |z: f64| with(&law, z).raw_moments(1)[0];
    let inputs = DMatrix::from_iterator(HISTORY.len(), 1, HISTORY.map(mean_after));
    let hyperparameters = Hyperparameters { lengthscales: vec![0.05], signal_variance: 1e-3, noise_variance: 1e-12 };
    let process = GaussianProcess::condition(&inputs, &gains, &hyperparameters).expect("four distinct points");
    for (z, gain) in HISTORY.iter().zip(&gains) {
        let predicted = process.mean(&[mean_after(*z)]);
        println!("    m({:.4}) = {predicted:.6}, g_1 = {gain:.6}", mean_after(*z));
        // The noise is 1e-9 of the signal's variance.
        must((predicted - gain).abs() < 1e-6, "the surrogate passes through its design point");
    }
    let ceiling = gains.iter().copied().fold(0.0, f64::max);
    let surrogate = |z: f64| process.mean(&[mean_after(z)]).clamp(0.0, ceiling);

    println!("4. One step back, with the surrogate instead of g_1: both wealth and law move with z");
    let (action, worst) = ball.robust_step(surrogate);
    println!(
        "    g_0 = max_a min_F E_F[ln(growth(a, Z)/(1+r)) + m(Z)] = {:.6} at action {action:.4}",
        worst.expectation
    );
    must(worst.expectation >= 0.0, "all-bank is feasible and no law can hurt it: g_0 >= 0");
    for moved in worst.moves.iter().filter(|moved| moved.from != moved.to) {
        let (from, to) = (ball.support[moved.from], ball.support[moved.to]);
        println!("    the worst law moves mass {:.4} from {from:.3} to {to:.3}", moved.mass);
    }

    println!("5. Step 4 without a surrogate: g_1 is solved at every return of the grid");
    let (exact_action, exact) = ball.robust_step(|z| last_step(&law, z).1.expectation);
    let basis_points = |difference: f64| 1e4 * difference.abs();
    let error = basis_points(worst.expectation - exact.expectation);
    println!(
        "    g_0 = {:.6} at action {exact_action:.4}: four design points cost {error:.2} basis points",
        exact.expectation
    );
    must(error < 5.0, "the error of four points is below 5 basis points");

    println!("6. The library on the same problem, with a design of 400 points");
    let specification = json!({
        "problem": {
            "horizon": 2, "rate_per_step": RATE, "utility": { "kind": "log" },
            "radius": { "rule": "root_n", "kappa": KAPPA },
            "support": { "rule": "between", "min": SUPPORT.0, "max": SUPPORT.1 },
            "history": HISTORY
        },
        "design": { "count": 400 }
    });
    let specification: Specification = serde_json::from_value(specification).expect("a specification");
    let watch = Watch::unwatched();
    let policy = Training::new(&specification).and_then(|training| training.run(&watch)).expect("a policy");
    let Solution::Single(first) = &policy.steps()[0].solution else { panic!("step 0 starts from one state") };
    let (gain, action) = (first.floor_gains[0], first.band.low);
    let error = basis_points(gain - exact.expectation);
    println!("    g_0 = {gain:.6} at action {action:.4}: {error:.3} basis points from step 5");
    must(error < 0.5, "the trained policy is within half a basis point of the nested solve");
    must((action - exact_action).abs() < 0.02, "and its action within 0.02");
}
