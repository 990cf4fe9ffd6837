//! The description as a page of Markdown, for people: every call, and every field that is sent or answered.
//!
//! `ballast openapi --page` prints it, and `docs/requests.md` is its output. `docs/problem.md` and `docs/sessions.md`
//! explain what the fields do.

use std::collections::BTreeSet;
use std::fmt::Write;

use serde_json::{Map, Value};
use utoipa::openapi::{OpenApi, RefOr, Schema};

const REFERENCE: &str = "#/components/schemas/";
/// Longest line of an example.
const WIDTH: usize = 120;
/// The beginning of the page. Everything after it follows from the description.
const HEAD: &str = include_str!("reference/head.md");

/// Returns the page of a description.
pub fn page(described: &OpenApi) -> String {
    let mut page = HEAD.to_owned();
    let description = &serde_json::to_value(described).unwrap_or_default();
    let page_of = ReferencePage { described, schemas: &description["components"]["schemas"] };
    let mut named = BTreeSet::new();
    for tag in list(&description["tags"]) {
        let name = text(&tag["name"]);
        let _ = write!(page, "\n# {}\n\n{}\n", capitalised(name), text(&tag["description"]));
        for (path, methods) in members(&description["paths"]) {
            for (method, operation) in members(methods) {
                if list(&operation["tags"]).any(|of| of == name) {
                    let _ = write!(page, "\n## `{} {path}`\n", method.to_uppercase());
                    page.push_str(&page_of.operation(operation, &mut named));
                }
            }
        }
    }
    page.push_str("\n# Types\n\nThe objects of the calls above, in alphabetical order.\n");
    for name in page_of.with_those_inside(named) {
        let _ = write!(page, "\n## `{name}`\n\n{}", page_of.type_of(&name));
    }
    page
}

/// A page in progress.
struct ReferencePage<'a> {
    described: &'a OpenApi,
    schemas: &'a Value,
}

