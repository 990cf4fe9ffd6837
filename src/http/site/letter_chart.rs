//! The chart of wealth in a letter: lines over common positions, as SVG without styles or scripts of its own.

use std::fmt::Write;

use crate::report::escaped;
use crate::service::letter::content::{WealthChart, WealthLine};
use crate::service::letter::figures::grouped;

/// The width of an A4 page between the margins of a letter, in CSS pixels.
const WIDTH: f64 = 672.0;
/// The height, of few and of many assets.
const HEIGHT: f64 = 190.0;
const LOW_HEIGHT: f64 = 110.0;
/// Room below the plot for the names of positions, and above it.
const BELOW: f64 = 30.0;
const ABOVE: f64 = 10.0;
/// Room to the right of the plot.
const RIGHT: f64 = 14.0;
/// The least room to the left of it, and that of a letter of a label.
const GUTTER: f64 = 64.0;
const LETTER_WIDTH: f64 = 6.6;
/// Distances between labels.
const APART_X: f64 = 70.0;
const APART_Y: f64 = 38.0;
/// Up to so many values of one's own line have a dot each.
const DOTTED: usize = 40;
/// A smaller relative difference is rounding.
const ROUNDING: f64 = 1e-9;
/// The most decimals of a label.
const FINEST: f64 = 10.0;
/// The colours of the lines in the style sheet, in their order.
const COLOURS: [usize; 6] = [0, 2, 3, 1, 7, 8];

/// Returns the chart with its legend.
pub(super) fn figure(chart: &WealthChart, is_dense: bool) -> String {
    let legend: String = chart.lines.iter().zip(COLOURS).map(|(line, colour)| entry(line, colour)).collect();
    let height = if is_dense { LOW_HEIGHT } else { HEIGHT };
    format!(
        "<figure class=\"chart\"><figcaption><span class=\"title\">Wealth</span><span class=\"legend\"><span>{}</span>{legend}</span>\
         </figcaption>{}</figure>",
        escaped(&chart.here),
        plot(chart, height)
    )
}

fn entry(WealthLine { name, last, .. }: &WealthLine, colour: usize) -> String {
    let swatch = format!(
        "<svg class=\"swatch\" width=\"22\" height=\"8\" aria-hidden=\"true\"><line class=\"line s{colour}\" x1=\"1\" x2=\"21\" y1=\"4\" y2=\"4\"/></svg>"
    );
    format!("<span>{swatch}{name} <b>{}</b></span>", escaped(last))
}

/// The positions of values on the drawing.
struct PlotFrame {
    left: f64,
    bottom: f64,
    low: f64,
    high: f64,
    last: f64,
}

impl PlotFrame {
    fn x(&self, position: f64) -> f64 {
        self.left + (WIDTH - RIGHT - self.left) * position / self.last
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom + (ABOVE - self.bottom) * (value - self.low) / (self.high - self.low)
    }
}

fn plot(chart: &WealthChart, height: f64) -> String {
    let (low, high) = extent(chart.lines.iter().flat_map(|line| line.values.iter().flatten().copied()));
    let (rules, step) = ticks(low, high, height / APART_Y);
    let labels: Vec<String> = rules.iter().map(|tick| grouped(*tick, decimals(step))).collect();
    let longest = labels.iter().map(|label| label.chars().count()).max().unwrap_or(0);
    let left = GUTTER.max(16.0 + LETTER_WIDTH * longest as f64);
    let last = (chart.positions.len() - 1).max(1) as f64;
    let frame = PlotFrame { left, bottom: height - BELOW, low, high, last };
    let mut text = format!(
        "<svg class=\"wealth\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"Wealth after each period, beside that of the comparators\">"
    );
    for (tick, label) in rules.iter().zip(&labels) {
        let (y, right) = (frame.y(*tick), WIDTH - 4.0);
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "<line class=\"rule\" x1=\"{left:.1}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{y:.1}\" dy=\"0.32em\" text-anchor=\"end\">{label}</text>",
            left - 8.0
        );
    }
    text += &position_labels(chart, &frame);
    for (line, colour) in chart.lines.iter().zip(COLOURS).rev() {
        text += &drawn(line, colour, &frame);
    }
    text + "</svg>"
}

