//! The destinations that a webhook may have: public addresses, and hosts that the operator allowed by name.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use crate::control::error::FieldError;

/// The most characters of an address.
pub const LONGEST_URL: usize = 2_000;

/// The parts of a URL that a delivery needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Destination {
    pub is_encrypted: bool,
    /// In lower case; of an IPv6 address without brackets.
    pub host: String,
    pub port: u16,
    /// With the query.
    pub path: String,
}

impl Destination {
    /// Reads the URL of a receiver. `allowed` are the hosts that the operator named: these alone may be private, and
    /// may be reached without encryption.
    ///
    /// # Errors
    /// It is no such URL, or names an address that is not public.
    pub fn read(url: &str, allowed: &[String]) -> Result<Self, FieldError> {
        let fault = |rule: &str| FieldError::new("url", url, rule);
        let is_plain = url.bytes().all(|byte| byte.is_ascii_graphic()) && url.len() <= LONGEST_URL;
        let (scheme, rest) = url.split_once("://").unwrap_or_default();
        let is_encrypted = scheme.eq_ignore_ascii_case("https");
        if !is_plain || !(is_encrypted || scheme.eq_ignore_ascii_case("http")) {
            return Err(fault("must be a URL such as https://example.com/hook or mailto:someone@example.com"));
        }
        let end = rest.find(['/', '?', '#']).unwrap_or(rest.len());
        let (authority, path) = rest.split_at(end);
        if authority.contains('@') || path.contains('#') {
            return Err(fault("must hold no user name, no password and no fragment"));
        }
        let (host, port) = host_and_port(authority, is_encrypted).ok_or_else(|| fault("must name a host"))?;
        // A machine reads such a number as an address too, so it is not clear which host is meant.
        if is_number(&host) && host.parse::<IpAddr>().is_err() {
            return Err(fault("must name a host, or an address of four numbers from 0 to 255"));
        }
        if !is_allowed(&host, allowed) {
            if !is_encrypted {
                return Err(fault("must begin with https:// unless the operator allows the host by --webhook-allow"));
            }
            if host.parse().is_ok_and(|address| !is_public(address)) {
                return Err(fault("must have a public address unless the operator allows the host by --webhook-allow"));
            }
        }
        let path = if path.starts_with('/') { path.to_owned() } else { format!("/{path}") };
        Ok(Destination { is_encrypted, host, port, path })
    }

    /// Returns the header `Host`.
    pub fn authority(&self) -> String {
        let host = if self.host.contains(':') { format!("[{}]", self.host) } else { self.host.clone() };
        let usual = if self.is_encrypted { 443 } else { 80 };
        if self.port == usual { host } else { format!("{host}:{}", self.port) }
    }
}

fn host_and_port(authority: &str, is_encrypted: bool) -> Option<(String, u16)> {
    let (host, port) = match authority.strip_prefix('[') {
        Some(rest) => {
            let (host, after) = rest.split_once(']')?;
            host.parse::<Ipv6Addr>().ok()?;
            (host, after.strip_prefix(':').map_or_else(|| after.is_empty().then_some(""), Some)?)
        }
        None => authority.split_once(':').unwrap_or((authority, "")),
    };
    let is_host = |byte: u8| byte.is_ascii_alphanumeric() || b"-._:".contains(&byte);
    if host.is_empty() || !host.bytes().all(is_host) {
        return None;
    }
    let usual = if is_encrypted { 443 } else { 80 };
    let port = if port.is_empty() { usual } else { port.parse().ok().filter(|port| *port > 0)? };
    Some((host.to_ascii_lowercase(), port))
}

/// Returns whether the last part of a host is a number, decimal or with 0x.
fn is_number(host: &str) -> bool {
    let last = host.trim_end_matches('.').rsplit('.').next().unwrap_or_default();
    let hexadecimal = last.strip_prefix("0x").is_some_and(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()));
    hexadecimal || !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns whether the operator named the host.
pub fn is_allowed(host: &str, allowed: &[String]) -> bool {
    allowed.iter().any(|name| name.trim_matches(['[', ']']).eq_ignore_ascii_case(host))
}

