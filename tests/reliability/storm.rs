//! Sixteen clients report the same periods at once: some requests are dropped on the way, most arrive again and again,
//! out of order and at times with other content. What is left must be what one patient client would have left.

use std::collections::BTreeMap;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::caller::Caller;
use crate::ledger::{Audit, Session, says_the_same};
use crate::scene::{HORIZON, Outcome, Tally, import};
use crate::server::Site;

const CLIENTS: u64 = 16;
/// One short of the horizon, so that there is an action to compare.
const PERIODS: usize = HORIZON - 1;

pub async fn storm(trials: usize) -> Outcome {
    let (site, mut tally) = (Site::new(), Tally::default());
    let server = site.start().await?;
    tally.started(&server);
    let caller = Caller::new(&[&server.url]);
    let policy = import(&caller).await;
    for trial in 0..trials {
        let session = caller.open(&policy).await.ok_or("no session")?;
        let clients = (0..CLIENTS).map(|number| {
            let mut random = ChaCha8Rng::seed_from_u64(trial as u64);
            random.set_stream(number);
            // A connection dropped in the middle is this client's alone.
            let caller = Caller::new(&[&server.url]);
            tokio::spawn(Pest { caller, session: session.clone(), random, sent: 0, answers: Vec::new() }.pester())
        });
        let mut pests = Vec::new();
        for client in clients.collect::<Vec<_>>() {
            pests.push(client.await.map_err(|panic| panic.to_string())??);
        }
        tally.trials += 1;
        tally.faults += pests.iter().map(|pest| pest.sent).sum::<usize>() - PERIODS;
        let rows = rows(&caller, &session).await?;
        tally.audit += one_answer_each(&pests, &rows);
        let patient = caller.open(&policy).await.ok_or("no session")?;
        if let Err(difference) = equals_replay(&caller, &session, rows, &patient).await {
            tally.complain(difference);
        }
    }
    tally.listen(&site);
    Ok(Some(tally))
}

struct Pest {
    caller: Caller,
    session: String,
    random: ChaCha8Rng,
    sent: usize,
    /// Period and acknowledgement.
    answers: Vec<(usize, Value)>,
}

impl Pest {
    /// Reports until every period is settled, by this client or another.
    async fn pester(mut self) -> Result<Pest, String> {
        let mut open: Vec<usize> = (1..=PERIODS).collect();
        while let Some(&next) = open.first() {
            let period = if self.random.random_bool(0.6) { next } else { self.random.random_range(1..=PERIODS) };
            match self.send(period).await {
                Some((200, answer)) => {
                    self.answers.push((period, answer));
                    open.retain(|&other| other != period);
                }
                Some((409, problem)) if problem["type"] == "/problems/report-conflict" => {
                    open.retain(|&other| other != period);
                }
                Some((409, problem)) if problem["type"] == "/problems/report-gap" => {}
                None | Some((503, _)) => {}
                Some((status, problem)) => return Err(format!("{status} {problem}")),
            }
        }
        Ok(self)
    }

    /// Sends a report, and hangs up on one in four before the answer may have come.
    async fn send(&mut self, period: usize) -> Option<(u16, Value)> {
        self.sent += 1;
        let content = if self.random.random_bool(0.9) { 0.001 } else { -0.002 };
        // Small enough that none is asked about.
        let log_return = content * (1 + period % 16) as f64;
        let report = json!({ "session": self.session, "period": period, "log_return": log_return });
        let patience = Duration::from_micros(self.random.random_range(0..8000));
        let sending = self.caller.post("/observe", &report);
        if self.random.random_bool(0.25) {
            tokio::time::timeout(patience, sending).await.ok().flatten()
        } else {
            sending.await
        }
    }
}

/// Each period has one content and one answer, whoever got it, and a row that says the same. A period of which every
/// client that reported its content hung up was acknowledged to nobody.
fn one_answer_each(pests: &[Pest], rows: &[Value]) -> Audit {
    let mut answers: BTreeMap<usize, &Value> = BTreeMap::new();
    let mut doubled = 0;
    for (period, answer) in pests.iter().flat_map(|pest| &pest.answers) {
        doubled += usize::from(*answers.entry(*period).or_insert(answer) != answer);
    }
    let kept =
        |(period, answer): &(&usize, &&Value)| rows.get(*period - 1).is_some_and(|row| says_the_same(row, answer));
    let lost = answers.iter().filter(|fact| !kept(fact)).count();
    Audit { acknowledged: answers.len(), lost, doubled }
}

/// The rows that the server has of a session.
async fn rows(caller: &Caller, name: &str) -> Result<Vec<Value>, String> {
    let rows = Session::opened(name.to_owned()).rows(caller).await;
    rows.map(|(rows, _)| rows).ok_or(format!("no rows of {name}"))
}

/// The stored returns, reported once each and in order, give the same rows and the same action, bit for bit.
async fn equals_replay(caller: &Caller, session: &str, stormed: Vec<Value>, patient: &str) -> Result<(), String> {
    for row in &stormed {
        let report = json!({ "session": patient, "period": row["period"], "log_return": row["log_return"] });
        caller
            .post("/observe", &report)
            .await
            .filter(|(status, _)| *status == 200)
            .ok_or("a replayed report failed")?;
    }
    let without_names = |mut rows: Vec<Value>| {
        let named = ["observed_ms", "session", "drift"];
        rows.iter_mut().for_each(|row| named.iter().for_each(|field| row[*field] = Value::Null));
        rows
    };
    let (stormed, replayed) = (without_names(stormed), without_names(rows(caller, patient).await?));
    if stormed.len() != PERIODS || stormed != replayed {
        return Err(format!("{} rows differ from their replay", stormed.len()));
    }
    let action = async |name: &str| {
        let (status, mut action) = caller.get(&format!("/action?session={name}")).await.ok_or("no action")?;
        action["session"] = Value::Null;
        Ok::<_, String>((status, action))
    };
    let (stormed, replayed) = (action(session).await?, action(patient).await?);
    if stormed == replayed { Ok(()) } else { Err(format!("{stormed:?} is not the replay's {replayed:?}")) }
}
