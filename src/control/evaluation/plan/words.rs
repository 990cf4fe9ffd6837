//! A plan in sentences.

use super::report::{BreakingReturn, InBothWorlds, PlanReport, PlanRule, PlanStrategy, SustainableSpending};
use crate::control::request::annualised::compounded;
use crate::control::request::frequency::Frequency;
use crate::control::request::plan::{PlanAim, PlanQuestion};
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::machine::digits;

/// Standard errors within which the mean of a record may well differ from the true one.
const NEAR: f64 = 1.0;
/// The worst case in words.
const WORST: &str = "when returns are as bad as caution allows for";
/// Share of a figure below which a difference counts as none: paths err by more.
const NEGLIGIBLE: f64 = 1e-3;

/// Returns the answer, the most important first; the last says what would have to be true for it to fail.
pub(super) fn sentences(report: &PlanReport, question: &PlanQuestion) -> Vec<String> {
    let problem = &question.problem;
    let (periods, certainty) = (problem.periods_per_year, question.certainty);
    let noun = Frequency::noun_for(periods);
    let mut sentences = vec![now(report, question, noun)];
    let is_aimed = question.aim == PlanAim::Goal;
    if is_aimed {
        sentences.extend(question.goal.and_then(|goal| aimed(report, question, goal, noun)));
    } else {
        sentences.push(lasts(report, question, noun));
        sentences.extend(goal(report, question.goal));
        sentences.extend(secured(report, problem, noun));
        sentences.extend(question.drawdown_limit.and_then(|limit| limited(report, limit, noun)));
        sentences.extend(report.sustainable.first().map(|amount| sustainable(amount, certainty, noun)));
        sentences.push(worth(report, noun));
    }
    sentences.extend(cost(report, noun));
    let amount = amount(if is_aimed { question.goal.unwrap_or_default() } else { report.wanted.amount });
    let lasting = match is_aimed {
        true => format!("the plan to end with {amount} in {} of 100 futures", certain(certainty)),
        false => format!("a fixed {amount} a {noun} to last in {} of 100 futures", certain(certainty)),
    };
    sentences.push(breaking(report, periods, &lasting, noun));
    sentences
}

fn now(report: &PlanReport, question: &PlanQuestion, noun: &str) -> String {
    let problem = &question.problem;
    let (share, spent) = report.advice.spending.map_or((0.0, 0.0), |spending| (spending.share, spending.amount));
    let yearly = problem.periods_per_year.filter(|periods| *periods > 1.0);
    let pace = yearly.map_or_else(
        || format!("{} of wealth", percent(share)),
        |periods| format!("{} of wealth a year", percent(share * periods)),
    );
    let of = |(name, share): (&String, &f64)| format!("{} of it {name}", percent(*share));
    let held =
        report.composition.as_ref().map(|shares| shares.iter().filter(|(_, share)| **share > 0.0).map(of).collect());
    let held =
        held.map_or("the risky asset".to_owned(), |held: Vec<String>| format!("the assets ({})", held.join(", ")));
    let left = problem.initial_wealth - spent + question.saved.unwrap_or(0.0);
    let spend = match (spent, question.saved) {
        (_, Some(saved)) => format!("Put in {} this {noun}. Of the {} then, hold", amount(saved), amount(left)),
        (0.0, None) => format!("Of the {}, hold", amount(left)),
        (_, None) => format!("Spend {} this {noun} ({pace}). Of the {} left, hold", amount(spent), amount(left)),
    };
    format!(
        "{spend} {} ({}) in {held} and keep the rest in the bank.",
        amount(report.advice.allocation * left),
        percent(report.advice.allocation)
    )
}

