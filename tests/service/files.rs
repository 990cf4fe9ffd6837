//! The files of a folder that is served: what becomes of the service once they are others.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::support::patience::{assert_within, patience, until};
use crate::support::process::{self, Process};
use crate::support::{App, specification};
use ballast::store::{Damage, Store, backup};
use tempfile::TempDir;

/// The exit code of a process whose store failed.
const STORE_FAILED: i32 = 74;

struct Served(Process, App);

impl Served {
    fn new() -> Served {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let (child, url) = process::serve(|command| {
            command.arg("--data").arg(data);
        });
        Served(Process(child), App::at(url, folder))
    }

    fn file(&self, name: &str) -> PathBuf {
        self.1.folder().join("data").join(name)
    }

    async fn ended(&mut self) -> Option<i32> {
        let child = &mut self.0.0;
        until("the end of the process", async || child.try_wait().unwrap()).await.code()
    }
}

fn moved(file: &Path) {
    std::fs::rename(file, file.with_extension("moved")).unwrap();
}

fn removed(file: &Path) {
    std::fs::remove_file(file).unwrap();
}

/// Another file has its name.
fn replaced(file: &Path) {
    let copy = file.with_extension("copy");
    std::fs::copy(file, &copy).unwrap();
    std::fs::rename(copy, file).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_is_another_ends_the_service_before_it_acknowledges_more() {
    type Change = fn(&Path);
    let changes: [(&str, Change); 6] = [
        ("ballast.sqlite", moved),
        ("ballast.sqlite", removed),
        ("ballast.sqlite", replaced),
        ("ballast.lock", moved),
        ("ballast.lock", removed),
        ("ballast.lock", replaced),
    ];
    for (name, change) in changes {
        let mut served = Served::new();
        served.1.train(&specification(2)).await;
        served.1.open().await;
        assert_eq!(served.1.observe(1, 0.01).await.0, 200);
        let file = served.file(name);
        change(&file);
        let changed = Instant::now();
        let request = serde_json::json!({ "session": served.1.session, "period": 2, "log_return": 0.01 });
        let report = served.1.client.post(format!("{}/observe", served.1.url)).json(&request).send().await;
        let status = report.map(|answer| answer.status().as_u16());
        assert!(!matches!(status, Ok(200)), "{name} was changed and a report acknowledged: {status:?}");
        assert_eq!(served.ended().await, Some(STORE_FAILED), "{name}");
        assert_within(Duration::from_secs(2), changed, "the end");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_is_another_ends_a_service_that_nobody_asks() {
    let mut served = Served::new();
    removed(&served.file("ballast.sqlite"));
    let changed = Instant::now();
    assert_eq!(served.ended().await, Some(STORE_FAILED));
    assert_within(Duration::from_secs(2), changed, "the end");
}

/// The file keeps its name and number, and has another's content.
#[tokio::test(flavor = "multi_thread")]
async fn a_backup_copied_over_the_database_ends_the_service() {
    let mut served = Served::new();
    let copy = served.1.folder().join("copy.sqlite");
    backup(&served.1.folder().join("data"), &copy, Damage::Refused, &mut |_| {}).await.unwrap();
    std::fs::write(served.file("ballast.sqlite"), std::fs::read(copy).unwrap()).unwrap();
    assert_eq!(served.ended().await, Some(STORE_FAILED));
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_else_reads_the_files() {
    let served = Served::new();
    assert_eq!(served.1.get("/sessions").await.0, 200);
    let files: Vec<_> = std::fs::read_dir(served.file("")).unwrap().map(Result::unwrap).collect();
    assert!(files.len() >= 3, "{files:?}");
    for file in files {
        let mode = std::os::unix::fs::MetadataExt::mode(&file.metadata().unwrap());
        assert_eq!(mode & 0o077, 0, "{file:?} has mode {mode:o}");
    }
}

/// The exit code of a service that may not have `data`, and what it said.
fn refused(data: &Path) -> (Option<i32>, String) {
    let served = process::try_serve(|command| {
        command.arg("--data").arg(data).env_remove("BALLAST_STORE").stderr(Stdio::piped());
    });
    match served {
        Ok((child, _)) => {
            drop(Process(child));
            panic!("{} is served twice", data.display());
        }
        Err((child, _)) => {
            let output = child.wait_with_output().unwrap();
            (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn two_services_never_have_one_folder() {
    let mut served = Served::new();
    let data = served.1.folder().join("data");
    let lock = served.file("ballast.lock");
    // Stopped, the first does not see that its lock is gone.
    let pid = rustix::process::Pid::from_child(&served.0.0);
    rustix::process::kill_process(pid, rustix::process::Signal::STOP).unwrap();
    // A signal is answered a little later, and a first that looked until then would give the folder up.
    let stopped = rustix::process::waitpid(Some(pid), rustix::process::WaitOptions::UNTRACED).unwrap();
    assert!(stopped.is_some_and(|(_, status)| status.stopped()));
    removed(&lock);
    let (code, stderr) = refused(&data);
    assert!(code == Some(1) && stderr.contains("ballast.sqlite is locked by another process"), "{code:?}: {stderr}");
    rustix::process::kill_process(pid, rustix::process::Signal::CONT).unwrap();
    assert_eq!(served.ended().await, Some(STORE_FAILED));
}

fn ballast(arguments: &[&str], data: &Path) -> (Option<i32>, String) {
    let output = process::ballast(&[arguments, &["--data", data.to_str().unwrap()]].concat());
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_that_had_keys_is_not_served_without() {
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    let serve = ["serve", "--listen", "127.0.0.1:0"];
    let (code, stderr) = ballast(&[&serve[..], &["--require-keys"]].concat(), &data);
    assert!(code == Some(1) && stderr.contains("--require-keys") && stderr.contains("ballast keys create"), "{stderr}");
    for wrong in [&["keys", "create", "--role", "admin"][..], &["keys", "list"], &["audit"]] {
        let (code, stderr) = ballast(wrong, &data.join("wrong"));
        assert!(code == Some(1) && stderr.contains("ballast.sqlite"), "{stderr}");
        assert!(!data.join("wrong").exists(), "{wrong:?} makes nothing");
    }
    let new = ["keys", "create", "--role", "admin", "--new"];
    assert_eq!(ballast(&new, &data).0, Some(0));
    // The database is lost, and one without keys made in its place.
    for file in ["ballast.sqlite", "ballast.sqlite-wal", "ballast.sqlite-shm"] {
        let _ = std::fs::remove_file(data.join(file));
    }
    let (code, stderr) = ballast(&serve, &data);
    assert!(code == Some(1) && stderr.contains("ballast.keys says that the store had keys"), "{stderr}");
    assert_eq!(ballast(&new, &data).0, Some(0));
    let (child, url) = process::serve(|command| {
        command.args(["--require-keys", "--data"]).arg(&data);
    });
    let served = Served(Process(child), App::at(url, folder));
    assert_eq!(served.1.get("/jobs").await.0, 401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_that_is_open_says_so_in_its_log() {
    let folder = TempDir::new().unwrap();
    let log = folder.path().join("log");
    let file = std::fs::File::create(&log).unwrap();
    let data = folder.path().join("data");
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(data).stderr(file);
    });
    let _served = Served(Process(child), App::at(url, folder));
    let logged = std::fs::read_to_string(log).unwrap();
    assert!(logged.contains("WARN") && logged.contains("holds no key: every caller is answered"), "{logged}");
}

/// Whoever closes a folder leaves it to the next.
#[tokio::test(flavor = "multi_thread")]
async fn a_folder_that_was_closed_opens_again() {
    let folder = TempDir::new().unwrap();
    for _ in 0..3 {
        let store = tokio::time::timeout(patience(), Store::open(folder.path())).await.unwrap().unwrap();
        assert!(Store::open(folder.path()).await.is_err());
        store.close().await;
    }
}
