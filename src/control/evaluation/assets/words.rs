//! Sentences about the figures of several assets, by rules that treat all strategies alike.

use super::report::AssetsFigures;
use super::{AssetsLine, AssetsWalked};
use crate::control::evaluation::account::uncounted_periods;
use crate::control::evaluation::backtest_report::BootstrapEstimate;
use crate::control::evaluation::names::{StrategyKind, quoted};
use crate::control::evaluation::verdict::{all_at_once, cost, few_years, grouped, listed, uncounted};

/// Returns, in words, how much of the past a strategy knows.
pub fn window(window: Option<usize>, year: usize, noun: &str) -> String {
    let counted = |count: usize, noun: &str| format!("{count} {noun}{}", if count == 1 { "" } else { "s" });
    match window {
        None => "all".into(),
        Some(periods) if periods.is_multiple_of(year) => counted(periods / year, "year"),
        Some(periods) => counted(periods, noun),
    }
}

/// Returns what the figures say in sentences, the most important first.
pub fn sentences(walked: &AssetsWalked, figures: &[AssetsFigures]) -> Vec<String> {
    let (lived, record) = (walked.backtest.lived().len(), &walked.backtest.record);
    let mut sentences = vec![ranking(figures)];
    let left_out = uncounted_periods(lived, record.periods_per_year);
    sentences.extend(uncounted(left_out, record.frequency.noun()));
    match few_years(lived / record.periods_per_year) {
        Some(sentence) => sentences.push(sentence),
        None => sentences.extend([against_equal(figures), against_own_mix(figures)]),
    }
    let number = |figures: &AssetsFigures| figures.effective_assets;
    let fall = |figures: &AssetsFigures| Some(100.0 * figures.performance.max_drawdown);
    let share = |figures: &AssetsFigures| Some(100.0 * figures.performance.mean_allocation);
    sentences.extend([
        format!("Effective number of assets held: {}.", ranges(&walked.lines, figures, number, 1, "")),
        format!("Average share of wealth held: {}.", ranges(&walked.lines, figures, share, 0, " %")),
        format!("Largest fall from a peak: {}.", ranges(&walked.lines, figures, fall, 0, " %")),
        cost(
            walked.backtest.choices.trading_cost,
            match walked.backtest.choices.horizon {
                Some(_) => "policies are trained with it, and no other strategy knows of it",
                None => "no strategy knows of it",
            },
        ),
    ]);
    sentences
}

fn ranking(figures: &[AssetsFigures]) -> String {
    let value = |figures: &AssetsFigures| figures.performance.yearly_certainty_equivalent.value;
    let equal = figures.iter().find(|figures| figures.beyond_equal.is_none());
    let best = figures.iter().find(|figures| figures.place == 1);
    let Some((equal, best)) = equal.zip(best) else { return String::new() };
    let best = if equal.place == 1 {
        String::new()
    } else {
        format!(" The first is {} with {:.2}.", quoted(&best.strategy), value(best))
    };
    format!(
        "With {} of all assets a year that starts at 100 is worth {:.2} for certain, place {} of {}.{best}",
        quoted(&equal.strategy),
        value(equal),
        equal.place,
        figures.len()
    )
}

fn against_equal(figures: &[AssetsFigures]) -> String {
    let [ahead, behind, unclear] = of_each(figures, |figures| figures.beyond_equal);
    let compared = all_at_once(figures.len() - 1);
    format!(
        "By the intervals of the differences, {compared}, ahead of equal shares: {ahead}. Behind them: {behind}. No \
         clear difference: {unclear}."
    )
}

fn against_own_mix(figures: &[AssetsFigures]) -> String {
    let [paid, cost, unclear] = of_each(figures, |figures| figures.performance.beyond_own_mix);
    format!(
        "Each strategy is also compared with equal shares at its own average total, which nobody knew beforehand. By \
         intervals that also hold at once, choosing among assets and times paid for: {paid}. It cost: {cost}. The \
         record shows neither for {unclear}."
    )
}

/// Returns the names with an interval above zero, the names with one below, and how many have one around zero.
fn of_each(figures: &[AssetsFigures], of: impl Fn(&AssetsFigures) -> Option<BootstrapEstimate>) -> [String; 3] {
    let [above, below, around] =
        grouped(figures.iter().filter_map(|figures| Some((figures.strategy.as_str(), of(figures)?))));
    [listed(&above), listed(&below), format!("the other {}", around.len())]
}

/// Returns the range from least to most of every family of strategies.
fn ranges(
    lines: &[AssetsLine],
    figures: &[AssetsFigures],
    of: impl Fn(&AssetsFigures) -> Option<f64>,
    decimals: usize,
    unit: &str,
) -> String {
    let mut families: Vec<(StrategyKind, [f64; 2])> = Vec::new();
    for (line, figures) in lines.iter().zip(figures) {
        let (family, Some(value)) = (line.strategy.rule.kind(), of(figures)) else { continue };
        match families.iter_mut().find(|(name, _)| *name == family) {
            Some((_, [low, high])) => (*low, *high) = (low.min(value), high.max(value)),
            None => families.push((family, [value; 2])),
        }
    }
    let family_range = |(family, ends): &(StrategyKind, [f64; 2])| {
        let ([low, high], family) = (ends.map(|end| format!("{end:.decimals$}")), quoted(family.name()));
        if low == high { format!("{family} {low}{unit}") } else { format!("{family} {low} to {high}{unit}") }
    };
    families.iter().map(family_range).collect::<Vec<String>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_told_in_years_where_they_are_whole() {
        let window_name = |periods| window(periods, 12, "month");
        assert_eq!(
            [None, Some(12), Some(120), Some(125), Some(1)].map(window_name),
            ["all", "1 year", "10 years", "125 months", "1 month"]
        );
    }
}
