//! Text as rows of cells. A cell knows its line and column, so that an error in it can be located. This module does not
//! decide the meaning of a cell, with one exception: whether a comma separates numbers or is part of them.

use std::borrow::Cow;

use super::choices::Choices;
use super::dates::could_be_date;
use super::number::{Mark, is_number, looks_numeric, number};
use super::outcome::{Stop, TextPosition};

/// The most bytes of a text: a century of days for dozens of assets.
pub const MOST_BYTES: usize = 8_000_000;
pub const MOST_LINES: usize = 200_000;
const MOST_CELLS: usize = 1_000_000;
/// Marks that always separate cells; a comma or a blank does so only if nothing else can be meant.
const SEPARATORS: [char; 3] = ['\t', ';', '|'];
const COMMA: char = ',';
const BLANK: char = ' ';
/// The number of lines that decide the meaning of a comma, which is the same in all lines.
const FIRST: usize = 200;
/// Words that mark a missing number, and the most letters of such a word.
const MISSING: [&str; 11] = ["n/a", "na", "#n/a", "#na", "nan", "null", "none", "<na>", "-", "--", "."];
const LONGEST_MISSING: usize = 4;
/// The most letters of a value that are shown.
const SHOWN: usize = 60;
pub const SPREADSHEET: &str = "This is a spreadsheet file. Save it as CSV, or copy the column and paste it.";
pub const NO_TEXT: &str = "This is not text in UTF-8, UTF-16 or Windows-1252. Save it as CSV in UTF-8.";

/// The text between two separators.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell<'a> {
    pub text: Cow<'a, str>,
    line: u32,
    column: u32,
}

impl Cell<'_> {
    /// Returns the heading of a column that the text does not have.
    pub fn heading(text: &'static str) -> Cell<'static> {
        Cell { text: Cow::Borrowed(text), line: 1, column: 1 }
    }

    /// Returns a cell with another text at the same place.
    pub fn with_text<'a>(&self, text: String) -> Cell<'a> {
        Cell { text: Cow::Owned(text), line: self.line, column: self.column }
    }

    /// Returns a refusal that says that the cell breaks `rule`, with the name of its column if it has one.
    pub fn refused(&self, name: &str, rule: &str) -> Stop {
        let place = self.place();
        Stop::Refused { sentence: format!("{}: {rule}", self.called(name)), place: Some(place) }
    }

    /// Returns true if the cell is blank, or has a word that says that there is no number.
    pub fn is_missing(&self) -> bool {
        self.text.is_empty()
            || (self.text.len() <= LONGEST_MISSING && MISSING.contains(&self.text.to_ascii_lowercase().as_str()))
    }

    /// Returns the line, from 1.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Returns the place of the cell and its value, in words.
    pub fn called(&self, name: &str) -> String {
        let TextPosition { line, column, value } = self.place();
        let name = if name.is_empty() { format!("column {column}") } else { name.to_owned() };
        format!("line {line}: {name} is {value:?}")
    }

    /// Returns the text, shortened if it is long.
    pub fn shown(&self) -> String {
        match self.text.char_indices().nth(SHOWN) {
            Some((end, _)) => format!("{}\u{2026}", &self.text[..end]),
            None => self.text.to_string(),
        }
    }

    fn place(&self) -> TextPosition {
        TextPosition { line: self.line as usize, column: self.column as usize, value: self.shown() }
    }
}

/// A line without its line ending, counted from 1.
#[derive(Clone, Copy)]
struct TextLine<'a> {
    text: &'a str,
    number: u32,
}

/// Rows of cells without blank rows, and the number of lines that were comments.
pub struct CellRows<'a> {
    pub rows: Vec<Vec<Cell<'a>>>,
    pub remarks: usize,
}

