// The return of the coming period, reported once: what is sent again after a failure is the very same request.

import { h } from "./dom.js";
import { endWords } from "./flows.js";
import { allocation, percent, wealth } from "./format.js";
import { reportFields, sendReports } from "./report_fields.js";

/** The form; what is held where nothing else is said is the advice. */
export function observeForm(action, { id, session, policy, calendar, refresh }) {
  const { rate_per_step, trading_cost } = policy.specification.problem;
  const preview = h("output", { class: "note" });
  const advised = action.allocation;
  const foretell = () => {
    const read = fields.read(advised);
    if (read === null) return (preview.textContent = "");
    const { growth, executed, rate, added, ended, missing } = read;
    const wrong = [
      (executed < 0 || executed > 1) && `${percent(executed)} cannot be held`,
      growth <= 0 && "more than everything cannot be lost",
    ].find(Boolean);
    if (wrong) return (preview.textContent = `This will be refused: ${wrong}.`);
    const traded = 1 - trading_cost * Math.abs(executed - session.holding);
    const grown = session.wealth * traded * ((1 - executed) * (1 + rate) + executed * growth);
    const seen = missing ? "No return; wealth" : "Wealth";
    const reached = Number.isNaN(ended) ? grown + added : ended;
    preview.textContent = `${seen} ${wealth(session.wealth)} \u2192 ${wealth(reached)} at ${allocation(executed)} held. ${endWords(added)}`;
  };
  const fields = reportFields({
    label: `Return in ${calendar.inText(action.period)}, %`,
    rate: rate_per_step,
    contribution: action.contribution,
    date: calendar.next,
    changed: () => foretell(),
  });
  fields.advised(advised);
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const button = h("button", { type: "submit" }, `Report ${calendar.inText(action.period)}`);
  const form = h(
    "form",
    { class: "observe", novalidate: true, "data-needs": "operate" },
    fields.element,
    preview,
    message,
    h("p", { class: "send" }, button),
  );
  const compose = () => ({ session: id, period: action.period, ...fields.report() });
  const once = "a period counts once.";
  sendReports(form, { button, message, fields, path: "/observe", compose, once, session, refresh });
  return form;
}
