//! Dates of a record's rows: in one form for the whole column, never guessed row by row, and never read as numbers.

use jiff::civil::{Date, ISOWeekDate, Weekday};

use super::choices::Choices;
use super::month_names;
use super::numbered_dates::{epoch, go_one_way, serial};
use super::outcome::Stop;
use crate::control::request::frequency::Frequency;

const MONTHS: [&str; 12] = [
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
];
/// Headings of columns that hold dates even if their cells are not understood.
const HEADINGS: [&str; 21] = [
    "date",
    "dates",
    "datetime",
    "observationdate",
    "tradedate",
    "timestamp",
    "time",
    "opentime",
    "unix",
    "unixtime",
    "epoch",
    "day",
    "week",
    "month",
    "quarter",
    "year",
    "periodending",
    "datum",
    "fecha",
    "monat",
    "jahr",
];
/// The years of records of returns; outside this range a number only looks like a date.
const YEARS: std::ops::RangeInclusive<i16> = 1700..=2200;
/// Letters of the shortest dates that are not numbers, such as 1-2020 and Jan-99.
const SHORTEST: usize = 6;
/// Start of the range of two-digit years: from 1969 to 2068, as in POSIX.
const PIVOT: i16 = 69;
/// The number of rows of which at least one must fit a form, or the form is not tried on the rest.
const FIRST: usize = 50;
/// A column holds dates if this share of its cells are dates: with marks between their parts, or in digits that may be
/// numbers.
const MARKED: f64 = 0.5;
pub const IN_DIGITS: f64 = 0.9;

/// The form in which dates are written, one letter for each part:
///
/// - `y` is a year of four digits, and `u` one of two
/// - `m` and `d` are a month and a day of one or two digits, `A` and `B` of two
/// - `n` is a month's name, `q` a quarter and `w` a week
/// - `o` is a month after a decimal point, of which 1 is October
/// - `t` is a time of day or nothing
/// - `_` is any marks and blanks or none, `/` a mark between numbers, `-` one that is not a decimal point
/// - `#` is the day number of a spreadsheet, `@` seconds since 1970
/// - other letters stand for themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form(&'static str);

pub const FORMS: [Form; 22] = [
    Form("y/m/dt"),
    Form("y-mt"),
    Form("yMm"),
    DAY_FIRST,
    MONTH_FIRST,
    SHORT_DAY_FIRST,
    SHORT_MONTH_FIRST,
    Form("m/y"),
    Form("d_n_y"),
    Form("n_d_y"),
    Form("n_y"),
    Form("y_n"),
    Form("y_Qq"),
    Form("Qq_y"),
    Form("y_Ww"),
    Form("d_n_u"),
    Form("n_u"),
    Form("yAB"),
    Form("yA"),
    DECIMAL_MONTH,
    EPOCH,
    YEAR,
];
const DAY_FIRST: Form = Form("d/m/yt");
const MONTH_FIRST: Form = Form("m-d-yt");
const SHORT_DAY_FIRST: Form = Form("d/m/ut");
const SHORT_MONTH_FIRST: Form = Form("m-d-ut");
/// Years with a month after the point: 1871.01 to 1871.09, 1871.1, 1871.11 and 1871.12.
const DECIMAL_MONTH: Form = Form("y.o");
const EPOCH: Form = Form("@");
/// Day numbers of a spreadsheet. Five digits may be a price, so they are dates only under a heading of dates.
const SERIAL: Form = Form("#");
pub const YEAR: Form = Form("y");

impl Form {
    /// Returns true if its dates could also be plain numbers.
    pub fn is_digits(self) -> bool {
        matches!(self.0, "yAB" | "yA" | "y.o" | "@" | "#" | "y")
    }

