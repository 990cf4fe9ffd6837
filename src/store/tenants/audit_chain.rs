//! The chains of audit entries: how they grow, how they are cut, and how they are verified.
//!
//! The entries of a key form a chain: they are numbered from 1, and each seal covers the seal of the entry before. A
//! separate row stores the end of the chain and the point where it was cut, under a seal of its own. Another sealed row
//! stores the number of chains. A check therefore finds an altered, removed or inserted entry, entries missing at
//! either end, and a missing chain. Appending more entries hides no damage, because a damaged end keeps the seal that
//! does not fit.
//!
//! Each key has a chain of its own. A writer to a chain waits for the commit of the previous writer to that chain, and
//! writers with different keys need not wait for each other.
//!
//! [`Store::cut_audit`] drops entries by age only, so a caller cannot push out old entries by making many changes. A
//! caller with as many entries as [`Quotas`] allows within that age cannot change anything more. A chain is cut once
//! its oldest entry is a day past the age, so at most once a day, and it keeps the seal at which it was cut. The cut is
//! itself an entry, in the chain of the service.

use futures_util::FutureExt;

use crate::store::engine::codec::{Seal, hexadecimal};
use crate::store::engine::error::{Failure, Quota};
use crate::store::engine::query::{Query, StoreConnection, StoreRow, query};
use crate::store::tenants::audit::{Actor, AuditAction, AuditRow, entry};
use crate::store::tenants::quotas::{self, Quotas};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The number of entries of one chain that one transaction drops, so that other writers do not wait long.
const CUT_AT_ONCE: i64 = 5_000;
/// A chain is cut once its oldest entry is older than the age limit by this much.
const MARGIN_MS: i64 = 24 * 60 * 60 * 1000;

/// The end of a chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditEnd {
    pub tenant: Tenant,
    pub chain: String,
    pub number: i64,
    /// The seal of the last entry, in hexadecimal digits.
    pub seal: String,
}

impl Store {
    /// Lists the end of each chain.
    pub async fn audit_ends(&self) -> Result<Vec<AuditEnd>, StoreError> {
        let end = |row: &StoreRow| {
            let AuditChain { tenant, chain, end, end_seal, .. } = AuditChain::from_row(row)?;
            Ok(AuditEnd { tenant: Tenant::stored(&tenant), chain, number: end, seal: hexadecimal(&end_seal) })
        };
        self.list("reading the audit", chains(), |rows| rows.iter().map(end).collect()).await
    }

    /// Drops entries from before `before_ms` in every chain whose oldest entry is at least a day older than that.
    /// Returns how many were dropped. The newest entry of a chain always stays, so that its end can be compared.
    pub async fn cut_audit(&self, before_ms: i64, now_ms: i64) -> Result<u64, StoreError> {
        let aged = query(
            "SELECT audit_chains.tenant, audit_chains.chain FROM audit_chains
             JOIN audit ON audit.tenant = audit_chains.tenant AND audit.chain = audit_chains.chain
                           AND audit.number = audit_chains.cut_number + 1
             WHERE audit_chains.cut_number + 1 < audit_chains.number AND audit.at_ms < $1 ORDER BY place",
        );
        let names = |row: &StoreRow| Ok((row.get("tenant")?, row.get("chain")?));
        let aged = aged.bind(before_ms.saturating_sub(MARGIN_MS));
        let found: Vec<(String, String)> =
            self.list("reading the audit", aged, |rows| rows.iter().map(names).collect()).await?;
        let (mut dropped, mut failed) = (0, None);
        for of in found {
            match self.cut_chain(of, before_ms, now_ms).await {
                Ok(cut) => dropped += cut,
                // A damaged chain does not stop the others from being cut.
                Err(error) => failed = Some(error),
            }
        }
        failed.map_or(Ok(dropped), Err)
    }

    async fn cut_chain(&self, of: (String, String), before_ms: i64, now_ms: i64) -> Result<u64, StoreError> {
        let mut dropped = 0;
        loop {
            let of = of.clone();
            let cut = self.write("cutting the audit", move |connection| cut(connection, of, before_ms, now_ms).boxed());
            let cut = cut.await?;
            dropped += cut;
            if cut < CUT_AT_ONCE.unsigned_abs() {
                return Ok(dropped);
            }
        }
    }
}

