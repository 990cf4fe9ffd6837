// The form that opens a session, on a page of its own so that a link leads straight to it.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { keptFields, OPENING } from "./draft.js";
import { fieldset, input, refusal, select, sending, showProblem } from "./form.js";
import { moment, short } from "./format.js";
import { labelFields } from "./naming.js";
import { fraction, pointed, typed } from "./number_text.js";
import { all } from "./pages.js";
import { byDate, returnsField } from "./returns_field.js";
import { isDeclared } from "./specification.js";

export async function view(query, leaving) {
  const policies = await all("/policies", "policies", leaving);
  const asked = new URLSearchParams(query ?? "").get("policy");
  const trail = h("p", { class: "trail" }, h("a", { href: "#/sessions" }, "Overview"));
  const none = h("p", {}, "A session needs a policy first. ", h("a", { href: "#/train" }, "Train one"), ".");
  return { title: "Open a session", trail, body: policies.length > 0 ? opening(policies, asked, leaving) : none };
}

function opening(policies, asked, leaving) {
  const labels = labelFields();
  // With several policies the user must choose one.
  const unchosen = policies.length > 1 ? [["", "Choose one"]] : [];
  const policy = select({ name: "policy", label: "Policy", choices: [...unchosen, ...policyChoices(policies)] });
  if (policies.some(({ policy }) => policy === asked)) policy.control.value = asked;
  const stake = input({ name: "wealth", label: "Wealth", note: "Blank: the policy\u2019s initial wealth." });
  const holding = input({
    name: "holding",
    label: "Held now, %",
    note: "In stocks. Blank: nothing.",
    unit: "percent",
  });
  const going = select({
    name: "rolling",
    label: "How it continues",
    choices: { ends: "Until the horizon of the policy", renews: "Renewed automatically", rolls: "Rolling" },
    note: "A renewed session continues with policies trained on the returns seen by then.",
    changed: (choice) => [every, window].forEach(({ element }) => (element.hidden = choice !== "renews")),
  });
  for (const { element } of [policy, going]) element.classList.add("broad");
  const every = input({ name: "renew.every", label: "Periods with each policy", note: "Fewer than it looks ahead." });
  const window = input({ name: "renew.window", label: "Returns it is trained on", note: "How many of the latest. Blank: all." });
  every.element.hidden = window.element.hidden = true;
  let known = [];
  const history = returnsField({
    name: "history",
    label: "Returns or prices known",
    blank: "Blank: the policy\u2019s own history.",
    several: true,
    changed: (series) => (known = series),
  });
  let assets = null;
  let states = null;
  const begins = h("div", { class: "fields", hidden: true });
  const shares = h("div", { class: "fields", hidden: true });
  let usual = "";
  const goingNote = going.element.querySelector(".note");
  /** Disables what the policy cannot do, and says why. */
  const allow = ({ problem, design }) => {
    const reasons = cannot(problem, design);
    for (const option of going.control.options) {
      option.disabled = option.value in reasons;
      if (option.disabled && option.selected) going.control.value = "ends";
    }
    const { horizon } = problem;
    if (every.control.value === usual) every.control.value = usual = String(Math.max(1, Math.floor(horizon / 2)));
    every.element.querySelector(".note").textContent = `1 to ${horizon - 1}: this policy looks ${horizon} periods ahead.`;
    for (const { element } of [every, window]) element.hidden = going.control.value !== "renews";
    goingNote.textContent = ["A renewed session continues with policies trained on the returns seen by then.", ...Object.values(reasons)].join(" ");
  };
  const chosen = async () => {
    const asked = policy.control.value;
    if (asked === "") return;
    const { specification } = await get(`/policies/${asked}`, leaving);
    if (asked !== policy.control.value) return;
    states = isDeclared(specification) ? specification.problem.states : null;
    const state = ([name, { start, low, high }], index) => input({ within: `state-${index}-`, name: `state.${name}`, label: `${name} now`, note: `${low} to ${high}. Blank: ${start}.` });
    begins.replaceChildren(...Object.entries(states ?? {}).map((entry, index) => state(entry, index).element));
    begins.hidden = states === null;
    for (const element of [stake.element, holding.element, other]) element.hidden = states !== null;
    assets = states ? null : (specification.fund?.assets ?? null);
    shares.hidden = assets === null;
    allow(specification);
    if (states) return;
    holding.element.hidden = assets !== null;
    const field = (name, index) => input({ within: `asset-${index}-`, name: `holdings.${name}`, label: `${name} held now, %`, note: "Of wealth. Blank: nothing.", unit: "percent" });
    shares.replaceChildren(...(assets ?? []).map((name, index) => field(name, index).element));
    drafts.restore();
  };
  let choosing = null;
  const failed = (error) => leaving.aborted || showProblem(form, message, { field: policy.name, message: error.message });
  const choose = () => (choosing = chosen().then(() => true, (error) => (failed(error), false)));
  policy.control.addEventListener("change", choose);
  choose();
  const other = h(
    "details",
    {},
    h("summary", {}, "Use other known returns than the policy\u2019s history"),
    history.element,
  );
  const more = h("details", {}, h("summary", {}, "Tags and notes"), h("div", { class: "fields" }, labels.tags.element, labels.notes.element));
  const message = refusal();
  const open = h("button", { type: "submit" }, "Open");
  const form = h(
    "form",
    { novalidate: true },
    fieldset("The session", [labels.name, policy, stake, holding, shares, begins]),
    fieldset("How long", [going, every, window]),
    other,
    more,
    message,
    h("p", { class: "send" }, open),
  );
  sending(form, open, async () => {
    const trouble = await history.trouble();
    if (trouble) throw { field: "history", message: trouble };
    if (policy.control.value === "") throw { field: policy.name, message: "Choose a policy for this session." };
    if (!(await choosing) && !(await choose())) return;
    const request = { policy: policy.control.value, ...labels.read() };
    if (states) {
      const typedIn = Object.keys(states).map((name, index) => [name, begins.querySelectorAll("input")[index].value.trim()]);
      if (typedIn.some(([, text]) => text !== "")) request.state = Object.fromEntries(typedIn.map(([name, text]) => [name, text === "" ? states[name].start : pointed(text)]));
    }
    if (!states && known.length > 0) request.history = assets ? byDate(inOrder(known, assets)) : known[0].log_returns;
    const wealth = states ? null : typed(stake.control.value);
    if (wealth !== null) request.wealth = wealth;
    const share = (text) => fraction(text) ?? text.trim();
    const texts = states ? [] : assets ? [...shares.querySelectorAll("input")].map(({ value }) => value) : [holding.control.value];
    const isSaid = texts.some((text) => text.trim() !== "");
    if (isSaid && assets) request.holdings = Object.fromEntries(assets.map((name, index) => [name, texts[index].trim() === "" ? 0 : share(texts[index])]));
    else if (isSaid) request.holding = share(texts[0]);
    if (going.control.value === "rolls") request.rolling = true;
    if (going.control.value === "renews")
      request.renew = { every: typed(every.control.value), window: typed(window.control.value) };
    const { session } = await post("/sessions", request);
    drafts.drop();
    location.hash = `#/sessions/${session}`;
  });
  const drafts = keptFields(form, OPENING);
  drafts.restore();
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  return drafts.isKept ? [drafts.note(again), form] : form;
}

