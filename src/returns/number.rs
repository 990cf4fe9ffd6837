//! Numbers as people and programs write them: either decimal mark, thousands apart or not, a percent sign, any minus.
//!
//! No number here starts with a zero before another digit: 012 is what is left of 0,012 when a comma was taken for something
//! else, and -0 likewise.

/// What may stand between thousands, beside the mark that is not the decimal one.
const APART: [char; 5] = ['\'', '\u{2019}', '\u{a0}', '\u{202f}', ' '];

/// A decimal mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    Point,
    Comma,
}

impl Mark {
    fn letters(self) -> (char, char) {
        match self {
            Mark::Point => ('.', ','),
            Mark::Comma => (',', '.'),
        }
    }
}

/// Without a percent sign and a plus; whether a minus stood before it.
fn bare(text: &str) -> (bool, &str) {
    let text = text.trim();
    let text = text.strip_suffix('%').map_or(text, str::trim_end);
    match text.strip_prefix(['-', '\u{2212}', '\u{2013}']) {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    }
}

fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// The number that `text` is by this decimal mark, infinite where it is beyond all numbers; `None` where it is none. A percent
/// sign does not divide it.
pub fn number(text: &str, mark: Mark) -> Option<f64> {
    let (is_negative, rest) = bare(text);
    let (digits, exponent) = rest.split_once(['e', 'E']).unwrap_or((rest, "0"));
    if !is_digits(exponent.strip_prefix(['+', '-']).unwrap_or(exponent)) {
        return None;
    }
    let (point, apart) = mark.letters();
    let (whole, part) = digits.split_once(point).map_or((digits, None), |(whole, part)| (whole, Some(part)));
    if part.is_some_and(|part| !part.is_empty() && !is_digits(part)) {
        return None;
    }
    let groups: Vec<&str> = whole.split(|letter| letter == apart || APART.contains(&letter)).collect();
    let starts_well = |group: &str| is_digits(group) && (!group.starts_with('0') || group == "0");
    let is_whole = match groups[..] {
        [""] => part.is_some_and(|part| !part.is_empty()),
        ["0"] => !(is_negative && rest == "0"),
        [one] => starts_well(one),
        [first, ref others @ ..] => {
            starts_well(first)
                && first != "0"
                && first.len() <= 3
                && others.iter().all(|group| group.len() == 3 && is_digits(group))
        }
        [] => false,
    };
    let sign = if is_negative { "-" } else { "" };
    let plain = || format!("{sign}0{}.{}0e{exponent}", groups.concat(), part.unwrap_or_default());
    is_whole.then(plain)?.parse().ok()
}

/// Whether `text` is a number by one mark or the other.
pub fn is_number(text: &str) -> bool {
    number(text, Mark::Point).or_else(|| number(text, Mark::Comma)).is_some()
}

/// Whether `text` is meant as a number, well formed or not: digits and marks alone.
pub fn looks_numeric(text: &str) -> bool {
    let (_, rest) = bare(text);
    let (digits, exponent) = rest.split_once(['e', 'E']).unwrap_or((rest, "0"));
    let is_mark = |letter: char| matches!(letter, '.' | ',') || APART.contains(&letter);
    digits.contains(|letter: char| letter.is_ascii_digit())
        && digits.chars().all(|letter| letter.is_ascii_digit() || is_mark(letter))
        && is_digits(exponent.strip_prefix(['+', '-']).unwrap_or(exponent))
}

pub fn has_percent(text: &str) -> bool {
    text.trim_end().ends_with('%')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_by_their_mark_and_nothing_else_is_one() {
        for (text, point, comma) in [
            ("3.2", Some(3.2), None),
            ("3,2", None, Some(3.2)),
            (" -1.4 % ", Some(-1.4), None),
            ("\u{2212}.5", Some(-0.5), None),
            ("1,234.50", Some(1234.5), None),
            ("1.234,5", None, Some(1234.5)),
            ("1\u{202f}234", Some(1234.0), Some(1234.0)),
            ("1'234'567", Some(1_234_567.0), Some(1_234_567.0)),
            ("1,234", Some(1234.0), Some(1.234)),
            ("3e-2", Some(0.03), Some(0.03)),
            ("+5.", Some(5.0), None),
            ("1e400", Some(f64::INFINITY), Some(f64::INFINITY)),
            ("012", None, None),
            ("-0", None, None),
            ("-0.0", Some(0.0), None),
            ("0,012", None, Some(0.012)),
            ("1,23", None, Some(1.23)),
            ("12,3456", None, Some(12.3456)),
            ("1.2.3", None, None),
            ("", None, None),
            (".", None, None),
            ("e5", None, None),
            ("1e", None, None),
            ("inf", None, None),
            ("nan", None, None),
            ("0x1", None, None),
        ] {
            assert_eq!((number(text, Mark::Point), number(text, Mark::Comma)), (point, comma), "{text}");
        }
    }
}
