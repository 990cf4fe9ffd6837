//! The two ways in which a reading stops early: a question and a refusal.

use serde::Serialize;
use utoipa::ToSchema;

use super::choices::Choices;

/// A question about something that the text leaves open.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Question {
    /// The choice that the question asks for, by its name in `choices`.
    pub asks: &'static str,
    /// The question in words.
    pub question: String,
    /// The possible answers; each of them settles the question.
    pub options: Vec<Answer>,
}

/// One answer to a question.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Answer {
    /// The answer in words.
    pub label: String,
    /// The choices to add to `choices`.
    pub choices: Choices,
    /// The record that this answer would give, in a sentence, if it gives one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sentence: Option<String>,
}

/// The place of an error in the text.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TextPosition {
    /// Line, from 1.
    pub line: usize,
    /// Field of the line, from 1.
    pub column: usize,
    /// The value at this place, shortened if it is long.
    pub value: String,
}

/// The reason why there is no reading.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Stop {
    Asked(Vec<Question>),
    Refused { sentence: String, place: Option<TextPosition> },
}

impl Stop {
    pub fn refused(sentence: impl Into<String>) -> Self {
        Stop::Refused { sentence: sentence.into(), place: None }
    }

    /// Adds the name of the column to a sentence that does not name one already.
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

    pub fn question(asks: &'static str, question: impl Into<String>, options: Vec<(String, Choices)>) -> Self {
        let option = |(label, choices)| Answer { label, choices, sentence: None };
        let options = options.into_iter().map(option).collect();
        Stop::Asked(vec![Question { asks, question: question.into(), options }])
    }
}

fn names_a_column(sentence: &str) -> bool {
    sentence.starts_with("Column ") || sentence.starts_with("line ")
}

/// Returns both results. If both are questions, returns the questions of both; a refusal goes before a question.
pub(super) fn both<A, B>(one: Result<A, Stop>, other: Result<B, Stop>) -> Result<(A, B), Stop> {
    match (one, other) {
        (Ok(one), Ok(other)) => Ok((one, other)),
        (Err(Stop::Asked(one)), Err(Stop::Asked(other))) => Err(Stop::Asked([one, other].concat())),
        (Err(refused @ Stop::Refused { .. }), _) | (_, Err(refused @ Stop::Refused { .. })) => Err(refused),
        (Err(question), _) | (_, Err(question)) => Err(question),
    }
}
