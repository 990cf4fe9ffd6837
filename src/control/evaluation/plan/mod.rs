//! A plan: what to spend and what to hold, period after period to a horizon, and how it fares.
//!
//! The plan is the policy of a problem with spending whose ball stays that of the record
//! (`control/problem/spending.rs`): one share of wealth to spend and one to hold in each period. If it aims at a goal or
//! limits the drawdown, the shares depend on one number besides (`control/problem/goal.rs`, `drawdown.rs`). It is followed on paths
//! drawn from the centre of the ball, and on the same paths with each return moved as the worst law of its period moves
//! it. Simple rules are followed beside it on both.
//!
//! Checked by: `tests/solver/plan.rs` and `tests/solver/aims.rs`.

mod by_state;
mod course;
mod over_time;
mod periods;
pub mod report;
mod utility;
pub mod words;

use std::collections::BTreeMap;

use self::by_state::ByState;
use self::course::{Market, PeriodReturns, ReturnPaths, SpendingRule, Spends};
use self::periods::{PeriodPlan, Solved};
use self::report::{
    BreakingReturn, InBothWorlds, PlanReport, PlanRule, PlanStrategy, SustainableSpending, WantedSpending,
};
use self::utility::{Followed, SpendingUtility};
use crate::control::assets::advice::AssetsAdvice;
use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::futures::World;
use crate::control::policy::one_period::OnePeriod;
use crate::control::progress::Watch;
use crate::control::request::annualised::premium;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::caution::CautionLevel;
use crate::control::request::plan::{PlanAim, PlanQuestion};
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::{ProblemSpecification, Specification};
use crate::control::training::Training;
use crate::numerics::bridge::funds::fund_returns;
use crate::numerics::statistics::summary::{Clustered, Estimate};

/// Confidence level of all intervals.
const LEVEL: f64 = 0.95;
/// The share of simple rules in the risky asset, and what they spend a year.
const SIXTY: f64 = 0.6;
const FOUR_PERCENT: f64 = 0.04;
/// The share of cases that count as poor.
const POOR: f64 = 0.05;
/// Largest shift of the log-returns of a period that is tried, and the halvings after which it is known to 2e-9.
const FARTHEST: f64 = 1.0;
const HALVINGS: usize = 30;
/// Share of a goal that rounding may take from it.
const ROUNDING: f64 = 1e-9;

/// A solved plan.
pub struct Plan {
    question: PlanQuestion,
    /// The completed problem.
    problem: ProblemSpecification,
    own: Solved,
    /// The plan without a ball.
    trusting: Solved,
    /// Shares of several assets in what is held.
    composition: Option<BTreeMap<String, f64>>,
}

impl Plan {
    /// Solves a plan, with the cache `kept`. Cost: the caution, and three robust steps a period; with an aim or a limit on
    /// the drawdown some tens of robust steps besides.
    ///
    /// # Errors
    /// A field breaks a rule, or a step has no finite solution.
    pub fn new(question: PlanQuestion, kept: &Cache) -> Result<Self, TrainError> {
        let advisor = |specification: &Specification| {
            let policy = Training::with(specification, kept.clone())?.run(&Watch::unwatched())?;
            Ok::<Advisor, TrainError>(Advisor::with(policy, kept.clone()))
        };
        let own = advisor(&question.specification()?)?;
        let problem = own.specification().problem.clone();
        let without_ball = ProblemSpecification {
            radius: Some(RadiusRule::Fixed { radius: 0.0 }),
            caution: Some(CautionLevel::Paper),
            levels: None,
            ..problem.clone()
        };
        let trusting = advisor(&Specification { problem: without_ball, ..own.specification().clone() })?;
        let (own, trusting) = (Solved::new(&own, &question)?, Solved::new(&trusting, &question)?);
        Ok(Plan { question, problem, own, trusting, composition: None })
    }

