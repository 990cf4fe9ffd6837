//! The mail server of the operator, by which people are told of events.
//!
//! The operator chose the server, so it may have a private address. Its certificate is checked against those of the
//! system. Each e-mail has a connection of its own: events are rare, and an idle connection would be closed by the server.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use jiff::Timestamp;
use jiff::fmt::rfc2822::DateTimePrinter;
use lettre::address::Envelope;
use lettre::transport::smtp::Error as SmtpError;
use lettre::transport::smtp::extension::ClientId;
use lettre::{AsyncSmtpTransport, AsyncTransport, Tokio1Executor};
use thiserror::Error;

use crate::service::subscriptions::mail_address::MailAddress;

/// The most bytes of a subject in one encoded word, of at most 75 characters (RFC 2047).
const WORD_BYTES: usize = 45;
/// The most characters of a subject that is written as it is, and of a line of such a text.
const PLAIN_SUBJECT: usize = 65;
const PLAIN_LINE: usize = 900;
/// The characters of a line of an encoded text (RFC 2045).
const ENCODED_LINE: usize = 76;

/// The reason why a mail server cannot be used. Its URL is not shown, because it may hold a password.
#[derive(Debug, Error)]
pub enum MailServerError {
    #[error(
        "the mail server must be given as smtps://user:password@host:465, as smtp://user:password@host:587?tls=required (STARTTLS), or without encryption as smtp://host:25; marks of a password such as / and @ are written as %2F and %40"
    )]
    Url,
    #[error("the mail server cannot be used")]
    Server { source: SmtpError },
    #[error("the sender of e-mails must be one address such as ballast@example.com, and not '{given}'")]
    Sender { given: String },
}

/// A mail server and the address that it sends from. It prints without its user and password.
#[derive(Clone)]
pub struct MailServer {
    transport: AsyncSmtpTransport<Tokio1Executor>,
    from: MailAddress,
}

/// An e-mail to send. A repeat of it is the same message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct OutgoingMail {
    /// The identifier of the delivery.
    pub id: String,
    pub at: Timestamp,
    pub to: MailAddress,
    pub subject: String,
    pub text: String,
}

impl MailServer {
    /// Reads the URL of a server and the address of the sender.
    ///
    /// # Errors
    /// One of them is not as it must be, or the certificates of the system cannot be read.
    pub fn new(url: &str, from: &str) -> Result<Self, MailServerError> {
        let from = MailAddress::read(from).ok_or_else(|| MailServerError::Sender { given: from.to_owned() })?;
        if !is_server(url) {
            return Err(MailServerError::Url);
        }
        let builder = AsyncSmtpTransport::<Tokio1Executor>::from_url(url);
        let builder = builder.map_err(|source| MailServerError::Server { source })?;
        let transport = builder.hello_name(ClientId::Domain(from.address().domain().to_owned())).build();
        Ok(MailServer { transport, from })
    }

    /// Sends an e-mail.
    ///
    /// # Errors
    /// The server cannot be reached or did not accept it; the text says why.
    pub(super) async fn send(&self, mail: OutgoingMail) -> Result<(), String> {
        let ends = Envelope::new(Some(self.from.address().clone()), vec![mail.to.address().clone()]);
        let ends = ends.map_err(|error| format!("no e-mail: {error}"))?;
        let message = self.message(&mail).map_err(|error| format!("no e-mail: {error}"))?;
        let sent = self.transport.send_raw(&ends, message.as_bytes()).await;
        sent.map(drop).map_err(|error| format!("the mail server: {error}"))
    }

    /// Writes the message (RFC 5322). Programs that answer every e-mail leave one alone that is `Auto-Submitted` (RFC 3834).
    fn message(&self, OutgoingMail { id, at, to, subject, text }: &OutgoingMail) -> Result<String, jiff::Error> {
        let (from, to, date) = (self.from.address(), to.address(), DateTimePrinter::new().timestamp_to_string(at)?);
        let (domain, subject, (encoding, text)) = (from.domain(), header_text(subject), body_text(text));
        Ok(format!(
            "Message-ID: <{id}@{domain}>\r\nDate: {date}\r\nFrom: {from}\r\nTo: {to}\r\nSubject: {subject}\r\n\
             Auto-Submitted: auto-generated\r\nMIME-Version: 1.0\r\nContent-Type: text/plain; charset=utf-8\r\n\
             Content-Transfer-Encoding: {encoding}\r\n\r\n{text}"
        ))
    }
}

/// Returns a text for a header: as it is if it is short and plain, otherwise in encoded words, each on its line (RFC 2047).
fn header_text(text: &str) -> String {
    let is_plain = text.len() <= PLAIN_SUBJECT && !text.contains("=?");
    if is_plain && text.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()) {
        return text.to_owned();
    }
    let mut words = vec![String::new()];
    for letter in text.chars() {
        match words.last_mut() {
            Some(word) if word.len() + letter.len_utf8() <= WORD_BYTES => word.push(letter),
            _ => words.push(letter.to_string()),
        }
    }
    let encoded = words.iter().map(|word| format!("=?utf-8?B?{}?=", STANDARD.encode(word)));
    encoded.collect::<Vec<_>>().join("\r\n ")
}

/// Returns the encoding and the lines of a text.
fn body_text(text: &str) -> (&'static str, String) {
    if text.is_ascii() && !text.contains(['\r', '\0']) && text.lines().all(|line| line.len() <= PLAIN_LINE) {
        return ("7bit", text.replace('\n', "\r\n"));
    }
    let mut lines = String::new();
    for (index, letter) in STANDARD.encode(text).chars().enumerate() {
        if index > 0 && index % ENCODED_LINE == 0 {
            lines.push_str("\r\n");
        }
        lines.push(letter);
    }
    ("base64", lines + "\r\n")
}

