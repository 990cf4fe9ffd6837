//! Exponential and logarithm that LLVM can turn into vector code.
//!
//! Multiplications and additions are fused only where the formula says so, so that the bits of a result do not depend
//! on the processor. A processor without the instruction computes the same fused result, slowly. The functions are
//! called inside loops that `pulp` compiles once for each instruction set.

/// The range in which the exponential has normal values; outside it is clamped to the ends, about 3e-308 and 8e307.
const EXPONENT_RANGE: (f64, f64) = (-708.0, 709.0);
/// Adding 1.5 * 2^52 rounds to an integer and leaves it in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; the first has 21 trailing zero bits, so its product with an exponent is exact.
const LN2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
const LN2_LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);
const EXPONENT_BIAS: u64 = 1024;
/// Bits of sqrt(1/2), the start of the range of mantissas: they lie in [sqrt(1/2), sqrt 2).
const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;

/// Returns exp(x), with relative error below 1e-14 on [-708, 709] and clamped outside. A NaN stays a NaN.
///
///   exp(x) = 2^k exp(x - k ln 2),  k = round(x / ln 2)
///
/// The second factor is the Taylor polynomial of degree 12 on [-0.347, 0.347], whose remainder is below 3e-16.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let (polynomial, power) = reduced(x);
    power * (polynomial + 1.0)
}

/// Returns exp(x) - 1, with relative error below 1e-14 on [-708, 709] and clamped outside. A NaN stays a NaN.
#[inline(always)]
pub fn exp_m1(x: f64) -> f64 {
    let (polynomial, power) = reduced(x);
    power * polynomial + (power - 1.0)
}

/// Returns exp(t) - 1 and 2^k for the argument x = k ln 2 + t.
#[inline(always)]
fn reduced(x: f64) -> (f64, f64) {
    let x = if x < EXPONENT_RANGE.0 { EXPONENT_RANGE.0 } else { x };
    let x = if x > EXPONENT_RANGE.1 { EXPONENT_RANGE.1 } else { x };
    let rounded = x.mul_add(std::f64::consts::LOG2_E, ROUNDER);
    let k = rounded - ROUNDER;
    let t = k.mul_add(-LN2_LOW, k.mul_add(-LN2_HIGH, x));
    let mut sum: f64 = 1.0 / 479_001_600.0;
    sum = sum.mul_add(t, 1.0 / 39_916_800.0);
    sum = sum.mul_add(t, 1.0 / 3_628_800.0);
    sum = sum.mul_add(t, 1.0 / 362_880.0);
    sum = sum.mul_add(t, 1.0 / 40_320.0);
    sum = sum.mul_add(t, 1.0 / 5_040.0);
    sum = sum.mul_add(t, 1.0 / 720.0);
    sum = sum.mul_add(t, 1.0 / 120.0);
    sum = sum.mul_add(t, 1.0 / 24.0);
    sum = sum.mul_add(t, 1.0 / 6.0);
    sum = sum.mul_add(t, 0.5);
    sum = sum.mul_add(t, 1.0);
    (sum * t, f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52))
}

/// Returns ln(x) for positive normal x, with absolute error below 1e-15 plus rounding of the result.
///
///   ln(x) = k ln 2 + ln(m),  m in [sqrt(1/2), sqrt 2),  ln(m) = 2 s (1 + s^2/3 + s^4/5 + ..),  s = (m - 1)/(m + 1)
///
/// Eleven terms: s^2 is below 0.0295, so the remainder is below 1e-17.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    let shifted = x.to_bits().wrapping_sub(SQRT_HALF_BITS);
    // Biased to be positive, and put into the low bits of a number whose unit is 1, because no instruction converts
    // integers.
    let biased = shifted.wrapping_add(EXPONENT_BIAS << 52) >> 52;
    let k = f64::from_bits(ROUNDER.to_bits() + biased) - (ROUNDER + EXPONENT_BIAS as f64);
    let mantissa = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(SQRT_HALF_BITS));
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let square = s * s;
    let mut sum: f64 = 1.0 / 21.0;
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        sum = sum.mul_add(square, 1.0 / odd);
    }
    let log = (2.0 * s * square).mul_add(sum, 2.0 * s);
    k.mul_add(LN2_HIGH, k.mul_add(LN2_LOW, log))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_accurate_on_its_whole_domain() {
        for index in -708_000..=709_000 {
            let x = f64::from(index) * 0.001 - f64::from(index % 7) * 1e-6;
            let relative = (exp(x) / x.exp() - 1.0).abs();
            assert!(relative < 1e-14 || x > EXPONENT_RANGE.1, "exp({x}): relative error {relative:e}");
            let relative = (exp_m1(x) / x.exp_m1() - 1.0).abs();
            assert!(relative < 1e-14 || x > EXPONENT_RANGE.1 || x == 0.0, "exp_m1({x}): relative error {relative:e}");
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(-0.0), 1.0);
        assert!(exp(f64::NEG_INFINITY) < 1e-300 && exp(f64::INFINITY) > 1e300);
        assert!(exp(f64::NAN).is_nan());
    }

    #[test]
    fn the_logarithm_is_accurate_where_it_vanishes_and_far_from_there() {
        for index in -700_000..=700_000 {
            let x = (f64::from(index) * 0.001).exp();
            let expected = x.ln();
            assert!((ln(x) - expected).abs() < 1e-15 + 4e-16 * expected.abs(), "ln({x})");
        }
        for index in -10_000..=10_000 {
            let x = 1.0 + f64::from(index) * 1e-9;
            assert!((ln(x) / x.ln() - 1.0).abs() < 1e-14 || x == 1.0, "ln({x})");
        }
        assert_eq!(ln(1.0), 0.0);
    }
}
