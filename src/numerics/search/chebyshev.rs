//! Interpolation: Chebyshev nodes on the unit interval, and local cubics on an irregular grid.

use std::f64::consts::PI;

/// Barycentric interpolation in Chebyshev points of the first kind, mapped to `[0, 1]`.
///
/// Source: Berrut and Trefethen (2004), Barycentric Lagrange interpolation, SIAM Review 46.
#[derive(Debug, Clone)]
pub struct Chebyshev {
    nodes: Vec<f64>,
    weights: Vec<f64>,
}

impl Chebyshev {
    /// Creates `count` nodes, at least one.
    pub fn new(count: usize) -> Self {
        let angle = |index: usize| (2 * index + 1) as f64 * PI / (2 * count) as f64;
        let nodes = (0..count).map(|index| 0.5 - 0.5 * angle(index).cos()).collect();
        let weights =
            (0..count).map(|index| if index % 2 == 0 { angle(index).sin() } else { -angle(index).sin() }).collect();
        Chebyshev { nodes, weights }
    }

    /// Returns the points at which values are needed, ascending, in [0, 1].
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// Returns the weight of each node's value in the interpolating polynomial at `position`. Cost O(count).
    pub fn basis(&self, position: f64) -> Vec<f64> {
        if let Some(hit) = self.nodes.iter().position(|&node| node == position) {
            return (0..self.nodes.len()).map(|node| if node == hit { 1.0 } else { 0.0 }).collect();
        }
        let ratios = self.nodes.iter().zip(&self.weights).map(|(node, weight)| weight / (position - node));
        let mut basis: Vec<f64> = ratios.collect();
        let total: f64 = basis.iter().sum();
        basis.iter_mut().for_each(|ratio| *ratio /= total);
        basis
    }
}

/// Returns even values from one end to the other, two at least.
pub fn even(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|index| low + (high - low) * index as f64 / (count - 1) as f64).collect()
}

/// Returns the first index and the weights of the cubic through the four nodes around `position`, or fewer on a shorter
/// grid.
///
/// `nodes` must be ascending and distinct, at least one. Error O(h^4) times the fourth derivative.
pub fn local_cubic(nodes: &[f64], position: f64) -> (usize, [f64; 4]) {
    let count = nodes.len().min(4);
    let above = below(nodes, position);
    let first = above.saturating_sub(2).min(nodes.len() - count);
    let mut weights = [0.0; 4];
    for i in 0..count {
        let mut weight = 1.0;
        for j in 0..count {
            if j != i {
                weight *= (position - nodes[first + j]) / (nodes[first + i] - nodes[first + j]);
            }
        }
        weights[i] = weight;
    }
    (first, weights)
}

/// Returns how many ascending nodes lie below a position. Even nodes cost no search.
fn below(nodes: &[f64], position: f64) -> usize {
    let last = nodes.len() - 1;
    let share = (position - nodes[0]) / (nodes[last] - nodes[0]);
    let near = ((share * last as f64) as usize).min(last);
    let is_it = |below: &usize| {
        nodes[..*below].last().is_none_or(|node| *node < position)
            && nodes.get(*below).is_none_or(|node| position <= *node)
    };
    let guessed = [near + 1, near, (near + 2).min(nodes.len())].into_iter().find(is_it);
    guessed.unwrap_or_else(|| nodes.partition_point(|&node| node < position))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn nodes_below_a_position_are_those_of_a_search() {
        let mut random = crate::numerics::machine::streams::stream(1, "nodes below", 0, 0);
        for count in 1..200 {
            let mut uneven: Vec<f64> = (0..count).map(|_| random.random_range(-1.0..1.0_f64).powi(3)).collect();
            uneven.sort_unstable_by(f64::total_cmp);
            for nodes in [even(-0.3, 0.7, count.max(2)), uneven] {
                let ends = [f64::NEG_INFINITY, f64::NAN, f64::INFINITY];
                let drawn: Vec<f64> = (0..20).map(|_| random.random_range(-1.2..1.2)).collect();
                for position in nodes.iter().chain(&drawn).chain(&ends) {
                    assert_eq!(below(&nodes, *position), nodes.partition_point(|node| node < position), "{position}");
                }
            }
        }
    }

    #[test]
    fn both_reproduce_a_cubic() {
        let cubic = |x: f64| 1.0 - 2.0 * x + 0.5 * x * x + 3.0 * x * x * x;
        let chebyshev = Chebyshev::new(5);
        let values: Vec<f64> = chebyshev.nodes().iter().map(|&x| cubic(x)).collect();
        let grid = [-1.0, -0.4, -0.3, 0.0, 0.5, 0.6, 1.2];
        for step in 0..=20 {
            let x = step as f64 / 20.0;
            let found: f64 = chebyshev.basis(x).iter().zip(&values).map(|(weight, value)| weight * value).sum();
            assert!((found - cubic(x)).abs() < 1e-13);
            let (first, weights) = local_cubic(&grid, x);
            let sum: f64 = weights.iter().zip(&grid[first..]).map(|(w, &node)| w * cubic(node)).sum();
            assert!((sum - cubic(x)).abs() < 1e-12);
        }
    }
}
