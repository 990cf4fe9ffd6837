//! Decisions of a declared problem's policy at any state.

use std::collections::BTreeMap;

use super::{Decided, DeclaredPolicy, NoiseMove};
use crate::control::bellman::controlled::{ControlledSolution, ControlledStep};
use crate::control::bellman::solution::Adversary;
use crate::control::cache::Cache;
use crate::control::controlled_training::ControlledPolicy;
use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::prepared_step::{Factor, steps_bytes};
use crate::control::problem::actions::{ActionInterval, ActionSet};
use crate::control::problem::controlled::Controlled;
use crate::control::problem::declared::{Declared, EarnedState};
use crate::control::request::rules;
use crate::control::request::specification::Specification;
use crate::control::request::warnings::Warning;
use crate::control::surrogate::features::Features;
use crate::control::uncertainty::radius::Measure;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::statistics::summary::range;

/// Least share of the mass that is reported as moved.
const LEAST_MOVED: f64 = 1e-9;

/// The worth falls between two peaks by at least this share of how much it varies. The errors of surrogates are smaller.
const DENT: f64 = 0.01;

/// Outcomes of the worst law, equally likely, of which it is checked whether the step after was trained there.
const OUTCOMES: usize = 32;

impl DeclaredPolicy {
    /// Returns the policy ready to decide.
    ///
    /// # Errors
    /// As [`Self::checked`].
    pub fn prepared(self, kept: Cache) -> Result<DeclaredAdvisor, FieldError> {
        let training = self.checked(kept.clone())?;
        let (specification, warnings) = (training.specification().clone(), training.warnings());
        let problem = training.problem().afresh();
        let stored = self.steps.iter().filter_map(|step| step.solution.surrogates());
        let factors = stored.map(Factor::of).collect();
        let controlled = ControlledPolicy::prepared(&problem, &specification, &self.steps, kept.clone())?;
        Ok(DeclaredAdvisor { policy: self, problem, specification, controlled, factors, warnings, kept })
    }
}

/// The policy of a declared problem, ready to decide.
pub struct DeclaredAdvisor {
    policy: DeclaredPolicy,
    problem: Declared,
    specification: Specification,
    controlled: ControlledPolicy,
    /// Processes behind the deviations of the trained steps.
    factors: Vec<Factor>,
    warnings: Vec<Warning>,
    kept: Cache,
}

impl DeclaredAdvisor {
    /// Returns the policy.
    pub fn policy(&self) -> &DeclaredPolicy {
        &self.policy
    }

    /// Returns what the solver of controlled problems knows of the declaration.
    pub fn specification(&self) -> &Specification {
        &self.specification
    }

    /// Returns the problem that was read from the formulas.
    pub fn problem(&self) -> &Declared {
        &self.problem
    }

    /// Returns the formulas that jump, which may be mistakes.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns a state by name: the declared start, or the one that is given.
    ///
    /// # Errors
    /// It is not a state of the problem.
    pub fn state(
        &self,
        field: &str,
        given: Option<&BTreeMap<String, f64>>,
    ) -> Result<BTreeMap<String, f64>, FieldError> {
        let start = || self.policy.specification.problem.states.iter().map(|(name, state)| (name.clone(), state.start));
        let state = given.cloned().unwrap_or_else(|| start().collect());
        self.problem.state(field, &state).map(|_| state)
    }

    /// Returns the bytes that it takes, without bridges and factors.
    pub fn bytes(&self) -> usize {
        steps_bytes(&self.policy.steps)
    }

    /// Solves the robust step of a period, from 1, at a state with the noises seen since the start. The state is by
    /// default the declared start, in the first period alone. Cost: one robust step with some hundred actions priced.
    /// Checked by: `tests/solver/declared_policy.rs`.
    ///
    /// # Errors
    /// A period past the horizon, a state that is not one, too many or too few noises, a noise beyond its support;
    /// actions that lead a state out of its range, or to a worth that is no number.
    pub fn decide(
        &self,
        period: usize,
        state: Option<&BTreeMap<String, f64>>,
        noises: &[f64],
    ) -> Result<Decided, FieldError> {
        let (step, state, seen) = self.situation(period, state, noises)?;
        self.advise(step, &state, &seen, 1.0)
    }

    /// Reads a period, its state and the noises seen before it, in the unit of the solver.
    fn situation(
        &self,
        period: usize,
        state: Option<&BTreeMap<String, f64>>,
        noises: &[f64],
    ) -> Result<(usize, EarnedState, Vec<f64>), FieldError> {
        let horizon = self.policy.specification.problem.horizon;
        rules::whole("period", period, &(1..=horizon))?;
        let step = period - 1;
        let problem = &self.problem;
        if state.is_none() && step > 0 {
            return Err(FieldError::new("state", "null", "must be given after the first period"));
        }
        let state = problem.state("state", &self.state("state", state)?)?;
        if noises.len() != step {
            let rule = format!("must have {step}, one for each period before this one");
            return Err(FieldError::new("noises", format!("a list of {}", noises.len()), rule));
        }
        let seen =
            noises.iter().enumerate().map(|(index, noise)| problem.checked_noise(&format!("noises[{index}]"), *noise));
        Ok((step, state, seen.collect::<Result<_, _>>()?))
    }

