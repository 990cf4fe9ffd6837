//! What is wrong with a file of returns: where, what was found, and the rule that it breaks; or what it does not say.

use std::path::PathBuf;

use ballast::returns::{Choices, Question};
use serde_json::Value;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ReturnsError {
    #[error("reading {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{said}")]
    Refused { said: String },
    #[error("{questions}")]
    Asked { questions: String },
    #[error(
        "the file does not say what the bank pays: must have a column risk_free_return, rf or rate, or --rate must be \
         given, as a fraction a period (0.002 is 0.2 %){remarks}"
    )]
    NoBank { remarks: String },
    #[error(
        "the file does not say what a period is: must have a column of dates, which are daily, weekly, monthly, quarterly \
         or yearly"
    )]
    NoFrequency,
    #[error("--column is {found} columns: must be one")]
    Several { found: usize },
    #[error("{option} is {value}: {rule}")]
    Option { option: &'static str, value: String, rule: &'static str },
    #[error("{wanted} {noun}s before {date} are wanted: the file holds {found}")]
    TooShort { date: String, wanted: usize, noun: &'static str, found: usize },
}

impl ReturnsError {
    /// Each question, and the options of the command that answer it.
    pub fn asked(questions: &[Question]) -> Self {
        let mut lines = Vec::new();
        for Question { question, options, .. } in questions {
            lines.push(question.clone());
            for option in options {
                let sentence = option.sentence.iter().map(|sentence| format!(". {sentence}")).collect::<String>();
                lines.push(format!("  {}: {}{sentence}", flags(&option.choices), option.label));
            }
        }
        ReturnsError::Asked { questions: lines.join("\n") }
    }
}

/// Choices as the options that make them.
fn flags(choices: &Choices) -> String {
    let flag = |(name, value): (&String, &Value)| {
        let (name, value) = match value {
            Value::Array(columns) => ("column".to_owned(), columns.first().unwrap_or(value)),
            value => (name.replace('_', "-"), value),
        };
        format!("--{name} {}", value.as_str().map_or_else(|| value.to_string(), str::to_owned))
    };
    match serde_json::to_value(choices) {
        Ok(Value::Object(said)) => said.iter().map(flag).collect::<Vec<_>>().join(" "),
        _ => String::new(),
    }
}
