//! Warnings about requests that are valid but probably mistaken, above all in a unit.
//!
//! A warning rejects nothing, because each of these requests can be intended: banks have paid 50 % a year, and coins
//! have moved as much in a day.

use std::borrow::Cow;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::request::annualised::{self, compounded};
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::centre_rules::LEAST_LIKE;
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::law::conditional::{effective, kernel_weights};
use crate::numerics::statistics::summary::quantile;
use crate::numerics::statistics::tail_index::{TailIndex, tail_indices};

/// Annual rates above this are rarely paid in a currency that keeps its value.
const HIGH_RATE_A_YEAR: f64 = 0.15;
/// Rises of prices above this in a year are rarely planned for: a rate of a year given for a quarter is higher.
const HIGH_INFLATION_A_YEAR: f64 = 0.08;
/// Annual deviations of log-returns above this are those of daily or monthly returns in percent. Shares have 0.15 to 1,
/// coins up to 2.5; the returns of an index in percent have from 10 (months) to 16 (days).
const LARGE_DEVIATION_A_YEAR: f64 = 3.0;
/// Largest usual deviation of log-returns in one period of unknown length: more than most shares move in a year.
const LARGE_DEVIATION: f64 = 0.5;
/// Costs above this are those of houses, not of assets that are traded every period.
const HIGH_TRADING_COST: f64 = 0.02;

/// Order of the moment that a ball needs more than: its radius is finite if a moment above the second exists.
const NEEDED_MOMENT: f64 = 2.0;
/// Standard errors between the estimate of a tail index and its upper bound: 95 %, one-sided.
const TAIL_ERRORS: f64 = 1.645;

/// A return so many times as far from the median as any other may be a slip of the keyboard. Of the 1,098 windows of 12
/// months in the bundled market 10 have one as far out, of those of 24 months 2, and of those of 60 months none.
const LONE: f64 = 4.0;
/// A lone return this near to the median is no slip worth asking about, in log-return.
const NEAR: f64 = 0.02;
/// With fewer returns one of them may well be alone.
const LEAST_LONE: usize = 12;

/// Something in a valid request that may be a mistake.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Warning {
    /// Kind of the warning.
    pub code: WarningCode,
    /// Dotted path of the field in the request.
    #[schema(value_type = String)]
    pub field: Cow<'static, str>,
    /// The value, what it means, and what the field should hold if something else was meant, in sentences.
    pub message: String,
}

/// Kind of a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WarningCode {
    /// The bank pays more than 15 % a year. Without `periods_per_year` a period counts as a year, its greatest length.
    RateHigh,
    /// The bank pays more than the mean of the record's simple returns.
    RateAboveRecord,
    /// The record's log-returns have a standard deviation above 3 a year, or above 0.5 a period if `periods_per_year`
    /// is not given.
    RecordInPercent,
    /// Trading costs more than 2 %.
    TradingCostHigh,
    /// Prices rise more than 8 % a year. Without `periods_per_year` a period counts as a year.
    InflationHigh,
    /// A tail of the record is so heavy that moments above the second may not exist, and the returns have no bounds: the
    /// tail index is below 2 by 1.645 standard errors.
    TailHeavy,
    /// One return of the record lies more than 4 times as far from the median as any other.
    LoneReturn,
    /// An asset has no returns in the first periods of the record, so they are estimated.
    EstimatedReturns,
    /// At the bandwidth of a conditional centre fewer than 30 returns count, so it is widened.
    FewAlike,
    /// A formula of a declared problem jumps as a state or the noise moves.
    Jumps,
}

impl Warning {
    /// Renames the fields to those of a walk-forward; `returns` is its field of returns.
    pub fn of_walk(self, returns: &'static str) -> Self {
        let names = [
            ("problem.rate_per_step", "rate"),
            ("problem.trading_cost", "trading_cost"),
            ("problem.history", returns),
            ("problem.support", "support"),
            ("problem.centre.bandwidth", "centre.bandwidth"),
        ];
        Warning {
            field: names.iter().find(|(from, _)| *from == self.field).map_or(self.field, |(_, to)| (*to).into()),
            message: names.iter().fold(self.message, |message, (from, to)| message.replace(from, to)),
            code: self.code,
        }
    }
}