    /// Solves the robust step after `step` periods at a state, with the noises seen since the start in the unit of the
    /// solver, against a ball with the radius of the law times `radius_scale`. What was earned before is not counted.
    /// Cost: that of [`Self::decide`].
    ///
    /// # Errors
    /// As [`Self::decide`], but for fields that it alone reads.
    pub fn advise(
        &self,
        step: usize,
        state: &EarnedState,
        seen: &[f64],
        radius_scale: f64,
    ) -> Result<Decided, FieldError> {
        // A state that leaves its range is a fault of this question alone.
        let problem = self.problem.afresh();
        let state = EarnedState { earned: 0.0, ..state.clone() };
        let decision = self.decided(&problem, step, &state, (&self.law(seen), radius_scale));
        problem.fault().map_or(decision, |fault| Err(fault.clone()))
    }

    /// Returns what the periods from this one on are worth by the surrogate of its own step, against the worst laws, as of
    /// the period. That step is never solved for it, so the document alone says it: `docs/policy-format.md`. Cost: one
    /// prediction. Checked by: `tests/project/policy_format.rs`.
    ///
    /// # Errors
    /// The first period, whose step has no surrogate, and those of [`Self::decide`].
    pub fn predicted(&self, period: usize, state: &BTreeMap<String, f64>, noises: &[f64]) -> Result<f64, FieldError> {
        let (step, state, seen) = self.situation(period, Some(state), noises)?;
        let worth = self.worth_after(step, &state, &seen).ok_or_else(|| {
            FieldError::new("period", period, "must be after the first, whose step is solved where it is asked for")
        })?;
        Ok(worth / self.problem.discounted(step))
    }

    /// Returns the worth of a state with what was earned, as of the start, by the surrogate of its step; `None` at step 0.
    pub fn worth_after(&self, step: usize, state: &EarnedState, seen: &[f64]) -> Option<f64> {
        let features = self.controlled.step(&self.problem, step).features(state, &self.law(seen));
        let gain = self.controlled.gain(step, &features)?;
        Some(self.problem.worth(gain, self.problem.baseline(step, state)))
    }

    /// Returns the uncertainty set once these noises, in the unit of the solver, were seen. Its radius and its moments are
    /// in the noise's own unit.
    pub fn uncertainty(&self, seen: &[f64]) -> Uncertainty {
        let law = self.law(seen);
        let Measure { radius, quantile } = self.controlled.measure(&law);
        let own = law.atoms().iter().map(|scaled| self.problem.noise(*scaled));
        let moment = |power: usize| {
            let terms = own.clone().zip(law.weights()).map(|(noise, weight)| weight * noise.powi(power as i32));
            terms.sum::<f64>() / law.total_weight()
        };
        Uncertainty {
            sample_size: self.specification.problem.history.len() + seen.len(),
            effective_size: law.effective_size(),
            moments: (1..=self.specification.surrogate.moment_count).map(moment).collect(),
            quantile,
            radius: radius * self.problem.noise_width(),
        }
    }

    /// Returns the law that is known once so many noises were seen.
    pub fn law(&self, seen: &[f64]) -> EmpiricalDistribution {
        let own = &self.specification.problem;
        let mut law = own.learning.law(&own.history);
        if own.framework.learns() {
            law.extend(seen);
        }
        law
    }

    /// Solves a step of the declared problem at a state, with the noises that were seen in the unit of the solver.
    ///
    /// # Errors
    /// A worth that is no number. A state that leaves its range is a fault of `problem`.
    pub fn solved(
        &self,
        problem: &Declared,
        step: usize,
        state: &EarnedState,
        seen: &[f64],
    ) -> Result<ControlledSolution, FieldError> {
        let found = self.controlled.step(problem, step).solve(state, &self.law(seen));
        finite(found, problem, step, state)
    }

