//! Dates of a record's rows: in one form for the whole column, never guessed row by row, and never taken for numbers.

use jiff::civil::Date;

use super::choices::Choices;
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
/// Of records of returns; what lies outside is a number that looks like a date.
const YEARS: std::ops::RangeInclusive<i16> = 1700..=2200;
/// 1-2020 and Jan-99 are the shortest dates that are no numbers.
const SHORTEST: usize = 6;
/// Of two digits: from 1969 to 2068, as POSIX has it.
const PIVOT: i16 = 69;
/// Rows by which the forms of a column are told from those that cannot be its.
const FIRST: usize = 50;
/// A column is one of dates where so many of its cells are: written apart by marks, or in digits that might be numbers.
const MARKED: f64 = 0.5;
const IN_DIGITS: f64 = 0.9;

/// How dates are written: `y` is a year of four digits and `u` one of two, `m` and `d` one or two digits, `A` and `B` a month and
/// a day of two, `n` a month's name, `q` a quarter, `t` the time of day or nothing, `_` any marks and blanks or none, `/` a mark
/// between numbers, `-` one of those that are no decimal point; other letters stand for themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form(&'static str);

const FORMS: [Form; 16] = [
    Form("y/m/dt"),
    Form("y-mt"),
    Form("yMm"),
    DAY_FIRST,
    MONTH_FIRST,
    Form("m/y"),
    Form("d_n_y"),
    Form("n_d_y"),
    Form("n_y"),
    Form("y_n"),
    Form("y_Qq"),
    Form("Qq_y"),
    Form("d_n_u"),
    Form("n_u"),
    Form("yAB"),
    Form("yA"),
];
const DAY_FIRST: Form = Form("d/m/yt");
const MONTH_FIRST: Form = Form("m-d-yt");
const YEAR: Form = Form("y");

impl Form {
    fn is_digits(self) -> bool {
        matches!(self.0, "yAB" | "yA" | "y")
    }

    /// The day that `text` is in this form, the first of a month or a year, or the last month's of a quarter.
    pub fn date(self, text: &str) -> Option<Date> {
        let (mut year, mut month, mut day, mut rest) = (0, 1, 1, text.trim());
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
                't' => rest = rest.strip_suffix('Z').unwrap_or(rest),
                '_' => rest = rest.trim_start_matches([' ', '.', ',', '-']),
                '/' => rest = rest.strip_prefix(['/', '-', '.'])?,
                '-' => rest = rest.strip_prefix(['/', '-'])?,
                other => rest = rest.strip_prefix([other, other.to_ascii_lowercase()])?,
            }
        }
        let is_time = |rest: &str| self.0.ends_with('t') && rest.starts_with(['T', ' ']) && rest.contains(':');
        let date = Date::new(year, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok()?;
        ((rest.is_empty() || is_time(rest)) && YEARS.contains(&year)).then_some(date)
    }
}

fn digits(rest: &mut &str, least: usize, most: usize) -> Option<i16> {
    let count = rest.bytes().take(most).take_while(u8::is_ascii_digit).count();
    let (number, after) = rest.split_at(count);
    *rest = after;
    if count < least { None } else { number.parse().ok() }
}

/// A month by three letters of its name or more.
fn name(rest: &mut &str) -> Option<i16> {
    let count = rest.bytes().take_while(u8::is_ascii_alphabetic).count();
    let (word, after) = rest.split_at(count);
    *rest = after.strip_prefix('.').unwrap_or(after);
    let starts = |name: &str| name.get(..count).is_some_and(|start| start.eq_ignore_ascii_case(word));
    let found = if word.eq_ignore_ascii_case("sept") { Some(8) } else { MONTHS.iter().position(|name| starts(name)) };
    found.filter(|_| count >= 3).and_then(|index| i16::try_from(index + 1).ok())
}

/// The month from 1 that `text` alone names.
pub fn month(text: &str) -> Option<usize> {
    let mut rest = text.trim();
    let found = name(&mut rest)?;
    usize::try_from(found).ok().filter(|_| rest.is_empty())
}

/// Tells whether `text` alone can be a year.
pub fn is_year(text: &str) -> bool {
    YEAR.date(text).is_some()
}

/// Whether `text` alone is a date that nobody would take for a number.
pub fn could_be_date(text: &str) -> bool {
    text.len() >= SHORTEST && FORMS.iter().any(|form| !form.is_digits() && form.date(text).is_some())
}

/// The forms that most of the texts are in, of all that fit them.
fn best(texts: &[&str]) -> Vec<Form> {
    let share = |form: &Form| {
        let of = |texts: &[&str]| texts.iter().filter(|text| form.date(text).is_some()).count();
        let first = of(&texts[..texts.len().min(FIRST)]);
        if first == 0 { 0.0 } else { of(texts) as f64 / texts.len() as f64 }
    };
    let shares = FORMS.iter().map(|form| (*form, share(form)));
    let fits = |(form, share): &(Form, f64)| *share >= if form.is_digits() { IN_DIGITS } else { MARKED };
    let fitting: Vec<(Form, f64)> = shares.filter(fits).collect();
    let most = fitting.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    fitting.into_iter().filter(|(_, share)| *share == most).map(|(form, _)| form).collect()
}

/// Whether a column holds dates; where it `stands_alone`, years may as well be prices.
pub fn are_dates(texts: &[&str], stands_alone: bool) -> bool {
    !best(texts).is_empty() || (!stands_alone && are_years(texts))
}

/// Whole numbers of four digits that go up or down by one.
fn are_years(texts: &[&str]) -> bool {
    let years: Option<Vec<i16>> = texts.iter().map(|text| YEAR.date(text).map(Date::year)).collect();
    let Some(years) = years else { return false };
    let mut steps = years.windows(2).map(|pair| pair[1] - pair[0]);
    steps.next().is_some_and(|first| first.abs() == 1 && steps.all(|step| step == first))
}

/// The form of a column of dates: asked for where day and month can change places.
pub fn form(texts: &[&str], said: &Choices) -> Result<Form, Stop> {
    let found = best(texts);
    let first = found.first().copied().unwrap_or(YEAR);
    if first != DAY_FIRST || !found.contains(&MONTH_FIRST) {
        return Ok(first);
    }
    if let Some(day_first) = said.day_first {
        return Ok(if day_first { DAY_FIRST } else { MONTH_FIRST });
    }
    let differs = |text: &&&str| DAY_FIRST.date(text) != MONTH_FIRST.date(text);
    let Some(doubtful) = texts.iter().find(differs) else { return Ok(first) };
    let option = |form: Form, day_first| {
        let words = form.date(doubtful).map_or(String::new(), |date| told(date, None));
        (words, Choices { day_first: Some(day_first), ..Choices::default() })
    };
    let options = vec![option(DAY_FIRST, true), option(MONTH_FIRST, false)];
    Err(Stop::asked("day_first", format!("Which day is {doubtful}?"), options))
}

/// A date in words, as fine as the periods are.
pub fn told(date: Date, frequency: Option<Frequency>) -> String {
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
        assert_eq!(Form("n_u").date("Jan-99"), Some(Date::constant(1999, 1, 1)));
    }
}
