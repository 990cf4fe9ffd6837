//! Shares of wealth that a user states in a formula over the returns before a period.
//!
//! Names are `last`, the return of the period before; `mean` and `deviation` of all periods before, and of the last N with
//! the number behind the word, as in `mean12`; `bank`, the rate that the bank paid last; `n`, the number of returns before.
//! Returns are simple, and deviations have n - 1 degrees of freedom. The grammar is that of declared problems.
//!
//! Checked by: the tests below, and `tests/service/own_formulas.rs`.

use super::declared::formula::Formula;
use crate::control::error::FieldError;

/// Largest number behind a word.
const MOST_BACK: usize = 20_000;

/// A formula for the share of an asset.
#[derive(Debug, Clone)]
pub struct OwnFormula {
    field: String,
    text: String,
    formula: Formula,
    names: Vec<Named>,
}

/// A name of the formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Named {
    Last,
    Bank,
    Count,
    /// The mean of so many last returns, or of all.
    Mean(Option<usize>),
    Deviation(Option<usize>),
}

/// The returns of an asset, summed up so that a mean or a deviation costs one subtraction.
#[derive(Debug, Clone)]
pub struct ReturnSums {
    simple: Vec<f64>,
    /// Sums of the returns less the first, and of their squares, up to each.
    sums: Vec<[f64; 2]>,
}

impl ReturnSums {
    /// Sums up log-returns, oldest first. Cost O(n).
    pub fn of(log_returns: impl Iterator<Item = f64>) -> Self {
        let mut all = ReturnSums { simple: Vec::new(), sums: vec![[0.0; 2]] };
        log_returns.for_each(|log_return| all.push(log_return));
        all
    }

    /// Adds a return.
    pub fn push(&mut self, log_return: f64) {
        let simple = log_return.exp_m1();
        self.simple.push(simple);
        let from = simple - self.simple[0];
        let [sum, squares] = self.sums[self.sums.len() - 1];
        self.sums.push([sum + from, squares + from * from]);
    }

    /// Returns mean and deviation of the last `back` of the first `known` returns; NaN if there are fewer.
    fn moments(&self, known: usize, back: Option<usize>) -> [f64; 2] {
        let count = back.unwrap_or(known);
        if count > known || count == 0 {
            return [f64::NAN; 2];
        }
        let [sum, squares] = [0, 1].map(|part| self.sums[known][part] - self.sums[known - count][part]);
        let n = count as f64;
        let spread = (squares - sum * sum / n).max(0.0);
        [self.simple[0] + sum / n, if count > 1 { (spread / (n - 1.0)).sqrt() } else { f64::NAN }]
    }
}

impl OwnFormula {
    /// Parses the formula of the field `field`.
    ///
    /// # Errors
    /// A formula that cannot be read, with its column.
    pub fn parse(field: &str, text: &str) -> Result<Self, FieldError> {
        let mut words: Vec<&str> = ["last", "bank", "n", "mean", "deviation"].into();
        let found = text.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
        words.extend(found.filter(|word| numbered(word).is_some()));
        let formula = Formula::parse(text, &words).map_err(|error| {
            let names = "last, bank, n, mean, deviation, and the last two with a number of periods, as in mean12";
            FieldError::new(field, text, format!("must be a formula over {names}; {error}"))
        })?;
        let named = |word: &&str| match *word {
            "last" => Named::Last,
            "bank" => Named::Bank,
            "n" => Named::Count,
            "mean" => Named::Mean(None),
            "deviation" => Named::Deviation(None),
            word => numbered(word).unwrap_or(Named::Count),
        };
        let names = words.iter().map(named).collect();
        Ok(OwnFormula { field: field.to_owned(), text: text.to_owned(), formula, names })
    }

    /// Returns the share after the first `known` returns, moved into 0 to `highest`.
    ///
    /// # Errors
    /// The formula has no value there, or an infinite one.
    pub fn share(&self, returns: &ReturnSums, known: usize, bank: f64, highest: f64) -> Result<f64, FieldError> {
        Ok(self.wanted(returns, known, bank)?.clamp(0.0, highest))
    }

    /// Checks that `wanted`, values of the formula over a record, are shares of wealth and not percent.
    ///
    /// # Errors
    /// There is one above 0, and each that is above 0 is above 1.
    pub fn check_fractions(&self, wanted: impl IntoIterator<Item = f64>) -> Result<(), FieldError> {
        let lowest = wanted.into_iter().filter(|share| *share > 0.0).min_by(f64::total_cmp);
        match lowest {
            Some(lowest) if lowest > 1.0 => {
                let rule = format!(
                    "must be a share of wealth, as 0.6 for 60 %: whenever it is above 0 on the record, it is at least \
                     {lowest:.4}, and nobody can hold more than 1; write min(1, …) if all of wealth is meant"
                );
                Err(FieldError::new(&self.field, &self.text, rule))
            }
            _ => Ok(()),
        }
    }

