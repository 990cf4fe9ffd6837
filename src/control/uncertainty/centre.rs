//! The discrete law that a Wasserstein ball is centred on.

use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::request::centre::CentreSpecification;
use crate::control::request::centre_rules::LEAST_LIKE;
use crate::control::request::framework::Framework;
use crate::control::request::learning::Learning;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::support::{Interval, LawExtent};
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::conditional::{effective, kernel_weights, representative};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::law::volatility::rescaled;

/// Smallest mass of an atom: less is lost in rounding, so an atom that decayed to it is left out.
const NO_MASS: f64 = 1e-18;

/// The Gauss-Hermite rule of five nodes for a standard normal error, exact for polynomials up to the ninth order: nodes
/// 0 and +-sqrt(5 -+ sqrt(10)), masses 8/15 and (7 +- 2 sqrt(10)) / 60. A record has many returns, and five nodes
/// around each are dense.
const HERMITE: [(f64, f64); 5] = [
    (-2.856_970_013_872_805_6, 0.011_257_411_327_720_688),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_65),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_65),
    (2.856_970_013_872_805_6, 0.011_257_411_327_720_688),
];

/// A discrete law of log-returns: ascending distinct atoms, and their masses, which sum to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Centre {
    /// Log-returns, ascending.
    pub atoms: Vec<f64>,
    /// Masses of the atoms, in their order.
    pub masses: Vec<f64>,
}

/// The map from the law of the returns seen to the centre of the ball. Every return seen is spread over some nodes
/// around it, and assumed atoms are added.
///
///   centre = ( sum_j w_j sum_k m_k delta_(z_j + h x_k) + sum_i v_i delta_(y_i) ) / ( sum_j w_j + sum_i v_i )
///
/// with x and m the nodes and masses of the Gauss-Hermite rule and h the bandwidth. Atoms beyond the returns accepted
/// are clamped to their bounds. Checked by: `tests/solver/centre.rs` against draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Centring {
    /// Steps h x_k away from a return, ascending, and m_k.
    nodes: Vec<(f64, f64)>,
    /// Log-returns y_i, and their weights v_i in numbers of returns.
    assumed: Vec<(f64, f64)>,
    /// The interval of accepted returns.
    accepted: Interval,
}

/// Returns a history, oldest first, as the centre of a problem uses it.
pub fn record(history: &[f64], problem: &ProblemSpecification) -> Vec<f64> {
    match problem.centre {
        CentreSpecification::VolatilityScaled { half_life } => {
            rescaled(history, half_life).into_iter().map(|log_return| admissible(log_return, problem)).collect()
        }
        _ => history.to_vec(),
    }
}

/// Returns the weights of a history under a conditional centre; `None` if all its returns count as they are learned.
fn conditional_weights(problem: &ProblemSpecification) -> Option<Vec<f64>> {
    let CentreSpecification::Conditional { on, bandwidth } = &problem.centre else { return None };
    let ages = problem.learning.weights(problem.history.len());
    let weights = kernel_weights(&on.figures(&problem.history), &ages, *bandwidth, LEAST_LIKE as f64);
    (weights != ages).then_some(weights)
}

/// Returns the law of a history as the centre of the problem uses it.
pub fn learned_law(problem: &ProblemSpecification) -> EmpiricalDistribution {
    let record = record(&problem.history, problem);
    match conditional_weights(problem) {
        Some(weights) => EmpiricalDistribution::weighted(&record, &weights, problem.learning.retention()),
        None => problem.learning.law(&record),
    }
}

/// Returns the record that stands for a history in simulations of its worlds, and how it is learned: the history itself, or
/// under a conditional centre as many returns as count, drawn evenly from their weights, which then are equal.
pub fn representative_record(problem: &ProblemSpecification) -> (Vec<f64>, Learning) {
    let record = record(&problem.history, problem);
    match conditional_weights(problem) {
        Some(weights) => {
            let count = (effective(&weights).round() as usize).max(2);
            (representative(&record, &weights, count), Learning::default())
        }
        None => (record, problem.learning),
    }
}

/// Returns the law of returns, if the framework knows it.
pub fn known_law(problem: &ProblemSpecification) -> Option<ContinuousLaw> {
    let law = problem.law.as_ref().unwrap_or(&SamplingLaw::Bootstrap {});
    (problem.framework == Framework::KnownLaw).then(|| continuous_law(law, problem))
}

impl Centring {
    /// Builds the map of a completed problem.
    pub fn of(problem: &ProblemSpecification) -> Self {
        let (mut nodes, mut assumed) = (vec![(0.0, 1.0)], Vec::new());
        match &problem.centre {
            CentreSpecification::Smoothed { bandwidth } if *bandwidth > 0.0 => {
                nodes = HERMITE.map(|(node, mass)| (bandwidth * node, mass)).to_vec();
            }
            CentreSpecification::Mixed { law, history, weight } if *weight > 0.0 => {
                let (atoms, masses) = match law {
                    Some(law) => continuous_law(law, problem).quadrature(),
                    None => {
                        let record = history.clone().unwrap_or_default();
                        let mass = 1.0 / record.len() as f64;
                        let masses = vec![mass; record.len()];
                        (record, masses)
                    }
                };
                let weighed = |(atom, mass): (f64, f64)| (admissible(atom, problem), weight * mass);
                assumed = atoms.into_iter().zip(masses).map(weighed).collect();
            }
            _ => {}
        }
        let [min, max] = [f64::NEG_INFINITY, f64::INFINITY].map(|end| admissible(end, problem));
        Centring { nodes, assumed, accepted: Interval { min, max } }
    }