impl<'a> CellRows<'a> {
    /// # Errors
    /// The text is too long or no text, or a comma in it has two possible meanings.
    pub fn of(text: &'a str, choices: &Choices) -> Result<Self, Stop> {
        let text = text.trim_start_matches('\u{feff}');
        let end = if text.contains('\n') { '\n' } else { '\r' };
        check(text, end)?;
        let number =
            |(index, text): (usize, &'a str)| TextLine { text, number: u32::try_from(index + 1).unwrap_or(u32::MAX) };
        let given: Vec<TextLine> =
            text.split(end).enumerate().map(number).filter(|line| !line.text.trim().is_empty()).collect();
        let declared = given.first().and_then(|line| declared(line.text));
        let from = usize::from(declared.is_some());
        let lines: Vec<TextLine> = given[from..].iter().copied().filter(|line| !is_remark(line.text)).collect();
        if lines.is_empty() {
            return Err(Stop::refused("There are no numbers in the text."));
        }
        let separator = declared.map_or_else(|| separator(&lines, choices), Ok)?;
        let mut rows = lines.iter().map(|line| cells(*line, separator)).collect::<Result<Vec<_>, Stop>>()?;
        let filled = |row: &Vec<Cell>| row.iter().rposition(|cell| !cell.text.is_empty()).map_or(0, |last| last + 1);
        rows.retain(|row| filled(row) > 0);
        // Separators at the ends of lines make blank cells, which are removed.
        let width = rows.iter().map(filled).max().unwrap_or(0);
        rows.iter_mut().for_each(|row| row.truncate(width));
        if rows.is_empty() {
            return Err(Stop::refused("There are no numbers in the text."));
        }
        Ok(CellRows { rows, remarks: given.len() - lines.len() })
    }
}

fn check(text: &str, end: char) -> Result<(), Stop> {
    let bounds = [
        (text.len(), MOST_BYTES, "bytes"),
        (text.matches(end).count(), MOST_LINES, "lines"),
        (text.chars().filter(|letter| letter.is_whitespace() || ",;|".contains(*letter)).count(), MOST_CELLS, "cells"),
    ];
    if let Some((found, most, what)) = bounds.into_iter().find(|(found, most, _)| found > most) {
        return Err(Stop::refused(format!("The text has {found} {what}: it must have at most {most}.")));
    }
    if text.starts_with("PK\u{3}\u{4}") {
        return Err(Stop::refused(SPREADSHEET));
    }
    if text.contains(['\0', '\u{fffd}']) { Err(Stop::refused(NO_TEXT)) } else { Ok(()) }
}

/// Returns true for a comment line. A spreadsheet writes #N/A for a missing number, so that is no comment.
fn is_remark(line: &str) -> bool {
    let line = line.trim_start();
    line.starts_with('#') && !line.get(..3).is_some_and(|start| ["#N/", "#NA"].contains(&&*start.to_ascii_uppercase()))
}

/// Returns the separator that a first line such as `sep=;` declares to a spreadsheet.
fn declared(line: &str) -> Option<char> {
    let mut rest = line.trim_matches(['"', '\r']).strip_prefix("sep=")?.chars();
    let separator = rest.next()?;
    ((separator == COMMA || SEPARATORS.contains(&separator)) && rest.next().is_none()).then_some(separator)
}

/// Returns the lines that end in a number, apart from separators. They show how cells are separated; words around a
/// table do not.
fn numeric<'a>(lines: &[TextLine<'a>]) -> Vec<TextLine<'a>> {
    let ends_in_number = |line: &TextLine| {
        let rest = line.text.trim_end_matches(|letter: char| letter.is_whitespace() || "\",;|%)".contains(letter));
        rest.ends_with(|letter: char| letter.is_ascii_digit() || letter == '.')
    };
    // The line above the first such line may be its heading.
    let from = lines.iter().position(ends_in_number).unwrap_or(0).saturating_sub(1);
    let is_shown = |(index, line): &(usize, &TextLine)| *index == from || ends_in_number(line);
    let found: Vec<TextLine> = lines.iter().enumerate().filter(is_shown).map(|(_, line)| *line).collect();
    if found.len() < 2 { lines.to_vec() } else { found }
}

fn separator(lines: &[TextLine], choices: &Choices) -> Result<char, Stop> {
    let lines = &numeric(lines)[..];
    let holding = |wanted: char| {
        let outside = |line: &&TextLine| line.text.split('"').step_by(2).any(|unquoted| unquoted.contains(wanted));
        lines.iter().filter(outside).count()
    };
    let counts = SEPARATORS.map(|separator| (holding(separator), separator));
    let (count, plain) = counts.into_iter().rev().max().unwrap_or((0, COMMA));
    if count > 0 && 2 * count >= lines.len() {
        return Ok(plain);
    }
    if holding(COMMA) > 0 {
        return match choices.comma_parts {
            Some(parts) => Ok(if parts { COMMA } else { BLANK }),
            None => comma(lines),
        };
    }
    // Without commas each word is a cell, unless a quoted cell or a date of several words contains the blanks.
    let is_whole = |line: &TextLine| !line.text.trim().contains(char::is_whitespace) || could_be_date(line.text.trim());
    let quoted = lines.iter().any(|line| line.text.contains('"'));
    Ok(if quoted || lines.iter().all(is_whole) { COMMA } else { BLANK })
}

/// Decides whether a comma separates cells or is a decimal or thousands mark within them. If the text allows both, a
/// person must choose.
fn comma(lines: &[TextLine]) -> Result<char, Stop> {
    let (parting, inside) = (strangers(lines, COMMA)?, strangers(lines, BLANK)?);
    if parting < inside {
        return Ok(COMMA);
    }
    let word = lines.iter().find_map(|line| words(*line).into_iter().find(|cell| cell.text.contains(COMMA)));
    let Some(word) = word.filter(|word| looks_numeric(&word.text)) else { return Ok(COMMA) };
    if inside < parting {
        return Ok(BLANK);
    }
    let (word, parted) = (&word.text, word.text.replace(COMMA, " and "));
    let parts = |parts| Choices { comma_parts: Some(parts), ..Choices::default() };
    let options =
        vec![(format!("One number: {word}"), parts(false)), (format!("Separate numbers: {parted}"), parts(true))];
    Err(Stop::question("comma_parts", format!("Is {word} one number, or are {parted} separate numbers?"), options))
}

