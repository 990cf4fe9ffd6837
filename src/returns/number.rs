//! Numbers as people and programs write them: with either decimal mark, with or without thousands separators, a percent
//! sign or a mark of money, and with a minus before or after, or parentheses instead.
//!
//! No number starts with a zero before another digit: 012 is what is left of 0,012 if a comma was read as something
//! else. For the same reason -0 is no number.

/// Letters that may separate thousands, besides the mark that is not the decimal one.
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

/// Marks and codes of money, before or after a number; longer ones come first.
const MONEY: [&str; 19] = [
    "US$", "CHF", "EUR", "USD", "GBP", "GBX", "JPY", "CAD", "AUD", "SEK", "NOK", "DKK", "PLN", "z\u{142}", "Fr.", "$",
    "\u{20ac}", "\u{a3}", "\u{a5}",
];
const MINUS: [char; 3] = ['-', '\u{2212}', '\u{2013}'];

/// A number without its sign, percent sign and mark of money.
struct Bare<'a> {
    is_negative: bool,
    money: Option<&'static str>,
    rest: &'a str,
}

/// Splits off the sign, the percent sign and the mark of money. A sign may come before or after the number or its mark
/// of money, or parentheses around both; a second sign is left in the rest.
fn bare(text: &str) -> Bare<'_> {
    let without_percent = |text: &'_ str| -> usize { text.strip_suffix('%').map_or(text, str::trim_end).len() };
    let text = text.trim();
    let text = &text[..without_percent(text)];
    let bracketed = text.strip_prefix('(').and_then(|text| text.strip_suffix(')')).map(str::trim);
    let text = bracketed.unwrap_or(text);
    let text = &text[..without_percent(text)];
    let mut is_signed = bracketed.is_some();
    let mut is_negative = is_signed;
    let mut rest = text;
    let mut sign = |rest: &mut &str| {
        if let Some(after) = rest.strip_prefix(MINUS).filter(|_| !is_signed) {
            (is_signed, is_negative, *rest) = (true, true, after);
        } else if let Some(after) = rest.strip_prefix('+').filter(|_| !is_signed) {
            (is_signed, *rest) = (true, after);
        } else if let Some(before) =
            rest.strip_suffix(MINUS).filter(|before| !is_signed && before.ends_with(|last: char| last.is_ascii_digit()))
        {
            (is_signed, is_negative, *rest) = (true, true, before);
        }
    };
    sign(&mut rest);
    let starts = |mark: &str| rest.get(..mark.len()).is_some_and(|start| start.eq_ignore_ascii_case(mark));
    let ends = |mark: &str| {
        let at = rest.len().checked_sub(mark.len());
        at.and_then(|at| rest.get(at..)).is_some_and(|end| end.eq_ignore_ascii_case(mark))
    };
    let before = MONEY.into_iter().find(|mark| starts(mark));
    let after = if before.is_some() { None } else { MONEY.into_iter().find(|mark| ends(mark)) };
    if let Some(mark) = before {
        rest = rest[mark.len()..].trim_start();
    } else if let Some(mark) = after {
        rest = rest[..rest.len() - mark.len()].trim_end();
    }
    if before.or(after).is_some() {
        sign(&mut rest);
    }
    Bare { is_negative, money: before.or(after), rest }
}

/// Returns the mark of money in `text`.
pub fn money(text: &str) -> Option<&'static str> {
    bare(text).money
}

/// Returns the digits and marks of `text`.
pub fn significant(text: &str) -> &str {
    bare(text).rest
}

fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Reads `text` as a number with this decimal mark: infinite if it overflows, and `None` if it is no number. A percent
/// sign does not divide it.
pub fn number(text: &str, mark: Mark) -> Option<f64> {
    let Bare { is_negative, rest, .. } = bare(text);
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

/// Returns true if `text` is a number with either decimal mark.
pub fn is_number(text: &str) -> bool {
    number(text, Mark::Point).or_else(|| number(text, Mark::Comma)).is_some()
}

/// Returns true if `text` is meant as a number, well formed or not: it holds digits and marks alone.
pub fn looks_numeric(text: &str) -> bool {
    let rest = significant(text);
    let (digits, exponent) = rest.split_once(['e', 'E']).unwrap_or((rest, "0"));
    let is_mark = |letter: char| matches!(letter, '.' | ',') || APART.contains(&letter);
    digits.contains(|letter: char| letter.is_ascii_digit())
        && digits.chars().all(|letter| letter.is_ascii_digit() || is_mark(letter))
        && is_digits(exponent.strip_prefix(['+', '-']).unwrap_or(exponent))
}

/// Splits a number off a mark of one to three letters or symbols before or after it: returns the mark and the number.
/// The number must have a decimal or thousands mark, because amounts of a currency have one and labels do not.
pub fn marked(text: &str) -> Option<(&str, &str)> {
    let start = text.find(|letter: char| letter.is_ascii_digit() || matches!(letter, '-' | '+' | '.'))?;
    let end = text.rfind(|letter: char| letter.is_ascii_digit())? + 1;
    let (before, number, after) = (text[..start].trim(), text.get(start..end)?, text[end..].trim());
    let mark = match (before, after) {
        (mark, "") | ("", mark) => mark,
        _ => return None,
    };
    let is_amount = number.contains(['.', ',']) && looks_numeric(number);
    ((1..=3).contains(&mark.chars().count()) && is_amount).then_some((mark, number))
}

pub fn has_percent(text: &str) -> bool {
    text.trim_end_matches([')', ' ']).ends_with('%')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_with_an_unknown_mark_is_told_apart_from_words() {
        for (text, found) in [
            ("kr 12.3", Some(("kr", "12.3"))),
            ("\u{20b9}12.3", Some(("\u{20b9}", "12.3"))),
            ("12,3p", Some(("p", "12,3"))),
            ("C$-1,234.5", Some(("C$", "-1,234.5"))),
            ("DE0001234567", None),
            ("2021-01-31", None),
            ("Fund", None),
            ("12.3", None),
            ("kr 12 p", None),
        ] {
            assert_eq!(marked(text), found, "{text}");
        }
    }

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
            ("(3.2)", Some(-3.2), None),
            ("(1.2 %)", Some(-1.2), None),
            ("(1.2)%", Some(-1.2), None),
            ("5.2-", Some(-5.2), None),
            ("$250.69", Some(250.69), None),
            ("-$1,250.50", Some(-1250.5), None),
            ("$-3.5", Some(-3.5), None),
            ("($3.5)", Some(-3.5), None),
            ("1994,99 \u{20ac}", None, Some(1994.99)),
            ("\u{a3} 12.5", Some(12.5), None),
            ("CHF 1'234.50", Some(1234.5), None),
            ("12.5 usd", Some(12.5), None),
            ("EUR", None, None),
            ("$", None, None),
            ("--5", None, None),
            ("(-5)", None, None),
            ("-5-", None, None),
            ("0,-", None, None),
            ("$5 EUR", None, None),
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
