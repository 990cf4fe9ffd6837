//! The plan of every period.

use super::by_state::{ByState, DescribedBy};
use crate::control::bellman::solution::Adversary;
use crate::control::controlled_grid::{GridStep, solve_on_grid};
use crate::control::error::TrainError;
use crate::control::policy::advice::{Advice, SpendingAdvice};
use crate::control::policy::advisor::Advisor;
use crate::control::policy::worst_case::{TransportedMass, WorstCase};
use crate::control::problem::actions::Band;
use crate::control::problem::drawdown::DrawdownLimit;
use crate::control::problem::goal::Goal;
use crate::control::problem::state::State;
use crate::control::request::plan::{PlanAim, PlanQuestion};
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::spending::Spending;
use crate::control::uncertainty::Reach;

/// A solved plan.
pub(super) struct Solved {
    pub(super) advice: Advice,
    /// The law that is worst for it; `None` if what is held depends on the state.
    pub(super) worst_case: Option<WorstCase>,
    pub(super) described: DescribedBy,
    pub(super) periods: Vec<PeriodPlan>,
    /// The payments of each period and the reserve before them, in money of now; empty if nothing is secured or aimed at.
    pub(super) reserves: Vec<[f64; 2]>,
}

/// The plan of a period.
pub(super) struct PeriodPlan {
    /// The share of wealth, or of the surplus beside what is secured, that is spent.
    pub(super) spent: ByState,
    /// The share held, of what is left or of the surplus that is left.
    pub(super) held: ByState,
    /// The worst laws of the states.
    pub(super) transports: Vec<Vec<TransportedMass>>,
}

impl Solved {
    /// Solves every period.
    ///
    /// # Errors
    /// The start breaks a rule, or a step has no finite solution.
    pub(super) fn new(advisor: &Advisor, question: &PlanQuestion) -> Result<Self, TrainError> {
        match (question.aim, question.drawdown_limit) {
            (PlanAim::Goal, _) => Solved::of_goal(advisor, question),
            (PlanAim::Spending, Some(limit)) => Solved::of_drawdown(advisor, limit, question.drawdown),
            (PlanAim::Spending, None) => Solved::of_spending(advisor),
        }
    }

    /// Solves every period with the surplus of the start: the reserve of a later period may exceed the wealth of the start.
    fn of_spending(advisor: &Advisor) -> Result<Self, TrainError> {
        let start = advisor.initial_state(None, None)?;
        let problem = &advisor.specification().problem;
        let reserves = reserves_of(problem);
        let reserve = |step: usize| reserves.get(step).map_or(0.0, |[_, reserve]| *reserve);
        let explain = |step: usize| {
            let wealth = if step == 0 { start.wealth } else { start.wealth - reserve(0) + reserve(step) };
            let (advice, worst_case) = advisor.explain(step, &State { wealth, ..start.clone() });
            let planned = PeriodPlan::of(&advice, &worst_case, wealth);
            (advice, worst_case, planned)
        };
        let (advice, worst_case, first) = explain(0);
        let later = (1..problem.horizon).map(|step| explain(step).2);
        Ok(Solved {
            periods: std::iter::once(first).chain(later).collect(),
            advice,
            worst_case: Some(worst_case),
            described: DescribedBy::Period,
            reserves: real(problem, reserves),
        })
    }

    fn of_goal(advisor: &Advisor, question: &PlanQuestion) -> Result<Self, TrainError> {
        let specification = advisor.specification();
        let problem = &specification.problem;
        let wealth = problem.initial_wealth;
        let (amount, wanted) = (question.spent_to_goal(), question.goal.unwrap_or(0.0));
        let payments =
            Spending { secured: amount, secured_left: wanted, inflation: problem.inflation(), ..Spending::default() };
        let reserves = real(problem, payments.reserves(problem.rate_per_step, problem.horizon));
        let goal = Goal::new(problem, amount, wanted, reserves.iter().map(|[_, reserve]| *reserve));
        let steps = solve_on_grid(&goal, specification, advisor.laws())?;
        let first = &steps[0].found[0];
        let planned = |(step, found): (usize, &GridStep)| {
            let planned = PeriodPlan::on_grid(found, |_, _| 0.0);
            PeriodPlan { held: planned.held.where_decided(|state| goal.decides(step, state)), ..planned }
        };
        let spent = amount.clamp(0.0, wealth);
        let spending = SpendingAdvice { share: spent / wealth, amount: spent, secured: 0.0, reserve: 0.0 };
        let advice = Advice {
            // The goal less the expected shortfall against the worst law, and the same in the bank.
            certainty_equivalent: wanted - goal.shortfall(first.certainty_equivalent),
            floor: wanted - goal.shortfall_in_bank(0, wealth),
            ..decided(advisor, first.actions[0], spending)?
        };
        Ok(Solved {
            advice,
            worst_case: None,
            described: DescribedBy::Funds,
            periods: steps.iter().enumerate().map(planned).collect(),
            reserves,
        })
    }

