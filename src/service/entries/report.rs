//! The report of a period, and how it is read.

use std::collections::BTreeMap;
use std::sync::Arc;

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::by_name::distinct_if_given;
use crate::control::request::rules;
use crate::service::entries::change::Change;
use crate::service::entries::doubts::Doubt;

/// The range of prices: any currency, any quantity.
pub const PRICE: (f64, f64) = (1e-12, 1e15);
/// The range of prices at the end of a period, where 0 is a total loss.
pub const END_PRICE: (f64, f64) = (0.0, PRICE.1);
/// The range of simple returns in a report, where -1 is a total loss.
pub const REPORTED_RETURN: (f64, f64) = (-1.0, rules::SIMPLE_RETURN.1);
/// The most corrections of a session: a replay goes through all of them.
pub const MOST_CORRECTIONS: usize = 1_000;
/// The most characters of a reason.
pub const LONGEST_REASON: usize = 200;
const ONE_RETURN: &str = "must be the only one of log_return, simple_return, price and missing";
pub(in crate::service) const OF_SEVERAL: &str =
    "must be absent: the session has one asset, and the field is for several";
pub(in crate::service) const OF_DECLARED: &str =
    "must be absent: the session is of an investor, and the field is for declared problems";
pub(in crate::service) const OF_INVESTORS: &str =
    "must be absent: the session is of a declared problem, and the field is for investors";
pub(in crate::service) const OF_ONE: &str = "must be absent: the session has several assets, and the field is for one";

/// Defines a struct with its own fields and those of a report.
///
/// They form one struct because `serde` can reject unknown and repeated fields only if nothing is flattened.
macro_rules! reporting {
    ($(#[$meta:meta])* $name:ident { $($(#[$attribute:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($(#[$attribute])* pub $field: $kind,)*
            #[schema(example = 0.012)]
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub log_return: Option<f64>,
            /// `price / previous price - 1`; -1 is a total loss.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub simple_return: Option<f64>,
            /// Price at the end of the period; 0 is a total loss.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub price: Option<f64>,
            /// Price at the start of the period. Default: the price reported for the period before.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub previous_price: Option<f64>,
            /// Log-returns of several assets by name. Each has one, or null if its price did not come.
            #[schema(example = json!({ "stocks": 0.012, "bonds": 0.004 }))]
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub log_returns: Option<BTreeMap<String, Option<f64>>>,
            /// `price / previous price - 1` of several assets by name; -1 is a total loss. The return after a null
            /// covers every period since the last price.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub simple_returns: Option<BTreeMap<String, Option<f64>>>,
            /// Prices of several assets at the end of the period; 0 is a total loss.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub prices: Option<BTreeMap<String, Option<f64>>>,
            /// Prices of several assets at the start of the period, or the last one that came. Default: those reported
            /// before.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub previous_prices: Option<BTreeMap<String, Option<f64>>>,
            /// The noise that a declared problem's period brought.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub noise: Option<f64>,
            /// Actions that were executed in a declared problem's period, each by its name. Default: the advised ones.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub executed: Option<BTreeMap<String, f64>>,
            /// States that a declared problem's period led to, each by its name. Default: those that the formulas give.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub state: Option<BTreeMap<String, f64>>,
            /// Given instead of a return or a noise if none is known: the law does not change, and holdings count as unmoved.
            #[serde(default, skip_serializing_if = "std::ops::Not::not")]
            pub missing: bool,
            /// The last day of the period, later than that of the period before.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(value_type = Option<String>, format = Date, example = "2008-09-30")]
            pub date: Option<Date>,
            /// Rate that the bank paid in the period. Default: the policy's rate.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub rate: Option<f64>,
            /// Money added at the end of the period; negative if withdrawn. Default: the policy's contribution.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub flow: Option<f64>,
            /// Money spent from wealth at the start of the period. Default: what was advised; nothing without spending.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub spent: Option<f64>,
            /// Share of wealth held in the risky asset through the period. Default: the advised allocation.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub executed_allocation: Option<f64>,
            /// Share of wealth held in each of several assets through the period. Default: the advised allocations.
            #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "distinct_if_given")]
            pub executed_allocations: Option<BTreeMap<String, f64>>,
            /// Wealth reached, with what was added, if it differs from what the fields above give.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub wealth: Option<f64>,
        }
    };
}

reporting! {
    /// The record of a period: its return, given in exactly one of three ways or as missing, and the trades in it.
    Report {
        /// True if its numbers come from the record, in which a log-return may be minus infinity after a total loss.
        #[serde(skip)]
        is_recorded: bool,
    }
}

