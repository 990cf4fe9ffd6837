//! Reports of periods: one report, or a list of reports for many sessions.

use std::fmt;
use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::json;
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, LiveCalls};
use crate::http::gate::extract::JsonBytes;
use crate::http::gate::{bodies, decode, telemetry};
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::entries::answer::ObservationAnswer;
use crate::service::entries::report::Observe;
use crate::service::entries::reports::{self, REPORTS, Reported};
use crate::service::process::memory::Large;

/// Most bytes of the answer to a report: a constant, and a factor for each byte of the request, because the answer
/// repeats asset names in at most four fields.
const ANSWER_BYTES: usize = 2048;
const ANSWERED_A_BYTE: usize = 8;

/// One report, or a list of reports, each for another session.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum Reports {
    One(Box<Observe>),
    Many(Vec<Observe>),
}

impl<'de> Deserialize<'de> for Reports {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrMany)
    }
}

/// Decides by the first byte which of the two it is, so that an error names the field at its position.
struct OneOrMany;

impl<'de> Visitor<'de> for OneOrMany {
    type Value = Reports;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a report, or a list of reports")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Reports, A::Error> {
        Observe::deserialize(MapAccessDeserializer::new(map)).map(Box::new).map(Reports::One)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Reports, A::Error> {
        let mut reports = Vec::new();
        while let Some(report) = elements.next_element()? {
            if reports.len() == *REPORTS.end() {
                return Err(A::Error::custom(reports::too_many()));
            }
            reports.push(report);
        }
        Ok(Reports::Many(reports))
    }
}

/// The answer to one report, or the answers to a list in its order.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "answers are sent as they are stored; this type only describes them")]
pub enum ReportsAnswered {
    One(ObservationAnswer),
    Many(Vec<ElementAnswered>),
}

/// The answer to one element of a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct ElementAnswered {
    pub session: String,
    pub period: usize,
    /// HTTP status that a call with this report alone would get.
    #[schema(example = 200)]
    pub status: u16,
    /// The answer, if the status is 200.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<ObservationAnswer>,
    /// The problem, if the status is not 200.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<ProblemDocument>,
}

/// Records the return of a period, or of one period of each of up to 1000 sessions. Each is recorded exactly once, and
/// is durable before it is answered.
#[utoipa::path(post, path = "/observe", tag = "sessions",
    request_body(content = Reports, example = json!({
        "session": "session_0123456789abcdef0123456789abcdef", "period": 1, "simple_return": 0.012, "executed_allocation": 0.3
    })),
    responses(
        (status = 200, description = "Recorded. Repeating the period with the same content returns the same answer. A list gets one answer for each element, with a status of its own.", body = ReportsAnswered),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The period was reported with other content, is not the next, or is past the horizon; or the report is probably a mistake and is not confirmed.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule, or a list names a session twice.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn observe(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let length = body.length();
    match body.decoded(decode::json).await? {
        Reports::One(report) => {
            bodies::recorded(&service, service.sessions.report(&caller, *report, &caller.turn).await?).await
        }
        Reports::Many(reports) => {
            let room = service.room_for(reports.len() * ANSWER_BYTES + ANSWERED_A_BYTE * length).await?;
            let reported = service.sessions.report_all(&caller, reports).await?;
            let elements: Vec<String> =
                reported.into_iter().map(|element| answered(element, caller.tenant.as_str())).collect();
            Ok(bodies::sent(Large { value: format!("[{}]", elements.join(",")).into_bytes(), room }))
        }
    }
}

/// Formats the answer for one element, around the answer as it is stored.
fn answered(Reported { session, period, outcome }: Reported, tenant: &str) -> String {
    let session = json!(session);
    match outcome.map_err(ProblemDocument::from) {
        Ok(answer) => format!(r#"{{"session":{session},"period":{period},"status":200,"answer":{answer}}}"#),
        Err(problem) => {
            problem.count();
            telemetry::count_refusal(problem.status, tenant);
            let (status, problem) = (problem.status, json!(problem));
            format!(r#"{{"session":{session},"period":{period},"status":{status},"problem":{problem}}}"#)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::gate::decode;

    fn refused(body: &str) -> (String, String) {
        let problem = decode::json::<Reports>(body.as_bytes()).unwrap_err();
        (problem.field.unwrap().into(), problem.rule.unwrap().into())
    }

    #[test]
    fn what_is_wrong_in_a_list_is_named_with_its_place() {
        let good = r#"{"session": "a", "period": 1, "log_return": 0.1}"#;
        assert!(matches!(decode::json::<Reports>(good.as_bytes()), Ok(Reports::One(_))));
        let list = format!("[{good}, {}]", good.replace("1,", "1.0,"));
        assert!(matches!(decode::json(list.as_bytes()), Ok(Reports::Many(reports)) if reports.len() == 2));
        assert_eq!(refused(r#"{"session": "a", "period": "x"}"#).0, "period");
        assert_eq!(refused(&format!(r#"[{good}, {{"session": "a", "period": "x"}}]"#)).0, "[1].period");
        assert_eq!(refused(&format!(r#"[{good}, {{"session": "a", "perod": 1}}]"#)).0, "[1].perod");
        assert_eq!(refused(&format!(r#"[{good}, {{"session": "a"}}]"#)), ("[1].period".into(), "must be given".into()));
        let (field, rule) = refused("7");
        assert!(field == "body" && rule.contains("a report, or a list of reports"), "{field}: {rule}");
        let long = format!("[{}]", vec![good; REPORTS.end() + 1].join(","));
        assert_eq!(refused(&long), ("body".into(), "must hold 1 to 1000 reports".into()));
    }
}