/// Says how likely the goal is reached that the plan aims at, and what is missing where it is not.
fn aimed(report: &PlanReport, question: &PlanQuestion, goal: f64, noun: &str) -> Option<String> {
    let PlanQuestion { wanted, saved, .. } = *question;
    let plan = report.strategies.first()?;
    let (reaches, shortfall) = plan.reaches_goal.zip(plan.shortfall)?;
    let does = |does: &str, each: Option<f64>| each.map(|each| format!("{does} {} a {noun} and ", amount(each)));
    let spending = does("spends", wanted).or(does("puts in", saved)).unwrap_or_default();
    let of = if wanted.is_some() { " of the spending and the goal" } else { "" };
    let missing = match 1.0 - reaches.record.value {
        0.0 => String::new(),
        fails => format!("; in the others {} is missing{of} on average", amount(shortfall.record.value / fails)),
    };
    Some(format!(
        "The plan {spending}ends with the {} wanted in {} of 100 simulated futures like the record{missing}. In the worst case, {WORST}, it ends with them in {}. Once wealth left in the bank would reach them by itself, nothing is held at risk, and the nearer that is the less: ask again each {noun}.",
        amount(goal),
        of_hundred(reaches.record.value),
        of_hundred(reaches.worst.value),
    ))
}

/// Says how far money that stays invested may fall, and how far it does.
fn limited(report: &PlanReport, limit: f64, noun: &str) -> Option<String> {
    let InBothWorlds { record, .. } = report.strategies.first()?.max_drawdown;
    Some(format!(
        "Money that is not spent stays within {} of its highest value, even through the worst {noun} that caution counts with. In one of twenty futures it falls {} or more. The nearer it comes to the limit, the less is held: ask again each {noun}.",
        percent(limit),
        percent(record.value)
    ))
}

fn worth(report: &PlanReport, noun: &str) -> String {
    format!(
        "The plan itself spends more when wealth grows and less when it falls. In the worst case it is worth as much as a guaranteed {} a {noun} at today's prices; the bank alone gives {}.",
        amount(report.advice.certainty_equivalent),
        amount(report.advice.floor)
    )
}

/// Says what is secured, and which money pays for it.
fn secured(report: &PlanReport, problem: &ProblemSpecification, noun: &str) -> Option<String> {
    let (advised, spending) = report.advice.spending.zip(problem.spending.as_ref())?;
    let level = (spending.secured > 0.0).then(|| format!("{} a {noun}", amount(spending.secured)));
    let left = (spending.secured_left > 0.0).then(|| format!("{} at the end", amount(spending.secured_left)));
    let both: Vec<String> = level.into_iter().chain(left).collect();
    let sentence = || {
        format!(
            "{} at today's prices {} safe whatever the market does: {} in the bank pays for that, and only the rest is at risk.",
            both.join(" and "),
            if both.len() == 1 { "is" } else { "are" },
            amount(advised.reserve)
        )
    };
    (!both.is_empty()).then(sentence)
}

fn lasts(report: &PlanReport, question: &PlanQuestion, noun: &str) -> String {
    let InBothWorlds { record, worst } = report.wanted.lasts;
    let (wanted, spent) = (report.wanted.amount, report.advice.spending.map_or(0.0, |spending| spending.amount));
    let answer = match question.wanted {
        Some(_) if spent < wanted => format!("The plan starts with less than the {} wanted. ", amount(wanted)),
        Some(_) => format!("The plan starts with the {} wanted or more. ", amount(wanted)),
        None => String::new(),
    };
    // With a reserve the plan itself holds less than these shares of all that is left.
    let mix = report.periods.first().filter(|first| first.reserve.is_some());
    let mix = mix.map_or(String::new(), |first| format!(", with {} held and no reserve,", percent(first.held)));
    format!(
        "{answer}A fixed {} a {noun}{mix} lasts all {} {noun}s in {} of 100 simulated futures like the record, and in {} in the worst case, {WORST}.",
        amount(wanted),
        question.problem.horizon,
        of_hundred(record.value),
        of_hundred(worst.value)
    )
}

fn sustainable(found: &SustainableSpending, certainty: f64, noun: &str) -> String {
    let InBothWorlds { record, worst } = found.amount;
    format!(
        "The largest fixed amount that lasts in {} of 100 futures is {} a {noun}, or {} in the worst case; nothing is set aside for the end.",
        certain(certainty),
        amount(record.value),
        amount(worst.value)
    )
}

