//! The labels of a tenant's policies and sessions: a name, notes and tags.
//!
//! Labels describe things and make them findable, and nothing is computed from them. No seal covers them, and neither a
//! policy's content hash nor a session's advice depends on them. Both kinds of thing have their labels in one table.
//! Each row is written in the transaction of the thing it labels, and deleted with it.

use std::collections::{BTreeSet, HashSet};

use futures_util::FutureExt;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::text::check_text;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::sessions::words::{self, Labelled, Worded};
use crate::store::tenants::audit::AuditAction;
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Usage};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The most letters of a name.
pub const LONGEST_NAME: usize = 100;
/// The most letters of notes.
pub const LONGEST_NOTES: usize = 2_000;
/// The most letters of a tag.
pub const LONGEST_TAG: usize = 50;
/// The most tags of a policy or a session.
pub const MOST_TAGS: usize = 20;

/// The labels of a policy or a session; a part that was not set is empty.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Labels {
    /// The name, which need not be unique.
    pub name: String,
    pub notes: String,
    pub tags: Vec<String>,
}

/// A change of labels: an absent field stays, a null or empty one is cleared.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Relabel {
    /// At most 100 letters, without control characters.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// At most 2,000 letters, without control characters except line breaks.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub notes: Option<String>,
    /// At most 20 distinct tags, each of 1 to 50 letters without control characters.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub tags: Option<Vec<String>>,
}

/// Deserializes a field that is present, even if it is null.
pub fn given<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default>(deserializer: D) -> Result<Option<T>, D::Error> {
    Option::<T>::deserialize(deserializer).map(|value| Some(value.unwrap_or_default()))
}

impl Bounded for Relabel {
    const BOUNDS: &'static [FieldBounds] = &[
        ("name", ValueBounds::Text(0, LONGEST_NAME)),
        ("notes", ValueBounds::Text(0, LONGEST_NOTES)),
        ("tags", ValueBounds::Set(0, MOST_TAGS, &ValueBounds::Text(1, LONGEST_TAG))),
    ];
}

impl Relabel {
    /// Checks every field.
    ///
    /// # Errors
    /// Fails with the first field that breaks its rule.
    pub fn check(&self) -> Result<(), FieldError> {
        if let Some(name) = &self.name {
            check_text("name", name, 0..=LONGEST_NAME, &[])?;
        }
        if let Some(notes) = &self.notes {
            check_text("notes", notes, 0..=LONGEST_NOTES, &['\n'])?;
        }
        let tags = self.tags.as_deref().unwrap_or_default();
        if tags.len() > MOST_TAGS {
            let rule = format!("must hold at most {MOST_TAGS} tags");
            return Err(FieldError::new("tags", format!("{} tags", tags.len()), rule));
        }
        let mut seen = HashSet::new();
        for (index, tag) in tags.iter().enumerate() {
            let field = format!("tags[{index}]");
            check_text(&field, tag, 1..=LONGEST_TAG, &[])?;
            if !seen.insert(tag) {
                return Err(FieldError::new(field, tag, "must differ from the tags before it"));
            }
        }
        Ok(())
    }

    /// Returns true if it changes nothing, whatever the labels are.
    pub fn is_empty(&self) -> bool {
        *self == Relabel::default()
    }
}

impl Labels {
    /// Returns the labels after a change.
    pub fn after(self, change: &Relabel) -> Labels {
        let Relabel { name, notes, tags } = change.clone();
        Labels { name: name.unwrap_or(self.name), notes: notes.unwrap_or(self.notes), tags: tags.unwrap_or(self.tags) }
    }

