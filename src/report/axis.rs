//! What an axis says, and where on the drawing a value of it lies.

use super::ticks::{Ticks, linear, logarithmic};

/// An axis: its title, with the unit, and how values run along it.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(super) title: String,
    pub(super) logarithmic: bool,
    from_zero: bool,
    tight: bool,
}

impl Axis {
    pub fn new(title: &str) -> Self {
        Axis { title: title.into(), logarithmic: false, from_zero: false, tight: false }
    }

    /// Equal ratios take equal room; every value must be above 0.
    pub fn log(self) -> Self {
        Axis { logarithmic: true, from_zero: false, ..self }
    }

    /// Shows zero, wherever the data lie; a logarithmic axis, which has none, becomes a plain one.
    pub fn from_zero(self) -> Self {
        Axis { from_zero: true, logarithmic: false, ..self }
    }

    /// Ends where the data end, not at the tick beyond: for time.
    pub fn tight(self) -> Self {
        Axis { tight: true, ..self }
    }

    /// Lays data between `low` and `high` out from `start` to `end` on the drawing.
    pub(super) fn scale(&self, low: f64, high: f64, start: f64, end: f64) -> Scale {
        let (low, high) = if self.from_zero { (low.min(0.0), high.max(0.0)) } else { (low, high) };
        let mut ticks = if self.logarithmic { logarithmic(low, high) } else { linear(low, high) };
        let (mut first, mut last) = (ticks.low(), ticks.high());
        if self.tight && low < high {
            (first, last) = (low, high);
            ticks.values.retain(|value| (low..=high).contains(value));
        }
        Scale { ticks, logarithmic: self.logarithmic, first, last, start, end }
    }
}

/// An axis laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    pub ticks: Ticks,
    logarithmic: bool,
    first: f64,
    last: f64,
    start: f64,
    end: f64,
}

impl Scale {
    pub fn at(&self, value: f64) -> f64 {
        let [value, first, last] =
            [value, self.first, self.last].map(|number| if self.logarithmic { number.ln() } else { number });
        self.start + (self.end - self.start) * (value - first) / (last - first)
    }

    /// Every tick as its place and its label.
    pub fn marks(&self) -> impl Iterator<Item = (f64, String)> {
        self.ticks.values.iter().map(|&value| (self.at(value), self.ticks.label(value)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_where_the_axis_says() {
        let plain = Axis::new("wealth").from_zero().scale(40.0, 100.0, 0.0, 200.0);
        assert_eq!((plain.at(0.0), plain.at(50.0), plain.at(100.0)), (0.0, 100.0, 200.0));
        let log = Axis::new("wealth").log().scale(1.0, 1e4, 0.0, 4.0);
        assert!((log.at(100.0) - 2.0).abs() < 1e-12, "{log:?}");
        let tight = Axis::new("year").tight().scale(1946.0, 2018.0, 0.0, 72.0);
        assert_eq!((tight.at(1960.0), tight.ticks.values.first()), (14.0, Some(&1960.0)));
    }
}
