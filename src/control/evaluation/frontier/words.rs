//! Sentences about a frontier.

use super::report::{Bootstrap, ResampledFrontier};

/// Standard errors beyond which a premium counts as distinguishable from none.
const TOLD: f64 = 2.0;

/// Returns the findings in sentences, the most important first.
pub(super) fn sentences(resampled: &[ResampledFrontier], evidence: f64, per_year: bool) -> Vec<String> {
    let mut sentences: Vec<String> = resampled.iter().filter_map(|resampled| of_one(resampled, per_year)).collect();
    sentences.extend(resampled.first().map(|first| of_own_mix(first, per_year)));
    let behind = if evidence < 0.0 { "below" } else { "above" };
    let errors = evidence.abs();
    let chance = if errors < TOLD { "that may be chance" } else { "that is hardly chance" };
    sentences.push(format!(
        "The average return of the record lies {behind} the bank's by {errors:.1} standard errors: {chance}. The first two figures are for markets with that average, the third for one with the bank's. The record does not settle which is true."
    ));
    sentences.push(
        "What did best on such records says next to nothing about the future, and the variation from record to record \
         need not fall as caution grows. More caution makes sense only if you doubt that average."
            .to_owned(),
    );
    sentences
}

/// Formats basis points as percent.
fn percent(basis_points: f64) -> String {
    format!("{:.3} %", basis_points / 100.0)
}

/// Names a multiple of the requested caution, within a sentence.
fn caution(scale: f64) -> String {
    match scale {
        0.0 => "no caution".to_owned(),
        1.0 => "this caution".to_owned(),
        scale => format!("{scale} times this caution"),
    }
}

/// Lists several names within a sentence.
fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Capitalises the words for the start of a sentence.
fn opening(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Compares following each record with holding the average of its advice.
fn of_own_mix(resampled: &ResampledFrontier, per_year: bool) -> String {
    let per = if per_year { "a year" } else { "a period" };
    let lost = |beyond: f64| percent((-beyond).max(0.0));
    let each: Vec<String> = resampled
        .points
        .iter()
        .map(|point| format!("{} with {}", lost(point.beyond_own_mix.value), caution(point.scale)))
        .collect();
    format!(
        "While the market stays as it is, following the record earns nothing more than holding its average advice: on the first records it loses {per} {}.",
        listed(&each)
    )
}

/// Names the scale that loses least, and the scales indistinguishable from it.
fn of_one(resampled: &ResampledFrontier, per_year: bool) -> Option<String> {
    let least = resampled.points.iter().find(|point| point.beyond_least.is_none())?;
    let steadiest =
        resampled.points.iter().min_by(|one, other| one.deviation.value.total_cmp(&other.deviation.value))?;
    let per = if per_year { "a year" } else { "a period" };
    let records = match resampled.bootstrap {
        Bootstrap::Smoothed { .. } => "On records drawn from the smoothed returns".to_owned(),
        Bootstrap::Block { length } => format!("On records of blocks of {length} periods"),
        Bootstrap::WithoutPremium { .. } => "If the market pays no more than the bank,".to_owned(),
    };
    let alike: Vec<String> = resampled
        .points
        .iter()
        .filter(|point| point.beyond_least.is_some_and(|beyond| beyond.low <= 0.0))
        .map(|point| caution(point.scale))
        .collect();
    let alike = match alike.as_slice() {
        [] => String::new(),
        alike => format!("; {} cannot be distinguished from it", listed(alike)),
    };
    Some(format!(
        "{records} {} loses least on average: {} {per}{alike}. {} varies least from record to record, by {}.",
        caution(least.scale),
        percent(least.lost.value),
        opening(&caution(steadiest.scale)),
        percent(steadiest.deviation.value)
    ))
}
