//! ES modules joined into one script, so that a browser asks once and a report is one file.
//!
//! Each module becomes a function that is called once and returns what the module exports, after the modules that it
//! imports. Names of a module so stay its own, and its text stays as it is but for its imports and exports. The
//! dashboard keeps to what this reads: an import is a line `import {…} from "./x.js";` or `import * as x from "./x.js";`,
//! an export is a function, class or constant that stands in its declaration, and modules import in no circle.
//!
//! Checked by: the tests below, `tests/project/dashboard.rs`, and the browser tests, which run the joined script.

use std::collections::BTreeSet;

use thiserror::Error;

/// The keywords that may stand between `export` and a name.
const KEYWORDS: [&str; 5] = ["async", "function", "function*", "class", "const"];

/// A function that returns an embedded file by its name.
pub type Files = fn(&str) -> Option<&'static [u8]>;

/// A reason why modules cannot be joined.
#[derive(Debug, Error)]
pub enum ModuleError {
    #[error("the file {name:?}, which draws the report, is missing")]
    Missing { name: String },
    #[error("the module {name:?} imports itself through others")]
    Circle { name: String },
    #[error("the module {name:?} exports {export:?}, and an export must be one name in its declaration")]
    Unnamed { name: String, export: String },
}

/// Returns one script with `entries` and all that they import. What `a.js` exports is then the object `$a`.
///
/// # Errors
/// A module is not among `files`, exports anything but a name, or modules import each other in a circle.
pub fn joined(files: Files, entries: &[&str]) -> Result<String, ModuleError> {
    let mut script = Joining { files, done: BTreeSet::new(), open: Vec::new(), text: String::new() };
    entries.iter().try_for_each(|entry| script.add(entry))?;
    Ok(script.text)
}

/// Returns the name of the object that holds what a module exports.
pub fn named(module: &str) -> String {
    format!("${}", module.trim_end_matches(".js"))
}

/// Returns an embedded file.
///
/// # Errors
/// There is none of this name.
pub(super) fn bytes(files: Files, name: &str) -> Result<&'static [u8], ModuleError> {
    files(name).ok_or_else(|| ModuleError::Missing { name: name.into() })
}

/// Returns an embedded file as text.
///
/// # Errors
/// As [`bytes`].
pub(super) fn text(files: Files, name: &str) -> Result<String, ModuleError> {
    bytes(files, name).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
}

struct Joining {
    files: Files,
    done: BTreeSet<String>,
    /// The modules that wait for what they import.
    open: Vec<String>,
    text: String,
}

impl Joining {
    fn add(&mut self, name: &str) -> Result<(), ModuleError> {
        if self.done.contains(name) {
            return Ok(());
        }
        if self.open.iter().any(|open| open == name) {
            return Err(ModuleError::Circle { name: name.into() });
        }
        self.open.push(name.into());
        let source = text(self.files, name)?;
        source.lines().filter_map(imported).try_for_each(|(_, module)| self.add(module))?;
        self.open.pop();
        self.done.insert(name.into());
        let mut exports = Vec::new();
        let body: Vec<String> = source.lines().map(|line| within(line, &mut exports)).collect();
        let is_letter = |letter: char| letter.is_ascii_alphanumeric() || "_$".contains(letter);
        if let Some(export) = exports.iter().find(|export| export.is_empty() || !export.chars().all(is_letter)) {
            return Err(ModuleError::Unnamed { name: name.into(), export: export.clone() });
        }
        let (object, body, exports) = (named(name), body.join("\n"), exports.join(", "));
        self.text
            .push_str(&format!("// {name}\nconst {object} = (() => {{\n{body}\nreturn {{ {exports} }};\n}})();\n"));
        Ok(())
    }
}

/// Returns what an import takes and from which module, if the line is one.
fn imported(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix("import ")?.strip_suffix("\";")?.split_once(" from \"./")
}

/// Returns a line as it stands within the function of its module, and adds the name that it exports.
fn within(line: &str, exports: &mut Vec<String>) -> String {
    if let Some((names, module)) = imported(line) {
        let names = names.trim_start_matches("* as ").replace(" as ", ": ");
        return format!("const {names} = {};", named(module));
    }
    let Some(declared) = line.strip_prefix("export ") else { return line.to_owned() };
    let name = declared.split(' ').find(|word| !KEYWORDS.contains(word)).unwrap_or_default();
    exports.push(name.split(['(', ';']).next().unwrap_or_default().to_owned());
    declared.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(name: &str) -> Option<&'static [u8]> {
        Some(match name {
            "a.js" => b"import { b as two, c } from \"./b.js\";\nimport * as d from \"./d.js\";\nexport const one = two + c();\nconst own = d.own;",
            "b.js" => b"import { own } from \"./d.js\";\nexport const b = own;\nexport async function* c(x) {\n  return \"export\";\n}",
            "d.js" => b"export class own {}\nexport function gone() {}",
            "round.js" => b"import { back } from \"./back.js\";",
            "two.js" => b"export const [one, two] = [1, 2];",
            "back.js" => b"import { round } from \"./round.js\";",
            _ => return None,
        })
    }

    #[test]
    fn modules_come_once_after_what_they_import_and_keep_their_names() {
        let wanted = [
            "// d.js\nconst $d = (() => {\nclass own {}\nfunction gone() {}\nreturn { own, gone };\n})();\n",
            "// b.js\nconst $b = (() => {\nconst { own } = $d;\nconst b = own;\nasync function* c(x) {\n  return \"export\";\n}\nreturn { b, c };\n})();\n",
            "// a.js\nconst $a = (() => {\nconst { b: two, c } = $b;\nconst d = $d;\nconst one = two + c();\nconst own = d.own;\nreturn { one };\n})();\n",
        ];
        assert_eq!(joined(files, &["a.js", "d.js"]).unwrap(), wanted.concat());
    }

    #[test]
    fn modules_that_cannot_be_joined_are_named() {
        let words = |entry| joined(files, &[entry]).unwrap_err().to_string();
        assert_eq!(words("round.js"), "the module \"round.js\" imports itself through others");
        assert_eq!(
            words("two.js"),
            "the module \"two.js\" exports \"[one,\", and an export must be one name in its declaration"
        );
        assert_eq!(words("none.js"), "the file \"none.js\", which draws the report, is missing");
    }
}
