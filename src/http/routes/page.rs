//! Pages of a list.

use serde::Deserialize;

use crate::http::problem::ProblemDocument;

const DEFAULT_LIMIT: usize = 50;
const LARGEST_LIMIT: usize = 1000;

/// Most bytes of a row in a list: labels at their limits take 12,400, and the rest of the row less than 3,000.
const ROW_BYTES: usize = 16 << 10;

/// Returns the most bytes of a page with so many rows, for the budget of large answers.
pub fn bytes(limit: usize) -> usize {
    limit * ROW_BYTES
}

/// Query parameters of a list, as text.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    limit: Option<String>,
    after: Option<String>,
}

impl Page {
    pub fn new(limit: Option<String>, after: Option<String>) -> Self {
        Page { limit, after }
    }

    /// Returns the limit and the cursor.
    pub fn bounds(&self) -> Result<(usize, Option<i64>), ProblemDocument> {
        let limit = match &self.limit {
            None => DEFAULT_LIMIT,
            Some(text) => match text.parse() {
                Ok(limit) if (1..=LARGEST_LIMIT).contains(&limit) => limit,
                _ => return Err(ProblemDocument::of_parameter("limit", text, "must be a whole number in [1, 1000]")),
            },
        };
        let after = self.after.as_deref().map(|text| {
            text.parse()
                .map_err(|_| ProblemDocument::of_parameter("after", text, "must be the `next` of the previous page"))
        });
        Ok((limit, after.transpose()?))
    }
}

/// Returns the cursor of the page after one that ends at `last`, if the page is full.
pub fn next(length: usize, limit: usize, last: Option<i64>) -> Option<i64> {
    last.filter(|_| length == limit)
}
