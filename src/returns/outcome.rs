//! The two ways in which a reading stops short: a question, and a refusal.

use serde::Serialize;
use utoipa::ToSchema;

use super::choices::Choices;

/// What cannot be told from the text.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Question {
    /// The choice that is asked for, as `choices` names it.
    pub asks: &'static str,
    /// In words.
    pub question: String,
    /// Each of them settles it.
    pub options: Vec<Answer>,
}

/// One answer to a question.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Answer {
    /// In words.
    pub label: String,
    /// What to add to `choices`.
    pub choices: Choices,
    /// What would be read, where that is one thing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sentence: Option<String>,
}

/// Where in the text something is wrong.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Place {
    /// From 1.
    pub line: usize,
    /// From 1: of the fields of the line.
    pub column: usize,
    /// What stands there, shortened where it is long.
    pub value: String,
}

/// Why there is no reading.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Stop {
    Asked(Vec<Question>),
    Refused { sentence: String, place: Option<Place> },
}

impl Stop {
    pub fn refused(sentence: impl Into<String>) -> Self {
        Stop::Refused { sentence: sentence.into(), place: None }
    }

    /// Names the column in what does not name its cell.
    pub fn about(self, column: &str) -> Self {
        match self {
            Stop::Refused { sentence, place: None } if !names_a_column(&sentence) => {
                Stop::refused(format!("Column {column}: {sentence}"))
            }
            Stop::Asked(mut questions) => {
                for Question { question, .. } in questions.iter_mut().filter(|one| !names_a_column(&one.question)) {
                    *question = format!("Column {column}: {question}");
                }
                Stop::Asked(questions)
            }
            refused @ Stop::Refused { .. } => refused,
        }
    }

    pub fn asked(asks: &'static str, question: impl Into<String>, options: Vec<(String, Choices)>) -> Self {
        let option = |(label, choices)| Answer { label, choices, sentence: None };
        let options = options.into_iter().map(option).collect();
        Stop::Asked(vec![Question { asks, question: question.into(), options }])
    }
}

fn names_a_column(sentence: &str) -> bool {
    sentence.starts_with("Column ") || sentence.starts_with("line ")
}

/// Both results, and the questions of both where both ask; a refusal counts before a question.
pub(super) fn both<A, B>(one: Result<A, Stop>, other: Result<B, Stop>) -> Result<(A, B), Stop> {
    match (one, other) {
        (Ok(one), Ok(other)) => Ok((one, other)),
        (Err(Stop::Asked(one)), Err(Stop::Asked(other))) => Err(Stop::Asked([one, other].concat())),
        (Err(refused @ Stop::Refused { .. }), _) | (_, Err(refused @ Stop::Refused { .. })) => Err(refused),
        (Err(asked), _) | (_, Err(asked)) => Err(asked),
    }
}