    /// Returns true if numbers that could be dates in this form progress as dates do.
    fn goes_on(self, texts: &[&str]) -> bool {
        let dates = || texts.iter().filter_map(|text| self.date(text)).collect::<Vec<Date>>();
        let months = |date: &Date| 12 * i32::from(date.year()) + i32::from(date.month());
        match self {
            EPOCH | SERIAL => go_one_way(&dates()),
            DECIMAL_MONTH => dates().windows(2).all(|pair| (months(&pair[1]) - months(&pair[0])).abs() == 1),
            _ => true,
        }
    }

    /// Returns the day that `text` is in this form: the first of a month or a year, or of the last month of a quarter.
    pub fn date(self, text: &str) -> Option<Date> {
        let (mut year, mut month, mut day, mut week, mut rest) = (0, 1, 1, None, without_weekday(text.trim()));
        match self {
            SERIAL => return serial(rest),
            EPOCH => return epoch(rest),
            _ => {}
        }
        for letter in self.0.chars() {
            match letter {
                'y' => year = digits(&mut rest, 4, 4)?,
                'u' => year = digits(&mut rest, 2, 2).map(|year| year + if year < PIVOT { 2000 } else { 1900 })?,
                'm' => month = digits(&mut rest, 1, 2)?,
                'A' => month = digits(&mut rest, 2, 2)?,
                'd' => day = digits(&mut rest, 1, 2)?,
                'B' => day = digits(&mut rest, 2, 2)?,
                'q' => month = digits(&mut rest, 1, 1).filter(|quarter| (1..=4).contains(quarter))? * 3,
                'n' => month = name(&mut rest)?,
                'w' => week = Some(digits(&mut rest, 2, 2)?),
                'o' => month = decimal_month(&mut rest)?,
                't' => rest = rest.strip_suffix('Z').unwrap_or(rest),
                '_' => rest = rest.trim_start_matches([' ', '.', ',', '-']),
                '/' => rest = rest.strip_prefix(['/', '-', '.'])?,
                '-' => rest = rest.strip_prefix(['/', '-'])?,
                other => rest = rest.strip_prefix([other, other.to_ascii_lowercase()])?,
            }
        }
        let is_time = |rest: &str| self.0.ends_with('t') && rest.starts_with(['T', ' ']) && rest.contains(':');
        let date = match week {
            Some(week) => ISOWeekDate::new(year, i8::try_from(week).ok()?, Weekday::Friday).ok()?.date(),
            None => Date::new(year, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok()?,
        };
        ((rest.is_empty() || is_time(rest)) && YEARS.contains(&year)).then_some(date)
    }
}

fn digits(rest: &mut &str, least: usize, most: usize) -> Option<i16> {
    let count = rest.bytes().take(most).take_while(u8::is_ascii_digit).count();
    let (number, after) = rest.split_at(count);
    *rest = after;
    if count < least { None } else { number.parse().ok() }
}

/// Reads a month by at least three letters of its name; a Spanish `de` may come before and after it.
fn name(rest: &mut &str) -> Option<i16> {
    let start = rest.strip_prefix("de ").unwrap_or(rest);
    let (word, after) = start.split_at(start.find(|letter: char| !letter.is_alphabetic()).unwrap_or(start.len()));
    let after = after.strip_prefix('.').unwrap_or(after);
    *rest = after.strip_prefix(" de ").unwrap_or(after);
    month_names::month(word)
}

/// Reads a month of two digits, or the single digit that is left of 10.
fn decimal_month(rest: &mut &str) -> Option<i16> {
    if *rest == "1" {
        *rest = "";
        return Some(10);
    }
    digits(rest, 2, 2)
}

/// Removes the name of a weekday before the date.
fn without_weekday(text: &str) -> &str {
    const DAYS: [&str; 7] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];
    let is_day = |start: &str| DAYS.iter().any(|day| start.eq_ignore_ascii_case(day));
    if !text.get(..3).is_some_and(is_day) {
        return text;
    }
    text.trim_start_matches(char::is_alphabetic).trim_start_matches([',', '.', ' '])
}

