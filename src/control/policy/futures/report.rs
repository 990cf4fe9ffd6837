//! The futures of a policy as they are sent.

use serde::Serialize;
use utoipa::ToSchema;

use super::PlayedPath;
use crate::numerics::statistics::summary::{Estimate, interpolated_quantile};

/// Shares of the paths below the three lines of a fan.
const FAN: [f64; 3] = [0.1, 0.5, 0.9];

/// The futures of a policy from a state.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Futures {
    /// First period that is played, from 1.
    pub period: usize,
    /// Number of paths of each world.
    pub paths: usize,
    /// Worth for certain against the worst laws, as the policy says it at the start.
    pub promised: f64,
    /// Standard deviation that the policy states for it, as an amount; null if it states none.
    pub stated_error: Option<f64>,
    /// Worth for certain in the worst world, as these paths find it, with a 90 % interval.
    pub played: Estimate,
    /// Courses of wealth, or of each state of a declared problem and of what was earned.
    pub courses: Vec<Course>,
    /// The two worlds in words.
    pub sentence: String,
}

/// The course of a figure in both worlds: before each period, and at the end.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Course {
    /// Name of the figure.
    pub name: String,
    /// In the world in which every period brings the worst law.
    pub worst: Vec<FanPoint>,
    /// In the world in which periods are drawn from the record.
    pub record: Vec<FanPoint>,
}

/// Quantiles over paths at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct FanPoint {
    /// Value below which a tenth of the paths lie.
    pub low: f64,
    /// The median.
    pub median: f64,
    /// Value below which nine tenths of the paths lie.
    pub high: f64,
}

/// Returns the quantiles of a figure at every time.
pub(super) fn fan(paths: &[PlayedPath], place: usize) -> Vec<FanPoint> {
    let times = paths.first().map_or(0, |path| path.figures.len());
    let at = |time: usize| {
        let mut values: Vec<f64> = paths.iter().map(|path| path.figures[time][place]).collect();
        values.sort_by(f64::total_cmp);
        let [low, median, high] = FAN.map(|share| interpolated_quantile(&values, share));
        FanPoint { low, median, high }
    };
    (0..times).map(at).collect()
}

/// Says what both worlds bring: what the policy is worth in the worst one beside its floor, and the range of the first
/// figure after so many periods.
pub(super) fn in_words(
    courses: &[Course],
    (worth, floor): (f64, Option<f64>),
    (periods, noun): (usize, &str),
) -> String {
    let Some(Course { name, worst, record }) = courses.first() else { return String::new() };
    let (Some(start), Some(worst), Some(record)) = (worst.first(), worst.last(), record.last()) else {
        return String::new();
    };
    let after = if periods == 1 { format!("one {noun}") } else { format!("{periods} {noun}s") };
    let bank = floor.map_or_else(String::new, |floor| format!(", where the bank alone pays {floor:.2}"));
    format!(
        "If every {noun} brought the worst case that the data then cannot reject, this policy would be worth {worth:.2} for \
         certain after {after}{bank}. On 8 of 10 such paths {name}, {:.2} now, ends between {:.2} and {:.2}. With {noun}s \
         like those of the record it ends between {:.2} and {:.2}.",
        start.median, worst.low, worst.high, record.low, record.high
    )
}