impl ReferencePage<'_> {
    fn operation(&self, operation: &Value, named: &mut BTreeSet<String>) -> String {
        let mut section = String::new();
        for part in ["summary", "description"] {
            if let Some(words) = operation[part].as_str() {
                let _ = write!(section, "\n{}\n", flowing(words));
            }
        }
        let parameters: Vec<&Value> = list(&operation["parameters"]).collect();
        if !parameters.is_empty() {
            section.push_str("\n| parameter | in | type | meaning |\n|---|---|---|---|\n");
        }
        for parameter in parameters {
            let (name, place) = (text(&parameter["name"]), text(&parameter["in"]));
            let (kind, meaning) = (self.kind(&parameter["schema"], ""), cell(text(&parameter["description"])));
            references(&parameter["schema"], named);
            let _ = writeln!(section, "| `{name}` | {place} | {kind} | {meaning} |");
        }
        let body = &operation["requestBody"]["content"]["application/json"];
        if let Some(sent) = members(&operation["requestBody"]["content"]).map(|(_, content)| content).next() {
            references(&sent["schema"], named);
            let _ = write!(section, "\nBody: {}.\n", self.kind(&sent["schema"], ""));
        }
        if !body["example"].is_null() {
            let _ = write!(section, "\n```json\n{}\n```\n", example(&body["example"], 0));
        }
        section.push('\n');
        for (status, response) in members(&operation["responses"]).filter(|(status, _)| status.starts_with('2')) {
            let content = members(&response["content"]).map(|(_, content)| &content["schema"]).next();
            let kind = content.filter(|schema| schema["$ref"].is_string()).map(|schema| self.kind(schema, ""));
            content.into_iter().for_each(|schema| references(schema, named));
            let answer = kind.unwrap_or_else(|| flowing(text(&response["description"])));
            let _ = writeln!(section, "Answer {status}: {}.", answer.trim_end_matches('.'));
        }
        section
    }

    /// Returns the names with those of the types inside, in alphabetical order.
    fn with_those_inside(&self, named: BTreeSet<String>) -> BTreeSet<String> {
        let (mut all, mut open) = (BTreeSet::new(), Vec::from_iter(named));
        while let Some(name) = open.pop() {
            let mut inside = BTreeSet::new();
            references(&self.schemas[&name], &mut inside);
            if all.insert(name) {
                open.extend(inside);
            }
        }
        all
    }

    fn type_of(&self, name: &str) -> String {
        let about = self.schemas[name]["description"].as_str().map(|words| format!("{}\n", flowing(words)));
        let contents = self.described.components.as_ref().and_then(|components| components.schemas.get(name));
        about.unwrap_or_default() + &contents.map(|schema| self.contents(schema)).unwrap_or_default()
    }

    /// Returns the fields of a type in the order of their declaration, or its variants.
    fn contents(&self, schema: &RefOr<Schema>) -> String {
        let mut contents = String::new();
        match schema {
            RefOr::T(Schema::OneOf(variants)) => variants.items.iter().for_each(|variant| {
                let value = as_value(variant);
                if value["type"] != "null" {
                    let name = tag(&value).map_or_else(|| self.kind(&value, ""), |name| format!("`{name}`"));
                    let about = value["description"].as_str().map(|words| format!(": {}", flowing(words)));
                    let _ = write!(contents, "\n{name}{}\n", about.unwrap_or_default());
                    contents.push_str(&self.contents(variant));
                }
            }),
            RefOr::T(Schema::AllOf(parts)) => parts.items.iter().for_each(|part| match part {
                RefOr::Ref(_) => drop(write!(contents, "\nThe fields of {}, and:\n", self.kind(&as_value(part), ""))),
                RefOr::T(_) => contents.push_str(&self.contents(part)),
            }),
            RefOr::T(Schema::Object(object)) => {
                let fields = object.properties.iter().map(|(name, field)| (name, as_value(field)));
                let fields: Vec<_> = fields.filter(|(_, field)| only_value(field).is_none()).collect();
                if !fields.is_empty() {
                    contents.push_str("\n| field | type | default | meaning |\n|---|---|---|---|\n");
                }
                for (name, field) in fields {
                    let row = self.row(name, &field, object.required.contains(name));
                    contents.push_str(&row);
                }
            }
            _ => {}
        }
        contents
    }

    fn row(&self, name: &str, field: &Value, is_required: bool) -> String {
        let variants = || list(&field["oneOf"]).find_map(|variant| variant["description"].as_str());
        let words = flowing(field["description"].as_str().or_else(variants).unwrap_or_default());
        let (meaning, in_words) = without_default(&words);
        let default = match (&field["default"], in_words) {
            (_, Some(words)) => words.to_owned(),
            (Value::Null, None) if is_required => "required".to_owned(),
            (Value::Null, None) => String::new(),
            (value, None) => format!("`{value}`"),
        };
        format!("| `{name}` | {} | {} | {} |\n", self.kind(field, &words), cell(&default), cell(&meaning))
    }

    /// Returns the type of a value in words, with the bounds that `beside` does not say.
    fn kind(&self, schema: &Value, beside: &str) -> String {
        if let Some(name) = schema["$ref"].as_str().and_then(|name| name.strip_prefix(REFERENCE)) {
            return format!("[`{name}`](#{})", name.to_lowercase());
        }
        let variants: Vec<&Value> = list(&schema["oneOf"]).chain(list(&schema["anyOf"])).collect();
        if !variants.is_empty() {
            let kinds: Vec<String> = variants.into_iter().map(|variant| self.kind(variant, beside)).collect();
            return kinds.join(" or ");
        }
        let words: Vec<String> = list(&schema["enum"]).map(|word| format!("`{}`", text(word))).collect();
        if !words.is_empty() {
            return words.join(", ");
        }
        let kinds: Vec<&str> = match &schema["type"] {
            Value::String(kind) => vec![kind.as_str()],
            kinds => list(kinds).map(text).collect(),
        };
        let kinds: Vec<String> = kinds.into_iter().map(|kind| self.plain(kind, schema, beside)).collect();
        if kinds.is_empty() { "any".into() } else { kinds.join(" or ") }
    }

    fn plain(&self, kind: &str, schema: &Value, beside: &str) -> String {
        let range = |names: [&str; 2]| range(names.map(|name| &schema[name]), beside);
        match kind {
            "array" => {
                let count =
                    range(["minItems", "maxItems"]).map(|range| format!("; {range} of them")).unwrap_or_default();
                let distinct = if schema["uniqueItems"] == true { ", all different" } else { "" };
                format!("list of {}{count}{distinct}", self.kind(&schema["items"], beside))
            }
            "object" if schema["additionalProperties"].is_object() => {
                format!("{} by name", self.kind(&schema["additionalProperties"], beside))
            }
            "string" => match (range(["minLength", "maxLength"]), schema["format"].as_str()) {
                (Some(range), _) => format!("text of {range} characters"),
                (None, Some("date")) => "day".into(),
                (None, _) => "text".into(),
            },
            "integer" | "number" => {
                let above = schema["exclusiveMinimum"].as_f64().map(|low| format!(" above {}", number(low)));
                let range = range(["minimum", "maximum"]).map(|range| format!(", {range}")).unwrap_or_default();
                format!("{kind}{}{range}", above.unwrap_or_default())
            }
            kind => kind.into(),
        }
    }
}

