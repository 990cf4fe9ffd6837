//! The document of a session, by which it moves to another service or tenant.
//!
//! Texts and numbers are those of the rows, so a document can be laid out anew, and the hash is of what it says.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::control::error::FieldError;
use crate::control::policy::content_hash;
use crate::service::error::ServiceError;
use crate::service::sessions::initial_history::InitialHistory;
use crate::service::sessions::opening::SessionStart;
use crate::service::sessions::plan::SessionPlan;
use crate::store::{EntryKind, EntryRow, Labels, Relabel, SessionFacts};

const NUMBER_BYTES: usize = size_of::<f64>();

/// A session as one document.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionDocument {
    /// SHA-256 of `session` in its shortest JSON, in hexadecimal.
    pub(super) hash: String,
    pub(super) session: ExportedSession,
}

/// The version of the document.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
enum DocumentFormat {
    #[serde(rename = "ballast-session/1")]
    First,
}

/// A session with everything that was recorded in it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExportedSession {
    format: DocumentFormat,
    pub(super) session: String,
    /// The policies that it used, each once, in their order.
    pub(super) policies: Vec<String>,
    labels: Labels,
    pub(super) start: ExportedStart,
    /// In the order they were recorded.
    entries: Vec<ExportedEntry>,
    /// Figures to which the entries lead.
    pub(super) state: Value,
}

/// The start of a session.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExportedStart {
    pub(super) policy: String,
    /// Wealth and the share held in the risky assets; null if the session lives a declared problem.
    pub(super) account: Option<(f64, f64)>,
    /// The noises known: of an investor the log-returns, date after date.
    pub(super) history: Vec<f64>,
    /// The plan as it is stored.
    pub(super) plan: String,
    pub(super) created_ms: i64,
}

/// An entry of a session, with its texts as they are stored.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExportedEntry {
    /// `period`, `correction` or `renewal`.
    kind: String,
    content: String,
    answer: String,
    /// The numbers of several assets, in Base64.
    numbers: String,
    created_ms: i64,
    /// Name of the key that reported it.
    key: String,
}

impl SessionDocument {
    /// Returns the document of a session that used these policies and is in this state.
    ///
    /// # Errors
    /// It cannot be written as JSON, which never happens.
    pub(super) fn new(
        SessionFacts { row, entries, .. }: SessionFacts,
        labels: Labels,
        (policies, state): (Vec<String>, Value),
    ) -> Result<Self, ServiceError> {
        let start = ExportedStart {
            policy: row.policy,
            account: row.account.map(|account| (account.wealth, account.holding)),
            history: row.initial_history,
            plan: row.plan_json,
            created_ms: row.created_ms,
        };
        let entries = entries.into_iter().map(ExportedEntry::from).collect();
        let format = DocumentFormat::First;
        let session = ExportedSession { format, session: row.session, policies, labels, start, entries, state };
        Ok(SessionDocument { hash: session.hash()?, session })
    }
}

impl ExportedSession {
    /// Returns the hash that the document must have.
    ///
    /// # Errors
    /// It cannot be written as JSON, which never happens.
    pub(super) fn hash(&self) -> Result<String, ServiceError> {
        Ok(content_hash(&serde_json::to_vec(self).map_err(ServiceError::internal)?))
    }

    /// Checks the name and the labels, and returns these.
    ///
    /// # Errors
    /// One of them breaks its rule.
    pub(super) fn check(&self) -> Result<Relabel, FieldError> {
        let name = self.session.strip_prefix("session_").unwrap_or_default();
        if name.len() != 32 || !name.bytes().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f')) {
            return Err(FieldError::new("session.session", &self.session, "must be the name of a session"));
        }
        let Labels { name, notes, tags } = self.labels.clone();
        let labels = Relabel {
            name: Some(name).filter(|name| !name.is_empty()),
            notes: Some(notes).filter(|notes| !notes.is_empty()),
            tags: Some(tags).filter(|tags| !tags.is_empty()),
        };
        labels.check()?;
        Ok(labels)
    }

    /// Returns the entries as they are stored, numbered by their kind.
    ///
    /// # Errors
    /// An entry is of no kind, or its numbers are none.
    pub(super) fn rows(&self) -> Result<Vec<EntryRow>, FieldError> {
        let kinds = [EntryKind::Observation, EntryKind::Correction, EntryKind::Renewal];
        let mut numbers = [0; 3];
        let row = |(index, entry): (usize, &ExportedEntry)| {
            let field = |name: &str| format!("session.entries[{index}].{name}");
            let Some(place) = kinds.iter().position(|kind| kind.counted() == entry.kind) else {
                return Err(FieldError::new(field("kind"), &entry.kind, "must be period, correction or renewal"));
            };
            numbers[place] += 1;
            let bytes = STANDARD.decode(&entry.numbers).ok().filter(|bytes| is_numbers(bytes));
            Ok(EntryRow {
                session: self.session.clone(),
                entry: index + 1,
                kind: kinds[place],
                number: numbers[place],
                content_json: entry.content.clone(),
                answer_json: entry.answer.clone(),
                numbers: bytes
                    .ok_or_else(|| FieldError::new(field("numbers"), &entry.numbers, "must be numbers in Base64"))?,
                created_ms: entry.created_ms,
                key: entry.key.clone(),
            })
        };
        self.entries.iter().enumerate().map(row).collect()
    }
}

impl ExportedStart {
    /// Returns the request that opens the session. A history that is the policy's `own` is left out.
    pub(super) fn request(&self, plan: &SessionPlan, own: Vec<f64>) -> SessionStart {
        let assets = plan.assets.as_ref();
        let is_investor = plan.problem.is_none();
        let history = (is_investor && self.history != own)
            .then(|| InitialHistory::of(self.history.clone(), assets.map(|assets| assets.missing())));
        SessionStart {
            policy: self.policy.clone(),
            history,
            wealth: self.account.map(|(wealth, _)| wealth),
            holding: self.account.map(|(_, holding)| holding).filter(|_| assets.is_none()),
            holdings: assets.map(|assets| assets.composed.holdings.clone()),
            state: plan.problem.as_ref().map(|planned| planned.state.clone()),
            renew: plan.renew,
            rolling: plan.rolling,
            labels: Relabel::default(),
        }
    }
}

impl From<EntryRow> for ExportedEntry {
    fn from(row: EntryRow) -> Self {
        ExportedEntry {
            kind: row.kind.counted().to_owned(),
            content: row.content_json,
            answer: row.answer_json,
            numbers: STANDARD.encode(&row.numbers),
            created_ms: row.created_ms,
            key: row.key,
        }
    }
}

/// Returns true if the bytes are finite numbers.
fn is_numbers(bytes: &[u8]) -> bool {
    let (numbers, rest) = bytes.as_chunks::<NUMBER_BYTES>();
    rest.is_empty() && numbers.iter().all(|number| f64::from_le_bytes(*number).is_finite())
}