/// Writes an audit entry in the transaction of the change that it records.
///
/// # Errors
/// Fails if the caller's chain already has as many entries as `quotas` allows; the transaction must then be rolled
/// back.
pub(in crate::store) async fn record(
    connection: &mut StoreConnection<'_>,
    (quotas, actor): (Quotas, &Actor),
    tenant: &Tenant,
    deed: AuditAction,
    object: &str,
    outcome: &str,
) -> Result<(), Failure> {
    // The chain is locked from here on, so that no two entries follow the same one.
    let mut chain = AuditChain::hold(connection, tenant, actor.chain()).await?;
    if actor.is_caller() {
        quotas::within(Quota::AuditEntries, chain.end - chain.number, 1, quotas.audit_entries.into())?;
    }
    let is_sound = chain.verify().is_ok();
    let mut row = AuditRow {
        sequence: 0,
        tenant: tenant.clone(),
        key: actor.key.to_string(),
        roles: actor.roles.to_string(),
        deed: deed.as_str().to_owned(),
        object: object.to_owned(),
        outcome: outcome.to_owned(),
        at_ms: actor.at_ms,
        number: chain.end + 1,
        seal: String::new(),
    };
    let seal = row.chained(&chain.end_seal).finish();
    row.seal = hexadecimal(&seal);
    let insert = query(
        "INSERT INTO audit (tenant, chain, number, access_key, roles, deed, object, outcome, at_ms, previous, seal)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)",
    );
    let insert = insert
        .bind(tenant.as_str())
        .bind(actor.chain())
        .bind(row.number)
        .bind(row.key)
        .bind(row.roles)
        .bind(row.deed)
        .bind(row.object)
        .bind(row.outcome)
        .bind(row.at_ms)
        .bind(chain.end_seal)
        .bind(seal.clone());
    connection.execute(insert).await?;
    (chain.end, chain.end_seal) = (row.number, seal);
    if is_sound {
        chain.own_seal = chain.seal().finish();
    }
    let end = query("UPDATE audit_chains SET number = $1, end_seal = $2, seal = $3 WHERE tenant = $4 AND chain = $5");
    let end = end.bind(chain.end).bind(chain.end_seal).bind(chain.own_seal);
    connection.execute(end.bind(tenant.as_str()).bind(actor.chain())).await.map(drop)
}

async fn cut(
    mut connection: StoreConnection<'_>,
    (tenant, name): (String, String),
    before_ms: i64,
    now_ms: i64,
) -> Result<u64, Failure> {
    let connection = &mut connection;
    let tenant = Tenant::stored(&tenant);
    let mut chain = AuditChain::hold(connection, &tenant, &name).await?;
    // Without this check, resealing would make a damaged end look sound.
    chain.verify()?;
    let young = query("SELECT min(number) AS number FROM audit WHERE tenant = $1 AND chain = $2 AND at_ms >= $3");
    let young = connection.row(young.bind(tenant.as_str()).bind(name.as_str()).bind(before_ms)).await?;
    let young: Option<i64> = young.map_or(Ok(None), |row| row.get("number"))?;
    let last = young.unwrap_or(chain.end).min(chain.end) - 1;
    let last = last.min(chain.number + CUT_AT_ONCE);
    if last <= chain.number {
        return Ok(0);
    }
    let seal = query("SELECT seal FROM audit WHERE tenant = $1 AND chain = $2 AND number = $3");
    let seal = connection.row(seal.bind(tenant.as_str()).bind(name.as_str()).bind(last)).await?;
    let seal: Vec<u8> = seal.ok_or_else(|| Failure::Corrupt(entry(&name, tenant.as_str(), last)))?.get("seal")?;
    let drop_them = query("DELETE FROM audit WHERE tenant = $1 AND chain = $2 AND number <= $3");
    let dropped = connection.execute(drop_them.bind(tenant.as_str()).bind(name.as_str()).bind(last)).await?;
    let outcome = format!("dropped {dropped} entries; the last had the seal {}", hexadecimal(&seal));
    (chain.number, chain.cut_seal) = (last, seal);
    let mark =
        query("UPDATE audit_chains SET cut_number = $1, cut_seal = $2, seal = $3 WHERE tenant = $4 AND chain = $5");
    let own_seal = chain.seal().finish();
    let mark = mark.bind(last).bind(chain.cut_seal).bind(own_seal).bind(tenant.as_str()).bind(name.as_str());
    connection.execute(mark).await?;
    let (actor, object) = (Actor::service(now_ms), format!("entries to {last} of {name}"));
    record(connection, (Quotas::NONE, &actor), &tenant, AuditAction::CutAudit, &object, &outcome).await?;
    Ok(dropped)
}

/// Selects the chains with their ends.
pub(in crate::store) fn chains() -> Query {
    query("SELECT * FROM audit_chains ORDER BY place")
}

/// Selects the number of chains; there is no row before the first chain.
pub(in crate::store) fn total() -> Query {
    query("SELECT chains, seal FROM audit_total")
}

fn total_seal(chains: i64) -> Seal {
    Seal::of("audit total").integer(chains)
}

/// Checks that `chains` equals the number of chains ever begun.
pub(in crate::store) fn verify_total(total: Option<&StoreRow>, chains: i64) -> Result<(), Failure> {
    let what = || "the number of chains of the audit".to_owned();
    match total {
        None if chains == 0 => Ok(()),
        Some(row) if row.get::<i64>("chains")? == chains => {
            total_seal(chains).verify(&row.get::<Vec<u8>>("seal")?, what)
        }
        _ => Err(Failure::Corrupt(what())),
    }
}

