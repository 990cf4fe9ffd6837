//! Operations on a store: check it, back it up while it is written to, restore it.

use std::path::Path;
use std::process::Child;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use crate::support::patience::patience;
use crate::support::place::Place;
use crate::support::process::ballast;
use crate::support::{App, execute, specification, trained};
use ballast::store::Store;
use futures_util::future::join_all;
use serde_json::{Value, json};

const CLIENTS: usize = 6;
const HORIZON: usize = 5;
/// Periods that a client lives: one less than there are, so that every session still has an advice.
const LIVED: usize = HORIZON - 1;

/// Returns the output of a command that must succeed.
fn succeeds(arguments: &[&str]) -> String {
    let output = ballast(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Returns the complaint of a command that must fail.
fn fails(arguments: &[&str]) -> String {
    let output = ballast(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded: {}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8(output.stderr).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The real service over `app`'s folder; it ends with this.
struct Served(Child, App);

impl Served {
    fn over(folder: tempfile::TempDir, data: &str) -> Served {
        let data = folder.path().join(data);
        let (child, url) = crate::support::process::serve(|command| {
            command.arg("--data").arg(data);
        });
        Served(child, App::at(url, folder))
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One acknowledged observation: the request, its answer, and the advice after it.
struct Acknowledged {
    session: String,
    period: usize,
    request: Value,
    answer: Value,
    advice: Value,
}

/// Opens sessions and lives them through, one after the other, until told to stop.
async fn client(app: &App, number: usize, stop: &AtomicBool, count: &AtomicUsize) -> Vec<Acknowledged> {
    let mut acknowledged = Vec::new();
    for life in 0.. {
        let (status, opened) = app.post("/sessions", &json!({ "policy": app.policy })).await;
        assert_eq!(status, 201, "{opened}");
        let session = opened["session"].as_str().unwrap().to_owned();
        for period in 1..=LIVED {
            if stop.load(Ordering::SeqCst) {
                return acknowledged;
            }
            let log_return = 0.01 * ((number + 3 * life + 7 * period) % 11) as f64 - 0.04;
            let request = json!({ "session": session, "period": period, "log_return": log_return });
            let (status, answer) = app.post("/observe", &request).await;
            assert_eq!(status, 200, "{answer}");
            let (status, advice) = app.get(&format!("/action?session={session}")).await;
            assert_eq!(status, 200, "{advice}");
            acknowledged.push(Acknowledged { session: session.clone(), period, request, answer, advice });
            count.store(acknowledged.len(), Ordering::SeqCst);
        }
    }
    acknowledged
}

/// Waits until every client had `more` observations acknowledged than `before` says.
async fn until(counts: &[AtomicUsize], before: &[usize], more: usize) -> Vec<usize> {
    let now = || counts.iter().map(|count| count.load(Ordering::SeqCst)).collect::<Vec<_>>();
    let waiting = async {
        while now().iter().zip(before).any(|(now, before)| *now < before + more) {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        now()
    };
    tokio::time::timeout(patience(), waiting).await.expect("the clients go on")
}

/// The restored service has the first `before` of what was `acknowledged` and answers them alike, and where it stands at
/// any of them it advises alike. How many advices were compared.
async fn assert_holds(app: &App, acknowledged: &[Acknowledged], before: usize) -> usize {
    let mut compared = 0;
    for (number, Acknowledged { session, period, request, answer, advice }) in acknowledged.iter().enumerate() {
        let (status, found) = app.get(&format!("/sessions/{session}")).await;
        let coming = found["period"].as_u64().unwrap_or_default() as usize;
        if number < before {
            assert_eq!(status, 200, "{found}");
            assert!(coming > *period, "{session} lost period {period}: {found}");
            assert_eq!(&app.post("/observe", request).await.1, answer, "told again");
        }
        if coming == period + 1 {
            assert_eq!(&app.get(&format!("/action?session={session}")).await.1, advice);
            compared += 1;
        }
    }
    compared
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_under_load_holds_everything_acknowledged_before_it_began() {
    let mut served = Served::over(tempfile::tempdir().unwrap(), "data");
    served.1.train(&specification(HORIZON)).await;
    let app = &served.1;
    let (data, copy) = (app.folder().join("data"), app.folder().join("copy.sqlite"));
    let (stop, counts) = (AtomicBool::new(false), [const { AtomicUsize::new(0) }; CLIENTS]);
    let clients = join_all((0..CLIENTS).map(|number| client(app, number, &stop, &counts[number])));
    let operator = async {
        let before = until(&counts, &[0; CLIENTS], 3 * LIVED + 2).await;
        let arguments = ["backup".to_owned(), "--data".to_owned(), text(&data).to_owned()];
        let out = ["--out".to_owned(), text(&copy).to_owned()];
        let backup = tokio::task::spawn_blocking(move || {
            succeeds(&arguments.iter().chain(&out).map(String::as_str).collect::<Vec<_>>())
        });
        assert!(backup.await.unwrap().contains("sound, and on the disk"));
        // The service went on meanwhile, and goes on.
        until(&counts, &before, LIVED).await;
        succeeds(&["check", "--data", text(&data)]);
        stop.store(true, Ordering::SeqCst);
        before
    };
    let (lived, before) = tokio::join!(clients, operator);

    let folder = tempfile::tempdir().unwrap();
    let restored = folder.path().join("restored");
    succeeds(&["check", "--backup", text(&copy)]);
    let printed = succeeds(&["restore", "--from", text(&copy), "--data", text(&restored)]);
    assert!(printed.contains("sessions: "), "{printed}");
    let again = fails(&["restore", "--from", text(&copy), "--data", text(&restored)]);
    assert!(again.contains("ballast.sqlite") && again.contains("it exists already"), "{again}");

    let second = Served::over(folder, "restored");
    let mut compared = 0;
    for (lived, before) in lived.iter().zip(before) {
        compared += assert_holds(&second.1, lived, before).await;
    }
    // The sessions that each client had done with, and the one it was at.
    assert!(compared >= 4 * CLIENTS, "only {compared} advices could be compared");
    succeeds(&["check", "--data", text(&restored)]);
}

#[tokio::test]
async fn a_backup_replaces_nothing_and_leaves_nothing_where_it_fails() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    Store::open(&data).await.unwrap().close().await;
    std::fs::write(&out, "mine").unwrap();
    let complaint = fails(&["backup", "--data", text(&data), "--out", text(&out)]);
    assert!(complaint.contains("it exists already"), "{complaint}");
    assert_eq!(std::fs::read(&out).unwrap(), b"mine");

    let nowhere = folder.path().join("nowhere");
    fails(&["backup", "--data", text(&nowhere), "--out", text(&folder.path().join("new"))]);
    let empty = folder.path().join("empty.sqlite");
    std::fs::write(&empty, "").unwrap();
    let complaint = fails(&["restore", "--from", text(&empty), "--data", text(&folder.path().join("second"))]);
    assert!(complaint.contains("it is not a backup of a store"), "{complaint}");
    let mut left: Vec<_> =
        std::fs::read_dir(folder.path().join("second")).unwrap().map(|file| file.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["ballast.lock"]);
    assert!(!folder.path().join("new").exists() && !folder.path().join("new.partial").exists());

    // What a killed backup left stands in nobody's way, and one that runs does.
    let new = folder.path().join("new");
    for left in ["new.partial", "new.partial-journal"] {
        std::fs::write(folder.path().join(left), "left").unwrap();
    }
    let running = std::fs::File::open(folder.path().join("new.partial")).unwrap();
    running.lock().unwrap();
    let complaint = fails(&["backup", "--data", text(&data), "--out", text(&new)]);
    assert!(complaint.contains("new.partial"), "{complaint}");
    drop(running);
    succeeds(&["backup", "--data", text(&data), "--out", text(&new)]);
    assert!(!folder.path().join("new.partial").exists() && !folder.path().join("new.partial-journal").exists());
    assert_eq!(std::os::unix::fs::MetadataExt::mode(&new.metadata().unwrap()) & 0o777, 0o600);

    let hint = fails(&["backup", "--store", "postgres://u@127.0.0.1:1/x", "--out", text(&nowhere)]);
    assert!(hint.contains("pg_dump"), "{hint}");
    let hint = fails(&["restore", "--store", "postgres://u@127.0.0.1:1/x", "--from", text(&out)]);
    assert!(hint.contains("pg_restore"), "{hint}");
}

/// Each kind of damage, the statement that makes it, and what the check says.
const DAMAGES: [(&str, &str); 7] = [
    ("UPDATE policies SET json = x'7b7d'", "policy "),
    ("UPDATE jobs SET kind = 'dream'", "the kind of job"),
    ("UPDATE sessions SET initial_wealth = 1e6", "the start of session"),
    ("UPDATE entries SET content_json = '{}' WHERE entry = 2", "entry 2 of session"),
    ("DELETE FROM entries WHERE entry = 1", "entry 1 of session"),
    ("UPDATE usage SET bytes = bytes + 1", "the total of tenant"),
    ("UPDATE access_keys SET roles = 'root'", "key key_"),
];

#[tokio::test]
async fn a_check_finds_every_kind_of_damage() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    for period in 1..=2 {
        assert_eq!(app.observe(period, 0.01).await.0, 200);
    }
    app.key("north", "read").await;
    let data = text(app.folder());
    let printed = succeeds(&["check", "--data", data]);
    for line in ["policies: 1,", "jobs: 1,", "sessions: 1, with 2 entries", "keys: 1,", "sound"] {
        assert!(printed.contains(line), "{printed}");
    }
    let copies = tempfile::tempdir().unwrap();
    let references = ("DELETE FROM policies", "a reference from");
    let newer = ("UPDATE _sqlx_migrations SET version = 9999 WHERE version = 1", "newer than");
    let older =
        ("DELETE FROM _sqlx_migrations WHERE version = (SELECT max(version) FROM _sqlx_migrations)", "older than");
    for (number, (statement, complaint)) in DAMAGES.into_iter().chain([references, newer, older]).enumerate() {
        let folder = copies.path().join(number.to_string());
        let file = folder.join("ballast.sqlite");
        std::fs::create_dir(&folder).unwrap();
        succeeds(&["backup", "--data", data, "--out", text(&file)]);
        Place::break_references(&file, statement).await;
        let output = fails(&["check", "--data", text(&folder)]);
        assert!(output.contains(complaint), "{statement}: {output}");
        let output = fails(&["backup", "--data", text(&folder), "--out", text(&copies.path().join("out"))]);
        assert!(output.contains(complaint), "{statement}: {output}");
    }
    assert!(!copies.path().join("out").exists());
}

#[tokio::test]
async fn a_check_finds_a_torn_file() {
    let app = App::start().await;
    execute(app.folder(), "PRAGMA wal_checkpoint(TRUNCATE)").await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ballast.sqlite");
    succeeds(&["backup", "--data", text(app.folder()), "--out", text(&file)]);
    let sound = std::fs::read(&file).unwrap();
    const PAGE: usize = 8192;
    // A page in the middle is lost, then the first, then half the file.
    let middle = sound.len() / 2 / PAGE * PAGE;
    let torn = [
        [&sound[..middle], &[0xa5; PAGE], &sound[middle + PAGE..]].concat(),
        [&[0; PAGE], &sound[PAGE..]].concat(),
        sound[..middle].to_vec(),
    ];
    for torn in torn {
        std::fs::write(&file, torn).unwrap();
        let output = fails(&["check", "--data", text(folder.path())]);
        assert!(output.contains("the database") && output.contains("is damaged"), "{output}");
    }
}

#[tokio::test]
async fn a_database_is_checked_beside_its_replicas() {
    let Some(place) = Place::database().await else { return };
    let Place::Database(url) = &place else { unreachable!("a database") };
    let store = place.open().await;
    let json = trained(&specification(1));
    let policy = ballast::control::policy::content_hash(&json);
    assert!(store.insert_policy(&Default::default(), &policy, &json, 1).await.unwrap());
    let printed = succeeds(&["check", "--store", url]);
    assert!(printed.contains("policies: 1,") && printed.contains("sound"), "{printed}");
    place.tamper("UPDATE policies SET json = decode('7b7d', 'hex')").await;
    let output = fails(&["check", "--store", url]);
    assert!(output.contains(&format!("policy {policy} is damaged")), "{output}");
}
