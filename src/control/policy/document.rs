//! A trained policy: immutable, portable, named by the hash of its bytes.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::control::bellman::problem::{Problem, largest_gain};
use crate::control::cache::Cache;
use crate::control::error::{FieldError, PolicyError};
use crate::control::problem::actions::Band;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::caution::CautionLevel;
use crate::control::request::rules;
use crate::control::request::specification::Specification;
use crate::control::solved_step::{FORMAT, StepDiagnostics, StepSolution};
use crate::control::surrogate::stored::{SingleSolution, Solution, StepSurrogates};

/// Returns the periods per year of the specification in a policy's bytes, if it gives them; none if the bytes are not a
/// policy.
pub fn periods_per_year(json: &[u8]) -> Option<f64> {
    #[derive(Deserialize)]
    struct Specifying {
        specification: Specified,
    }
    #[derive(Deserialize)]
    struct Specified {
        problem: PeriodsPerYear,
    }
    #[derive(Deserialize)]
    struct PeriodsPerYear {
        periods_per_year: Option<f64>,
    }
    serde_json::from_slice::<Specifying>(json).ok().and_then(|document| document.specification.problem.periods_per_year)
}

/// The completed specification and the solution of every step, in ascending order of step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Policy {
    format: String,
    specification: Specification,
    steps: Vec<StepSolution>,
}

impl Policy {
    /// Builds the policy of a completed specification from the solutions of all its steps, ascending.
    pub fn new(specification: Specification, steps: Vec<StepSolution>) -> Self {
        Policy { format: FORMAT.to_owned(), specification, steps }
    }

    /// Returns the completed specification it was trained from.
    pub fn specification(&self) -> &Specification {
        &self.specification
    }

    /// Returns the solutions of all steps, ascending.
    pub fn steps(&self) -> &[StepSolution] {
        &self.steps
    }

    /// Returns the diagnostics of every step, ascending.
    pub fn diagnostics(&self) -> impl Iterator<Item = &StepDiagnostics> {
        self.steps.iter().map(|step| &step.diagnostics)
    }

    /// Returns the problem it solves, with the cache `kept`.
    pub fn problem(&self, kept: Cache) -> Problem {
        Problem::with(&self.specification, kept)
    }

    /// Returns the portable form: JSON whose numbers parse back to the same bits.
    ///
    /// # Errors
    /// None that plain structs of numbers and strings can cause.
    pub fn to_json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    /// Reads the portable form and checks it as hostile input: format, shapes, finite numbers, the specification's
    /// rules.
    ///
    /// # Errors
    /// The first fault, naming the field.
    pub fn from_json(bytes: &[u8]) -> Result<Self, PolicyError> {
        let policy: Policy = serde_json::from_slice(bytes).map_err(|error| PolicyError::Format(error.to_string()))?;
        Ok(policy.checked()?)
    }

    /// Returns this policy if its parts fit together and its specification keeps the rules.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn checked(self) -> Result<Self, FieldError> {
        self.check()?;
        Ok(self)
    }

    fn check(&self) -> Result<(), FieldError> {
        if self.format != FORMAT {
            return Err(FieldError::new("format", &self.format, format!("must be {FORMAT}")));
        }
        if self.specification.clone().completed()? != self.specification {
            return Err(FieldError::new("specification", "an incomplete object", "must have every field filled in"));
        }
        let problem = &self.specification.problem;
        if problem.caution.is_some_and(CautionLevel::is_found) != problem.levels.is_some() {
            let rule = "must be present if the level of caution is found from the record, and absent otherwise";
            return Err(FieldError::new("specification.problem.levels", "null or an object", rule));
        }
        if self.specification.fund.as_ref().is_some_and(|fund| fund.radius_factor.is_none()) {
            let rule = "must be given in a policy";
            return Err(FieldError::new("specification.fund.radius_factor", "null", rule));
        }
        let horizon = self.specification.problem.horizon;
        if self.steps.len() != horizon {
            return Err(FieldError::new("steps", self.steps.len(), format!("must hold horizon = {horizon} steps")));
        }
        let feature_count = self.problem(Cache::default()).selection.names().len();
        for (index, step) in self.steps.iter().enumerate() {
            if step.step != index {
                return Err(FieldError::new(format!("steps[{index}].step"), step.step, format!("must be {index}")));
            }
            let field = format!("steps[{index}].solution");
            match &step.solution {
                Solution::Single(single) => check_single(&field, index, single, &self.specification)?,
                Solution::Surrogates(stored) => {
                    check_surrogates(&field, stored, feature_count)?;
                    check_functions(&field, stored, &self.specification)?;
                }
            }
        }
        Ok(())
    }
}

fn check_single(
    field: &str,
    step: usize,
    single: &SingleSolution,
    specification: &Specification,
) -> Result<(), FieldError> {
    let highest = specification.problem.action_interval[1];
    let (field_of, Band { low, high }) = (|name: &str| format!("{field}.{name}"), single.band);
    rules::within(&field_of("band[0]"), low, 0.0, highest)?;
    rules::within(&field_of("band[1]"), high, low, highest)?;
    if specification.problem.trading_cost <= 0.0 && low != high {
        return Err(FieldError::new(
            field_of("band"),
            format!("[{low}, {high}]"),
            "must be a single allocation, repeated, if trading is free",
        ));
    }
    check_holdings(&field_of("floor_gains"), single.floor_gains.len(), specification, &HOLDINGS_OF_ONE_LAW)?;
    let largest = credible_gain(specification, step);
    single.floor_gains.iter().try_for_each(|&gain| rules::within(&field_of("floor_gains"), gain, 0.0, largest))
}