reporting! {
    /// The return of one period, given in exactly one of three ways or as missing, and the trades in it.
    Observe {
        #[schema(example = "session_0123456789abcdef0123456789abcdef")]
        session: String,
        /// Number of the period, from 1.
        #[schema(example = 1)]
        period: usize,
        /// Confirms the report despite any doubts.
        #[serde(default, skip_serializing_if = "never_recorded")]
        confirm: bool,
        /// Name of the key that reports it, never part of a body; empty if no key is needed.
        #[serde(skip)]
        reported_by: Arc<str>,
        /// Doubts that the other reports of its list raise.
        #[serde(skip)]
        peer_doubts: Vec<Doubt>,
    }
}

reporting! {
    /// A change of observed periods: a period is reported again in full, inserted between others, or removed.
    Correct {
        /// Number of the correction, from 1.
        #[schema(example = 1)]
        correction: usize,
        /// The period to correct or remove, or the one to insert before.
        #[schema(example = 3)]
        period: usize,
        #[serde(default, skip_serializing_if = "Change::is_replace")]
        change: Change,
        /// The reason, in at most 200 characters.
        #[schema(example = "the index was revised", max_length = 200)]
        reason: String,
        /// Confirms the correction despite any doubts.
        #[serde(default, skip_serializing_if = "never_recorded")]
        confirm: bool,
    }
}

/// Returns true: such fields come with a report and are never part of its stored content.
fn never_recorded(_: &bool) -> bool {
    true
}

/// Implements what both structs have in common.
macro_rules! report_of {
    ($name:ident) => {
        impl $name {
            /// Returns the report alone, as it is recorded.
            pub(in crate::service) fn report(&self) -> Report {
                let $name { log_return, simple_return, price, previous_price, missing, date, noise, .. } = *self;
                let $name { rate, flow, spent, executed_allocation, wealth, .. } = *self;
                let $name { log_returns, simple_returns, prices, previous_prices, executed_allocations, .. } = self;
                let $name { executed, state, .. } = self;
                let done = Report { rate, flow, spent, executed_allocation, wealth, ..Report::default() };
                let one = Report { log_return, simple_return, price, previous_price, missing, date, noise, ..done };
                Report {
                    log_returns: log_returns.clone(),
                    simple_returns: simple_returns.clone(),
                    prices: prices.clone(),
                    previous_prices: previous_prices.clone(),
                    executed_allocations: executed_allocations.clone(),
                    executed: executed.clone(),
                    state: state.clone(),
                    ..one
                }
            }
        }
    };
}

report_of!(Observe);
report_of!(Correct);

/// Converts a reported simple return to a log-return: minus infinity for a total loss.
pub(in crate::service) fn reported_log_return(field: &str, simple_return: f64) -> Result<f64, FieldError> {
    rules::within(field, simple_return, REPORTED_RETURN.0, REPORTED_RETURN.1)?;
    if simple_return >= rules::SIMPLE_RETURN.0 {
        log_return_of(field, simple_return)
    } else {
        Ok(simple_return.ln_1p())
    }
}

/// Converts a simple return, named `field` in messages, to a log-return.
pub(in crate::service) fn log_return_of(field: &str, simple_return: f64) -> Result<f64, FieldError> {
    rules::within(field, simple_return, rules::SIMPLE_RETURN.0, rules::SIMPLE_RETURN.1)?;
    Ok(simple_return.ln_1p().clamp(-rules::LOG_RETURN, rules::LOG_RETURN))
}

impl Report {
    /// Returns a report to be filled with recorded numbers.
    pub(super) fn recorded() -> Self {
        Report { is_recorded: true, ..Report::default() }
    }

    /// Returns the report of the actions that were advised, with no check of their bounds: they were allowed in the state
    /// that was known then.
    pub(super) fn with_acknowledged(self, advised: &BTreeMap<String, f64>) -> Self {
        Report { executed: Some(advised.clone()), is_recorded: true, ..self }
    }

    /// Returns true if its numbers come from the record.
    pub(in crate::service) fn is_recorded(&self) -> bool {
        self.is_recorded
    }

