// Sessions: the investors who live by a policy.

import { list, post } from "./api.js";
import { h, section, table } from "./dom.js";
import { fieldset, input, select, showProblem } from "./form.js";
import { count, moment, short, wealth } from "./format.js";

export async function view(query, leaving) {
  const [sessions, policies] = await Promise.all([
    list("/sessions", "sessions", leaving),
    list("/policies", "policies", leaving),
  ]);
  const asked = new URLSearchParams(query ?? "").get("policy");
  const body = [];
  if (sessions.entries.length > 0) body.push(listed(sessions.entries));
  else
    body.push(
      h(
        "p",
        { class: "lead" },
        "No session yet. A session is one investor who lives by a policy: report each return as it comes, and read what to hold next.",
      ),
    );
  if (policies.entries.length > 0) body.push(opening(policies.entries, asked));
  else body.push(h("p", {}, "A session needs a policy first. ", h("a", { href: "#/train" }, "Train one"), "."));
  return { title: "Sessions", body };
}

function listed(entries) {
  return table(
    "Sessions, newest first",
    [
      {
        name: "Session",
        cell: ({ session }) => h("a", { href: `#/sessions/${session}` }, h("code", {}, short(session))),
      },
      { name: "State", cell: ({ state }) => h("span", { class: `state ${state}` }, state) },
      { name: "Observed", numeric: true, cell: ({ period, horizon }) => `${count(period - 1)} of ${count(horizon)}` },
      { name: "Initial wealth", numeric: true, cell: ({ initial_wealth }) => wealth(initial_wealth) },
      { name: "Policy", cell: ({ policy }) => h("a", { href: `#/policies/${policy}` }, h("code", {}, short(policy))) },
      { name: "Opened", cell: ({ created_ms }) => moment(created_ms) },
    ],
    entries,
  );
}

function opening(policies, asked) {
  const choices = Object.fromEntries(
    policies.map(({ policy, created_ms }) => [policy, `${short(policy)}, stored ${moment(created_ms)}`]),
  );
  const policy = select({ name: "policy", label: "Policy", choices });
  if (asked in choices) policy.control.value = asked;
  const stake = input({ name: "wealth", label: "Wealth", note: "Blank: the policy\u2019s initial wealth." });
  const history = input({
    name: "history",
    label: "Log-returns known",
    note: "Blank: the policy\u2019s own history. As fractions, oldest first.",
    inputmode: "text",
  });
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const form = h(
    "form",
    { novalidate: true },
    fieldset("Whose session", [policy, stake, history]),
    message,
    h("p", { class: "send" }, h("button", { type: "submit" }, "Open")),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const request = { policy: policy.control.value };
    const words = history.control.value.split(/[\s,;]+/).filter((word) => word !== "");
    if (words.length > 0) request.history = words.map(read);
    if (stake.control.value.trim() !== "") request.wealth = read(stake.control.value);
    try {
      const { session } = await post("/sessions", request);
      location.hash = `#/sessions/${session}`;
    } catch (error) {
      showProblem(form, message, error);
    }
  });
  return section("Open a session", form);
}

/** What is no number is sent as it is: the service says what is wrong with it. */
const read = (text) => (Number.isNaN(Number(text)) ? text : Number(text));
