//! The address of somebody who reads events by e-mail: one address, and nothing that a mail server could take for more.

use lettre::Address;

use crate::control::error::FieldError;

const SCHEME: &str = "mailto:";
/// The most characters of an address and of the part before its `@` (RFC 5321, 4.5.3.1).
const LONGEST_ADDRESS: usize = 254;
const LONGEST_LOCAL_PART: usize = 64;
/// Marks before the `@` besides letters, digits and dots: those of RFC 5322 without `/`, `%`, `#` and `?`, which mean
/// something else in a URL.
const LOCAL_MARKS: &[u8] = b"!$&'*+-=^_`{|}~";

/// A checked address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MailAddress(Address);

impl MailAddress {
    /// Reads `mailto:` and an address; `None` if the URL has another scheme.
    pub fn of_url(url: &str) -> Option<Result<Self, FieldError>> {
        let (scheme, address) = url.split_at_checked(SCHEME.len())?;
        let rule = "must be mailto: and one address such as someone@example.com, without anything else";
        let fault = || FieldError::new("url", url, rule);
        scheme.eq_ignore_ascii_case(SCHEME).then(|| MailAddress::read(address).ok_or_else(fault))
    }

    /// Reads an address such as `someone@example.com`.
    pub fn read(address: &str) -> Option<Self> {
        let (local, domain) = address.split_once('@')?;
        let is_sound = address.len() <= LONGEST_ADDRESS && is_local_part(local) && is_domain(domain);
        is_sound.then(|| Address::new(local, domain).ok().map(MailAddress))?
    }

    pub(super) fn address(&self) -> &Address {
        &self.0
    }
}

fn is_local_part(local: &str) -> bool {
    let is_mark = |byte: u8| byte.is_ascii_alphanumeric() || LOCAL_MARKS.contains(&byte);
    local.len() <= LONGEST_LOCAL_PART && local.split('.').all(|part| !part.is_empty() && part.bytes().all(is_mark))
}

/// Returns whether this is the name of a domain: at least two labels, so no machine of the operator's own network by its
/// short name, and no address of numbers.
fn is_domain(domain: &str) -> bool {
    let is_label = |label: &str| {
        let is_plain = label.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
        is_plain && !label.is_empty() && !label.starts_with('-') && !label.ends_with('-')
    };
    let last = domain.rsplit('.').next().unwrap_or_default();
    domain.contains('.') && domain.split('.').all(is_label) && !last.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_plain_address_is_read_and_nothing_else() {
        for (url, expected) in [
            ("mailto:someone@example.com", "someone@example.com"),
            ("MailTo:a.b+c_d'e@mail.example.co.uk", "a.b+c_d'e@mail.example.co.uk"),
            ("mailto:x@xn--bcher-kva.example", "x@xn--bcher-kva.example"),
        ] {
            assert_eq!(MailAddress::of_url(url).unwrap().unwrap().address().to_string(), expected);
        }
        for other in ["https://example.com/", "mailt", "", "someone@example.com", "mailüo:x@example.com"] {
            assert!(MailAddress::of_url(other).is_none(), "{other}");
        }
        let long = format!("mailto:{}@example.com", "a".repeat(65));
        let longer = format!("mailto:a@{}com", "abcdefghi.".repeat(25));
        for hostile in [
            "mailto:",
            "mailto:someone",
            "mailto:@example.com",
            "mailto:someone@",
            "mailto:someone@example.com?subject=x",
            "mailto:someone@example.com?bcc=other@example.com",
            "mailto:one@example.com,two@example.com",
            "mailto:one@example.com;two@example.com",
            "mailto:one@example.com two@example.com",
            "mailto:one@two@example.com",
            "mailto:one%40example.com@relay.example",
            "mailto:someone@example.com%0d%0aBcc:other@example.com",
            "mailto:someone@example.com\r\nBcc: other@example.com",
            "mailto:some\none@example.com",
            "mailto:someone@example.com\0",
            "mailto:Some One <someone@example.com>",
            "mailto:<someone@example.com>",
            "mailto:\"some one\"@example.com",
            "mailto:some..one@example.com",
            "mailto:.someone@example.com",
            "mailto:someone@localhost",
            "mailto:someone@127.0.0.1",
            "mailto:someone@[127.0.0.1]",
            "mailto:someone@-example.com",
            "mailto:someone@example..com",
            "mailto:someone@example.com.",
            "mailto:jos\u{e9}@example.com",
            "mailto://someone@example.com",
            long.as_str(),
            longer.as_str(),
        ] {
            let refused = MailAddress::of_url(hostile).unwrap().unwrap_err();
            assert_eq!((refused.field.as_str(), refused.value.as_str()), ("url", hostile));
        }
    }
}
