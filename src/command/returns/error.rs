//! Errors of a file of returns: the position, the value found, and the rule that it breaks; or the information that is
//! missing.

use std::path::PathBuf;

use ballast::returns::{Choices, Question};
use serde_json::Value;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ReturnsError {
    #[error("reading {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{sentence}")]
    Refused { sentence: String },
    #[error("{questions}")]
    Asked { questions: String },
    #[error(
        "the file does not say what the bank pays: add a column risk_free_return, rf or rate, or give --rate as a \
         fraction a period (0.002 is 0.2 %){remarks}"
    )]
    NoBank { remarks: String },
    #[error("the file does not say what a period is: {rule}")]
    NoFrequency { rule: &'static str },
    #[error("--column is {found} columns: must be one")]
    Several { found: usize },
    #[error("{option} is {value}: {rule}")]
    Option { option: &'static str, value: String, rule: &'static str },
    #[error("{wanted} {noun}s before {date} are needed: the file has {found}")]
    TooShort { date: String, wanted: usize, noun: &'static str, found: usize },
}

impl ReturnsError {
    /// Returns each question with the options of the command that answer it; `needs_year` if they leave the length of a
    /// period open.
    pub fn open_questions(questions: &[Question], needs_year: bool) -> Self {
        let mut lines = Vec::new();
        for Question { question, options, .. } in questions {
            lines.push(question.clone());
            for option in options {
                let sentence = option.sentence.iter().map(|sentence| format!(". {sentence}")).collect::<String>();
                lines.push(format!("  {}: {}{sentence}", flags(&option.choices), option.label));
            }
        }
        if needs_year {
            lines.push("  with --periods-per-year, such as 12, as the dates do not say what a period is".to_owned());
        }
        ReturnsError::Asked { questions: lines.join("\n") }
    }
}

/// Formats choices as the options that make them, quoted for a shell.
fn flags(choices: &Choices) -> String {
    let flag = |(name, value): (&String, &Value)| match value {
        Value::Array(columns) => columns.iter().map(|column| option("column", column)).collect::<Vec<_>>().join(" "),
        value => option(&name.replace('_', "-"), value),
    };
    match serde_json::to_value(choices) {
        Ok(Value::Object(fields)) => fields.iter().map(flag).collect::<Vec<_>>().join(" "),
        _ => String::new(),
    }
}

fn option(name: &str, value: &Value) -> String {
    let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_./:,%+=@".contains(letter);
    // A value that begins with a hyphen would be read as an option.
    let equals = if value.starts_with('-') { '=' } else { ' ' };
    if !value.is_empty() && value.chars().all(is_plain) {
        return format!("--{name}{equals}{value}");
    }
    format!("--{name}{equals}'{}'", value.replace('\'', "'\\''"))
}
