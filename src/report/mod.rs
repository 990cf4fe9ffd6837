//! A leaf beside the floors: reports to read, from data. It names no floor, and none below `service` names it.
//!
//! Charts are drawn as SVG, pages written as one HTML file, tables of data as CSV; no template, no script, nothing
//! loaded from elsewhere. Markup is a tree of elements, escaped where it is written, so it is well-formed however
//! odd a name in the data is. Colours are CSS variables, told apart by the colour-blind and helped by dashes.
//!
//! ```
//! use ballast::report::{Axis, Chart, Page, Table, interval};
//!
//! let chart = Chart::new("Wealth", Axis::new("month").tight(), Axis::new("wealth"))
//!     .line("all-bank", [(0.0, 100.0), (1.0, 100.2)])
//!     .band("adaptive", [(0.0, [100.0, 100.0]), (1.0, [97.0, 104.0])]);
//! let page = Page::new("A month")
//!     .paragraph("What became of wealth.")
//!     .figure(chart, "Lines, and the middle 80 % of paths.")
//!     .table(Table::new("Returns", &["strategy", "mean, %"]).row(["adaptive".into(), interval(0.5, [0.1, 0.9], 2)]));
//! assert!(page.html()?.starts_with("<!doctype html>"));
//! # Ok::<(), ballast::report::ChartError>(())
//! ```

mod axis;
mod bars;
mod chart;
mod csv;
mod drawing;
mod histogram;
mod markup;
mod number;
mod page;
mod table;
mod ticks;
#[cfg(test)]
mod well_formed;

pub use self::csv::Csv;
pub use axis::Axis;
pub use bars::BarChart;
pub use chart::Chart;
pub use drawing::{ChartError, Draw, Drawing};
pub use page::Page;
pub use table::{Cell, Table, interval, number};
