//! The bundled monthly returns of the US stock market and of Treasury bills.

use thiserror::Error;

const CSV: &str = include_str!("../../data/us_market_monthly.csv");
const HEADER: &str = "month,market_return,risk_free_return";

/// One month: simple returns, as fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Month {
    /// As in `2008-01`.
    pub month: String,
    pub market_return: f64,
    pub risk_free_return: f64,
}

/// Months in calendar order, without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct UsMarket {
    months: Vec<Month>,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum MarketError {
    #[error("the first line is {found:?}: must be {HEADER:?}")]
    Header { found: String },
    #[error("line {line}: {found:?} has {count} fields: must have 3")]
    FieldCount { line: usize, found: String, count: usize },
    #[error("line {line}: month is {found:?}: must read as in 2008-01")]
    Month { line: usize, found: String },
    #[error("line {line}: month is {found}: must follow {previous} without a gap")]
    Gap { line: usize, found: String, previous: String },
    #[error("line {line}: {column} is {found:?}: must be a number above -1")]
    Return { line: usize, column: &'static str, found: String },
    #[error("{wanted} months before {month} are wanted: the file holds {found}")]
    TooShort { month: String, wanted: usize, found: usize },
}

impl UsMarket {
    /// The file embedded in the binary.
    pub fn bundled() -> Result<Self, MarketError> {
        Self::parse(CSV)
    }

    fn parse(csv: &str) -> Result<Self, MarketError> {
        let mut lines = csv.lines().zip(1..);
        let header = lines.next().map_or("", |(text, _)| text);
        if header.trim_end() != HEADER {
            return Err(MarketError::Header { found: header.into() });
        }
        let mut months: Vec<Month> = Vec::new();
        let mut previous: Option<(u32, String)> = None;
        for (text, line) in lines {
            let (number, month) = row(line, text)?;
            if let Some((_, previous)) = previous.filter(|(before, _)| before + 1 != number) {
                return Err(MarketError::Gap { line, found: month.month, previous });
            }
            previous = Some((number, month.month.clone()));
            months.push(month);
        }
        Ok(UsMarket { months })
    }

    /// The `count` months before `month`, oldest first.
    pub fn before(&self, month: &str, count: usize) -> Result<&[Month], MarketError> {
        let end = self.months.partition_point(|row| row.month.as_str() < month);
        let too_short = || MarketError::TooShort { month: month.into(), wanted: count, found: end };
        let start = end.checked_sub(count).ok_or_else(too_short)?;
        Ok(&self.months[start..end])
    }

    /// The months of a calendar year.
    pub fn year(&self, year: &str) -> &[Month] {
        let start = self.months.partition_point(|row| row.month.as_str() < year);
        let length = self.months[start..].iter().take_while(|row| row.month.starts_with(year)).count();
        &self.months[start..start + length]
    }
}

/// One line, and its month counted from year 0.
fn row(line: usize, text: &str) -> Result<(u32, Month), MarketError> {
    let fields: Vec<&str> = text.trim_end().split(',').collect();
    let [month, market, risk_free] = fields[..] else {
        return Err(MarketError::FieldCount { line, found: text.into(), count: fields.len() });
    };
    let number = month_number(month).ok_or_else(|| MarketError::Month { line, found: month.into() })?;
    let market_return = simple_return(line, "market_return", market)?;
    let risk_free_return = simple_return(line, "risk_free_return", risk_free)?;
    Ok((number, Month { month: month.into(), market_return, risk_free_return }))
}

fn month_number(text: &str) -> Option<u32> {
    let (year, month) = text.split_once('-')?;
    if year.len() != 4 || month.len() != 2 || !text.bytes().all(|byte| byte == b'-' || byte.is_ascii_digit()) {
        return None;
    }
    let (year, month): (u32, u32) = (year.parse().ok()?, month.parse().ok()?);
    (1..=12).contains(&month).then_some(12 * year + month - 1)
}

fn simple_return(line: usize, column: &'static str, text: &str) -> Result<f64, MarketError> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > -1.0);
    number.ok_or_else(|| MarketError::Return { line, column, found: text.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_file_is_whole() {
        let market = UsMarket::bundled().unwrap();
        assert_eq!(market.months.len(), 1109);
        assert_eq!(market.year("2008").len(), 12);
        let history = market.before("2008-01", 240).unwrap();
        assert_eq!((history[0].month.as_str(), history[239].month.as_str()), ("1988-01", "2007-12"));
        assert_eq!(history[239].risk_free_return, 0.0027);
        assert_eq!(market.year("2008")[9].market_return, -0.1715);
    }

    #[test]
    fn a_bad_row_is_named_by_line_and_reason() {
        let message = |rows: &str| UsMarket::parse(&format!("{HEADER}\n{rows}")).unwrap_err().to_string();
        assert_eq!(UsMarket::parse("").unwrap_err(), MarketError::Header { found: String::new() });
        assert_eq!(message("2008-01,0.1"), "line 2: \"2008-01,0.1\" has 2 fields: must have 3");
        assert_eq!(message("2008-13,0.1,0"), "line 2: month is \"2008-13\": must read as in 2008-01");
        assert_eq!(message("2008-01,nan,0"), "line 2: market_return is \"nan\": must be a number above -1");
        assert_eq!(message("2008-01,-1,0"), "line 2: market_return is \"-1\": must be a number above -1");
        assert_eq!(message("2008-01,0,x"), "line 2: risk_free_return is \"x\": must be a number above -1");
        assert_eq!(message("2008-01,0,0\n2008-03,0,0"), "line 3: month is 2008-03: must follow 2008-01 without a gap");
    }

    #[test]
    fn too_short_a_past_is_refused() {
        let market = UsMarket::bundled().unwrap();
        let message = market.before("1927-01", 240).unwrap_err().to_string();
        assert_eq!(message, "240 months before 1927-01 are wanted: the file holds 6");
    }
}