fn position_labels(chart: &WealthChart, frame: &PlotFrame) -> String {
    let (places, _) = ticks(0.0, frame.last, (WIDTH / APART_X).min(12.0));
    let mut text = String::new();
    for place in places.into_iter().filter(|place| place.fract() == 0.0) {
        let Some(name) = chart.positions.get(place as usize) else { continue };
        let (x, right) = (frame.x(place), WIDTH - 4.0);
        let is_beyond = x + LETTER_WIDTH * name.chars().count() as f64 / 2.0 > right;
        let (x, anchor) = if is_beyond { (right, "end") } else { (x, "middle") };
        let (y, name) = (frame.bottom + 18.0, escaped(name));
        let _ = write!(text, "<text class=\"tick\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{name}</text>");
    }
    text
}

/// Draws a line, which is interrupted by missing values; the first line of a chart has dots.
fn drawn(WealthLine { values, .. }: &WealthLine, colour: usize, frame: &PlotFrame) -> String {
    let mut path = String::new();
    let (mut pen, mut dots) = ("M", String::new());
    for (position, value) in values.iter().enumerate() {
        let Some(value) = value else {
            pen = "M";
            continue;
        };
        let (x, y) = (frame.x(position as f64), frame.y(*value));
        let _ = write!(path, "{pen}{x:.1} {y:.1}");
        pen = "L";
        if colour == COLOURS[0] && values.len() <= DOTTED {
            let _ = write!(dots, "<circle class=\"dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\"/>");
        }
    }
    format!("<path class=\"line s{colour}\" d=\"{path}\"/>{dots}")
}

/// Returns the range of the values, widened by a twentieth.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        // There is no value.
        return (0.0, 1.0);
    }
    let size = low.abs().max(high.abs());
    let room = match high - low {
        apart if apart > ROUNDING * size => 0.05 * apart,
        _ if size > 0.0 => 0.05 * size,
        _ => 0.5,
    };
    (low - room, high + room)
}

/// Returns round numbers within `[low, high]`, in about `wanted` steps, and their step.
fn ticks(low: f64, high: f64, wanted: f64) -> (Vec<f64>, f64) {
    let rough = (high - low) / wanted.max(1.0);
    let power = 10_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough * 0.999).unwrap_or(10.0);
    let step = factor * power;
    let (first, last) = ((low / step - ROUNDING).ceil(), (high / step + ROUNDING).floor());
    let count = if last >= first { (last - first) as usize + 1 } else { 0 };
    // Adding 0 turns a negative zero into zero.
    ((0..count).map(|k| (first + k as f64) * step + 0.0).collect(), step)
}

/// Returns the decimals that tell multiples of `step` apart.
fn decimals(step: f64) -> usize {
    (-(step.log10() + ROUNDING).floor()).clamp(0.0, FINEST) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(ticks(98.3, 107.2, 5.0), (vec![100.0, 102.0, 104.0, 106.0], 2.0));
        assert_eq!(ticks(0.0, 3.0, 9.0).0.len(), 7);
        assert_eq!(ticks(-0.4, 0.9, 4.0).0, [0.0, 0.5]);
        assert_eq!([1000.0, 2.0, 0.5, 0.02].map(decimals), [0, 0, 1, 2]);
        assert_eq!(extent([100.0, 120.0].into_iter()), (99.0, 121.0));
        assert_eq!(extent([100.0].into_iter()), (95.0, 105.0));
    }

    #[test]
    fn a_line_ends_where_its_values_do() {
        let line = |name, values: &[Option<f64>]| WealthLine { name, values: values.to_vec(), last: "<9>".into() };
        let chart = WealthChart {
            positions: vec!["Start".into(), "<b>".into(), "Feb 26".into()],
            here: "After <i>".into(),
            lines: vec![line("You", &[Some(100.0); 3]), line("60/40", &[Some(100.0), None, Some(50.0)])],
        };
        let text = figure(&chart, false);
        for markup in ["<b>&lt;9&gt;</b>", "After &lt;i&gt;", ">&lt;b&gt;</text>"] {
            assert!(text.contains(markup), "{markup} in {text}");
        }
        assert_eq!(text.matches("<circle").count(), 3);
        let path = text.split("class=\"line s2\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        assert_eq!((path.matches('M').count(), path.matches('L').count()), (2, 0), "{path}");
    }
}
