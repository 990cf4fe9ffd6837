//! File systems made for a trial: a small one in memory, and one on a loop device whose power can be cut.

use std::fs::File;
use std::io::Write;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;

/// A mounted file system; unmounted when dropped.
pub struct Mount {
    folder: TempDir,
    image: Option<PathBuf>,
}

impl Mount {
    /// So many megabytes of memory. `None` where this process may not mount.
    pub fn in_memory(megabytes: usize) -> Option<Mount> {
        let folder = tempfile::tempdir().unwrap();
        let size = format!("size={megabytes}m");
        let mounted = run(Command::new("mount").args(["-t", "tmpfs", "-o", &size, "ballast-test"]).arg(folder.path()));
        mounted.then_some(Mount { folder, image: None })
    }

    /// An ext4 of so many megabytes in a file. `None` where this process may not mount or there is no loop device.
    pub fn on_loop(megabytes: u64) -> Option<Mount> {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("image");
        File::create(&image).unwrap().set_len(megabytes << 20).unwrap();
        std::fs::create_dir(folder.path().join("mount")).unwrap();
        let mount = Mount { folder, image: Some(image.clone()) };
        let made = run(Command::new("mkfs.ext4").args(["-q", "-F"]).arg(image)) && mount.again();
        made.then_some(mount)
    }

    pub fn path(&self) -> PathBuf {
        match self.image {
            Some(_) => self.folder.path().join("mount"),
            None => self.folder.path().to_owned(),
        }
    }

    /// Cuts the power: what the journal does not have yet is gone, and every call fails from now on.
    pub fn cut(&self) {
        const EXT4_IOC_SHUTDOWN: libc::c_ulong = 0x8004_587d;
        const NO_LOG_FLUSH: u32 = 2;
        let root = File::open(self.path()).unwrap();
        let flags = NO_LOG_FLUSH;
        // SAFETY: the descriptor is open and the call reads one u32.
        #[expect(unsafe_code, reason = "an ioctl of this file system alone")]
        let done = unsafe { libc::ioctl(root.as_raw_fd(), EXT4_IOC_SHUTDOWN, &raw const flags) };
        assert_eq!(done, 0, "{}", std::io::Error::last_os_error());
    }

    /// Brings the power back. The caller has ended whoever had files open.
    pub fn restore(&self) -> Result<(), String> {
        if unmount(&self.path()) && self.again() { Ok(()) } else { Err("the file system does not mount again".into()) }
    }

    fn again(&self) -> bool {
        let image = self.image.as_ref().expect("on a loop device");
        run(Command::new("mount").args(["-o", "loop"]).arg(image).arg(self.path()))
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        unmount(&self.path());
    }
}

fn unmount(path: &Path) -> bool {
    run(Command::new("umount").arg(path))
}

fn run(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Says that a row is left out. `BALLAST_RELIABILITY=required` makes that a failure.
pub fn skip<T>(reason: &str) -> Result<Option<T>, String> {
    if std::env::var("BALLAST_RELIABILITY").is_ok_and(|value| value == "required") {
        return Err(reason.into());
    }
    let _ = writeln!(std::io::stderr(), "SKIPPED: a fault cannot be made here: {reason}");
    Ok(None)
}
