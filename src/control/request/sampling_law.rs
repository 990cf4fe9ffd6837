//! Laws that returns can be drawn from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, above, within};

/// Allowed number of components of a mixture.
const COMPONENTS: std::ops::RangeInclusive<usize> = 1..=32;
/// Allowed probabilities of a component: above the first.
const WEIGHT: (f64, f64) = (0.0, 1.0);
/// Allowed means, in log-return per step.
const MEAN: (f64, f64) = (-1.0, 1.0);
/// Allowed variances of a component, in squared log-return.
const VARIANCE: (f64, f64) = (1e-12, 1.0);
/// Allowed factors on a standard t variable, in log-return.
const SCALE: (f64, f64) = (1e-6, 1.0);
/// Allowed degrees of freedom. Above 2 the variance is finite.
const DEGREES_OF_FREEDOM: (f64, f64) = (2.1, 1e6);

/// A law of log-returns that can be drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SamplingLaw {
    /// A mixture of normal laws.
    GaussianMixture {
        /// Components of the mixture, 1 to 32; their weights sum to 1.
        components: Vec<MixtureComponent>,
    },
    /// Smoothed bootstrap of the history with the weights of its returns, with the same weighted mean and variance.
    Bootstrap {},
    /// A Student t law, shifted and scaled.
    StudentT {
        /// Mean, in log-return per step, -1 to 1.
        location: f64,
        /// Factor on a standard t variable, in log-return, 1e-6 to 1.
        scale: f64,
        /// Degrees of freedom, 2.1 to 1e6: above 2 the variance is finite.
        degrees_of_freedom: f64,
    },
}

/// One normal law of a mixture, of log-returns per step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MixtureComponent {
    /// Probability of the component, above 0 and at most 1.
    pub weight: f64,
    /// Mean, in log-return, -1 to 1.
    pub mean: f64,
    /// Variance, in squared log-return, 1e-12 to 1.
    pub variance: f64,
}

impl Bounded for SamplingLaw {
    const BOUNDS: &'static [FieldBounds] = &[
        ("components", ValueBounds::list(&COMPONENTS, &ValueBounds::Any)),
        ("location", ValueBounds::number(MEAN)),
        ("scale", ValueBounds::number(SCALE)),
        ("degrees_of_freedom", ValueBounds::number(DEGREES_OF_FREEDOM)),
    ];
}

impl Bounded for MixtureComponent {
    const BOUNDS: &'static [FieldBounds] = &[
        ("weight", ValueBounds::Above(WEIGHT.0, WEIGHT.1)),
        ("mean", ValueBounds::number(MEAN)),
        ("variance", ValueBounds::number(VARIANCE)),
    ];
}

impl SamplingLaw {
    /// Checks the law, named `field` in messages.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn check(&self, field: &str) -> Result<(), FieldError> {
        match self {
            SamplingLaw::Bootstrap {} => Ok(()),
            SamplingLaw::StudentT { location, scale, degrees_of_freedom } => {
                within(&format!("{field}.location"), *location, MEAN.0, MEAN.1)?;
                within(&format!("{field}.scale"), *scale, SCALE.0, SCALE.1)?;
                let (least, most) = DEGREES_OF_FREEDOM;
                within(&format!("{field}.degrees_of_freedom"), *degrees_of_freedom, least, most)
            }
            SamplingLaw::GaussianMixture { components } => check_mixture(&format!("{field}.components"), components),
        }
    }
}

fn check_mixture(field: &str, components: &[MixtureComponent]) -> Result<(), FieldError> {
    if !COMPONENTS.contains(&components.len()) {
        let rule = format!("must hold {} to {} components", COMPONENTS.start(), COMPONENTS.end());
        return Err(FieldError::new(field, format!("{} components", components.len()), rule));
    }
    for (index, component) in components.iter().enumerate() {
        above(&format!("{field}[{index}].weight"), component.weight, WEIGHT)?;
        within(&format!("{field}[{index}].mean"), component.mean, MEAN.0, MEAN.1)?;
        within(&format!("{field}[{index}].variance"), component.variance, VARIANCE.0, VARIANCE.1)?;
    }
    let total: f64 = components.iter().map(|component| component.weight).sum();
    if (total - 1.0).abs() > 1e-9 {
        return Err(FieldError::new(field, format!("weights summing to {total}"), "must sum to 1"));
    }
    Ok(())
}
