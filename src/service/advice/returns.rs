//! Reads returns from text on request. Nothing is stored.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::returns::{Choices, Reading, read};
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// A text with returns, and the choices for reading it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReadReturns {
    /// The text as pasted or read from a file: at most 8 MB.
    pub text: String,
    /// Empty at first, then the answers to the questions about the text.
    #[serde(default)]
    pub choices: Choices,
}

impl Sessions {
    /// Reads the returns.
    ///
    /// # Errors
    /// No permit to compute came in time.
    pub async fn read_returns(&self, tenant: &Tenant, question: ReadReturns) -> Result<Reading, ServiceError> {
        self.advising.run(tenant, move || read(&question.text, &question.choices)).await
    }
}
