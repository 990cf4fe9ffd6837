//! Advice for a single period, for a problem that no policy was trained for. The robust step at the horizon is solved
//! exactly and needs no surrogate.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use super::document::Policy;
use super::levels::{LevelsAdvised, WhyNothing};
use super::sensitivity::{AdviceVariants, Premium, Sensitivity, check_learning};
use super::worst_case::WorstCase;
use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::problem::state::State;
use crate::control::request::annualised::premium;
use crate::control::request::caution::CautionLevel;
use crate::control::request::framework::Framework;
use crate::control::request::specification::{ProblemSpecification, Specification};
use crate::control::solved_step::StepSolution;
use crate::control::uncertainty::radius::RadiusEstimator;
use crate::numerics::law::empirical::EmpiricalDistribution;

/// An investor whose horizon is the end of this period.
pub struct OnePeriod {
    advisor: Advisor,
    kept: Cache,
}

impl OnePeriod {
    /// Prepares a completed specification of horizon 1, with the cache `kept`.
    pub fn new(specification: &Specification, kept: Cache) -> Self {
        let policy = Policy::new(specification.clone(), vec![StepSolution::unsolved(0)]);
        OnePeriod { advisor: Advisor::with(policy, kept.clone()), kept }
    }

    /// Finds the levels of caution from the record, if the investor follows one of them. Cost: as
    /// [`Specification::resolved`].
    #[must_use]
    pub fn resolved(&self) -> Self {
        OnePeriod::new(&self.advisor.specification().clone().resolved(&self.kept), self.kept.clone())
    }

    /// Returns the investor at another level of those computed.
    #[must_use]
    pub fn at(&self, level: CautionLevel) -> Self {
        self.of(ProblemSpecification { caution: Some(level), ..self.problem().clone() })
    }

    /// Returns the investor with the radius multiplied by `factor`, if it is simulated.
    #[must_use]
    pub fn within(&self, factor: f64) -> Self {
        let radius = Some(self.problem().radius_rule().scaled(factor));
        self.of(ProblemSpecification { radius, ..self.problem().clone() })
    }

    fn of(&self, problem: ProblemSpecification) -> Self {
        let specification = Specification { problem, ..self.advisor.specification().clone() };
        OnePeriod::new(&specification, self.kept.clone())
    }

    /// Returns the seed of its simulations.
    pub fn seed(&self) -> u64 {
        self.advisor.specification().seed
    }

    /// Returns the advice at each level, if the levels were computed. Cost: six robust steps.
    ///
    /// # Errors
    /// As [`Self::advise`].
    pub fn levels(&self, holding: f64) -> Result<Option<LevelsAdvised>, FieldError> {
        let problem = self.problem();
        let (Some(found), Some(followed)) = (&problem.levels, problem.caution) else { return Ok(None) };
        let state = self.state(holding)?;
        let at = |share: f64| {
            Some(self.at(CautionLevel::Scale(share)).advisor.advise(0, &state, AdviceMode::Resolve).allocation)
        };
        Ok(Some(LevelsAdvised::of(found, followed, at)))
    }

    /// Returns why `advice` holds nothing, if it does and its set is a ball. Cost: a robust step.
    ///
    /// # Errors
    /// As [`Self::advise`].
    pub fn why_nothing(&self, holding: f64, advice: &Advice) -> Result<Option<WhyNothing>, FieldError> {
        let problem = self.problem();
        if advice.allocation > 0.0 || !problem.framework.has_ball() {
            return Ok(None);
        }
        let state = self.state(holding)?;
        let (premium_seen, standard_error) = premium(&problem.history, problem.rate_per_step);
        let half = || self.within(0.5).advisor.advise(0, &state, AdviceMode::Resolve).allocation;
        Ok(Some(WhyNothing {
            premium_seen,
            standard_error,
            premium_left: Some(self.advisor.laws().worst_mean(&state.law) - (1.0 + problem.rate_per_step)),
            at_half_the_caution: (problem.radius_rule().paths() > 0).then(half),
        }))
    }

    /// Returns the bytes of the bridges that its radius needs.
    pub fn bridges(&self) -> usize {
        self.advisor.laws().radii.heaviest(self.problem().history.len(), 1)
    }

    /// Returns the advice for an investor with the share `holding` of the initial wealth in the asset, and the worst
    /// law behind it. Cost: the radius, and a robust step.
    ///
    /// # Errors
    /// A holding that is no share, or one whose sale leaves less than the withdrawals.
    pub fn advise(&self, holding: f64) -> Result<(Advice, WorstCase), FieldError> {
        let state = self.state(holding)?;
        self.advisor.check_withdrawals(&state)?;
        Ok(self.advisor.explain(0, &state))
    }

