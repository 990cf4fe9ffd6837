//! An advice on several assets.

use std::fmt::Write;

use ballast::service::advice::advise_assets::AssetsAdvised;

use super::{caution, money, percent};

/// Describes what to hold of each asset, and the basis of the advice.
pub fn describe_several(advised: &AssetsAdvised, wealth: f64, noun: &str, periods: f64) -> String {
    let advice = &advised.advice;
    let total = percent(advice.total, 1);
    let mut text = match advice.total > 0.0 {
        true if advice.total >= 0.9995 => format!("Hold all wealth in these assets through the coming {noun}.\n"),
        true => format!("Hold {total} of wealth in these assets through the coming {noun}, the rest in the bank.\n"),
        false => format!("Hold nothing of these assets through the coming {noun}: keep all wealth in the bank.\n"),
    };
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "Against the worst law in the ball around the {} dates, that is worth {} for certain at the end of the {noun};\n\
         the bank alone reaches {}.\n",
        advice.sample_size,
        money(advice.certainty_equivalent),
        money(advice.floor)
    );
    if let Some(why) = &advised.why_nothing {
        let _ = writeln!(text, "{}\n", caution::why_nothing("The assets by inverse volatility", why, noun));
    }
    let width = advice.allocation.keys().map(String::len).max().unwrap_or_default();
    let _ = writeln!(
        text,
        "  {:<width$}{:>9}{:>9}{:>12}   mean log-return a {noun}: seen, and by the worst law",
        "", "hold", "trade", "hold"
    );
    for (asset, share) in &advice.allocation {
        let means = advice
            .worst_means
            .get(asset)
            .map_or(String::new(), |mean| format!("{:>10}{:>10}", percent(mean.seen, 2), percent(mean.worst, 2)));
        let trade = advice.trade.get(asset).map_or(String::new(), |share| format!("{:+.1} %", 100.0 * share));
        let held = percent(*share, 1);
        let _ = writeln!(text, "  {asset:<width$}{held:>9}{trade:>9}{:>12}   {means}", money(share * wealth));
    }
    if let Some(levels) = &advice.levels {
        text += &format!("\n{}", caution::describe(levels, periods));
    }
    let warnings = advised.warnings.iter().map(|warning| &warning.message);
    for sentence in warnings.chain(advice.caution.iter().map(|caution| &caution.sentence)) {
        text += &format!("\n{sentence}");
    }
    text.trim_end().to_owned()
}
