// Renewals: sessions go on with another policy from their coming periods. It already exists, or is trained on the
// returns seen.

import { get, post, trained } from "./api.js";
import { statesWords } from "./declared_policy.js";
import { announce, h, table } from "./dom.js";
import { fieldset, refusal, select, sending } from "./form.js";
import { count, counted, dateText } from "./format.js";
import { inCurrency } from "./money.js";
import { called, headed } from "./naming.js";
import { all } from "./pages.js";
import { standing } from "./flows.js";
import { policyChoices } from "./session_opening.js";
import { requestOf } from "./train.js";

/** The choice to retrain the policy of each session. */
const ANEW = "anew";
/** Most letters of a name that the service accepts. */
const LONGEST_NAME = 100;

/** `query`: `sessions=A,B`. */
export async function view(query, leaving) {
  const ids = (new URLSearchParams(query ?? "").get("sessions") ?? "").split(",").filter(Boolean);
  const trail = h("p", { class: "trail" }, h("a", { href: "#/sessions" }, "Overview"));
  const title = "Continue with another policy";
  if (ids.length === 0) return { title, trail, body: h("p", {}, "Tick the sessions in the ", h("a", { href: "#/sessions" }, "overview"), " first.") };
  const [policies, sessions] = await Promise.all([all("/policies", "policies", leaving), Promise.all(ids.map((id) => get(`/sessions/${id}`, leaving)))]);
  return { title, trail, body: renewing(sessions, policies, leaving) };
}

/** Returns the name of a policy that is retrained from another. */
function renewedName(name, now) {
  const month = dateText(now, { month: "short", year: "numeric" });
  const stem = name.split(" (renewed ")[0];
  const when = `renewed ${month}`;
  return stem === "" ? `R${when.slice(1)}` : `${[...stem].slice(0, LONGEST_NAME - when.length - 3).join("")} (${when})`;
}

/** Returns the request to retrain a session's policy on all returns it has seen, at its current wealth if the policy depends on wealth. */
export function anew(session, history, { specification, name }, now) {
  const request = requestOf(specification);
  const { problem, design } = request;
  problem.history = history.record;
  const rates = history.observations.map((row) => standing(row).rate).filter((rate) => rate !== null && rate !== undefined);
  problem.rate_per_step = rates.at(-1) ?? problem.rate_per_step;
  const flows = [problem.contributions ?? 0].flat();
  if (problem.utility.kind === "exponential" || flows.some((amount) => amount !== 0)) {
    const factor = session.wealth / problem.initial_wealth;
    problem.initial_wealth = session.wealth;
    if (design.wealth) design.wealth = { min: design.wealth.min * factor, max: design.wealth.max * factor };
  }
  return { ...request, name: renewedName(name ?? "", now), tags: ["renewed"] };
}

/** Returns the request to retrain the policy of a declared problem's session on all it has seen, from its current states. */
function anewDeclared(session, history, { specification, name }, now) {
  const request = structuredClone(specification);
  request.problem.history = [...history.history, ...history.observations.map(({ now }) => now.noise).filter((noise) => noise !== null)];
  for (const [name, state] of Object.entries(request.problem.states)) state.start = session.states[name];
  return { ...request, name: renewedName(name ?? "", now), tags: ["renewed"] };
}

function renewing(sessions, policies, leaving) {
  const choice = select({
    name: "policy",
    label: "Continue with",
    note: "A retrained policy differs only in its record: it includes every return seen so far.",
    choices: [["", "Choose one"], [ANEW, "The same policy, retrained on the returns seen"], ...policyChoices(policies)],
  });
  choice.element.classList.add("broad");
  const outcomes = new Map(sessions.map(({ session }) => [session, h("span", { class: "under" })]));
  const policyName = (id) => called(id, policies.find(({ policy }) => policy === id)?.name);
  const rows = table("Sessions that continue", [
    { name: "Session", cell: ({ session, name }) => h("div", { class: "said" }, headed(`#/sessions/${session}`, session, name), outcomes.get(session)) },
    { name: "Policy now", cell: ({ policy }) => h("a", { href: `#/policies/${policy}` }, policyName(policy)) },
    { name: "Periods", numeric: true, cell: ({ period, horizon, rolling }) => (rolling ? count(period - 1) : `${count(period - 1)} of ${count(horizon)}`) },
    { name: "Stands at", numeric: true, cell: (session) => (session.states ? statesWords(session.states) : inCurrency(session.wealth)) },
  ], sessions);
  const line = h("p", { class: "note", role: "status", tabindex: -1 });
  const button = h("button", { type: "submit" }, sessions.length === 1 ? "Continue" : `Continue the ${count(sessions.length)}`);
  const form = h("form", { novalidate: true }, fieldset("From the next period", [choice]), rows, refusal(), h("div", { class: "send" }, button, line));
  const tell = ({ session }, words, wrong = false) => {
    outcomes.get(session).textContent = words;
    outcomes.get(session).classList.toggle("wrong", wrong);
  };
  /** Trainings by their request, so that sessions with the same record and policy share one. */
  const trainings = new Map();
  const trainedFor = async (session) => {
    const [history, policy] = await Promise.all([get(`/sessions/${session.session}/history`, leaving), get(`/policies/${session.policy}`, leaving)]);
    const asked = JSON.stringify((session.states ? anewDeclared : anew)(session, history, policy, new Date()));
    if (!trainings.has(asked)) trainings.set(asked, trained(asked, leaving));
    tell(session, "its policy is being trained\u2026");
    return trainings.get(asked);
  };
  const goneOn = new Set();
  const one = async (session) => {
    const policy = choice.control.value === ANEW ? await trainedFor(session) : choice.control.value;
    const { renewals } = await get(`/sessions/${session.session}`, leaving);
    const { period, horizon } = await post(`/sessions/${session.session}/renewals`, { renewal: renewals + 1, policy });
    goneOn.add(session.session);
    tell(session, `continues: its new policy advises periods ${count(period)} to ${count(horizon)}`);
  };
  sending(form, button, async () => {
    if (choice.control.value === "") throw { field: choice.name, message: "Choose a policy to continue with." };
    const left = sessions.filter(({ session }) => !goneOn.has(session));
    trainings.clear();
    if (choice.control.value === ANEW) line.textContent = "Stay on this page until every session continues. A session continues once its policy is trained.";
    await Promise.all(left.map((session) => one(session).catch((error) => leaving.aborted || tell(session, error.message, true))));
    if (leaving.aborted) return;
    const words = `${counted(goneOn.size, "session continues", "sessions continue")} with another policy${goneOn.size < sessions.length ? `, and ${count(sessions.length - goneOn.size)} as before` : ""}.`;
    line.textContent = words;
    announce(words);
    line.focus();
    if (goneOn.size === sessions.length) button.remove();
  });
  return form;
}
