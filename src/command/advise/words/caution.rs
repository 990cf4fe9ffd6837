//! The levels of caution, in a sentence and a table.

use std::fmt::Write;

use ballast::control::policy::levels::{LevelAdvised, LevelsAdvised, WhyNothing};

use super::percent;

/// Describes the record's mean return beyond the bank, its standard error, what the caution leaves of it, and the
/// allocation at half the caution.
pub fn why_nothing(record: &str, why: &WhyNothing, noun: &str) -> String {
    let [seen, error] = [why.premium_seen, why.standard_error].map(|premium| percent(premium.abs(), 2));
    let text = match why.premium_seen > 0.0 {
        true => format!("{record} beat the bank by {seen} a {noun}; the chance error of that is {error}."),
        false => format!("{record} paid {seen} a {noun} less than the bank; the chance error of that is {error}."),
    };
    let left = why.premium_left.filter(|left| why.premium_seen > 0.0 && *left < 0.0);
    let as_well =
        left.map(|left| format!("At this caution the true return may be {} below the bank's.", percent(left.abs(), 2)));
    let half = why.at_half_the_caution.map(|share| match share > 0.0 {
        true => format!("Half the caution would hold {}.", percent(share, 1)),
        false => "Half the caution would hold nothing either.".into(),
    });
    let second: Vec<String> = as_well.into_iter().chain(half).collect();
    if second.is_empty() { text } else { format!("{text}\n{}", second.join(" ")) }
}

/// Describes the yearly cost and gain of the level followed and of the others, with `periods` periods in a year.
pub fn describe(levels: &LevelsAdvised, periods: f64) -> String {
    let a_year = |loss: f64| format!("{:.2} %", 100.0 * periods * loss.max(0.0));
    let mut text = String::new();
    if let Some(LevelAdvised { level, scale, regrets, spared, .. }) =
        levels.levels.iter().find(|level| level.level == levels.followed)
    {
        let saved = if *spared < 0.0 { "costs" } else { "saves" };
        let supposed = match levels.premium_seen > 0.0 {
            true => "what the record shows plus a standard error",
            false => "a standard error, as the record shows no premium",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "Caution is {}: {} of the radius is used. If the premium is {supposed},\n\
             this costs {} a year compared with the best share; if there is none, it {saved} {} a year compared with \
             trusting the record.\n",
            level.name(),
            percent(*scale, 0),
            a_year(regrets[2]),
            a_year(spared.abs()),
        );
    }
    let [none, half, whole] = levels.premiums.map(|premium| percent(periods * premium, 1));
    let _ = writeln!(text, "  {:<10}{:>9}{:>9}   yearly cost if the yearly premium is", "caution", "share", "hold");
    let _ = writeln!(text, "  {:<28}   {none:>8}{half:>9}{whole:>9}", "");
    for LevelAdvised { level, scale, regrets, allocation, .. } in &levels.levels {
        let mark = if *level == levels.followed { "<" } else { "" };
        let held = allocation.map_or("-".to_owned(), |share| percent(share, 1));
        let [none, half, whole] = regrets.map(a_year);
        let (name, share) = (level.name(), percent(*scale, 0));
        let _ = writeln!(text, "  {name:<10}{share:>9}{held:>9}   {none:>8}{half:>9}{whole:>9}  {mark}");
    }
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use ballast::control::request::caution::CautionLevel;

    use super::*;

    #[test]
    fn the_level_followed_is_told_with_its_price_and_the_others_beside() {
        let level = |level, scale, allocation| LevelAdvised {
            level,
            scale,
            regrets: [0.0001, 0.0002, 0.0003],
            spared: 0.0004,
            allocation: Some(allocation),
            allocation_error: None,
        };
        let levels = LevelsAdvised {
            followed: CautionLevel::Balanced,
            premium_seen: 0.005,
            standard_error: 0.001,
            premiums: [0.0, 0.003, 0.006],
            levels: vec![
                level(CautionLevel::Bold, 0.1, 0.7),
                level(CautionLevel::Balanced, 0.2, 0.6),
                level(CautionLevel::Paper, 1.0, 0.0),
            ],
        };
        let text = describe(&levels, 12.0);
        // A regret of 0.0003 per month is 0.36 % per year, and 0.0004 is 0.48 %.
        assert!(text.contains("20 % of the radius") && text.contains("0.36 %") && text.contains("0.48 %"), "{text}");
        let line = text.lines().find(|line| line.contains("balanced  ")).unwrap();
        assert!(line.ends_with('<') && line.contains("60.0 %") && line.contains("0.12 %"), "{text}");
    }
}