    /// Reads a row with the columns `name`, `notes` and `tags`; the values are NULL if a join found no labels.
    pub(super) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let text = |column: &str| row.get::<Option<String>>(column).map(Option::unwrap_or_default);
        let tags = text("tags")?.split('\n').filter(|tag| !tag.is_empty()).map(str::to_owned).collect();
        Ok(Labels { name: text("name")?, notes: text("notes")?, tags })
    }

    /// Encodes the tags for their column. Each stands between line breaks, which no tag contains, so that a substring
    /// search finds whole tags.
    fn tags_column(&self) -> String {
        if self.tags.is_empty() { String::new() } else { format!("\n{}\n", self.tags.join("\n")) }
    }

    fn bytes(&self) -> i64 {
        let tags = self.tags_column();
        let texts = [&self.name, &self.notes, &tags, &self.name.to_lowercase()];
        texts.iter().map(|text| quotas::length(text.as_bytes())).sum::<i64>() + words::bytes(&self.words())
    }

    /// Returns the words of the name and of the tags.
    fn words(&self) -> BTreeSet<String> {
        words::findable(&format!("{}\n{}", self.name, self.tags.join("\n")))
    }
}

impl Store {
    /// Returns the labels of a tenant's policy or session; empty labels if there are none.
    pub async fn labels(&self, tenant: &Tenant, object: &str) -> Result<Labels, StoreError> {
        let find = query(FIND).bind(tenant.as_str()).bind(object);
        self.list("reading labels", find, |rows| rows.first().map_or(Ok(Labels::default()), Labels::from_row)).await
    }

    /// Changes the labels of a tenant's policy or session, and returns the new labels. Returns `None` if the tenant has
    /// no such thing.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the tenant's quota of bytes is used up.
    pub async fn relabel(
        &self,
        tenant: &Tenant,
        kind: Labelled,
        object: &str,
        change: Relabel,
    ) -> Result<Option<Labels>, StoreError> {
        let (tenant, object, actor, quotas) = (tenant.clone(), object.to_owned(), self.actor.clone(), self.quotas);
        self.write("changing labels", move |mut connection| {
            async move {
                let connection = &mut connection;
                let Some(sequence) = hold(connection, &tenant, kind, &object).await? else { return Ok(None) };
                if change.is_empty() {
                    return Ok(Some(stored(connection, &tenant, &object).await?));
                }
                let deed = match kind {
                    Labelled::Policy => AuditAction::LabelPolicy,
                    Labelled::Session => AuditAction::LabelSession,
                };
                let of = Worded { tenant: &tenant, kind, sequence };
                let (labels, grown) = put(connection, of, &object, &change).await?;
                quotas::take(connection, &tenant, grown, quotas).await?;
                audit_chain::record(connection, (quotas, &actor), &tenant, deed, &object, &outcome(&change)).await?;
                Ok(Some(labels))
            }
            .boxed()
        })
        .await
    }
}

async fn stored(connection: &mut StoreConnection<'_>, tenant: &Tenant, object: &str) -> Result<Labels, Failure> {
    let row = connection.row(query(FIND).bind(tenant.as_str()).bind(object)).await?;
    row.as_ref().map_or(Ok(Labels::default()), Labels::from_row)
}

const FIND: &str = "SELECT name, notes, tags FROM labels WHERE tenant = $1 AND object = $2";

/// Returns which labels were changed, for the audit.
fn outcome(change: &Relabel) -> String {
    let given = [("name", change.name.is_some()), ("notes", change.notes.is_some()), ("tags", change.tags.is_some())];
    let named: Vec<&str> = given.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
    format!("set {}", named.join(", "))
}

/// Locks a thing against deletion and changes of its labels until this transaction ends. Returns its row, if the tenant
/// has it.
pub(super) async fn hold(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    kind: Labelled,
    object: &str,
) -> Result<Option<i64>, Failure> {
    let find = query(match kind {
        Labelled::Policy => "SELECT sequence FROM policy_owners WHERE tenant = $1 AND policy = $2",
        Labelled::Session => "SELECT sequence FROM sessions WHERE tenant = $1 AND session = $2",
    });
    let find = find.bind(tenant.as_str()).bind(object).for_update_but_references();
    connection.row(find).await?.map(|row| row.get("sequence")).transpose()
}

