//! Tables: the first column names the row, columns of numbers line up.

use super::markup::Element;
use super::number::{decimal, with_interval};

/// What a cell holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    Text(String),
    /// Already written; lines up with the numbers of its column.
    Figure(String),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Cell::Text(text.into())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Cell::Text(text)
    }
}

/// A number to so many decimals; a dash where it is not finite.
pub fn number(value: f64, decimals: usize) -> Cell {
    Cell::Figure(decimal(value, decimals))
}

/// `value [low, high]`.
pub fn interval(value: f64, ends: [f64; 2], decimals: usize) -> Cell {
    Cell::Figure(with_interval(value, ends, decimals))
}

/// A table with a caption.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    pub fn new(caption: &str, header: &[&str]) -> Self {
        Table { caption: caption.into(), header: header.iter().map(ToString::to_string).collect(), rows: Vec::new() }
    }

    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        self.rows.push(cells.into_iter().collect());
        self
    }

    pub(super) fn element(&self) -> Element {
        let header = self.header.iter().enumerate().map(|(column, name)| {
            let figures = self.rows.iter().any(|row| matches!(row.get(column), Some(Cell::Figure(_))));
            let cell = Element::new("th").with("scope", "col").text(name);
            if figures { cell.class("figure") } else { cell }
        });
        let rows = self.rows.iter().map(|row| Element::new("tr").children(row.iter().enumerate().map(cell)));
        let table = Element::new("table")
            .child(Element::new("caption").text(&self.caption))
            .child(Element::new("thead").child(Element::new("tr").children(header)))
            .child(Element::new("tbody").children(rows));
        // Wide tables scroll by themselves, with the keyboard too.
        let scrolled = Element::new("div").class("scroll").with("role", "region").with("tabindex", 0);
        scrolled.with("aria-label", &self.caption).child(table)
    }
}

fn cell((column, cell): (usize, &Cell)) -> Element {
    match cell {
        Cell::Text(text) if column == 0 => Element::new("th").with("scope", "row").text(text),
        Cell::Text(text) => Element::new("td").text(text),
        Cell::Figure(text) => Element::new("td").class("figure").text(text),
    }
}