/// Returns whether a URL is one of the three forms. The whole URL is judged here, because a setting of encryption that is
/// misspelt would otherwise mean none.
fn is_server(url: &str) -> bool {
    let (address, query) = url.split_once('?').unwrap_or((url, ""));
    let Some((scheme, authority)) = address.split_once("://") else { return false };
    let authority = authority.strip_suffix('/').unwrap_or(authority);
    let is_form = matches!((scheme, query), ("smtps" | "smtp", "") | ("smtp", "tls=required"));
    // A user without a password would be left out silently.
    let is_whole = |user: &str| user.split_once(':').is_some_and(|(name, word)| !name.is_empty() && !word.is_empty());
    is_form && !authority.contains(['/', '#']) && authority.rsplit_once('@').is_none_or(|(user, _)| is_whole(user))
}

impl fmt::Debug for MailServer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "MailServer(from {})", self.from.address())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn server() -> MailServer {
        MailServer::new("smtp://127.0.0.1:25", "ballast@example.com").unwrap()
    }

    #[test]
    fn a_server_is_encrypted_unless_its_url_says_so_and_a_password_is_never_printed() {
        for url in [
            "smtps://user:secret@mail.example:465",
            "smtps://mail.example",
            "smtp://user:secret@mail.example:587?tls=required",
            "smtp://127.0.0.1:25/",
            "smtp://user:sec%2Fret%40@mail.internal",
        ] {
            let shown = format!("{:?}", MailServer::new(url, "ballast@example.com").unwrap());
            assert_eq!(shown, "MailServer(from ballast@example.com)", "{url}");
        }
        for url in [
            "",
            "secret",
            "https://user:secret@mail.example",
            "smtp://user:secret@mail.example?tls=opportunistic",
            "smtp://user:secret@mail.example?tls=requird",
            "smtp://user:secret@mail.example?TLS=required",
            "smtp://user:secret@mail.example?x=1&tls=required",
            "smtps://user:secret@mail.example?tls=none",
            "smtps://secret@mail.example",
            "smtps://:secret@mail.example",
            "smtps://user:secret@mail.example/path",
            "smtps://user:secret@mail.example:port",
            "smtps://user:secret@",
        ] {
            let error = MailServer::new(url, "ballast@example.com").unwrap_err();
            let causes = std::iter::successors(std::error::Error::source(&error), |cause| cause.source());
            let text = causes.fold(format!("{error} {error:?}"), |text, cause| format!("{text} {cause}"));
            assert!(!text.contains("secret"), "{url}: {text}");
        }
        for from in ["", "ballast", "Ballast <ballast@example.com>", "a@example.com, b@example.com"] {
            assert!(matches!(MailServer::new("smtp://h", from), Err(MailServerError::Sender { .. })), "{from}");
        }
    }

    #[test]
    fn no_text_becomes_a_header() {
        let subject = "Été\r\nBcc: other@example.com\r\n\r\nno body".to_owned();
        let text = "First.\r\n.\r\nBcc: other@example.com\n".repeat(5);
        let to = MailAddress::read("someone@example.com").unwrap();
        let at = Timestamp::from_second(1_700_000_000).unwrap();
        let message = server().message(&OutgoingMail { id: "msg_1".to_owned(), at, to, subject, text: text.clone() });
        let message = message.unwrap();
        let (head, body) = message.split_once("\r\n\r\n").unwrap();
        let lines = head.split("\r\n").filter(|line| !line.starts_with(' '));
        let names: Vec<&str> = lines.map(|line| line.split(':').next().unwrap()).collect();
        let [first, second] = [
            ["Message-ID", "Date", "From", "To", "Subject"].as_slice(),
            ["Auto-Submitted", "MIME-Version", "Content-Type", "Content-Transfer-Encoding"].as_slice(),
        ];
        assert_eq!(names, [first, second].concat(), "{message}");
        assert!(head.starts_with("Message-ID: <msg_1@example.com>\r\nDate: Tue, 14 Nov 2023 22:13:20 "), "{message}");
        assert_eq!(STANDARD.decode(body.replace("\r\n", "")).unwrap(), text.as_bytes());
        assert!(message.is_ascii() && message.split("\r\n").all(|line| line.len() <= 84), "{message}");
    }

    #[test]
    fn encoded_words_are_read_back_and_plain_texts_stay_as_they_are() {
        assert_eq!(header_text("Pension: the advice changed"), "Pension: the advice changed");
        for text in ["=?utf-8?B?QQ==?=", &"a".repeat(66), &"é\u{1F600}".repeat(30), "\u{7f}", "a\nb"] {
            let words: Vec<String> = header_text(text).split("\r\n ").map(str::to_owned).collect();
            let decode = |word: &String| {
                assert!(word.len() <= 75, "{word}");
                let inside = word.strip_prefix("=?utf-8?B?").and_then(|rest| rest.strip_suffix("?=")).unwrap();
                String::from_utf8(STANDARD.decode(inside).unwrap()).unwrap()
            };
            assert_eq!(words.iter().map(decode).collect::<String>(), text);
        }
        assert_eq!(body_text("One.\n\nTwo.\n"), ("7bit", "One.\r\n\r\nTwo.\r\n".to_owned()));
        assert_eq!(body_text(&"a".repeat(901)).0, "base64");
    }
}
