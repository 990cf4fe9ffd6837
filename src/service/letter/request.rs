//! A request for a client's letter, and its rules.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, within};
use crate::control::request::text::check_text;
use crate::service::advice::orders::AMOUNT;

/// The most letters of each text of a firm, so that a letter stays on one page.
pub const LONGEST_FIRM: usize = 80;
/// See [`LONGEST_FIRM`].
pub const LONGEST_CLOSING: usize = 200;
/// See [`LONGEST_FIRM`].
pub const LONGEST_DISCLAIMER: usize = 600;
/// The largest logo, in bytes of the picture.
pub const LARGEST_LOGO: usize = 200 * 1024;
/// The letters of a currency code.
const CODE: usize = 3;
/// Allowed shares of wealth as the smallest trade.
const SHARE: (f64, f64) = (0.0, 1.0);

/// The most letters of a data URL with the largest logo.
const LONGEST_URL: usize = "data:image/jpeg;base64,".len() + LARGEST_LOGO.div_ceil(3) * 4;

/// A request for a client's letter.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LetterRequest {
    /// The firm that writes. Default: none is named.
    #[serde(default)]
    pub firm: Option<Firm>,
    /// Currency of the amounts: a code of three capital letters (ISO 4217). Default: none is named.
    #[schema(example = "EUR", pattern = "^[A-Z]{3}$")]
    #[serde(default)]
    pub currency: Option<String>,
    /// Trades below it count as none. Default: every trade of 0.05 % of wealth or more is named.
    #[serde(default)]
    pub smallest_trade: Option<SmallestTrade>,
    /// The day of the letter. Default: today, in UTC.
    #[schema(value_type = Option<String>, format = Date)]
    #[serde(default)]
    pub date: Option<Date>,
}

/// The firm that writes letters. Only a link keeps it, without the logo.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Firm {
    /// At most 80 letters, without control characters. Default: none.
    #[serde(default)]
    pub name: String,
    /// The last line of the letter, at most 200 letters. Default: none.
    #[serde(default)]
    pub closing: String,
    /// Text in small print below it, at most 600 letters. Default: none.
    #[serde(default)]
    pub disclaimer: String,
    /// A PNG, JPEG or WebP picture of at most 200 KB, as a data URL in base64. Default: none.
    #[schema(example = json!(null))]
    #[serde(default)]
    pub logo: Option<String>,
}

/// The smallest trade that is named, as an amount of money, as a share of wealth, or as both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SmallestTrade {
    /// Amount of money, 0 to 1e15. Default 0.
    #[serde(default)]
    pub amount: f64,
    /// Share of wealth, 0 to 1. Default 0.
    #[serde(default)]
    pub share: f64,
}

impl Bounded for Firm {
    const BOUNDS: &'static [FieldBounds] = &[
        ("name", ValueBounds::Text(0, LONGEST_FIRM)),
        ("closing", ValueBounds::Text(0, LONGEST_CLOSING)),
        ("disclaimer", ValueBounds::Text(0, LONGEST_DISCLAIMER)),
        ("logo", ValueBounds::Text(0, LONGEST_URL)),
    ];
}

impl Bounded for SmallestTrade {
    const BOUNDS: &'static [FieldBounds] =
        &[("amount", ValueBounds::number(AMOUNT)), ("share", ValueBounds::number(SHARE))];
}

impl LetterRequest {
    /// Checks every field.
    ///
    /// # Errors
    /// A field breaks its rule.
    pub fn check(&self) -> Result<(), FieldError> {
        if let Some(firm) = &self.firm {
            firm.check()?;
        }
        if let Some(code) = &self.currency
            && (code.len() != CODE || !code.bytes().all(|letter| letter.is_ascii_uppercase()))
        {
            let rule = "must be a currency code of three capital letters (ISO 4217), such as EUR";
            return Err(FieldError::new("currency", format!("{code:?}"), rule));
        }
        if let Some(smallest) = self.smallest_trade {
            within("smallest_trade.amount", smallest.amount, AMOUNT.0, AMOUNT.1)?;
            within("smallest_trade.share", smallest.share, SHARE.0, SHARE.1)?;
        }
        Ok(())
    }
}

impl Firm {
    fn check(&self) -> Result<(), FieldError> {
        check_text("firm.name", &self.name, 0..=LONGEST_FIRM, &[])?;
        check_text("firm.closing", &self.closing, 0..=LONGEST_CLOSING, &['\n'])?;
        check_text("firm.disclaimer", &self.disclaimer, 0..=LONGEST_DISCLAIMER, &['\n'])?;
        match &self.logo {
            Some(url) if !is_picture(url) => {
                let rule = format!(
                    "must be a data URL in base64 of a PNG, JPEG or WebP picture of at most {LARGEST_LOGO} bytes"
                );
                Err(FieldError::new("firm.logo", format!("a text of {} letters", url.chars().count()), rule))
            }
            _ => Ok(()),
        }
    }
}

/// Returns whether a data URL holds a picture of the kind that it names, of an allowed size. The bytes decide, because a
/// browser does not believe the name either.
fn is_picture(url: &str) -> bool {
    let Some((media, text)) = url.strip_prefix("data:").and_then(|rest| rest.split_once(";base64,")) else {
        return false;
    };
    if url.len() > LONGEST_URL {
        return false;
    }
    let Ok(bytes) = STANDARD.decode(text) else { return false };
    let begins = match media {
        "image/png" => bytes.starts_with(b"\x89PNG\r\n\x1a\n"),
        "image/jpeg" => bytes.starts_with(&[0xff, 0xd8, 0xff]),
        "image/webp" => bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP"),
        _ => false,
    };
    begins && bytes.len() <= LARGEST_LOGO
}

#[cfg(test)]
mod tests {
    use super::*;

    fn url(media: &str, bytes: &[u8]) -> String {
        format!("data:{media};base64,{}", STANDARD.encode(bytes))
    }

    #[test]
    fn a_logo_is_a_picture_by_its_bytes_and_of_at_most_so_many() {
        let png = b"\x89PNG\r\n\x1a\n and more";
        assert!(is_picture(&url("image/png", png)));
        assert!(is_picture(&url("image/jpeg", &[0xff, 0xd8, 0xff, 0xe0])));
        assert!(is_picture(&url("image/webp", b"RIFF\x04\x00\x00\x00WEBPVP8 ")));
        for wrong in [
            url("image/jpeg", png),
            url("image/svg+xml", b"<svg onload='x'/>"),
            url("image/png", b"<svg onload='x'/>"),
            url("image/png", b""),
            "data:image/png;base64,\"><script>".to_owned(),
            "https://example.com/logo.png".to_owned(),
        ] {
            assert!(!is_picture(&wrong), "{wrong}");
        }
        let of_size = |size: usize| {
            let mut bytes = png.to_vec();
            bytes.resize(size, 0);
            is_picture(&url("image/png", &bytes))
        };
        assert_eq!([LARGEST_LOGO, LARGEST_LOGO + 1, LARGEST_LOGO + 9].map(of_size), [true, false, false]);
    }
}
