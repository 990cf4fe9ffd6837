//! Links to a letter: whoever has one reads the present letter of one session without a key, until the link expires or
//! is deleted.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tokio::sync::Semaphore;
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, whole};
use crate::service::Service;
use crate::service::callers::allowance::{Class, HeavyPermit, Refused};
use crate::service::callers::identity;
use crate::service::callers::keys::Caller;
use crate::service::callers::secret::random_digits;
use crate::service::error::ServiceError;
use crate::service::letter::content::Letter;
use crate::service::letter::request::LetterRequest;
use crate::service::letter::{LetterReasons, declared};
use crate::store::{LinkRow, Linking, MOST_LINKS, Tenant};

/// Allowed days for which a link is in force.
const DAYS: RangeInclusive<usize> = 1..=400;
/// Days that a link is in force by default: until the letter of the next month.
const USUAL_DAYS: usize = 31;
const DAY_MS: i64 = 24 * 60 * 60 * 1000;
/// The digits of a link's secret: 256 random bits in hexadecimal.
const DIGITS: usize = 64;
/// Links looked up at a time, so that guesses cannot keep the store from its work.
const LOOKUPS: usize = 8;

/// A request for a link to a session's letter.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MakeLink {
    /// Days until the link expires.
    #[serde(default = "usual_days")]
    #[schema(default = 31)]
    pub days: usize,
    /// Firm, currency and smallest trade of the letter, which the link keeps. It has the day on which it is read, and no
    /// logo.
    #[serde(default)]
    pub letter: LetterRequest,
}

fn usual_days() -> usize {
    USUAL_DAYS
}

impl Bounded for MakeLink {
    const BOUNDS: &'static [FieldBounds] = &[("days", ValueBounds::count(&DAYS))];
}

/// A new link.
#[derive(Debug, Serialize, ToSchema)]
pub struct MadeLink {
    pub link: String,
    /// The address of the letter on this service. It is shown once.
    #[schema(example = "/letter?link=9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08")]
    pub path: String,
    /// When it expires, in milliseconds since 1970.
    pub expires_ms: i64,
}

/// Limits how many links are looked up at a time.
pub(in crate::service) struct LinkLookups(Semaphore);

impl Default for LinkLookups {
    fn default() -> Self {
        LinkLookups(Semaphore::new(LOOKUPS))
    }
}

impl MakeLink {
    fn check(&self) -> Result<(), ServiceError> {
        whole("days", self.days, &DAYS)?;
        let inside = |error: FieldError| FieldError { field: format!("letter.{}", error.field), ..error };
        self.letter.check().map_err(inside)?;
        if let Some(date) = self.letter.date {
            let rule = "must be left out: a letter has the day on which it is read";
            return Err(FieldError::new("letter.date", date, rule).into());
        }
        match self.letter.firm.as_ref().is_some_and(|firm| firm.logo.is_some()) {
            true => {
                let rule = "must be left out: a link keeps no picture";
                Err(FieldError::new("letter.firm.logo", "a picture", rule).into())
            }
            false => Ok(()),
        }
    }
}

impl Service {
    /// Makes a link to the letter of a session.
    ///
    /// # Errors
    /// A field breaks its rule, there is no such session, or it has as many links as it may.
    pub async fn make_link(&self, caller: &Caller, session: &str, new: MakeLink) -> Result<MadeLink, ServiceError> {
        new.check()?;
        if self.sessions.get(&caller.tenant, session).await?.standing.account().is_err() {
            return Err(declared(session));
        }
        let (secret, link) = (random_digits()?, identity::new_id("link")?);
        let created_ms = self.clock.now_milliseconds();
        let days = i64::try_from(new.days).unwrap_or(i64::MAX);
        let expires_ms = created_ms.saturating_add(days.saturating_mul(DAY_MS));
        let row = LinkRow {
            link: link.clone(),
            session: session.to_owned(),
            hash: Sha256::digest(&secret).into(),
            letter_json: serde_json::to_string(&new.letter).map_err(ServiceError::internal)?,
            created_ms,
            expires_ms,
        };
        match self.store.by(caller.actor()).create_link(&caller.tenant, row).await? {
            Linking::Created => Ok(MadeLink { link, path: format!("/letter?link={secret}"), expires_ms }),
            Linking::NoSession => Err(ServiceError::unknown("session", session)),
            Linking::Full => {
                let rule = format!("must be at most {MOST_LINKS} of a session; delete one first");
                Err(FieldError::new("links", MOST_LINKS + 1, rule).into())
            }
        }
    }

    /// Lists the links of a session, oldest first, also those that have expired.
    ///
    /// # Errors
    /// There is no such session.
    pub async fn links(&self, tenant: &Tenant, session: &str) -> Result<Vec<LinkRow>, ServiceError> {
        if self.store.session(tenant, session).await?.is_none() {
            return Err(ServiceError::unknown("session", session));
        }
        Ok(self.store.links(tenant, session).await?)
    }

    /// Deletes a link; it leads nowhere from then on.
    ///
    /// # Errors
    /// There is no such link.
    pub async fn delete_link(&self, caller: &Caller, link: &str) -> Result<(), ServiceError> {
        let is_deleted = self.store.by(caller.actor()).delete_link(&caller.tenant, link).await?;
        if is_deleted { Ok(()) } else { Err(ServiceError::unknown("link", link)) }
    }

    /// Writes the letter that a link leads to; `None` if the link is unknown, was deleted or has expired.
    ///
    /// # Errors
    /// Too many links are being looked up, the tenant reads too much, or the letter cannot be written now.
    pub async fn linked_letter(&self, secret: &str) -> Result<Option<Letter>, ServiceError> {
        // Nothing else was ever made, so nothing else is looked up.
        if secret.len() != DIGITS || !secret.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Ok(None);
        }
        let lookup = self.lookups.0.try_acquire().map_err(|_| Refused::NoPlace)?;
        let found = self.store.link_of(&Sha256::digest(secret).into()).await?;
        drop(lookup);
        let Some((row, tenant)) = found.filter(|(row, _)| row.expires_ms > self.clock.now_milliseconds()) else {
            return Ok(None);
        };
        let allowance = self.keys.allowance(&tenant);
        allowance.take(Class::Read)?;
        let request: LetterRequest = serde_json::from_str(&row.letter_json).map_err(ServiceError::internal)?;
        let turn = HeavyPermit::new(allowance);
        match self.letter(&tenant, &row.session, (request, LetterReasons::Worth), &turn).await {
            Err(ServiceError::Unknown { .. }) => Ok(None),
            written => written.map(Some),
        }
    }
}
