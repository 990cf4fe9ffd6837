//! A ledger of what a server acknowledged, and a check that another server over the same facts still has it.

use std::ops::AddAssign;

use serde_json::Value;

use crate::caller::Caller;

/// Facts acknowledged to one client or many.
#[derive(Default)]
pub struct Ledger {
    pub sessions: Vec<Session>,
    pub trainings: Vec<Training>,
    /// Answers that no client should ever see.
    pub complaints: Vec<String>,
    /// Advice for a period that was acknowledged before it was asked for.
    pub stale: usize,
}

pub struct Session {
    pub name: String,
    /// Each period's report and the answer to it.
    pub reports: Vec<(Value, Value)>,
    /// Each correction and the answer to it.
    pub corrections: Vec<(Value, Value)>,
    /// Sent, but not acknowledged: it may be stored or not. A correction has a number.
    pub pending: Option<Value>,
}

pub struct Training {
    pub key: String,
    pub request: Value,
    /// The job, once acknowledged.
    pub job: Option<String>,
    /// The job's last acknowledged state, once it had ended.
    pub ended: Option<Value>,
}

/// Acknowledged facts, and those of them that are gone or there twice.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Audit {
    pub acknowledged: usize,
    pub lost: usize,
    pub doubled: usize,
}

impl AddAssign for Audit {
    fn add_assign(&mut self, other: Audit) {
        self.acknowledged += other.acknowledged;
        self.lost += other.lost;
        self.doubled += other.doubled;
    }
}

impl Ledger {
    pub fn extend(&mut self, other: Ledger) {
        self.sessions.extend(other.sessions);
        self.trainings.extend(other.trainings);
        self.complaints.extend(other.complaints);
        self.stale += other.stale;
    }

    /// Reads every fact back, then sends everything again: the same answers, and nothing new but what was pending.
    pub async fn audit(&self, caller: &Caller) -> Audit {
        let mut audit = Audit::default();
        for session in &self.sessions {
            audit += session.audit(caller).await;
        }
        for training in &self.trainings {
            audit += training.audit(caller).await;
        }
        audit
    }
}

impl Session {
    pub fn opened(name: String) -> Session {
        Session { name, reports: Vec::new(), corrections: Vec::new(), pending: None }
    }

    /// Sends a report or a correction.
    pub async fn send(&self, caller: &Caller, entry: &Value) -> Option<(u16, Value)> {
        if is_correction(entry) {
            caller.post(&format!("/sessions/{}/corrections", self.name), entry).await
        } else {
            caller.post("/observe", entry).await
        }
    }

    pub fn acknowledge(&mut self, entry: Value, answer: Value) {
        let entries = if is_correction(&entry) { &mut self.corrections } else { &mut self.reports };
        entries.push((entry, answer));
    }

    async fn audit(&self, caller: &Caller) -> Audit {
        let acknowledged = self.reports.len() + self.corrections.len() + 1;
        let Some((rows, corrections)) = self.rows(caller).await else {
            return Audit { acknowledged, lost: acknowledged, doubled: 0 };
        };
        let kept = |(index, (_, answer)): &(usize, &(Value, Value))| {
            rows.get(*index).is_some_and(|row| says_the_same(row, answer) && self.stands(row))
        };
        let mut lost = self.reports.iter().enumerate().filter(|report| !kept(report)).count();
        let made = |(index, (sent, _)): &(usize, &(Value, Value))| {
            let fields = ["correction", "period", "log_return", "reason"];
            corrections.get(*index).is_some_and(|row| fields.iter().all(|field| row[field] == sent[field]))
        };
        lost += self.corrections.iter().enumerate().filter(|correction| !made(correction)).count();
        for (entry, answer) in self.reports.iter().chain(&self.corrections) {
            let again = self.send(caller, entry).await;
            lost += usize::from(again.as_ref() != Some(&(200, answer.clone())));
        }
        let mut most = self.reports.len() + self.corrections.len();
        if let Some(pending) = &self.pending {
            most += 1;
            lost += usize::from(self.send(caller, pending).await.is_none_or(|(status, _)| status != 200));
        }
        let kept = self.rows(caller).await.map_or(0, |(rows, corrections)| rows.len() + corrections.len());
        Audit { acknowledged, lost: lost.min(acknowledged), doubled: kept.saturating_sub(most) }
    }

    /// Returns true if a period's return is that of its last correction, and no other correction of it is under way.
    fn stands(&self, row: &Value) -> bool {
        let of_period = |entry: &&Value| entry["period"] == row["period"];
        if self.pending.iter().filter(of_period).any(is_correction) {
            return true;
        }
        let last = self.corrections.iter().rev().map(|(correction, _)| correction).find(of_period);
        last.is_none_or(|correction| row["now"]["log_return"] == correction["log_return"])
    }

    /// The periods and the corrections that the server has of it.
    pub async fn rows(&self, caller: &Caller) -> Option<(Vec<Value>, Vec<Value>)> {
        let (status, mut history) = caller.get(&format!("/sessions/{}/history", self.name)).await?;
        let mut rows = |of: &str| history[of].as_array_mut().map(std::mem::take);
        (status == 200).then(|| rows("observations").zip(rows("corrections")))?
    }
}

fn is_correction(entry: &Value) -> bool {
    entry["correction"].is_u64()
}

/// Returns true if a stored row is the fact that an answer acknowledged.
pub fn says_the_same(row: &Value, answer: &Value) -> bool {
    ["period", "log_return", "wealth"].iter().all(|at| row[at] == answer[at])
}

impl Training {
    async fn audit(&self, caller: &Caller) -> Audit {
        let again = caller.train(&self.key, &self.request).await;
        let Some(job) = &self.job else { return Audit::default() };
        let same_job = again.is_some_and(|(status, again)| status == 202 && again["job"] == job.as_str());
        let now = caller.get(&format!("/jobs/{job}")).await.map(|(_, now)| now);
        let same_end = self.ended.is_none() || self.ended == now;
        Audit { acknowledged: 1, lost: usize::from(!same_job || !same_end), doubled: 0 }
    }
}
