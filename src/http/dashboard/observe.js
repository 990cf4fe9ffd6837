// The return of the coming period, reported once: what is sent again after a failure is the very same request.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { endWords } from "./flows.js";
import { clear, showProblem } from "./form.js";
import { allocation, significant, wealth } from "./format.js";
import { refusedReport, reportFields } from "./report_fields.js";

/** `{element, advise(allocation)}`: what is held where nothing else is said is the advice, or another that took its place. */
export function observeForm(action, { id, session, policy, refresh }) {
  const { rate_per_step, trading_cost } = policy.specification.problem;
  const preview = h("output", { class: "note" });
  let [advised, replaced] = [action.allocation, false];
  const foretell = () => {
    const read = fields.read(advised);
    if (read === null) return (preview.textContent = "");
    const { growth, executed, rate, added, ended, missing } = read;
    const traded = 1 - trading_cost * Math.abs(executed - session.holding);
    const grown = session.wealth * traded * ((1 - executed) * (1 + rate) + executed * growth);
    const seen = missing ? "No return" : `Log-return ${significant(Math.log(growth), 4)}`;
    const reached = Number.isNaN(ended) ? grown + added : ended;
    preview.textContent = `${seen}; wealth ${wealth(session.wealth)} \u2192 ${wealth(reached)} at ${allocation(executed)} held. ${endWords(added)}`;
  };
  const fields = reportFields({
    label: `Return in period ${action.period}, %`,
    rate: rate_per_step,
    contribution: action.contribution,
    changed: () => foretell(),
  });
  fields.advised(advised);
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const button = h("button", { type: "submit" }, `Report period ${action.period}`);
  const form = h(
    "form",
    { class: "observe", novalidate: true },
    fields.element,
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
  form.addEventListener("change", freed);
  const compose = () => {
    const report = { session: id, period: action.period, ...fields.report() };
    if (replaced) report.executed_allocation ??= advised;
    return report;
  };
  const send = async () => {
    try {
      await post("/observe", request);
      await refresh();
    } catch (error) {
      await refused(error);
    }
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    clear(form);
    message.hidden = true;
    const trouble = fields.trouble();
    if (trouble) return showProblem(form, message, trouble);
    request ??= compose();
    button.disabled = true;
    await send();
    button.disabled = false;
  });
  const refused = async (error) => {
    if (error.passing) {
      button.textContent = "Send again";
      showProblem(form, message, { message: `${error.message} Sending it again is safe: a period counts once.` });
      return;
    }
    const refusal = request;
    request = null;
    if (error.status === 409) {
      const now = await get(`/sessions/${id}`).catch(() => null);
      if (now && now.period !== action.period) await refresh();
    }
    if (refusedReport(form, message, error)) {
      request = { ...refusal, confirm: true };
      await send();
    }
  };
  const advise = (allocation) => {
    [advised, replaced] = [allocation, true];
    fields.advised(advised);
    foretell();
  };
  return { element: form, advise };
}