/// A chain that a check is walking, starting where the chain was cut.
pub(in crate::store) struct AuditChain {
    pub tenant: String,
    pub chain: String,
    place: i64,
    /// The number of the last entry checked so far; entries that were cut count.
    number: i64,
    cut_seal: Vec<u8>,
    end: i64,
    end_seal: Vec<u8>,
    own_seal: Vec<u8>,
}

impl AuditChain {
    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        Ok(AuditChain {
            tenant: row.get("tenant")?,
            chain: row.get("chain")?,
            place: row.get("place")?,
            number: row.get("cut_number")?,
            cut_seal: row.get("cut_seal")?,
            end: row.get("number")?,
            end_seal: row.get("end_seal")?,
            own_seal: row.get("seal")?,
        })
    }

    /// Locks the chain for this transaction, and begins it if there is none.
    async fn hold(connection: &mut StoreConnection<'_>, tenant: &Tenant, chain: &str) -> Result<Self, Failure> {
        let find = || {
            let find = query("SELECT * FROM audit_chains WHERE tenant = $1 AND chain = $2");
            find.bind(tenant.as_str()).bind(chain).for_update()
        };
        if let Some(row) = connection.row(find()).await? {
            return AuditChain::from_row(&row);
        }
        // Locked from here on, so that no two transactions begin the same chain or use the same `place`.
        let hold = query(
            "INSERT INTO audit_total (row_id, chains, seal) VALUES (1, 0, $1)
             ON CONFLICT (row_id) DO UPDATE SET chains = audit_total.chains RETURNING chains",
        );
        let held = connection.row(hold.bind(total_seal(0).finish())).await?;
        let place = 1 + held.map_or(Ok(0), |row| row.get::<i64>("chains"))?;
        if let Some(row) = connection.row(find()).await? {
            return AuditChain::from_row(&row);
        }
        let first = Seal::of("audit chain").text(tenant.as_str()).text(chain).finish();
        let mut begun = AuditChain {
            tenant: tenant.to_string(),
            chain: chain.to_owned(),
            place,
            number: 0,
            cut_seal: first.clone(),
            end: 0,
            end_seal: first.clone(),
            own_seal: Vec::new(),
        };
        begun.own_seal = begun.seal().finish();
        let begin = query(
            "INSERT INTO audit_chains (tenant, chain, place, number, end_seal, cut_number, cut_seal, seal)
             VALUES ($1, $2, $3, 0, $4, 0, $4, $5)",
        );
        let begin = begin.bind(tenant.as_str()).bind(chain).bind(place).bind(first).bind(begun.own_seal.clone());
        connection.execute(begin).await?;
        let count = query("UPDATE audit_total SET chains = $1, seal = $2").bind(place);
        connection.execute(count.bind(total_seal(place).finish())).await?;
        Ok(begun)
    }

    /// Computes the seal over the point of the cut and the end.
    fn seal(&self) -> Seal {
        Seal::of("audit end")
            .text(&self.tenant)
            .text(&self.chain)
            .integer(self.place)
            .integer(self.number)
            .bytes(&self.cut_seal)
            .integer(self.end)
            .bytes(&self.end_seal)
    }

    /// Verifies the chain's own seal. Call this before [`AuditChain::follow`].
    pub(in crate::store) fn verify(&self) -> Result<(), Failure> {
        self.seal().verify(&self.own_seal, || format!("the end of {} in the audit of {}", self.chain, self.tenant))
    }

    /// Selects at most `limit` following entries, without those added since the check began.
    pub(in crate::store) fn next(&self, limit: i64) -> Query {
        let next = query(
            "SELECT * FROM audit WHERE tenant = $1 AND chain = $2 AND number > $3 AND number <= $4
             ORDER BY number LIMIT $5",
        );
        let next = next.bind(self.tenant.as_str()).bind(self.chain.as_str());
        next.bind(self.number).bind(self.end).bind(limit)
    }

    pub(in crate::store) fn is_whole(&self) -> bool {
        self.number >= self.end
    }

    /// Advances over the rows that [`AuditChain::next`] found, and returns the damage among them.
    pub(in crate::store) fn follow(&mut self, rows: &[StoreRow]) -> Result<Vec<String>, Failure> {
        let named = |number| entry(&self.chain, &self.tenant, number);
        let mut damage = Vec::new();
        let mut sequence = None;
        for row in rows {
            let (number, previous): (i64, Vec<u8>) = (row.get("number")?, row.get("previous")?);
            let at: i64 = row.get("sequence")?;
            if number != self.number + 1 {
                damage.push(named(self.number + 1));
            } else if previous != self.cut_seal || sequence.is_some_and(|before| before >= at) {
                damage.push(named(number));
            } else if let Err(failure) = AuditRow::from_row(row) {
                damage.push(failure.damage()?);
            }
            sequence = Some(at);
            (self.number, self.cut_seal) = (number, row.get("seal")?);
        }
        if rows.is_empty() {
            damage.push(named(self.number + 1));
            self.number = self.end;
        } else if self.is_whole() && self.cut_seal != self.end_seal {
            damage.push(named(self.end));
        }
        Ok(damage)
    }
}
