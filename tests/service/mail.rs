//! People are told of events by e-mail, over a real conversation with a mail server: at least once, each event under one
//! `Message-ID`, and nothing that a subscriber writes becomes more than one address or a header.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::subscriptions::{a_job_ends, listed, until};
use crate::support::{App, postgres, specification};
use ballast::service::process::config::{Config, StoreLocation};
use ballast::service::subscriptions::mail_server::MailServer;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use reqwest::Method;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};

/// A mail server that keeps each message with the commands before it, and answers as the test sets.
#[derive(Clone)]
struct Mailbox {
    address: std::net::SocketAddr,
    state: Arc<Mutex<MailboxState>>,
}

#[derive(Default)]
struct MailboxState {
    /// Every command of every connection.
    commands: Vec<String>,
    messages: Vec<String>,
    /// The answer to a message.
    answer: String,
    /// The answer to a command that begins so, instead of the usual one.
    refuses: Option<(&'static str, &'static str)>,
    delay: Duration,
}

impl Mailbox {
    async fn start() -> Mailbox {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let state = MailboxState { answer: "250 accepted".to_owned(), ..MailboxState::default() };
        let mailbox = Mailbox { address: listener.local_addr().unwrap(), state: Arc::new(Mutex::new(state)) };
        let accepting = mailbox.clone();
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(accepting.clone().converse(stream));
            }
        });
        mailbox
    }

    /// Speaks with a client until it goes away (RFC 5321).
    async fn converse(self, stream: TcpStream) -> Option<()> {
        let (reading, mut writing) = stream.into_split();
        let mut lines = BufReader::new(reading).lines();
        writing.write_all(b"220 mail.test\r\n").await.ok()?;
        loop {
            let command = lines.next_line().await.ok()??;
            self.state.lock().unwrap().commands.push(command.clone());
            let refused = self.state.lock().unwrap().refuses.filter(|(begin, _)| command.starts_with(begin));
            let usual = match command.split(' ').next().unwrap() {
                "EHLO" => "250-mail.test\r\n250-8BITMIME\r\n250 AUTH PLAIN",
                "AUTH" => "235 known",
                "DATA" => "354 go on",
                "QUIT" => "221 bye",
                _ => "250 fine",
            };
            let answer = refused.map_or(usual, |(_, answer)| answer);
            writing.write_all(format!("{answer}\r\n").as_bytes()).await.ok()?;
            if answer.starts_with("354") {
                let mut message = String::new();
                loop {
                    match lines.next_line().await.ok()?? {
                        end if end == "." => break,
                        line => message += &format!("{}\n", line.strip_prefix('.').unwrap_or(&line)),
                    }
                }
                let (answer, delay) = {
                    let mut state = self.state.lock().unwrap();
                    state.messages.push(message);
                    (state.answer.clone(), state.delay)
                };
                tokio::time::sleep(delay).await;
                writing.write_all(format!("{answer}\r\n").as_bytes()).await.ok()?;
            }
        }
    }

    fn answer(&self, answer: &str) {
        self.state.lock().unwrap().answer = answer.to_owned();
    }

    fn refuse(&self, begin: &'static str, answer: &'static str) {
        self.state.lock().unwrap().refuses = Some((begin, answer));
    }

    fn messages(&self) -> Vec<String> {
        self.state.lock().unwrap().messages.clone()
    }

    fn commands(&self) -> Vec<String> {
        self.state.lock().unwrap().commands.clone()
    }

    /// The URL of the server with `user` in front of the host.
    fn url(&self, user: &str, query: &str) -> String {
        format!("smtp://{user}{}{query}", self.address)
    }

    async fn app(&self) -> App {
        let url = self.url("", "");
        App::configured(|config| quickly(config, &url)).await
    }
}

fn quickly(config: &mut Config, url: &str) {
    config.webhooks.mail = Some(MailServer::new(url, "ballast@house.example").unwrap());
    (config.webhooks.first_delay, config.webhooks.attempts) = (Duration::from_millis(50), 3);
    config.webhooks.look = Duration::from_millis(50);
}

/// The value of a header that is not folded.
fn header<'a>(message: &'a str, name: &str) -> &'a str {
    let (head, _) = message.split_once("\n\n").unwrap();
    let found: Vec<&str> = head.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix(": ")).collect();
    assert_eq!(found.len(), 1, "{name}: {message}");
    found[0]
}

