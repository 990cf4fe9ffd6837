//! The laws from which returns are drawn.

use crate::control::request::rules::LOG_RETURN;
use crate::control::request::sampling_law::{MixtureComponent, SamplingLaw};
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::support::Interval;
use crate::numerics::law::ContinuousLaw;

/// Returns the law that a problem specifies.
pub fn continuous_law(law: &SamplingLaw, problem: &ProblemSpecification) -> ContinuousLaw {
    let ProblemSpecification { history, learning, .. } = problem;
    match law {
        SamplingLaw::Bootstrap {} => ContinuousLaw::smoothed_bootstrap(history, &learning.weights(history.len())),
        SamplingLaw::StudentT { location, scale, degrees_of_freedom } => {
            let (location, scale, degrees_of_freedom) = (*location, *scale, *degrees_of_freedom);
            ContinuousLaw::StudentT { location, scale, degrees_of_freedom }
        }
        SamplingLaw::GaussianMixture { components } => {
            let component = |c: &MixtureComponent| (c.weight, c.mean, c.variance.sqrt());
            ContinuousLaw::mixture(components.iter().map(component).collect())
        }
    }
}

/// Clamps a return to the accepted range: the support and the limit on log-returns.
pub fn admissible(log_return: f64, problem: &ProblemSpecification) -> f64 {
    let limit = LOG_RETURN;
    let Interval { min, max } = problem.support_rule().given().unwrap_or(Interval { min: -limit, max: limit });
    log_return.clamp(min.max(-limit), max.min(limit))
}
