//! Numbers of a letter, as a client reads them: with a unit, and no more digits than mean something.

use crate::numerics::machine::digits::{self, fixed};

/// The minus sign, which is as wide as the plus sign.
const MINUS: char = '\u{2212}';
/// Stands between a number and its unit, and never ends a line.
const NARROW: char = '\u{202f}';
/// Stands between a currency and its amount.
const SPACE: char = '\u{a0}';
/// The text for a number that is not known.
const UNKNOWN: &str = "\u{2013}";
/// From this size on an amount has no decimals.
const WHOLE: f64 = 1e5;
/// Below this size an amount has four significant digits.
const SMALL: f64 = 0.1;
/// The most decimals of a number.
const FINEST: i32 = 15;

/// Currencies without a smaller unit, and those of a thousand smaller units (ISO 4217); all others have a hundred.
const WITHOUT_UNITS: [&str; 17] = [
    "BIF", "CLP", "DJF", "GNF", "ISK", "JPY", "KMF", "KRW", "PYG", "RWF", "UGX", "UYI", "VND", "VUV", "XAF", "XOF",
    "XPF",
];
const OF_THOUSAND: [&str; 7] = ["BHD", "IQD", "JOD", "KWD", "LYD", "OMR", "TND"];

/// How amounts of money are written: in a currency, or without one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct MoneyFormat {
    pub code: Option<String>,
}

impl MoneyFormat {
    /// Writes an amount: the code of its currency before the number, so that no two currencies look alike.
    pub fn amount(&self, value: f64) -> String {
        if !value.is_finite() {
            return UNKNOWN.to_owned();
        }
        let size = value.abs();
        let decimals = match size {
            size if size >= WHOLE => 0,
            size if size == 0.0 || size >= SMALL => self.decimals(),
            size => (3 - size.log10().floor() as i32).clamp(0, FINEST) as usize,
        };
        match &self.code {
            Some(code) => format!("{code}{SPACE}{}", grouped(value, decimals)),
            None => grouped(value, decimals),
        }
    }

    fn decimals(&self) -> usize {
        match self.code.as_deref() {
            Some(code) if WITHOUT_UNITS.contains(&code) => 0,
            Some(code) if OF_THOUSAND.contains(&code) => 3,
            _ => 2,
        }
    }
}

/// Writes an amount that may be unknown.
pub(super) fn known(money: &MoneyFormat, value: Option<f64>) -> String {
    money.amount(value.unwrap_or(f64::NAN))
}

/// Writes a number with a comma between thousands.
pub fn grouped(value: f64, decimals: usize) -> String {
    digits::grouped(&fixed(value, decimals)).replace('-', MINUS.encode_utf8(&mut [0; 4]))
}

/// Writes a fraction as a percentage.
pub(super) fn percent(fraction: f64, decimals: usize) -> String {
    if !fraction.is_finite() {
        return UNKNOWN.to_owned();
    }
    format!("{}{NARROW}%", grouped(100.0 * fraction, decimals))
}

/// Writes a return with its sign.
pub(super) fn signed(fraction: f64) -> String {
    format!("{}{}", if fraction > 0.0 { "+" } else { "" }, percent(fraction, 1))
}

/// Writes a share of wealth; nothing and everything, after rounding, have no decimals.
pub(super) fn share(fraction: f64) -> String {
    let is_end = ["0.0", "100.0"].contains(&fixed(100.0 * fraction, 1).as_str());
    percent(fraction, usize::from(!is_end))
}

/// Replaces hyphens before numbers by minus signs in a sentence.
pub(super) fn with_minus(sentence: &str) -> String {
    let mut out = String::with_capacity(sentence.len());
    let mut letters = sentence.chars().peekable();
    let mut before = ' ';
    while let Some(letter) = letters.next() {
        let opens = before.is_whitespace() || ['(', '['].contains(&before);
        let counts = letters.peek().is_some_and(|next| next.is_ascii_digit() || *next == '.');
        out.push(if letter == '-' && opens && counts { MINUS } else { letter });
        before = letter;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn amounts(code: Option<&str>, values: &[f64]) -> Vec<String> {
        let money = MoneyFormat { code: code.map(str::to_owned) };
        values.iter().map(|value| money.amount(*value).replace(SPACE, " ")).collect()
    }

    #[test]
    fn an_amount_has_the_decimals_of_its_currency_and_of_its_size() {
        let values = [0.0, 1234.5, -300.0, 99_999.994, 123_456.78, 2_500_000.0];
        let plain = ["0.00", "1,234.50", "\u{2212}300.00", "99,999.99", "123,457", "2,500,000"];
        assert_eq!(amounts(None, &values), plain);
        assert_eq!(amounts(Some("EUR"), &values[1..3]), ["EUR 1,234.50", "EUR \u{2212}300.00"]);
        assert_eq!(amounts(Some("JPY"), &[1234.5, 0.0]), ["JPY 1,234", "JPY 0"]);
        assert_eq!(amounts(Some("KWD"), &[1234.5]), ["KWD 1,234.500"]);
        assert_eq!(amounts(None, &[0.012344, -1e-6, f64::NAN]), ["0.01234", "\u{2212}0.000001000", UNKNOWN]);
        // An amount that rounds to nothing has no sign.
        assert_eq!(amounts(Some("JPY"), &[-0.3]), ["JPY 0"]);
    }

    #[test]
    fn shares_have_a_decimal_and_the_ends_have_none() {
        let plain = |text: String| text.replace(NARROW, " ");
        assert_eq!(
            [0.0, 0.0004, 0.6123, 0.9997, 1.0].map(share).map(plain),
            ["0 %", "0 %", "61.2 %", "100 %", "100 %"]
        );
        assert_eq!([0.051, -0.049, 0.0].map(signed).map(plain), ["+5.1 %", "\u{2212}4.9 %", "0.0 %"]);
        assert_eq!(plain(percent(12.5, 1)), "1,250.0 %");
    }

    #[test]
    fn a_hyphen_before_a_number_is_a_minus_sign() {
        let sentence = "After -7.0 % (-.5) the no-trade range of 2026-10-31 stays.";
        assert_eq!(with_minus(sentence), "After \u{2212}7.0 % (\u{2212}.5) the no-trade range of 2026-10-31 stays.");
    }
}
