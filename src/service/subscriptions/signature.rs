//! The secret of a subscription and the signature of a delivery, as Standard Webhooks defines them.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ring::hmac;

use crate::service::callers::identity::random_bytes;
use crate::service::error::ServiceError;

/// Prefix of the text of a secret, by which the libraries of the standard know one.
const PREFIX: &str = "whsec_";

/// The secret of a subscription, 256 random bits; shown once and never printed otherwise.
pub struct SigningSecret(Vec<u8>);

impl SigningSecret {
    /// Draws a new secret.
    ///
    /// # Errors
    /// The operating system gives no random bits.
    pub(super) fn new() -> Result<Self, ServiceError> {
        Ok(SigningSecret(random_bytes::<32>()?.to_vec()))
    }

    pub(super) fn stored(secret: Vec<u8>) -> Self {
        SigningSecret(secret)
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        self.0.clone()
    }

    /// Returns the text, to show it to its owner.
    pub fn reveal(&self) -> String {
        format!("{PREFIX}{}", STANDARD.encode(&self.0))
    }
}

impl fmt::Debug for SigningSecret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("SigningSecret(..)")
    }
}

/// Returns the header `webhook-signature`: `v1,` and HMAC-SHA-256 over identifier, time and body for each secret.
pub(super) fn signatures(secrets: &[Vec<u8>], delivery: &str, seconds: i64, body: &str) -> String {
    let signed = format!("{delivery}.{seconds}.{body}");
    let sign = |secret: &Vec<u8>| {
        let tag = hmac::sign(&hmac::Key::new(hmac::HMAC_SHA256, secret), signed.as_bytes());
        format!("v1,{}", STANDARD.encode(tag))
    };
    secrets.iter().map(sign).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the specification of Standard Webhooks.
    #[test]
    fn a_signature_is_that_of_the_standard() {
        let secret = STANDARD.decode("MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").unwrap();
        let signed = signatures(&[secret], "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, r#"{"test": 2432232314}"#);
        assert_eq!(signed, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    }

    #[test]
    fn every_secret_signs_during_a_rotation() {
        let signed = signatures(&[vec![1; 32], vec![2; 32]], "msg_1", 1, "{}");
        let each: Vec<&str> = signed.split(' ').collect();
        assert!(each.len() == 2 && each[0] != each[1] && each.iter().all(|one| one.starts_with("v1,")), "{signed}");
    }
}
