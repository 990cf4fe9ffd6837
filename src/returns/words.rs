//! Numbers and counts in sentences.

use crate::control::request::annualised::compounded;

/// A yearly return that nothing reaches; above it no digits are shown.
const BEYOND_ALL: f64 = 100.0;

/// Returns a fraction in percent with two decimals.
pub fn percent(fraction: f64) -> String {
    let shown = format!("{:.2}", 100.0 * fraction);
    format!("{} %", if shown == "-0.00" { "0.00" } else { &shown })
}

/// Returns the compounded return of a year with `periods` periods that earn `mean` each.
pub fn percent_a_year(mean: f64, periods: f64) -> String {
    let a_year = compounded(mean, periods);
    if a_year > BEYOND_ALL { format!("more than {}", percent(BEYOND_ALL)) } else { percent(a_year) }
}

/// Returns a count with its noun, in the plural unless the count is 1.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
