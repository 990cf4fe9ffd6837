//! Bins that several samples share, with round edges.

use super::ticks::linear;

/// Most bins of a histogram.
const MOST_BINS: f64 = 60.0;

/// First edge, width, and per sample the share in each bin, in per cent; `None` where a sample is empty or not finite.
///
/// The width is that of Freedman and Diaconis over all values, 2 IQR / n^(1/3), n the size of the smallest sample,
/// at least a sixtieth of the range, rounded to 1, 2 or 5 times a power of ten.
pub fn shared_bins(samples: &[(&str, &[f64])]) -> Option<(f64, f64, Vec<Vec<f64>>)> {
    let mut all: Vec<f64> = samples.iter().flat_map(|(_, sample)| sample.iter().copied()).collect();
    let smallest = samples.iter().map(|(_, sample)| sample.len()).min().filter(|&size| size > 0)?;
    if !all.iter().all(|value| value.is_finite() && value.abs() < 1e100) {
        return None;
    }
    all.sort_by(f64::total_cmp);
    let (low, high) = (*all.first()?, *all.last()?);
    let covering = linear(low, high);
    let range = covering.high() - covering.low();
    let quartiles = all[3 * all.len() / 4] - all[all.len() / 4];
    let width = round_width((2.0 * quartiles / (smallest as f64).cbrt()).max(range / MOST_BINS).min(0.1 * range));
    let first = (low / width).floor() * width;
    let count = ((high - first) / width).floor() as usize + 1;
    let shares = |sample: &[f64]| {
        let mut heights = vec![0.0; count];
        for value in sample {
            let bin = ((value - first) / width) as usize;
            heights[bin.min(count - 1)] += 100.0 / sample.len() as f64;
        }
        heights
    };
    Some((first, width, samples.iter().map(|(_, sample)| shares(sample)).collect()))
}

/// The next 1, 2 or 5 times a power of ten.
fn round_width(width: f64) -> f64 {
    let power = 10_f64.powf(width.log10().floor());
    let mantissa = [1.0, 2.0, 5.0].into_iter().find(|mantissa| mantissa * power >= width * (1.0 - 1e-9));
    mantissa.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_counted_in_the_bin_that_holds_it() {
        let sample: Vec<f64> = (0..100).map(|index| 0.01 * f64::from(index) - 0.3).collect();
        let (first, width, shares) = shared_bins(&[("a", &sample), ("b", &[0.695])]).unwrap();
        assert_eq!(round_width(0.03), 0.05);
        let counted: Vec<f64> = (0..shares[0].len())
            .map(|bin| {
                let edges = first + width * bin as f64 - 1e-12..first + width * (bin + 1) as f64 - 1e-12;
                sample.iter().filter(|value| edges.contains(value)).count() as f64
            })
            .collect();
        let rounded: Vec<f64> = shares[0].iter().map(|share| share.round()).collect();
        assert!(counted.iter().zip(&rounded).all(|(counted, share)| (counted - share).abs() <= 1.0), "{rounded:?}");
        assert_eq!(shares[1].iter().filter(|share| **share == 100.0).count(), 1);
        assert_eq!(shared_bins(&[("a", &[])]), None);
    }
}
