//! The README and the pages of `docs/` say what is there: links lead somewhere, files and functions that they name exist,
//! and `docs/requests.md` has every field of every request with its bounds, and an example that fits.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use ballast::control::request::specification::Specification;
use jiff::ToSpan;
use jiff::civil::Date;
use serde_json::{Value, json};

const README_BYTES: usize = 10_000;
/// Folders at the root whose files the pages name in backticks.
const FOLDERS: [&str; 12] = [
    ".ci/",
    "api/",
    "benches/",
    "clients/",
    "data/",
    "docker/",
    "docs/",
    "examples/",
    "fuzz/",
    "lab/",
    "src/",
    "tests/",
];
/// Kinds of items that a name in backticks may be in its file.
const KINDS: [&str; 7] = ["fn", "struct", "enum", "trait", "const", "mod", "type"];

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn exists(path: &str) -> bool {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).exists()
}

/// Every page by its path from the root.
fn pages() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut paths: Vec<String> =
        names.filter(|name| name.ends_with(".md")).map(|name| format!("docs/{name}")).collect();
    assert!(paths.len() >= 15, "{paths:?}");
    paths.extend(["README.md".into(), "CONTRIBUTING.md".into()]);
    paths.into_iter().map(|path| (path.clone(), read(&path))).collect()
}

/// A page without its blocks of code.
fn prose(page: &str) -> String {
    page.split("\n```").step_by(2).collect::<Vec<&str>>().join("\n")
}

/// Returns the words in backticks outside of blocks.
fn spans(text: &str) -> Vec<String> {
    let text = prose(text);
    assert!(text.matches('`').count().is_multiple_of(2), "a backtick without its other: {text}");
    text.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " ")).collect()
}

/// The name by which a heading is linked to.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|letter| letter.is_alphanumeric() || matches!(letter, '-' | '_')).collect()
}

fn anchors(page: &str) -> BTreeSet<String> {
    let headings = prose(page);
    headings.lines().filter(|line| line.starts_with('#')).map(|line| anchor(line.trim_start_matches('#'))).collect()
}

#[test]
fn the_readme_is_short() {
    let bytes = read("README.md").len();
    assert!(bytes < README_BYTES, "{bytes} bytes");
}

#[test]
fn every_link_leads_somewhere() {
    let mut followed = 0;
    for (path, page) in pages() {
        let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
        for link in prose(&page).split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.contains("://") {
                continue;
            }
            let (file, at) = link.split_once('#').unwrap_or((link, ""));
            let target = match (file, file.strip_prefix("../")) {
                ("", _) => path.clone(),
                (_, Some(above)) => above.to_owned(),
                (file, None) if folder.is_empty() => file.to_owned(),
                (file, None) => format!("{folder}/{file}"),
            };
            assert!(exists(&target), "{path}: there is no {target}");
            assert!(at.is_empty() || anchors(&read(&target)).contains(at), "{path}: no heading {link}");
            followed += 1;
        }
    }
    assert!(followed > 50, "{followed} links");
}

/// Returns true if the file defines the last part of a name such as `Type::function`, and every part before it.
fn defines(file: &str, name: &str) -> bool {
    let defined = |part: &str| KINDS.iter().any(|kind| words(file, &format!("{kind} {part}")));
    let variant = |part: &str| part.starts_with(char::is_uppercase) && words(file, part);
    name.split("::").all(|part| defined(part) || variant(part))
}

/// Returns true if `text` is in the file, and not as a part of a longer word.
fn words(file: &str, text: &str) -> bool {
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    file.match_indices(text).any(|(at, _)| !file[at + text.len()..].starts_with(is_word))
}

#[test]
fn every_file_and_function_that_is_named_exists() {
    let mut named = 0;
    for (path, page) in pages() {
        for span in spans(&page) {
            let Some(name) = span.split_whitespace().find(|word| FOLDERS.iter().any(|at| word.starts_with(at))) else {
                continue;
            };
            let (file, item) = name.split_once("::").map_or((name, None), |(file, item)| (file, Some(item)));
            assert!(exists(file), "{path}: there is no {file}");
            if let Some(item) = item {
                assert!(defines(&read(file), item), "{path}: {file} defines no {item}");
            }
            named += 1;
        }
    }
    assert!(named > 150, "{named} files named");
}