    fn decided(
        &self,
        problem: &Declared,
        step: usize,
        state: &EarnedState,
        (law, radius_scale): (&EmpiricalDistribution, f64),
    ) -> Result<Decided, FieldError> {
        for (name, set) in problem.actions_named().iter().zip(problem.actions(step, state)) {
            if let ActionSet::Interval(ActionInterval { lowest, highest }) = set
                && (lowest > highest || lowest.is_nan() || highest.is_nan())
            {
                let rule = format!("must have `low` at most `high`; they are {lowest} and {highest}");
                return Err(FieldError::new(format!("problem.actions.{name}"), problem.named(step, state), rule));
            }
        }
        let bellman = ControlledStep { radius_scale, ..self.controlled.step(problem, step) };
        let (found, worths) = bellman.solve_with_worths(state, law);
        let found = finite(found, problem, step, state)?;
        let names = problem.actions_named();
        let has_several = |place: &usize| worths[*place].as_ref().is_some_and(|worths| has_several_peaks(worths));
        let earned_later = problem.discounted(step);
        Ok(Decided {
            period: step + 1,
            actions: names.iter().cloned().zip(found.actions.iter().copied()).collect(),
            several_peaks: (0..names.len()).filter(has_several).map(|place| names[place].clone()).collect(),
            value: found.certainty_equivalent / earned_later,
            radius: radius_scale * self.controlled.radius(law) * problem.noise_width(),
            worst_law: moves(&found.adversary, problem),
            duality_gap: found.duality_gap / earned_later,
            value_error: self.value_error(step, found.certainty_equivalent).map(|error| error / earned_later),
            untrained_share: self.untrained_share(&bellman, (state, law), &found.actions, &found.adversary),
        })
    }

    /// Returns the error of a worth by the values of the step after, as of the start: 0 after the last step, which is exact.
    /// `None` if the policy was not trained to an accuracy.
    pub fn value_error(&self, step: usize, worth: f64) -> Option<f64> {
        self.specification.design.accuracy?;
        let after =
            self.policy.steps.get(step).map_or(Some(0.0), |after| Some(after.diagnostics.expected_error?.total));
        after.map(|error| self.problem.error_amount(error, worth))
    }

    /// Returns the share of the outcomes under the worst law that lead out of the design of the step after.
    fn untrained_share(
        &self,
        bellman: &ControlledStep<'_, Declared>,
        (state, law): (&EarnedState, &EmpiricalDistribution),
        actions: &[f64],
        adversary: &Adversary,
    ) -> f64 {
        let trained = self.policy.steps.get(bellman.step).and_then(|step| step.solution.surrogates());
        let Some((stored, factor)) = trained.zip(self.factors.get(bellman.step)) else { return 0.0 };
        let process = factor.process(&self.kept, stored);
        let is_inside = |features: &Features| {
            let input = stored.scaling.apply(features);
            process
                .as_ref()
                .as_ref()
                .is_some_and(|found| found.latent_variance(&input).sqrt() <= stored.deviation_limit)
        };
        let (noises, counts) = outcomes(adversary);
        let next = bellman.features_after(state, law, actions, &noises);
        let outside = next.iter().zip(counts).filter(|(features, _)| !is_inside(features)).map(|(_, count)| count);
        outside.sum::<usize>() as f64 / OUTCOMES as f64
    }
}

fn finite(
    found: ControlledSolution,
    problem: &Declared,
    step: usize,
    state: &EarnedState,
) -> Result<ControlledSolution, FieldError> {
    let rule = "must have actions whose worth is a number";
    found.finite(step, 0).map_err(|_| FieldError::new("problem", problem.named(step, state), rule))
}

/// Returns outcomes of a worst law that are equally likely, ascending: all that differ, and how often each is there.
fn outcomes(adversary: &Adversary) -> (Vec<f64>, Vec<usize>) {
    let Adversary::Transport { support, moves } = adversary else { return (Vec::new(), Vec::new()) };
    let mut masses: Vec<(f64, f64)> = moves.iter().map(|moved| (support[moved.to], moved.mass)).collect();
    masses.sort_by(|left, right| left.0.total_cmp(&right.0));
    let whole: f64 = masses.iter().map(|(_, mass)| mass).sum();
    let (mut noises, mut counts, mut below) = (Vec::new(), Vec::new(), 0.0);
    for (noise, mass) in masses {
        let before = counts.iter().sum::<usize>();
        below += mass;
        // The outcomes are the quantiles in the middles of equal shares.
        let until = ((below / whole * OUTCOMES as f64 + 0.5) as usize).min(OUTCOMES);
        match noises.last() {
            Some(last) if *last == noise => counts[noises.len() - 1] += until - before,
            _ if until > before => {
                noises.push(noise);
                counts.push(until - before);
            }
            _ => {}
        }
    }
    (noises, counts)
}

/// Returns true if values rise again after they fell.
fn has_several_peaks(values: &[f64]) -> bool {
    let [least, most] = range(values.iter().copied());
    // The lower of the highest values on both sides, less the value.
    let mut highest_before = f64::NEG_INFINITY;
    (0..values.len()).any(|place| {
        highest_before = highest_before.max(values[place]);
        let highest_after = values[place..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        highest_before.min(highest_after) - values[place] > DENT * (most - least)
    })
}

fn moves(adversary: &Adversary, problem: &Declared) -> Vec<NoiseMove> {
    let Adversary::Transport { support, moves } = adversary else { return Vec::new() };
    let moved = moves.iter().filter(|moved| moved.mass > LEAST_MOVED);
    let named = moved.map(|moved| NoiseMove {
        from: problem.noise(support[moved.from]),
        to: problem.noise(support[moved.to]),
        share: moved.mass,
    });
    named.collect()
}
