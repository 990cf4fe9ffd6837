//! Numbers as people read them.

const MINUS: char = '\u{2212}';
const NARROW_SPACE: char = '\u{202F}';
/// From here on a plain number is longer than its power of ten.
const LONG: f64 = 1e7;

/// `value` to so many decimals: a true minus sign, digits in threes from five on, powers of ten from 1e7.
/// What is not finite is shown as a dash.
pub fn decimal(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".into();
    }
    if value.abs() >= LONG {
        return signed(value, format!("{:.2e}", value.abs()).replace(".00", ""));
    }
    let digits = format!("{:.decimals$}", value.abs());
    if digits.bytes().all(|byte| matches!(byte, b'0' | b'.')) {
        return digits; // no minus before a zero
    }
    let (whole, fraction) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    signed(value, format!("{}{fraction}", in_threes(whole)))
}

/// `value [low, high]`.
pub fn with_interval(value: f64, [low, high]: [f64; 2], decimals: usize) -> String {
    format!("{} [{}, {}]", decimal(value, decimals), decimal(low, decimals), decimal(high, decimals))
}

fn signed(value: f64, digits: String) -> String {
    if value < 0.0 { format!("{MINUS}{digits}") } else { digits }
}

fn in_threes(whole: &str) -> String {
    if whole.len() < 5 {
        return whole.into();
    }
    let mut text = String::new();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push(NARROW_SPACE);
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(decimal(-0.004, 2), "0.00");
        assert_eq!(decimal(-1234.5, 1), "\u{2212}1234.5");
        assert_eq!(decimal(1_234_567.0, 0), "1\u{202F}234\u{202F}567");
        assert_eq!(decimal(2e7, 0), "2e7");
        assert_eq!(decimal(f64::NAN, 2), "\u{2013}");
        assert_eq!(with_interval(0.5, [-0.25, 1.0], 2), "0.50 [\u{2212}0.25, 1.00]");
    }
}
