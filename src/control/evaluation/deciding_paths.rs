//! How many of the simulated paths determine a strategy's certainty equivalent.

use crate::control::evaluation::names::quoted;
use crate::control::problem::utility::RelativeUtility;

/// Fewer paths than this are too few for a reliable mean.
const FEW_PATHS: f64 = 100.0;

/// Returns the effective sample size of these weights, `(sum v)^2 / sum v^2`. Source: Kish (1965), Survey Sampling.
fn effective_number(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = weights.fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
    sum * sum / squares
}

/// Names, in a sentence, the strategies whose certainty equivalent depends on so few paths that its interval is
/// unreliable. Each strategy comes with its terminal wealth path by path. A path's weight is its marginal utility. Few
/// means below a hundred, or below half of the paths. Checked by:
/// `what_few_paths_decide_is_said_where_intervals_do_not_hold`.
pub fn few_decide<'a>(
    strategies: impl Iterator<Item = (&'a str, &'a Vec<f64>)>,
    utility: RelativeUtility,
    floor: f64,
) -> Option<String> {
    let mut count = 0;
    let mut named = Vec::new();
    for (name, wealth) in strategies {
        count = wealth.len();
        let deciding = effective_number(wealth.iter().map(|wealth| utility.weight((wealth / floor).ln())));
        if deciding < FEW_PATHS.min(0.5 * count as f64) {
            named.push(format!("{} ({deciding:.0})", quoted(name)));
        }
    }
    (!named.is_empty()).then(|| {
        format!(
            "Few of the {count} paths decide what these strategies are worth for certain, so their intervals hold \
             less often than stated: {}.",
            named.join("; ")
        )
    })
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::numerics::machine::streams::stream;
    use crate::numerics::statistics::summary::Clustered;

    /// Counts over 200 reports of 300 paths of twelve months in stocks. The first count is how often the 90 % interval
    /// of the certainty equivalent holds the truth. The second is how often the sentence appears.
    fn held_and_noted(eta: f64, crash: f64) -> [usize; 2] {
        let utility = RelativeUtility::Power { eta };
        let mut generator = stream(6, "test", eta as usize, 0);
        // E[e^((1 - eta) Z)] of one month, in closed form.
        let normal = |power: f64| (0.008 * power + 0.5 * (0.04 * power).powi(2)).exp();
        let moment = |power: f64| (1.0 - crash) * normal(power) + crash * 0.75_f64.powf(power);
        let truth = (moment(1.0 - eta).powi(12) - 1.0) / (1.0 - eta);
        let mut counts = [0; 2];
        for _ in 0..200 {
            let mut month = || match generator.random::<f64>() < crash {
                true => 0.75_f64.ln(),
                false => 0.008 + 0.04 * generator.sample::<f64, _>(StandardNormal),
            };
            let wealth: Vec<f64> = (0..300).map(|_| 100.0 * (0..12).map(|_| month()).sum::<f64>().exp()).collect();
            let values: Vec<f64> = wealth.iter().map(|wealth| utility.value((wealth / 100.0).ln())).collect();
            let found = Clustered::new(1, 300, 0.9).mean(&values);
            counts[0] += usize::from(found.low <= truth && truth <= found.high);
            counts[1] += usize::from(few_decide(std::iter::once(("all", &wealth)), utility, 100.0).is_some());
        }
        counts
    }

    #[test]
    fn what_few_paths_decide_is_said_where_intervals_do_not_hold() {
        // Three months in a hundred lose a quarter of wealth.
        let [held, noted] = held_and_noted(10.0, 0.03);
        assert!(held < 165 && noted > 190, "{held} held and {noted} noted of 200");
        let [held, noted] = held_and_noted(3.0, 0.0);
        assert!(held > 168 && noted < 5, "{held} held and {noted} noted of 200");
    }
}
