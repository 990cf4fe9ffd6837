// The return of the coming period, reported once: what is sent again after a failure is the very same request.

import { h } from "./dom.js";
import { endWords } from "./flows.js";
import { allocation, significant, wealth } from "./format.js";
import { reportFields, sendReports } from "./report_fields.js";

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
  const compose = () => {
    const report = { session: id, period: action.period, ...fields.report() };
    if (replaced) report.executed_allocation ??= advised;
    return report;
  };
  const once = "a period counts once.";
  sendReports(form, { button, message, fields, path: "/observe", compose, once, session, refresh });
  const advise = (allocation) => {
    [advised, replaced] = [allocation, true];
    fields.advised(advised);
    foretell();
  };
  return { element: form, advise };
}