#[test]
fn the_map_has_every_folder_of_the_source() {
    let readme = read("README.md");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(source).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let named = readme.contains(&format!("`src/{name}/`"));
        assert!(named || !entry.file_type().unwrap().is_dir(), "the README has no src/{name}/");
    }
}

fn description() -> Value {
    serde_json::from_str(&read("api/openapi.json")).unwrap()
}

fn resolved<'a>(description: &'a Value, schema: &'a Value) -> &'a Value {
    match schema["$ref"].as_str() {
        Some(name) => description.pointer(name.trim_start_matches('#')).unwrap(),
        None => schema,
    }
}

/// The fields of a schema itself, in all its variants; those of the types it refers to are theirs.
fn own_fields(schema: &Value, found: &mut Vec<(String, Value)>) {
    let properties = schema["properties"].as_object().into_iter().flatten();
    found.extend(properties.map(|(name, property)| (name.clone(), property.clone())));
    for several in ["oneOf", "allOf"] {
        schema[several].as_array().into_iter().flatten().for_each(|one| own_fields(one, found));
    }
}

/// The names of the types that a schema refers to, and those inside them.
fn named_types(description: &Value, schema: &Value, found: &mut BTreeSet<String>) {
    match schema {
        Value::Object(members) => {
            if let Some(name) = schema["$ref"].as_str().and_then(|name| name.rsplit('/').next())
                && found.insert(name.to_owned())
            {
                named_types(description, resolved(description, schema), found);
            }
            members.values().for_each(|member| named_types(description, member, found));
        }
        Value::Array(items) => items.iter().for_each(|item| named_types(description, item, found)),
        _ => {}
    }
}

/// The part of a page under the heading of an operation or a type.
fn section(page: &str, operation: &str) -> String {
    let heading = format!("\n## `{operation}`\n");
    let at = page.find(&heading).unwrap_or_else(|| panic!("no heading {operation}"));
    let rest = &page[at + heading.len()..];
    rest[..rest.find("\n## ").unwrap_or(rest.len())].to_owned()
}

