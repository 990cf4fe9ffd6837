// The return of the coming period, reported once: what is sent again after a failure is the very same request.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { clear, input, select, showProblem } from "./form.js";
import { allocation, significant, wealth } from "./format.js";

const KINDS = { simple_return: "Simple return", log_return: "Log-return" };

/** Percent to a fraction without a rounding of its own: the decimal point moves in the text. */
function fraction(text) {
  const plain = text.trim().replace("\u2212", "-").replace(/\s*%$/, "");
  const [digits, power = "0"] = plain.toLowerCase().split("e");
  const value = plain === "" ? NaN : Number(`${digits}e${Number(power) - 2}`);
  return Number.isFinite(value) ? value : null;
}

export function observeForm(action, { id, session, policy, refresh }) {
  const { rate_per_step } = policy.specification.problem;
  const preview = h("output", { class: "note" });
  const read = () => {
    const value = fraction(given.control.value);
    const executed = held.control.value.trim() === "" ? action.allocation : fraction(held.control.value);
    if (value === null || executed === null) return (preview.textContent = "");
    const growth = kind.control.value === "log_return" ? Math.exp(value) : 1 + value;
    const next = session.wealth * ((1 - executed) * (1 + rate_per_step) + executed * growth);
    preview.textContent = `Log-return ${significant(Math.log(growth), 4)}; wealth ${wealth(session.wealth)} \u2192 ${wealth(next)} at ${allocation(executed)} held.`;
  };
  const given = input({
    name: "return",
    label: `Return in period ${action.period}, %`,
    note: "Of the risky asset: \u22122.5 is a loss of 2.5 %",
    changed: () => read(),
  });
  const kind = select({ name: "kind", label: "Given as", choices: KINDS, changed: () => read() });
  const held = input({
    name: "executed_allocation",
    label: "Share held, %",
    note: `Blank: the ${allocation(action.allocation)} advised.`,
    changed: () => read(),
  });
  const reached = input({ name: "wealth", label: "Wealth reached", note: "Blank: what return and share give." });
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
    if (reached.control.value.trim() !== "")
      report.wealth = Number.isNaN(Number(reached.control.value))
        ? reached.control.value
        : Number(reached.control.value);
    return report;
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    clear(form);
    message.hidden = true;
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
    showProblem(form, message, { message: error.message, field });
  };
  return form;
}
