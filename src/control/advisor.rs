//! A policy made ready to answer: what to hold in a state, what the law and the radius are, where the next return leads.
//! Live sessions and the simulator call these same functions.  (STUB BODIES)

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::{FieldError, PolicyError};
use super::policy::Policy;
use super::specification::Specification;
use super::state::State;
use crate::numerics::empirical::EmpiricalDistribution;

/// How an allocation is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdviceMode {
    /// From the policy surrogate; by re-solving where the state lies outside the design.
    Surrogate,
    /// By solving the robust step at the exact state with the value surrogate of the step after.
    Resolve,
}

/// Where an advice came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AdviceSource {
    /// The policy surrogate (or the stored solution of a single-state design).
    PolicySurrogate,
    /// Re-solved on request.
    Resolved,
    /// Re-solved because the state lies outside the design.
    ResolvedOutsideDesign,
}

/// The robust allocation for the coming period and what it is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Advice {
    /// Share of wealth to hold in the risky asset.
    pub allocation: f64,
    /// Certainty equivalent of the robust value, in terminal wealth.
    pub certainty_equivalent: f64,
    /// Terminal wealth of all-bank: no law can take it away.
    pub floor: f64,
    /// Radius of the Wasserstein ball, in log-return.
    pub radius: f64,
    pub sample_size: usize,
    /// Predicted standard deviation of the log certainty equivalent.
    pub surrogate_sd: f64,
    /// Whether the state lies where the surrogates were trained.
    pub in_design: bool,
    pub source: AdviceSource,
}

/// The law that is worst for the advised allocation, as a transport of the empirical law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstCase {
    /// Lagrange multiplier of the ball: utility lost per unit of extra radius.
    pub multiplier: f64,
    pub transport: Vec<TransportedMass>,
    /// Difference between primal and dual value, in log certainty equivalent.
    pub duality_gap: f64,
    /// The worst case in one plain sentence.
    pub sentence: String,
}

/// Mass of one atom and where the adversary puts it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TransportedMass {
    /// Observed log-return.
    pub atom: f64,
    /// Log-return in the worst case; equal to `atom` where the mass stays.
    pub moved_to: f64,
    pub mass: f64,
}

/// The uncertainty set of a state, in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Uncertainty {
    pub sample_size: usize,
    /// Raw moments of the empirical law, first to the specification's count.
    pub moments: Vec<f64>,
    /// (1 - alpha)-quantile of the bridge statistic; absent under other radius rules.
    pub quantile: Option<f64>,
    /// Simulation standard error of the quantile.
    pub quantile_standard_error: Option<f64>,
    pub radius: f64,
}

/// A policy with what its evaluation needs prepared. Cheap to share behind an `Arc`; all methods are pure.
pub struct Advisor {
    policy: Policy,
}

impl Advisor {
    pub fn new(policy: Policy) -> Result<Self, PolicyError> {
        Ok(Advisor { policy })
    }

    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    pub fn specification(&self) -> &Specification {
        self.policy.specification()
    }

    /// The state a session starts from: `history` and `wealth` default to the specification's.
    ///
    /// # Errors
    /// A history or wealth that breaks a rule; a history other than the policy's own under the static framework.
    pub fn initial_state(&self, history: Option<&[f64]>, wealth: Option<f64>) -> Result<State, FieldError> {
        let problem = &self.specification().problem;
        let history = history.unwrap_or(&problem.history);
        super::limits::history("history", history)?;
        let wealth = wealth.unwrap_or(problem.initial_wealth);
        super::limits::within("wealth", wealth, 1e-6, 1e15)?;
        Ok(State { wealth, law: EmpiricalDistribution::new(history) })
    }

    /// The advice for the period that follows `step` periods already observed; `step < horizon`.
    pub fn advise(&self, step: usize, state: &State, mode: AdviceMode) -> Advice {
        let floor = state.wealth
            * (1.0 + self.specification().problem.rate_per_step)
                .powi((self.specification().problem.horizon - step) as i32);
        Advice {
            allocation: 0.5,
            certainty_equivalent: floor * 1.01,
            floor,
            radius: 0.01,
            sample_size: state.law.sample_size(),
            surrogate_sd: 0.0,
            in_design: true,
            source: if mode == AdviceMode::Resolve { AdviceSource::Resolved } else { AdviceSource::PolicySurrogate },
        }
    }

    /// The re-solved advice and the worst-case law behind it.
    pub fn explain(&self, step: usize, state: &State) -> (Advice, WorstCase) {
        let transport = state
            .law
            .atoms()
            .iter()
            .map(|&atom| TransportedMass { atom, moved_to: atom, mass: 1.0 / state.law.sample_size() as f64 })
            .collect();
        (
            self.advise(step, state, AdviceMode::Resolve),
            WorstCase { multiplier: 1.0, transport, duality_gap: 0.0, sentence: "stub".into() },
        )
    }

    /// Sample size, moments, quantile and radius of a state.
    pub fn uncertainty(&self, state: &State) -> Uncertainty {
        let moments = state.law.raw_moments(self.specification().surrogate.moment_count);
        Uncertainty {
            sample_size: state.law.sample_size(),
            moments,
            quantile: Some(0.1),
            quantile_standard_error: Some(0.001),
            radius: 0.01,
        }
    }

    /// The state after holding `allocation` through `log_return`.
    pub fn advance(&self, state: &State, allocation: f64, log_return: f64) -> State {
        let mut law = state.law.clone();
        law.push(log_return);
        let gross = 1.0 + self.specification().problem.rate_per_step;
        State { wealth: state.wealth * ((1.0 - allocation) * gross + allocation * log_return.exp()), law }
    }
}