/// Returns the range between two ends in words. Returns `None` if there is no end, if it excludes only counts below 0, or
/// if both ends are named `beside`.
fn range(ends: [&Value; 2], beside: &str) -> Option<String> {
    let ends = ends.map(Value::as_f64);
    if ends.iter().flatten().all(|end| says(beside, *end)) {
        return None;
    }
    match ends {
        [Some(low), Some(high)] if low == high => Some(number(low)),
        [Some(low), Some(high)] => Some(format!("{} to {}", number(low), number(high))),
        [Some(low), None] if low > 0.0 => Some(format!("at least {}", number(low))),
        [None, Some(high)] => Some(format!("at most {}", number(high))),
        _ => None,
    }
}

/// Returns true if a number stands in a text.
fn says(words: &str, number: f64) -> bool {
    let parts = words.split(|letter: char| !(letter.is_ascii_alphanumeric() || ".,-".contains(letter)));
    let mut numbers = parts.filter_map(|part| part.trim_end_matches(['.', ',']).replace(',', "").parse::<f64>().ok());
    numbers.any(|found| (found - number).abs() <= 1e-3 * number.abs())
}

/// Splits the sentence about the default off a description.
fn without_default(words: &str) -> (String, Option<&str>) {
    let Some((before, default)) = words.split_once("Default") else { return (words.to_owned(), None) };
    let is_sentence = before.is_empty() || before.ends_with(". ");
    let (default, after) = default.split_once(". ").unwrap_or((default.trim_end_matches('.'), ""));
    if !is_sentence {
        return (words.to_owned(), None);
    }
    (format!("{before}{after}").trim().to_owned(), Some(default.trim_start_matches(':').trim()))
}

/// Returns a bound: with a power of ten if it is very small or large, else with four decimals at most.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if !(1e-3..1e8).contains(&size) => format!("{value:e}"),
        _ if (1e4 * value).round() / 1e4 != value => format!("{value:.4}"),
        _ => format!("{value}"),
    }
}

/// Returns the one text that a field may hold, if it only names its variant.
fn only_value(field: &Value) -> Option<&str> {
    field["enum"].as_array().filter(|words| words.len() == 1).and_then(|words| words[0].as_str())
}

/// Returns the name of a variant, if it has one.
fn tag(variant: &Value) -> Option<&str> {
    let parts = list(&variant["allOf"]).chain([variant]);
    let fields = parts.flat_map(|part| members(&part["properties"])).map(|(_, field)| field);
    fields.chain([variant]).find_map(only_value)
}

fn as_value(schema: &RefOr<Schema>) -> Value {
    serde_json::to_value(schema).unwrap_or_default()
}

fn references(schema: &Value, found: &mut BTreeSet<String>) {
    match schema {
        Value::Object(members) => {
            found.extend(schema["$ref"].as_str().and_then(|name| name.strip_prefix(REFERENCE)).map(str::to_owned));
            members.values().for_each(|member| references(member, found));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, found)),
        _ => {}
    }
}

/// Returns an example, with a line for each member that does not fit into one line with the others.
fn example(value: &Value, indent: usize) -> String {
    let line = one_line(value);
    let Value::Object(members) = value else { return line };
    if indent + line.len() <= WIDTH {
        return line;
    }
    let inside = indent + 2;
    let member = |(name, value): (&String, &Value)| format!("\"{name}\": {}", example(value, inside));
    let members: Vec<String> = members.iter().map(member).collect();
    format!("{{ {} }}", members.join(&format!(",\n{}", " ".repeat(inside))))
}

fn one_line(value: &Value) -> String {
    let joined = |parts: Vec<String>| parts.join(", ");
    match value {
        Value::Object(members) if !members.is_empty() => {
            let member = |(name, value): (&String, &Value)| format!("\"{name}\": {}", one_line(value));
            format!("{{ {} }}", joined(members.iter().map(member).collect()))
        }
        Value::Array(items) => format!("[{}]", joined(items.iter().map(one_line).collect())),
        value => value.to_string(),
    }
}

fn flowing(words: &str) -> String {
    words.split_whitespace().collect::<Vec<&str>>().join(" ")
}

/// Returns words as they may stand in a cell of a table.
fn cell(words: &str) -> String {
    flowing(words).replace('|', "\\|")
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn members(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flat_map(Map::iter)
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}