    /// Returns the atoms of the centre for one return seen: log-returns and their masses, which sum to 1.
    pub fn spread(&self, log_return: f64) -> impl Iterator<Item = (f64, f64)> {
        let Interval { min, max } = self.accepted;
        self.nodes.iter().map(move |&(step, mass)| {
            (if step == 0.0 { log_return } else { (log_return + step).clamp(min, max) }, mass)
        })
    }

    /// Returns the assumed atoms of the centre: log-returns, and their weights in numbers of returns.
    pub fn assumed(&self) -> &[(f64, f64)] {
        &self.assumed
    }

    /// Returns true if the centre is the law of the returns seen.
    pub fn is_empirical(&self) -> bool {
        self.nodes.len() == 1 && self.assumed.is_empty()
    }

    /// Returns the largest number of atoms of the centre of so many returns.
    pub fn atom_count(&self, returns: usize) -> usize {
        returns.saturating_mul(self.nodes.len()).saturating_add(self.assumed.len())
    }

    /// Returns the centre after the returns of `law`.
    pub fn centre(&self, law: &EmpiricalDistribution) -> Centre {
        let assumed: f64 = self.assumed.iter().map(|(_, weight)| weight).sum();
        let total = law.total_weight() + assumed;
        let spread = |(&atom, weight): (&f64, &f64)| {
            let weight = *weight;
            self.spread(atom).map(move |(node, mass)| (node, weight * mass))
        };
        let seen = law.atoms().iter().zip(law.weights()).flat_map(spread);
        let mut weighted: Vec<(f64, f64)> = seen.chain(self.assumed.iter().copied()).collect();
        weighted.sort_by(|left, right| left.0.total_cmp(&right.0));
        let masses = weighted.into_iter().map(|(atom, weight)| (atom, weight / total));
        Centre::gathered(masses.filter(|(_, mass)| *mass > NO_MASS))
    }

    /// Returns the centre if the law of returns is known: the law by its quadrature. Returns beyond those accepted are
    /// clamped to their bounds, as the simulated returns of the same law are, because an exponential of a heavy tail has
    /// no mean.
    pub fn known_centre(&self, law: &ContinuousLaw) -> Centre {
        let Interval { min, max } = self.accepted;
        let (atoms, masses) = law.quadrature();
        Centre::gathered(atoms.into_iter().map(|atom| atom.clamp(min, max)).zip(masses))
    }

    /// Returns an upper bound on the returns of the centre of `law` with `log_return`, while `periods` more returns are
    /// learned, each of them at most the bound before it.
    pub fn highest(&self, law: &EmpiricalDistribution, log_return: f64, periods: usize) -> f64 {
        let seen = law.atoms().last().copied().unwrap_or(self.accepted.max).max(log_return);
        let step = self.nodes.last().map_or(0.0, |node| node.0);
        let spread = if step > 0.0 { (seen + periods as f64 * step).min(self.accepted.max).max(seen) } else { seen };
        self.assumed.iter().fold(spread, |highest, (atom, _)| highest.max(*atom))
    }
}

impl Centre {
    /// Returns the centre if nothing is learned: that of the known law, or of the history.
    pub fn frozen(problem: &ProblemSpecification) -> Self {
        let centring = Centring::of(problem);
        match known_law(problem) {
            Some(law) => centring.known_centre(&law),
            None => centring.centre(&learned_law(problem)),
        }
    }

    /// Adds up the masses of equal adjacent atoms.
    fn gathered(ascending: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut atoms, mut masses): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for (atom, mass) in ascending {
            match (atoms.last(), masses.last_mut()) {
                (Some(&last), Some(total)) if last == atom => *total += mass,
                _ => {
                    atoms.push(atom);
                    masses.push(mass);
                }
            }
        }
        Centre { atoms, masses }
    }

    /// Returns the lowest atom.
    pub fn lowest(&self) -> f64 {
        self.atoms.first().copied().unwrap_or_default()
    }

    /// Returns the highest atom.
    pub fn highest(&self) -> f64 {
        self.atoms.last().copied().unwrap_or_default()
    }

    /// Returns the extent from which a support around the centre is computed.
    pub fn extent(&self) -> LawExtent {
        LawExtent { ends: [self.lowest(), self.highest()], mean: self.mean(), variance: self.variance() }
    }

    /// Returns the mean, per step as the variance.
    pub fn mean(&self) -> f64 {
        self.atoms.iter().zip(&self.masses).map(|(atom, mass)| atom * mass).sum()
    }

    /// Returns the variance, per step.
    pub fn variance(&self) -> f64 {
        let mean = self.mean();
        self.atoms.iter().zip(&self.masses).map(|(atom, mass)| mass * (atom - mean).powi(2)).sum()
    }
}