/// Counts the cells that would be neither numbers nor dates if lines were split by `separator`; a heading is not
/// counted.
fn strangers(lines: &[TextLine], separator: char) -> Result<usize, Stop> {
    let lines = &lines[..lines.len().min(FIRST)];
    let rows = lines.iter().map(|line| cells(*line, separator)).collect::<Result<Vec<_>, Stop>>()?;
    let is_known = |cell: &Cell| cell.text.is_empty() || is_number(&cell.text) || could_be_date(&cell.text);
    let headed = rows.len() > 1 && !rows[0].iter().any(is_known);
    Ok(rows[usize::from(headed)..].iter().flatten().filter(|cell| !is_known(cell)).count())
}

fn cells(line: TextLine, separator: char) -> Result<Vec<Cell>, Stop> {
    if separator == BLANK { Ok(words(line)) } else { fields(line, separator) }
}

/// Splits a line at blanks. A comma at the end of a word is removed, and so are quotes around it; a percent sign
/// belongs to the number before it.
fn words(line: TextLine) -> Vec<Cell> {
    let mut found: Vec<Cell> = Vec::new();
    for word in line.text.split_whitespace() {
        let word = word.strip_suffix(COMMA).unwrap_or(word);
        let text = word.strip_prefix('"').and_then(|word| word.strip_suffix('"')).unwrap_or(word);
        match found.last_mut() {
            Some(last) if text == "%" => last.text.to_mut().push_str(" %"),
            _ if text.is_empty() => {}
            _ => found.push(cell(line, found.len(), text.into())),
        }
    }
    found
}

fn cell<'a>(line: TextLine<'a>, before: usize, text: Cow<'a, str>) -> Cell<'a> {
    Cell { text, line: line.number, column: u32::try_from(before + 1).unwrap_or(u32::MAX) }
}

/// Splits a line at `separator`. Quotes protect a separator within them and are removed; a doubled quote within quotes
/// is one quote.
fn fields(line: TextLine, separator: char) -> Result<Vec<Cell>, Stop> {
    let mut found = Vec::new();
    let mut rest = Some(line.text);
    while let Some(text) = rest {
        let start = text.trim_start_matches([' ', '\u{a0}']);
        let quoted = match start.strip_prefix('"') {
            Some(inside) => Some((
                inside,
                closing(inside).ok_or_else(|| {
                    Stop::refused(format!("Line {} opens a quote and does not close it.", line.number))
                })?,
            )),
            None => None,
        };
        let after = quoted.map_or(start, |(inside, end)| &inside[end + 1..]);
        let (own, next) = after.split_once(separator).map_or((after, None), |(own, next)| (own, Some(next)));
        if quoted.is_some() && !own.trim().is_empty() {
            return Err(Stop::refused(format!("Line {} has {} after a closing quote.", line.number, own.trim())));
        }
        let text: Cow<str> = match quoted {
            Some((inside, end)) if inside[..end].contains("\"\"") => inside[..end].replace("\"\"", "\"").into(),
            Some((inside, end)) => inside[..end].trim().into(),
            None => own.trim().into(),
        };
        found.push(cell(line, found.len(), text));
        rest = next;
    }
    Ok(found)
}

/// Returns the index of the closing quote, if `text` starts after the opening one.
fn closing(text: &str) -> Option<usize> {
    let mut from = 0;
    loop {
        let at = from + text[from..].find('"')?;
        if !text[at + 1..].starts_with('"') {
            return Some(at);
        }
        from = at + 2;
    }
}

/// Returns the decimal mark of `cells`. If 1,234 can be read both ways, the caller is asked.
pub fn mark<'a>(cells: impl Iterator<Item = &'a Cell<'a>>, choices: &Choices) -> Result<Mark, Stop> {
    if let Some(comma) = choices.decimal_comma {
        return Ok(if comma { Mark::Comma } else { Mark::Point });
    }
    let numeric: Vec<&Cell> = cells.filter(|cell| looks_numeric(&cell.text)).collect();
    let Some(doubtful) = numeric.iter().find(|cell| cell.text.contains(COMMA)) else { return Ok(Mark::Point) };
    let fits = |mark| numeric.iter().filter(|cell| number(&cell.text, mark).is_some()).count();
    match fits(Mark::Point).cmp(&fits(Mark::Comma)) {
        std::cmp::Ordering::Greater => Ok(Mark::Point),
        std::cmp::Ordering::Less => Ok(Mark::Comma),
        std::cmp::Ordering::Equal => {
            let option = |word: &str, decimal_comma, mark| {
                let value = number(&doubtful.text, mark).unwrap_or(f64::NAN);
                let choices = Choices { decimal_comma: Some(decimal_comma), ..Choices::default() };
                (format!("{word}: {} is {value}", doubtful.text), choices)
            };
            let options = vec![option("Yes", true, Mark::Comma), option("No", false, Mark::Point)];
            Err(Stop::question("decimal_comma", format!("Is the comma in {} a decimal mark?", doubtful.text), options))
        }
    }
}
