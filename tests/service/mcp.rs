//! The Model Context Protocol: what agents may ask for, and that they change nothing.

use crate::decide::stock;
use crate::support::{App, specification};
use reqwest::header::{ALLOW, CONTENT_TYPE};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};

const PAGE: &str = include_str!("../../docs/agents.md");

/// The revision without a handshake.
const STATELESS: &str = "2026-07-28";
const TOOLS: [&str; 16] = [
    "advise",
    "advise_assets",
    "plan",
    "plan_assets",
    "sleeve",
    "sleeve_assets",
    "read_returns",
    "list_policies",
    "get_policy",
    "list_sessions",
    "get_session",
    "session_history",
    "action",
    "what_if",
    "orders",
    "decide",
];

/// Reads an answer, whose errors are problem documents only if they are not those of JSON-RPC.
async fn answered(response: Response) -> (StatusCode, Value) {
    let (status, text) = (response.status(), response.text().await.unwrap());
    (status, if text.is_empty() { Value::Null } else { serde_json::from_str(&text).unwrap() })
}

async fn send(app: &App, message: &Value) -> (StatusCode, Value) {
    answered(app.client.post(format!("{}/mcp", app.url)).json(message).send().await.unwrap()).await
}

/// Sends a request of a client that began with a handshake, and returns its result.
async fn result(app: &App, method: &str, params: Value) -> Value {
    let message = json!({ "jsonrpc": "2.0", "id": "a", "method": method, "params": params });
    let (status, mut answer) = send(app, &message).await;
    assert_eq!((status, &answer["jsonrpc"], &answer["id"]), (StatusCode::OK, &json!("2.0"), &json!("a")), "{answer}");
    answer["result"].take()
}

/// Calls a tool, and returns whether it failed and its JSON, which is the same as a value and as text.
async fn call(app: &App, name: &str, arguments: Value) -> (bool, Value) {
    let result = result(app, "tools/call", json!({ "name": name, "arguments": arguments })).await;
    let content = &result["content"];
    assert_eq!((content.as_array().unwrap().len(), &content[0]["type"]), (1, &json!("text")), "{result}");
    let text: Value = serde_json::from_str(content[0]["text"].as_str().unwrap()).unwrap();
    assert_eq!(text, result["structuredContent"], "{name}");
    (result["isError"].as_bool().unwrap(), text)
}

/// A request of the revision without a handshake, with the headers that it demands.
async fn stateless(app: &App, method: &str, mut params: Value) -> (StatusCode, Value) {
    params["_meta"] = json!({
        "io.modelcontextprotocol/protocolVersion": STATELESS,
        "io.modelcontextprotocol/clientCapabilities": {},
    });
    let mut request = app.client.post(format!("{}/mcp", app.url)).header("MCP-Protocol-Version", STATELESS);
    request = request.header("Mcp-Method", method);
    if let Some(name) = params["name"].as_str() {
        request = request.header("Mcp-Name", name);
    }
    let message = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params });
    answered(request.json(&message).send().await.unwrap()).await
}

/// A service with a policy, a session of two periods and the policy of a declared problem.
async fn filled() -> (App, String) {
    let mut app = App::start().await;
    app.train(&stock(3)).await;
    let declared = app.policy.clone();
    app.train(&specification(5)).await;
    app.open().await;
    for period in 1..=2 {
        assert_eq!(app.observe(period, 0.01).await.0, 200);
    }
    (app, declared)
}

