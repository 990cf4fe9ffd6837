//! Reads when a certificate expires: rustls checks the expiry of others' certificates, but reports none.
//!
//! The parser reads only the DER encoding on the way: `Certificate`, its first part, and in that the fifth field after
//! the version, which is `SEQUENCE { notBefore, notAfter }`. Source: RFC 5280, section 4.1.

use jiff::civil::DateTime;
use jiff::tz::TimeZone;

const SEQUENCE: u8 = 0x30;
const VERSION: u8 = 0xa0;
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;

/// Returns the moment after which a certificate is not valid, in seconds since 1970; `None` if it cannot be read.
pub fn expiry(certificate: &[u8]) -> Option<i64> {
    let (signed, _) = content(SEQUENCE, certificate)?;
    let (fields, _) = content(SEQUENCE, signed)?;
    let (first, _, after_first) = element(fields)?;
    let mut fields = if first == VERSION { after_first } else { fields };
    for _serial_signature_issuer in 0..3 {
        fields = element(fields)?.2;
    }
    let (validity, _) = content(SEQUENCE, fields)?;
    let (kind, text, _) = element(element(validity)?.2)?;
    let text = std::str::from_utf8(text).ok()?;
    let whole = match kind {
        // The years 1950 to 2049.
        UTC_TIME if text < "50" => format!("20{text}"),
        UTC_TIME => format!("19{text}"),
        GENERALIZED_TIME => text.to_owned(),
        _ => return None,
    };
    let moment = DateTime::strptime("%Y%m%d%H%M%SZ", whole).ok()?;
    moment.to_zoned(TimeZone::UTC).ok().map(|moment| moment.timestamp().as_second())
}

/// Returns the content of the first element, if it is of this kind, and the bytes after it.
fn content(kind: u8, bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    element(bytes).filter(|(found, ..)| *found == kind).map(|(_, content, rest)| (content, rest))
}

/// Returns the kind and the content of the first element, and the bytes after it.
fn element(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&[kind, first], rest) = bytes.split_first_chunk()?;
    let (length, rest) = match first {
        0..=0x7f => (usize::from(first), rest),
        0x81..=0x84 => {
            let (digits, rest) = rest.split_at_checked(usize::from(first - 0x80))?;
            (digits.iter().fold(0, |length, &digit| length << 8 | usize::from(digit)), rest)
        }
        _ => return None,
    };
    let (content, rest) = rest.split_at_checked(length)?;
    Some((kind, content, rest))
}

#[cfg(test)]
mod tests {
    use rcgen::{CertificateParams, KeyPair, date_time_ymd};

    use super::*;

    #[test]
    fn the_end_of_a_certificate_is_read_in_either_form_of_time() {
        // The second certificate writes its year with four digits.
        for (year, seconds) in [(2031, 1_925_164_800), (2061, 2_871_936_000)] {
            let mut params = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
            params.not_after = date_time_ymd(year, 1, 3);
            let certificate = params.self_signed(&KeyPair::generate().unwrap()).unwrap();
            assert_eq!(expiry(certificate.der()), Some(seconds), "{year}");
            for length in 0..certificate.der().len().min(150) {
                assert_eq!(expiry(&certificate.der()[..length]), None);
            }
        }
    }
}
