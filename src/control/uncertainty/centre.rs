//! The discrete law that a Wasserstein ball is centred on.

use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::request::framework::Framework;
use crate::control::request::specification::{ProblemSpecification, SamplingLaw};
use crate::numerics::empirical::EmpiricalDistribution;

/// Less than this of a law is lost in rounding; what decayed to it is left out.
const NO_MASS: f64 = 1e-18;

/// A discrete law of log-returns: ascending distinct atoms, and their masses, which sum to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Centre {
    /// Log-returns, ascending.
    pub atoms: Vec<f64>,
    /// Of the atoms, in their order.
    pub masses: Vec<f64>,
}

impl Centre {
    /// The empirical law, each distinct value with its mass.
    pub fn empirical(law: &EmpiricalDistribution) -> Self {
        let weighted = law.atoms().iter().zip(law.weights());
        let masses = weighted.map(|(&atom, weight)| (atom, weight / law.total_weight()));
        Centre::gathered(masses.filter(|(_, mass)| *mass > NO_MASS))
    }

    /// Where nothing is learned: the known law by its quadrature, or the empirical law of the history. What of a known law
    /// lies beyond the returns accepted is put at their bounds, as the simulated returns of the same law are: an exponential
    /// of a heavy tail has no mean.
    pub fn frozen(problem: &ProblemSpecification) -> Self {
        if problem.framework == Framework::KnownLaw {
            let law = problem.law.as_ref().unwrap_or(&SamplingLaw::Bootstrap {});
            let (atoms, masses) = continuous_law(law, problem).quadrature();
            return Centre::gathered(atoms.into_iter().map(|atom| admissible(atom, problem)).zip(masses));
        }
        Centre::empirical(&problem.learning.law(&problem.history))
    }

    /// The masses of equal neighbours added up.
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

    /// The lowest atom.
    pub fn lowest(&self) -> f64 {
        self.atoms.first().copied().unwrap_or_default()
    }

    /// The highest atom.
    pub fn highest(&self) -> f64 {
        self.atoms.last().copied().unwrap_or_default()
    }

    /// Per step, as the variance.
    pub fn mean(&self) -> f64 {
        self.atoms.iter().zip(&self.masses).map(|(atom, mass)| atom * mass).sum()
    }

    /// Per step.
    pub fn variance(&self) -> f64 {
        let mean = self.mean();
        self.atoms.iter().zip(&self.masses).map(|(atom, mass)| mass * (atom - mean).powi(2)).sum()
    }
}
