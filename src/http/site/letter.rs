//! A client's letter as one HTML document: its styles and its chart are inside, and nothing is loaded or run.
//!
//! All text is escaped. The policy allows only the one style sheet, by its hash, and pictures inside the document.

use std::fmt::Write;
use std::sync::LazyLock;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

use crate::http::site::letter_chart;
use crate::report::escaped;
use crate::service::letter::FEW;
use crate::service::letter::content::{AssetLine, Letter, LetterCourse, LetterFact, LetterOrder, LivedCourse, Phrase};

/// The style sheet, which the dashboard loads too.
const STYLE: &str = include_str!("dashboard/letter.css");

static META_POLICY: LazyLock<String> = LazyLock::new(|| {
    let hash = STANDARD.encode(Sha256::digest(STYLE));
    format!("default-src 'none'; style-src 'sha256-{hash}'; img-src data:; base-uri 'none'; form-action 'none'")
});

static POLICY: LazyLock<String> = LazyLock::new(|| format!("{}; frame-ancestors 'none'; sandbox", *META_POLICY));

/// The page of a link that leads nowhere.
pub const GONE: &str = r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>No letter</title>
</head>
<body>
<h1>There is no letter here</h1>
<p>The link has expired, was withdrawn, or is not complete. Please ask for a new one.</p>
</body>
</html>
"#;

/// Returns the content security policy of every letter. The document itself repeats what a saved file can hold of it.
pub fn content_security_policy() -> &'static str {
    &POLICY
}

/// Writes the document.
pub fn page(letter: &Letter) -> String {
    let (policy, title) = (&*META_POLICY, escaped(&format!("Letter to {}", letter.recipient)));
    format!(
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="content-security-policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{STYLE}</style>
</head>
<body>
{}
</body>
</html>
"#,
        article(letter)
    )
}

fn article(letter: &Letter) -> String {
    let Letter { firm, recipient, day, about, order, course, reasons, is_dense, .. } = letter;
    let class = if *is_dense { "letter dense" } else { "letter" };
    let mut text = format!("<article class=\"{class}\" aria-label=\"Letter to {}\">\n", escaped(recipient));
    text += &head(&firm.name, firm.logo.as_deref());
    let (to, day) = (escaped(recipient), escaped(day));
    // Writing to a string cannot fail.
    let _ = writeln!(text, "<div class=\"addressed\"><h2>{to}</h2><p>{day}</p></div>");
    text += &note(about);
    text += &part(&order.title, &order_text(order, recipient));
    text += &part("How it went", &course_text(course, *is_dense));
    if !reasons.is_empty() {
        text += &part("Why", &paragraphs(reasons));
    }
    let closing = if firm.closing.is_empty() { String::new() } else { format!("<p>{}</p>\n", escaped(&firm.closing)) };
    let _ = write!(text, "<div class=\"letterfoot\">{closing}{}</div>\n</article>", note(&firm.disclaimer));
    text
}

fn head(firm: &str, logo: Option<&str>) -> String {
    let name = escaped(firm);
    let of = if firm.is_empty() { "Logo".to_owned() } else { format!("Logo of {name}") };
    let logo = logo.map_or(String::new(), |url| format!("<img class=\"logo\" src=\"{}\" alt=\"{of}\">", escaped(url)));
    let firm = if firm.is_empty() { String::new() } else { format!("<p class=\"firm\">{name}</p>") };
    format!("<div class=\"letterhead\">{logo}{firm}</div>\n")
}

fn part(title: &str, text: &str) -> String {
    format!("<div class=\"part\"><h3>{}</h3>\n{text}</div>\n", escaped(title))
}

/// Writes small print; empty if there is none.
fn note(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("<p class=\"note\">{}</p>\n", escaped(text)) }
}

fn order_text(LetterOrder { order, assets, sentences, .. }: &LetterOrder, recipient: &str) -> String {
    let mut text = format!("<p class=\"order\">{}</p>\n", sentence(order));
    let caption = format!("What {recipient} is to hold of each asset");
    if assets.len() > FEW {
        let (first, second) = assets.split_at(assets.len().div_ceil(2));
        let halves: Vec<String> = (1..)
            .zip([first, second])
            .map(|(half, lines)| asset_table(&format!("{caption}, part {half}"), lines, false))
            .collect();
        let _ = writeln!(text, "<div class=\"halves\">{}</div>", halves.concat());
    } else if !assets.is_empty() {
        text += &asset_table(&caption, assets, true);
    }
    text + &paragraphs(sentences)
}

/// Writes a table of assets, if `is_wide` with the amounts and what is held now.
fn asset_table(caption: &str, lines: &[AssetLine], is_wide: bool) -> String {
    let cells = |line: &AssetLine| match is_wide {
        true => vec![line.share.clone(), line.amount.clone(), line.holding.clone(), line.trade.clone()],
        false => vec![line.share.clone(), line.trade.clone()],
    };
    let names: &[&str] =
        if is_wide { &["To hold", "Amount", "Held now", "To trade"] } else { &["To hold", "To trade"] };
    let head: String = names.iter().map(|name| format!("<th scope=\"col\" class=\"number\">{name}</th>")).collect();
    let row = |line: &AssetLine| {
        let numbers: String =
            cells(line).iter().map(|cell| format!("<td class=\"number\">{}</td>", escaped(cell))).collect();
        format!("<tr><th scope=\"row\">{}</th>{numbers}</tr>\n", escaped(&line.name))
    };
    let rows: String = lines.iter().map(row).collect();
    format!(
        "<table aria-label=\"{}\">\n<thead><tr><th scope=\"col\">Asset</th>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n",
        escaped(caption)
    )
}

fn course_text(course: &LetterCourse, is_dense: bool) -> String {
    let LivedCourse { facts, chart, comparison } = match course {
        LetterCourse::New(sentence) => return format!("<p>{}</p>\n", escaped(sentence)),
        LetterCourse::Lived(lived) => lived,
    };
    let facts: String = facts.iter().map(fact).collect();
    format!(
        "<dl class=\"facts\">{facts}</dl>\n\
         <p class=\"note\">Returns are time-weighted: money added or withdrawn does not count as a gain or a loss.</p>\n\
         {}\n<p>{}</p>\n",
        letter_chart::figure(chart, is_dense),
        escaped(comparison)
    )
}

fn fact(LetterFact { name, value, note }: &LetterFact) -> String {
    let [name, value] = [name, value].map(|text| escaped(text));
    let note = if note.is_empty() { String::new() } else { format!("<dd class=\"note\">{}</dd>", escaped(note)) };
    format!("<div><dt>{name}</dt><dd>{value}</dd>{note}</div>")
}

fn paragraphs(sentences: &[Vec<Phrase>]) -> String {
    sentences.iter().map(|phrases| format!("<p>{}</p>\n", sentence(phrases))).collect()
}

fn sentence(phrases: &[Phrase]) -> String {
    let phrase = |Phrase { text, is_strong }: &Phrase| match is_strong {
        true => format!("<b>{}</b>", escaped(text)),
        false => escaped(text),
    };
    phrases.iter().map(phrase).collect()
}
