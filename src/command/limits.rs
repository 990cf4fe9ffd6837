//! The command-line option for limits on the composition of several assets.

use ballast::control::error::FieldError;
use ballast::control::request::limits::WeightLimits;
use ballast::http::gate::decode;
use clap::Args;

#[derive(Debug, Clone, Args)]
pub struct LimitsArgument {
    /// For several assets: limits on their shares of the risky holdings, as `limits` of a request:
    /// '{"each": {"max": 0.4}, "groups": [{"name": "risky", "assets": ["stocks", "gold"], "max": 0.6}], "max_turnover": 0.2}'
    #[arg(long, value_name = "JSON", value_parser = limits)]
    limits: Option<WeightLimits>,
}

impl LimitsArgument {
    pub fn given(&self) -> Option<WeightLimits> {
        self.limits.clone()
    }

    /// Rejects limits on one asset.
    pub fn check_none(&self) -> Result<(), FieldError> {
        if self.limits.is_none() {
            return Ok(());
        }
        Err(FieldError::new(
            "--limits",
            "given",
            "must be left out with one asset: limits are on the shares of several",
        ))
    }
}

fn limits(text: &str) -> Result<WeightLimits, String> {
    decode::json(text.as_bytes()).map_err(|problem| problem.detail.into())
}
