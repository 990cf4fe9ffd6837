//! What a server acknowledged, and what another, started over the same facts, still knows of it.

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
    /// Sent, but not acknowledged: it may be stored or not.
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
    async fn audit(&self, caller: &Caller) -> Audit {
        let acknowledged = self.reports.len() + 1;
        let Some(rows) = self.rows(caller).await else {
            return Audit { acknowledged, lost: acknowledged, doubled: 0 };
        };
        let kept = |(index, (_, answer)): &(usize, &(Value, Value))| {
            rows.get(*index).is_some_and(|row| says_the_same(row, answer))
        };
        let mut lost = self.reports.iter().enumerate().filter(|report| !kept(report)).count();
        for (report, answer) in &self.reports {
            let again = caller.post("/observe", report).await;
            lost += usize::from(again.as_ref() != Some(&(200, answer.clone())));
        }
        let mut most = self.reports.len();
        if let Some(pending) = &self.pending {
            most += 1;
            lost += usize::from(caller.post("/observe", pending).await.is_none_or(|(status, _)| status != 200));
        }
        let rows = self.rows(caller).await.map_or(0, |rows| rows.len());
        Audit { acknowledged, lost: lost.min(acknowledged), doubled: rows.saturating_sub(most) }
    }

    /// What the server has of it.
    pub async fn rows(&self, caller: &Caller) -> Option<Vec<Value>> {
        let (status, mut history) = caller.get(&format!("/sessions/{}/history", self.name)).await?;
        (status == 200).then(|| history["observations"].as_array_mut().map(std::mem::take))?
    }
}

/// Whether a stored row is the fact that an answer acknowledged.
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
