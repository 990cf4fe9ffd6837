//! Minimum-variance portfolio shares.

/// Decrease in variance per share moved, below which the search ends.
const LEAST_GAIN: f64 = 1e-12;
/// The most moves of a search; searches over thirty assets end within some thousand.
const MOST_MOVES: usize = 1_000_000;

/// Returns the shares that minimise the variance `w' C w`, sum to 1 and are not below 0. Weight moves from the held
/// asset with the largest slope to the asset with the smallest, as far as the variance falls, until no move gains.
/// `covariance` is symmetric and positive semidefinite, for at least one asset. Cost O(d^2) for each move. Source:
/// pairwise Frank-Wolfe steps (Lacoste-Julien and Jaggi 2015).
pub fn least_variance(covariance: &[Vec<f64>]) -> Vec<f64> {
    let width = covariance.len();
    let mut shares = vec![1.0 / width as f64; width];
    for _ in 0..MOST_MOVES {
        let slopes: Vec<f64> =
            covariance.iter().map(|row| row.iter().zip(&shares).map(|(c, share)| c * share).sum()).collect();
        let by_slope = |a: &usize, b: &usize| slopes[*a].total_cmp(&slopes[*b]);
        let cheapest = (0..width).min_by(by_slope);
        let dearest = (0..width).filter(|asset| shares[*asset] > 0.0).max_by(by_slope);
        let Some((to, from)) = cheapest.zip(dearest) else { break };
        let gain = slopes[from] - slopes[to];
        if gain < LEAST_GAIN {
            break;
        }
        // Assets that differ only by rounding have a curvature of rounding size and either sign.
        let curvature = (covariance[from][from] + covariance[to][to] - 2.0 * covariance[from][to]).max(0.0);
        let moved = (gain / curvature).min(shares[from]);
        shares[from] -= moved;
        shares[to] += moved;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks `(v2 - c) / (v1 + v2 - 2 c)` for the first asset if it lies in [0, 1]; otherwise all goes to the asset
    /// with less variance.
    #[test]
    fn two_assets_have_the_shares_of_the_formula() {
        for (first, second, covariance) in [(0.04, 0.09, 0.012), (0.04, 0.01, -0.01), (0.04, 0.01, 0.015)] {
            let shares = least_variance(&[vec![first, covariance], vec![covariance, second]]);
            let share = f64::clamp((second - covariance) / (first + second - 2.0 * covariance), 0.0, 1.0);
            assert!((shares[0] - share).abs() < 1e-9 && (shares[0] + shares[1] - 1.0).abs() < 1e-12, "{shares:?}");
        }
    }

    #[test]
    fn no_asset_held_is_dearer_than_another_and_alike_ones_stay_as_they_are() {
        let deviations = [0.2, 0.15, 0.3, 0.1, 0.12];
        let correlation = |i: usize, j: usize| if i == j { 1.0 } else { 0.9 - 0.1 * i.abs_diff(j) as f64 };
        let row = |i: usize| (0..5).map(|j| correlation(i, j) * deviations[i] * deviations[j]).collect();
        let covariance: Vec<Vec<f64>> = (0..5).map(row).collect();
        let shares = least_variance(&covariance);
        let slope = |i: usize| covariance[i].iter().zip(&shares).map(|(c, share)| c * share).sum::<f64>();
        let least = (0..5).map(slope).fold(f64::INFINITY, f64::min);
        assert!(shares.contains(&0.0), "{shares:?}");
        assert!((0..5).all(|i| shares[i] == 0.0 || slope(i) < least + 1e-11), "{shares:?}");
        assert_eq!(least_variance(&[vec![0.04, 0.04], vec![0.04, 0.04]]), [0.5, 0.5]);
    }
}
