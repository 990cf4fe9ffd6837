//! Round numbers along an axis.

use super::number::decimal;

/// Fewest and most ticks of an axis.
const FEWEST: usize = 3;
const MOST: usize = 8;
/// A span below this share of its largest end is drawn as a constant: its ticks would not differ in print.
const CONSTANT: f64 = 1e-9;

/// Positions in ascending order, and the decimals that tell them apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Ticks {
    pub values: Vec<f64>,
    decimals: usize,
}

impl Ticks {
    pub fn low(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    pub fn high(&self) -> f64 {
        self.values.last().copied().unwrap_or(1.0)
    }

    /// Decimals that show a value between two ticks.
    pub fn finer_decimals(&self) -> usize {
        self.decimals + 1
    }

    pub fn label(&self, value: f64) -> String {
        // Longer ones have no room beside the axis.
        const MOST_DECIMALS: usize = 5;
        const LONG: f64 = 1e6;
        if (self.decimals > MOST_DECIMALS && value != 0.0) || value.abs() >= LONG {
            return format!("{value:e}").replace('-', "\u{2212}");
        }
        decimal(value, self.decimals)
    }
}

/// The number nearest to `mantissa` times a power of ten, which a product of floating-point numbers often misses.
fn decimal_number(mantissa: f64, exponent: i32) -> f64 {
    format!("{mantissa}e{exponent}").parse().unwrap_or(f64::INFINITY)
}

/// Multiples of 1, 2 or 5 times a power of ten that cover `[low, high]`: 4 to 8 of them.
///
/// The finest such step with at most 8 multiples is taken. A step 2.5 times finer, with 9 or more, means that the span
/// is above 2.4 steps, so there are at least 4. A constant is given room on both sides.
pub fn linear(low: f64, high: f64) -> Ticks {
    let largest = low.abs().max(high.abs());
    if high - low <= CONSTANT * largest {
        let room = if largest > 0.0 { 0.1 * largest } else { 1.0 };
        return linear(low - room, high + room);
    }
    let mut exponent = ((high - low) / MOST as f64).log10().floor() as i32;
    loop {
        for mantissa in [1.0, 2.0, 5.0] {
            let step = decimal_number(mantissa, exponent);
            // What lies a rounding beyond a multiple does not ask for the next.
            let (first, last) = ((low / step + CONSTANT).floor(), (high / step - CONSTANT).ceil());
            if last - first < MOST as f64 {
                let values = (0..=(last - first) as usize)
                    .map(|index| decimal_number(mantissa * (first + index as f64), exponent))
                    .collect();
                return Ticks { values, decimals: usize::try_from(-exponent).unwrap_or(0) };
            }
        }
        exponent += 1;
    }
}

/// 1, 2 and 5 times the powers of ten, or powers of ten alone, or every so many of them, that cover `[low, high]`,
/// both above 0: 3 to 8 of them.
pub fn logarithmic(low: f64, high: f64) -> Ticks {
    let fine = |index: i32| decimal_number([1.0, 2.0, 5.0][index.rem_euclid(3) as usize], index.div_euclid(3));
    covering(low, high, fine).unwrap_or_else(|| {
        let coarse = |stride: i32| covering(low, high, move |index| decimal_number(1.0, index * stride));
        (1..).find_map(coarse).unwrap_or_else(|| linear(low, high))
    })
}

/// The values of an ascending sequence around 1 from the last at or below `low` to the first at or above `high`;
/// `None` where they are more than [`MOST`].
fn covering(low: f64, high: f64, sequence: impl Fn(i32) -> f64) -> Option<Ticks> {
    // No number above 0 is beyond the thousandth value either way.
    const ENDS: i32 = 1000;
    let mut first = -ENDS;
    let mut last = ENDS;
    while first < ENDS && sequence(first + 1) <= low * (1.0 + CONSTANT) {
        first += 1;
    }
    while last > first && sequence(last - 1) >= high * (1.0 - CONSTANT) {
        last -= 1;
    }
    while ((last - first + 1) as usize) < FEWEST {
        last += 1;
        first -= i32::from(((last - first + 1) as usize) < FEWEST);
    }
    let count = (last - first + 1) as usize;
    let values: Vec<f64> = (first..=last).map(sequence).collect();
    let decimals = (-values.first()?.log10()).ceil().max(0.0) as usize;
    (count <= MOST).then_some(Ticks { values, decimals })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Digits of the shortest form of a number, without zeros at either end.
    fn digits(value: f64) -> String {
        let text = format!("{:e}", value.abs());
        text.split('e').next().unwrap_or_default().replace('.', "").trim_matches('0').to_owned()
    }

    proptest! {
        #[test]
        fn few_round_ticks_cover_the_data(low in -1e6_f64..1e6, exponent in -6..7, mantissa in 0.1_f64..1.0) {
            let span = mantissa * 10_f64.powi(exponent);
            let ticks = linear(low, low + span);
            prop_assert!((3..=8).contains(&ticks.values.len()), "{ticks:?}");
            let slack = 1e-8 * (span + low.abs());
            prop_assert!(ticks.low() <= low + slack && ticks.high() >= low + span - slack, "{ticks:?}");
            let step = (ticks.high() - ticks.low()) / (ticks.values.len() - 1) as f64;
            prop_assert!(["1", "2", "5"].contains(&digits((step * 1e9).round() / 1e9).as_str()) || step < 1e-3);
            let labels: Vec<String> = ticks.values.iter().map(|&value| ticks.label(value)).collect();
            prop_assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        }

        #[test]
        fn logarithmic_ticks_cover_the_data(exponent in -20.0_f64..20.0, decades in 0.0_f64..30.0) {
            let (low, high) = (10_f64.powf(exponent), 10_f64.powf(exponent + decades));
            let ticks = logarithmic(low, high);
            prop_assert!((3..=8).contains(&ticks.values.len()), "{ticks:?}");
            prop_assert!(ticks.low() <= low * 1.00001 && ticks.high() >= high * 0.99999, "{ticks:?}");
            prop_assert!(ticks.values.iter().all(|&tick| ["1", "2", "5"].contains(&digits(tick).as_str())), "{ticks:?}");
        }
    }

    #[test]
    fn ticks_are_the_round_numbers_one_would_write() {
        assert_eq!(linear(0.0, 0.7).values, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]);
        assert_eq!(linear(-3.0, 41.0).values, [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert_eq!(linear(1946.0, 2018.9).values, [1940.0, 1960.0, 1980.0, 2000.0, 2020.0]);
        assert_eq!(linear(5.0, 5.0).values, [4.4, 4.6, 4.8, 5.0, 5.2, 5.4, 5.6]);
        assert_eq!(linear(0.0, 0.0).values, [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(logarithmic(90.0, 120_000.0).values, [10.0, 100.0, 1000.0, 10_000.0, 100_000.0, 1_000_000.0]);
        assert_eq!(logarithmic(100.0, 100.0).values, [50.0, 100.0, 200.0]);
    }
}