fn has_number(text: &str, number: f64) -> bool {
    let text = text.replace(',', "");
    let parts = text.split(|letter: char| !(letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-')));
    let mut numbers = parts.filter_map(|part| part.trim_end_matches('.').parse::<f64>().ok());
    numbers.any(|found| (found - number).abs() <= 1e-3 * number.abs())
}

/// The ends that a schema gives a field, or the elements of a list.
fn ends(schema: &Value) -> Vec<f64> {
    let of = |schema: &Value| [schema["minimum"].as_f64(), schema["maximum"].as_f64()].into_iter().flatten().collect();
    let mut ends: Vec<f64> = of(schema);
    ends.extend::<Vec<f64>>(of(&schema["items"]));
    // A pair of numbers needs no bound on its length, nor what counts one on its lower end.
    ends.extend(schema["maxItems"].as_f64());
    ends.retain(|end| ![0.0, 2.0].contains(end));
    ends
}

#[test]
fn every_field_of_every_request_has_its_row_and_its_bounds() {
    let (description, page) = (description(), read("docs/requests.md"));
    let (mut seen, mut types) = (0, BTreeSet::new());
    for (path, operations) in description["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            let section = section(&page, &format!("{} {path}", method.to_uppercase()));
            for parameter in operation["parameters"].as_array().into_iter().flatten() {
                let name = parameter["name"].as_str().unwrap();
                assert!(section.contains(&format!("\n| `{name}` | ")), "{method} {path}: no {name}");
                seen += 1;
            }
            named_types(&description, &operation["requestBody"], &mut types);
        }
    }
    for name in types {
        let (section, mut fields) = (section(&page, &name), Vec::new());
        own_fields(&description["components"]["schemas"][&name], &mut fields);
        for (field, schema) in fields.into_iter().filter(|(_, schema)| schema["enum"].is_null()) {
            let rows: Vec<&str> = section.lines().filter(|line| line.starts_with(&format!("| `{field}` | "))).collect();
            assert!(!rows.is_empty(), "{name}: no row for {field}");
            for end in ends(&schema) {
                assert!(rows.iter().any(|row| has_number(row, end)), "{name}.{field} does not say {end}: {rows:?}");
            }
            seen += 1;
        }
    }
    assert!(seen > 250, "{seen} fields and parameters");
}

/// Returns the parts of a value that do not fit a schema.
fn misfits(description: &Value, schema: &Value, value: &Value, path: &str) -> Vec<String> {
    let schema = resolved(description, schema);
    if let Some(variants) = schema["oneOf"].as_array() {
        let tried: Vec<_> = variants.iter().map(|one| misfits(description, one, value, path)).collect();
        return tried.into_iter().min_by_key(Vec::len).unwrap_or_default();
    }
    if let (Some(allowed), Some(word)) = (schema["enum"].as_array(), value.as_str()) {
        return if allowed.contains(&json!(word)) { Vec::new() } else { vec![format!("{path} is {word}")] };
    }
    let mut found = Vec::new();
    match value {
        Value::Object(members) => {
            let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
            found.extend(
                required.filter(|name| !members.contains_key(*name)).map(|name| format!("{path}.{name} lacks")),
            );
            for (name, member) in members {
                match schema["properties"].get(name) {
                    Some(property) => found.extend(misfits(description, property, member, &format!("{path}.{name}"))),
                    None if schema["additionalProperties"].is_object() => {}
                    None => found.push(format!("{path}.{name} is no field")),
                }
            }
        }
        Value::Array(items) if schema["items"].is_object() => {
            found.extend(items.iter().flat_map(|item| misfits(description, &schema["items"], item, path)));
        }
        Value::Number(number) => {
            let number = number.as_f64().unwrap();
            let (low, high) = (schema["minimum"].as_f64(), schema["maximum"].as_f64());
            if low.is_some_and(|low| number < low) || high.is_some_and(|high| number > high) {
                found.push(format!("{path} is {number}"));
            }
        }
        _ => {}
    }
    found
}

#[test]
fn every_example_fits_its_request() {
    let (description, page) = (description(), read("docs/requests.md"));
    let mut examples = 0;
    for (path, operations) in description["paths"].as_object().unwrap() {
        let body = &operations["post"]["requestBody"]["content"]["application/json"]["schema"];
        if body["$ref"].is_null() {
            continue;
        }
        let section = section(&page, &format!("POST {path}"));
        let example = section.split("```json\n").nth(1).unwrap_or_else(|| panic!("{path} has no example"));
        let example: Value = serde_json::from_str(example.split("```").next().unwrap()).unwrap();
        assert_eq!(misfits(&description, body, &example, path), [""; 0]);
        assert_eq!(operations["post"]["requestBody"]["content"]["application/json"]["example"], example, "{path}");
        examples += 1;
    }
    assert_eq!(examples, 19);
}

#[test]
fn the_defaults_are_those_of_a_training() {
    let least = json!({ "problem": { "rate_per_step": 0.002, "history": [0.01, -0.02, 0.03] } });
    let completed = serde_json::from_value::<Specification>(least).unwrap().completed().unwrap();
    let completed = serde_json::to_value(completed).unwrap();
    let (description, mut compared) = (description(), 0);
    for (part, schema) in [
        ("/problem", "ProblemSpecification"),
        ("/design", "DesignSpecification"),
        ("/surrogate", "SurrogateSpecification"),
        ("/surrogate/bounds", "HyperparameterBounds"),
    ] {
        let fields = description["components"]["schemas"][schema]["properties"].as_object().unwrap();
        for (name, field) in fields.iter().filter(|(_, field)| !field["default"].is_null()) {
            assert_eq!(completed.pointer(part).unwrap()[name], field["default"], "{part}/{name}");
            compared += 1;
        }
    }
    assert!(compared >= 15, "{compared} defaults");
}

/// First cells of all rows of tables whose first column has this heading.
fn first_cells<'a>(page: &'a str, heading: &str) -> Vec<&'a str> {
    let first = |line: &'a str| line.strip_prefix("| ").and_then(|line| line.split(" | ").next());
    let tables = page.split("\n\n").filter(|table| first(table) == Some(heading));
    tables.flat_map(|table| table.lines().skip(2).filter_map(first)).collect()
}

