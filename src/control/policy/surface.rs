//! The surface of a policy: the shares that it holds after records like its own, for a picture.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::advice::Advice;

/// A direction in which the states of a step differ, beside the mean of the record's log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceAxis {
    /// Wealth.
    Wealth,
    /// Standard deviation of the record's log-returns.
    Deviation,
}

/// The wealth of a state, and the mean and standard deviation of its record's log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct SurfacePoint {
    /// Wealth, in the currency of the initial wealth.
    pub wealth: f64,
    /// Mean log-return, with the weights of learning.
    pub mean: f64,
    /// Standard deviation of the log-returns, with the weights of learning.
    pub deviation: f64,
}

/// The allocations of a policy over states that differ in two directions.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Surface {
    /// The states.
    #[serde(flatten)]
    pub grid: SurfaceGrid,
    /// Share of wealth to hold from nothing held, by row and then column. Outside the design a session would solve the
    /// step instead.
    pub allocations: Vec<Vec<f64>>,
    /// True where the surrogates were trained, by row and then column.
    pub in_design: Vec<Vec<bool>>,
    /// The advice for the policy's own record and initial wealth.
    pub advice: Advice,
}

/// The states of a surface.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SurfaceGrid {
    /// Number of periods observed.
    pub step: usize,
    /// The directions in which the states of this step differ beside the mean.
    pub axes: Vec<SurfaceAxis>,
    /// The direction of the columns; null if there is one column.
    pub across: Option<SurfaceAxis>,
    /// Wealth or standard deviation of each column.
    pub columns: Vec<f64>,
    /// Mean log-return of the whole record in each row; one row if the states of this step do not differ in it.
    pub means: Vec<f64>,
    /// The mean log-return since the start in each row, if all sessions start from the policy's record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observed_means: Option<Vec<f64>>,
    /// At most 300 design points, as the value of `across` and the mean.
    pub design: Vec<[f64; 2]>,
    /// The middle of the design. Wealth stays there if no axis shows it, and so does the deviation of a record that is
    /// shifted as a whole.
    pub middle: SurfacePoint,
    /// The policy's own record and initial wealth.
    pub own: SurfacePoint,
}
