//! Strategies of the user's own: shares of wealth by date from files, or a formula.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::str::FromStr;

use ballast::control::request::own_weights::OwnShares;

use super::{BacktestError, refused};

/// The option that names a strategy and its file.
pub const OPTION: &str = "--weights";

/// A strategy, and the file of its shares.
#[derive(Debug, Clone)]
pub struct OwnStrategy {
    pub name: String,
    file: PathBuf,
}

impl FromStr for OwnStrategy {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((name, file)) if !name.trim().is_empty() && !file.is_empty() => {
                Ok(OwnStrategy { name: name.trim().to_owned(), file: file.into() })
            }
            _ => Err("must be NAME=FILE"),
        }
    }
}

/// Returns the strategies of files and of formulas by name, given how the shares of a file are read.
///
/// # Errors
/// A file that cannot be read; a name that stands twice.
pub fn own_strategies<S>(
    files: &[OwnStrategy],
    formulas: &[OwnRule],
    shares: impl Fn(&OwnStrategy) -> Result<OwnShares<S>, BacktestError>,
) -> Result<BTreeMap<String, OwnShares<S>>, BacktestError> {
    let mut all = BTreeMap::new();
    let of_files = files.iter().map(|own| (OPTION, &own.name, shares(own)));
    let of_formulas = formulas.iter().map(|own| ("--formula", &own.name, Ok(OwnShares::Formula(own.formula.clone()))));
    for (option, name, own) in of_files.chain(of_formulas) {
        if all.insert(name.clone(), own?).is_some() {
            return Err(refused(option, name, "must not name a strategy twice"));
        }
    }
    Ok(all)
}

/// A strategy, and the formula of its shares.
#[derive(Debug, Clone)]
pub struct OwnRule {
    pub name: String,
    pub formula: String,
}

impl FromStr for OwnRule {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((name, formula)) if !name.trim().is_empty() && !formula.trim().is_empty() => {
                Ok(OwnRule { name: name.trim().to_owned(), formula: formula.trim().to_owned() })
            }
            _ => Err("must be NAME=FORMULA"),
        }
    }
}

impl OwnStrategy {
    /// Returns the shares for every one of `dates`, of which the first `unused` need none: those are 0. The file has a
    /// header, a column of dates and a column for each of `columns`, or any one column if there are no names.
    ///
    /// # Errors
    /// The file cannot be read, or a column or a date has no share.
    pub fn rows(&self, columns: &[String], dates: &[String], unused: usize) -> Result<Vec<Vec<f64>>, BacktestError> {
        let fault = |value: String, rule: &str| refused(OPTION, format!("{}: {value}", self.name), rule);
        let mut file = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_path(&self.file)
            .map_err(|error| fault(error.to_string(), "must be a file of comma-separated values"))?;
        let headers =
            file.headers().map_err(|error| fault(error.to_string(), "must begin with a line of names"))?.clone();
        let place = |name: &String| {
            let found = headers.iter().skip(1).position(|header| header == name).map(|place| place + 1);
            found.ok_or_else(|| fault("its header".to_owned(), &format!("must have a column {name:?} after its dates")))
        };
        let places: Vec<usize> = match columns {
            [] if headers.len() == 2 => vec![1],
            [] => return Err(fault(format!("{} columns", headers.len()), "must have one of dates and one of shares")),
            names => names.iter().map(place).collect::<Result<_, _>>()?,
        };
        let mut known: Vec<(String, Vec<f64>)> = Vec::new();
        for row in file.records() {
            let row = row.map_err(|error| fault(error.to_string(), "must have as many cells in every line"))?;
            let share = |place: &usize| {
                let rule = "must be a share of wealth from 0 to 1";
                row[*place]
                    .parse::<f64>()
                    .map_err(|_| fault(format!("{} in the line of {}", &row[*place], &row[0]), rule))
            };
            known.push((row[0].to_owned(), places.iter().map(share).collect::<Result<Vec<f64>, _>>()?));
        }
        known.sort_by(|one, other| one.0.cmp(&other.0));
        let rows = dates.iter().enumerate().map(|(period, date)| {
            let from = known.partition_point(|(own, _)| own < date);
            let alike = known[from..].iter().take_while(|(own, _)| own.starts_with(date.as_str()));
            let mut found = alike.filter(|(own, _)| is_date(own, date));
            match (found.next(), found.next()) {
                _ if period < unused => Ok(vec![0.0; places.len()]),
                (Some((_, shares)), None) => Ok(shares.clone()),
                (None, _) => Err(fault(date.clone(), "must have a line in the file, as every period that is decided")),
                _ => Err(fault(date.clone(), "must not have two lines in the file")),
            }
        });
        rows.collect()
    }
}

/// Returns true if a date of the file is that of a period. A month may be written with its last day.
fn is_date(own: &str, date: &str) -> bool {
    own.strip_prefix(date).is_some_and(|day| day.is_empty() || day.starts_with('-'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str, columns: &[&str], dates: &[&str], unused: usize) -> Result<Vec<Vec<f64>>, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.csv");
        std::fs::write(&file, text).unwrap();
        let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<String>>();
        let own: OwnStrategy = format!("Trend={}", file.display()).parse().unwrap();
        own.rows(&owned(columns), &owned(dates), unused).map_err(|error| error.to_string())
    }

    #[test]
    fn shares_are_found_by_their_dates() {
        let months = ["2008-01", "2008-02", "2008-03"];
        let one = "date,share\n2008-03-31,0.25\n2008-02-29,0.5\n";
        assert_eq!(rows(one, &[], &months, 1).unwrap(), [[0.0], [0.5], [0.25]]);
        // Periods without dates have numbers.
        let numbered: String = (1..=12).map(|period| format!("{period},0.{period:02}\n")).collect();
        let numbers: Vec<String> = (1..=12).map(|period| period.to_string()).collect();
        let names: Vec<&str> = numbers.iter().map(String::as_str).collect();
        let found = rows(&format!("period,share\n{numbered}"), &[], &names, 0).unwrap();
        assert_eq!((found[0][0], found[9][0], found[11][0]), (0.01, 0.1, 0.12));
        let two = "date,bonds,stocks\n2008-01,0.1,0.2\n2008-02,0.3,0.4\n2008-03,0.5,0.5\n";
        assert_eq!(rows(two, &["stocks", "bonds"], &months, 0).unwrap(), [[0.2, 0.1], [0.4, 0.3], [0.5, 0.5]]);
        for (text, columns, named) in [
            (one, vec![], "Trend: 2008-01: must have a line"),
            (two, vec![], "3 columns: must have one of dates and one of shares"),
            (two, vec!["gold"], "must have a column \"gold\""),
            ("date,share\n2008-01,half\n", vec![], "half in the line of 2008-01: must be a share"),
            ("date,share\n2008-01,1\n2008-01-31,0\n", vec![], "2008-01: must not have two lines"),
        ] {
            let error = rows(text, &columns, &months, 0).unwrap_err();
            assert!(error.contains(named), "{error}");
        }
    }
}
