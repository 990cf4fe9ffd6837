//! Marks on a plane: lines, bands, points and histograms, in any combination.

use super::axis::{Axis, Scale};
use super::drawing::{ChartError, Draw, Drawing, LegendEntry, MOST_SERIES, WIDTH, canvas, horizontal_axis, range_of};
use super::histogram::shared_bins;
use super::markup::Element;

const HEIGHT: f64 = 380.0;
const LEFT: f64 = 92.0;
const RIGHT: f64 = WIDTH - 36.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = HEIGHT - 64.0;

/// Marks over two axes. Marks of one name share a colour and an entry of the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    title: String,
    x: Axis,
    y: Axis,
    marks: Vec<Mark>,
}

#[derive(Debug, Clone, PartialEq)]
struct Mark {
    name: String,
    shape: Shape,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Line(Vec<(f64, f64)>),
    Points(Vec<(f64, f64)>),
    Band(Vec<(f64, [f64; 2])>),
    /// Heights over equal bins from `first` on.
    Bins {
        first: f64,
        width: f64,
        heights: Vec<f64>,
    },
}

impl Chart {
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Chart { title: title.into(), x, y, marks: Vec::new() }
    }

    /// Samples as histograms over shared bins: the share of each sample in a bin, in per cent.
    /// Samples that cannot be drawn are refused when the chart is.
    pub fn histograms(title: &str, axis_title: &str, samples: &[(&str, &[f64])]) -> Self {
        let chart = Chart::new(title, Axis::new(axis_title), Axis::new("share, %").from_zero());
        match shared_bins(samples) {
            Some((first, width, counted)) => samples
                .iter()
                .zip(counted)
                .fold(chart, |chart, ((name, _), heights)| chart.mark(name, Shape::Bins { first, width, heights })),
            None => samples
                .iter()
                .fold(chart, |chart, (name, sample)| chart.scatter(name, sample.iter().map(|&value| (value, 0.0)))),
        }
    }

    pub fn line(self, name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.mark(name, Shape::Line(points.into_iter().collect()))
    }

    pub fn scatter(self, name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.mark(name, Shape::Points(points.into_iter().collect()))
    }

    /// The area between a low and a high value at each x.
    pub fn band(self, name: &str, points: impl IntoIterator<Item = (f64, [f64; 2])>) -> Self {
        self.mark(name, Shape::Band(points.into_iter().collect()))
    }

    fn mark(mut self, name: &str, shape: Shape) -> Self {
        self.marks.push(Mark { name: name.into(), shape });
        self
    }

    /// Names in the order in which they first appear.
    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for mark in &self.marks {
            if !names.contains(&mark.name) {
                names.push(mark.name.clone());
            }
        }
        names
    }

    fn entry(&self, name: &str) -> LegendEntry {
        let mut marks = self.marks.iter().filter(|mark| mark.name == name);
        LegendEntry { name: name.into(), dotted: marks.all(|mark| matches!(mark.shape, Shape::Points(_))) }
    }

    fn scales(&self) -> Result<(Scale, Scale), ChartError> {
        let of = |part: fn(&Shape) -> Vec<f64>, logarithmic| {
            let values = |mark: &Mark| part(&mark.shape).into_iter().map(|value| (mark.name.clone(), value)).collect();
            range_of(&self.title, self.marks.iter().flat_map(|mark| -> Vec<_> { values(mark) }), logarithmic)
        };
        let [left, right] = of(Shape::xs, self.x.logarithmic)?;
        let [low, high] = of(Shape::ys, self.y.logarithmic)?;
        Ok((self.x.scale(left, right, LEFT, RIGHT), self.y.scale(low, high, BOTTOM, TOP)))
    }

    fn description(&self, x: &Scale, y: &Scale) -> String {
        let axis = |axis: &Axis, scale: &Scale| {
            let ticks = &scale.ticks;
            format!("{} from {} to {}", axis.title, ticks.label(ticks.low()), ticks.label(ticks.high()))
        };
        format!("{} against {}: {}.", axis(&self.y, y), axis(&self.x, x), self.names().join(", "))
    }
}

