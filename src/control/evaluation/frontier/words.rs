//! What a frontier says, in sentences.

use super::report::{Bootstrap, Resampled};

/// Standard errors beyond which a premium is told from none.
const TOLD: f64 = 2.0;

/// What the figures say, the most important first.
pub(super) fn sentences(resampled: &[Resampled], evidence: f64, per_year: bool) -> Vec<String> {
    let mut sentences: Vec<String> = resampled.iter().filter_map(|resampled| of_one(resampled, per_year)).collect();
    sentences.extend(resampled.first().map(|first| of_own_mix(first, per_year)));
    let behind = if evidence < 0.0 { "below" } else { "above" };
    let errors = evidence.abs();
    let told = if errors < TOLD { "the record cannot tell it from none" } else { "the record tells it from none" };
    sentences.push(format!(
        "The mean return of the record lies {errors:.1} standard errors {behind} the bank's: {told}. The first two figures are of laws with that mean, the third of one with the mean of the bank; which is true the record says no better than that."
    ));
    sentences.push(
        "A scale that did best in the past says next to nothing about the future: choose by how much loss from record to record you can bear."
            .to_owned(),
    );
    sentences
}

/// What following each record earned beside holding what is advised on average.
fn of_own_mix(resampled: &Resampled, per_year: bool) -> String {
    let per = if per_year { "a year" } else { "a period" };
    let lost = resampled.points.iter().map(|point| format!("{:.1}", (-point.beyond_own_mix.value).max(0.0)));
    let scales = resampled.points.iter().map(|point| point.scale.to_string());
    format!(
        "While the law stays as it is, an allocation that follows the record earns nothing beyond a constant mix of its own average: at scales {} it is {} basis points {per} behind on the first records.",
        scales.collect::<Vec<_>>().join(", "),
        lost.collect::<Vec<_>>().join(", ")
    )
}

/// Which scale loses least, and which cannot be told apart from it.
fn of_one(resampled: &Resampled, per_year: bool) -> Option<String> {
    let least = resampled.points.iter().find(|point| point.beyond_least.is_none())?;
    let steadiest =
        resampled.points.iter().min_by(|one, other| one.deviation.value.total_cmp(&other.deviation.value))?;
    let per = if per_year { "a year" } else { "a period" };
    let records = match resampled.bootstrap {
        Bootstrap::Smoothed { .. } => "On records drawn from the smoothed returns".to_owned(),
        Bootstrap::Block { length } => format!("On records of blocks of {length} periods"),
        Bootstrap::WithoutPremium { .. } => "Were there no premium,".to_owned(),
    };
    let alike: Vec<String> = resampled
        .points
        .iter()
        .filter(|point| point.beyond_least.is_some_and(|beyond| beyond.low <= 0.0))
        .map(|point| point.scale.to_string())
        .collect();
    let alike = match alike.as_slice() {
        [] => String::new(),
        alike => format!("; {} cannot be told apart from it", alike.join(", ")),
    };
    Some(format!(
        "{records} scale {} loses least on average: {:.1} basis points {per}{alike}. Scale {} varies least from record to record, by {:.1}.",
        least.scale, least.lost.value, steadiest.scale, steadiest.deviation.value
    ))
}
