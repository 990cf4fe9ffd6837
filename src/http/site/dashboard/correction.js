// The correction of a past period: the original report and advice stay on record, and new advice rests on the
// correction.

import { h } from "./dom.js";
import { standing } from "./flows.js";
import { input, refusal, select } from "./form.js";
import { reportFields, sendReports } from "./report_fields.js";
import { severalFields } from "./several_fields.js";

/** What a correction does to its period, in words. */
export const CHANGES = { replace: "The report is wrong", insert: "A period before it was skipped", remove: "The period should be removed" };

/** Returns the refusal of a correction without a reason, or null. */
export const unreasoned = ({ name, control }) => (control.value.trim() === "" ? { field: name, message: "Say why." } : null);

/** Returns the form of a correction: its first fields, the rest, and the button that sends it. */
export function correctionFrame(fields, rest, button) {
  return h(
    "form",
    { class: "observe", novalidate: true },
    h("p", { class: "note" }, "The fields show the current values. The original report stays on record."),
    h("div", { class: "fields" }, fields.map(({ element }) => element)),
    rest,
    h("p", { class: "send" }, button),
  );
}

/** Returns the form for a session with observed periods. */
export function correctionForm({ id, session, history, policy, calendar, refresh }) {
  const within = "correction-";
  const periods = history.observations.map(({ period }) => [period, calendar.name(period)]);
  const fill = (chosen) => {
    const row = history.observations[chosen - 1];
    if (history.assets) {
      const names = Object.keys(row.assets.advised_allocations);
      if (JSON.stringify(names) !== JSON.stringify(shown)) {
        [shown, fields] = [names, severalFields(names, blank)];
        place.replaceChildren(fields.element);
      }
      fields.fill(history, chosen - 1);
    } else fields.fill(standing(row), (row.now ?? row).log_return);
  };
  const period = select({ within, name: "period", label: "Period", choices: periods.reverse(), changed: (value) => fill(Number(value)) });
  const { rate_per_step, contributions, spending } = policy.specification.problem;
  const contribution = Array.isArray(contributions) ? null : contributions;
  const blank = { within, advised: null, rate: rate_per_step, contribution, spending: spending ? null : undefined };
  // The assets may differ from period to period; fields of the same assets keep what is open.
  let shown = null;
  let fields = history.assets ? null : reportFields({ ...blank, label: "Return, %" });
  const place = h("div", {}, fields?.element ?? "");
  fill(history.observations.length);
  const change = select({
    within,
    name: "change",
    label: "What is wrong",
    choices: CHANGES,
    changed: (value) => {
      place.hidden = value !== "replace";
      skipped.hidden = value !== "insert";
    },
  });
  const isReplaced = () => change.control.value === "replace";
  const skipped = h("p", { class: "note", hidden: true }, "The skipped period is inserted without a return. Correct it once you know the return.");
  const reason = input({
    within,
    name: "reason",
    label: "Why",
    note: "For example: the index was revised.",
    inputmode: "text",
    maxlength: 200,
  });
  const message = refusal();
  const button = h("button", { type: "submit" }, "Correct it");
  const form = correctionFrame([period, change, reason], [skipped, place, message], button);
  const compose = () => {
    const about = { correction: session.corrections + 1, period: Number(period.control.value), reason: reason.control.value };
    if (isReplaced()) return { ...about, ...fields.report() };
    return { ...about, change: change.control.value, ...(change.control.value === "insert" ? { missing: true } : {}) };
  };
  const trouble = () => (isReplaced() ? fields.trouble() : null) ?? unreasoned(reason);
  const once = "a correction counts once.";
  const path = `/sessions/${id}/corrections`;
  const done = "The period is corrected.";
  sendReports(form, { button, message, fields: { trouble }, path, compose, once, done, session, calendar, refresh });
  return form;
}