impl ProblemSpecification {
    /// Warns of a tail of the history without a moment above the second. That is the paper's postulate (2.1): without
    /// such a moment, the distance of the empirical law need not shrink as 1/sqrt(n), and the radius means nothing.
    /// Bounds on the returns give every moment. A normal law has them too, so only frameworks with a ball are checked.
    ///
    /// Checked by: `heavy_tails_are_warned_of_and_light_ones_rarely`.
    fn tail_heavy(&self) -> Option<Warning> {
        if !self.framework.has_ball() || self.support_rule().given().is_some() {
            return None;
        }
        let is_heavy = |tail: &TailIndex| tail.index + TAIL_ERRORS * tail.standard_error < NEEDED_MOMENT;
        let named = ["lower", "upper"].into_iter().zip(tail_indices(&self.history));
        let heavy = named.filter_map(|(name, tail)| tail.filter(is_heavy).map(|tail| (name, tail)));
        let (name, tail) = heavy.min_by(|(_, one), (_, other)| one.index.total_cmp(&other.index))?;
        let TailIndex { index, standard_error, count } = tail;
        let text = format!(
            "has a heavy {name} tail: its index by {count} returns is {index:.1}, with a standard error of \
             {standard_error:.1}, so moments above the second may not exist and no radius can be trusted. Give bounds \
             on the returns in problem.support"
        );
        Some(warning(WarningCode::TailHeavy, "problem.history", text))
    }

    /// Warns of one return that lies far beyond all others: a month of 5.7 % that was typed as 57 %.
    ///
    /// Checked by: `one_return_far_beyond_all_others_is_warned_of`.
    fn lone_return(&self) -> Option<Warning> {
        if self.history.len() < LEAST_LONE {
            return None;
        }
        let middle = quantile(&self.history, 0.5);
        let mut far: Vec<f64> = self.history.iter().map(|log_return| log_return - middle).collect();
        far.sort_by(|one, other| other.abs().total_cmp(&one.abs()));
        let (lone, next) = (far[0], far[1].abs());
        if lone.abs() < NEAR || lone.abs() <= LONE * next {
            return None;
        }
        let beyond = match lone.abs() / next {
            times if times.is_finite() => format!("{times:.1} times as far from the median as any other"),
            _ => "while all others are equal".to_owned(),
        };
        let one = 100.0 * (middle + lone).exp_m1();
        let text = format!("has one return of {one:.2} %, {beyond}. Make sure that it is not a slip");
        Some(warning(WarningCode::LoneReturn, "problem.history", text))
    }

    /// Warns of a present figure that so few returns resemble that the bandwidth is widened.
    ///
    /// Checked by: `tests/solver/conditional.rs::figures_that_would_be_misread_are_refused_by_name`.
    fn few_alike(&self) -> Option<Warning> {
        let CentreSpecification::Conditional { on, bandwidth } = &self.centre else { return None };
        let figures = on.figures(&self.history);
        let ages = self.learning.weights(self.history.len());
        let count = effective(&kernel_weights(&figures, &ages, *bandwidth, 0.0));
        let now = figures.last().copied().unwrap_or_default();
        let text = format!(
            "is {bandwidth}, at which {count:.1} returns count, because few came after a figure such as the present one, \
             {now}. It was widened until {LEAST_LIKE} count"
        );
        (count < LEAST_LIKE as f64).then(|| warning(WarningCode::FewAlike, "problem.centre.bandwidth", text))
    }

