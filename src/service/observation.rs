//! What an investor reports of a period, and what is answered.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::content_hash;
use crate::control::problem::actions::Band;
use crate::control::request::rules as limits;

/// Prices taken: any currency, any quantity.
pub const PRICE: (f64, f64) = (1e-12, 1e15);
const ONE_RETURN: &str = "must be the only one of log_return, simple_return and price";

/// The return of one period, given in exactly one of three ways, and what was done in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Observe {
    #[schema(example = "session_0123456789abcdef0123456789abcdef")]
    pub session: String,
    /// Number of the period, from 1.
    #[schema(example = 1)]
    pub period: usize,
    #[schema(example = 0.012)]
    pub log_return: Option<f64>,
    /// `price / previous price - 1`.
    pub simple_return: Option<f64>,
    /// Price at the end of the period.
    pub price: Option<f64>,
    /// Price at the start of the period. Default: the price reported for the period before.
    pub previous_price: Option<f64>,
    /// Share of wealth held in the risky asset through the period. Default: the allocation advised for it.
    pub executed_allocation: Option<f64>,
    /// Wealth reached, with what was added, where it differs from what the return, the allocation and the policy's
    /// contributions give.
    pub wealth: Option<f64>,
    /// The name of the key that reports it, which no body says; empty where none was asked for.
    #[serde(skip)]
    pub reported_by: Arc<str>,
}

/// The session after an observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Observed {
    pub session: String,
    pub period: usize,
    pub log_return: f64,
    /// The holdings that were best kept at the start of the period; where trading costs nothing both ends are the advised
    /// allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    pub executed_allocation: f64,
    /// The price reported, if one was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub price: Option<f64>,
    /// Wealth at the end of the period, with what was added to it.
    pub wealth: f64,
    /// Share of it in the risky asset, as the return left it.
    pub holding: f64,
    /// Whether the horizon is reached.
    pub completed: bool,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The log-return of a simple return, named `field` in messages.
pub(super) fn log_return_of(field: &str, simple_return: f64) -> Result<f64, FieldError> {
    limits::within(field, simple_return, (-limits::LOG_RETURN).exp_m1(), limits::LOG_RETURN.exp_m1())?;
    Ok(simple_return.ln_1p().clamp(-limits::LOG_RETURN, limits::LOG_RETURN))
}

impl Observe {
    /// Tells a repeat from other content under the same period.
    pub(super) fn content_hash(&self) -> Result<String, serde_json::Error> {
        serde_json::to_vec(self).map(|json| content_hash(&json))
    }

    /// Checks everything that can be checked without the session, and finds the log-return.
    /// `known_price` is the price reported for the period before.
    pub(super) fn checked_log_return(&self, known_price: Option<f64>) -> Result<f64, FieldError> {
        if let Some(allocation) = self.executed_allocation {
            limits::share("executed_allocation", allocation)?;
        }
        if let Some(wealth) = self.wealth {
            limits::within("wealth", wealth, limits::WEALTH.0, limits::WEALTH.1)?;
        }
        if let (Some(value), None) = (self.previous_price, self.price) {
            return Err(FieldError::new("previous_price", value, "must be absent unless price is given"));
        }
        match (self.log_return, self.simple_return, self.price) {
            (Some(value), None, None) => limits::log_return("log_return", value).map(|()| value),
            (None, Some(value), None) => log_return_of("simple_return", value),
            (None, None, Some(price)) => self.between_prices(price, known_price),
            (None, None, None) => {
                Err(FieldError::new("log_return", "null", "must be given, or simple_return or price instead of it"))
            }
            (Some(value), ..) => Err(FieldError::new("log_return", value, ONE_RETURN)),
            (None, Some(value), _) => Err(FieldError::new("simple_return", value, ONE_RETURN)),
        }
    }

    fn between_prices(&self, price: f64, known: Option<f64>) -> Result<f64, FieldError> {
        limits::within("price", price, PRICE.0, PRICE.1)?;
        let before = self.previous_price.or(known).ok_or_else(|| {
            FieldError::new(
                "previous_price",
                "null",
                "must be given with price where the period before was not reported by its price",
            )
        })?;
        limits::within("previous_price", before, PRICE.0, PRICE.1)?;
        let log_return = (price / before).ln();
        let rule = format!("must give a log-return in [-{0}, {0}] from {before}", limits::LOG_RETURN);
        limits::log_return("price", log_return).map_err(|_| FieldError::new("price", price, rule))?;
        Ok(log_return)
    }
}