    /// Checks every field that can be checked without the session, except the return.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub(in crate::service) fn check(&self) -> Result<(), FieldError> {
        if let Some(allocation) = self.executed_allocation {
            rules::share("executed_allocation", allocation)?;
        }
        if let Some(rate) = self.rate {
            rules::within("rate", rate, rules::RATE.0, rules::RATE.1)?;
        }
        if let Some(flow) = self.flow {
            rules::within("flow", flow, -rules::WEALTH.1, rules::WEALTH.1)?;
        }
        if let Some(spent) = self.spent {
            rules::within("spent", spent, 0.0, rules::WEALTH.1)?;
        }
        if let Some(wealth) = self.wealth {
            rules::wealth("wealth", wealth)?;
        }
        match (self.previous_price, self.price) {
            (Some(value), None) => {
                Err(FieldError::new("previous_price", value, "must be absent unless price is given"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the log-return, `None` if it is missing; `known_price` is the price reported for the period before.
    ///
    /// # Errors
    /// No return is given, more than one is, or one is out of bounds.
    pub(in crate::service) fn log_return(&self, known_price: Option<f64>) -> Result<Option<f64>, FieldError> {
        none_of(&self.of_several(), OF_SEVERAL)?;
        match (self.log_return, self.simple_return, self.price, self.missing) {
            (Some(value), None, None, false) => self.given_log_return("log_return", value).map(Some),
            (None, Some(value), None, false) => reported_log_return("simple_return", value).map(Some),
            (None, None, Some(price), false) => self.between_prices(price, known_price).map(Some),
            (None, None, None, true) => Ok(None),
            (None, None, None, false) => {
                let rule = "must be given, or simple_return, price or missing instead of it";
                Err(FieldError::new("log_return", "null", rule))
            }
            (.., true) => Err(FieldError::new("missing", true, ONE_RETURN)),
            (Some(value), ..) => Err(FieldError::new("log_return", value, ONE_RETURN)),
            (None, Some(value), ..) => Err(FieldError::new("simple_return", value, ONE_RETURN)),
        }
    }

    /// Lists the fields of a declared problem, and whether each is given.
    pub(in crate::service) fn of_declared(&self) -> [(&'static str, bool); 3] {
        [("noise", self.noise.is_some()), ("executed", self.executed.is_some()), ("state", self.state.is_some())]
    }

    /// Lists the fields of an investor, and whether each is given.
    pub(in crate::service) fn of_investors(&self) -> Vec<(&'static str, bool)> {
        let one = [
            ("log_return", self.log_return.is_some()),
            ("simple_return", self.simple_return.is_some()),
            ("price", self.price.is_some()),
            ("previous_price", self.previous_price.is_some()),
            ("rate", self.rate.is_some()),
            ("flow", self.flow.is_some()),
            ("spent", self.spent.is_some()),
            ("executed_allocation", self.executed_allocation.is_some()),
            ("wealth", self.wealth.is_some()),
        ];
        one.into_iter().chain(self.of_several()).collect()
    }

    /// Returns the field that gave the return, and its value.
    pub(in crate::service) fn given(&self) -> (&'static str, f64) {
        match (self.log_return, self.simple_return, self.price) {
            (_, Some(value), _) => ("simple_return", value),
            (_, _, Some(value)) => ("price", value),
            (value, ..) => ("log_return", value.unwrap_or(0.0)),
        }
    }

    /// Checks a log-return that was given as one.
    pub(super) fn given_log_return(&self, field: &str, value: f64) -> Result<f64, FieldError> {
        if self.is_recorded {
            return Ok(value);
        }
        rules::log_return(field, value).map(|()| value)
    }

    fn between_prices(&self, price: f64, known: Option<f64>) -> Result<f64, FieldError> {
        // After a total loss the price is 0, which no return follows.
        let before = self.previous_price.or(known.filter(|price| *price > 0.0)).ok_or_else(|| {
            FieldError::new(
                "previous_price",
                "null",
                "must be given with price if the period before was not reported with a price",
            )
        })?;
        between("price", price, ("previous_price", before))
    }
}

/// Checks that none of the fields is given.
///
/// # Errors
/// The first of the fields that is given.
pub(in crate::service) fn none_of(fields: &[(&'static str, bool)], rule: &str) -> Result<(), FieldError> {
    let given = fields.iter().find(|(_, is_given)| *is_given);
    given.map_or(Ok(()), |(field, _)| Err(FieldError::new(*field, "given", rule)))
}

/// Returns the log-return between two prices, minus infinity down to 0; messages use the names of their fields.
pub(super) fn between(field: &str, price: f64, (named, before): (&str, f64)) -> Result<f64, FieldError> {
    rules::within(field, price, END_PRICE.0, END_PRICE.1)?;
    rules::within(named, before, PRICE.0, PRICE.1)?;
    let log_return = (price / before).ln();
    if log_return <= rules::LOG_RETURN {
        return Ok(log_return);
    }
    let rule = format!("must give a log-return of at most {} from {before}", rules::LOG_RETURN);
    Err(FieldError::new(field, price, rule))
}
