//! Numbers and counts in sentences.

use crate::control::request::annualised::compounded;

/// A return a year that nothing has: of more no digits are told.
const BEYOND_ALL: f64 = 100.0;

/// A fraction in per cent: two decimals.
pub fn percent(fraction: f64) -> String {
    let shown = format!("{:.2}", 100.0 * fraction);
    format!("{} %", if shown == "-0.00" { "0.00" } else { &shown })
}

/// Return of a year whose `periods` earn `mean` each, compounded.
pub fn percent_a_year(mean: f64, periods: f64) -> String {
    let a_year = compounded(mean, periods);
    if a_year > BEYOND_ALL { format!("more than {}", percent(BEYOND_ALL)) } else { percent(a_year) }
}

/// So many things.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
