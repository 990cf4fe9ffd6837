//! Spending from wealth in every period, as part of the problem.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::bounds::{Bounded, FieldBounds, ValueBounds};

/// Allowed shares of wealth.
pub const SHARE: (f64, f64) = (0.0, 1.0);
/// Smallest greatest share.
pub const SMALLEST_HIGHEST: f64 = 1e-6;
/// Allowed weights of a period's spending beside the period before.
pub const DISCOUNT: (f64, f64) = (0.5, 1.5);
/// Allowed rises of prices per period.
pub const INFLATION: (f64, f64) = (-0.2, 0.2);
/// Allowed chances to live to the next period.
pub const SURVIVAL: (f64, f64) = (1e-3, 1.0);
/// Allowed amounts that are secured.
pub const SECURED: (f64, f64) = (0.0, 1e15);
/// Allowed weights of the wealth left at the horizon, in periods of spending.
pub const BEQUEST: (f64, f64) = (1e-6, 1e6);

/// Spending at the start of every period, which the policy chooses together with the allocation. Then utility is of what
/// is spent in each period and of the wealth left at the horizon, all in money of the same prices:
///
///   sum over t of  d_t u(c_t / p_t)  +  d_T bequest u(x_T / p_T),   d_t = discount^t times the chance to live so long,
///
/// where u is the utility and p_t the level of prices. Utility must be log or power, nothing may be added or withdrawn
/// besides, and trading must cost nothing: then the best shares of wealth depend on the law alone.
///
/// Amounts may be secured: a level s that is spent in every period, and wealth k that is left at the horizon, whatever
/// returns do. Then utility is of what exceeds them, u(c_t / p_t - s) and u(x_T / p_T - k). The money that pays for them
/// from the bank is the reserve, and all shares are of the surplus, wealth above the reserve:
///
///   R_T = k p_T,   R_t = s p_t + R_(t+1) / (1 + r),   c_t = s p_t + share (x_t - R_t).
///
/// The surplus moves as wealth does where nothing is secured, so the best shares are the same; no return of a total loss
/// of what is held reaches the reserve. Source: Merton (1971), section 6, and Black and Perold (1992), whose constant
/// proportion portfolio insurance this is for a known law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Spending {
    /// Least share of wealth, or of the surplus, that is spent in a period, 0 to 1. Default 0.
    pub lowest: f64,
    /// Greatest share of wealth, or of the surplus, that is spent in a period, 0.000001 to 1, and at least `lowest`. Default 1.
    pub highest: f64,
    /// Weight of a period's spending beside that of the period before, 0.5 to 1.5. Default 1.
    pub discount: f64,
    /// Rise of prices per period, as a fraction, -0.2 to 0.2. Default 0.
    pub inflation: f64,
    /// For each period the chance to live to the next if alive in it, 0.001 to 1: `horizon` numbers. Default: certain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub survival: Option<Vec<f64>>,
    /// Weight of the wealth left at the horizon, as a number of periods of spending, 0.000001 to 1,000,000. Default 1:
    /// it counts as much as the spending of one more period.
    pub bequest: f64,
    /// Amount spent in every period whatever returns do, in money of the start, 0 to 1e15. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub secured: f64,
    /// Wealth left at the horizon whatever returns do, in money of the start, 0 to 1e15. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub secured_left: f64,
}

/// Returns true if nothing is secured, so that the field is left out.
pub fn is_zero(amount: &f64) -> bool {
    *amount == 0.0
}

impl Default for Spending {
    fn default() -> Self {
        Spending {
            lowest: 0.0,
            highest: 1.0,
            discount: 1.0,
            inflation: 0.0,
            survival: None,
            bequest: 1.0,
            secured: 0.0,
            secured_left: 0.0,
        }
    }
}

impl Bounded for Spending {
    const BOUNDS: &'static [FieldBounds] = &[
        ("lowest", ValueBounds::number(SHARE)),
        ("highest", ValueBounds::Number(SMALLEST_HIGHEST, SHARE.1)),
        ("discount", ValueBounds::number(DISCOUNT)),
        ("inflation", ValueBounds::number(INFLATION)),
        ("survival", ValueBounds::List(1, 520, &ValueBounds::number(SURVIVAL))),
        ("bequest", ValueBounds::number(BEQUEST)),
        ("secured", ValueBounds::number(SECURED)),
        ("secured_left", ValueBounds::number(SECURED)),
    ];
}

impl Spending {
    /// Returns the weight of what comes after the period `step + 1` beside its spending.
    pub fn weight_after(&self, step: usize) -> f64 {
        let survival = self.survival.as_ref().and_then(|chances| chances.get(step));
        self.discount * survival.copied().unwrap_or(1.0)
    }

    /// Returns the level of prices after `periods`, 1 at the start.
    fn prices(&self, periods: usize) -> f64 {
        (self.inflation.ln_1p() * periods as f64).exp()
    }

    /// Returns what is secured in each period and the reserve before it is spent, `s p_t` and `R_t`, at a rate of the bank.
    pub fn reserves(&self, rate_per_step: f64, horizon: usize) -> Vec<[f64; 2]> {
        let mut reserve = self.secured_left * self.prices(horizon);
        let before = |period: usize| {
            let secured = self.secured * self.prices(period);
            reserve = secured + reserve / (1.0 + rate_per_step);
            [secured, reserve]
        };
        let mut reserves: Vec<[f64; 2]> = (0..horizon).rev().map(before).collect();
        reserves.reverse();
        reserves
    }

    /// Returns true if an amount is secured, so that the best shares of wealth depend on wealth.
    pub fn secures(&self) -> bool {
        self.secured > 0.0 || self.secured_left > 0.0
    }

    /// Returns the spending that is left after `periods`, in money of then.
    #[must_use]
    pub fn after(&self, periods: usize) -> Self {
        let survival = self.survival.as_ref().map(|chances| chances.iter().skip(periods).copied().collect());
        let [secured, secured_left] = [self.secured, self.secured_left].map(|amount| amount * self.prices(periods));
        Spending { survival, secured, secured_left, ..self.clone() }
    }
}