impl Draw for Chart {
    fn draw(&self) -> Result<Drawing, ChartError> {
        let names = self.names();
        if names.len() > MOST_SERIES {
            return Err(ChartError::TooMany { chart: self.title.clone(), found: names.len() });
        }
        let (x, y) = self.scales()?;
        let marks = self.marks.iter().map(|mark| {
            let index = names.iter().position(|name| *name == mark.name).unwrap_or(0);
            mark.shape.draw(&x, &y).class(format_args!("s{index} {}", mark.shape.class()))
        });
        let svg = canvas(&self.title, &self.description(&x, &y), HEIGHT)
            .child(horizontal_axis(&x, &self.x.title, [LEFT, RIGHT], [TOP, BOTTOM]))
            .child(vertical_axis(&y, &self.y.title))
            .children(marks);
        let legend = names.iter().map(|name| self.entry(name)).collect();
        Ok(Drawing { title: self.title.clone(), legend, svg })
    }
}

/// Ticks with their grid lines, and the title above them, where it can be read without turning the head.
fn vertical_axis(scale: &Scale, title: &str) -> Element {
    let tick = |(y, label): (f64, String)| {
        let grid = Element::new("line").at("x1", LEFT).at("x2", RIGHT).at("y1", y).at("y2", y).class("grid");
        [grid, Element::new("text").at("x", LEFT - 8.0).at("y", y + 5.0).class("y").text(label)]
    };
    let title = Element::new("text").at("x", 2.0).at("y", 18.0).text(title);
    Element::new("g").children(scale.marks().flat_map(tick)).child(title)
}

impl Shape {
    fn xs(&self) -> Vec<f64> {
        match self {
            Shape::Line(points) | Shape::Points(points) => points.iter().map(|point| point.0).collect(),
            Shape::Band(points) => points.iter().map(|point| point.0).collect(),
            Shape::Bins { first, width, heights } => vec![*first, first + width * heights.len() as f64],
        }
    }

    fn ys(&self) -> Vec<f64> {
        match self {
            Shape::Line(points) | Shape::Points(points) => points.iter().map(|point| point.1).collect(),
            Shape::Band(points) => points.iter().flat_map(|point| point.1).collect(),
            Shape::Bins { heights, .. } => heights.clone(),
        }
    }

    fn class(&self) -> &'static str {
        match self {
            Shape::Line(_) => "line",
            Shape::Points(_) => "points",
            Shape::Band(_) => "band",
            Shape::Bins { .. } => "bins",
        }
    }

    fn draw(&self, x: &Scale, y: &Scale) -> Element {
        let place = |&(along, up): &(f64, f64)| (x.at(along), y.at(up));
        match self {
            Shape::Line(points) => path(points.iter().map(place), ""),
            Shape::Points(points) => {
                let dot = |(cx, cy)| Element::new("circle").at("cx", cx).at("cy", cy).with("r", 3);
                Element::new("g").children(points.iter().map(place).map(dot))
            }
            Shape::Band(points) => {
                let upper = points.iter().map(|&(along, [_, high])| (along, high));
                let lower = points.iter().rev().map(|&(along, [low, _])| (along, low));
                let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
                path(outline.iter().map(place), "Z")
            }
            Shape::Bins { first, width, heights } => {
                let edge = |index: usize| first + width * index as f64;
                let tops = heights.iter().enumerate();
                let steps = tops.flat_map(|(index, &height)| [(edge(index), height), (edge(index + 1), height)]);
                let outline: Vec<(f64, f64)> =
                    [(edge(0), 0.0)].into_iter().chain(steps).chain([(edge(heights.len()), 0.0)]).collect();
                path(outline.iter().map(place), "")
            }
        }
    }
}

