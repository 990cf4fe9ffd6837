//! What-if questions about a session that lives a declared problem.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::declared::{Decided, DeclaredAdvisor};
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::entries::report::Report;
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::current_advice::of_state;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::problem_state::ProblemState;
use crate::store::Tenant;

/// The advice of a declared problem under one hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ProblemWhatIfPoint {
    /// The states before the period advised, by name.
    pub state: BTreeMap<String, f64>,
    /// The noise of the hypothesis, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// The factor on the radius in the hypothesis, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_scale: Option<f64>,
    #[serde(flatten)]
    pub decided: Decided,
}

/// A hypothesis about a declared problem's session.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProblemHypothesis {
    pub noise: Option<f64>,
    pub radius_scale: Option<f64>,
}

/// The coming period of a session, and the one after it if there is one: their steps of the policy, and the number of
/// the coming one.
#[derive(Debug, Clone, Copy)]
struct Steps {
    step: usize,
    following: Option<usize>,
    period: usize,
}

impl Sessions {
    /// Answers hypotheses about a session of a declared problem, perhaps with `supposed` states. Each point waits for its
    /// own permit.
    pub(super) async fn what_if_problem(
        &self,
        tenant: &Tenant,
        live: &LiveSession,
        state: &ProblemState,
        (supposed, hypotheses): (Option<&BTreeMap<String, f64>>, Vec<ProblemHypothesis>),
    ) -> Result<Large<Vec<ProblemWhatIfPoint>>, ServiceError> {
        let steps = Steps { step: live.step(), following: live.following(), period: live.observed + 1 };
        if hypotheses.iter().any(|hypothesis| hypothesis.noise.is_some()) && steps.following.is_none() {
            let rule = "must be absent: the coming period is the last, so there is none after it to advise";
            return Err(FieldError::new("noise", "given", rule).into());
        }
        let standing = match supposed {
            Some(supposed) => state.at("state", supposed)?,
            None => state.clone(),
        };
        let room = self.memory.answers(hypotheses.len() * standing.noises() * ATOM_BYTES).await?;
        let advisor = self.policies.decider(tenant, &live.current.policy).await?;
        let mut points = Vec::with_capacity(hypotheses.len());
        for hypothesis in hypotheses {
            let (advisor, standing) = (advisor.clone(), standing.clone());
            let solve = move || hypothesis.answer(&advisor, standing, steps);
            points.push(self.resolving.run(tenant, solve).await?.map_err(of_state)?);
        }
        Ok(Large { value: points, room })
    }
}

impl ProblemHypothesis {
    /// Returns the advice under the hypothesis, for the coming period, or for the one after it if there is a noise.
    ///
    /// # Errors
    /// The noise lies beyond its support, or a state leaves its range.
    fn answer(
        self,
        advisor: &DeclaredAdvisor,
        standing: ProblemState,
        steps: Steps,
    ) -> Result<ProblemWhatIfPoint, FieldError> {
        let (mut standing, mut step, mut period) = (standing, steps.step, steps.period);
        if let (Some(noise), Some(following)) = (self.noise, steps.following) {
            let advised = advisor.advise(step, &standing.state, &standing.seen, 1.0)?;
            let actions: Vec<f64> = advised.actions.values().copied().collect();
            let report = Report { noise: Some(noise), ..Report::default() };
            standing = standing.after((step, period), &report, &actions)?.standing;
            (step, period) = (following, period + 1);
        }
        let scale = self.radius_scale.unwrap_or(1.0);
        let decided = Decided { period, ..advisor.advise(step, &standing.state, &standing.seen, scale)? };
        Ok(ProblemWhatIfPoint { state: standing.named(), noise: self.noise, radius_scale: self.radius_scale, decided })
    }
}
