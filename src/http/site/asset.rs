//! Files that are embedded in the binary and served unchanged.

use axum::Extension;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, Response};
use sha2::{Digest, Sha256};

use crate::http::gate::bodies::Embedded;
use crate::http::problem::{ProblemDocument, ProblemKind};

pub const HTML: &str = "text/html; charset=utf-8";
pub const SCRIPT: &str = "text/javascript; charset=utf-8";
pub const STYLE: &str = "text/css; charset=utf-8";
pub const TEXT: &str = "text/plain; charset=utf-8";

/// One embedded file.
pub struct Asset {
    pub name: &'static str,
    media: &'static str,
    bytes: &'static [u8],
    /// True if the bytes are a gzip of the file; every browser can decode it.
    is_compressed: bool,
    /// Strong entity tag: the hash of the bytes. A browser revalidates each time and gets 304 until the binary changes.
    tag: String,
}

impl Asset {
    pub fn new((name, media, bytes): (&'static str, &'static str, &'static [u8])) -> Self {
        let digest = Sha256::digest(bytes);
        let hex: String = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
        Asset { name, media, bytes, is_compressed: false, tag: format!("\"{hex}\"") }
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
    /// browser may load and run.
    pub fn served(&'static self, policy: &'static str, headers: &HeaderMap) -> Response {
        let known = headers.get(header::IF_NONE_MATCH).and_then(|tags| tags.to_str().ok());
        let unchanged =
            known.is_some_and(|tags| tags.split(',').any(|tag| tag.trim().trim_start_matches("W/") == self.tag));
        let fixed: [(HeaderName, &str); 4] = [
            (header::CONTENT_TYPE, self.media),
            (header::CACHE_CONTROL, "no-cache"),
            (header::CONTENT_SECURITY_POLICY, policy),
            (header::REFERRER_POLICY, "no-referrer"),
        ];
        let tag = [(header::ETAG, self.tag.as_str())];
        if unchanged {
            return (StatusCode::NOT_MODIFIED, fixed, tag).into_response();
        }
        let encoding = self.is_compressed.then_some([(header::CONTENT_ENCODING, "gzip")]);
        (fixed, tag, AppendHeaders(encoding.into_iter().flatten()), Extension(Embedded), self.bytes).into_response()
    }
}
