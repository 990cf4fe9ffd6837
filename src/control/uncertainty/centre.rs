//! The discrete law that a Wasserstein ball is centred on.

use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::request::framework::Framework;
use crate::control::request::specification::{ProblemSpecification, SamplingLaw};
use crate::numerics::empirical::EmpiricalDistribution;

/// A discrete law of log-returns: ascending distinct atoms, and their masses, which sum to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Centre {
    /// Log-returns, ascending.
    pub atoms: Vec<f64>,
    /// Of the atoms, in their order.
    pub masses: Vec<f64>,
}

impl Centre {
    /// The empirical law, each distinct value with its share of the sample.
    pub fn empirical(law: &EmpiricalDistribution) -> Self {
        let mass = 1.0 / law.sample_size() as f64;
        Centre::gathered(law.atoms().iter().map(|&atom| (atom, mass)))
    }

    /// Where nothing is learned: the known law by its quadrature, or the empirical law of the history. What of a known law
    /// lies beyond the returns accepted is put at their bounds, as the simulated returns of the same law are: an exponential
    /// of a heavy tail has no mean.
    pub fn frozen(problem: &ProblemSpecification) -> Self {
        if problem.framework == Framework::KnownLaw {
            let law = problem.law.as_ref().unwrap_or(&SamplingLaw::Bootstrap {});
            let (atoms, masses) = continuous_law(law, &problem.history).quadrature();
            return Centre::gathered(atoms.into_iter().map(|atom| admissible(atom, problem)).zip(masses));
        }
        Centre::empirical(&EmpiricalDistribution::new(&problem.history))
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
