// A period that passed, put right: what was reported and told stays on record, and the advice rests on the new report.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { standing } from "./flows.js";
import { clear, input, select, showProblem } from "./form.js";
import { refusedReport, reportFields } from "./report_fields.js";

/** The form for a session with observed periods. */
export function correctionForm({ id, session, history, policy, refresh }) {
  const within = "correction-";
  const periods = history.observations.map((row) => {
    const { date } = standing(row);
    return [row.period, date ? `${row.period}, to ${date}` : row.period];
  });
  const period = select({ within, name: "period", label: "Period", choices: periods.reverse() });
  const { rate_per_step, contributions } = policy.specification.problem;
  const fields = reportFields({
    within,
    label: "Return, %",
    rate: rate_per_step,
    contribution: Array.isArray(contributions) ? null : contributions,
  });
  fields.advised(null);
  const reason = input({
    within,
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
  let request = null;
  form.addEventListener("input", () => (request = null));
  form.addEventListener("change", () => (request = null));
  const send = async () => {
    try {
      await post(`/sessions/${id}/corrections`, request);
    } catch (error) {
      return refused(error);
    }
    await refresh("The period is put right.");
  };
  const refused = async (error) => {
    if (error.passing) {
      showProblem(form, message, { message: `${error.message} Sending it again is safe: a correction counts once.` });
      return;
    }
    const refusal = request;
    request = null;
    if (error.field === "correction") {
      const now = await get(`/sessions/${id}`).catch(() => null);
      if (now && now.corrections !== session.corrections) return refresh("Another correction was made meanwhile.");
    }
    if (refusedReport(form, message, error)) {
      request = { ...refusal, confirm: true };
      await send();
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
    request ??= { ...about, ...fields.report() };
    await send();
    button.disabled = false;
  });
  return form;
}
