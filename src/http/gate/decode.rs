//! Decodes bytes into a typed request; an error names the field, the value and the rule.

use std::borrow::Cow;
use std::fmt;

use serde::de::{DeserializeOwned, DeserializeSeed, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use serde_json::value::RawValue;
use serde_path_to_error::{Path, Segment};

use crate::control::error::FieldError;
use crate::http::problem::{ProblemDocument, ProblemKind, SHOWN_VALUE, shortened};

/// Explanations of required fields for which no default is right for everybody.
const MEANT: [(&str, &str); 1] = [(
    "problem.rate_per_step",
    "it is what the bank pays per period of problem.history, as a fraction; 3 % a year is 0.00247 if the periods are months",
)];

/// Parses a JSON body. Refuses NaN, infinities, numbers beyond double precision, unknown fields (if the type does),
/// trailing bytes and nesting deeper than 128.
pub fn json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ProblemDocument> {
    let mut reader = serde_json::Deserializer::from_slice(bytes);
    match serde_path_to_error::deserialize(&mut reader) {
        Err(error) if error.inner().is_data() => {
            let fractional = error.inner().to_string().starts_with("invalid type: floating point");
            let whole = if fractional { with_whole_numbers(bytes) } else { None };
            whole.ok_or_else(|| mismatch(bytes, dotted(error.path()), error.inner()))
        }
        Ok(value) => reader.end().map(|()| value).map_err(|error| syntax(bytes, "", &error)),
        Err(error) => {
            let path = dotted(error.path());
            let cause = error.into_inner();
            Err(misshapen(bytes, &path, &cause).unwrap_or_else(|| syntax(bytes, &path, &cause)))
        }
    }
}

/// Parses a JSON body as [`json`] does, but rejects a list, which serde would read as the fields in their order.
pub fn object<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ProblemDocument> {
    if bytes.trim_ascii_start().starts_with(b"[") {
        json::<IgnoredAny>(bytes)?;
        let error = FieldError::new("body", at(bytes, "").unwrap_or_default(), "must be an object");
        return Err(ProblemDocument::of_field(ProblemKind::InvalidField, error));
    }
    json(bytes)
}

/// Reads the parameters of a query string; all of them are text.
pub fn parameters<T: DeserializeOwned>(pairs: Vec<(String, String)>) -> Result<T, ProblemDocument> {
    let mut object = serde_json::Map::new();
    for (name, value) in pairs {
        if object.contains_key(&name) {
            return Err(ProblemDocument::of_parameter(&name, &value, "must be given once"));
        }
        object.insert(name, Value::String(value));
    }
    let given = object.clone();
    serde_path_to_error::deserialize(Value::Object(object)).map_err(|error| {
        let (path, message) = (dotted(error.path()), error.into_inner().to_string());
        let value_of = |field: &str| given.get(field).map(Value::to_string);
        ProblemDocument::of_field(ProblemKind::InvalidQuery, located(value_of, path, &message))
    })
}

/// Reads a body with every number such as 5.0 rewritten as 5, under the same rules. JSON Schema counts 5.0 as an
/// integer; serde does not.
fn with_whole_numbers<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(&whole_numbers(bytes)).ok()
}

/// Rewrites the JSON without fractions that consist of zeros only; minus zero keeps its fraction.
fn whole_numbers(bytes: &[u8]) -> Vec<u8> {
    let mut written = Vec::with_capacity(bytes.len());
    let (mut in_string, mut at) = (false, 0);
    while at < bytes.len() {
        let length = if in_string { 0 } else { bytes[at..].iter().take_while(|byte| is_numeric(**byte)).count() };
        if length > 0 {
            written.extend_from_slice(whole(&bytes[at..at + length]));
            at += length;
            continue;
        }
        let escaped = in_string && bytes[at] == b'\\' && at + 1 < bytes.len();
        in_string ^= bytes[at] == b'"';
        let end = at + 1 + usize::from(escaped);
        written.extend_from_slice(&bytes[at..end]);
        at = end;
    }
    written
}