    /// Returns the value after the first `known` returns, finite.
    ///
    /// # Errors
    /// The formula has no value there, or an infinite one.
    pub fn wanted(&self, returns: &ReturnSums, known: usize, bank: f64) -> Result<f64, FieldError> {
        let value = |named: &Named| match *named {
            Named::Last => known.checked_sub(1).map_or(f64::NAN, |last| returns.simple[last]),
            Named::Bank => bank,
            Named::Count => known as f64,
            Named::Mean(back) => returns.moments(known, back)[0],
            Named::Deviation(back) => returns.moments(known, back)[1],
        };
        let values: Vec<f64> = self.names.iter().map(value).collect();
        let wanted = self.formula.value(&values, &mut Vec::new());
        if wanted.is_finite() {
            return Ok(wanted);
        }
        let found = if wanted.is_nan() { "has no value".to_owned() } else { format!("is {wanted}") };
        let rule = format!("must be a finite share in every period that is decided: it {found} after {known} returns");
        Err(FieldError::new(&self.field, &self.text, rule))
    }
}

/// Returns the name that a word with a number behind it stands for.
fn numbered(word: &str) -> Option<Named> {
    let number = |digits: &str| digits.parse().ok().filter(|back| (1..=MOST_BACK).contains(back));
    if let Some(back) = word.strip_prefix("mean").and_then(number) {
        return Some(Named::Mean(Some(back)));
    }
    word.strip_prefix("deviation").and_then(number).map(|back| Named::Deviation(Some(back)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums agree with the plain formulas over the same returns, also far from 0.
    #[test]
    fn every_name_is_what_a_plain_sum_says() {
        let log_returns: Vec<f64> = (0..60).map(|i: i32| 0.3 + 0.04 * f64::from((37 * i + 11) % 41) / 41.0).collect();
        let sums = ReturnSums::of(log_returns.iter().copied());
        let simple: Vec<f64> = log_returns.iter().map(|z| z.exp() - 1.0).collect();
        let of = |text: &str, known: usize| {
            OwnFormula::parse("weights.Mine", text).unwrap().share(&sums, known, 0.002, 1e9).unwrap()
        };
        for known in [12, 30, 60] {
            for back in [known, 12, 2] {
                let seen = &simple[known - back..known];
                let mean = seen.iter().sum::<f64>() / back as f64;
                let deviation = (seen.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / (back as f64 - 1.0)).sqrt();
                let (words, numbers) = if back == known {
                    (["mean".to_owned(), "deviation".to_owned()], [mean, deviation])
                } else {
                    ([format!("mean{back}"), format!("deviation{back}")], [mean, deviation])
                };
                for (word, number) in words.iter().zip(numbers) {
                    assert!((of(word, known) - number).abs() < 1e-13, "{word} after {known}");
                }
            }
            assert_eq!((of("n", known), of("bank", known)), (known as f64, 0.002));
            assert!((of("last", known) - simple[known - 1]).abs() < 1e-15);
        }
        assert_eq!(
            of("if(mean3 > mean12, 0.25, 0.75)", 20),
            if simple[17..20].iter().sum::<f64>() / 3.0 > simple[8..20].iter().sum::<f64>() / 12.0 {
                0.25
            } else {
                0.75
            }
        );
    }

    #[test]
    fn a_share_stays_between_its_bounds_and_a_fault_is_named() {
        let sums = ReturnSums::of([0.1, 0.1, 0.1].into_iter());
        let share = |text: &str, known: usize| OwnFormula::parse("weights.Mine", text)?.share(&sums, known, 0.0, 0.8);
        assert_eq!((share("5", 3), share("-1", 3), share("0.5", 0)), (Ok(0.8), Ok(0.0), Ok(0.5)));
        let fractions =
            |wanted: &[f64]| OwnFormula::parse("weights.Mine", "60").unwrap().check_fractions(wanted.iter().copied());
        assert!(fractions(&[60.0, 0.0, -1.0]).unwrap_err().rule.contains("at least 60.0000"));
        for wanted in [&[0.0, -1.0][..], &[1.0, 60.0], &[0.2, 5.0], &[]] {
            fractions(wanted).unwrap();
        }
        for (text, known, named) in [
            ("mean4", 3, "it has no value after 3 returns"),
            ("deviation1", 3, "it has no value"),
            ("1/(last - last)", 2, "it is inf"),
            ("mean0", 3, "column 1"),
            ("wealth", 3, "column 1"),
            ("mean12 +", 3, "column 9"),
        ] {
            let error = share(text, known).unwrap_err();
            assert!(
                error.rule.contains(named) && error.field == "weights.Mine" && error.value.contains(text),
                "{error:?}"
            );
        }
    }
}
