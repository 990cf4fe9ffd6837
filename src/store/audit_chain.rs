//! Whether the chains of the audit are whole.

use super::audit::{AuditRow, missing};
use super::error::Failure;
use super::query::{Query, Row, query};

/// The chains, with their ends.
pub(super) fn chains() -> Query {
    query("SELECT * FROM audit_chains ORDER BY tenant")
}

/// A chain on its way through a check.
pub(super) struct Chain {
    pub tenant: String,
    /// Entries found so far, those cut among them.
    pub number: i64,
    seal: Vec<u8>,
    end: i64,
    end_seal: Vec<u8>,
}

impl Chain {
    pub(super) fn from_row(row: &Row) -> Result<Self, Failure> {
        Ok(Chain {
            tenant: row.get("tenant")?,
            number: row.get("cut_number")?,
            seal: row.get("cut_seal")?,
            end: row.get("number")?,
            end_seal: row.get("seal")?,
        })
    }

    /// The entries that follow, no more than `limit`; what was added since the check began is not among them.
    pub(super) fn next(&self, limit: i64) -> Query {
        let next =
            query("SELECT * FROM audit WHERE tenant = $1 AND number > $2 AND number <= $3 ORDER BY number LIMIT $4");
        next.bind(self.tenant.as_str()).bind(self.number).bind(self.end).bind(limit)
    }

    pub(super) fn is_whole(&self) -> bool {
        self.number == self.end
    }

    /// Goes on over what [`Chain::next`] found.
    pub(super) fn follow(&mut self, rows: &[Row]) -> Result<(), Failure> {
        if rows.is_empty() {
            return Err(missing(&self.tenant, self.number + 1));
        }
        for row in rows {
            AuditRow::from_row(row)?;
            let (number, previous): (i64, Vec<u8>) = (row.get("number")?, row.get("previous")?);
            if number != self.number + 1 || previous != self.seal {
                return Err(missing(&self.tenant, self.number + 1));
            }
            (self.number, self.seal) = (number, row.get("seal")?);
        }
        if self.is_whole() && self.seal != self.end_seal {
            return Err(missing(&self.tenant, self.end));
        }
        Ok(())
    }
}
