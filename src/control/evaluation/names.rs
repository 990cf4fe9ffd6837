//! Names of strategies: one set for the terminal, tables, the wire, Python and the page.
//!
//! Every report carries the name as `strategy` and the kind beside it; no other code makes a name. Checked by:
//! `tests/project/dashboard.rs::the_page_calls_frameworks_what_reports_call_them`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::caution::CautionLevel;
use crate::control::request::framework::Framework;

/// A kind of strategy in a walk-forward, which decides its colour and its sentences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StrategyKind {
    /// A policy with a ball that learns.
    Adaptive,
    /// The main adaptive policy, trained as if trading were free.
    CostBlind,
    /// A policy with a ball frozen at its window.
    Static,
    /// A policy that takes the empirical law of the known returns as true.
    PlugIn,
    /// A constant 60 % in the risky asset.
    SixtyForty,
    /// All wealth in the risky asset.
    AllStock,
    /// All wealth in the bank.
    AllBank,
    /// A constant mix of the average allocation of the main adaptive strategy, known only at the end.
    OwnMix,
    /// Several assets: the trained policy of their fund, as a session follows it.
    Policy,
    /// Several assets: the best shares against the worst law in a ball of the norm `scaled_one`.
    Robust,
    /// Several assets: the best shares against the worst law in a ball of the norm `sup`.
    RobustSup,
    /// The robust shares, chosen anew only when the radius is.
    RobustStatic,
    /// All wealth at minimum variance.
    MinimumVariance,
    /// All wealth, in inverse proportion to the deviations of the returns.
    InverseVolatility,
    /// All wealth in equal shares of every asset.
    EqualShares,
    /// A constant 60 % of wealth in equal shares of every asset.
    SixtyEqual,
    /// A strategy of the user's own, which has a name of theirs.
    Own,
}

impl StrategyKind {
    /// Returns the name of the kind, without its level, its caution or its window.
    pub fn name(self) -> &'static str {
        match self {
            StrategyKind::Adaptive => framework_name(Framework::Adaptive),
            StrategyKind::CostBlind => "Cautious, blind to costs",
            StrategyKind::Static => framework_name(Framework::Static),
            StrategyKind::PlugIn => framework_name(Framework::PlugIn),
            StrategyKind::SixtyForty => "60/40",
            StrategyKind::AllStock => "All in stocks",
            StrategyKind::AllBank => "All in the bank",
            StrategyKind::OwnMix => "Hindsight",
            StrategyKind::Policy => "Policy",
            StrategyKind::Robust => "Robust",
            StrategyKind::RobustSup => "Robust, sup norm",
            StrategyKind::RobustStatic => "Robust, rarely renewed",
            StrategyKind::MinimumVariance => "Least variance",
            StrategyKind::InverseVolatility => "Inverse volatility",
            StrategyKind::EqualShares => "Equal shares",
            StrategyKind::SixtyEqual => "60 % in equal shares",
            StrategyKind::Own => "Own",
        }
    }
}

/// Returns the name of a framework of policies.
pub fn framework_name(framework: Framework) -> &'static str {
    match framework {
        Framework::Adaptive => "Cautious, learns",
        Framework::Static => "Cautious, fixed",
        Framework::KnownLaw => "Knows the market",
        Framework::PlugIn => "Trusts the record",
        Framework::ParametricStatic => "Cautious, fixed, bell curve",
        Framework::ParametricAdaptive => "Cautious, learns, bell curve",
    }
}

/// Returns the name of the constant mix that holds `share` of wealth in the risky asset.
pub fn mix_name(share: f64) -> String {
    match share {
        0.0 => StrategyKind::AllBank.name().into(),
        0.6 => StrategyKind::SixtyForty.name().into(),
        1.0 => StrategyKind::AllStock.name().into(),
        _ => format!("{} in stocks", percent(share)),
    }
}

/// Checks that the names of a user's own strategies differ from those of all others.
///
/// # Errors
/// The first that does not.
pub fn check_own_names<'a>(
    own: impl Iterator<Item = &'a String>,
    others: impl Iterator<Item = String> + Clone,
) -> Result<(), FieldError> {
    for name in own {
        if others.clone().any(|other| other == *name) {
            return Err(FieldError::new("weights", name, "must differ from the names of the other strategies"));
        }
    }
    Ok(())
}

/// Returns the name of one of several adaptive policies, by the confidence `1 - alpha` of its ball.
pub fn at_level(alpha: f64) -> String {
    format!("{}, {}", StrategyKind::Adaptive.name(), percent(1.0 - alpha))
}

/// Returns the name of the mix of an average allocation that is known only at the end.
pub fn own_mix_name(share: f64) -> String {
    format!("{}: {:.1} % in stocks", StrategyKind::OwnMix.name(), 100.0 * share)
}

/// Returns, in words, how much of the measured radius is used.
pub fn caution_in_words(level: CautionLevel) -> String {
    match level {
        CautionLevel::Paper => "full caution".into(),
        CautionLevel::Scale(scale) => format!("{scale} times the caution"),
        found => found.name().into(),
    }
}

/// Quotes a name within a sentence, because some contain commas.
pub fn quoted(name: &str) -> String {
    format!("\u{201c}{name}\u{201d}")
}

/// Formats a share with only its significant digits, as in 97.5 %. Digits beyond a millionth of a percent come from
/// binary fractions.
fn percent(share: f64) -> String {
    format!("{} %", (1e8 * share).round() / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_the_digits_that_its_share_has() {
        assert_eq!([at_level(0.1), at_level(0.025)], ["Cautious, learns, 90 %", "Cautious, learns, 97.5 %"]);
        let tenths: Vec<String> = [0, 3, 6, 7, 10].map(|tenth| mix_name(f64::from(tenth) / 10.0)).into();
        assert_eq!(tenths, ["All in the bank", "30 % in stocks", "60/40", "70 % in stocks", "All in stocks"]);
        assert_eq!(own_mix_name(0.25), "Hindsight: 25.0 % in stocks");
    }
}