/// Returns true if a heading says that its column holds dates.
pub fn heads_dates(name: &str) -> bool {
    let plain: String = name.to_lowercase().chars().filter(|letter| letter.is_alphanumeric()).collect();
    HEADINGS.contains(&plain.as_str())
}

/// Returns the month, from 1, if `text` is the name of one.
pub fn month(text: &str) -> Option<usize> {
    let mut rest = text.trim();
    let found = name(&mut rest)?;
    usize::try_from(found).ok().filter(|_| rest.is_empty())
}

/// Returns true if `text` can be a year.
pub fn is_year(text: &str) -> bool {
    YEAR.date(text).is_some()
}

/// Returns true if `text` is a date that nobody would take for a number.
pub fn could_be_date(text: &str) -> bool {
    text.len() >= SHORTEST && FORMS.iter().any(|form| !form.is_digits() && form.date(text).is_some())
}

/// Returns the forms that fit the most texts, among all forms that fit enough of them.
fn best(texts: &[&str]) -> Vec<Form> {
    let share = |form: &Form| {
        let of = |texts: &[&str]| texts.iter().filter(|text| form.date(text).is_some()).count();
        let first = of(&texts[..texts.len().min(FIRST)]);
        if first == 0 { 0.0 } else { of(texts) as f64 / texts.len() as f64 }
    };
    let shares = FORMS.iter().map(|form| (*form, share(form)));
    let fits = |(form, share): &(Form, f64)| *share >= if form.is_digits() { IN_DIGITS } else { MARKED };
    let fitting: Vec<(Form, f64)> =
        shares.filter(fits).filter(|(form, _)| *form != YEAR && form.goes_on(texts)).collect();
    let most = fitting.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    fitting.into_iter().filter(|(_, share)| *share == most).map(|(form, _)| form).collect()
}

/// Returns true if a column holds dates. If it `stands_alone`, years do not count, because they may be prices.
pub fn are_dates(texts: &[&str], stands_alone: bool) -> bool {
    !best(texts).is_empty() || (!stands_alone && are_years(texts))
}

/// Returns true if a column that is headed as dates holds dates that are understood.
pub fn are_understood(texts: &[&str]) -> bool {
    are_dates(texts, false) || are_serials(texts)
}

/// Returns true if all texts are whole numbers that a spreadsheet shows as days, in order.
fn are_serials(texts: &[&str]) -> bool {
    !texts.is_empty() && texts.iter().all(|text| SERIAL.date(text).is_some()) && SERIAL.goes_on(texts)
}

/// Returns a sentence that says how numbers are read as dates.
pub fn numbered(form: Form, texts: &[&str]) -> Option<String> {
    let what = match form {
        SERIAL => "the day numbers of a spreadsheet",
        EPOCH => "counted from 1970",
        DECIMAL_MONTH => "years with a month after the point",
        _ => return None,
    };
    let first = texts.first()?;
    Some(format!("The dates are {what}: {first} is {}.", in_words(form.date(first)?, None)))
}

/// Returns true for whole numbers of four digits that all go up, or all go down, by one.
fn are_years(texts: &[&str]) -> bool {
    let years: Option<Vec<i16>> = texts.iter().map(|text| YEAR.date(text).map(Date::year)).collect();
    let Some(years) = years else { return false };
    let mut steps = years.windows(2).map(|pair| pair[1] - pair[0]);
    steps.next().is_some_and(|first| first.abs() == 1 && steps.all(|step| step == first))
}