/// Straight lines from place to place.
fn path(places: impl Iterator<Item = (f64, f64)>, end: &str) -> Element {
    let legs: Vec<String> = places.map(|(x, y)| format!("{x:.2} {y:.2}")).collect();
    Element::new("path").with("d", format_args!("M{}{end}", legs.join("L")))
}

#[cfg(test)]
mod tests {
    use super::super::well_formed::check;
    use super::*;

    fn plain() -> Chart {
        Chart::new("Wealth & <more>", Axis::new("month"), Axis::new("wealth"))
    }

    #[test]
    fn charts_are_well_formed_and_say_what_they_show() {
        let chart = plain()
            .line("a \"quoted\" <name>", [(0.0, 1.0), (1.0, 2.0)])
            .band("b", [(0.0, [0.5, 1.5]), (1.0, [1.0, 3.0])])
            .scatter("a \"quoted\" <name>", [(0.5, 1.0)])
            .scatter("c", [(0.5, 1.0)]);
        let drawing = chart.draw().unwrap();
        let elements = check(&drawing.svg()).unwrap();
        assert!(elements.contains(&"title".to_owned()) && elements.contains(&"desc".to_owned()), "{elements:?}");
        assert_eq!(elements.iter().filter(|name| *name == "circle").count(), 2);
        let legend: Vec<_> = drawing.legend.iter().map(|entry| (entry.name.as_str(), entry.dotted)).collect();
        assert_eq!(legend, [("a \"quoted\" <name>", false), ("b", false), ("c", true)]);
        assert!(drawing.svg().contains("wealth from 0.5 to 3.0 against month from 0.0 to 1.0"), "{}", drawing.svg());
    }

    #[test]
    fn histograms_share_their_bins_and_their_shares_sum_to_a_hundred() {
        let spread: Vec<f64> = (0..1000).map(|index| f64::from(index) / 100.0).collect();
        let samples: [(&str, &[f64]); 2] = [("constant", &[3.0; 7]), ("spread", &spread)];
        let chart = Chart::histograms("H", "wealth", &samples);
        for mark in &chart.marks {
            let Shape::Bins { heights, .. } = &mark.shape else { panic!("{mark:?}") };
            assert!((heights.iter().sum::<f64>() - 100.0).abs() < 1e-9, "{mark:?}");
        }
        check(&chart.draw().unwrap().svg()).unwrap();
    }

    #[test]
    fn degenerate_data_are_drawn_or_refused_but_never_drawn_wrong() {
        let drawn = |points: &[(f64, f64)]| plain().line("a", points.iter().copied()).draw();
        for points in [&[(0.0, 0.0)][..], &[(1.0, 5.0), (2.0, 5.0)], &[(3.0, 1e16), (3.0, 1e16 + 2.0)]] {
            let svg = drawn(points).unwrap().svg();
            check(&svg).unwrap();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
        assert!(matches!(drawn(&[]), Err(ChartError::Empty { .. })));
        assert!(matches!(plain().draw(), Err(ChartError::Empty { .. })));
        assert!(matches!(drawn(&[(0.0, f64::NAN)]), Err(ChartError::NotFinite { .. })));
        assert!(matches!(drawn(&[(f64::INFINITY, 0.0)]), Err(ChartError::NotFinite { .. })));
        let log = Chart::new("L", Axis::new("x"), Axis::new("y").log()).line("a", [(0.0, 0.0)]);
        assert!(matches!(log.draw(), Err(ChartError::NotPositive { value: 0.0, .. })));
        let nine = (0..9).fold(plain(), |chart, index| chart.line(&format!("{index}"), [(0.0, 1.0)]));
        assert!(matches!(nine.draw(), Err(ChartError::TooMany { found: 9, .. })));
        for sample in [&[][..], &[f64::NAN, 1.0]] {
            assert!(Chart::histograms("H", "x", &[("a", sample)]).draw().is_err());
        }
    }
}
