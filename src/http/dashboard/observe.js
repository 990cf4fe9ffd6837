// The return of the coming period, reported once: what is sent again after a failure is the very same request.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { endWords } from "./flows.js";
import { clear, input, select, showProblem } from "./form.js";
import { allocation, significant, wealth } from "./format.js";
import { fraction, typed } from "./number_text.js";

const KINDS = { simple_return: "Simple return", log_return: "Log-return" };

/** `{element, advise(allocation)}`: what is held where nothing else is said is the advice, or another that took its place. */
export function observeForm(action, { id, session, policy, refresh }) {
  const { rate_per_step, trading_cost } = policy.specification.problem;
  const { contribution } = action;
  const preview = h("output", { class: "note" });
  let [advised, replaced] = [action.allocation, false];
  const read = () => {
    const value = fraction(given.control.value);
    const executed = held.control.value.trim() === "" ? advised : fraction(held.control.value);
    if (value === null || executed === null) return (preview.textContent = "");
    const growth = kind.control.value === "log_return" ? Math.exp(value) : 1 + value;
    const traded = 1 - trading_cost * Math.abs(executed - session.holding);
    const grown = session.wealth * traded * ((1 - executed) * (1 + rate_per_step) + executed * growth);
    preview.textContent = `Log-return ${significant(Math.log(growth), 4)}; wealth ${wealth(session.wealth)} \u2192 ${wealth(grown + contribution)} at ${allocation(executed)} held. ${endWords(contribution)}`;
  };
  const given = input({
    name: "return",
    label: `Return in period ${action.period}, %`,
    note: "Of the risky asset: \u22122.5 is a loss of 2.5 %",
    unit: "percent",
    changed: () => read(),
  });
  const kind = select({ name: "kind", label: "Given as", choices: KINDS, changed: () => read() });
  const held = input({
    name: "executed_allocation",
    label: "Share held, %",
    unit: "percent",
    note: blankShare(advised),
    changed: () => read(),
  });
  const reached = input({ name: "wealth", label: "Wealth reached", note: "Blank: what return and share give, and what is added." });
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const button = h("button", { type: "submit" }, `Report period ${action.period}`);
  const more = h(
    "details",
    {},
    h("summary", {}, "It went differently"),
    h("div", { class: "fields" }, held.element, reached.element),
  );
  const form = h(
    "form",
    { class: "observe", novalidate: true },
    h("div", { class: "fields" }, given.element, kind.element),
    more,
    preview,
    message,
    h("p", { class: "send" }, button),
  );
  let request = null;
  const freed = () => {
    request = null;
    button.textContent = `Report period ${action.period}`;
  };
  form.addEventListener("input", freed);
  kind.control.addEventListener("change", freed);
  const compose = () => {
    const report = { session: id, period: action.period, [kind.control.value]: fraction(given.control.value) };
    if (held.control.value.trim() !== "")
      report.executed_allocation = fraction(held.control.value) ?? held.control.value;
    else if (replaced) report.executed_allocation = advised;
    const worth = typed(reached.control.value);
    if (worth !== null) report.wealth = worth;
    return report;
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    clear(form);
    message.hidden = true;
    if (fraction(given.control.value) === null) return unread();
    request ??= compose();
    button.disabled = true;
    try {
      await post("/observe", request);
      await refresh();
    } catch (error) {
      await refused(error);
    }
    button.disabled = false;
  });
  const unread = () => {
    const text = given.control.value.trim();
    const words = text === "" ? "The return is blank." : `\u201c${text}\u201d is not a number of percent.`;
    showProblem(form, message, { message: words, field: "return" });
  };
  const refused = async (error) => {
    if (error.passing) {
      button.textContent = "Send again";
      showProblem(form, message, { message: `${error.message} Sending it again is safe: a period counts once.` });
      return;
    }
    request = null;
    if (error.status === 409) {
      const now = await get(`/sessions/${id}`).catch(() => null);
      if (now && now.period !== action.period) await refresh();
    }
    const field = ["log_return", "simple_return"].includes(error.field) ? "return" : error.field;
    showProblem(form, message, { ...error, message: error.message, field });
  };
  const advise = (allocation) => {
    [advised, replaced] = [allocation, true];
    held.element.querySelector(".note").textContent = blankShare(advised);
    read();
  };
  return { element: form, advise };
}

const blankShare = (advised) => `Blank: the ${allocation(advised)} advised.`;
