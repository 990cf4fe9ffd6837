//! The measurements, as a table and as JSON.

use std::fmt;

use serde::Serialize;

use super::load::Load;

#[derive(Debug, Default, Serialize)]
pub struct LoadReport {
    figures: Vec<LoadFigure>,
    notes: Vec<String>,
}

/// One line of the table.
#[derive(Debug, Serialize)]
struct LoadFigure {
    what: String,
    /// Rate per second.
    rate: Option<f64>,
    p50_ms: Option<f64>,
    p99_ms: Option<f64>,
    max_ms: Option<f64>,
    /// Microseconds of the service's processors per operation.
    processor_us: Option<f64>,
    bounds: Vec<LoadBound>,
}

#[derive(Debug, Serialize)]
pub struct LoadBound {
    rule: String,
    met: bool,
}

impl LoadBound {
    pub fn at_least(value: f64, bound: f64, unit: &str) -> Self {
        LoadBound { rule: format!("at least {bound} {unit}"), met: value >= bound }
    }

    pub fn below(value: f64, bound: f64, unit: &str) -> Self {
        LoadBound { rule: format!("below {bound} {unit}"), met: value < bound }
    }
}

/// Bounds that a load must keep.
#[derive(Debug, Clone, Copy, Default)]
pub struct Must {
    pub rate: Option<f64>,
    pub p99_ms: Option<f64>,
}

impl LoadReport {
    pub fn load(&mut self, what: impl Into<String>, load: &Load, must: Must) {
        let [p50, p99, max] = load.latency([0.5, 0.99, 1.0]);
        let rate = must.rate.map(|bound| LoadBound::at_least(load.rate(), bound, "a second"));
        let latency = must.p99_ms.map(|bound| LoadBound::below(p99, bound, "ms p99"));
        self.figures.push(LoadFigure {
            what: what.into(),
            rate: Some(load.rate()),
            p50_ms: Some(p50),
            p99_ms: Some(p99),
            max_ms: Some(max),
            processor_us: load.processor_us(),
            bounds: rate.into_iter().chain(latency).collect(),
        });
    }

    /// Adds the rate of something, per second.
    pub fn rate(&mut self, what: impl Into<String>, rate: f64) {
        self.line(what, Some(rate), Vec::new());
    }

    /// Adds a figure whose text its bound refers to.
    pub fn bounded(&mut self, what: impl Into<String>, bound: LoadBound) {
        self.line(what, None, vec![bound]);
    }

    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    fn line(&mut self, what: impl Into<String>, rate: Option<f64>, bounds: Vec<LoadBound>) {
        let (p50_ms, p99_ms, max_ms, processor_us) = (None, None, None, None);
        self.figures.push(LoadFigure { what: what.into(), rate, p50_ms, p99_ms, max_ms, processor_us, bounds });
    }
}

impl fmt::Display for LoadReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:<56}{:>10}", "", "a second")?;
        ["p50 ms", "p99 ms", "max ms", "CPU us"].iter().try_for_each(|title| write!(out, "{title:>9}"))?;
        writeln!(out, "  bound")?;
        for figure in &self.figures {
            let number = |value: Option<f64>, digits| value.map_or(String::new(), |found| format!("{found:.digits$}"));
            write!(out, "{:<56}{:>10}", figure.what, number(figure.rate, 0))?;
            for milliseconds in [figure.p50_ms, figure.p99_ms, figure.max_ms] {
                write!(out, "{:>9}", number(milliseconds, 2))?;
            }
            write!(out, "{:>9}", number(figure.processor_us, 0))?;
            let met = |bound: &LoadBound| format!("{}: {}", bound.rule, if bound.met { "met" } else { "NOT MET" });
            let bounds: Vec<String> = figure.bounds.iter().map(met).collect();
            writeln!(out, "  {}", bounds.join("; "))?;
        }
        self.notes.iter().try_for_each(|note| writeln!(out, "{note}"))
    }
}
