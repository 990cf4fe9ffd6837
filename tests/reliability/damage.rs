//! Bytes of the database and of its write-ahead log change on the disk: the server refuses to start, or to answer, or
//! answers what it answered before. It never gives another action.
//!
//! The last commits of the log are spared: damage there cannot be told from a commit that a power cut tore.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::caller::{Answer, Caller};
use crate::scene::{Outcome, Tally, import};
use crate::server::{Server, Site};

const DATABASE: &str = "ballast.sqlite";
const LOG: &str = "ballast.sqlite-wal";

/// A folder as a kill left it, and what was answered from it before.
struct Specimen {
    site: Site,
    /// Bytes of the log before its last commits.
    log_bytes: u64,
    answers: Vec<(String, Answer)>,
}

pub async fn flipped(trials: usize) -> Outcome {
    let (specimen, mut tally) = (Specimen::new().await?, Tally::default());
    let (mut refused, mut same) = (0, 0);
    for trial in 0..trials {
        let site = Site::new();
        let what = specimen.copy_damaged(&site.data(), &mut ChaCha8Rng::seed_from_u64(trial as u64));
        (tally.trials, tally.faults) = (trial + 1, tally.faults + 1);
        match site.start().await {
            Ok(server) => same += specimen.ask(&server, &what, &mut tally).await,
            Err(_) => refused += 1,
        }
        tally.audit.acknowledged += specimen.answers.len();
        tally.listen(&site);
    }
    let answers = (trials - refused) * specimen.answers.len();
    tally.note = format!("{refused} refused to start; of {answers} answers {same} as before, the others refused");
    Ok(Some(tally))
}

impl Specimen {
    /// Half of it in the database, half in the log.
    async fn new() -> Result<Specimen, String> {
        let site = Site::new();
        let mut server = site.start().await?;
        let mut caller = Caller::new(&[&server.url]);
        let policy = import(&caller).await;
        let mut sessions = Vec::new();
        for _ in 0..6 {
            sessions.push(caller.open(&policy).await.ok_or("no session")?);
        }
        report(&caller, &sessions, 1..=10).await?;
        server.signal("-TERM");
        server.ended().await.ok_or("it did not end")?;
        server = site.start().await?;
        caller = Caller::new(&[&server.url]);
        report(&caller, &sessions, 11..=25).await?;
        let mut answers = Vec::new();
        for session in &sessions {
            for question in [format!("/action?session={session}"), format!("/sessions/{session}/history")] {
                let answer = caller.get(&question).await.ok_or("no answer")?;
                answers.push((question, answer));
            }
        }
        let export = format!("/policies/{policy}/export");
        let exported = caller.get(&export).await.ok_or("no policy")?;
        answers.push((export, exported));
        let log_bytes = std::fs::metadata(site.data().join(LOG)).map_err(|error| error.to_string())?.len();
        caller.open(&policy).await.ok_or("no session")?;
        caller.open(&policy).await.ok_or("no session")?;
        drop::<Server>(server);
        Ok(Specimen { site, log_bytes, answers })
    }

    /// Asks everything again: the same answer, or none. How many are the same.
    async fn ask(&self, server: &Server, what: &str, tally: &mut Tally) -> usize {
        let (caller, mut same) = (Caller::new(&[&server.url]), 0);
        for (question, before) in &self.answers {
            let now = caller.get(question).await.filter(|(status, _)| *status < 400);
            same += usize::from(now.as_ref() == Some(before));
            if now.as_ref().is_some_and(|now| now != before) {
                tally.audit.lost += 1;
                tally.complain(format!("{what}: {question} answers {now:?}"));
            }
        }
        tally.ready = tally.ready.max(server.ready);
        same
    }

    /// Copies it and changes a few bytes, all in one file; where.
    fn copy_damaged(&self, to: &Path, random: &mut ChaCha8Rng) -> String {
        std::fs::create_dir(to).unwrap();
        for file in [DATABASE, LOG] {
            std::fs::copy(self.site.data().join(file), to.join(file)).unwrap();
        }
        let file = if random.random_bool(0.5) { DATABASE } else { LOG };
        let path: PathBuf = to.join(file);
        let mut bytes = std::fs::read(&path).unwrap();
        let end = if file == LOG { self.log_bytes as usize } else { bytes.len() };
        let places: Vec<usize> = (0..random.random_range(1..=8)).map(|_| random.random_range(0..end)).collect();
        for &place in &places {
            bytes[place] ^= random.random_range(1..=255u8);
        }
        std::fs::write(&path, bytes).unwrap();
        format!("{file} changed at {places:?}")
    }
}

async fn report(caller: &Caller, sessions: &[String], periods: std::ops::RangeInclusive<usize>) -> Result<(), String> {
    for period in periods {
        for (number, session) in sessions.iter().enumerate() {
            let log_return = 0.002 * (number as f64 - 2.5);
            let report: Value = json!({ "session": session, "period": period, "log_return": log_return });
            caller.post("/observe", &report).await.filter(|(status, _)| *status == 200).ok_or("a report failed")?;
        }
    }
    Ok(())
}