    /// Returns the sensitivity of that advice. Another record replaces the history; a calibrated radius keeps its
    /// factor. Cost: as [`Advisor::sensitivity`].
    ///
    /// # Errors
    /// A holding that is no share.
    pub fn sensitivity(&self, holding: f64, advice: &Advice) -> Result<Sensitivity, FieldError> {
        self.of_variants(holding, advice, |variants| variants.sensitivity())
    }

    /// Returns the mean at which `advice`, of an investor who holds nothing yet, leaves the bank, as
    /// [`Sensitivity::premium`] does. Cost: some thirty robust steps.
    ///
    /// # Errors
    /// As [`Self::advise`].
    pub fn premium(&self, advice: &Advice) -> Result<Premium, FieldError> {
        self.of_variants(0.0, advice, |variants| variants.premium_now())
    }

    /// Returns the number of further returns, of the law of the record, after which `advice` is more than `share`; `None`
    /// as for [`Premium::periods_more`]. Cost: some fifteen robust steps.
    ///
    /// # Errors
    /// As [`Self::advise`].
    pub fn periods_until(&self, advice: &Advice, share: f64) -> Result<Option<usize>, FieldError> {
        self.of_variants(0.0, advice, |variants| variants.periods_until(share))
    }

    /// Answers from the variants of `advice` for an investor with the share `holding` in the asset.
    fn of_variants<T>(
        &self,
        holding: f64,
        advice: &Advice,
        answer: impl FnOnce(&AdviceVariants<'_>) -> T,
    ) -> Result<T, FieldError> {
        let state = self.state(holding)?;
        let of = self.by_record(&state);
        Ok(self.advisor.with_variants(0, &state, &self.problem().history, (advice, &of), answer))
    }

    /// Returns the allocation that `count` further returns of this size would lead to. Cost: a robust step.
    ///
    /// # Errors
    /// As [`Self::advise`].
    pub fn after(&self, log_return: f64, count: usize) -> Result<f64, FieldError> {
        let state = self.state(0.0)?;
        let record = [&self.problem().history[..], &vec![log_return; count]].concat();
        Ok(self.by_record(&state)(&record))
    }

    /// Returns the law of the record.
    ///
    /// # Errors
    /// As [`Self::radius`].
    pub fn law(&self) -> Result<EmpiricalDistribution, FieldError> {
        Ok(self.state(0.0)?.law)
    }

    /// Returns the allocation in `state` as a function of the record. A calibrated radius keeps its factor.
    fn by_record<'a>(&'a self, state: &'a State) -> impl Fn(&[f64]) -> f64 + Sync + 'a {
        let radius = Some(RadiusEstimator::new(self.advisor.specification(), self.kept.clone()).calibrated_rule());
        move |record: &[f64]| {
            // The rule found already includes the level's share.
            let caution = Some(CautionLevel::Paper);
            let problem = ProblemSpecification { history: record.to_vec(), radius, caution, ..self.problem().clone() };
            let law = self.problem().learning.law(record);
            let state = State { law, ..*state };
            self.of(problem).advisor.advise(0, &state, AdviceMode::Resolve).allocation
        }
    }

    /// Checks that some return changes the advice, and that other records can be advised.
    ///
    /// # Errors
    /// Under the name `sensitivity`: the framework is `known_law`, which uses no returns, or the centre has a column, which
    /// belongs to this record.
    pub fn check_sensitivity(&self) -> Result<(), FieldError> {
        if self.problem().centre.has_column() {
            let rule = "must be false if the centre has a column: it has no figures for other records";
            return Err(FieldError::new("sensitivity", true, rule));
        }
        check_learning(self.problem(), self.problem().framework != Framework::KnownLaw)
    }

    fn state(&self, holding: f64) -> Result<State, FieldError> {
        self.advisor.initial_state(None, None)?.with_holding(holding)
    }

    /// Returns the radius of the set.
    ///
    /// # Errors
    /// The history breaks a rule, which a completed one does not.
    pub fn radius(&self) -> Result<f64, FieldError> {
        Ok(self.advisor.radius(&self.state(0.0)?))
    }

    /// Returns the completed problem.
    pub fn problem(&self) -> &ProblemSpecification {
        &self.advisor.specification().problem
    }
}
