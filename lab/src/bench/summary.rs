//! Summary figures of a measurement.

use ballast::numerics::statistics::summary::quantile;

pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Returns the largest resident memory of this process so far, in MB; `None` if the system does not report it.
pub fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}
