//! Numbers and counts in sentences.

/// A fraction in per cent: two decimals.
pub fn percent(fraction: f64) -> String {
    let shown = format!("{:.2}", 100.0 * fraction);
    format!("{} %", if shown == "-0.00" { "0.00" } else { &shown })
}

/// So many things.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