async fn subscribe(app: &App, request: Value) -> String {
    let (status, made) = app.post("/subscriptions", &request).await;
    assert_eq!(status, 201, "{made}");
    made["subscription"].as_str().unwrap().to_owned()
}

async fn only(app: &App) -> Value {
    listed(app).await[0].clone()
}

fn to_someone() -> Value {
    json!({ "url": "mailto:someone@example.com", "events": ["job_ended"] })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_fails_and_recovers_gets_each_event_under_one_identifier() {
    async fn story(app: App, mailbox: Mailbox) {
        mailbox.answer("451 try again later");
        let subscription = subscribe(&app, to_someone()).await;
        let job = a_job_ends(&app, 1).await;
        until("two attempts fail", async || only(&app).await["failures"].as_u64() >= Some(2)).await;
        let error = only(&app).await["last_error"].as_str().unwrap().to_owned();
        assert!(error.contains("451") && error.contains("try again later"), "{error}");
        mailbox.answer("250 accepted");
        until("it is delivered", async || only(&app).await["delivered"] == 1).await;
        let first = mailbox.messages();
        assert_eq!(first.len(), 3, "three attempts, the last of which succeeds");
        assert!(first.iter().all(|message| *message == first[0]), "a repeat is the same message");
        a_job_ends(&app, 2).await;
        until("another is delivered", async || only(&app).await["delivered"] == 2).await;
        let messages = mailbox.messages();
        assert_ne!(header(&messages[3], "Message-ID"), header(&messages[0], "Message-ID"));
        let message = &messages[0];
        assert!(header(message, "Message-ID").starts_with("<msg_"), "{message}");
        assert_eq!(header(message, "From"), "ballast@house.example");
        assert_eq!(header(message, "To"), "someone@example.com");
        assert_eq!(header(message, "Subject"), "A job (train) succeeded");
        assert_eq!(header(message, "Auto-Submitted"), "auto-generated");
        assert!(message.contains(&format!("The job {job} (train) succeeded.")), "{message}");
        assert!(message.contains(&subscription), "{message}");
        let commands = mailbox.commands();
        assert_eq!(&commands[1], "MAIL FROM:<ballast@house.example>");
        assert_eq!(&commands[2], "RCPT TO:<someone@example.com>");
    }
    let mailbox = Mailbox::start().await;
    story(mailbox.app().await, mailbox).await;
    let Some(database) = postgres::database().await else { return };
    let (store, mailbox) = (StoreLocation::Postgres(database.parse().unwrap()), Mailbox::start().await);
    let url = mailbox.url("", "");
    let shared = |config: &mut Config| {
        quickly(config, &url);
        config.store = store;
    };
    story(App::configured(shared).await, mailbox).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_that_is_refused_is_given_up_and_can_be_sent_to_again() {
    let mailbox = Mailbox::start().await;
    let app = mailbox.app().await;
    mailbox.refuse("RCPT", "550 no such person");
    let id = subscribe(&app, to_someone()).await;
    let job = a_job_ends(&app, 1).await;
    until("it is given up", async || only(&app).await["dead"] == 1).await;
    let letter = only(&app).await["dead_letters"][0].clone();
    assert_eq!(letter["attempts"], 3);
    assert!(letter["error"].as_str().unwrap().contains("no such person"), "{letter}");
    assert!(letter["body"].as_str().unwrap().contains(&job), "{letter}");
    assert_eq!(mailbox.messages(), Vec::<String>::new());
    mailbox.refuse("NONE", "");
    let (status, resent) = app.send(Method::POST, &format!("/subscriptions/{id}/resend"), None).await;
    assert_eq!((status.as_u16(), &resent), (200, &json!({ "queued": 1 })));
    until("it is delivered", async || only(&app).await["delivered"] == 1).await;
    let messages = mailbox.messages();
    let expected = format!("<{}@house.example>", letter["delivery"].as_str().unwrap());
    assert_eq!(messages.iter().map(|message| header(message, "Message-ID")).collect::<Vec<_>>(), [expected]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_is_called_by_its_name_which_becomes_no_header() {
    let mailbox = Mailbox::start().await;
    let mut app = mailbox.app().await;
    let mut monthly = specification(4);
    monthly["problem"]["periods_per_year"] = json!(12);
    app.train(&monthly).await;
    app.open_with(json!({ "name": "Bcc: other@example.com, <x>" })).await;
    subscribe(&app, json!({ "url": "mailto:someone@example.com", "events": ["report_due"] })).await;
    let report = json!({ "session": app.session, "period": 1, "log_return": 0.01, "date": "2008-01-31" });
    assert_eq!(app.post("/observe", &report).await.0, 200);
    until("the report is due", async || mailbox.messages().len() == 1).await;
    let message = &mailbox.messages()[0];
    let subject = "Bcc: other@example.com, <x>: the report of period 2 is due";
    assert_eq!(header(message, "Subject"), subject);
    assert!(message.contains("The report of period 2 is due. Its day is 2008-02-29."), "{message}");
    assert!(message.contains(&format!("({})", app.session)), "{message}");
    let recipients = mailbox.commands().into_iter().filter(|command| command.starts_with("RCPT"));
    assert_eq!(recipients.collect::<Vec<_>>(), ["RCPT TO:<someone@example.com>"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_password_is_sent_and_never_without_the_encryption_that_is_required() {
    let mailbox = Mailbox::start().await;
    let plain = mailbox.url("house:p%40ss@", "");
    let app = App::configured(|config| quickly(config, &plain)).await;
    subscribe(&app, to_someone()).await;
    a_job_ends(&app, 1).await;
    until("it is delivered", async || only(&app).await["delivered"] == 1).await;
    let shown = format!("AUTH PLAIN {}", STANDARD.encode("\0house\0p@ss"));
    assert!(mailbox.commands().contains(&shown), "{:?}", mailbox.commands());
    // The server offers no encryption, so a client that requires it says nothing more.
    let unable = Mailbox::start().await;
    for url in [unable.url("house:p%40ss@", "?tls=required"), format!("smtps://house:p%40ss@{}", unable.address)] {
        let app = App::configured(|config| quickly(config, &url)).await;
        subscribe(&app, to_someone()).await;
        a_job_ends(&app, 1).await;
        until("it fails", async || only(&app).await["failures"].as_u64() >= Some(1)).await;
        let error = only(&app).await["last_error"].as_str().unwrap().to_owned();
        assert!(!error.contains("ss@"), "{error}");
    }
    let commands = unable.commands();
    assert!(!commands.iter().any(|command| command.starts_with("AUTH") || command.starts_with("MAIL")), "{commands:?}");
    assert_eq!(unable.messages(), Vec::<String>::new());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_does_not_answer_ends_the_attempt() {
    let mailbox = Mailbox::start().await;
    let app = mailbox.app().await;
    mailbox.state.lock().unwrap().delay = Duration::from_secs(600);
    subscribe(&app, to_someone()).await;
    a_job_ends(&app, 1).await;
    until("the attempt ends", async || only(&app).await["failures"].as_u64() >= Some(1)).await;
    assert_eq!(only(&app).await["last_error"], "no answer within 10 s");
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_subscribes_by_email_without_a_server_or_with_more_than_one_address() {
    let without = App::start().await;
    let (status, refused) = without.post("/subscriptions", &to_someone()).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("url")), "{refused}");
    assert!(refused["rule"].as_str().unwrap().contains("configured no mail server"), "{refused}");
    let mailbox = Mailbox::start().await;
    let app = mailbox.app().await;
    for url in [
        "mailto:",
        "mailto:someone@example.com?bcc=other@example.com",
        "mailto:one@example.com,two@example.com",
        "mailto:someone@example.com\r\nRCPT TO:<other@example.com>",
        "mailto:someone%0a@example.com",
        "mailto:<someone@example.com>",
        "mailto:someone@localhost",
    ] {
        let (status, refused) = app.post("/subscriptions", &json!({ "url": url, "events": ["job_ended"] })).await;
        assert_eq!((status.as_u16(), &refused["field"], &refused["value"]), (422, &json!("url"), &json!(url)));
        assert!(refused["rule"].as_str().unwrap().contains("one address"), "{refused}");
    }
    assert_eq!(app.get("/subscriptions").await.1["subscriptions"], json!([]));
}
