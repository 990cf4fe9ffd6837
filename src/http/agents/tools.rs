//! The tools: operations of the interface that read or advise, and their input schemas as the OpenAPI description has
//! them.

use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Map, Value, json};
use utoipa::openapi::OpenApi;

/// The places of schemas: in the description, and beside the input schema of a tool.
const COMPONENTS: &str = "#/components/schemas/";
const DEFINITIONS: &str = "#/$defs/";

/// The operation behind a tool.
struct ToolSource {
    name: &'static str,
    method: &'static str,
    path: &'static str,
    /// The type of the arguments, if they are the body.
    body: Option<&'static str>,
}

const fn reads(name: &'static str, path: &'static str) -> ToolSource {
    ToolSource { name, method: "get", path, body: None }
}

const fn asks(name: &'static str, path: &'static str, body: &'static str) -> ToolSource {
    ToolSource { name, method: "post", path, body: Some(body) }
}

/// All tools. Each operation needs the role `read`, so none of them changes anything.
///
/// Checked by: `every_tool_is_an_operation_of_readers`.
const SOURCES: [ToolSource; 16] = [
    asks("advise", "/advise", "Advise"),
    asks("advise_assets", "/advise", "AdviseAssets"),
    asks("plan", "/plan", "PlanQuestion"),
    asks("plan_assets", "/plan", "PlanQuestion_AssetsProblem"),
    asks("sleeve", "/sleeve", "SleeveQuestion"),
    asks("sleeve_assets", "/sleeve", "SleeveQuestion_AssetsProblem"),
    asks("read_returns", "/returns", "ReadReturns"),
    reads("list_policies", "/policies"),
    reads("get_policy", "/policies/{id}"),
    reads("list_sessions", "/sessions"),
    reads("get_session", "/sessions/{id}"),
    reads("session_history", "/sessions/{id}/history"),
    reads("action", "/action"),
    asks("what_if", "/what-if", "WhatIf"),
    asks("orders", "/orders", "OrdersQuestion"),
    asks("decide", "/decide", "Decide"),
];

/// A tool.
pub struct Tool {
    pub name: &'static str,
    pub method: &'static str,
    /// The path of its operation, with the parameters in braces.
    pub path: &'static str,
    /// The names of the parameters; `None` if the arguments are the body.
    pub parameters: Option<Vec<String>>,
}

/// The tools, and their list as it is sent.
pub struct Toolbox {
    tools: Vec<Tool>,
    pub listed: Box<RawValue>,
}

/// A tool as the list shows it.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct ListedTool {
    name: &'static str,
    description: String,
    input_schema: Value,
    annotations: Value,
}

impl Toolbox {
    pub fn new(description: &OpenApi) -> Self {
        let description = serde_json::to_value(description).unwrap_or_default();
        let (tools, listed): (Vec<Tool>, Vec<ListedTool>) =
            SOURCES.iter().map(|source| (source.tool(&description), source.listed(&description))).unzip();
        let listed = serde_json::value::to_raw_value(&listed).unwrap_or_default();
        Toolbox { tools, listed }
    }

    pub fn find(&self, name: &str) -> Option<&Tool> {
        self.tools.iter().find(|tool| tool.name == name)
    }

    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.tools.iter().map(|tool| tool.name)
    }
}

impl ToolSource {
    fn tool(&self, description: &Value) -> Tool {
        let names =
            || list(&self.operation(description)["parameters"]).map(|parameter| text(&parameter["name"]).into());
        let parameters = self.body.is_none().then(|| names().collect());
        Tool { name: self.name, method: self.method, path: self.path, parameters }
    }

    fn operation<'a>(&self, description: &'a Value) -> &'a Value {
        &description["paths"][self.path][self.method]
    }

    fn listed(&self, description: &Value) -> ListedTool {
        let (operation, schemas) = (self.operation(description), &description["components"]["schemas"]);
        let body = self.body.map_or(&Value::Null, |body| &schemas[body]);
        let parts = [&operation["summary"], &operation["description"], &body["description"]];
        let sentences: Vec<String> = parts.into_iter().filter_map(Value::as_str).map(flowing).collect();
        let mut input_schema = if body.is_null() { of_parameters(operation) } else { body.clone() };
        let definitions = definitions(&mut input_schema, schemas);
        if !definitions.is_empty() {
            input_schema["$defs"] = Value::Object(definitions);
        }
        ListedTool {
            name: self.name,
            description: sentences.join(" "),
            input_schema,
            annotations: json!({ "readOnlyHint": true, "openWorldHint": false }),
        }
    }
}