fn is_numeric(byte: u8) -> bool {
    byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.' | b'e' | b'E')
}

fn whole(number: &[u8]) -> &[u8] {
    let Some(point) = number.iter().position(|byte| *byte == b'.') else { return number };
    let (whole, fraction) = (&number[..point], &number[point + 1..]);
    let is_whole = whole != b"-0" && !fraction.is_empty() && fraction.iter().all(|digit| *digit == b'0');
    if is_whole { whole } else { number }
}

/// Returns the problem of valid JSON of the wrong shape.
fn mismatch(bytes: &[u8], path: String, cause: &serde_json::Error) -> ProblemDocument {
    let value_of = |field: &str| at(bytes, field);
    ProblemDocument::of_field(ProblemKind::InvalidField, located(value_of, path, &without_position(cause)))
}

/// Returns the problem if the body is valid JSON after all. The parser reports an extra element like an extra byte, and
/// a list instead of a word, as a syntax error.
fn misshapen(bytes: &[u8], path: &str, cause: &serde_json::Error) -> Option<ProblemDocument> {
    const ELEMENT_TOO_MANY: &str = "trailing characters";
    const NO_NUMBER: &str = "number out of range";
    let message = without_position(cause);
    // Skipped values are not parsed as numbers, so the check below would miss this syntax error.
    if message == NO_NUMBER {
        return None;
    }
    serde_json::from_slice::<IgnoredAny>(bytes).ok()?;
    let value = at(bytes, path).or_else(|| at(bytes, ""))?;
    let rule = match message.as_str() {
        ELEMENT_TOO_MANY => "must have fewer elements".to_owned(),
        expected => format!("must have another type: {expected}"),
    };
    let field = if path.is_empty() { "body" } else { path };
    Some(ProblemDocument::of_field(ProblemKind::InvalidField, FieldError::new(field, value, rule)))
}

/// Names the field that a serde message is about: unknown and missing fields appear in the message, not in the path.
fn located(value_of: impl Fn(&str) -> Option<String>, path: String, message: &str) -> FieldError {
    let mut field = path;
    let mut rule = message.to_owned();
    for (marker, meaning) in [("unknown field `", "must be a known field"), ("missing field `", "must be given")] {
        let Some(name) = message.strip_prefix(marker).and_then(|rest| rest.split('`').next()) else { continue };
        if !field.ends_with(name) {
            field = if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") };
        }
        rule = match message.split_once("`, ") {
            Some((_, expected)) => format!("{meaning}: {expected}"),
            None => match MEANT.iter().find(|(named, _)| *named == field) {
                Some((_, meant)) => format!("{meaning}: {meant}"),
                None => meaning.to_owned(),
            },
        };
    }
    let value = value_of(&field).unwrap_or("null".to_owned());
    let field = if field.is_empty() { "body".to_owned() } else { field };
    FieldError::new(field, value, rule)
}

/// Returns the problem of text that is not JSON; it shows the token at which the parser stopped.
fn syntax(bytes: &[u8], path: &str, cause: &serde_json::Error) -> ProblemDocument {
    let field = if path.is_empty() { "body" } else { path };
    let rule = format!("must be JSON: {} at line {}, column {}", without_position(cause), cause.line(), cause.column());
    ProblemDocument::of_field(ProblemKind::MalformedJson, FieldError::new(field, token(bytes, cause), rule))
}

fn token(bytes: &[u8], cause: &serde_json::Error) -> String {
    let line = bytes.split(|&byte| byte == b'\n').nth(cause.line().saturating_sub(1)).unwrap_or_default();
    let delimiter = |byte: &u8| matches!(byte, b',' | b':' | b'[' | b'{' | b' ' | b'"');
    let stop = cause.column().saturating_sub(1).min(line.len());
    let start = line[..stop].iter().rposition(delimiter).map_or(0, |position| position + 1);
    let rest = &line[start..];
    let end = rest.iter().position(|byte| matches!(byte, b',' | b']' | b'}' | b' ')).unwrap_or(rest.len());
    String::from_utf8_lossy(&rest[..end]).into_owned()
}

