//! How what-if questions are read: the hypotheses that they ask about.

use crate::control::error::FieldError;
use crate::control::policy::advisor::AdviceMode;
use crate::control::policy::what_if::{Hypothesis, HypotheticalRadius};
use crate::control::request::{radius_rules, rules};
use crate::service::advice::sweep::SweepRange;
use crate::service::advice::what_if::WhatIf;
use crate::service::advice::what_if_problem::ProblemHypothesis;
use crate::service::entries::report::{OF_INVESTORS, OF_ONE, OF_SEVERAL, Report, log_return_of, none_of};

impl WhatIf {
    pub(super) fn hypothesis(&self) -> Result<Hypothesis, FieldError> {
        let log_return = match (self.log_return, self.simple_return) {
            (Some(_), Some(value)) => {
                return Err(FieldError::new("simple_return", value, "must be absent if log_return is given"));
            }
            (None, Some(value)) => Some(log_return_of("simple_return", value)?),
            (log_return, None) => log_return,
        };
        let radius = match (self.radius_scale, self.radius) {
            (Some(_), Some(value)) => {
                return Err(FieldError::new("radius", value, "must be absent if radius_scale is given"));
            }
            (Some(scale), None) => Some(HypotheticalRadius::Scaled(scale)),
            (None, radius) => radius.map(HypotheticalRadius::Fixed),
        };
        let hypothesis = Hypothesis { wealth: self.wealth, holding: self.holding, log_return, radius };
        hypothesis.check()?;
        Ok(hypothesis)
    }

    /// Returns every hypothesis of the request in order. Checking the ends of the ranges covers all values between.
    pub(super) fn hypotheses(&self) -> Result<Vec<Hypothesis>, FieldError> {
        let Some(sweep) = &self.sweep else { return Ok(vec![self.hypothesis()?]) };
        type Field = fn(&mut WhatIf) -> &mut Option<f64>;
        let fields: [(&str, Option<SweepRange>, Field); 6] = [
            ("wealth", sweep.wealth, |request| &mut request.wealth),
            ("holding", sweep.holding, |request| &mut request.holding),
            ("radius_scale", sweep.radius_scale, |request| &mut request.radius_scale),
            ("radius", sweep.radius, |request| &mut request.radius),
            ("log_return", sweep.log_return, |request| &mut request.log_return),
            ("simple_return", sweep.simple_return, |request| &mut request.simple_return),
        ];
        let given: Vec<_> = fields.iter().filter_map(|(name, range, field)| Some((*name, (*range)?, *field))).collect();
        let [(name, range, field)] = given[..] else {
            return Err(FieldError::new("sweep", format!("{} ranges", given.len()), "must hold exactly one range"));
        };
        let mut point = self.clone();
        if let Some(value) = *field(&mut point) {
            return Err(FieldError::new(name, value, format!("must be absent if sweep.{name} is given")));
        }
        let mut at = |value: f64| {
            *field(&mut point) = Some(value);
            point.hypothesis()
        };
        // Rules are intervals: if both ends keep them, all values between do.
        for (end, value) in [("from", range.from), ("to", range.to)] {
            at(value).map_err(|error| match error.field == name {
                true => FieldError { field: format!("sweep.{name}.{end}"), ..error },
                false => error,
            })?;
        }
        range.values(name)?.into_iter().map(at).collect()
    }

