//! Bars with intervals, lying, each under its own label: names of any length stay readable on any screen.

use super::axis::{Axis, Scale};
use super::drawing::{ChartError, Draw, Drawing, WIDTH, canvas, horizontal_axis, range_of};
use super::markup::Element;
use super::number::{decimal, with_interval};

const LEFT: f64 = 30.0;
const RIGHT: f64 = WIDTH - 36.0;
const TOP: f64 = 8.0;
const ROW: f64 = 54.0;
const BAR: f64 = 18.0;
const BELOW: f64 = 64.0;

/// One value a row, from zero, with an interval where there is one.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    title: String,
    axis: Axis,
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    name: String,
    value: f64,
    interval: Option<[f64; 2]>,
}

impl BarChart {
    pub fn new(title: &str, axis: Axis) -> Self {
        BarChart { title: title.into(), axis: axis.from_zero(), rows: Vec::new() }
    }

    pub fn bar(mut self, name: &str, value: f64, interval: Option<[f64; 2]>) -> Self {
        self.rows.push(Row { name: name.into(), value, interval });
        self
    }
}

impl Draw for BarChart {
    fn draw(&self) -> Result<Drawing, ChartError> {
        let values = self.rows.iter().flat_map(|row| {
            let ends = row.interval.into_iter().flatten();
            ends.chain([row.value]).map(|value| (row.name.clone(), value))
        });
        let [low, high] = range_of(&self.title, values, false)?;
        let scale = self.axis.scale(low, high, LEFT, RIGHT);
        let bottom = TOP + ROW * self.rows.len() as f64;
        let labels: Vec<String> = self.rows.iter().map(|row| row.label(&scale)).collect();
        let description = format!("{}: {}.", self.axis.title, labels.join("; "));
        let rows = self.rows.iter().zip(labels).enumerate();
        let svg = canvas(&self.title, &description, bottom + BELOW)
            .child(horizontal_axis(&scale, &self.axis.title, [LEFT, RIGHT], [TOP, bottom]))
            .children(rows.map(|(index, (row, label))| row.draw(&scale, TOP + ROW * index as f64, label)));
        Ok(Drawing { title: self.title.clone(), legend: Vec::new(), svg })
    }
}

impl Row {
    fn label(&self, scale: &Scale) -> String {
        let decimals = scale.ticks.finer_decimals();
        let figures = match self.interval {
            Some(ends) => with_interval(self.value, ends, decimals),
            None => decimal(self.value, decimals),
        };
        format!("{}  {figures}", self.name)
    }

    fn draw(&self, scale: &Scale, top: f64, label: String) -> Element {
        let [zero, end] = [scale.at(0.0), scale.at(self.value)];
        let bar_top = top + ROW - BAR - 4.0;
        let bar = Element::new("rect").at("x", zero.min(end)).at("y", bar_top).at("width", (end - zero).abs());
        let label = Element::new("text").at("x", 2.0).at("y", bar_top - 8.0).class("halo").text(label);
        let row = Element::new("g").class("s0").child(bar.at("height", BAR).class("bar")).child(label);
        let whisker = self.interval.map(|[low, high]| {
            let middle = bar_top + 0.5 * BAR;
            let [low, high] = [scale.at(low), scale.at(high)];
            let d = format!(
                "M{low:.2} {middle:.2}H{high:.2}M{low:.2} {:.2}v10M{high:.2} {:.2}v10",
                middle - 5.0,
                middle - 5.0
            );
            Element::new("path").with("d", d).class("whisker")
        });
        row.children(whisker)
    }
}

#[cfg(test)]
mod tests {
    use super::super::well_formed::check;
    use super::*;

    #[test]
    fn bars_start_at_zero_and_carry_their_figures() {
        let chart = BarChart::new("Sharpe", Axis::new("ratio"))
            .bar("adaptive <0.1>", 0.42, Some([0.2, 0.6]))
            .bar("loss", -0.1, None);
        let drawing = chart.draw().unwrap();
        let elements = check(&drawing.svg()).unwrap();
        assert_eq!(elements.iter().filter(|name| *name == "rect").count(), 2);
        assert!(drawing.svg().contains("adaptive &lt;0.1&gt;  0.42 [0.20, 0.60]"), "{}", drawing.svg());
        assert!(matches!(BarChart::new("B", Axis::new("x")).draw(), Err(ChartError::Empty { .. })));
        let bad = BarChart::new("B", Axis::new("x")).bar("a", 0.0, Some([f64::NAN, 1.0]));
        assert!(matches!(bad.draw(), Err(ChartError::NotFinite { .. })));
    }
}
