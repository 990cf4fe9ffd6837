// What may be asked of a declared problem's policy by a job: a comparison with other frameworks and a rule, and a walk through its record.

import { post } from "./api.js";
import { plain } from "./comparison.js";
import { announce, h, section } from "./dom.js";
import { fieldset, input, refusal, sending } from "./form.js";
import { pointed } from "./number_text.js";

const FRAMEWORKS = { adaptive: "Cautious, and learns", static: "Cautious, learns nothing more", plug_in: "Learns, and trusts what it learned", known_law: "Trusts the record, learns nothing more" };

/** Returns checkboxes for frameworks, and a function that returns the ticked ones. */
function frameworksField(names, ticked) {
  const boxes = names.map((name) => [name, h("input", { type: "checkbox", name: "frameworks", value: name, checked: name === ticked })]);
  const element = h("div", { class: "field checks" }, boxes.map(([name, box]) => h("label", {}, box, FRAMEWORKS[name])));
  return [fieldset("Frameworks", [element]), () => boxes.filter(([, { checked }]) => checked).map(([name]) => name)];
}

/** Returns fields for a rule, a formula for each action, and a function that returns the rules: none if all are blank. */
function ruleFields({ states, parameters = {}, actions }, form) {
  const bounds = ({ low, high, values }) => (values ? `The nearest of ${values.map(plain).join(", ")} is taken.` : `Moved into its bounds: ${low} to ${high}.`);
  const formula = ([name, action], index) =>
    input({ within: `${form}-${index}-`, name: `rules.rule.${name}`, label: name, note: bounds(action), inputmode: "text", spellcheck: "false" });
  const fields = Object.entries(actions).map(formula);
  fields.forEach(({ element }) => element.classList.add("broad"));
  const names = [...Object.keys(states), ...Object.keys(parameters)].join(", ");
  const note = h("p", { class: "note" }, `A formula for ${Object.keys(actions).join(" and ")} may name ${names}, the period t (from 0) and the number of periods T. Left blank, there is no rule.`);
  const rules = () => {
    const rule = Object.keys(actions).map((name, index) => [name, fields[index].control.value.trim()]);
    return rule.every(([, text]) => text === "") ? {} : { rule: Object.fromEntries(rule) };
  };
  return [note, fields, rules];
}

/** Returns the section of a form that queues a job and goes to its report. */
function asking(title, button, note, parts, queue, address) {
  const send = h("button", { type: "submit" }, button);
  const form = h("form", { novalidate: true }, parts, refusal(), h("p", { class: "send" }, send, h("span", { class: "note" }, note)));
  sending(form, send, async () => {
    const { job } = await queue();
    announce("The job is queued.");
    location.hash = `${address}/${job}`;
  });
  const element = section(title, form);
  element.dataset.needs = "train";
  return element;
}

/** Returns the form that compares policy `id` with policies of other frameworks and with a rule. */
export function beside(id, { problem, design, surrogate, seed }) {
  const [note, fields, rules] = ruleFields(problem, "rule");
  const [frameworks, ticked] = frameworksField(Object.keys(FRAMEWORKS).filter((name) => name !== problem.framework), null);
  const paths = input({ within: "rule-", name: "paths", label: "Paths", note: "100 to 100,000.", value: "1000", inputmode: "numeric" });
  const queue = () => {
    const trained = ticked();
    const own = trained.length > 0 ? { problem, design, surrogate, seed, frameworks: trained } : {};
    return post("/evaluate", { ...own, policies: { policy: id }, rules: rules(), paths: pointed(paths.control.value) });
  };
  const parts = [note, fieldset("The rule", [...fields, paths]), frameworks];
  return asking("Beside other frameworks and a rule of your own", "Compare", "All go through the same paths, drawn from the record.", parts, queue, "#/evaluations");
}

/** Returns the form that lets the problem walk through its own record. */
export function walking({ problem, design, surrogate, seed }) {
  const { history, horizon, framework } = problem;
  const [note, fields, rules] = ruleFields(problem, "walk");
  const [frameworks, ticked] = frameworksField(["adaptive", "static", "plug_in"], framework);
  const half = Math.floor(history.length / 2);
  const window = input({ within: "walk-", name: "window", label: "Window", note: `Numbers that each policy is trained on, 2 to ${history.length - 1}.`, value: String(Math.max(half, 2)), inputmode: "numeric" });
  const every = input({ within: "walk-", name: "every", label: "Train every", note: `Periods, 1 to ${horizon}.`, value: String(horizon), inputmode: "numeric" });
  const queue = () =>
    post("/backtest", { problem, design, surrogate, seed, window: pointed(window.control.value), every: pointed(every.control.value), frameworks: ticked(), rules: rules() });
  const parts = [note, fieldset("The rule", fields), fieldset("The walk", [window, every]), frameworks];
  return asking("Through the record itself", "Walk", "Trained on what was known then, and followed until the next training.", parts, queue, "#/backtests");
}