    /// Returns every hypothesis about a declared problem in order.
    ///
    /// # Errors
    /// A field of an investor is given, or a number is out of bounds.
    pub(super) fn of_problem(&self) -> Result<Vec<ProblemHypothesis>, FieldError> {
        let sweep = self.sweep.clone().unwrap_or_default();
        let of_investors = [
            ("wealth", self.wealth.is_some()),
            ("holding", self.holding.is_some()),
            ("radius", self.radius.is_some()),
            ("log_return", self.log_return.is_some()),
            ("simple_return", self.simple_return.is_some()),
            ("holdings", self.holdings.is_some()),
            ("log_returns", self.log_returns.is_some()),
            ("simple_returns", self.simple_returns.is_some()),
            ("prices", self.prices.is_some()),
            ("previous_prices", self.previous_prices.is_some()),
            ("sweep.wealth", sweep.wealth.is_some()),
            ("sweep.holding", sweep.holding.is_some()),
            ("sweep.radius", sweep.radius.is_some()),
            ("sweep.log_return", sweep.log_return.is_some()),
            ("sweep.simple_return", sweep.simple_return.is_some()),
        ];
        none_of(&of_investors, OF_INVESTORS)?;
        let own = ProblemHypothesis { noise: self.noise, radius_scale: self.radius_scale };
        let all = match (sweep.radius_scale, sweep.noise) {
            (None, None) if self.sweep.is_none() => vec![own],
            (Some(range), None) if self.radius_scale.is_none() => {
                let at = |scale| ProblemHypothesis { radius_scale: Some(scale), ..own };
                range.values("radius_scale")?.into_iter().map(at).collect()
            }
            (None, Some(range)) if self.noise.is_none() => {
                let at = |noise| ProblemHypothesis { noise: Some(noise), ..own };
                range.values("noise")?.into_iter().map(at).collect()
            }
            _ => {
                let rule = "must hold exactly one range, radius_scale or noise, of a field that is not given beside it";
                return Err(FieldError::new("sweep", "given", rule));
            }
        };
        let (low, high) = radius_rules::RADIUS_SCALE;
        let scales = all.iter().filter_map(|hypothesis| hypothesis.radius_scale);
        scales.into_iter().try_for_each(|scale| rules::within("radius_scale", scale, low, high))?;
        Ok(all)
    }

    /// Lists the fields of a declared problem, and whether each is given.
    pub(super) fn of_declared(&self) -> [(&'static str, bool); 3] {
        let sweep = self.sweep.as_ref().is_some_and(|sweep| sweep.noise.is_some());
        [("state", self.state.is_some()), ("noise", self.noise.is_some()), ("sweep.noise", sweep)]
    }

    /// Rejects fields that do not fit a session of one asset or of several.
    pub(super) fn fits(&self, several: bool) -> Result<(), FieldError> {
        let sweep = self.sweep.clone().unwrap_or_default();
        if several {
            let of_one = [
                ("holding", self.holding.is_some()),
                ("log_return", self.log_return.is_some()),
                ("simple_return", self.simple_return.is_some()),
                ("sweep.holding", sweep.holding.is_some()),
                ("sweep.log_return", sweep.log_return.is_some()),
                ("sweep.simple_return", sweep.simple_return.is_some()),
            ];
            return none_of(&of_one, OF_ONE);
        }
        let returns = self.report().map(|(field, _)| (field, true));
        let of_several: Vec<_> = [("holdings", self.holdings.is_some())].into_iter().chain(returns).collect();
        none_of(&of_several, OF_SEVERAL)
    }

    /// Returns the hypothetical report of several assets for the coming period, and the field that gives it.
    pub(super) fn report(&self) -> Option<(&'static str, Report)> {
        let WhatIf { log_returns, simple_returns, prices, previous_prices, .. } = self.clone();
        let field = match (&log_returns, &simple_returns, &prices, &previous_prices) {
            (Some(_), ..) => "log_returns",
            (None, Some(_), ..) => "simple_returns",
            (None, None, Some(_), _) => "prices",
            (None, None, None, Some(_)) => "previous_prices",
            _ => return None,
        };
        Some((field, Report { log_returns, simple_returns, prices, previous_prices, ..Report::default() }))
    }

    pub(super) fn mode(&self) -> AdviceMode {
        let solves = self.sweep.is_some() || self.explain.is_some();
        if solves { AdviceMode::Resolve } else { AdviceMode::Surrogate }
    }

    /// Renames the field of an error about the hypothetical return to the one that the request used.
    pub(super) fn renamed(&self, error: FieldError) -> FieldError {
        let sweep = self.sweep.clone().unwrap_or_default();
        let given = match error.field.as_str() {
            "log_return" if sweep.log_return.is_some() => "sweep.log_return",
            "log_return" if sweep.simple_return.is_some() => "sweep.simple_return",
            "log_return" if self.simple_return.is_some() => "simple_return",
            _ => return error,
        };
        FieldError { field: given.into(), ..error }
    }
}
