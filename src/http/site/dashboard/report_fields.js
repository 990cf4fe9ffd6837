// The fields for a period, in its report and in its correction: the return, and further details on demand.

import { get, post } from "./api.js";
import { h } from "./dom.js";
import { question, UNCONFIRMED } from "./doubts.js";
import { clear, input, pressed, select, showProblem } from "./form.js";
import { endWords } from "./flows.js";
import { allocation, percent } from "./format.js";
import { inCurrency } from "./money.js";
import { fraction, typed } from "./number_text.js";
import { dayOf, isoDay } from "./periods.js";
import { problemWords } from "./problem_words.js";

const KINDS = { simple_return: "Gain or loss", log_return: "Log-return", missing: "Not known" };

/** The bounds that the service accepts. */
export const LIMITS = { log_return: [-5, 5], simple_return: [-1, Math.expm1(5)], share: [0, 1], rate: [-0.5, 0.5], spent: [0, 1e15], wealth: [1e-6, 1e15] };

/** Returns the field for what was spent before a period, or null if the policy plans no spending. */
export const spentField = (within, spending, changed) =>
  spending === undefined ? null : input({ within, name: "spent", label: "Spent", note: `Before the period. Blank: ${spending ? `the ${inCurrency(spending.amount)}` : "as"} advised.`, changed });

/** Returns the field for the last day of a period. It holds the `due` day once that has come, and otherwise names it. */
export function dayField(within, due) {
  const isCome = due && due <= isoDay(new Date());
  return input({ within, name: "date", label: "Last day", note: due && !isCome ? `Due on ${due}. May be blank.` : "For example 2008-09-30. May be blank.", inputmode: "text", value: isCome ? due : "" });
}

/** Returns the fields for a period. Blank fields mean the `advised` share and the policy's rate and contribution; the last day is filled in
 * once it has come. `advised` is null if it is the advice of that time, and so is `spending`, which is undefined if the policy plans none. */
export function reportFields({ within, label, advised, rate, contribution, spending, date: due = null, changed }) {
  const edited = () => changed?.();
  const given = input({
    within,
    name: "return",
    label,
    note: "Return of the stocks: \u22122.5 is a loss of 2.5 %.",
    unit: "percent",
    changed: edited,
  });
  const kind = select({
    within,
    name: "kind",
    label: "Given as",
    choices: KINDS,
    changed: () => {
      given.control.disabled = kind.control.value === "missing";
      edited();
    },
  });
  const share = (name, label, note) => input({ within, name, label, note, unit: "percent", changed: edited });
  const held = share("executed_allocation", "Share held, %", advised === null ? "Blank: as advised." : `Blank: the ${allocation(advised)} advised.`);
  const paid = share("rate", "The bank paid, %", `Blank: ${percent(rate, 3)}, the policy\u2019s.`);
  const flow = input({
    within,
    name: "flow",
    label: "Money added at the end",
    note: `Blank: ${contribution === null ? "the policy\u2019s amount" : `${inCurrency(contribution)}, the policy\u2019s`}. \u2212100 is a withdrawal of 100.`,
    changed: edited,
  });
  const reached = input({ within, name: "wealth", label: "Wealth reached", note: "Blank: computed from the other fields.", changed: edited });
  const date = dayField(within, due);
  const spent = spentField(within, spending, edited);
  const more = h(
    "details",
    {},
    h("summary", {}, "I held another share, or money came or went"),
    h("div", { class: "fields" }, [held, paid, flow, reached].map((field) => field.element)),
  );
  const isMissing = () => kind.control.value === "missing";
  return {
    element: h("div", {}, h("div", { class: "fields" }, given.element, spent?.element, date.element, kind.element), more),
    /** Fills the fields with what was reported. */
    fill(report, logReturn) {
      const texts = new Map([[held, report.executed_allocation], [paid, report.rate]].map(([field, share]) => [field, inPercent(share)]));
      for (const [field, value] of [[flow, report.flow], [reached, report.wealth], [date, report.date], ...(spent ? [[spent, report.spent]] : [])]) texts.set(field, value ?? "");
      kind.control.value = logReturn === null ? "missing" : "simple_return";
      given.control.disabled = isMissing();
      texts.set(given, logReturn === null ? "" : inPercent(report.simple_return ?? Math.expm1(logReturn)));
      for (const [field, text] of texts) field.control.value = text;
    },
    /** Returns the values for `foretold`; null if a field cannot be read. */
    read() {
      const blank = (field, otherwise, read) => (field.control.value.trim() === "" ? otherwise : read(field.control.value));
      const value = isMissing() ? 0 : fraction(given.control.value);
      const executed = blank(held, advised, fraction);
      const [rateThen, added] = [blank(paid, rate, fraction), blank(flow, contribution, typed)];
      const ended = blank(reached, Number.NaN, typed);
      const used = spent ? blank(spent, spending?.amount ?? 0, typed) : 0;
      if ([value, executed, rateThen, added, ended, used].some((number) => typeof number !== "number")) return null;
      const growth = kind.control.value === "log_return" ? Math.exp(value) : 1 + value;
      const returned = LIMITS[kind.control.value] ?? LIMITS.simple_return;
      const numbers = [[given, value, returned], [held, executed, LIMITS.share], [paid, rateThen, LIMITS.rate], [reached, ended, LIMITS.wealth], ...(spent ? [[spent, used, LIMITS.spent]] : [])];
      return { parts: [{ held: executed, growth }], rate: rateThen, added, ended, spent: used, missing: isMissing(), numbers, flow, reached };
    },
    /** Returns the report; fields that cannot be read are sent as typed, so that the service refuses them by name. */
    report() {
      const report = isMissing() ? { missing: true } : { [kind.control.value]: fraction(given.control.value) };
      const texts = [
        [held, fraction],
        [paid, fraction],
        [flow, typed],
        [reached, typed],
        [date, dayOf],
        ...(spent ? [[spent, typed]] : []),
      ];
      for (const [{ name, control }, read] of texts)
        if (control.value.trim() !== "") report[name] = read(control.value.trim()) ?? control.value;
      return report;
    },
    /** Returns what is wrong with the report, or null. */
    trouble() {
      if (isMissing() || fraction(given.control.value) !== null) return null;
      const text = given.control.value.trim();
      const words = text === "" ? "The return is blank." : `\u201c${text}\u201d is not a percentage.`;
      return { message: words, field: "return" };
    },
  };
}

