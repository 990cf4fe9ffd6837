//! The requests that the computations share: the paper's problem at other sizes.

use std::error::Error;

use ballast::control::request::evaluation::EvaluationRequest;
use ballast::control::request::framework::Framework;
use ballast::control::request::radius_rule::RadiusRule;
use serde_json::json;

use super::ReproductionPlan;
use crate::paper;

/// Number of returns of a history.
pub const SAMPLE_SIZE: usize = 20;
/// Confidence of the intervals.
pub const LEVEL: f64 = 0.95;

/// Returns the request of the paper's problem, for drawn histories of `sample_size` returns.
pub fn request(
    plan: &ReproductionPlan,
    sample_size: usize,
    frameworks: &[Framework],
) -> Result<EvaluationRequest, Box<dyn Error>> {
    let mut request = json!({
        "problem": paper::problem(sample_size, plan.horizon),
        "design": { "sampling_law": paper::mixture(), "count": plan.count },
        "frameworks": frameworks, "paths": plan.paths,
        "histories": { "kind": "drawn", "count": plan.histories }, "level": LEVEL,
    });
    request["problem"]["radius"] = json!(bridge(plan.bridges));
    Ok(serde_json::from_value(request)?)
}

/// Returns the request at another horizon and with another number of design points, for the paths of a study and
/// without constant mixes.
pub fn sized(
    plan: &ReproductionPlan,
    sample_size: usize,
    horizon: usize,
    frameworks: &[Framework],
    count: usize,
) -> Result<EvaluationRequest, Box<dyn Error>> {
    let mut request = request(plan, sample_size, frameworks)?;
    request.problem.horizon = horizon;
    request.design.count = Some(count);
    request.constant_mixes = Some(Vec::new());
    request.paths = plan.study_paths;
    Ok(request)
}

/// Returns the paper's radius rule, whose quantiles come from `paths` simulated bridges.
pub fn bridge(paths: usize) -> RadiusRule {
    RadiusRule::Bridge { alpha: 0.1, paths, scale: 1.0, correction: None }
}
