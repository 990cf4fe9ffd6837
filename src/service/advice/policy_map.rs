//! The actions of a declared problem's policy over ranges of its inputs: what a page draws as a map.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::request::rules;
use crate::service::advice::sweep::evenly;
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// Number of values of a range.
pub const VALUES: std::ops::RangeInclusive<usize> = 2..=21;
/// The most ranges of a map.
pub const MOST_RANGES: usize = 2;

/// Evenly spaced values of an input, including both ends.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InputRange {
    /// The name of a state, or of the noise.
    #[schema(example = "stock")]
    pub input: String,
    #[schema(example = 0.0)]
    pub from: f64,
    #[schema(example = 60.0)]
    pub to: f64,
    /// 2 to 21.
    #[schema(example = 13)]
    pub points: usize,
}

/// The actions of a period over ranges of inputs.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PolicyMap {
    pub policy: String,
    /// The period decided, from 1.
    pub period: usize,
    /// The values of each input, in the order of the question.
    pub across: Vec<InputValues>,
    /// The decisions, those of each value of the first input in the order of the values of the second.
    pub points: Vec<MapPoint>,
}

/// The values of an input.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct InputValues {
    pub input: String,
    pub values: Vec<f64>,
}

/// The decision at one point of a map.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct MapPoint {
    /// The best actions, by name; null if there are none.
    pub actions: Option<BTreeMap<String, f64>>,
    /// Worth of this period and those after it, as in a decision at a state.
    pub value: Option<f64>,
    /// Share of the worst law's outcomes whose worth is a guess, as in a decision at a state.
    pub untrained_share: Option<f64>,
    /// The reason why nothing can be decided here: an action that the solver tries may lead a state out of its range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
}

/// A question for a map, with all of its points.
#[derive(Clone)]
pub(super) struct MapQuestion {
    advisor: Arc<DeclaredAdvisor>,
    period: usize,
    state: BTreeMap<String, f64>,
    noises: Vec<f64>,
    across: Vec<InputValues>,
}

impl MapQuestion {
    /// Reads the question.
    ///
    /// # Errors
    /// An input that there is not, a range with too few or too many values, or one whose ends may not be.
    pub(super) fn new(
        advisor: Arc<DeclaredAdvisor>,
        period: usize,
        (state, noises): (Option<BTreeMap<String, f64>>, Vec<f64>),
        across: Vec<InputRange>,
    ) -> Result<Self, FieldError> {
        let problem = &advisor.policy().specification().problem;
        rules::whole("period", period, &(1..=problem.horizon))?;
        if across.len() > MOST_RANGES {
            let rule = format!("must have at most {MOST_RANGES}");
            return Err(FieldError::new("across", format!("{} ranges", across.len()), rule));
        }
        let noise = &problem.noise.name;
        for (index, InputRange { input, from, to, points }) in across.iter().enumerate() {
            let field = |name: &str| format!("across[{index}].{name}");
            let [low, high] = match problem.states.get(input) {
                Some(state) => [state.low, state.high],
                None if input == noise && period > 1 => [problem.noise.low, problem.noise.high],
                None => {
                    let rule = "must be a state, or after the first period the noise";
                    return Err(FieldError::new(field("input"), input, rule));
                }
            };
            if across[..index].iter().any(|other| other.input == *input) {
                return Err(FieldError::new(field("input"), input, "must be another than the first"));
            }
            rules::within(&field("from"), *from, low, high)?;
            rules::within(&field("to"), *to, low, high)?;
            if to <= from {
                return Err(FieldError::new(field("to"), to, format!("must be above `from`, {from}")));
            }
            rules::whole(&field("points"), *points, &VALUES)?;
        }
        let is_swept = across.iter().any(|range| range.input == *noise);
        let expected = if is_swept { 0 } else { period - 1 };
        if noises.len() != expected {
            let rule = format!("must have {expected}, one for each period before this one that no range is of");
            return Err(FieldError::new("noises", format!("a list of {}", noises.len()), rule));
        }
        let start = || advisor.state("state", None);
        let state = state.map_or_else(start, |state| advisor.state("state", Some(&state)))?;
        let values = |InputRange { input, from, to, points }| InputValues { input, values: evenly(from, to, points) };
        let across = across.into_iter().map(values).collect();
        Ok(MapQuestion { advisor, period, state, noises, across })
    }

    /// Decides at every value of the second input, for one value of the first.
    fn column(&self, first: f64) -> Vec<MapPoint> {
        let second = self.across.get(1).map_or(vec![None], |input| input.values.iter().copied().map(Some).collect());
        second.into_iter().map(|second| self.point(first, second)).collect()
    }

    fn point(&self, first: f64, second: Option<f64>) -> MapPoint {
        let (mut state, mut noises) = (self.state.clone(), self.noises.clone());
        for (input, value) in self.across.iter().zip([Some(first), second].into_iter().flatten()) {
            match state.get_mut(&input.input) {
                Some(state) => *state = value,
                None => noises = vec![value; self.period - 1],
            }
        }
        match self.advisor.decide(self.period, Some(&state), &noises) {
            Ok(decided) => MapPoint {
                actions: Some(decided.actions),
                value: Some(decided.value),
                untrained_share: Some(decided.untrained_share),
                fault: None,
            },
            Err(fault) => {
                MapPoint { actions: None, value: None, untrained_share: None, fault: Some(fault.to_string()) }
            }
        }
    }

    /// Returns the map of these columns.
    pub(super) fn answer(self, policy: String, columns: Vec<Vec<MapPoint>>) -> PolicyMap {
        let MapQuestion { period, across, .. } = self;
        PolicyMap { policy, period, across, points: columns.concat() }
    }
}

impl Sessions {
    /// Decides at every point of a map. Each column waits for its own permit, so that a large map starves nobody and a
    /// disconnected caller stops it.
    pub(super) async fn map_columns(
        &self,
        tenant: &Tenant,
        map: &MapQuestion,
    ) -> Result<Vec<Vec<MapPoint>>, ServiceError> {
        let mut columns = Vec::new();
        for first in &map.across[0].values {
            let (map, first) = (map.clone(), *first);
            columns.push(self.resolving.run(tenant, move || map.column(first)).await?);
        }
        Ok(columns)
    }
}