/** Returns a share as it is typed in percent. */
export const inPercent = (share) => (share === null || share === undefined ? "" : String(Number((100 * share).toPrecision(12))));

/** Says what a report makes of `wealth`, or why it will be refused, in the words of the refusal. In `read`, `parts` are the shares held of each
 * asset and their growths, `numbers` are the fields with their values and bounds. `before` are the shares held before. */
export function foretold(read, { wealth: now, before, cost }) {
  const { parts, rate, added, ended, spent, missing, numbers, flow, reached } = read;
  const refused = ({ element, control }, value, rule) =>
    `This will be refused. ${problemWords({ value, rule }, element.querySelector("label").textContent, control.dataset.unit)}`;
  const within = ([low, high]) => `in [${low}, ${high}]`;
  const beyond = numbers.find(([, value, [low, high]]) => value < low || value > high);
  if (beyond) return refused(beyond[0], beyond[1], `must be a number ${within(beyond[2])}`);
  const sum = (of) => parts.reduce((all, part, index) => all + of(part, index), 0);
  const whole = sum(({ held }) => held);
  if (whole > 1 + 1e-9) return `This will be refused: the shares held add up to ${percent(whole)}, more than 100\u202f%.`;
  const traded = 1 - cost * sum(({ held }, index) => Math.abs(held - before[index]));
  const grown = (1 - whole) * (1 + rate) + sum(({ held, growth }) => held * growth);
  const left = Number.isNaN(ended) ? (now - spent) * traded * grown + added : ended;
  if (left < LIMITS.wealth[0] || left > LIMITS.wealth[1]) {
    const leaves = `the return, the allocation and the amount added give a wealth of ${left}, and wealth must lie ${within(LIMITS.wealth)}`;
    return flow.control.value.trim() === "" ? refused(reached, null, `must be reported: ${leaves}`) : refused(flow, added, `must leave an allowed wealth: ${leaves}`);
  }
  return `${missing ? "No return; wealth" : "Wealth"} ${inCurrency(now)} \u2192 ${inCurrency(left)} at ${allocation(whole)} held. ${endWords(added)}`;
}

