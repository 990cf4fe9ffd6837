//! Combines the periods of a record into longer ones.

use super::{Frequency, Returns, Row};

/// Fewest longer periods that are informative.
const LEAST: usize = 24;

impl Returns {
    /// Returns the record by months and by quarters, if a period is a day or a week. The first and the last month or
    /// quarter are left out, because they may be incomplete. A result with fewer than 24 periods is also left out.
    pub fn coarser(&self) -> Vec<Returns> {
        if !matches!(self.frequency, Some(Frequency::Daily | Frequency::Weekly)) {
            return Vec::new();
        }
        let longer = [(Frequency::Monthly, 12, 1), (Frequency::Quarterly, 4, 3)];
        let by = |(frequency, periods_per_year, months)| {
            let rows = together(&self.rows, months);
            let returns = Returns { rows, frequency: Some(frequency), periods_per_year, ..self.clone() };
            (returns.rows.len() >= LEAST).then_some(returns)
        };
        longer.into_iter().filter_map(by).collect()
    }
}

/// Returns one row for every whole part of a year of `months` months.
fn together(rows: &[Row], months: usize) -> Vec<Row> {
    let part = |row: &Row| {
        let month = row.date.get(5..7).and_then(|month| month.parse::<usize>().ok());
        (row.date.get(..4).map(str::to_owned), month.map(|month| (month - 1) / months))
    };
    let parts: Vec<&[Row]> = rows.chunk_by(|one, other| part(one) == part(other)).collect();
    let whole = parts.get(1..parts.len().saturating_sub(1)).unwrap_or_default();
    whole.iter().filter_map(|rows| compounded(rows)).collect()
}

fn compounded(rows: &[Row]) -> Option<Row> {
    let grown = |of: fn(&Row) -> f64| rows.iter().map(|row| 1.0 + of(row)).product::<f64>() - 1.0;
    Some(Row {
        date: rows.last()?.date.get(..7)?.to_owned(),
        log_return: rows.iter().map(|row| row.log_return).sum(),
        risky_return: grown(|row| row.risky_return),
        risk_free_return: grown(|row| row.risk_free_return),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weeks_are_put_together_to_whole_months_and_quarters() {
        // Three years of Fridays from the middle of January 2010: alternately 1.2 % and -0.8 %, and 0.05 % from the
        // bank.
        let mut text = "date,market_return,risk_free_return\n".to_owned();
        let mut date = jiff::civil::date(2010, 1, 15);
        for week in 0.. {
            if date.year() > 2012 {
                break;
            }
            text += &format!("{date},{},0.0005\n", [0.012, -0.008][week % 2]);
            date = date.checked_add(jiff::ToSpan::days(7)).unwrap();
        }
        let weeks = Returns::parse(&text, &super::super::Choices::default(), None, None).unwrap();
        let [months] = &weeks.coarser()[..] else { panic!("quarters are fewer than 24") };
        // January 2010 and December 2012 are left out.
        assert_eq!((months.rows.len(), months.noun()), (34, "month"));
        assert_eq!([&months.rows[0].date, &months.rows[33].date], ["2010-02", "2012-11"]);
        // Fridays of February 2010: 5, 12, 19, 26.
        let grown = (1.012 * 0.992_f64).powi(2);
        assert!((months.rows[0].risky_return - (grown - 1.0)).abs() < 1e-12);
        assert!((months.rows[0].log_return - grown.ln()).abs() < 1e-12);
        assert!((months.rows[0].risk_free_return - (1.0005_f64.powi(4) - 1.0)).abs() < 1e-12);
        assert!(months.coarser().is_empty());
    }
}
