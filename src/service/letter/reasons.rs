//! The words on why: what the advice is worth against the worst market, and what would change it.

use crate::control::assets::advice::OneStep;
use crate::control::assets::fund::Fund;
use crate::control::policy::advice::Advice;
use crate::control::request::framework::Framework;
use crate::service::letter::content::{Phrase, plain, strong};
use crate::service::letter::figures::{MoneyFormat, percent};
use crate::service::sessions::account_state::AccountState;

/// A smaller difference of means, in simple return, counts as none.
const LEAST: f64 = 5e-6;

/// Says what the advice is worth `end`, in the worst market if the policy guards against one.
pub(super) fn worth(advice: &Advice, money: &MoneyFormat, end: &str, framework: Framework) -> Vec<Phrase> {
    let (even, market) = match framework.has_ball() || framework.is_parametric() {
        true => ("Even in the worst market it guards against", "In the worst market it guards against"),
        false => ("If the market is what this policy assumes", "If the market is what this policy assumes"),
    };
    let floor = strong(money.amount(advice.floor));
    if advice.allocation == 0.0 {
        let nothing = plain(format!("{market}, nothing beats the bank, which reaches "));
        return vec![nothing, floor, plain(format!(" {end}."))];
    }
    vec![
        plain(format!("{even}, this is worth as much as a sure ")),
        strong(money.amount(advice.certainty_equivalent)),
        plain(format!(" {end}; all in the bank comes to ")),
        floor,
        plain("."),
    ]
}

/// Returns the lowest simple return in the record: of the asset, or of the composition of several.
pub(super) fn worst_seen(account: &AccountState) -> f64 {
    match &account.assets {
        None => account.state.law.atoms().first().map_or(0.0, |lowest| lowest.exp_m1()),
        Some(assets) => {
            let Fund { rows, composition, .. } = &assets.fund;
            let of = |row: &Vec<f64>| -> f64 { composition.iter().zip(row).map(|(share, z)| share * z.exp_m1()).sum() };
            rows.iter().map(of).reduce(f64::min).unwrap_or_default()
        }
    }
}

/// Says that this is no guarantee, and what the advice would lose in a period of this return, in simple return, on what is
/// held at risk. `left` is the wealth after spending, `rate` the return of the bank, `unit` the noun for a period.
pub(super) fn may_lose(
    advice: &Advice,
    lowest: f64,
    (left, rate): (f64, f64),
    (money, unit): (&MoneyFormat, &str),
) -> Vec<Phrase> {
    let lost = -(advice.allocation * lowest + (1.0 - advice.allocation) * rate) * left;
    if lost <= 0.0 {
        return Vec::new();
    }
    let lowest = percent(lowest, 1);
    vec![
        plain(format!(
            " That is a comparison, and no guarantee: a {unit} like the worst in the record, {lowest}, would cost "
        )),
        strong(money.amount(lost)),
        plain("."),
    ]
}

/// Says what the worst market takes most from, of assets in the order of `names`; `unit` is the noun for a period.
pub(super) fn worst_market(one_step: &OneStep, names: &[String], unit: &str) -> Option<String> {
    let means = names.iter().filter_map(|name| Some((name, one_step.worst_means.get(name)?)));
    let rows: Vec<(&String, f64, f64, bool)> = means
        .map(|(name, mean)| {
            let believed = mean.believed.unwrap_or(mean.seen);
            (name, believed.exp_m1(), mean.worst.exp_m1(), believed != mean.seen)
        })
        .collect();
    let lost = |row: &(&String, f64, f64, bool)| row.1 - row.2;
    let most = rows.iter().copied().reduce(|one, other| if lost(&other) > lost(&one) { other } else { one })?;
    if lost(&most) < LEAST {
        return Some(
            "It assumes that every asset keeps its average return, because no allowed market is worse for this advice."
                .to_owned(),
        );
    }
    let (name, believed, worst, _) = most;
    let known = if rows.iter().any(|(.., is_moved)| *is_moved) { "believed" } else { "seen" };
    let (worst, believed) = (percent(worst, 2), percent(believed, 2));
    Some(format!("That market takes most from {name}: {worst} a {unit} on average, compared with {believed} {known}."))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::control::assets::advice::WorstMean;

    fn sentence(means: &[(&str, f64, Option<f64>, f64)]) -> String {
        let named = means.iter().map(|&(name, seen, believed, worst)| {
            let [seen, worst] = [seen, worst].map(f64::ln_1p);
            (name.to_owned(), WorstMean { seen, believed: believed.map(f64::ln_1p), worst })
        });
        let one_step = OneStep {
            allocation: BTreeMap::new(),
            certainty_equivalent: 1.0,
            bound: 1.0,
            worst_means: named.collect(),
            caution: Vec::new(),
        };
        let names: Vec<String> = means.iter().map(|(name, ..)| (*name).to_owned()).collect();
        worst_market(&one_step, &names, "month").unwrap().replace('\u{202f}', " ")
    }

    #[test]
    fn the_worst_market_takes_most_from_one_asset() {
        assert_eq!(
            sentence(&[("stocks", 0.01, None, -0.002), ("bonds", 0.003, None, 0.002)]),
            "That market takes most from stocks: \u{2212}0.20 % a month on average, compared with 1.00 % seen."
        );
        assert_eq!(
            sentence(&[("stocks", 0.01, Some(0.008), 0.007), ("bonds", 0.003, Some(0.005), 0.002)]),
            "That market takes most from bonds: 0.20 % a month on average, compared with 0.50 % believed."
        );
        assert!(sentence(&[("stocks", 0.01, None, 0.01)]).starts_with("It assumes that every asset keeps"));
    }
}