/// Returns the form of a column of dates. If day and month could be swapped, the caller is asked.
pub fn form(texts: &[&str], choices: &Choices) -> Result<Form, Stop> {
    let found = best(texts);
    let first = found.first().copied().unwrap_or(if are_serials(texts) { SERIAL } else { YEAR });
    let month_first = match first {
        DAY_FIRST => MONTH_FIRST,
        SHORT_DAY_FIRST => SHORT_MONTH_FIRST,
        _ => return Ok(first),
    };
    if !found.contains(&month_first) {
        return Ok(first);
    }
    if let Some(day_first) = choices.day_first {
        return Ok(if day_first { first } else { month_first });
    }
    let differs = |text: &&&str| first.date(text) != month_first.date(text);
    let Some(doubtful) = texts.iter().find(differs) else { return Ok(first) };
    let option = |form: Form, day_first| {
        let words = form.date(doubtful).map_or(String::new(), |date| in_words(date, None));
        (words, Choices { day_first: Some(day_first), ..Choices::default() })
    };
    let options = vec![option(first, true), option(month_first, false)];
    Err(Stop::question("day_first", format!("Which day is {doubtful}?"), options))
}

/// Returns a date in words, to the precision of the frequency.
pub fn in_words(date: Date, frequency: Option<Frequency>) -> String {
    let (year, month) = (date.year(), MONTHS[usize::from(date.month().unsigned_abs()) - 1]);
    match frequency {
        Some(Frequency::Yearly) => year.to_string(),
        Some(Frequency::Quarterly) => format!("Q{} {year}", (date.month() + 2) / 3),
        Some(Frequency::Monthly) => format!("{month} {year}"),
        Some(Frequency::Daily | Frequency::Weekly) | None => format!("{} {month} {year}", date.day()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_date_is_read_in_every_form_that_programs_write() {
        let date = |month, day| Some(Date::constant(2020, month, day));
        for (text, expected) in [
            ("2020-01-31", date(1, 31)),
            ("2020/1/31", date(1, 31)),
            ("2020-01-31T00:00:00Z", date(1, 31)),
            ("2020-01-31 00:00:00-05:00", date(1, 31)),
            ("2020-01", date(1, 1)),
            ("2020M01", date(1, 1)),
            ("31.01.2020", date(1, 31)),
            ("1/31/2020", date(1, 31)),
            ("1/2020", date(1, 1)),
            ("31 January 2020", date(1, 31)),
            ("31-Jan-2020", date(1, 31)),
            ("Jan 31, 2020", date(1, 31)),
            ("Sept. 2020", date(9, 1)),
            ("2020 Jan", date(1, 1)),
            ("2020 Q1", date(3, 1)),
            ("Q4-2020", date(12, 1)),
            ("31-Jan-20", date(1, 31)),
            ("jan-20", date(1, 1)),
            ("01/31/20", date(1, 31)),
            ("31.1.20", date(1, 31)),
            ("Friday, January 31, 2020", date(1, 31)),
            ("31. J\u{e4}nner 2020", date(1, 31)),
            ("31 janv. 2020", date(1, 31)),
            ("31 de enero de 2020", date(1, 31)),
            ("M\u{e4}r 2020", date(3, 1)),
            ("2020-W05", date(1, 31)),
            ("20200131", None),
            ("2020.01", None),
            ("2020-13", None),
            ("30.02.2020", None),
            ("2020-01-31 and so on", None),
            ("Total 2020", None),
            ("Jan", None),
            ("2020\u{e9}1", None),
        ] {
            let found = FORMS.iter().filter(|form| !form.is_digits()).find_map(|form| form.date(text));
            assert_eq!(found, expected, "{text}");
        }
        assert_eq!((Form("yAB").date("20200131"), Form("yA").date("202002")), (date(1, 31), date(2, 1)));
        assert_eq!((DECIMAL_MONTH.date("2020.1"), DECIMAL_MONTH.date("2020.01")), (date(10, 1), date(1, 1)));
        assert_eq!((DECIMAL_MONTH.date("2020.2"), DECIMAL_MONTH.date("2020.011")), (None, None));
        assert_eq!(Form("n_u").date("Jan-99"), Some(Date::constant(1999, 1, 1)));
    }
}