/**
 * Sends the request that `compose` makes to `path`, one at a time, then shows the session again by `refresh`. After a failure the same request
 * is sent again; `once` says why that is safe. A doubt of the service is shown as a question below the form, and
 * `numbered(request, count)` is the request after `count` missing periods were reported before it. If somebody else reported meanwhile,
 * their report is shown beside what was typed, by `words`.
 */
export function sendReports(form, { button, message, fields, path, compose, once, done, numbered, words = INVESTOR, session, calendar, refresh }) {
  let request = null;
  const label = button.textContent;
  const place = h("div", {});
  message.after(place);
  const freed = () => {
    request = null;
    button.textContent = label;
    place.replaceChildren();
  };
  form.addEventListener("input", freed);
  form.addEventListener("change", freed);
  const send = async () => {
    try {
      await post(path, request);
      await refresh(done);
    } catch (error) {
      await refused(error);
    }
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    clear(form);
    message.hidden = true;
    place.replaceChildren();
    const trouble = fields.trouble();
    if (trouble) return showProblem(form, message, trouble);
    request ??= compose();
    button.disabled = true;
    await send();
    button.disabled = false;
  });
  /** Reports the missing periods one by one, then the one that was typed. */
  const fill = (refusal) => async (days) => {
    for (const [index, date] of days.entries()) await post(path, { session: refusal.session, period: refusal.period + index, missing: true, date });
    request = numbered(refusal, days.length);
    await send();
  };
  const refused = async (error) => {
    if (error.passing) {
      button.textContent = "Send again";
      showProblem(form, message, { message: `${error.message} Sending it again is safe: ${once}` });
      return;
    }
    const refusal = request;
    request = null;
    if (error.type === UNCONFIRMED) {
      const meant = () => {
        request = { ...refusal, confirm: true };
        return send();
      };
      const asked = question(error, { meant, filled: numbered && fill(refusal) });
      place.replaceChildren(asked);
      return asked.focus();
    }
    if (error.status === 409) {
      const now = await get(`/sessions/${session.session}`).catch(() => null);
      if (now && (now.period !== session.period || now.corrections !== session.corrections)) return refresh(null, overtaken(refusal, now, { calendar, refresh, words }));
    }
    const field = ["log_return", "simple_return"].includes(error.field) ? "return" : error.field;
    showProblem(form, message, { ...error, message: error.message, field });
  };
}

/** Says the return of a report. */
function returnWords({ simple_return, log_return, simple_returns, missing }) {
  if (missing) return "a missing period";
  if (simple_returns) return Object.entries(simple_returns).map(([name, back]) => `${name} ${back === null ? "without a price" : percent(back, 2)}`).join(", ");
  return percent(simple_return ?? Math.expm1(log_return), 2);
}

/** What a report of an investor says, and what stands for its period, in words. */
const INVESTOR = {
  typed: returnWords,
  recorded(row) {
    const { log_return } = row?.now ?? row ?? { log_return: null };
    return log_return === null ? "as missing" : `as ${percent(Math.expm1(log_return), 2)}`;
  },
};

/** Says that a report was not recorded because somebody else was faster: shows what is recorded, what was typed, and a button that corrects
 * it. The result takes the history that is read again. */
const overtaken = (refusal, now, { calendar, refresh, words: { typed, recorded } }) => ({ observations }) => {
  const { session, correction, confirm, reason, ...report } = refusal;
  const stands = recorded(observations[report.period - 1]);
  const words = correction
    ? `Not recorded: ${calendar.inText(report.period)} was corrected by somebody else a moment ago, and is now recorded ${stands}. `
    : `Not recorded: ${calendar.inText(report.period)} was reported ${stands} a moment ago. `;
  const place = h("div", {});
  const right = (confirmed) => async () => {
    const request = { correction: now.corrections + 1, reason: reason ?? "It was reported twice, and this report is the right one", ...report, ...confirmed };
    try {
      await post(`/sessions/${now.session}/corrections`, request);
    } catch (error) {
      if (error.type !== UNCONFIRMED) throw error;
      return place.replaceChildren(question(error, { meant: right({ confirm: true }) }));
    }
    await refresh("The period is corrected.");
  };
  const button = h("button", { type: "button", onclick: ({ target }) => pressed(target, right({})) }, "Correct it");
  return h("div", { class: "doubts", role: "alert" }, h("p", { class: "error" }, `${words}You typed ${typed(report)}. `), place, h("p", { class: "send" }, button));
};
