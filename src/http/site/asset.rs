//! Files that are embedded in the binary. Text is compressed for clients that can decode it.

use std::io::Write;
use std::sync::OnceLock;

use axum::Extension;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, Response};
use flate2::Compression;
use flate2::write::GzEncoder;
use sha2::{Digest, Sha256};

use crate::http::gate::bodies::Embedded;
use crate::http::problem::{ProblemDocument, ProblemKind};

pub const HTML: &str = "text/html; charset=utf-8";
pub const SCRIPT: &str = "text/javascript; charset=utf-8";
pub const STYLE: &str = "text/css; charset=utf-8";
pub const MARKDOWN: &str = "text/markdown; charset=utf-8";
pub const TEXT: &str = "text/plain; charset=utf-8";

/// One embedded file.
pub struct Asset {
    pub name: &'static str,
    media: &'static str,
    bytes: &'static [u8],
    /// True if the bytes are a gzip of the file; every browser can decode it.
    is_compressed: bool,
    /// The bytes compressed, once a client asked for them so.
    gzip: OnceLock<Vec<u8>>,
    /// The hash of the bytes, in hexadecimal digits.
    hash: String,
}

impl Asset {
    pub fn new((name, media, bytes): (&'static str, &'static str, &'static [u8])) -> Self {
        let digest = Sha256::digest(bytes);
        let hash = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
        Asset { name, media, bytes, is_compressed: false, gzip: OnceLock::new(), hash }
    }

    /// Marks the bytes as a gzip of the file.
    pub fn compressed(self) -> Self {
        Asset { is_compressed: true, ..self }
    }

    pub fn bytes(&self) -> &'static [u8] {
        self.bytes
    }

    /// Returns the file of `page` with this name.
    ///
    /// # Errors
    /// There is no such file.
    pub fn find(files: &'static [Asset], name: &str, page: &str) -> Result<&'static Asset, ProblemDocument> {
        files.iter().find(|asset| asset.name == name).ok_or_else(|| {
            let problem = ProblemDocument::new(ProblemKind::NotFound, format!("{page} has no file {name}"));
            problem.naming("file", name, format!("must be a file of {page}"))
        })
    }

    /// Returns the answer to a request with these headers; `policy` is the content security policy, which limits what a
    /// browser may load and run. A browser revalidates each time by the entity tag, which is strong, and gets 304 until
    /// the binary changes.
    pub fn served(&'static self, policy: &'static str, headers: &HeaderMap) -> Response {
        let (bytes, encoding) = match self.is_text() && accepts_gzip(headers) {
            true => (self.gzip.get_or_init(|| compressed(self.bytes)).as_slice(), Some("gzip")),
            false => (self.bytes, self.is_compressed.then_some("gzip")),
        };
        let tag = format!("\"{}{}\"", self.hash, if encoding.is_some() { "-gzip" } else { "" });
        let known = headers.get(header::IF_NONE_MATCH).and_then(|tags| tags.to_str().ok());
        let unchanged =
            known.is_some_and(|tags| tags.split(',').any(|known| known.trim().trim_start_matches("W/") == tag));
        let fixed: [(HeaderName, &str); 5] = [
            (header::CONTENT_TYPE, self.media),
            (header::CACHE_CONTROL, "no-cache"),
            (header::CONTENT_SECURITY_POLICY, policy),
            (header::REFERRER_POLICY, "no-referrer"),
            (header::VARY, "accept-encoding"),
        ];
        let tag = [(header::ETAG, tag)];
        if unchanged {
            return (StatusCode::NOT_MODIFIED, fixed, tag).into_response();
        }
        let encoding = encoding.map(|encoding| (header::CONTENT_ENCODING, encoding));
        (fixed, tag, AppendHeaders(encoding), Extension(Embedded), bytes).into_response()
    }

    fn is_text(&self) -> bool {
        !self.is_compressed && (self.media.starts_with("text/") || self.media == "image/svg+xml")
    }
}

/// Returns true if the client says that it decodes gzip.
fn accepts_gzip(headers: &HeaderMap) -> bool {
    let accepted = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    accepted.flat_map(|value| value.split(',')).any(|coding| {
        let (name, quality) = coding.split_once(';').unwrap_or((coding, ""));
        let refused = quality.trim().strip_prefix("q=").is_some_and(|quality| quality.parse() == Ok(0.0));
        name.trim().eq_ignore_ascii_case("gzip") && !refused
    })
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    // Writing to memory does not fail.
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}
