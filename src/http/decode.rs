//! From bytes to a typed request, naming the field, the value and the rule when they disagree.

use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_path_to_error::{Path, Segment};

use super::problem::{Problem, ProblemKind};
use crate::control::error::FieldError;

/// Values longer than this are cut when shown back.
const SHOWN_CHARACTERS: usize = 80;

/// Parses a JSON body. Refuses NaN, infinities, numbers beyond double precision, unknown fields (where the type
/// does), trailing bytes and nesting deeper than 128.
pub fn json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let mut reader = serde_json::Deserializer::from_slice(bytes);
    match serde_path_to_error::deserialize(&mut reader) {
        Ok(value) => reader.end().map(|()| value).map_err(|error| syntax(bytes, "", &error)),
        Err(error) => {
            let path = dotted(error.path());
            let cause = error.into_inner();
            match cause.classify() {
                serde_json::error::Category::Data => Err(mismatch(bytes, path, &cause)),
                _ => Err(overlong(bytes, &path).unwrap_or_else(|| syntax(bytes, &path, &cause))),
            }
        }
    }
}

/// Reads the parameters of a query string, all of them text.
pub fn parameters<T: DeserializeOwned>(pairs: Vec<(String, String)>) -> Result<T, Problem> {
    let mut object = serde_json::Map::new();
    for (name, value) in pairs {
        if object.contains_key(&name) {
            let error = FieldError::new(name, shortened(&value), "must be given once");
            return Err(Problem::of_field(ProblemKind::InvalidQuery, error));
        }
        object.insert(name, Value::String(value));
    }
    let given = Value::Object(object.clone());
    serde_path_to_error::deserialize(Value::Object(object)).map_err(|error| {
        let (path, message) = (dotted(error.path()), error.into_inner().to_string());
        Problem::of_field(ProblemKind::InvalidQuery, located(&given, path, &message))
    })
}

/// Valid JSON of the wrong shape.
fn mismatch(bytes: &[u8], path: String, cause: &serde_json::Error) -> Problem {
    let given = serde_json::from_slice(bytes).unwrap_or(Value::Null);
    Problem::of_field(ProblemKind::InvalidField, located(&given, path, &without_position(cause)))
}

/// The parser stops at an element too many as at a byte too many; the body is JSON all the same.
fn overlong(bytes: &[u8], path: &str) -> Option<Problem> {
    let given: Value = serde_json::from_slice(bytes).ok()?;
    let value = lookup(&given, path).unwrap_or(&given);
    let error = FieldError::new(path, shortened(&value.to_string()), "must have fewer elements");
    Some(Problem::of_field(ProblemKind::InvalidField, error))
}

/// Names the field a message of serde is about: unknown and missing fields stand in the message, not in the path.
fn located(given: &Value, path: String, message: &str) -> FieldError {
    let mut field = path;
    let mut rule = message.to_owned();
    for (marker, meaning) in [("unknown field `", "is not a field here"), ("missing field `", "must be given")] {
        let Some(name) = message.strip_prefix(marker).and_then(|rest| rest.split('`').next()) else { continue };
        if !field.ends_with(name) {
            field = if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") };
        }
        rule = match message.split_once("`, ") {
            Some((_, expected)) => format!("{meaning}: {expected}"),
            None => meaning.to_owned(),
        };
    }
    let value = lookup(given, &field).map_or("null".to_owned(), Value::to_string);
    let field = if field.is_empty() { "body".to_owned() } else { field };
    FieldError::new(field, shortened(&value), rule)
}

/// Text that is not JSON: shows the token the parser stopped at.
fn syntax(bytes: &[u8], path: &str, cause: &serde_json::Error) -> Problem {
    let field = if path.is_empty() { "body" } else { path };
    let rule = format!("must be JSON: {} at line {}, column {}", without_position(cause), cause.line(), cause.column());
    Problem::of_field(ProblemKind::MalformedJson, FieldError::new(field, token(bytes, cause), rule))
}

fn token(bytes: &[u8], cause: &serde_json::Error) -> String {
    let line = bytes.split(|&byte| byte == b'\n').nth(cause.line().saturating_sub(1)).unwrap_or_default();
    let delimiter = |byte: &u8| matches!(byte, b',' | b':' | b'[' | b'{' | b' ' | b'"');
    let stop = cause.column().saturating_sub(1).min(line.len());
    let start = line[..stop].iter().rposition(delimiter).map_or(0, |position| position + 1);
    let rest = &line[start..];
    let end = rest.iter().position(|byte| matches!(byte, b',' | b']' | b'}' | b' ')).unwrap_or(rest.len());
    shortened(&String::from_utf8_lossy(&rest[..end]))
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

fn lookup<'a>(given: &'a Value, field: &str) -> Option<&'a Value> {
    field.split(['.', '[']).filter(|part| !part.is_empty()).try_fold(given, |value, part| {
        match part.strip_suffix(']') {
            Some(index) => value.get(index.parse::<usize>().ok()?),
            None => value.get(part),
        }
    })
}

fn shortened(text: &str) -> String {
    match text.char_indices().nth(SHOWN_CHARACTERS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::specification::Specification;

    fn refused(body: &str) -> (String, Value, String) {
        let problem = json::<Specification>(body.as_bytes()).unwrap_err();
        (problem.field.unwrap(), *problem.value.unwrap(), problem.rule.unwrap().into())
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
        assert_eq!(refused(r#"{"problem": {}}"#).0, "problem.history");
        assert_eq!(
            refused(r#"{"problem": {"history": [], "utility": {"kind": "log", "x": 1}}}"#).0,
            "problem.utility.x"
        );
    }

    #[test]
    fn an_element_too_many_is_no_fault_of_the_syntax() {
        let body = r#"{"problem": {"history": [], "action_interval": [0, 1, 2]}}"#;
        assert_eq!(json::<Specification>(body.as_bytes()).unwrap_err().kind, "/problems/invalid-field");
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
    fn depth_is_bounded() {
        let bomb = format!(r#"{{"problem": {}"#, "[".repeat(100_000));
        assert!(json::<Value>(bomb.as_bytes()).unwrap_err().rule.unwrap().contains("recursion limit"));
    }
}
