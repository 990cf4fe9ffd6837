//! The paper's configuration: its mixture, 20 returns drawn from it, ten steps.

use ballast::control::problem::sampling_law::continuous_law;
use ballast::control::request::sampling_law::{MixtureComponent, SamplingLaw};
use ballast::control::request::specification::{
    InitialLaws, ProblemSpecification, Specification, UtilitySpecification,
};
use ballast::numerics::law::ContinuousLaw;
use ballast::numerics::machine::streams::stream;

/// Returns the law of the paper's section 3.
pub fn mixture() -> SamplingLaw {
    SamplingLaw::GaussianMixture {
        components: vec![
            MixtureComponent { weight: 0.4, mean: 0.006, variance: 0.016 },
            MixtureComponent { weight: 0.6, mean: 0.016, variance: 0.00625 },
        ],
    }
}

/// Draws `count` log-returns from the mixture.
pub fn history(count: usize, seed: u64) -> Vec<f64> {
    let law: ContinuousLaw = continuous_law(&mixture(), &ProblemSpecification::of(Vec::new(), 0.0));
    let mut generator = stream(seed, "bench-history", 0, 0);
    (0..count).map(|_| law.draw(&mut generator)).collect()
}

/// Returns the paper's problem after `sample_size` returns: exponential utility, a bank that pays 0.2 % per step.
pub fn problem(sample_size: usize, horizon: usize) -> ProblemSpecification {
    ProblemSpecification {
        horizon,
        utility: UtilitySpecification::exponential(0.01),
        ..ProblemSpecification::of(history(sample_size, 1), 0.002)
    }
    .as_in_the_paper()
}

/// Returns the request of the paper with a history of `sample_size` draws.
pub fn specification(sample_size: usize, horizon: usize, count: usize, initial_laws: InitialLaws) -> Specification {
    let mut specification = Specification {
        problem: problem(sample_size, horizon),
        fund: None,
        design: Default::default(),
        surrogate: Default::default(),
        seed: 1,
    };
    specification.design.count = Some(count);
    specification.design.initial_laws = initial_laws;
    specification.design.sampling_law = Some(mixture());
    specification
}
