//! Links: under each, one client's letter is read without a key until it expires. Only the SHA-256 of a link's secret is
//! stored.

use futures_util::FutureExt;

use crate::store::engine::codec::Seal;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::Quotas;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The most links of a session that are in force.
pub const MOST_LINKS: usize = 10;

/// A link as stored; verified against its seal when it is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkRow {
    pub link: String,
    pub session: String,
    /// The SHA-256 of the secret.
    pub hash: [u8; 32],
    /// Firm, currency and smallest trade of the letter.
    pub letter_json: String,
    pub created_ms: i64,
    pub expires_ms: i64,
}

/// The outcome of making a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Linking {
    Created,
    /// The tenant has no such session.
    NoSession,
    /// The session has [`MOST_LINKS`] already.
    Full,
}

impl Store {
    /// Makes a link to the letter of a tenant's session, and deletes those of the session that expired before.
    pub async fn create_link(&self, tenant: &Tenant, new: LinkRow) -> Result<Linking, StoreError> {
        let (tenant, by) = (tenant.clone(), (self.quotas, self.actor.clone()));
        self.write("making a link", move |connection| create(connection, tenant, new, by).boxed()).await
    }

    /// Lists the links of a tenant's session, oldest first.
    pub async fn links(&self, tenant: &Tenant, session: &str) -> Result<Vec<LinkRow>, StoreError> {
        let all = query(
            "SELECT links.* FROM links JOIN sessions ON sessions.session = links.session
             WHERE links.session = $1 AND sessions.tenant = $2 ORDER BY links.created_ms, links.link",
        );
        let decode = |rows: &[StoreRow]| rows.iter().map(LinkRow::from_row).collect();
        self.list("listing links", all.bind(session).bind(tenant.as_str()), decode).await
    }

    /// Finds the link whose secret has this hash, and the tenant of its session.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the row is not what was written.
    pub async fn link_of(&self, hash: &[u8; 32]) -> Result<Option<(LinkRow, Tenant)>, StoreError> {
        let find = query(
            "SELECT links.*, sessions.tenant FROM links JOIN sessions ON sessions.session = links.session
             WHERE links.hash = $1",
        );
        let decode = |row: &StoreRow| Ok((LinkRow::from_row(row)?, Tenant::stored(&row.get::<String>("tenant")?)));
        self.read("reading a link", find.bind(hash.to_vec()), |rows| rows.first().map(decode).transpose()).await
    }

    /// Deletes a link to the letter of a tenant's session. Returns false if there is none.
    pub async fn delete_link(&self, tenant: &Tenant, link: &str) -> Result<bool, StoreError> {
        let of = (tenant.clone(), link.to_owned(), self.actor.clone());
        self.write("deleting a link", move |connection| delete(connection, of).boxed()).await
    }
}

/// Makes a link while its session's row is locked, so that no two are counted past the most.
async fn create(
    mut connection: StoreConnection<'_>,
    tenant: Tenant,
    new: LinkRow,
    (quotas, actor): (Quotas, Actor),
) -> Result<Linking, Failure> {
    let connection = &mut connection;
    let session = query("SELECT session FROM sessions WHERE session = $1 AND tenant = $2");
    let session = session.bind(new.session.as_str()).bind(tenant.as_str()).for_update();
    if connection.row(session).await?.is_none() {
        return Ok(Linking::NoSession);
    }
    let expired = query("DELETE FROM links WHERE session = $1 AND expires_ms <= $2");
    connection.execute(expired.bind(new.session.as_str()).bind(new.created_ms)).await?;
    let insert = query(
        "INSERT INTO links (link, session, hash, letter_json, created_ms, expires_ms, seal)
         SELECT $1, $2, $3, $4, $5, $6, $7 WHERE (SELECT count(*) FROM links WHERE session = $2) < $8",
    );
    let insert = insert
        .bind(new.link.as_str())
        .bind(new.session.as_str())
        .bind(new.hash.to_vec())
        .bind(new.letter_json.as_str())
        .bind(new.created_ms)
        .bind(new.expires_ms)
        .bind(new.seal().finish())
        .bind(i64::try_from(MOST_LINKS).unwrap_or(i64::MAX));
    if connection.execute(insert).await? == 0 {
        return Ok(Linking::Full);
    }
    let outcome = format!("{} until {}", new.link, new.expires_ms);
    audit_chain::record(connection, (quotas, &actor), &tenant, AuditAction::CreateLink, &new.session, &outcome).await?;
    Ok(Linking::Created)
}

async fn delete(
    mut connection: StoreConnection<'_>,
    (tenant, link, actor): (Tenant, String, Actor),
) -> Result<bool, Failure> {
    let connection = &mut connection;
    let delete = query(
        "DELETE FROM links WHERE link = $1 AND session IN (SELECT session FROM sessions WHERE tenant = $2)
         RETURNING session",
    );
    let Some(row) = connection.row(delete.bind(link.as_str()).bind(tenant.as_str())).await? else { return Ok(false) };
    let (session, by): (String, _) = (row.get("session")?, (Quotas::NONE, &actor));
    let outcome = format!("{link} deleted");
    audit_chain::record(connection, by, &tenant, AuditAction::DeleteLink, &session, &outcome).await?;
    Ok(true)
}

impl LinkRow {
    fn seal(&self) -> Seal {
        Seal::of("link")
            .text(&self.link)
            .text(&self.session)
            .bytes(&self.hash)
            .text(&self.letter_json)
            .integer(self.created_ms)
            .integer(self.expires_ms)
    }

    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let link: String = row.get("link")?;
        let what = || format!("link {link}");
        let read = LinkRow {
            session: row.get("session")?,
            hash: row.get::<Vec<u8>>("hash")?.try_into().map_err(|_| Failure::Corrupt(what()))?,
            letter_json: row.get("letter_json")?,
            created_ms: row.get("created_ms")?,
            expires_ms: row.get("expires_ms")?,
            link: link.clone(),
        };
        read.seal().verify(&row.get::<Vec<u8>>("seal")?, what)?;
        Ok(read)
    }
}
