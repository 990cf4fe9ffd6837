//! The start of the interior point search, inside all bounds.

use super::{BarrierConstraint, Interior};
use crate::control::assets::PortfolioStep;
use crate::control::assets::branches::Branches;
use crate::control::assets::cuts::Cuts;
use crate::control::assets::limited::GIVES_WAY;

/// Weight of the default start in a warm start, which keeps it inside the bounds.
const DRAWN_INSIDE: f64 = 0.002;
/// Above the least sum allowed, the shares of a start sum to at most this over the risk aversion.
const SHARE_AT_START: f64 = 0.5;
/// Smallest width of the interval for the sum of the shares.
const LEAST_ROOM: f64 = 1e-6;

/// Returns the least sum of the shares, so that an interval is left.
fn lowest(step: &PortfolioStep) -> f64 {
    step.total.lowest.min(step.total.highest - LEAST_ROOM)
}

/// Returns the first point. `near` is a warm start: shares and a price.
fn first_point(step: &PortfolioStep, near: Option<(Vec<f64>, f64)>) -> Vec<f64> {
    let (assets, lowest) = (step.assets(), lowest(step));
    // Halfway between the bounds of the sum, or at a sum whose total loss still weighs little. Further inside,
    // utilities of a risk aversion of 20 and more are so large that rounding exceeds the gain of a step.
    let weighs_little = SHARE_AT_START / step.utility.risk_aversion();
    let middle = (0.5 * (lowest + step.total.highest)).min(lowest + weighs_little);
    let mut point = match &step.compositions {
        Some(compositions) => {
            // Limits that leave no room for an asset give way by as little.
            let least = 0.25 * GIVES_WAY / assets as f64;
            compositions.centre().iter().map(|share| middle * share.max(least)).collect()
        }
        None => vec![middle / assets as f64; assets],
    };
    if let Some((shares, _)) = &near {
        let shares = step.allowed_near(shares);
        let inside = |(share, near): (&mut f64, &f64)| *share = DRAWN_INSIDE * *share + (1.0 - DRAWN_INSIDE) * near;
        point.iter_mut().zip(&shares).for_each(inside);
    }
    let moves = step.compositions.as_ref().map(|compositions| compositions.moves_of(&point, GIVES_WAY));
    point.push(near.as_ref().map_or(middle, |(_, price)| price.max(LEAST_ROOM)));
    point.extend(&step.trading.holdings);
    point.extend(moves.unwrap_or_default());
    point
}

/// Returns the directions and offsets of the bounds of points of this size.
fn lines(step: &PortfolioStep, size: usize) -> Vec<(Vec<f64>, f64)> {
    let (assets, highest, lowest) = (step.assets(), step.total.highest, lowest(step));
    let unit = |index: usize| (0..size).map(|other| if other == index { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let sum = |sign: f64| (0..size).map(|other| if other < assets { sign } else { 0.0 }).collect::<Vec<f64>>();
    let mut lines: Vec<(Vec<f64>, f64)> = (0..=assets).map(|index| (unit(index), 0.0)).collect();
    lines.push((sum(-1.0), highest));
    if lowest > 0.0 {
        lines.push((sum(1.0), -lowest));
    }
    for (asset, held) in step.trading.holdings.iter().enumerate() {
        for sign in [1.0, -1.0] {
            let mut line = unit(assets + 1 + asset);
            line[asset] = sign;
            lines.push((line, -sign * held));
        }
    }
    let cone = step.compositions.iter().flat_map(|compositions| compositions.cone(GIVES_WAY));
    lines.extend(cone.map(|of| {
        let mut line = vec![0.0; size];
        let moves = of.len() - assets;
        line[..assets].copy_from_slice(&of[..assets]);
        line[size - moves..].copy_from_slice(&of[assets..]);
        (line, 0.0)
    }));
    lines
}

impl<'a> Interior<'a> {
    /// Starts the search. `near` is a warm start: shares of the assets searched among, and a price.
    pub fn start(
        step: &'a PortfolioStep,
        whole: &'a PortfolioStep,
        held: &'a [usize],
        near: Option<(Vec<f64>, f64)>,
        barrier: f64,
        reach: f64,
    ) -> Self {
        let assets = step.assets();
        let point = first_point(step, near);
        let bound = |(direction, offset)| BarrierConstraint { direction, offset, multiplier: 0.0 };
        let mut interior = Interior {
            step,
            whole,
            held,
            entering: Vec::new(),
            best: point[..assets].to_vec(),
            best_price: point[assets],
            bounds: lines(step, point.len()).into_iter().map(bound).collect(),
            point,
            bound_weight: 1.0 / assets as f64,
            barrier,
            reach,
            branches: Branches::default(),
            cuts: Cuts::default(),
            known_before: Cuts::default(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            tangent: None,
            evaluations: 0,
            steps: 0,
        };
        interior.open();
        interior.ask();
        interior.learn();
        interior
    }
}
