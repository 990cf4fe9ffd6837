// The report of the coming period's return, recorded once: a retry after a failure sends the very same request.

import { h } from "./dom.js";
import { foretold, reportFields, sendReports } from "./report_fields.js";
import { presentAssets, severalFields } from "./several_fields.js";

/** Returns the form; a blank share held means the advised one. */
export function observeForm(action, { id, session, history, policy, calendar, refresh }) {
  const assets = presentAssets(history);
  const { rate_per_step, trading_cost } = policy.specification.problem;
  const preview = h("output", { class: "note" });
  const before = assets ? assets.map((name) => action.holdings[name]) : [session.holding];
  const foretell = () => {
    const read = fields.read();
    preview.textContent = read === null ? "" : foretold(read, { wealth: session.wealth, before, cost: trading_cost });
  };
  const blank = { advised: action.allocation, rate: rate_per_step, contribution: action.contribution, spending: action.spending ?? undefined, date: session.next, changed: foretell };
  const fields = assets ? severalFields(assets, blank) : reportFields({ ...blank, label: `Return in ${calendar.inText(action.period)}, %` });
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
  const numbered = (report, count) => ({ ...report, period: report.period + count });
  sendReports(form, { button, message, fields, path: "/observe", compose, once, numbered, session, calendar, refresh });
  return form;
}