/// Allowed numbers of holdings at which a step's value is stored if trading costs: for a step of one law, and for a
/// surrogate. A robust step tabulates those of a surrogate over all the returns it considers.
const HOLDINGS_OF_ONE_LAW: RangeInclusive<usize> = 4..=1025;
const HOLDINGS_OF_A_SURROGATE: RangeInclusive<usize> = 4..=65;

/// Checks the number of functions: one if trading costs nothing, or else one for each holding.
fn check_holdings(
    field: &str,
    count: usize,
    specification: &Specification,
    allowed: &RangeInclusive<usize>,
) -> Result<(), FieldError> {
    match specification.problem.trading_cost > 0.0 {
        true => rules::whole(field, count, allowed),
        false => rules::whole(field, count, &(1..=1)),
    }
}

/// Rounding tolerance for a gain at its bound.
const ROUNDING: f64 = 1e-9;

/// Returns the floor gain of a step if every return were the best that is accepted: no state is worth more.
fn credible_gain(specification: &Specification, step: usize) -> f64 {
    let problem = &specification.problem;
    // With withdrawals, the cost of selling may take nearly all of the wealth that remains.
    let unsold = match problem.contributions.are_none() {
        true => Dynamics::plain(problem.rate_per_step, problem.trading_cost).liquidation(1.0).ln(),
        false => (rules::WEALTH.0 / rules::WEALTH.1).ln(),
    };
    (largest_gain(problem, step, rules::LOG_RETURN) - unsold) * (1.0 + ROUNDING)
}

/// Bound on every other stored number.
const LARGEST_NUMBER: f64 = 1e30;

pub(super) fn check_surrogates(field: &str, stored: &StepSurrogates, feature_count: usize) -> Result<(), FieldError> {
    let scaling = &stored.scaling;
    let inputs = scaling.active.len();
    let ascending = scaling.active.windows(2).all(|pair| pair[0] < pair[1]);
    if inputs == 0 || !ascending || scaling.active.iter().any(|&feature| feature >= feature_count) {
        let rule = format!("must list distinct features below {feature_count} in ascending order");
        return Err(FieldError::new(format!("{field}.scaling.active"), format!("{:?}", scaling.active), rule));
    }
    let points = stored.count();
    let shapes = [
        ("scaling.centre", scaling.centre.len(), inputs),
        ("scaling.spread", scaling.spread.len(), inputs),
        ("inputs", stored.inputs.len(), inputs),
        ("value.hyperparameters.lengthscales", stored.value.hyperparameters.lengthscales.len(), inputs),
        ("policy.hyperparameters.lengthscales", stored.policy.hyperparameters.lengthscales.len(), inputs),
        ("inputs[0]", points, points.clamp(2, *rules::COUNT.end())),
    ];
    let weights = || stored.value.weights.iter().chain(&stored.policy.weights);
    let columns = stored.inputs.iter().map(|column| ("inputs", column.len(), points));
    let functions = weights().map(|weights| ("weights", weights.len(), points));
    for (name, found, expected) in shapes.into_iter().chain(columns).chain(functions) {
        if found != expected {
            return Err(FieldError::new(format!("{field}.{name}"), found, format!("must have {expected} entries")));
        }
    }
    let plain = scaling.centre.iter().chain(stored.inputs.iter().flatten());
    for &number in plain.chain(weights().flatten()) {
        rules::within(field, number, -LARGEST_NUMBER, LARGEST_NUMBER)?;
    }
    for surrogate in [&stored.value, &stored.policy] {
        let hyper = &surrogate.hyperparameters;
        rules::within(&format!("{field}.offset"), surrogate.offset, -LARGEST_NUMBER, LARGEST_NUMBER)?;
        let positive =
            hyper.lengthscales.iter().chain([&hyper.signal_variance, &hyper.noise_variance, &surrogate.scale]);
        for &number in positive.chain(&scaling.spread) {
            rules::within(field, number, 1.0 / LARGEST_NUMBER, LARGEST_NUMBER)?;
        }
    }
    rules::within(&format!("{field}.deviation_limit"), stored.deviation_limit, 0.0, LARGEST_NUMBER)
}

/// Checks that there is a value for each holding and, if trading costs, a policy for each end of the band.
fn check_functions(field: &str, stored: &StepSurrogates, specification: &Specification) -> Result<(), FieldError> {
    let functions = stored.value.weights.len();
    check_holdings(&format!("{field}.value.weights"), functions, specification, &HOLDINGS_OF_A_SURROGATE)?;
    let ends = Dynamics::plain(specification.problem.rate_per_step, specification.problem.trading_cost).sides().len();
    rules::whole(&format!("{field}.policy.weights"), stored.policy.weights.len(), &(ends..=ends))
}

/// Returns the SHA-256 of a policy's portable form, in lower-case hexadecimal: the policy's name.
pub fn content_hash(json: &[u8]) -> String {
    let digit = |value: u8| char::from(b"0123456789abcdef"[usize::from(value)]);
    Sha256::digest(json).iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 15)]).collect()
}