    /// Solves the plan of several assets. Its asset is their fund in the composition that is best for one period, with the
    /// radius that holds for all funds. Cost: the advice for one period besides.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_assets(question: &PlanQuestion<AssetsProblem>, kept: &Cache) -> Result<Self, TrainError> {
        let problem = &question.problem;
        let one_period = AssetsProblem { horizon: None, spending: None, ..problem.clone() };
        let fund = OnePeriod::new(&one_period.fund(question.seed)?, kept.clone());
        let (advice, _) = AssetsAdvice::of(&one_period, &vec![0.0; problem.assets.len()], &fund)?;
        let shares: Vec<f64> = problem.assets.iter().map(|name| advice.composition[name]).collect();
        let of_fund = problem.of_fund();
        let of_composition = ProblemSpecification {
            history: fund_returns(&problem.means.applied(&problem.history), &shares),
            radius: Some(of_fund.radius_rule().scaled(advice.radius_factor)),
            caution: of_fund.caution_level(),
            ..of_fund
        };
        let plan = Plan::new(question.about(of_composition), kept)?;
        Ok(Plan { composition: Some(advice.composition), ..plan })
    }

    /// Follows the plan and the simple rules, on the current pool. Cost O(paths horizon ln returns) for each.
    pub fn report(&self) -> PlanReport {
        let Plan { question, problem, own, .. } = self;
        let paths = self.paths();
        let rules = self.rules();
        let sample = Clustered::new(1, question.paths, LEVEL);
        let strategies: Vec<PlanStrategy> = rules.iter().map(|rule| self.strategy(&paths, rule, &sample)).collect();
        let mixes: &[&SpendingRule] = if self.has_goal() { &[] } else { &[&rules[0], &rules[2]] };
        let sustainable = mixes.iter().map(|rule| SustainableSpending {
            holding: rule.named,
            amount: in_both(|world| self.sustainable(&paths, world, rule, &sample)),
        });
        let wanted = self.wanted(&paths, &rules[0], &sample);
        let breaking = self.breaking(&paths, &rules[0], wanted.amount);
        let (annualised, warnings) = (problem.annualised(), problem.warnings());
        let mut report = PlanReport {
            sentences: Vec::new(),
            advice: own.advice.clone(),
            composition: self.composition.clone(),
            worst_case: own.worst_case.clone(),
            periods: self.planned(),
            states: self.states(),
            wanted,
            sustainable: sustainable.collect(),
            strategies,
            fan: self.fan(&paths, &rules[0]),
            breaking,
            annualised,
            warnings,
        };
        report.sentences = words::sentences(&report, &question.about(problem.clone()));
        report
    }

    /// Returns true if the plan aims at a goal.
    fn has_goal(&self) -> bool {
        self.question.aim == PlanAim::Goal
    }

    fn paths(&self) -> ReturnPaths {
        let Solved { periods, described, reserves, .. } = &self.own;
        let returns = periods.iter().map(|planned| PeriodReturns::new(&planned.held.states, &planned.transports));
        let market = Market {
            bank: 1.0 + self.problem.rate_per_step,
            prices: 1.0 + self.problem.inflation(),
            reserves: reserves.clone(),
            described: *described,
            drawdown: self.question.drawdown,
        };
        ReturnPaths::draw(returns.collect(), self.question.paths, self.question.seed, market)
    }

    /// Returns the plan, and the simple rules in the order of [`PlanRule`]: those of a year only if it is known how many
    /// periods it has.
    fn rules(&self) -> Vec<SpendingRule> {
        let problem = &self.problem;
        let spends = |planned: &[PeriodPlan]| match self.has_goal() {
            true => Spends::Amount(self.question.spent_to_goal()),
            false => Spends::Planned(planned.iter().map(|period| period.spent.clone()).collect()),
        };
        let follows = |named: PlanRule, planned: &[PeriodPlan]| SpendingRule {
            named,
            spends: spends(planned),
            held: planned.iter().map(|period| period.held.clone()).collect(),
            keeps_reserve: !self.has_goal(),
        };
        let sixty = vec![ByState::always(problem.action_interval[1].min(SIXTY)); problem.horizon];
        let holds =
            |named: PlanRule, spends: Spends| SpendingRule { named, spends, held: sixty.clone(), keeps_reserve: false };
        let mut rules = vec![
            follows(PlanRule::Plan, &self.own.periods),
            follows(PlanRule::Trusting, &self.trusting.periods),
            holds(PlanRule::SixtyForty, spends(&self.own.periods)),
        ];
        let spends_anything = self.question.saved.is_none();
        if let Some(periods) = problem.periods_per_year.filter(|_| spends_anything) {
            let share = FOUR_PERCENT / periods;
            let amount = share * problem.initial_wealth;
            rules.extend([
                holds(PlanRule::FourPercent, Spends::Amount(amount)),
                holds(PlanRule::ShareOfWealth, Spends::Share(share)),
            ]);
        }
        rules
    }

    fn strategy(&self, paths: &ReturnPaths, rule: &SpendingRule, sample: &Clustered) -> PlanStrategy {
        let utility = SpendingUtility::of(&self.problem, self.own.advice.certainty_equivalent);
        let follow = |world| {
            paths.follow((world, 1.0), rule, self.problem.initial_wealth, |course| Followed::of(course, &utility))
        };
        let followed = [follow(World::Record), follow(World::Worst)];
        let both =
            |of: &dyn Fn(&[Followed]) -> Estimate| InBothWorlds { record: of(&followed[0]), worst: of(&followed[1]) };
        let middle = |share: f64, of: &dyn Fn(&Followed) -> f64| {
            both(&|followed| quantile(&followed.iter().map(of).collect::<Vec<f64>>(), share, sample))
        };
        let reaches = |goal: f64| both(&|followed| sample.share(followed, |path| path.left >= goal * (1.0 - ROUNDING)));
        let short = |goal: f64| {
            let missing = |path: &Followed| path.unpaid + (goal - path.left).max(0.0);
            both(&|followed| sample.mean(&followed.iter().map(missing).collect::<Vec<f64>>()))
        };
        let utilities = |followed: &[Followed]| followed.iter().map(|path| path.utility).collect::<Vec<f64>>();
        let sure = || both(&|followed| utility.certainty_equivalent(&utilities(followed), sample));
        PlanStrategy {
            rule: rule.named,
            ruin: both(&|followed| sample.share(followed, |path| path.unpaid > 0.0)),
            mean_spending: middle(0.5, &|path| path.mean),
            lowest_spending: middle(0.5, &|path| path.lowest),
            poor_spending: middle(POOR, &|path| path.lowest),
            bequest: middle(0.5, &|path| path.left),
            reaches_goal: self.question.goal.map(reaches),
            shortfall: self.question.goal.map(short),
            max_drawdown: middle(1.0 - POOR, &|path| path.drawdown),
            certainty_equivalent: (!self.has_goal()).then(sure),
        }
    }

    fn sustainable(&self, paths: &ReturnPaths, world: World, rule: &SpendingRule, sample: &Clustered) -> Estimate {
        let wealth = self.problem.initial_wealth;
        let amounts: Vec<f64> =
            paths.sustainable(world, &rule.held, 1.0).into_iter().map(|of_one| wealth * of_one).collect();
        quantile(&amounts, 1.0 - self.question.certainty, sample)
    }

    fn wanted(&self, paths: &ReturnPaths, plan: &SpendingRule, sample: &Clustered) -> WantedSpending {
        let first = self.own.advice.spending.map_or(0.0, |spending| spending.amount);
        let amount = self.question.wanted.unwrap_or(first);
        let wealth = self.problem.initial_wealth;
        let lasts = |world| match self.has_goal() {
            true => {
                sample.share(&paths.follow((world, 1.0), plan, wealth, |course| course.unpaid), |left| *left == 0.0)
            }
            false => sample.share(&self.lasting(paths, plan, (world, 1.0), amount), |lasts| *lasts),
        };
        WantedSpending { amount, lasts: in_both(lasts) }
    }

    /// Returns for every path whether `amount` lasts in what the plan holds, or whether the goal is reached that the plan aims at.
    fn lasting(&self, paths: &ReturnPaths, plan: &SpendingRule, world: (World, f64), amount: f64) -> Vec<bool> {
        let wealth = self.problem.initial_wealth;
        match self.question.goal {
            // Who could not pay for everything has nothing left.
            Some(goal) if self.has_goal() => paths.follow(world, plan, wealth, |course| {
                course.wealth.last().is_some_and(|left| *left >= goal * (1.0 - ROUNDING))
            }),
            _ => {
                let all = paths.sustainable(world.0, &plan.held, world.1);
                all.into_iter().map(|of_one| wealth * of_one >= amount).collect()
            }
        }
    }

    /// Finds by halving the shift of all log-returns with which `amount` lasts, or the goal is reached that the plan aims at,
    /// with the certainty asked for.
    fn breaking(&self, paths: &ReturnPaths, plan: &SpendingRule, amount: f64) -> Option<BreakingReturn> {
        let problem = &self.problem;
        let lasts = |shift: f64| {
            let all = self.lasting(paths, plan, (World::Record, shift.exp()), amount);
            let lasting = all.iter().filter(|lasts| **lasts).count();
            lasting as f64 >= self.question.certainty * all.len() as f64
        };
        let (mut low, mut high) = (-FARTHEST, FARTHEST);
        if lasts(low) || !lasts(high) {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if lasts(middle) { high = middle } else { low = middle }
        }
        let mean_seen = problem.mean_return();
        let mean_return = high.exp() * (1.0 + mean_seen) - 1.0;
        let (_, error) = premium(&problem.history, problem.rate_per_step);
        Some(BreakingReturn { mean_return, mean_seen, standard_errors: (mean_return - mean_seen) / error })
    }
}

fn in_both(of: impl Fn(World) -> Estimate) -> InBothWorlds {
    InBothWorlds { record: of(World::Record), worst: of(World::Worst) }
}

fn quantile(values: &[f64], share: f64, sample: &Clustered) -> Estimate {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sample.quantile(values, &sorted, share)
}
