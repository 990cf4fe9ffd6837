//! The host names to which the service answers.
//!
//! A request must have exactly one `Host`. A service without keys could also be reached by a web page whose name was
//! made to resolve to it. So it accepts only the names of loopback, the address of the connection, and those that the
//! operator gives. Such a page sends its own name and is refused. A page of another origin may address the service by
//! its own name; its browser says so, and such a call changes nothing.

use std::net::IpAddr;

use axum::http::uri::Authority;
use axum::http::{HeaderMap, Method, Uri, header};

use crate::http::problem::{ProblemDocument, ProblemKind};

const RULE: &str = "must be localhost, a loopback address, the address of the connection, or a name given with --host";

/// The names that an operator gives, besides the service's own.
#[derive(Debug, Clone, Default)]
pub struct Hosts(Vec<String>);

impl Hosts {
    pub fn new(names: &[String]) -> Self {
        Hosts(names.iter().map(|name| name.trim_end_matches('.').to_ascii_lowercase()).collect())
    }

    /// Rejects a request that names a foreign host.
    ///
    /// # Errors
    /// The request names a host that is not this service.
    pub fn refuse_foreign(&self, headers: &HeaderMap, uri: &Uri, local: Option<IpAddr>) -> Result<(), ProblemDocument> {
        let named = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
        let own = |host: &str| host.parse::<Authority>().is_ok_and(|host| self.is_own(host.host(), local));
        let foreign = match uri.authority() {
            _ if !own(named) => named,
            Some(authority) if !own(authority.as_str()) => authority.as_str(),
            _ => return Ok(()),
        };
        let problem =
            ProblemDocument::new(ProblemKind::Misdirected, "a service without keys accepts only its own host names");
        Err(problem.naming("Host", foreign, RULE))
    }

    fn is_own(&self, host: &str, local: Option<IpAddr>) -> bool {
        let host = host.trim_end_matches('.').to_ascii_lowercase();
        let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(&host);
        match bare.parse::<IpAddr>().map(|address| address.to_canonical()) {
            Ok(address) if address.is_loopback() => true,
            Ok(address) if local.is_some_and(|local| local.to_canonical() == address) => true,
            _ => host == "localhost" || self.0.contains(&host),
        }
    }
}

/// Rejects a request of a web page of another origin, unless it only reads.
///
/// # Errors
/// The browser says in `Sec-Fetch-Site` that the page is not the service's own.
pub fn refuse_other_pages(headers: &HeaderMap, method: &Method) -> Result<(), ProblemDocument> {
    let site = headers.get("sec-fetch-site").map(|site| site.to_str().unwrap_or_default());
    match site {
        Some(site) if !method.is_safe() && !["same-origin", "none"].contains(&site) => {
            let detail = "a service without keys is changed by no web page but its own";
            let problem = ProblemDocument::new(ProblemKind::InvalidHeader, detail);
            Err(problem.naming("Sec-Fetch-Site", site, "must be same-origin or none"))
        }
        _ => Ok(()),
    }
}

/// Rejects a request with ambiguous headers.
///
/// # Errors
/// There is not exactly one `Host`, or there is more than one `Authorization`.
pub fn refuse_ambiguous(headers: &HeaderMap) -> Result<(), ProblemDocument> {
    let count = |name| headers.get_all(name).iter().count();
    let refused = |name: &str, given: usize, rule: &str| {
        let problem = ProblemDocument::new(
            ProblemKind::InvalidHeader,
            format!("the header {name} is given {given} times: it {rule}"),
        );
        Err(problem.naming(name, given, rule))
    };
    match (count(header::HOST), count(header::AUTHORIZATION)) {
        (1, 0 | 1) => Ok(()),
        (1, given) => refused("Authorization", given, "must be given at most once"),
        (given, _) => refused("Host", given, "must be given exactly once"),
    }
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderName, HeaderValue};

    use super::*;

    fn headers(named: &[(HeaderName, &'static str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in named {
            headers.append(name, HeaderValue::from_static(value));
        }
        headers
    }

    #[test]
    fn own_names_are_taken_and_others_are_not() {
        let hosts = Hosts::new(&["api-1".into(), "Ballast.Example".into()]);
        let local: IpAddr = "192.168.7.1".parse().unwrap();
        let answers = |host: &'static str, uri: &'static str| {
            hosts.refuse_foreign(&headers(&[(header::HOST, host)]), &Uri::from_static(uri), Some(local)).is_ok()
        };
        for own in [
            "localhost",
            "LOCALHOST:8080",
            "127.0.0.1:80",
            "127.9.9.9",
            "[::1]:8080",
            "192.168.7.1:8080",
            "api-1:8080",
            "ballast.example.",
            "BALLAST.example",
        ] {
            assert!(answers(own, "/jobs"), "{own}");
        }
        for foreign in [
            "evil.example",
            "localhost.evil.example",
            "192.168.7.2",
            "",
            "a b",
            "localhost@evil.example",
            "127.0.0.1.evil.example",
            "api-2",
        ] {
            assert!(!answers(foreign, "/jobs"), "{foreign}");
        }
        assert!(answers("localhost", "http://localhost/jobs") && !answers("localhost", "http://evil.example/jobs"));
    }

    #[test]
    fn a_page_of_another_origin_only_reads() {
        let passes = |site, method: Method| {
            refuse_other_pages(&headers(&[(HeaderName::from_static("sec-fetch-site"), site)]), &method).is_ok()
        };
        for site in ["cross-site", "same-site", ""] {
            assert!(
                passes(site, Method::GET) && !passes(site, Method::POST) && !passes(site, Method::DELETE),
                "{site}"
            );
        }
        assert!(passes("same-origin", Method::POST) && passes("none", Method::POST));
        assert!(refuse_other_pages(&headers(&[]), &Method::POST).is_ok(), "programs send no such header");
    }

    #[test]
    fn who_is_asked_and_who_asks_is_said_once() {
        let (host, key) = ((header::HOST, "localhost"), (header::AUTHORIZATION, "Bearer a"));
        for (named, sound) in [
            (&[host.clone()][..], true),
            (&[host.clone(), key.clone()], true),
            (&[], false),
            (&[host.clone(), host.clone()], false),
            (&[host, key.clone(), key], false),
        ] {
            assert_eq!(refuse_ambiguous(&headers(named)).is_ok(), sound, "{named:?}");
        }
    }
}