/// Returns the schema of an object with the parameters of an operation.
fn of_parameters(operation: &Value) -> Value {
    let mut properties = Map::new();
    for parameter in list(&operation["parameters"]) {
        let mut schema = parameter["schema"].clone();
        schema["description"] = parameter["description"].clone();
        properties.insert(text(&parameter["name"]).to_owned(), schema);
    }
    let required = list(&operation["parameters"]).filter(|parameter| parameter["required"] == true);
    let required: Vec<&Value> = required.map(|parameter| &parameter["name"]).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

/// Redirects the references of a schema to its own definitions, and returns these: all types that it leads to.
fn definitions(schema: &mut Value, schemas: &Value) -> Map<String, Value> {
    let (mut found, mut open) = (Map::new(), BTreeSet::new());
    redirect(schema, &mut open);
    while let Some(name) = open.pop_first() {
        if !found.contains_key(&name) {
            let mut definition = schemas[&name].clone();
            redirect(&mut definition, &mut open);
            found.insert(name, definition);
        }
    }
    found
}

fn redirect(schema: &mut Value, named: &mut BTreeSet<String>) {
    match schema {
        Value::Object(members) => {
            if let Some(Value::String(reference)) = members.get_mut("$ref")
                && let Some(name) = reference.strip_prefix(COMPONENTS)
            {
                named.insert(name.to_owned());
                *reference = format!("{DEFINITIONS}{name}");
            }
            members.values_mut().for_each(|member| redirect(member, named));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| redirect(item, named)),
        _ => {}
    }
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn flowing(words: &str) -> String {
    words.split_whitespace().collect::<Vec<&str>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::gate::access::{Access, access};
    use crate::http::router;
    use crate::store::KeyRole;

    #[test]
    fn every_tool_is_an_operation_of_readers() {
        let description = serde_json::to_value(router::description()).unwrap();
        for source in &SOURCES {
            assert!(source.operation(&description).is_object(), "{}", source.name);
            let needed = access(&source.method.to_uppercase(), Some(source.path));
            assert_eq!(needed, Access::Role(KeyRole::Read), "{}", source.name);
            let parameters = list(&source.operation(&description)["parameters"]);
            let (is_body, count) = (source.body.is_some(), parameters.count());
            assert!(is_body != (count > 0), "{}: its arguments are the body or the parameters", source.name);
        }
        let names: BTreeSet<&str> = SOURCES.iter().map(|source| source.name).collect();
        assert_eq!(names.len(), SOURCES.len());
    }

    #[test]
    fn every_schema_is_an_object_that_stands_alone() {
        let toolbox = Toolbox::new(&router::description());
        let listed: Vec<Value> = serde_json::from_str(toolbox.listed.get()).unwrap();
        assert_eq!(listed.len(), SOURCES.len());
        for tool in listed {
            let schema = &tool["inputSchema"];
            let defined = schema["$defs"].as_object().cloned().unwrap_or_default();
            for reference in schema.to_string().split("\"$ref\":\"").skip(1) {
                let name = reference.split('"').next().unwrap().strip_prefix(DEFINITIONS);
                assert!(name.is_some_and(|name| defined.get(name).is_some_and(Value::is_object)), "{reference}");
            }
            assert_eq!(schema["type"], "object", "{tool}");
            assert!(schema["properties"].as_object().is_some_and(|fields| !fields.is_empty()), "{tool}");
            // Programs that call models refuse schemas with alternatives at the top.
            assert!(["oneOf", "anyOf", "allOf"].iter().all(|keyword| schema[keyword].is_null()), "{tool}");
            assert!(tool["description"].as_str().is_some_and(|words| words.len() > 20), "{tool}");
        }
    }

    #[test]
    fn an_input_schema_is_the_one_of_the_description() {
        let (toolbox, description) = (Toolbox::new(&router::description()), router::description());
        let description = serde_json::to_value(description).unwrap();
        let listed: Vec<Value> = serde_json::from_str(toolbox.listed.get()).unwrap();
        let advise = listed.iter().find(|tool| tool["name"] == "advise").unwrap();
        let mut own = advise["inputSchema"].clone();
        own.as_object_mut().unwrap().remove("$defs");
        let described = &description["components"]["schemas"]["Advise"];
        assert_eq!(own.to_string().replace(DEFINITIONS, COMPONENTS), described.to_string());
        let problem = &advise["inputSchema"]["$defs"]["ProblemSpecification"]["properties"]["horizon"];
        assert_eq!(*problem, description["components"]["schemas"]["ProblemSpecification"]["properties"]["horizon"]);
    }
}