/** Returns the columns in the order of `assets`, or as they are if their names are not those of the assets. */
function inOrder(series, assets) {
  const named = assets.map((name) => series.find(({ column }) => column === name));
  return named.every(Boolean) ? named : series;
}

/** Returns the reasons why a session with a policy cannot be renewed automatically or roll, by the choice they disable. */
function cannot({ horizon, contributions, learning, utility, states }, { initial_laws }) {
  const flows = [contributions ?? 0].flat();
  const reasons = {};
  if (horizon < 2) reasons.renews = "A renewed session needs a policy that looks at least two periods ahead. This one looks one period ahead.";
  else if (Array.isArray(contributions)) reasons.renews = "A session cannot be renewed automatically if its policy lists contributions period by period.";
  if (states) reasons.rolls = "A rolling session needs an investor.";
  else if (learning?.kind !== "decay") reasons.rolls = "A rolling session needs a policy that counts older returns less. This one counts all returns equally.";
  else if (initial_laws !== "resampled") reasons.rolls = "A rolling session needs a policy trained for other records than its own.";
  else if (utility.kind === "exponential" || flows.some((amount) => amount !== 0)) reasons.rolls = "A rolling session needs a policy whose advice does not depend on wealth.";
  return reasons;
}

/** Returns the policies to choose from, with names that tell them apart; automatically renewed ones come last. */
export const policyChoices = (policies) => {
  const isRenewed = ({ tags }) => Number(tags.includes("renewed"));
  return [...policies]
    .sort((one, other) => isRenewed(one) - isRenewed(other))
    .map(({ policy, name, created_ms }) => [policy, `${name ? `${name} (${short(policy)})` : short(policy)}, stored ${moment(created_ms)}`]);
};
