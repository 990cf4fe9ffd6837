//! Summary figures of a measurement.

use std::time::Instant;

use ballast::numerics::statistics::summary::quantile;

pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Returns the median of some runs, in seconds.
pub fn timed(runs: usize, mut work: impl FnMut()) -> f64 {
    let seconds = |_| {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64()
    };
    median(&(0..runs.max(1)).map(seconds).collect::<Vec<f64>>())
}

/// Returns the largest resident memory of this process so far, in MB; `None` if the system does not report it.
pub fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}
