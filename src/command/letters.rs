//! `ballast letters`: the letters to all clients of a running service, a file each.

mod remote;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ballast::http::api_client::percent_encoded;
use clap::Args;
use hyper::Method;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use self::remote::{RemoteAnswer, RemoteService};

/// Sessions on a page of the list, the most that the service sends.
const LISTED: usize = 1000;
/// Pauses before a call that the service is too busy for is sent again.
const PAUSES: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(4)];
/// The statuses of such a call.
const BUSY: [u16; 2] = [429, 503];

#[derive(Debug, Args)]
pub struct LettersArgs {
    /// Address of the service, as `http://host:port` or `https://host:port`.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    url: String,
    /// File with a key of role read. Without it no key is sent.
    #[arg(long)]
    key_file: Option<PathBuf>,
    /// File with the firm in JSON: `name`, `closing`, `disclaimer` and `logo`, each of which may be left out.
    #[arg(long)]
    firm: Option<PathBuf>,
    /// Currency of the amounts, such as EUR. Without it none is named.
    #[arg(long)]
    currency: Option<String>,
    /// A session whose letter is written; may be repeated. Default: all that are not completed.
    #[arg(long)]
    session: Vec<String>,
    /// Folder for the letters, made if there is none.
    #[arg(long)]
    out: PathBuf,
}

/// A session as the service lists it.
#[derive(Debug, Deserialize)]
struct ListedSession {
    session: String,
    name: String,
    state: String,
    /// Missing if the session is of a declared problem.
    wealth: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct ListedSessions {
    sessions: Vec<ListedSession>,
    next: Option<Value>,
}

/// Writes the letters, and prints a line for each.
///
/// # Errors
/// A file cannot be read, the sessions cannot be listed, or a letter could not be written; the others are.
pub async fn run(arguments: LettersArgs) -> Result<(), Box<dyn Error>> {
    let key = arguments.key_file.as_deref().map(read).transpose()?.map(|key| key.trim().to_owned());
    let mut request = Map::new();
    if let Some(path) = &arguments.firm {
        let firm: Value = serde_json::from_str(&read(path)?).map_err(|error| format!("{}: {error}", path.display()))?;
        request.insert("firm".into(), firm);
    }
    if let Some(currency) = &arguments.currency {
        request.insert("currency".into(), json!(currency));
    }
    let (request, service) = (Value::Object(request), RemoteService::at(&arguments.url, key)?);
    let clients: Vec<(String, String)> = match arguments.session.is_empty() {
        true => all(&service).await?,
        false => arguments.session.iter().map(|session| (session.clone(), String::new())).collect(),
    };
    fs::create_dir_all(&arguments.out).map_err(|error| format!("{}: {error}", arguments.out.display()))?;
    let mut failed = 0;
    for (session, name) in &clients {
        match write(&service, (session, name), &request, &arguments.out).await {
            Ok(line) => println!("{line}"),
            Err(error) => {
                failed += 1;
                let of = if name.is_empty() { session } else { name };
                eprintln!("ballast: no letter to {of}: {error}");
            }
        }
    }
    if failed == 0 { Ok(()) } else { Err(format!("{failed} of {} letters could not be written", clients.len()).into()) }
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Returns the identifiers and the names of all investors' sessions that are not completed, in the order of the names.
async fn all(service: &RemoteService) -> Result<Vec<(String, String)>, Box<dyn Error>> {
    let mut found = Vec::new();
    let mut after = String::new();
    loop {
        let path = format!("/sessions?sort=name&limit={LISTED}{after}");
        let page: ListedSessions = parsed(&service.call(Method::GET, &path, None).await?)?;
        let wanted = page.sessions.into_iter().filter(|entry| entry.state != "completed" && entry.wealth.is_some());
        found.extend(wanted.map(|entry| (entry.session, entry.name)));
        let Some(next) = page.next else { return Ok(found) };
        let next = next.as_str().map_or_else(|| next.to_string(), str::to_owned);
        after = format!("&after={}", percent_encoded(&next));
    }
}

/// Writes one letter and returns its line: the file, the client and the trades.
async fn write(
    service: &RemoteService,
    (session, name): (&str, &str),
    request: &Value,
    folder: &Path,
) -> Result<String, Box<dyn Error>> {
    if !session.bytes().all(|letter| letter.is_ascii_alphanumeric() || letter == b'_') {
        return Err("it is not the name of a session".into());
    }
    let path = format!("/sessions/{session}/letter");
    let answer = answered(service, &path, request).await?;
    if !answer.status.is_success() {
        return Err(refusal(&answer).into());
    }
    let file = format!("{session}.html");
    fs::write(folder.join(&file), &answer.text)?;
    let trades = answer.headers.get("ballast-trades").and_then(|trades| trades.to_str().ok()).unwrap_or_default();
    let name = if name.is_empty() { String::new() } else { format!("  {name}") };
    Ok(format!("{file}{name}  {trades}"))
}

/// Asks for a letter, again if the service is busy; at last for one without the sentence on what would change the advice.
async fn answered(service: &RemoteService, path: &str, request: &Value) -> Result<RemoteAnswer, Box<dyn Error>> {
    for pause in PAUSES {
        let answer = service.call(Method::POST, &format!("{path}?sensitivity=true"), Some(request)).await?;
        if !BUSY.contains(&answer.status.as_u16()) {
            return Ok(answer);
        }
        tokio::time::sleep(pause).await;
    }
    Ok(service.call(Method::POST, path, Some(request)).await?)
}

fn parsed<T: DeserializeOwned>(answer: &RemoteAnswer) -> Result<T, Box<dyn Error>> {
    if !answer.status.is_success() {
        return Err(refusal(answer).into());
    }
    Ok(serde_json::from_str(&answer.text)?)
}

/// Returns the words of a refusal: the detail of its problem document, and otherwise its status.
fn refusal(answer: &RemoteAnswer) -> String {
    let problem: Option<Value> = serde_json::from_str(&answer.text).ok();
    let detail = problem.as_ref().and_then(|problem| problem["detail"].as_str());
    detail.map_or_else(|| format!("the service answered {}", answer.status), str::to_owned)
}
