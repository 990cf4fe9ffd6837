//! A PostgreSQL server for tests, with a database for each.
//!
//! Uses `TEST_POSTGRES_URL` if set; else a private cluster in a temporary folder, made by the installed `initdb` and
//! deleted when this process ends, however it ends. Without either, a test prints that it was skipped and passes,
//! unless `BALLAST_TEST_POSTGRES` is `required`.

use std::io::{BufRead, BufReader, Lines, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock};

use sqlx::postgres::PgConnection;
use sqlx::{AssertSqlSafe, Connection};

/// A script that runs as the owner of the cluster until its input ends, which happens when this process ends.
const KEEPER: &str = r#"
    set -eu
    # An interrupt reaches the whole group; the end of the input still ends this.
    trap '' INT HUP
    folder=$(mktemp -d "${TMPDIR:-/tmp}/ballast-postgres.XXXXXX")
    cd "$folder"
    trap '"$BIN/pg_ctl" -D data -m immediate stop >>log 2>&1 || true; cd /; rm -rf "$folder"' EXIT
    start() { "$BIN/pg_ctl" -D data -w -l log -o "-p $PORT -k $folder -c listen_addresses=127.0.0.1" start >>log 2>&1; }
    "$BIN/initdb" -D data -U ballast -A trust -E UTF8 --locale=C --no-sync >>log 2>&1 || { cat log >&2; exit 1; }
    if [ -n "${CERTIFICATE:-}" ]; then
        printf '%s' "$CERTIFICATE" >data/server.crt
        (umask 077; printf '%s' "$PRIVATE_KEY" >data/server.key)
        echo "ssl = on" >>data/postgresql.conf
        # Who comes without encryption is turned away.
        sed -i 's/^host /hostssl /' data/pg_hba.conf
    fi
    start || { cat log >&2; exit 1; }
    echo done
    while read -r word; do
        case $word in
            start) start ;;
            stop) "$BIN/pg_ctl" -D data -m immediate stop >>log 2>&1 ;;
        esac
        echo done
    done
"#;

/// A private server.
pub struct Cluster {
    port: u16,
    keeper: Mutex<(Child, Lines<BufReader<ChildStdout>>)>,
}

impl Cluster {
    /// Returns `None` if no server is installed.
    pub fn start() -> Option<Cluster> {
        Cluster::start_with(&[])
    }

    /// Starts a cluster that accepts only encrypted connections, with this certificate and key in PEM; `None` as for
    /// [`database`].
    pub fn encrypted(certificate: &str, key: &str) -> Option<Cluster> {
        Cluster::start_with(&[("CERTIFICATE", certificate), ("PRIVATE_KEY", key)]).or_else(skip)
    }

    fn start_with(variables: &[(&str, &str)]) -> Option<Cluster> {
        let bin = installed()?;
        let port = TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port();
        let root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
        // The server refuses to run as root.
        let mut command = if root { Command::new("runuser") } else { Command::new("sh") };
        if root {
            command.args(["-u", "postgres", "--", "sh"]);
        }
        let mut child = command
            .args(["-c", KEEPER])
            .env("BIN", bin)
            .env("PORT", port.to_string())
            .envs(variables.iter().copied())
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let cluster = Cluster { port, keeper: Mutex::new((child, lines)) };
        cluster.answered();
        Some(cluster)
    }

    fn tell(&self, word: &str) {
        writeln!(self.keeper.lock().unwrap().0.stdin.as_mut().unwrap(), "{word}").unwrap();
        self.answered();
    }

    fn answered(&self) {
        let answer = self.keeper.lock().unwrap().1.next();
        assert_eq!(answer.expect("the keeper of the cluster ended").unwrap(), "done");
    }

    /// Stops the server like a crash: no checkpoint, connections cut.
    pub fn crash(&self) {
        self.tell("stop");
    }

    /// Starts it again and waits for its recovery.
    pub fn recover(&self) {
        self.tell("start");
    }

    /// Returns the address of the database that every server has.
    pub fn own_database(&self) -> String {
        self.url("postgres")
    }

    fn url(&self, database: &str) -> String {
        format!("postgres://ballast@127.0.0.1:{}/{database}", self.port)
    }

    /// Creates a database and returns its address.
    pub async fn database(&self) -> String {
        let name = new_name();
        create(&self.url("postgres"), &name).await;
        self.url(&name)
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // Waiting closes the child's input first.
        let _ = self.keeper.get_mut().unwrap().0.wait();
    }
}

/// Returns the folder of `initdb` and `pg_ctl`: on the path, else the newest of Debian's.
fn installed() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten();
    let mut versions: Vec<PathBuf> = versions.filter_map(|entry| Some(entry.ok()?.path().join("bin"))).collect();
    versions.sort();
    folders.extend(versions.into_iter().rev());
    folders.into_iter().find(|folder| ["initdb", "pg_ctl"].iter().all(|tool| Path::new(folder).join(tool).exists()))
}

fn new_name() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!("ballast_test_{}_{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

async fn create(server: &str, name: &str) {
    execute(server, &format!("CREATE DATABASE {name}")).await;
}

/// Runs a statement on the database at `url`, and returns the number of rows it changed.
pub async fn execute(url: &str, statement: &str) -> u64 {
    let mut connection = PgConnection::connect(url).await.expect("the server");
    let done = sqlx::query(AssertSqlSafe(statement.to_owned())).execute(&mut connection).await;
    let changed = done.unwrap_or_else(|error| panic!("{statement}: {error}")).rows_affected();
    connection.close().await.expect("closed");
    changed
}

/// Starts a private cluster for a test that crashes it; `None` as for [`database`].
pub fn private_cluster() -> Option<Cluster> {
    Cluster::start().or_else(skip)
}

/// Creates a new database for one test; if there is no server, prints so and returns `None`.
pub async fn database() -> Option<String> {
    static SHARED: OnceLock<Option<Cluster>> = OnceLock::new();
    if let Ok(given) = std::env::var("TEST_POSTGRES_URL") {
        let name = new_name();
        create(&given, &name).await;
        let (address, options) = given.split_once('?').unwrap_or((&given, ""));
        let server = address.rsplit_once('/').map_or(address, |(server, _)| server);
        return Some(format!("{server}/{name}?{options}"));
    }
    match SHARED.get_or_init(Cluster::start) {
        Some(cluster) => Some(cluster.database().await),
        None => skip(),
    }
}

fn skip<T>() -> Option<T> {
    let required = std::env::var("BALLAST_TEST_POSTGRES").is_ok_and(|value| value == "required");
    assert!(!required, "no PostgreSQL: neither TEST_POSTGRES_URL nor an installed initdb");
    // This bypasses the capture of test output: a suite that ran only half must not look complete.
    let _ = writeln!(std::io::stderr(), "SKIPPED, NO POSTGRESQL: a test of the shared store did not run");
    None
}
