//! Numbers in text.

/// Writes a number to `decimals` decimals; a zero has no sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if is_zero(&text) { text.trim_start_matches('-').to_owned() } else { text }
}

/// Writes a fraction as a percentage to `decimals` decimals; a zero has no sign.
pub fn percent(fraction: f64, decimals: usize) -> String {
    format!("{} %", fixed(100.0 * fraction, decimals))
}

/// Writes a number to `decimals` decimals with its sign; a zero has no sign.
pub fn signed(value: f64, decimals: usize) -> String {
    let text = format!("{value:+.decimals$}");
    if is_zero(&text) { text.trim_start_matches(['-', '+']).to_owned() } else { text }
}

/// Puts a comma between the thousands of a number that is written in decimals: 1234567.5 as 1,234,567.5.
pub fn grouped(text: &str) -> String {
    let start = text.find(|character: char| character.is_ascii_digit()).unwrap_or(text.len());
    let whole = text[start..].find('.').unwrap_or(text.len() - start);
    let mut out = text[..start].to_owned();
    for (place, digit) in text[start..].char_indices() {
        if (1..whole).contains(&place) && (whole - place).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Returns the number of decimals at which two numbers differ by at least five units of the last: at least `least`, and
/// at most 6.
pub fn deciding(one: f64, other: f64, least: usize) -> usize {
    let wanted = (5.0 / (one - other).abs()).log10().ceil();
    if wanted.is_finite() { (wanted.max(0.0) as usize).clamp(least, 6.max(least)) } else { least }
}

fn is_zero(text: &str) -> bool {
    text.chars().all(|character| !matches!(character, '1'..='9'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        assert_eq!(
            [-0.004, -0.0, 0.004, -0.006, 1.0].map(|value| fixed(value, 2)),
            ["0.00", "0.00", "0.00", "-0.01", "1.00"]
        );
        assert_eq!([-0.004, 0.004, 0.006, -1.5].map(|value| signed(value, 2)), ["0.00", "0.00", "+0.01", "-1.50"]);
        assert_eq!(fixed(f64::NAN, 2), "NaN");
    }

    #[test]
    fn thousands_are_set_apart() {
        let texts = ["0", "999", "1000", "-1234567.5678", "+12345", "0.123456", "NaN"];
        assert_eq!(texts.map(grouped), ["0", "999", "1,000", "-1,234,567.5678", "+12,345", "0.123456", "NaN"]);
    }

    #[test]
    fn two_numbers_have_the_digits_that_tell_them_apart() {
        assert_eq!([0.5, 0.06, 0.004, 0.0, 1e-9].map(|apart| deciding(0.02, 0.02 + apart, 2)), [2, 2, 4, 2, 6]);
    }
}
