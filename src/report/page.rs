//! A report as one HTML file.

use super::drawing::{ChartError, Draw, Drawing, LegendEntry};
use super::markup::Element;
use super::table::Table;

const STYLE: &str = include_str!("style.css");

/// A page, written from top to bottom.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    title: String,
    blocks: Vec<Block>,
}

#[derive(Debug, Clone, PartialEq)]
enum Block {
    Section(String),
    Paragraph(String),
    Points(Vec<String>),
    Table(Table),
    Figure { drawing: Result<Drawing, ChartError>, caption: String },
}

impl Page {
    pub fn new(title: &str) -> Self {
        Page { title: title.into(), blocks: Vec::new() }
    }

    /// What follows belongs under this heading.
    pub fn section(self, heading: &str) -> Self {
        self.block(Block::Section(heading.into()))
    }

    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.block(Block::Paragraph(text.into()))
    }

    /// Short statements, one a line.
    pub fn points(self, statements: impl IntoIterator<Item = String>) -> Self {
        self.block(Block::Points(statements.into_iter().collect()))
    }

    pub fn table(self, table: Table) -> Self {
        self.block(Block::Table(table))
    }

    pub fn figure(self, chart: impl Draw, caption: &str) -> Self {
        self.block(Block::Figure { drawing: chart.draw(), caption: caption.into() })
    }

    fn block(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// The file: no script, nothing loaded from elsewhere, light or dark as the reader's system is.
    ///
    /// # Errors
    /// The first figure that could not be drawn.
    pub fn html(&self) -> Result<String, ChartError> {
        let mut blocks = Vec::new();
        for block in &self.blocks {
            blocks.push(block.element()?);
        }
        let meta = |name, content| Element::new("meta").with("name", name).with("content", content);
        let head = Element::new("head")
            .child(Element::new("meta").with("charset", "utf-8"))
            .child(meta("viewport", "width=device-width, initial-scale=1"))
            .child(meta("color-scheme", "light dark"))
            .child(Element::new("title").text(&self.title))
            .child(Element::style(STYLE));
        let body = Element::new("main").child(Element::new("h1").text(&self.title)).children(blocks);
        let page = Element::new("html").with("lang", "en").child(head).child(Element::new("body").child(body));
        let mut html = String::from("<!doctype html>\n");
        page.write(&mut html);
        html.push('\n');
        Ok(html)
    }
}

impl Block {
    fn element(&self) -> Result<Element, ChartError> {
        Ok(match self {
            Block::Section(heading) => Element::new("h2").text(heading),
            Block::Paragraph(text) => Element::new("p").text(text),
            Block::Points(statements) => {
                Element::new("ul").children(statements.iter().map(|text| Element::new("li").text(text)))
            }
            Block::Table(table) => table.element(),
            Block::Figure { drawing, caption } => figure(drawing.as_ref().map_err(Clone::clone)?, caption),
        })
    }
}

fn figure(drawing: &Drawing, caption: &str) -> Element {
    let entry = |(index, LegendEntry { name, dotted }): (usize, &LegendEntry)| {
        let sample = if *dotted {
            Element::new("circle").with("cx", 16).with("cy", 5).with("r", 4).class(format_args!("s{index} points"))
        } else {
            Element::new("path").with("d", "M0 5H32").class(format_args!("s{index} line"))
        };
        let key = Element::new("svg").class("key").with("viewBox", "0 0 32 10").with("aria-hidden", true).child(sample);
        Element::new("li").child(key).text(name)
    };
    let figure = Element::new("figure").child(Element::new("p").class("title").text(&drawing.title));
    let legend = Element::new("ul").class("legend").children(drawing.legend.iter().enumerate().map(entry));
    let figure = if drawing.legend.len() > 1 { figure.child(legend) } else { figure };
    figure.child(drawing.svg.clone()).child(Element::new("figcaption").text(caption))
}

#[cfg(test)]
mod tests {
    use super::super::well_formed::check;
    use super::super::{Axis, Chart, interval, number};
    use super::*;

    #[test]
    fn a_page_is_well_formed_self_contained_and_escaped() {
        let hostile = "<script>alert('x')</script> & \u{1}";
        let chart = Chart::new(hostile, Axis::new(hostile), Axis::new(hostile));
        let table = Table::new(hostile, &[hostile, "mean"]);
        let page = Page::new(hostile)
            .section(hostile)
            .paragraph(hostile)
            .points([hostile.to_owned()])
            .figure(chart.line(hostile, [(0.0, 1.0)]).line("b", [(1.0, 2.0)]), hostile)
            .table(table.row([hostile.into(), interval(1.0, [0.5, 1.5], 1)]).row(["b".into(), number(-2.0, 1)]));
        let html = page.html().unwrap();
        let elements = check(html.trim_start_matches("<!doctype html>\n")).unwrap();
        assert!(!elements.contains(&"script".to_owned()));
        for name in ["h1", "h2", "svg", "figcaption", "table", "caption", "style"] {
            assert!(elements.contains(&name.to_owned()), "no {name}");
        }
        assert!(html.contains("<td class=\"figure\">1.0 [0.5, 1.5]</td>"), "{html}");
        assert!(!html.contains("src=") && !html.contains("href=") && !html.contains("url("), "{html}");
    }

    #[test]
    fn a_figure_that_cannot_be_drawn_is_an_error_of_the_page() {
        let chart = Chart::new("C", Axis::new("x"), Axis::new("y")).line("a", [(0.0, f64::NAN)]);
        let message = Page::new("P").figure(chart, "").html().unwrap_err().to_string();
        assert_eq!(message, "chart \"C\": \"a\" holds NaN: must be finite and at most 1e100 in size");
    }
}
