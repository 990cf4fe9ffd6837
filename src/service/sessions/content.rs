//! The JSON that is stored for a session.
//!
//! The start of a session with several assets holds their names. In its entries, each map from names to numbers is
//! replaced by the index of a list of the numbers in the order of the names. Each list is stored once. So the size of
//! an entry depends on the number of assets, and not on the length of their names.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json as object};

use crate::service::error::ServiceError;
use crate::store::{EntryKind, EntryRow};

/// The only key of an object that stands for a map from names; no field has this name, and no lone asset.
const LIST: &str = "$";
const NUMBER_BYTES: usize = size_of::<f64>();

pub(in crate::service) fn json(of: &impl Serialize) -> Result<String, ServiceError> {
    serde_json::to_string(of).map_err(ServiceError::internal)
}

pub(in crate::service) fn read<'a, T: Deserialize<'a>>(json: &'a str) -> Result<T, ServiceError> {
    serde_json::from_str(json).map_err(ServiceError::internal)
}

/// The stored form of an entry.
pub(in crate::service) struct Packed {
    pub content_json: String,
    pub answer_json: String,
    pub numbers: Vec<u8>,
    /// The answer as it is sent.
    pub sent: String,
}

impl Packed {
    /// Packs the entry of a session with the assets `names`, which are empty for a session with one asset.
    pub(in crate::service) fn of(
        content: &impl Serialize,
        answer: &impl Serialize,
        names: &[String],
    ) -> Result<Self, ServiceError> {
        let (sent, mut lists) = (json(answer)?, Lists { names, numbers: Vec::new() });
        // The content goes first, so that its lists come first and do not depend on the answer.
        let (content_json, answer_json) = (lists.text(content)?, lists.text(answer)?);
        Ok(Packed { content_json, answer_json, numbers: lists.numbers, sent })
    }
}

/// Returns whether `row` records this content.
pub(in crate::service) fn records(
    row: &EntryRow,
    content: &impl Serialize,
    names: &[String],
) -> Result<bool, ServiceError> {
    let mut lists = Lists { names, numbers: Vec::new() };
    Ok(row.content_json == lists.text(content)? && row.numbers.starts_with(&lists.numbers))
}

/// Reads the content of an entry of a session with these assets.
pub(in crate::service) fn content<T: DeserializeOwned>(row: &EntryRow, names: &[String]) -> Result<T, ServiceError> {
    unpacked(&row.content_json, row, names)
}

/// Reads the answer of an entry of a session with these assets.
pub(in crate::service) fn answer<T: DeserializeOwned>(row: &EntryRow, names: &[String]) -> Result<T, ServiceError> {
    unpacked(&row.answer_json, row, names)
}

/// Reads the names of several assets from the answer of a renewal that changed them.
pub(in crate::service) fn names_after(row: &EntryRow) -> Result<Option<Vec<String>>, ServiceError> {
    #[derive(Deserialize)]
    struct WithNames {
        #[serde(default)]
        names: Option<Vec<String>>,
    }
    match row.kind {
        EntryKind::Renewal => Ok(read::<WithNames>(&row.answer_json)?.names),
        EntryKind::Observation | EntryKind::Correction => Ok(None),
    }
}

fn unpacked<T: DeserializeOwned>(text: &str, row: &EntryRow, names: &[String]) -> Result<T, ServiceError> {
    if names.is_empty() {
        return read(text);
    }
    let value = unpack(read(text)?, &row.numbers, names)?;
    serde_json::from_value(value).map_err(ServiceError::internal)
}

/// Lists of one number for each name, one list after the other.
struct Lists<'a> {
    names: &'a [String],
    numbers: Vec<u8>,
}

impl Lists<'_> {
    fn text(&mut self, of: &impl Serialize) -> Result<String, ServiceError> {
        if self.names.is_empty() {
            return json(of);
        }
        let value = serde_json::to_value(of).map_err(ServiceError::internal)?;
        json(&self.pack(value))
    }

    fn pack(&mut self, value: Value) -> Value {
        match value {
            Value::Array(items) => items.into_iter().map(|item| self.pack(item)).collect(),
            Value::Object(map) => match self.packed(&map) {
                Some(place) => object!({ LIST: place }),
                None => map.into_iter().map(|(key, value)| (key, self.pack(value))).collect(),
            },
            other => other,
        }
    }

    /// Returns the index of a map from names to numbers. For a map to objects of numbers, returns one index for each
    /// field.
    fn packed(&mut self, map: &Map<String, Value>) -> Option<Value> {
        if map.len() != self.names.len() {
            return None;
        }
        let values: Option<Vec<&Value>> = self.names.iter().map(|name| map.get(name)).collect();
        let values = values?;
        let Some(first) = values.first()?.as_object() else { return self.list(&values) };
        let same = |value: &&Value| value.as_object().is_some_and(|object| object.keys().eq(first.keys()));
        let numbers = |value: &&Value| value.as_object().is_some_and(|object| object.values().all(Value::is_f64));
        if !values.iter().all(|value| same(value) && numbers(value)) {
            return None;
        }
        let field = |key: &String| {
            let column: Vec<&Value> = values.iter().map(|value| &value[key]).collect();
            Some((key.clone(), self.list(&column)?))
        };
        first.keys().map(field).collect::<Option<Map<String, Value>>>().map(Value::Object)
    }

    fn list(&mut self, values: &[&Value]) -> Option<Value> {
        let numbers: Option<Vec<f64>> = values.iter().map(|value| value.as_f64().filter(|_| value.is_f64())).collect();
        let bytes: Vec<u8> = numbers?.into_iter().flat_map(f64::to_le_bytes).collect();
        let length = bytes.len();
        let index = self.numbers.chunks_exact(length).position(|list| list == bytes).unwrap_or_else(|| {
            self.numbers.extend(bytes);
            self.numbers.len() / length - 1
        });
        Some(index.into())
    }
}

