//! Shares of wealth held before trading, at which the value is known where trading costs.
//!
//! The value of a state depends on the share h that is held before trading only through what reaching the band costs: along h
//! it is smooth but for a bend of the second derivative at either end of the band. It is kept at even holdings and read between
//! them by the cubic through the four nearest. The error at a bend is below a twentieth of the jump of the second derivative,
//! 2 c over the width of the band, times the square of the distance.

/// Holdings at which the value of a design point is found, where trading costs.
pub const HOLDINGS: usize = 17;
/// The same where one law is all there is, and hundreds of steps may follow each other.
pub const HOLDINGS_OF_ONE_LAW: usize = 257;

/// Even holdings from 0 to 1, at which a function of the holding is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Holdings {
    count: usize,
}

impl Holdings {
    /// Of `count` values: one for a function that does not depend on the holding, else at least four.
    pub fn new(count: usize) -> Self {
        Holdings { count }
    }

    /// How many.
    pub fn count(self) -> usize {
        self.count
    }

    /// True where the function depends on the holding.
    pub fn matter(self) -> bool {
        self.count > 1
    }

    /// The holdings, ascending.
    pub fn nodes(self) -> impl Iterator<Item = f64> {
        let last = self.count.saturating_sub(1).max(1) as f64;
        (0..self.count).map(move |index| index as f64 / last)
    }

    /// The first of the four values to read at `holding`, and the weights of the cubic through them.
    pub fn cubic(self, holding: f64) -> (usize, [f64; 4]) {
        let position = holding.clamp(0.0, 1.0) * (self.count - 1) as f64;
        let first = (position as usize).saturating_sub(1).min(self.count - 4);
        let t = position - first as f64;
        let (t1, t2, t3) = (t - 1.0, t - 2.0, t - 3.0);
        (first, [-t1 * t2 * t3 / 6.0, 0.5 * t * t2 * t3, -0.5 * t * t1 * t3, t * t1 * t2 / 6.0])
    }

    /// The function at `holding`, from its values.
    pub fn at(values: &[f64], holding: f64) -> f64 {
        if let [only] = values {
            return *only;
        }
        let (first, weights) = Holdings::new(values.len()).cubic(holding);
        weights.iter().zip(&values[first..]).map(|(weight, value)| weight * value).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_read_exactly_everywhere() {
        let cubic = |h: f64| 0.3 - h + 2.0 * h * h - 0.7 * h * h * h;
        for count in [4, 5, 17] {
            let values: Vec<f64> = Holdings::new(count).nodes().map(cubic).collect();
            for step in 0..=100 {
                let holding = f64::from(step) / 100.0;
                assert!((Holdings::at(&values, holding) - cubic(holding)).abs() < 1e-14, "{count} at {holding}");
            }
        }
    }

    /// The bend of the value at an end of the band: half a parabola of second derivative 1.
    #[test]
    fn a_bend_is_read_to_a_twentieth_of_its_jump_times_the_square_of_the_distance() {
        let (count, mut worst) = (17, 0.0_f64);
        for place in 0..1000 {
            let bend = 0.3 + f64::from(place) / 1000.0 / 16.0;
            let value = |h: f64| 0.5 * (h - bend).max(0.0).powi(2);
            let values: Vec<f64> = Holdings::new(count).nodes().map(value).collect();
            for step in 0..=400 {
                let holding = f64::from(step) / 400.0;
                worst = worst.max((Holdings::at(&values, holding) - value(holding)).abs());
            }
        }
        assert!(worst < 1.0 / 20.0 / 256.0 && worst > 1.0 / 200.0 / 256.0, "{worst}");
    }

    #[test]
    fn one_value_is_read_at_any_holding() {
        assert_eq!((Holdings::at(&[0.2], 0.7), Holdings::new(1).matter()), (0.2, false));
    }
}
