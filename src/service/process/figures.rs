//! Figures of the system about this process, under the names that Prometheus' own clients use. On systems other than
//! Linux only the start time is reported.

use std::fs;
use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use metrics::{Unit, counter, describe_counter, describe_gauge, gauge};

const START: &str = "process_start_time_seconds";
const RESIDENT: &str = "process_resident_memory_bytes";
const PROCESSOR: &str = "process_cpu_seconds_total";
const THREADS: &str = "process_threads";
const OPEN: &str = "process_open_fds";
const MOST: &str = "process_max_fds";

/// Clock ticks a second in `/proc`, independent of the kernel's own: part of its interface to programs.
const TICKS: u64 = 100;

/// Describes the figures to the recorder. The process counts as started at the first call.
pub fn describe() {
    describe_gauge!(START, Unit::Seconds, "When the process started, in seconds since 1970.");
    describe_gauge!(RESIDENT, Unit::Bytes, "Resident memory of the process.");
    describe_counter!(PROCESSOR, Unit::Seconds, "Processor time used.");
    describe_gauge!(THREADS, "Threads of the process.");
    describe_gauge!(OPEN, "Files and sockets open.");
    describe_gauge!(MOST, "Most files and sockets that can be open.");
    static STARTED: OnceLock<f64> = OnceLock::new();
    let now = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    gauge!(START).set(*STARTED.get_or_init(now));
}

/// Records the present figures.
pub fn record() {
    if let Some(kilobytes) = status("VmRSS:") {
        gauge!(RESIDENT).set(kilobytes as f64 * 1024.0);
    }
    if let Some(threads) = status("Threads:") {
        gauge!(THREADS).set(threads as f64);
    }
    if let Some(ticks) = processor_ticks() {
        counter!(PROCESSOR).absolute(ticks / TICKS);
    }
    if let Ok(open) = fs::read_dir("/proc/self/fd") {
        // The directory itself is open while it is read.
        gauge!(OPEN).set(open.count().saturating_sub(1) as f64);
    }
    if let Some(most) = descriptors() {
        gauge!(MOST).set(most as f64);
    }
}

/// Returns how many files and sockets this process may open.
pub fn descriptors() -> Option<usize> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}

fn status(name: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// Returns the sum of fields 14 and 15, user and system time; the second field, in brackets, may hold anything.
fn processor_ticks() -> Option<u64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = stat.rsplit_once(')')?.1;
    let ticks = after_name.split_whitespace().skip(11).take(2).map(str::parse::<u64>);
    ticks.sum::<Result<_, _>>().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_system_tells() {
        assert!(status("VmRSS:").unwrap() > 1000 && status("Threads:").unwrap() >= 1);
        assert!(descriptors().unwrap() > 3);
        let before = processor_ticks().unwrap();
        while processor_ticks().unwrap() == before {
            std::hint::spin_loop();
        }
    }
}
