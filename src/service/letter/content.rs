//! The content of a letter, in words and figures, before anybody lays it out.

use crate::service::letter::request::Firm;

/// A client's letter.
#[derive(Debug, Clone, PartialEq)]
pub struct Letter {
    pub firm: Firm,
    pub recipient: String,
    pub day: String,
    /// The policy, the assets and the currency, in sentences; empty if there is nothing to say.
    pub about: String,
    pub order: LetterOrder,
    pub course: LetterCourse,
    /// Why, in sentences; empty for a completed session.
    pub reasons: Vec<Vec<Phrase>>,
    /// The trades in one line, such as `Buy EUR 1,234.50`, or `Nothing`.
    pub trades: String,
    /// True if there are many assets, so that the letter must be set smaller to stay on its page.
    pub is_dense: bool,
}

/// A part of a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Phrase {
    pub text: String,
    /// True for the words that the eye should find.
    pub is_strong: bool,
}

/// Builds a part of a sentence.
pub(super) fn plain(text: impl Into<String>) -> Phrase {
    Phrase { text: text.into(), is_strong: false }
}

/// Builds a part of a sentence that the eye should find.
pub(super) fn strong(text: impl Into<String>) -> Phrase {
    Phrase { text: text.into(), is_strong: true }
}

/// The text below a title: the order in large letters, the assets if there are several, and sentences.
#[derive(Debug, Clone, PartialEq)]
pub struct LetterOrder {
    pub title: String,
    pub order: Vec<Phrase>,
    pub assets: Vec<AssetLine>,
    pub sentences: Vec<Vec<Phrase>>,
}

/// A line of the table of assets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssetLine {
    pub name: String,
    /// Share of wealth to hold.
    pub share: String,
    /// Money to hold.
    pub amount: String,
    /// Share of wealth that is held now.
    pub holding: String,
    pub trade: String,
}

/// How the session went.
#[derive(Debug, Clone, PartialEq)]
pub enum LetterCourse {
    /// No return is reported yet, in a sentence.
    New(String),
    Lived(LivedCourse),
}

/// The figures of the observed periods.
#[derive(Debug, Clone, PartialEq)]
pub struct LivedCourse {
    pub facts: Vec<LetterFact>,
    pub chart: WealthChart,
    /// Wealth beside that of the comparators, in a sentence.
    pub comparison: String,
}

/// A figure with its name, and a note that may be empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LetterFact {
    pub name: String,
    pub value: String,
    pub note: String,
}

/// Wealth after each period, beside that of the comparators.
#[derive(Debug, Clone, PartialEq)]
pub struct WealthChart {
    /// The short name of each position, from the start on.
    pub positions: Vec<String>,
    /// The last position in words.
    pub here: String,
    pub lines: Vec<WealthLine>,
}

/// A line of the chart.
#[derive(Debug, Clone, PartialEq)]
pub struct WealthLine {
    pub name: &'static str,
    /// Wealth at each position; missing once the comparator could not pay.
    pub values: Vec<Option<f64>>,
    /// The last of them, in words.
    pub last: String,
}