fn without_position(cause: &serde_json::Error) -> String {
    let message = cause.to_string();
    match message.rfind(" at line ") {
        Some(end) => message[..end].to_owned(),
        None => message,
    }
}

fn dotted(path: &Path) -> String {
    let mut text = String::new();
    for segment in path {
        match segment {
            Segment::Seq { index } => text.push_str(&format!("[{index}]")),
            Segment::Map { key } | Segment::Enum { variant: key } => {
                if !text.is_empty() {
                    text.push('.');
                }
                text.push_str(key);
            }
            Segment::Unknown => {}
        }
    }
    text
}

/// Returns the text of the value at a dotted path, as far as a problem shows it. Values off the path are skipped,
/// because a tree of a large body would take ten times its bytes.
fn at(bytes: &[u8], field: &str) -> Option<String> {
    let path: Vec<&str> = field.split(['.', '[']).filter(|part| !part.is_empty()).collect();
    Along(&path).deserialize(&mut serde_json::Deserializer::from_slice(bytes)).ok()?
}

/// The path from a value to one inside it.
struct Along<'a>(&'a [&'a str]);

impl<'de> DeserializeSeed<'de> for Along<'_> {
    type Value = Option<String>;

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<Self::Value, D::Error> {
        if self.0.is_empty() {
            let text = <&RawValue>::deserialize(reader)?.get();
            return Ok(Some(match text.len() <= SHOWN_VALUE {
                true => serde_json::from_str::<Value>(text).map_or(text.to_owned(), |value| value.to_string()),
                false => shortened(text, SHOWN_VALUE + 1),
            }));
        }
        reader.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Along<'_> {
    type Value = Option<String>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Self::Value, A::Error> {
        let mut found = None;
        while let Some(name) = fields.next_key::<Cow<'de, str>>()? {
            if name == self.0[0] {
                found = fields.next_value_seed(Along(&self.0[1..]))?;
            } else {
                fields.next_value::<IgnoredAny>()?;
            }
        }
        Ok(found)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let wanted = self.0[0].strip_suffix(']').and_then(|index| index.parse::<usize>().ok());
        let (mut found, mut index) = (None, 0);
        loop {
            let is_there = if wanted == Some(index) {
                elements.next_element_seed(Along(&self.0[1..]))?.map(|value| found = value)
            } else {
                elements.next_element::<IgnoredAny>()?.map(drop)
            };
            if is_there.is_none() {
                return Ok(found);
            }
            index += 1;
        }
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_str<E>(self, _: &str) -> Result<Self::Value, E> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::request::specification::{ProblemSpecification, Specification};

    fn refused(body: &str) -> (String, Value, String) {
        let problem = json::<Specification>(body.as_bytes()).unwrap_err();
        (problem.field.unwrap().into(), *problem.value.unwrap(), problem.rule.unwrap().into())
    }

    #[test]
    fn a_wrong_type_names_field_and_value() {
        let (field, value, rule) = refused(r#"{"problem": {"history": [0.1, "x"]}}"#);
        assert_eq!((field.as_str(), value), ("problem.history[1]", Value::from("x")));
        assert!(rule.contains("expected f64"), "{rule}");
    }

    #[test]
    fn unknown_and_missing_fields_are_named() {
        let (field, value, _) = refused(r#"{"problem": {"history": [0.1], "colour": 3}}"#);
        assert_eq!((field.as_str(), value), ("problem.colour", Value::from(3)));
        assert_eq!(refused(r#"{"problem": {"rate_per_step": 0.001}}"#).0, "problem.history");
        let (field, value, rule) = refused(r#"{"problem": {"history": [0.1]}}"#);
        assert_eq!((field.as_str(), value), ("problem.rate_per_step", Value::Null));
        assert!(rule.starts_with("must be given: it is what the bank pays per period"), "{rule}");
        assert_eq!(
            refused(r#"{"problem": {"history": [], "utility": {"kind": "log", "x": 1}}}"#).0,
            "problem.utility.x"
        );
    }

    #[test]
    fn an_element_too_many_is_no_fault_of_the_syntax() {
        let body = r#"{"problem": {"history": [], "action_interval": [0, 1, 2]}}"#;
        assert_eq!(json::<Specification>(body.as_bytes()).unwrap_err().kind.as_ref(), "/problems/invalid-field");
        let (field, _, rule) = refused(body);
        assert_eq!((field.as_str(), rule.as_str()), ("problem.action_interval", "must have fewer elements"));
    }

    #[test]
    fn literals_that_are_not_finite_numbers_are_shown() {
        let (field, value, _) = refused(r#"{"problem": {"history": [0.1, NaN]}}"#);
        assert_eq!((field.as_str(), value), ("problem.history[1]", Value::from("NaN")));
        assert_eq!(refused(r#"{"problem": {"history": [0.1, 1e999]}}"#).0, "problem.history[1]");
    }

    #[test]
    fn a_deep_list_is_not_called_a_long_one() {
        for depth in [1, 2, 3, 4, 127] {
            let (_, _, rule) = refused(&format!("{}{}", "[".repeat(depth), "]".repeat(depth)));
            assert!(!rule.contains("fewer elements"), "{depth}: {rule}");
        }
        let (_, _, rule) = refused(&format!("{}{}", "[".repeat(128), "]".repeat(128)));
        assert!(!rule.contains("fewer elements"), "{rule}");
    }

    #[test]
    fn refused_text_is_shown_in_part() {
        let long = "x".repeat(4 << 20);
        for body in [
            format!(r#"{{"problem": "{long}"}}"#),
            format!(r#"{{"{long}": 1}}"#),
            format!(r#"{{"problem": {{"{long}": 1}}}}"#),
            format!(r#"{{"problem": {{"history": [0.1], "utility": {{"kind": "{long}"}}}}}}"#),
            format!(r#"{{"problem": {{"history": [{long}]}}}}"#),
        ] {
            let shown = serde_json::to_string(&json::<Specification>(body.as_bytes()).unwrap_err()).unwrap();
            assert!(shown.len() < 2000, "{}: {}", &body[..20], shown.len());
        }
    }

    #[test]
    fn a_whole_number_may_be_written_with_a_point() {
        let read = |body: &str| json::<Specification>(body.as_bytes());
        let dotted =
            read(r#"{"problem": {"history": [1.0, -0.0], "rate_per_step": 0.0, "horizon": 3.0}, "seed": 7.0}"#)
                .unwrap();
        let whole = r#"{"problem": {"history": [1, -0.0], "rate_per_step": 0, "horizon": 3}, "seed": 7}"#;
        let completed = |read: Specification| Specification {
            problem: ProblemSpecification { utility: Default::default(), ..read.problem },
            ..read
        };
        assert_eq!(completed(dotted), completed(read(whole).unwrap()));
        assert_eq!(refused(r#"{"problem": {"history": [1.0], "horizon": 3.5}}"#).0, "problem.horizon");
        let twice = r#"{"problem": {"history": [1.0], "horizon": 3.0, "horizon": 3}}"#;
        assert!(read(twice).is_err(), "a field given twice");
        let text = br#"{"1.0": "a\\\"1.0", "b\"": [2.50, -0.0, 1.0e3, 70.00]}"#;
        assert_eq!(whole_numbers(text), br#"{"1.0": "a\\\"1.0", "b\"": [2.50, -0.0, 1.0e3, 70]}"#);
    }

    #[test]
    fn depth_is_bounded() {
        let bomb = format!(r#"{{"problem": {}"#, "[".repeat(100_000));
        assert!(json::<Value>(bomb.as_bytes()).unwrap_err().rule.unwrap().contains("recursion limit"));
    }
}
