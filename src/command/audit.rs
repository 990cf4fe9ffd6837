//! `ballast audit`: shows who changed what, from the store itself, whether or not a service runs.

use std::io::Write;

use ballast::store::{AuditFilter, AuditRow, Tenant};
use clap::Args;

use super::store_location::StoreArgs;
use super::{keys, moments};

/// Number of entries read at a time.
const PAGE: usize = 1000;

#[derive(Debug, Args)]
pub struct AuditCommand {
    /// Show the entries of this tenant only.
    #[arg(long)]
    tenant: Option<Tenant>,
    /// Show only what was done to this session, job, policy or key; a session's observations are included.
    #[arg(long)]
    object: Option<String>,
    /// Maximum number of entries shown.
    #[arg(long, default_value_t = 1000)]
    limit: usize,
    #[command(flatten)]
    store: StoreArgs,
}

/// Prints the entries of the audit.
///
/// # Errors
/// The store is not reached, or an entry is not what was written.
pub async fn run(arguments: AuditCommand) -> Result<(), Box<dyn std::error::Error>> {
    let ring = keys::open(arguments.store).await?;
    let filter = AuditFilter { tenant: arguments.tenant, object: arguments.object };
    let mut out = std::io::stdout().lock();
    writeln!(out, "time\ttenant\tkey\troles\taction\tobject\toutcome\tnumber\tseal")?;
    let (mut left, mut after) = (arguments.limit, None);
    while left > 0 {
        let page = ring.deeds(&filter, PAGE.min(left), after).await?;
        for AuditRow { tenant, key, roles, deed, object, outcome, at_ms, number, seal, .. } in &page {
            let (time, key) = (moments::shown(Some(*at_ms)), if key.is_empty() { "-" } else { key });
            writeln!(out, "{time}\t{tenant}\t{key}\t{roles}\t{deed}\t{object}\t{outcome}\t{number}\t{seal}")?;
        }
        after = page.iter().map(|row| row.sequence).filter(|sequence| *sequence > 0).min();
        if after.is_none() || page.len() < PAGE.min(left) {
            break;
        }
        left = left.saturating_sub(page.len());
    }
    ring.close().await;
    Ok(())
}