fn unpack(value: Value, numbers: &[u8], names: &[String]) -> Result<Value, ServiceError> {
    let again = |value| unpack(value, numbers, names);
    match value {
        Value::Array(items) => items.into_iter().map(again).collect(),
        Value::Object(map) if map.len() == 1 && map.contains_key(LIST) => match &map[LIST] {
            Value::Object(columns) => {
                let columns: Vec<_> = columns
                    .iter()
                    .map(|(key, index)| Ok((key, list(index, numbers, names)?)))
                    .collect::<Result<_, ServiceError>>()?;
                let of = |(asset, name): (usize, &String)| {
                    let fields = columns.iter().map(|(key, list)| ((*key).clone(), Value::from(list[asset])));
                    (name.clone(), fields.collect::<Value>())
                };
                Ok(names.iter().enumerate().map(of).collect())
            }
            index => Ok(names.iter().cloned().zip(list(index, numbers, names)?).collect()),
        },
        Value::Object(map) => map.into_iter().map(|(key, value)| Ok((key, again(value)?))).collect(),
        other => Ok(other),
    }
}

/// Returns the list with this index.
fn list(index: &Value, numbers: &[u8], names: &[String]) -> Result<Vec<f64>, ServiceError> {
    let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
    let mut lists = numbers.chunks_exact(names.len() * NUMBER_BYTES);
    let list = index.and_then(|index| lists.nth(index));
    let list = list.ok_or_else(|| ServiceError::internal("an entry names a list that it does not contain"))?;
    Ok(list.as_chunks::<NUMBER_BYTES>().0.iter().map(|number| f64::from_le_bytes(*number)).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn recorded(packed: &Packed) -> EntryRow {
        EntryRow {
            session: "session".into(),
            entry: 1,
            kind: EntryKind::Observation,
            number: 1,
            content_json: packed.content_json.clone(),
            answer_json: packed.answer_json.clone(),
            numbers: packed.numbers.clone(),
            created_ms: 0,
            key: String::new(),
        }
    }

    /// Packs and unpacks `entry`.
    fn through(entry: &Value, names: &[String]) -> (Packed, Value) {
        let packed = Packed::of(entry, entry, names).unwrap();
        let row = recorded(&packed);
        assert!(records(&row, entry, names).unwrap());
        assert_eq!(content::<Value>(&row, names).unwrap(), answer::<Value>(&row, names).unwrap());
        (packed, answer(&row, names).unwrap())
    }

    #[test]
    fn an_entry_comes_back_bit_for_bit_without_the_names() {
        let names = ["wealth", "a \"quoted\" name", "$"].map(str::to_owned);
        let by_name = |values: [f64; 3]| names.iter().cloned().zip(values).collect::<BTreeMap<_, _>>();
        let means: BTreeMap<_, _> =
            names.iter().map(|name| (name.clone(), object!({ "seen": 0.1, "worst": -0.0 }))).collect();
        let entry = object!({
            "log_returns": by_name([0.1 + 0.2, -0.0, f64::MIN_POSITIVE]), "executed": by_name([0.5, 0.25, 0.25]),
            "advised": by_name([0.5, 0.25, 0.25]), "worst_means": means, "wealth": 1.5, "nothing": null,
            "list": [by_name([1.0, 2.0, 3.0]), "text", 7], "others": { "wealth": 1.0, "$": 2.0 }
        });
        let (packed, back) = through(&entry, &names);
        assert_eq!(serde_json::to_string(&back).unwrap(), serde_json::to_string(&entry).unwrap());
        assert!(!packed.answer_json.contains("quoted"), "{}", packed.answer_json);
        // A repeated list is stored once.
        assert_eq!(packed.numbers.len(), 5 * names.len() * NUMBER_BYTES);
    }

    #[test]
    fn of_one_asset_nothing_is_changed() {
        let entry = object!({ "log_return": 0.25, "session": "s" });
        let (packed, back) = through(&entry, &[]);
        assert_eq!((&packed.answer_json, &back, packed.numbers.len()), (&packed.sent, &entry, 0));
    }

    #[test]
    fn another_content_is_told_from_it() {
        let names = ["stocks", "bonds"].map(str::to_owned);
        let report = |stocks: f64, other: &str| object!({ "log_returns": { "stocks": stocks, other: 0.5 } });
        let packed = Packed::of(&report(0.25, "bonds"), &object!({}), &names).unwrap();
        let row = recorded(&packed);
        assert!(records(&row, &report(0.25, "bonds"), &names).unwrap());
        for other in [report(0.26, "bonds"), report(0.25, "gold"), object!({ "missing": true })] {
            assert!(!records(&row, &other, &names).unwrap(), "{other}");
        }
    }
}
