//! Exponentially weighted means of the values before each time.

/// Returns the mean of the values before each one, and before the next: `m_(t+1) = d m_t + (1 - d) x_t` with
/// `d = 2^(-1 / half_life)`, and m_1 the mean of all. Cost O(n).
///
/// Checked by: `tests/solver/conditional.rs::weights_agree_with_pencil_and_paper`, and for squares by
/// `src/numerics/law/volatility.rs::three_returns_agree_with_pencil_and_paper`.
pub fn moving_means(values: &[f64], half_life: f64) -> Vec<f64> {
    let newest = -f64::exp_m1(-std::f64::consts::LN_2 / half_life);
    let start = values.iter().sum::<f64>() / values.len() as f64;
    let mut mean = start;
    let after = values.iter().map(|value| {
        mean += newest * (value - mean);
        mean
    });
    std::iter::once(start).chain(after).collect()
}
