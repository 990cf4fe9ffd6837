// The form that requests an out-of-sample comparison, on a page of its own.

import { get, post } from "./api.js";
import { announce, h } from "./dom.js";
import { fieldset, input, refusal, select, sending } from "./form.js";
import { typed } from "./number_text.js";
import { OWN_FIELD, ownFormula } from "./own_formula.js";
import { all } from "./pages.js";
import { policyChoices } from "./session_opening.js";
import { FRAMEWORKS, investorsOnly } from "./specification.js";

export async function view(query, leaving) {
  const policies = await all("/policies", "policies", leaving);
  const wanted = Object.fromEntries(new URLSearchParams(query ?? ""));
  const trail = h("p", { class: "trail" }, h("a", { href: "#/evaluations" }, "Evaluations"));
  const none = h("p", {}, "An evaluation starts from a policy. ", h("a", { href: "#/train" }, "Train one"), ".");
  return { title: "Compare out of sample", trail, body: policies.length > 0 ? asking(policies, wanted) : none };
}

/** Returns the form, with the `policy` chosen, and with drawn records if `records` is "drawn". */
function asking(policies, wanted) {
  const choices = policyChoices(policies);
  const policy = select({
    name: "policy",
    label: "Policy",
    note: "All strategies are compared with its investor, record and precision.",
    choices,
  });
  policy.element.classList.add("broad");
  if (policies.some(({ policy }) => policy === wanted.policy)) policy.control.value = wanted.policy;
  const paths = input({ name: "paths", label: "Futures per record", note: "100 to 100,000.", value: "1000" });
  const histories = select({
    name: "histories.kind",
    label: "Records",
    note: "Drawn records show how much the result depends on the record.",
    choices: { given: "The policy\u2019s own", drawn: "Drawn from the market" },
  });
  const count = input({ name: "histories.count", label: "How many records", note: "2 to 1,000.", value: "50" });
  const frameworks = h(
    "div",
    { class: "field checks", role: "group", "aria-label": "Kinds of policy" },
    Object.entries(FRAMEWORKS).map(([value, words]) =>
      h("label", {}, h("input", { type: "checkbox", name: "frameworks", value, checked: true }), words),
    ),
  );
  const own = ownFormula("A share of wealth from the returns before each period.");
  const drawn = () => (count.element.hidden = histories.control.value !== "drawn");
  histories.control.addEventListener("change", drawn);
  if (wanted.records === "drawn") histories.control.value = "drawn";
  drawn();
  const send = h("button", { type: "submit" }, "Evaluate");
  const form = h(
    "form",
    { novalidate: true },
    fieldset("What to compare", [policy, histories, count, paths, own.field, frameworks]),
    refusal(),
    h(
      "p",
      { class: "send" },
      send,
      h(
        "span",
        { class: "note" },
        "The other kinds of policy are trained first. All in the bank and constant mixes are always included.",
      ),
    ),
  );
  sending(form, send, async () => {
    const { specification } = await get(`/policies/${policy.control.value}`);
    investorsOnly(specification);
    const request = composed(specification, policy.control.value, {
      frameworks: [...frameworks.querySelectorAll(":checked")].map(({ value }) => value),
      paths: typed(paths.control.value),
      histories:
        histories.control.value === "drawn"
          ? { kind: "drawn", count: typed(count.control.value) }
          : { kind: "given" },
      ...own.weights(),
    });
    const job = await post("/evaluate", request);
    announce("The evaluation is queued.");
    location.hash = `#/evaluations/${job.job}`;
  }, { told: (error) => error.field === OWN_FIELD && (error.field = own.field.name) });
  return form;
}

/** Returns the request for a policy's problem. With drawn histories every learning policy must be trained for any history. */
function composed({ problem, design, surrogate, seed }, policy, choices) {
  const { framework, ...rest } = problem;
  const serves = choices.histories.kind === "given" || design.initial_laws === "resampled";
  const policies = serves && choices.frameworks.includes(framework) ? { [framework]: policy } : {};
  return { problem: rest, design, surrogate, seed, policies, ...choices };
}