/// Returns whether an address is one of the public internet. Everything else could be a machine of the operator.
pub fn is_public(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(address) => is_public_v4(address),
        IpAddr::V6(address) => match (address.to_ipv4_mapped(), address.segments()) {
            (Some(mapped), _) => is_public_v4(mapped),
            // Translated (64:ff9b::/96) and tunnelled (2002::/16) addresses stand for one of IPv4.
            (None, [0x64, 0xff9b, 0, 0, 0, 0, high, low] | [0x2002, high, low, ..]) => {
                is_public_v4(Ipv4Addr::from(u32::from(high) << 16 | u32::from(low)))
            }
            // 2000::/3 is all that is allocated; without Teredo, documentation, benchmarks and ORCHID.
            (None, [0x2001, second, ..]) => second >= 0x200 && second != 0xdb8,
            (None, [0x3fff, ..]) => false,
            (None, [first, ..]) => first & 0xe000 == 0x2000,
        },
    }
}

fn is_public_v4(address: Ipv4Addr) -> bool {
    let [first, second, third, _] = address.octets();
    !matches!(
        (first, second, third),
        (0 | 10 | 127 | 224..=255, ..)
            | (169, 254, _)
            | (192, 168, _)
            | (100, 64..=127, _)
            | (172, 16..=31, _)
            | (198, 18..=19, _)
            | (192, 0, 0 | 2)
            | (192, 88, 99)
            | (198, 51, 100)
            | (203, 0, 113)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_addresses_of_the_internet_are_public() {
        for private in [
            "0.0.0.0",
            "10.1.2.3",
            "127.0.0.1",
            "127.9.9.9",
            "169.254.169.254",
            "172.16.0.1",
            "172.31.255.255",
            "192.168.1.1",
            "100.64.0.1",
            "192.0.2.1",
            "198.18.0.1",
            "198.51.100.7",
            "203.0.113.9",
            "224.0.0.1",
            "240.0.0.1",
            "255.255.255.255",
            "::",
            "::1",
            "fe80::1",
            "fc00::1",
            "fd12::1",
            "ff02::1",
            "2001:db8::1",
            "::ffff:127.0.0.1",
            "::ffff:10.0.0.1",
            "::127.0.0.1",
            "64:ff9b::7f00:1",
            "2002:7f00:1::",
            "2001::1",
            "fec0::1",
            "3fff::1",
        ] {
            assert!(!is_public(private.parse().unwrap()), "{private}");
        }
        for public in [
            "1.1.1.1",
            "8.8.8.8",
            "172.15.0.1",
            "172.32.0.1",
            "100.128.0.1",
            "192.1.2.3",
            "2606:4700::1111",
            "2a00:1450::1",
            "::ffff:8.8.8.8",
            "64:ff9b::808:808",
            "2001:4860:4860::8888",
        ] {
            assert!(is_public(public.parse().unwrap()), "{public}");
        }
    }

    #[test]
    fn urls_are_read_strictly() {
        let read = |url: &str| Destination::read(url, &["Hooks.internal".into(), "[::1]".into(), "127.0.0.1".into()]);
        let there = read("https://Example.com").unwrap();
        assert_eq!((there.host.as_str(), there.port, there.path.as_str()), ("example.com", 443, "/"));
        assert_eq!(there.authority(), "example.com");
        let there = read("http://hooks.internal:8080/a/b?c=d").unwrap();
        assert_eq!(
            (there.port, there.path.as_str(), there.authority().as_str()),
            (8080, "/a/b?c=d", "hooks.internal:8080")
        );
        assert_eq!(read("https://[::1]:1/").unwrap().authority(), "[::1]:1");
        assert_eq!(read("https://example.com?x=1").unwrap().path, "/?x=1");
        for refused in [
            "",
            "example.com",
            "ftp://example.com",
            "http://example.com",
            "https://",
            "https:///x",
            "https://a@b.com",
            "https://b.com/#x",
            "https://b.com:0",
            "https://b.com:99999",
            "https://b.com/ x",
            "https://10.0.0.1/",
            "https://[::2]/",
            "https://[x]/",
            "https://[::1]x/",
            "https://b%41.com/",
            "https://bücher.example/",
            "https://127.0.0.2",
            "https://2130706433/",
            "https://0x7f.1/",
            "https://127.1",
            "https://300.1.1.1.",
            "https://a\\b.com",
        ] {
            assert!(read(refused).is_err(), "{refused}");
        }
    }
}
