//! Objects that hold one value for each of some names.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserializer, Error, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::control::error::FieldError;

/// Returns the values in the order of `names`. Every name must have a value. Errors call what is named a `noun`.
///
/// # Errors
/// A value has a name that is not in `names`, or a name has no value.
pub fn by_name<T: Copy + Serialize>(
    field: &str,
    noun: &str,
    values: &BTreeMap<String, T>,
    names: &[String],
) -> Result<Vec<T>, FieldError> {
    if let Some((other, value)) = values.iter().find(|(name, _)| !names.contains(name)) {
        let rule = format!("must name one of the {noun}s: {}", names.join(", "));
        return Err(FieldError::new(format!("{field}.{other}"), serde_json::json!(value), rule));
    }
    let of = |name: &String| {
        let value = values.get(name).copied();
        value.ok_or_else(|| {
            let rule = format!("must be given: every {noun} needs a value");
            FieldError::new(format!("{field}.{name}"), "null", rule)
        })
    };
    names.iter().map(of).collect()
}

/// Reads an object with one value for each name, and refuses a name that occurs twice. Otherwise its last value would
/// silently replace the first.
pub fn distinct<'de, D: Deserializer<'de>, V: Deserialize<'de>>(source: D) -> Result<BTreeMap<String, V>, D::Error> {
    Distinct::deserialize(source).map(|Distinct(found)| found)
}

/// Reads such an object or null.
pub fn distinct_if_given<'de, D: Deserializer<'de>, V: Deserialize<'de>>(
    source: D,
) -> Result<Option<BTreeMap<String, V>>, D::Error> {
    Ok(Option::<Distinct<V>>::deserialize(source)?.map(|Distinct(found)| found))
}

/// Reads such an object of such objects.
pub fn distinct_twice<'de, D: Deserializer<'de>, V: Deserialize<'de>>(
    source: D,
) -> Result<BTreeMap<String, BTreeMap<String, V>>, D::Error> {
    let found: BTreeMap<String, Distinct<V>> = distinct(source)?;
    Ok(found.into_iter().map(|(name, Distinct(of_name))| (name, of_name)).collect())
}

struct Distinct<V>(BTreeMap<String, V>);

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Distinct<V> {
    fn deserialize<D: Deserializer<'de>>(source: D) -> Result<Self, D::Error> {
        source.deserialize_map(DistinctNames(PhantomData)).map(Distinct)
    }
}

struct DistinctNames<V>(PhantomData<V>);

impl<'de, V: Deserialize<'de>> Visitor<'de> for DistinctNames<V> {
    type Value = BTreeMap<String, V>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object by name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut found = BTreeMap::new();
        while let Some((name, value)) = map.next_entry::<String, V>()? {
            if found.contains_key(&name) {
                return Err(A::Error::custom(format!("`{name}` stands twice")));
            }
            found.insert(name, value);
        }
        Ok(found)
    }
}
