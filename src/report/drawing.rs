//! What every chart shares: the canvas, the legend, and what is refused.

use thiserror::Error;

use super::axis::Scale;
use super::markup::Element;

/// Drawing units. The page scales them: text is larger in them on a narrow screen (see `style.css`).
pub const WIDTH: f64 = 640.0;
/// Series told apart by colour and dash.
pub const MOST_SERIES: usize = 8;
/// Beyond it, differences overflow.
const LARGEST: f64 = 1e100;

/// A chart that cannot be drawn.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ChartError {
    #[error("chart {chart:?}: there is nothing to draw")]
    Empty { chart: String },
    #[error("chart {chart:?}: {series:?} holds {value}: must be finite and at most 1e100 in size")]
    NotFinite { chart: String, series: String, value: f64 },
    #[error("chart {chart:?}: a value is {value}: must be above 0 on a logarithmic axis")]
    NotPositive { chart: String, value: f64 },
    #[error("chart {chart:?}: {found} series: must be at most 8")]
    TooMany { chart: String, found: usize },
}

/// Anything a page can show as a figure.
pub trait Draw {
    /// # Errors
    /// No data, data that are not finite, not above 0 on a logarithmic axis, or more than 8 series.
    fn draw(&self) -> Result<Drawing, ChartError>;
}

/// A name of the legend, in the order of the series.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct LegendEntry {
    pub name: String,
    /// Drawn as points alone.
    pub dotted: bool,
}

/// A chart, drawn. The legend is not part of the SVG, so that it wraps with the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    pub(super) title: String,
    pub(super) legend: Vec<LegendEntry>,
    pub(super) svg: Element,
}

impl Drawing {
    /// The SVG alone, as text.
    pub fn svg(&self) -> String {
        let mut out = String::new();
        self.svg.write(&mut out);
        out
    }
}

/// An empty drawing with its title and description for those who cannot see it.
pub fn canvas(title: &str, description: &str, height: f64) -> Element {
    Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("viewBox", format_args!("0 0 {WIDTH} {height}"))
        .with("role", "img")
        .with("aria-label", title)
        .class("chart")
        .child(Element::new("title").text(title))
        .child(Element::new("desc").text(description))
}

/// Ticks of a horizontal axis with their grid lines from `top` to `bottom`, and its title below.
pub fn horizontal_axis(scale: &Scale, title: &str, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> Element {
    // On a narrow screen, where there are many, every other label is left out.
    let crowded = scale.ticks.values.len() > 5;
    let tick = |(index, (x, label)): (usize, (f64, String))| {
        let grid = Element::new("line").at("x1", x).at("x2", x).at("y1", top).at("y2", bottom).class("grid");
        let class = if crowded && index % 2 == 1 { "x spare" } else { "x" };
        [grid, Element::new("text").at("x", x).at("y", bottom + 22.0).class(class).text(label)]
    };
    let title = Element::new("text").at("x", 0.5 * (left + right)).at("y", bottom + 48.0).class("x").text(title);
    Element::new("g").children(scale.marks().enumerate().flat_map(tick)).child(title)
}

/// The smallest and the largest of some values of a series, all of which can be drawn.
pub fn range_of(
    chart: &str,
    values: impl Iterator<Item = (String, f64)>,
    logarithmic: bool,
) -> Result<[f64; 2], ChartError> {
    let mut range: Option<[f64; 2]> = None;
    for (series, value) in values {
        let chart = || chart.to_owned();
        if !value.is_finite() || value.abs() > LARGEST {
            return Err(ChartError::NotFinite { chart: chart(), series, value });
        }
        if logarithmic && value <= 0.0 {
            return Err(ChartError::NotPositive { chart: chart(), value });
        }
        range = Some(range.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]));
    }
    range.ok_or_else(|| ChartError::Empty { chart: chart.into() })
}
