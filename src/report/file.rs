//! A report as one HTML file: the modules that draw it, its data as JSON, its styles and its typeface.
//!
//! The modules are the dashboard's own, joined into one script. The policy names it and the styles by their hashes, so a
//! browser may run these and load nothing else.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::escape::escaped;
use super::modules::{Files, ModuleError, bytes, joined, named, text};

/// The module that shows the page, whichever module draws it.
const SHOWS: &str = "report_file.js";
const SHEETS: [&str; 2] = ["style.css", "print.css"];
const TYPEFACE: &str = "inter.woff2";

/// A report that cannot be written.
#[derive(Debug, Error)]
pub enum FileError {
    #[error(transparent)]
    Modules(#[from] ModuleError),
    #[error("writing the data of the report")]
    Json(#[from] serde_json::Error),
}

/// Returns the file. `module` draws `data` below `title`; readers without scripts see `sentences`.
///
/// # Errors
/// A module is not among `files`, or the data cannot be written as JSON.
pub fn html(
    files: Files,
    module: &str,
    title: &str,
    data: &impl Serialize,
    sentences: &[String],
) -> Result<String, FileError> {
    let script = format!("{}{}.show({});", joined(files, &[SHOWS, module])?, named(SHOWS), named(module));
    let mut style = String::new();
    for name in SHEETS {
        style.push_str(&text(files, name)?);
    }
    let style = style.replace(TYPEFACE, &address("font/woff2", bytes(files, TYPEFACE)?));
    let policy = format!(
        "default-src 'none'; script-src {}; style-src {}; font-src data:; base-uri 'none'; form-action 'none'; \
         require-trusted-types-for 'script'",
        hash(&script),
        hash(&style)
    );
    let data = json(&serde_json::json!({ "title": title, "data": data }))?;
    let title = escaped(title);
    let sentences: String = sentences.iter().map(|sentence| format!("<p>{}</p>\n", escaped(sentence))).collect();
    Ok(format!(
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="content-security-policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main class="report"><noscript><h1>{title}</h1>
{sentences}<p>The figures and charts of this report are drawn by scripts, which are not run here.</p></noscript></main>
<p id="status" class="unseen" role="status" aria-live="polite"></p>
<script type="application/json" id="report">{data}</script>
<script type="module">{script}</script>
</body>
</html>
"#
    ))
}

fn address(media: &str, bytes: &[u8]) -> String {
    format!("data:{media};base64,{}", STANDARD.encode(bytes))
}

/// Returns the name of an inline script or style in the policy.
fn hash(text: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text)))
}

/// Returns JSON that can stand within a `<script>`, because nothing in it ends the script.
fn json(value: &impl Serialize) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(name: &str) -> Option<&'static [u8]> {
        Some(match name {
            SHOWS => b"export const show = 1;",
            "drawn.js" => b"import { a } from \"./a.js\";\nexport const body = a;",
            "a.js" => b"export const a = 1;",
            "style.css" => b"src: url(\"inter.woff2\")",
            "print.css" | TYPEFACE => b"",
            _ => return None,
        })
    }

    #[test]
    fn a_file_holds_every_module_once_and_nothing_in_its_data_ends_a_script() {
        let hostile = "</script><script>alert(1)</script> & <b>";
        let page = html(files, "drawn.js", hostile, &[hostile], &[hostile.to_owned()]).unwrap();
        assert_eq!(page.matches("<script").count(), 2, "{page}");
        assert_eq!(page.matches("</script>").count(), 2, "{page}");
        assert!(page.contains("<p>&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt; &amp; &lt;b&gt;</p>"), "{page}");
        for name in [SHOWS, "drawn.js", "a.js"] {
            assert_eq!(page.matches(&format!("// {name}\n")).count(), 1, "{page}");
        }
        assert!(page.contains("\n$report_file.show($drawn);</script>"), "{page}");
        assert!(page.contains("url(\"data:font/woff2;base64,\")"), "{page}");
    }

    #[test]
    fn a_module_that_is_not_there_is_named() {
        let error = html(files, "gone.js", "", &0, &[]).unwrap_err();
        assert_eq!(error.to_string(), "the file \"gone.js\", which draws the report, is missing");
    }
}
