//! A call of a tool: a request to its operation, made on behalf of the caller and answered by the router.

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::header::{AUTHORIZATION, CONTENT_LENGTH, CONTENT_TYPE, HOST};
use axum::http::{HeaderMap, Request, StatusCode};
use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use tower::ServiceExt;

use crate::control::error::FieldError;
use crate::http::agents::tools::Tool;
use crate::http::api_client::percent_encoded;
use crate::http::connection::exchanges::LocalAddress;
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::error::ServiceError;

/// Most bytes that a tool returns. A larger answer does not help a model, and is had from the operation itself.
const LARGEST_ANSWER: usize = 1 << 20;

/// The caller of a tool: what its request shows, and its connection.
pub struct ToolCaller {
    pub headers: HeaderMap,
    pub local: Option<LocalAddress>,
}

/// The JSON of an answer, and whether it is a problem document.
pub struct ToolAnswer {
    json: Box<RawValue>,
    is_error: bool,
}

/// The result of a call, as it is sent: the JSON as a value and as text.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ToolResult<'a> {
    content: [TextContent<'a>; 1],
    structured_content: &'a RawValue,
    is_error: bool,
}

#[derive(Serialize)]
struct TextContent<'a> {
    r#type: &'static str,
    text: &'a str,
}

impl ToolAnswer {
    /// Returns the answer as the result of a call.
    pub fn result(&self) -> ToolResult<'_> {
        let content = [TextContent { r#type: "text", text: self.json.get() }];
        ToolResult { content, structured_content: &self.json, is_error: self.is_error }
    }

    fn of_problem(problem: &ProblemDocument) -> Self {
        problem.count();
        ToolAnswer { json: serde_json::value::to_raw_value(problem).unwrap_or_default(), is_error: true }
    }
}

impl Tool {
    /// Calls the tool. A problem is an answer too, so that a model can read what to correct.
    pub async fn call(&self, operations: Router, arguments: Option<&RawValue>, caller: ToolCaller) -> ToolAnswer {
        let answered = async {
            let request = self.request(arguments, caller)?;
            let response = operations.oneshot(request).await.unwrap_or_else(|never| match never {});
            let is_error = response.status() != StatusCode::OK;
            let bytes = to_bytes(response.into_body(), LARGEST_ANSWER).await.map_err(|_| too_large())?;
            let text = String::from_utf8(bytes.into()).map_err(ServiceError::internal)?;
            let json = RawValue::from_string(text).map_err(ServiceError::internal)?;
            Ok::<_, ProblemDocument>(ToolAnswer { json, is_error })
        };
        answered.await.unwrap_or_else(|problem| ToolAnswer::of_problem(&problem))
    }

    fn request(&self, arguments: Option<&RawValue>, caller: ToolCaller) -> Result<Request<Body>, ProblemDocument> {
        let given = arguments.map_or("{}", RawValue::get);
        let (address, body) = match &self.parameters {
            None => (self.path.to_owned(), given.to_owned()),
            Some(names) => (self.address(names, given)?, String::new()),
        };
        let mut request = Request::builder().method(self.method.to_uppercase().as_str()).uri(address);
        for name in [HOST, AUTHORIZATION] {
            if let Some(value) = caller.headers.get(&name) {
                request = request.header(name, value);
            }
        }
        if self.parameters.is_none() {
            request = request.header(CONTENT_TYPE, "application/json").header(CONTENT_LENGTH, body.len());
        }
        let mut request = request.body(Body::from(body)).map_err(ServiceError::internal)?;
        if let Some(local) = caller.local {
            request.extensions_mut().insert(local);
        }
        Ok(request)
    }

    /// Returns the path with its parameters, and the others as a query.
    fn address(&self, names: &[String], given: &str) -> Result<String, ProblemDocument> {
        let wrong = |name: &str, value: String, rule: String| {
            ProblemDocument::of_field(ProblemKind::InvalidField, FieldError::new(name, value, rule))
        };
        let arguments: Map<String, Value> = serde_json::from_str(given)
            .map_err(|_| wrong("arguments", given.to_owned(), "must be an object".to_owned()))?;
        let (mut path, mut query) = (self.path.to_owned(), String::new());
        for (name, value) in &arguments {
            let text = match value {
                _ if !names.contains(name) => {
                    return Err(wrong(name, value.to_string(), format!("must be one of {}", names.join(", "))));
                }
                Value::Null => continue,
                Value::String(text) => text.clone(),
                Value::Bool(_) | Value::Number(_) => value.to_string(),
                Value::Array(_) | Value::Object(_) => {
                    return Err(wrong(name, value.to_string(), "must be a text, a number or a boolean".to_owned()));
                }
            };
            let place = format!("{{{name}}}");
            match path.contains(&place) {
                true if text.is_empty() => return Err(wrong(name, value.to_string(), "must not be empty".to_owned())),
                true => path = path.replace(&place, &percent_encoded(&text)),
                false => {
                    query.push(if query.is_empty() { '?' } else { '&' });
                    query.push_str(&format!("{name}={}", percent_encoded(&text)));
                }
            }
        }
        match names.iter().find(|name| path.contains(&format!("{{{name}}}"))) {
            Some(missing) => Err(wrong(missing, "null".to_owned(), "must be given".to_owned())),
            None => Ok(path + &query),
        }
    }
}

fn too_large() -> ProblemDocument {
    let detail = format!("the answer has more than {LARGEST_ANSWER} bytes, the most that a tool returns");
    let rule = "must ask for less, for example by a smaller limit";
    ProblemDocument::new(ProblemKind::InvalidField, detail).naming("arguments", Value::Null, rule)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(path: &'static str, arguments: &str) -> Result<String, String> {
        let mut names = Vec::from_iter(path.split('{').nth(1).map(|rest| rest.trim_end_matches('}').to_owned()));
        names.push("search".to_owned());
        let tool = Tool { name: "tool", method: "get", path, parameters: None };
        tool.address(&names, arguments).map_err(|problem| problem.field.map(String::from).unwrap_or_default())
    }

    #[test]
    fn arguments_stay_within_their_part_of_the_address() {
        let in_path = |text: &str| address("/sessions/{id}", &serde_json::json!({ "id": text }).to_string());
        assert_eq!(in_path("session_1").unwrap(), "/sessions/session_1");
        assert_eq!(in_path("../train?x=1#y").unwrap(), "/sessions/..%2Ftrain%3Fx%3D1%23y");
        assert_eq!(in_path("{search}").unwrap(), "/sessions/%7Bsearch%7D");
        assert_eq!(in_path("").unwrap_err(), "id");
        assert_eq!(address("/sessions/{id}", "{}").unwrap_err(), "id");
        let listed = address("/sessions", r#"{"search": "a&b=\u00e9"}"#);
        assert_eq!(listed.unwrap(), "/sessions?search=a%26b%3D%C3%A9");
        assert_eq!(address("/sessions", r#"{"search": null}"#).unwrap(), "/sessions");
        assert_eq!(address("/sessions", r#"{"colour": 1}"#).unwrap_err(), "colour");
        assert_eq!(address("/sessions", r#"{"search": [1]}"#).unwrap_err(), "search");
        assert_eq!(address("/sessions", "[]").unwrap_err(), "arguments");
    }
}
