//! Text of returns, read for whoever asks. Nothing is stored.

use serde::Deserialize;
use utoipa::ToSchema;

use super::error::ServiceError;
use super::sessions::Sessions;
use crate::returns::{Choices, Reading, read};
use crate::store::Tenant;

/// A text, and what is said of it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReadReturns {
    /// As it was pasted, or stands in a file: at most 8 MB.
    pub text: String,
    /// Nothing at first, then the answers to what is asked.
    #[serde(default)]
    pub choices: Choices,
}

impl Sessions {
    /// # Errors
    /// No turn to compute.
    pub async fn read_returns(&self, tenant: &Tenant, question: ReadReturns) -> Result<Reading, ServiceError> {
        self.advising.run(tenant, move || read(&question.text, &question.choices)).await
    }
}
