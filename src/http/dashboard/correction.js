// A period that passed, put right: what was reported and told stays on record, and the advice rests on the new report.

import { post } from "./api.js";
import { h } from "./dom.js";
import { clear, input, select, showProblem } from "./form.js";
import { refusedReport, reportFields } from "./report_fields.js";

/** The form for a session with observed periods. */
export function correctionForm({ id, session, history, policy, refresh }) {
  const periods = history.observations.map(({ period, reported: { date } }) => [period, date ? `${period}, to ${date}` : period]);
  const period = select({ name: "period", label: "Period", choices: Object.fromEntries(periods.reverse()) });
  const { rate_per_step, contributions } = policy.specification.problem;
  const fields = reportFields({
    label: "Return, %",
    rate: rate_per_step,
    contribution: Array.isArray(contributions) ? "the period\u2019s" : contributions,
  });
  fields.advised(null);
  const reason = input({
    name: "reason",
    label: "Why",
    note: "Such as: the index was revised.",
    inputmode: "text",
    maxlength: 200,
  });
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const button = h("button", { type: "submit" }, "Put it right");
  const form = h(
    "form",
    { class: "observe", novalidate: true },
    h("p", { class: "note" }, "All of the period is said anew: what is left blank is what it is by default, whatever was reported first."),
    h("div", { class: "fields" }, period.element, reason.element),
    fields.element,
    message,
    h("p", { class: "send" }, button),
  );
  const send = async (body) => {
    try {
      await post(`/sessions/${id}/corrections`, body);
      await refresh();
    } catch (error) {
      if (refusedReport(form, message, error)) await send({ ...body, confirm: true });
    }
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    clear(form);
    message.hidden = true;
    const trouble = fields.trouble();
    if (trouble) return showProblem(form, message, trouble);
    button.disabled = true;
    const about = { correction: session.corrections + 1, period: Number(period.control.value), reason: reason.control.value };
    await send({ ...about, ...fields.report() });
    button.disabled = false;
  });
  return form;
}
