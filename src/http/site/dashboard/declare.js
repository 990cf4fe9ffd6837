// A problem of the user's own, declared in formulas as JSON, to be trained.

import { get, post } from "./api.js";
import { announce, h } from "./dom.js";
import { draft } from "./draft.js";
import { area, fieldset, input, refusal, sending } from "./form.js";
import { policyLink } from "./naming.js";
import { meant } from "./specification.js";
import { compact } from "./train.js";

/** The declaration that the form starts with, as the guide has it. */
const EXAMPLE = `{
  "problem": {
    "states": { "stock": { "start": 4, "low": 0, "high": 60 } },
    "actions": { "order": { "low": "0", "high": "capacity - stock" } },
    "noise": { "name": "demand", "low": 0, "high": 40 },
    "parameters": { "price": 9, "cost": 5, "holding": 0.5, "salvage": 3, "capacity": 60 },
    "next": { "stock": "max(stock + order - demand, 0)" },
    "reward": "price*min(stock + order, demand) - cost*order - holding*max(stock + order - demand, 0)",
    "end": "salvage*stock",
    "horizon": 12,
    "history": [9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7],
    "radius": { "rule": "bridge", "alpha": 0.1, "scale": 0.3 }
  },
  "design": { "count": 100 }
}`;

/** `query`: `from=POLICY` fills the form with the declaration that trained the policy. */
export async function view(query, leaving) {
  const origin = new URLSearchParams(query ?? "").get("from");
  const drafts = draft(`#/declare?${query ?? ""}`);
  const kept = drafts.read();
  const keep = () => drafts.keep({ text: text.control.value, name: name.control.value });
  const name = input({ name: "name", label: "Name", note: "May be blank.", inputmode: "text", value: kept?.name, changed: keep });
  const initial = origin ? flat(compact((await get(`/policies/${origin}`, leaving)).specification)) : EXAMPLE;
  const text = area({ name: "problem", label: "Declaration, as JSON", rows: 20, value: kept?.text ?? initial, changed: keep });
  text.control.classList.remove("prose");
  text.control.spellcheck = false;
  const send = h("button", { type: "submit" }, "Train");
  const note = h("span", { class: "note" }, "Trains in the background; the job list shows the progress. What you type here is kept while this tab is open.");
  const form = h("form", { novalidate: true }, h("fieldset", {}, h("legend", {}, "The problem"), text.element), fieldset("Labels", [name]), refusal(), h("p", { class: "send" }, send, note));
  sending(form, send, async () => {
    const called = name.control.value.trim();
    const request = { ...declaration(text.control.value), ...(called && { name: called }) };
    const { job, warnings } = await post("/train", request);
    announce(`Training ${job} is queued.`);
    meant(form, { noun: "training", job, warnings, problem: request.problem }, () => {
      drafts.drop();
      location.hash = "#/jobs";
    });
  }, { otherwise: text.control });
  const lead = h("p", { class: "lead" }, "State what can be decided, what is not known and what it earns, in formulas. ", h("a", { href: "/guide/declared" }, "The guide"), " says how.");
  const trail = h("p", { class: "trail" }, origin ? ["Like ", policyLink(origin)] : h("a", { href: "#/jobs" }, "Jobs"));
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  return { title: "Declare a problem", trail, body: [lead, kept ? drafts.note(again) : "", form] };
}

/** Puts each innermost object of a JSON text on one line. */
const flat = (json) => json.replace(/\{\s*([^{}[\]]*?)\s*\}/g, (_, inside) => `{ ${inside.replace(/\n\s*/g, " ")} }`);

/** Parses a declaration; throws what the browser says of its first error. */
function declaration(text) {
  try {
    return JSON.parse(text);
  } catch (error) {
    throw { field: "problem", message: `This is no JSON: ${error.message}.` };
  }
}