/// Every tool with valid arguments, and the call of the interface that it stands for.
fn calls(app: &App, declared: &str) -> Vec<(&'static str, Value, Method, String)> {
    let (policy, session) = (&app.policy, &app.session);
    let several = &crate::support::several_assets(1)["problem"];
    let one = json!({ "problem": { "history": [0.012, -0.034, 0.021, 0.008], "rate_per_step": 0.001 } });
    let get = |path: &str| (Method::GET, path.to_owned());
    let post = |path: &str| (Method::POST, path.to_owned());
    let call = |name, arguments, (method, path)| (name, arguments, method, path);
    vec![
        call("advise", one.clone(), post("/advise")),
        call("advise_assets", json!({ "problem": several }), post("/advise")),
        call("plan", json!({ "problem": one["problem"], "paths": 200 }), post("/plan")),
        call("plan_assets", json!({ "problem": several, "paths": 200 }), post("/plan")),
        call("sleeve", one.clone(), post("/sleeve")),
        call("sleeve_assets", json!({ "problem": several }), post("/sleeve")),
        call(
            "read_returns",
            json!({ "text": "month,fund\n2020-01,1.2\n2020-02,-3.4\n2020-03,2.1\n" }),
            post("/returns"),
        ),
        call("list_policies", json!({ "limit": 1 }), get("/policies?limit=1")),
        call("get_policy", json!({ "id": policy }), get(&format!("/policies/{policy}"))),
        call("list_sessions", json!({ "count": "total" }), get("/sessions?count=total")),
        call("get_session", json!({ "id": session }), get(&format!("/sessions/{session}"))),
        call("session_history", json!({ "id": session }), get(&format!("/sessions/{session}/history"))),
        call(
            "action",
            json!({ "session": session, "sensitivity": false }),
            get(&format!("/action?session={session}&sensitivity=false")),
        ),
        call("what_if", json!({ "session": session, "wealth": 50.0 }), post("/what-if")),
        call(
            "orders",
            json!({ "session": session, "prices": { "asset": 10.0 }, "units": { "asset": 3.0 }, "cash": 70.0 }),
            post("/orders"),
        ),
        call("decide", json!({ "policy": declared }), post("/decide")),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_tool_answers_as_its_operation_does_and_changes_nothing() {
    let (app, declared) = filled().await;
    let calls = calls(&app, &declared);
    assert_eq!(calls.iter().map(|(name, ..)| *name).collect::<Vec<_>>(), TOOLS);
    let mut before = Vec::new();
    for (_, arguments, method, path) in &calls {
        let (status, answer) = app.send(method.clone(), path, (method == Method::POST).then_some(arguments)).await;
        assert_eq!(status, StatusCode::OK, "{path}: {answer}");
        before.push(answer);
    }
    for ((name, arguments, ..), expected) in calls.iter().zip(&before) {
        assert_eq!(call(&app, name, arguments.clone()).await, (false, expected.clone()), "{name}");
    }
    // The last tools saw what the first calls of the interface saw.
    for ((name, arguments, method, path), expected) in calls.iter().zip(&before) {
        let (_, answer) = app.send(method.clone(), path, (method == Method::POST).then_some(arguments)).await;
        assert_eq!(&answer, expected, "{name}");
    }
}

#[tokio::test]
async fn a_client_shakes_hands_and_lists_the_tools() {
    let app = App::start().await;
    for (offered, agreed) in [("2025-06-18", "2025-06-18"), ("2025-11-25", "2025-11-25"), ("1999-01-01", "2025-11-25")]
    {
        let params =
            json!({ "protocolVersion": offered, "capabilities": {}, "clientInfo": { "name": "test", "version": "1" } });
        let result = result(&app, "initialize", params).await;
        assert_eq!((&result["protocolVersion"], &result["serverInfo"]["name"]), (&json!(agreed), &json!("ballast")));
        assert!(result["capabilities"]["tools"].is_object() && result["instructions"].is_string(), "{result}");
    }
    let (status, nothing) = send(&app, &json!({ "jsonrpc": "2.0", "method": "notifications/initialized" })).await;
    assert_eq!((status, nothing), (StatusCode::ACCEPTED, Value::Null));
    assert_eq!(result(&app, "ping", json!({})).await, json!({}));
    let listed = result(&app, "tools/list", json!({})).await;
    assert_eq!(listed.as_object().unwrap().len(), 1, "no member that an older client does not know");
    let names: Vec<&str> =
        listed["tools"].as_array().unwrap().iter().map(|tool| tool["name"].as_str().unwrap()).collect();
    assert_eq!(names, TOOLS);
    assert!(TOOLS.iter().all(|tool| PAGE.contains(&format!("`{tool}`"))), "docs/agents.md names every tool");
    for tool in listed["tools"].as_array().unwrap() {
        assert_eq!(tool["annotations"]["readOnlyHint"], true, "{tool}");
    }
    println!("tools/list: {} bytes", listed.to_string().len());
}

#[tokio::test]
async fn a_client_of_the_newest_revision_needs_no_handshake() {
    let app = App::start().await;
    let (status, answer) = stateless(&app, "server/discover", json!({})).await;
    let result = &answer["result"];
    assert_eq!((status, &result["supportedVersions"][0]), (StatusCode::OK, &json!(STATELESS)), "{answer}");
    let (_, answer) = stateless(&app, "tools/list", json!({})).await;
    let result = &answer["result"];
    assert_eq!((&result["resultType"], &result["cacheScope"]), (&json!("complete"), &json!("public")), "{answer}");
    assert_eq!(result["tools"].as_array().unwrap().len(), TOOLS.len());
    let (_, answer) = stateless(&app, "tools/call", json!({ "name": "list_policies" })).await;
    assert_eq!(answer["result"]["structuredContent"]["policies"], json!([]), "{answer}");
    let (status, answer) = stateless(&app, "no/such", json!({})).await;
    assert_eq!((status, &answer["error"]["code"]), (StatusCode::NOT_FOUND, &json!(-32601)), "{answer}");
    let (status, answer) = stateless(&app, "tools/call", json!({ "name": "train" })).await;
    assert_eq!((status, &answer["error"]["code"]), (StatusCode::BAD_REQUEST, &json!(-32602)), "{answer}");
    let request = app.client.post(format!("{}/mcp", app.url)).header("MCP-Protocol-Version", "2199-01-01");
    let request = request.json(&json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/list" }));
    let (status, answer) = answered(request.send().await.unwrap()).await;
    assert_eq!((status, &answer["error"]["code"]), (StatusCode::BAD_REQUEST, &json!(-32022)), "{answer}");
    assert_eq!(answer["error"]["data"]["supported"][0], STATELESS);
}

#[tokio::test]
async fn what_is_wrong_is_named() {
    let app = App::start().await;
    // A problem of the operation is the answer of the tool, for the model to read.
    let problem = json!({ "history": [0.01, -0.02, 0.03], "rate_per_step": 0.001, "colour": 1 });
    let (is_error, problem) = call(&app, "advise", json!({ "problem": problem })).await;
    assert_eq!((is_error, &problem["field"]), (true, &json!("problem.colour")), "{problem}");
    for (name, arguments, field) in [
        ("advise", json!({}), "problem"),
        ("list_policies", json!({ "limit": 0 }), "limit"),
        ("list_policies", json!({ "colour": 1 }), "colour"),
        ("get_session", json!({}), "id"),
        ("get_session", json!({ "id": ["a"] }), "id"),
        ("action", json!({}), "session"),
        ("decide", json!([]), "body"),
        ("get_policy", json!([]), "arguments"),
    ] {
        let (is_error, problem) = call(&app, name, arguments).await;
        assert_eq!((is_error, &problem["field"]), (true, &json!(field)), "{name}: {problem}");
    }
    let (is_error, problem) = call(&app, "get_session", json!({ "id": "../../train" })).await;
    assert_eq!((is_error, &problem["status"]), (true, &json!(404)), "{problem}");
    for (code, method, params) in [
        (-32601, "no/such", json!({})),
        (-32601, "server/discover", json!({})),
        (-32602, "tools/call", json!({})),
        (-32602, "tools/call", json!({ "name": "no_such" })),
    ] {
        let (status, answer) =
            send(&app, &json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params })).await;
        assert_eq!((status, &answer["error"]["code"]), (StatusCode::OK, &json!(code)), "{method}: {answer}");
    }
    for body in [
        json!({ "id": 1, "method": "ping" }),
        json!({ "jsonrpc": "2.0", "id": null, "method": "ping" }),
        json!([{ "jsonrpc": "2.0", "id": 1, "method": "ping" }, { "jsonrpc": "2.0", "id": 2, "method": "ping" }]),
        json!([]),
        json!("ping"),
    ] {
        let (status, answer) = send(&app, &body).await;
        assert_eq!((status, &answer["error"]["code"]), (StatusCode::BAD_REQUEST, &json!(-32600)), "{body}: {answer}");
    }
    let post = |media: &'static str, body: &'static str| {
        app.client.post(format!("{}/mcp", app.url)).header(CONTENT_TYPE, media).body(body).send()
    };
    let (status, answer) = answered(post("application/json", "{").await.unwrap()).await;
    assert_eq!((status.as_u16(), &answer["error"]["code"]), (400, &json!(-32700)), "{answer}");
    let (status, problem) = answered(post("text/plain", "{}").await.unwrap()).await;
    assert_eq!((status.as_u16(), &problem["field"]), (415, &json!("content-type")), "{problem}");
    let answer = app.client.get(format!("{}/mcp", app.url)).send().await.unwrap();
    assert_eq!((answer.status().as_u16(), answer.headers()[ALLOW].to_str().unwrap()), (405, "POST"));
}

#[tokio::test]
async fn no_tool_has_the_name_of_an_operation_that_changes_something() {
    let app = App::start().await;
    for name in [
        "train",
        "evaluate",
        "backtest",
        "frontier",
        "observe",
        "open",
        "correct",
        "renew",
        "delete",
        "cancel",
        "import",
        "of_session",
        "of_policy",
        "POST /train",
        "/observe",
        "",
    ] {
        let message = json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": { "name": name } });
        let (_, answer) = send(&app, &message).await;
        assert_eq!((&answer["error"]["code"], &answer["result"]), (&json!(-32602), &Value::Null), "{name}: {answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tool_has_the_rights_of_the_callers_key() {
    let (mut app, _) = filled().await;
    let session = app.session.clone();
    let (reader, trainer) = (app.key("default", "read").await, app.key("default", "train,operate").await);
    let stranger = app.key("south", "read").await;
    app.enter(&stranger).await;
    let (is_error, problem) = call(&app, "get_session", json!({ "id": session })).await;
    assert_eq!((is_error, &problem["status"]), (true, &json!(404)), "another tenant: {problem}");
    assert_eq!(call(&app, "list_sessions", json!({})).await.1["sessions"], json!([]));
    app.hold(&reader);
    assert_eq!(call(&app, "get_session", json!({ "id": session })).await.1["session"], session);
    app.hold(&trainer);
    let ping = json!({ "jsonrpc": "2.0", "id": 1, "method": "ping" });
    let (status, problem) = send(&app, &ping).await;
    assert_eq!((status.as_u16(), &problem["type"]), (403, &json!("/problems/forbidden")), "{problem}");
    app.hold("");
    assert_eq!(send(&app, &ping).await.0, StatusCode::UNAUTHORIZED);
}

#[tokio::test]
async fn a_page_of_another_origin_is_not_answered() {
    let app = App::start().await;
    let ping = json!({ "jsonrpc": "2.0", "id": 1, "method": "ping" });
    for (origin, expected) in [("https://evil.example", 403), ("null", 403), (app.url.as_str(), 200)] {
        let request = app.client.post(format!("{}/mcp", app.url)).header("Origin", origin).json(&ping);
        assert_eq!(request.send().await.unwrap().status().as_u16(), expected, "{origin}");
    }
}

#[tokio::test]
async fn the_pages_of_the_guide_are_resources() {
    let app = App::start().await;
    let listed = result(&app, "resources/list", json!({})).await;
    let pages = listed["resources"].as_array().unwrap();
    assert!(pages.len() >= 20, "{listed}");
    for page in pages {
        let read = result(&app, "resources/read", json!({ "uri": page["uri"] })).await;
        let (content, name) = (&read["contents"][0], page["name"].as_str().unwrap());
        let served = app.client.get(format!("{}/guide/{name}.md", app.url)).send().await.unwrap().text().await.unwrap();
        assert_eq!((&content["uri"], content["text"].as_str()), (&page["uri"], Some(served.as_str())), "{name}");
    }
    assert_eq!(result(&app, "resources/templates/list", json!({})).await["resourceTemplates"], json!([]));
    let message =
        json!({ "jsonrpc": "2.0", "id": 1, "method": "resources/read", "params": { "uri": "file:///etc/passwd" } });
    assert_eq!(send(&app, &message).await.1["error"]["code"], -32602);
}

/// A rate limit holds for tools as for their operations.
#[tokio::test]
async fn tools_are_limited_as_their_operations_are() {
    let app = App::configured(|config| config.limits.rates = [0, 1, 0]).await;
    let arguments = json!({ "problem": { "history": [0.012, -0.034, 0.021, 0.008], "rate_per_step": 0.001 } });
    let mut refused = 0;
    for _ in 0..20 {
        let (is_error, answer) = call(&app, "advise", arguments.clone()).await;
        if is_error {
            assert_eq!(answer["status"], 429, "{answer}");
            refused += 1;
        }
    }
    assert!(refused > 0);
}

/// An answer above a megabyte is refused in words; a list is then asked for in smaller parts.
#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_no_model_reads_is_refused() {
    let mut app = App::start().await;
    let mut long = specification(1);
    let returns: Vec<f64> = (0..60_000).map(|k| 0.004 + 0.02 * (1.7 * f64::from(k)).sin()).collect();
    long["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    long["problem"]["history"] = json!(returns[..4000]);
    app.train(&long).await;
    let (is_error, detail) = call(&app, "get_policy", json!({ "id": app.policy })).await;
    assert!(!is_error && detail.to_string().len() > 64 << 10, "{}", detail.to_string().len());
    let text = returns.iter().map(|back| format!("{back:.12}\n")).collect::<String>();
    let choices = json!({ "kind": "simple", "unit": "fraction", "unusual": true });
    let (is_error, problem) = call(&app, "read_returns", json!({ "text": text, "choices": choices })).await;
    assert!(is_error, "{}", &problem.to_string()[..200.min(problem.to_string().len())]);
    assert!(problem["detail"].as_str().unwrap().contains("1048576 bytes"), "{problem}");
}
