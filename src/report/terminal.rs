//! The end of a program that prints to a terminal or a pipe.

use std::error::Error;

/// Exit code that a shell reports for a program whose output is no longer read.
const NOBODY_READS: i32 = 141;

/// Installs a panic hook that ends the process silently if nothing reads its output any more: `head` stops once it has
/// read enough. Other panics are reported as usual.
pub fn end_where_nobody_reads() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let message = panic.payload_as_str().unwrap_or_default();
        if message.starts_with("failed printing to stdout") && message.contains("Broken pipe") {
            std::process::exit(NOBODY_READS);
        }
        tell(panic);
    }));
}

/// Formats an error and its causes on one line.
pub fn with_causes(error: &dyn Error) -> String {
    let causes = std::iter::successors(error.source(), |&cause| cause.source());
    causes.fold(error.to_string(), |line, cause| format!("{line}: {cause}"))
}
