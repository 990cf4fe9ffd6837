//! Space-filling selection.

/// Returns the indices of `count` rows of `rows` that are far apart, starting with those in `given`. Each further row
/// is the farthest from all rows chosen before it (the first such row) in the metric
/// `sum_i ((x_i - y_i) / scales_i)^2`. Its distance is multiplied by its entry of `weights`. A row without a weight may
/// be given, but is never chosen.
///
/// With equal weights the covering radius is at most twice the least one. Cost O(rows count d). Source: Gonzalez
/// (1985), Theoretical Computer Science 38; weights as in Dyer and Frieze (1985), Operations Research Letters 3.
pub fn farthest_points(
    rows: &[Vec<f64>],
    scales: &[f64],
    weights: &[f64],
    given: &[usize],
    count: usize,
) -> Vec<usize> {
    assert!(weights.len() <= rows.len(), "one weight for each row that may be chosen");
    let scaled: Vec<Vec<f64>> =
        rows.iter().map(|row| row.iter().zip(scales).map(|(x, scale)| x / scale).collect()).collect();
    let mut chosen = given.to_vec();
    let mut nearest = vec![f64::INFINITY; rows.len()];
    for &centre in &chosen {
        approach(&mut nearest, &scaled, centre);
    }
    while chosen.len() < count.min(rows.len()) {
        let mut farthest = (0, f64::NEG_INFINITY);
        for (row, (distance, weight)) in nearest.iter().zip(weights).enumerate() {
            let weighted = distance * weight * weight;
            if weighted > farthest.1 {
                farthest = (row, weighted);
            }
        }
        let farthest = farthest.0;
        chosen.push(farthest);
        approach(&mut nearest, &scaled, farthest);
    }
    chosen
}

/// Lowers each row's squared distance to the chosen rows by the one to `centre`, and marks `centre` so that it is never
/// chosen again.
fn approach(nearest: &mut [f64], scaled: &[Vec<f64>], centre: usize) {
    for (nearest, row) in nearest.iter_mut().zip(scaled) {
        let distance: f64 = row.iter().zip(&scaled[centre]).map(|(x, y)| (x - y) * (x - y)).sum();
        *nearest = nearest.min(distance);
    }
    nearest[centre] = f64::NEG_INFINITY;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_come_first_and_none_twice() {
        let rows: Vec<Vec<f64>> = [0.0, 1.0, 5.0, 9.0, 10.0, 0.0].iter().map(|&x| vec![x, 0.0]).collect();
        assert_eq!(farthest_points(&rows, &[1.0, 1.0], &[1.0; 6], &[0], 3), [0, 4, 2]);
        let mut all = farthest_points(&rows, &[1.0, 1.0], &[1.0; 6], &[0, 1], 9);
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn a_long_scale_hides_its_coordinate() {
        let rows = vec![vec![0.0, 0.0], vec![0.0, 50.0], vec![2.0, 0.0]];
        assert_eq!(farthest_points(&rows, &[1.0, 100.0], &[1.0; 3], &[0], 2), [0, 2]);
        assert_eq!(farthest_points(&rows, &[1.0, 1.0], &[1.0; 3], &[0], 2), [0, 1]);
    }

    #[test]
    fn a_weight_multiplies_the_distance() {
        let rows: Vec<Vec<f64>> = [0.0, 3.0, -5.0].iter().map(|&x| vec![x]).collect();
        assert_eq!(farthest_points(&rows, &[1.0], &[1.0, 1.6, 1.0], &[0], 2), [0, 2]);
        assert_eq!(farthest_points(&rows, &[1.0], &[1.0, 1.7, 1.0], &[0], 2), [0, 1]);
    }
}