    /// Returns the warnings, in the order of the request. Cost O(n ln n) for n returns.
    ///
    /// Checked by: `what_is_mistaken_is_warned_of_and_what_is_usual_is_not`.
    pub fn warnings(&self) -> Vec<Warning> {
        let (rate, cost, periods) = (self.rate_per_step, self.trading_cost, self.periods_per_year);
        let mean = self.mean_return();
        let a_year = compounded(rate, periods.unwrap_or(1.0));
        let year = periods
            .map_or("if a period is a year, and more if a period is shorter".into(), |p| format!("of {p} periods"));
        let large = periods.map_or(LARGE_DEVIATION, |periods| LARGE_DEVIATION_A_YEAR / periods.sqrt());
        let rate_high = || {
            let a_year = percent(a_year);
            format!(
                "is {rate}, which is {a_year} a year {year}. Give the rate of one period as a fraction, not the rate of a \
                 year"
            )
        };
        let inflation = self.inflation();
        let prices_a_year = compounded(inflation, periods.unwrap_or(1.0));
        let prices_rise = || {
            let a_year = percent(prices_a_year);
            format!(
                "is {inflation}, which is {a_year} a year {year}. Give the rise of prices of one period as a fraction, not \
                 that of a year"
            )
        };
        let rate_above = || {
            format!(
                "is {rate}, above the mean simple return of problem.history, {mean:.6}: over the record the bank paid \
                 more than the asset. Give the rate of one period as a fraction, not the rate of a year"
            )
        };
        let in_percent = |field, deviation: f64| {
            let message = || {
                format!(
                    "has log-returns with a standard deviation of {deviation:.4} a period: are they in percent? Give \
                     fractions, 0.012 for a rise of 1.2 %"
                )
            };
            (deviation > large).then(|| warning(WarningCode::RecordInPercent, field, message()))
        };
        let assumed = match &self.centre {
            CentreSpecification::Mixed { history: Some(history), .. } => Some(annualised::deviation(history)),
            _ => None,
        };
        let cost_high = || {
            let share = percent(cost);
            format!("is {cost}, which is {share} of every trade. Give a fraction, 0.002 for 0.2 %")
        };
        [
            (a_year > HIGH_RATE_A_YEAR).then(|| warning(WarningCode::RateHigh, "problem.rate_per_step", rate_high())),
            (rate > mean).then(|| warning(WarningCode::RateAboveRecord, "problem.rate_per_step", rate_above())),
            (cost > HIGH_TRADING_COST)
                .then(|| warning(WarningCode::TradingCostHigh, "problem.trading_cost", cost_high())),
            (prices_a_year > HIGH_INFLATION_A_YEAR)
                .then(|| warning(WarningCode::InflationHigh, "problem.spending.inflation", prices_rise())),
            in_percent("problem.history", self.deviation()),
            assumed.and_then(|deviation| in_percent("problem.centre.history", deviation)),
            self.tail_heavy(),
            self.lone_return(),
            self.few_alike(),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

impl AssetHistory {
    /// Says which assets' early returns are estimated.
    ///
    /// Checked by: `tests/solver/unequal_records.rs::a_young_asset_is_named_in_a_warning`.
    pub fn warning(&self, names: &[String]) -> Option<Warning> {
        let of = |(name, missing): (&String, &usize)| {
            (*missing > 0).then(|| format!("{} of {} returns of {name}", self.len() - missing, self.len()))
        };
        let young: Vec<String> = names.iter().zip(self.missing()).filter_map(of).collect();
        let text = || {
            format!(
                "holds {}; those before are estimated by regression on the assets with longer records, and their law \
                 counts as less certain",
                young.join(", ")
            )
        };
        (!young.is_empty()).then(|| warning(WarningCode::EstimatedReturns, "problem.history", text()))
    }
}

fn warning(code: WarningCode, field: &'static str, text: String) -> Warning {
    Warning { code, field: field.into(), message: format!("{field} {text}.") }
}

/// Formats a share in percent, to a tenth of a percent.
fn percent(share: f64) -> String {
    let shown = 100.0 * share;
    if shown < 1e6 { format!("{} %", (10.0 * shown).round() / 10.0) } else { "over a million %".into() }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    use super::*;
    use crate::control::request::framework::Framework;
    use crate::control::request::spending::Spending;
    use crate::control::request::support::Support;
    use crate::numerics::machine::streams::stream;

    /// Returns the warnings for a rate, periods per year, a trading cost, and the deviation of returns with mean 1 %.
    fn warned(rate: f64, periods_per_year: Option<f64>, trading_cost: f64, deviation: f64) -> Vec<WarningCode> {
        // Two simple returns with mean 1 %, whose log-returns have the standard deviation `deviation`.
        let history = vec![(1.01 * (1.0 + deviation.tanh())).ln(), (1.01 * (1.0 - deviation.tanh())).ln()];
        let problem =
            ProblemSpecification { periods_per_year, trading_cost, ..ProblemSpecification::of(history, rate) };
        assert!((problem.mean_return() - 0.01).abs() < 1e-12 && (problem.deviation() - deviation).abs() < 1e-12);
        problem.warnings().iter().map(|warning| warning.code).collect()
    }

    #[test]
    fn what_is_mistaken_is_warned_of_and_what_is_usual_is_not() {
        use WarningCode::{RateAboveRecord, RateHigh, RecordInPercent, TradingCostHigh};
        let (months, days) = (Some(12.0), Some(252.0));
        // Monthly shares, daily shares, and shares with a period of unknown length; a daily coin; a currency that pays
        // 14 % a year.
        for (rate, periods, cost, deviation) in [
            (0.0025, months, 0.002, 0.045),
            (0.0001, days, 0.0005, 0.0125),
            (0.0095, None, 0.02, 0.45),
            (0.0001, Some(365.0), 0.0, 0.13),
            (0.0095, Some(14.0), 0.0, 0.045),
        ] {
            assert_eq!(warned(rate, periods, cost, deviation), [], "{rate} {periods:?} {cost} {deviation}");
        }
        // An annual rate given as a monthly one, and with a period of unknown length; daily returns in percent; a cost
        // in percent.
        assert_eq!(warned(0.03, months, 0.0, 0.045), [RateHigh, RateAboveRecord]);
        assert_eq!(warned(0.16, None, 0.0, 0.045), [RateHigh, RateAboveRecord]);
        assert_eq!(warned(0.03, None, 0.0, 0.045), [RateAboveRecord]);
        assert_eq!(warned(0.0001, days, 0.0, 0.4), [RecordInPercent]);
        assert_eq!(warned(0.0001, None, 0.0, 1.1), [RecordInPercent]);
        assert_eq!(warned(0.0025, months, 0.05, 0.045), [TradingCostHigh]);
        assert_eq!(warned(0.2, months, 0.05, 1.5), [RateHigh, RateAboveRecord, TradingCostHigh, RecordInPercent]);
    }

    #[test]
    fn one_return_far_beyond_all_others_is_warned_of() {
        let months = [0.012, -0.031, 0.02, 0.044, -0.012, 0.008, 0.057, -0.027, 0.016, 0.002, -0.044, 0.03];
        let warned = |slip: f64| {
            let history = months.iter().map(|&month| f64::ln_1p(if month == 0.057 { slip } else { month })).collect();
            let warnings = ProblemSpecification::of(history, 0.001).warnings();
            warnings.into_iter().filter(|one| one.code == WarningCode::LoneReturn).map(|one| one.message).next()
        };
        assert_eq!([0.057, 0.15, -0.15, 0.0].map(warned), [None, None, None, None]);
        let message = "problem.history has one return of 57.00 %, 7.7 times as far from the median as any other. Make sure \
                       that it is not a slip.";
        assert_eq!(warned(0.57).as_deref(), Some(message));
        assert!(warned(-0.57).is_some());
        let bank = |last: f64| {
            let history = std::iter::repeat_n(0.002, 20).chain([last]).collect();
            ProblemSpecification::of(history, 0.001).lone_return().map(|one| one.message)
        };
        assert_eq!(bank(0.003), None);
        assert!(bank(0.3).unwrap().contains("while all others are equal"));
    }

    /// 2 % of a year given for a month is 26.8 % a year, and for a quarter 8.2 %.
    #[test]
    fn a_yearly_rise_of_prices_given_by_the_period_is_warned_of() {
        let warned = |inflation: f64, periods_per_year: Option<f64>| {
            let spending = Some(Spending { inflation, ..Spending::default() }.into());
            let history = vec![0.08, -0.01, 0.05];
            let problem =
                ProblemSpecification { periods_per_year, spending, ..ProblemSpecification::of(history, 0.002) };
            problem.warnings().into_iter().map(|one| (one.code, one.field.into_owned())).collect::<Vec<_>>()
        };
        for (inflation, periods) in [(0.0017, Some(12.0)), (0.02, None), (0.02, Some(1.0)), (-0.01, Some(12.0))] {
            assert_eq!(warned(inflation, periods), []);
        }
        for (inflation, periods) in [(0.02, Some(12.0)), (0.02, Some(4.0)), (0.1, None)] {
            assert_eq!(
                warned(inflation, periods),
                [(WarningCode::InflationHigh, "problem.spending.inflation".to_owned())]
            );
        }
    }

    #[test]
    fn heavy_tails_are_warned_of_and_light_ones_rarely() {
        let records = 500;
        let student = |degrees: f64| StudentT::new(degrees).unwrap();
        let share = |size: usize, draw: &dyn Fn(&mut ChaCha8Rng) -> f64| {
            let is_warned = |index: &usize| {
                let mut generator = stream(3, "heavy", size, *index);
                // Small enough to be in no doubt about their unit.
                let history: Vec<f64> = (0..size).map(|_| 1e-6 * draw(&mut generator)).collect();
                let warnings = ProblemSpecification::of(history, -0.01).warnings();
                warnings.iter().any(|warning| warning.code == WarningCode::TailHeavy)
            };
            (0..records).filter(is_warned).count() as f64 / records as f64
        };
        for size in [60, 120, 240, 1000] {
            let normal = share(size, &|generator| generator.sample(StandardNormal));
            let light = share(size, &|generator| student(4.0).sample(generator));
            let heavy = share(size, &|generator| student(1.5).sample(generator));
            assert!(normal < 0.05 && light < 0.05 && heavy > 0.5, "{size}: {normal} {light} {heavy}");
        }
    }

    #[test]
    fn a_heavy_tail_is_no_matter_if_the_returns_have_bounds_or_no_ball_is_drawn() {
        // Quantiles of a law with P(Z > z) = z^-1 below, none above.
        let fallen = |cell: usize| -0.001 * (1.0 - (cell as f64 + 0.5) / 100.0).recip();
        let history: Vec<f64> = (0..100).map(fallen).collect();
        let problem = ProblemSpecification::of(history, -0.01);
        let warned = |problem: &ProblemSpecification| problem.warnings().into_iter().map(|one| one.message).collect();
        let found: Vec<String> = warned(&problem);
        assert!(
            found.len() == 1
                && found[0].starts_with("problem.history has a heavy lower tail: its index by 10 returns is ")
        );
        let between = Some(Support::Between { min: -1.0, max: 1.0 });
        let framework = Framework::PlugIn;
        for other in [
            ProblemSpecification { support: between, ..problem.clone() },
            ProblemSpecification { framework, ..problem },
        ] {
            assert_eq!(warned(&other), [""; 0]);
        }
    }

    #[test]
    fn an_assumed_record_in_percent_is_warned_of_by_its_own_name() {
        let mixed = |history: Vec<f64>| CentreSpecification::Mixed { law: None, history: Some(history), weight: 20.0 };
        let warned = |history: Vec<f64>| {
            let problem = ProblemSpecification {
                centre: mixed(history),
                ..ProblemSpecification::of(vec![0.08, -0.01, 0.05], 0.002)
            };
            problem.warnings().into_iter().map(|warning| (warning.code, warning.field.into_owned())).collect::<Vec<_>>()
        };
        assert_eq!(warned(vec![0.041, -0.014, 0.032]), []);
        assert_eq!(warned(vec![4.1, -1.4, 3.2]), [(WarningCode::RecordInPercent, "problem.centre.history".to_owned())]);
    }

    /// 1.03^12 is 1.4258 by hand.
    #[test]
    fn a_warning_says_what_was_typed_and_what_it_means() {
        let problem = ProblemSpecification {
            periods_per_year: Some(12.0),
            ..ProblemSpecification::of(vec![0.08, -0.01, 0.05], 0.03)
        };
        let [warning] = &problem.warnings()[..] else { panic!("{:?}", problem.warnings()) };
        assert!(warning.message.starts_with("problem.rate_per_step is 0.03, which is 42.6 % a year of 12 periods."));
    }
}