/// Changes the labels of a thing that this transaction holds. Returns the new labels, and the additional bytes they
/// take.
pub(super) async fn put(
    connection: &mut StoreConnection<'_>,
    of: Worded<'_>,
    object: &str,
    change: &Relabel,
) -> Result<(Labels, Usage), Failure> {
    let before = stored(connection, of.tenant, object).await?;
    let (grown, former) = (-before.bytes(), before.words());
    let labels = before.after(change);
    let words = labels.words();
    let write = query(
        "INSERT INTO labels (tenant, object, name, notes, tags, folded_name, words)
         VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (tenant, object) DO UPDATE SET name = excluded.name, notes = excluded.notes,
                                                    tags = excluded.tags, folded_name = excluded.folded_name,
                                                    words = excluded.words",
    );
    let write = write
        .bind(of.tenant.as_str())
        .bind(object)
        .bind(labels.name.as_str())
        .bind(labels.notes.as_str())
        .bind(labels.tags_column())
        .bind(labels.name.to_lowercase())
        .bind(words::column(&words));
    connection.execute(write).await?;
    words::remove(connection, of, former.difference(&words).map(String::as_str)).await?;
    words::add(connection, of, words.difference(&former).map(String::as_str)).await?;
    let grown = grown + labels.bytes();
    Ok((labels, Usage::of_bytes(grown)))
}

/// Deletes the labels and all the words of a deleted thing. Returns the usage that the labels took.
pub(super) async fn remove(
    connection: &mut StoreConnection<'_>,
    of: Worded<'_>,
    object: &str,
) -> Result<Usage, Failure> {
    let labels = stored(connection, of.tenant, object).await?;
    let delete = query("DELETE FROM labels WHERE tenant = $1 AND object = $2");
    connection.execute(delete.bind(of.tenant.as_str()).bind(object)).await?;
    let (words, own) = (labels.words(), words::identifying(object));
    words::remove(connection, of, words.iter().map(String::as_str).chain([own.as_str()])).await?;
    Ok(Usage::of_bytes(labels.bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(json: &str) -> String {
        let change: Relabel = serde_json::from_str(json).unwrap();
        change.check().unwrap_err().field
    }

    #[test]
    fn every_rule_refuses_what_is_beyond_it_alone() {
        let (name, notes, tag) = ("é".repeat(LONGEST_NAME), "x\n".repeat(LONGEST_NOTES / 2), "t".repeat(LONGEST_TAG));
        let tags: Vec<String> = (1..MOST_TAGS).map(|tag| tag.to_string()).chain([tag.clone()]).collect();
        let most = Relabel { name: Some(name.clone()), notes: Some(notes.clone()), tags: Some(tags.clone()) };
        assert_eq!(most.check(), Ok(()));
        let field = |change: Relabel| change.check().unwrap_err().field;
        assert_eq!(field(Relabel { name: Some(name + "x"), ..most.clone() }), "name");
        assert_eq!(field(Relabel { notes: Some(notes + "x"), ..most.clone() }), "notes");
        let with = |tag: &str| Relabel { tags: Some([&tags[..], &[tag.into()]].concat()), ..most.clone() };
        assert_eq!(field(with("x")), "tags");
        for (json, field) in [
            (r#"{"name": "a\nb"}"#, "name"),
            (r#"{"notes": "a\u0007b"}"#, "notes"),
            (r#"{"tags": ["a", ""]}"#, "tags[1]"),
            (r#"{"tags": ["a", "b\tc"]}"#, "tags[1]"),
            (r#"{"tags": ["a", "b", "a"]}"#, "tags[2]"),
        ] {
            assert_eq!(refused(json), field, "{json}");
        }
        assert_eq!(refused(&format!(r#"{{"tags": ["{tag}x"]}}"#)), "tags[0]");
    }

    #[test]
    fn what_is_absent_stays_and_what_is_null_is_cleared() {
        let labels = Labels { name: "a".into(), notes: "b".into(), tags: vec!["c".into()] };
        let after = |json: &str| labels.clone().after(&serde_json::from_str(json).unwrap());
        assert_eq!(after("{}"), labels);
        assert_eq!(after(r#"{"name": null, "tags": []}"#), Labels { notes: "b".into(), ..Labels::default() });
        assert_eq!(after(r#"{"notes": "", "name": "d"}"#).name, "d");
    }
}