/// Says what robustness costs and what it buys, beside the same plan without a ball.
fn cost(report: &PlanReport, noun: &str) -> Option<String> {
    let of = |rule: PlanRule| report.strategies.iter().find(|strategy| strategy.rule == rule);
    let (own, trusting): (&PlanStrategy, &PlanStrategy) = of(PlanRule::Plan).zip(of(PlanRule::Trusting))?;
    if report.advice.radius == 0.0 {
        return None;
    }
    let [record, worst] = match own.certainty_equivalent.zip(trusting.certainty_equivalent) {
        Some((own, trusting)) => {
            let turned = |difference: f64, [more, less]: [&str; 2]| match difference {
                difference if difference.abs() <= NEGLIGIBLE * trusting.record.value => format!("{more} nothing"),
                difference => {
                    format!("{} {} a {noun}", if difference > 0.0 { more } else { less }, amount(difference.abs()))
                }
            };
            let (lost, saved) = (trusting.record.value - own.record.value, own.worst.value - trusting.worst.value);
            [turned(lost, ["costs", "brings"]), turned(saved, ["saves", "costs"])]
        }
        None => {
            let (own, trusting) = (own.shortfall?, trusting.shortfall?);
            let turned = |difference: f64| match difference {
                difference if difference.abs() <= NEGLIGIBLE * trusting.record.value => "as much".to_owned(),
                difference if difference > 0.0 => format!("{} more", amount(difference)),
                difference => format!("{} less", amount(-difference)),
            };
            [own.record.value - trusting.record.value, own.worst.value - trusting.worst.value]
                .map(|difference| format!("leaves {} missing on average", turned(difference)))
        }
    };
    Some(format!(
        "Compared with a plan that fully trusts the record, caution {record} if the record is right, and {worst} in the worst case."
    ))
}

fn goal(report: &PlanReport, goal: Option<f64>) -> Option<String> {
    let InBothWorlds { record, worst } = report.strategies.first()?.reaches_goal?;
    Some(format!(
        "The plan ends with the {} wanted in {} of 100 futures, and in {} in the worst case. It does not aim at them: to plan for them, secure them, or let the plan aim at the goal.",
        amount(goal?),
        of_hundred(record.value),
        of_hundred(worst.value)
    ))
}

fn breaking(report: &PlanReport, periods: Option<f64>, lasting: &str, noun: &str) -> String {
    let Some(BreakingReturn { mean_return, mean_seen, standard_errors }) = report.breaking else {
        return format!("No mean return of the asset decides it for {lasting}.");
    };
    let (unit, [breaking, seen]) = match periods {
        Some(periods) => ("year", [mean_return, mean_seen].map(|mean| compounded(mean, periods))),
        None => (noun, [mean_return, mean_seen]),
    };
    let error = if standard_errors == 0.0 { 0.0 } else { (breaking - seen) / standard_errors };
    let verdict = match standard_errors {
        errors if errors.abs() <= NEAR => ", which leaves open whether it will",
        errors if errors > 0.0 => ": it would have to do better than that",
        _ => ": it may do worse than that and still suffice",
    };
    format!(
        "For {lasting}, the asset must return {} a {unit} on average. The record shows {}, give or take {} by chance{verdict}.",
        percent(breaking),
        percent(seen),
        percent(error)
    )
}

/// Formats an amount: without decimals from 1000 on, and with commas from 10,000 on; with two decimals or none below, and
/// with four digits below 1.
pub fn amount(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = match value.abs() {
        size if size >= 1000.0 => 0,
        size if size >= 1.0 => 2,
        size => (3.0 - size.log10().floor()) as usize,
    };
    let text = digits::fixed(value, decimals);
    if value.abs() >= 9999.5 {
        return digits::grouped(&text);
    }
    text.strip_suffix(".00").map(str::to_owned).unwrap_or(text)
}

/// Formats a fraction with three digits.
fn percent(share: f64) -> String {
    digits::percent(share, if share.abs() < 0.0995 { 2 } else { 1 })
}

/// Formats a probability as a number of a hundred, and never as certain if it is not.
fn of_hundred(share: f64) -> String {
    match share {
        0.0 => "none".to_owned(),
        share if share < 0.01 => "fewer than 1".to_owned(),
        share if share > 0.99 && share < 1.0 => "more than 99".to_owned(),
        share => digits::fixed(100.0 * share, 0),
    }
}

/// Formats the certainty asked for as a number of a hundred.
fn certain(certainty: f64) -> String {
    let text = digits::fixed(100.0 * certainty, 1);
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
