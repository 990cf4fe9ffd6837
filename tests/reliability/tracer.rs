//! strace on a running server, to answer its system calls in the kernel's place.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// An attached strace; detached when dropped, which leaves the server as it is.
pub struct Tracer(Child);

impl Tracer {
    /// Does `what` to the fsyncs of process `pid` (`strace -e inject=`). `None` where there is no strace, or it may not.
    pub fn of_fsync(pid: &str, what: &str) -> Option<Tracer> {
        let inject = format!("inject=fsync,fdatasync:{what}");
        let mut command = Command::new("strace");
        command.args(["-f", "-p", pid, "-o", "/dev/null", "-e", "trace=fsync,fdatasync", "-e", &inject]);
        let mut child = command.stderr(Stdio::piped()).spawn().ok()?;
        let mut lines = BufReader::new(child.stderr.take()?).lines().map_while(Result::ok);
        let attached = lines.any(|line| line.contains("attached"));
        // What it says later must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let tracer = Tracer(child);
        attached.then_some(tracer)
    }
}

impl Drop for Tracer {
    fn drop(&mut self) {
        // SIGTERM lets it detach in order; of a tracee that has ended it has ended itself.
        let _ = Command::new("kill").arg(self.0.id().to_string()).stderr(Stdio::null()).status();
        let _ = self.0.wait();
    }
}