    fn of_drawdown(advisor: &Advisor, limit: f64, drawdown: f64) -> Result<Self, TrainError> {
        let specification = advisor.specification();
        let problem = &specification.problem;
        let laws = advisor.laws();
        let law = problem.learning.law(&problem.history);
        // The support is around the centre, which may lie elsewhere than the record.
        let set = laws.uncertainty_set(&law);
        let lowest = set.exact_returns(Reach::FIRST).into_iter().fold(laws.least_return(&law), f64::min);
        let limited = DrawdownLimit::new(problem, limit, drawdown, lowest);
        let steps = solve_on_grid(&limited, specification, laws)?;
        let first = &steps[0].found[0];
        let (wealth, share) = (problem.initial_wealth, limited.share(0, first.gain));
        let spending = SpendingAdvice { share, amount: share * wealth, secured: 0.0, reserve: 0.0 };
        let advice = Advice {
            certainty_equivalent: wealth * limited.sure_level(first.gain),
            ..decided(advisor, first.actions[0], spending)?
        };
        let planned = |(step, found): (usize, &GridStep)| {
            PeriodPlan::on_grid(found, |place, _| limited.share(step, found.found[place].gain))
        };
        Ok(Solved {
            advice,
            worst_case: None,
            described: DescribedBy::Unit,
            periods: steps.iter().enumerate().map(planned).collect(),
            reserves: Vec::new(),
        })
    }
}

/// Returns the advice of the plan without aim or limit, with what is held and spent instead.
fn decided(advisor: &Advisor, allocation: f64, spending: SpendingAdvice) -> Result<Advice, TrainError> {
    let (advice, _) = advisor.explain(0, &advisor.initial_state(None, None)?);
    let trade = allocation - advice.holding;
    Ok(Advice { allocation, band: Band::of(&[allocation]), trade, spending: Some(spending), ..advice })
}

impl PeriodPlan {
    fn of(advice: &Advice, worst_case: &WorstCase, wealth: f64) -> Self {
        let spent = advice.spending.map_or(0.0, |spending| spending.share_of_surplus(wealth));
        let surplus = advice.spending.map_or(1.0, |spending| spending.surplus_left(wealth));
        let held = if surplus > 0.0 { advice.allocation / surplus } else { 0.0 };
        PeriodPlan {
            spent: ByState::always(spent),
            held: ByState::always(held),
            transports: vec![worst_case.transport.clone()],
        }
    }

    /// Returns the plan of a step on a grid, where `spent` gives the share of a place of it and its number.
    fn on_grid(step: &GridStep, spent: impl Fn(usize, f64) -> f64) -> Self {
        let shares = |of: &dyn Fn(usize) -> f64| ByState {
            states: step.nodes.clone(),
            shares: (0..step.nodes.len()).map(of).collect(),
        };
        PeriodPlan {
            spent: shares(&|place| spent(place, step.nodes[place])),
            held: shares(&|place| step.found[place].actions[0]),
            transports: step.found.iter().map(|found| transported(&found.adversary)).collect(),
        }
    }
}

/// Returns the moves of a law in the order of the returns that they leave.
fn transported(adversary: &Adversary) -> Vec<TransportedMass> {
    let Adversary::Transport { support, moves } = adversary else { return Vec::new() };
    let mut moves = moves.clone();
    moves.sort_by_key(|moved| (moved.from, moved.to));
    moves
        .iter()
        .map(|moved| TransportedMass { atom: support[moved.from], moved_to: support[moved.to], mass: moved.mass })
        .collect()
}

/// Returns what is secured in each period and the reserve, in the money of each; empty if nothing is.
fn reserves_of(problem: &ProblemSpecification) -> Vec<[f64; 2]> {
    let secured = problem.spending.as_ref().filter(|spending| spending.secures());
    secured.map_or_else(Vec::new, |spending| spending.reserves(problem.rate_per_step, problem.horizon))
}

/// Returns reserves in money of now.
fn real(problem: &ProblemSpecification, reserves: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let prices = 1.0 + problem.inflation();
    let of_now = |(period, amounts): (usize, [f64; 2])| amounts.map(|amount| amount / prices.powf(period as f64));
    reserves.into_iter().enumerate().map(of_now).collect()
}