#[test]
fn results_call_strategies_what_reports_call_them() {
    let (page, names) = (read("docs/results.md"), read("src/control/evaluation/names.rs"));
    let is_name = |text: &str| names.contains(&format!("=> \"{text}\"")) || text.ends_with(" % in stocks");
    // A name may go on with a level, a caution or a window.
    let ends = |cell: &str| cell.match_indices(',').map(|(at, _)| at).chain([cell.len()]).collect::<Vec<usize>>();
    let cells = first_cells(&page, "strategy");
    assert!(cells.len() >= 40, "{cells:?}");
    for cell in cells {
        assert!(ends(cell).into_iter().any(|end| is_name(&cell[..end])), "docs/results.md: no report has a {cell}");
    }
    for other in ["all-bank", "all-stock", "plug-in", "1/n"] {
        assert!(!page.to_lowercase().contains(other), "docs/results.md calls a strategy {other}");
    }
}

/// The code that the sections of `docs/measurements.md` measure, and when.
fn measured() -> Vec<(String, Date, Vec<String>)> {
    let page = read("docs/measurements.md");
    let sections = page.split("\n## ").skip(1).map(|section| {
        let (heading, rest) = section.split_once("\n\n").unwrap();
        let line = rest.lines().next().unwrap();
        let parts = line.strip_prefix("Measured ").and_then(|line| line.split_once(": "));
        let (date, code) = parts.unwrap_or_else(|| panic!("{heading}: {line:?} must be `Measured DATE: CODE`"));
        let date = date.parse().unwrap_or_else(|error| panic!("{heading}: {date}: {error}"));
        (heading.to_owned(), date, spans(code))
    });
    sections.collect()
}

/// The day of the last commit that changed `paths`; `None` without a history.
fn changed(paths: &[String]) -> Option<Date> {
    let mut git = Command::new("git");
    let git = git.current_dir(env!("CARGO_MANIFEST_DIR")).args(["log", "-1", "--format=%as", "--"]).args(paths);
    let day = git.output().ok().filter(|output| output.status.success())?;
    String::from_utf8(day.stdout).ok()?.trim().parse().ok()
}

/// Returns true if code that changed on a day leaves a measurement behind. Some days pass between a change and its measurement, and
/// changes that come one after the other are measured once.
fn is_outdated(measured: Date, changed: Date) -> bool {
    measured.checked_add(30.days()).unwrap() < changed
}

/// By the days of commits and not by today: what holds once holds until the code is changed.
#[test]
fn no_measurement_is_older_than_the_code_it_measures() {
    let measured = measured();
    assert!(measured.len() >= 13, "{measured:?}");
    for (heading, date, code) in measured {
        assert!(!code.is_empty() && code.iter().all(|path| exists(path)), "{heading}: {code:?}");
        let Some(changed) = changed(&code) else { continue };
        assert!(
            !is_outdated(date, changed),
            "docs/measurements.md, {heading}: measured on {date}, and {code:?} changed on {changed}: measure again, or look \
             whether the change can matter, and write the day of that"
        );
    }
    let day = |text: &str| text.parse::<Date>().unwrap();
    assert!(!is_outdated(day("2026-11-01"), day("2026-12-01")) && is_outdated(day("2026-11-01"), day("2026-12-02")));
}
