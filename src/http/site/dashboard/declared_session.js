// One session of a declared problem: what to do now, the noise to report, how it went, and how to correct it.

import { get, post } from "./api.js";
import { lineChart } from "./chart.js";
import { CHANGES, correctionFrame, unreasoned } from "./correction.js";
import { csvText } from "./csv.js";
import { decided, isMoved, plain, statesWords } from "./declared_policy.js";
import { announce, disclosure, facts, h, section, table } from "./dom.js";
import { input, refusal, select } from "./form.js";
import { count, moment, short, tick } from "./format.js";
import { futuresOf } from "./futures.js";
import { policyLink } from "./naming.js";
import { pointed } from "./number_text.js";
import { calendar, day } from "./periods.js";
import { save } from "./picture.js";
import { due } from "./renewal_due.js";
import { dayField, sendReports } from "./report_fields.js";

/** Returns the body of the page of session `id` under `policy`. */
export async function declaredSession(id, session, policy, leaving) {
  const { problem } = policy.specification;
  const holder = h("div", {});
  const read = async () => {
    const [session, history] = await Promise.all([`/sessions/${id}`, `/sessions/${id}/history`].map((path) => get(path, leaving)));
    return { id, session, history, problem, calendar: calendar(history, null), refresh, leaving };
  };
  /** Shows the session again after a report: with a receipt, or with the result of `alert(history)`. */
  const refresh = async (news, alert) => {
    const shown = await read();
    const words = `${news ?? `${shown.calendar.name(shown.session.period - 1)} is recorded.`} ${statesWords(shown.session.states)}.`;
    await fill(holder, shown, alert ? alert(shown.history) : h("p", { class: "note receipt" }, words));
    if (!alert) announce(words);
    holder.querySelector("#advice")?.focus();
  };
  await fill(holder, await read(), "");
  return holder;
}

async function fill(holder, shown, notice) {
  const { id, session, history, problem, leaving } = shown;
  const action = session.state === "completed" ? null : await get(`/action?session=${id}`, leaving).catch((error) => (error.status === undefined || error.status === 0 || leaving.aborted ? Promise.reject(error) : { error }));
  const first = history.observations.length === 0;
  holder.replaceChildren(
    changed(session, problem),
    due(shown),
    h("div", { id: "advice", tabindex: -1 }, action === null ? section("Completed", h("p", {}, "Its horizon is reached.")) : action.error ? section(shown.calendar.name(session.period), h("p", { class: "note wrong" }, action.error.message)) : decided(action, problem, { heading: shown.calendar.name(session.period), last: session.horizon })),
    notice,
    action === null ? "" : section(`Report ${shown.calendar.inText(session.period)}`, reporting(shown, action.actions ?? null)),
    figures(shown),
    action?.actions ? section("What if", supposing(shown)) : "",
    action?.actions ? futuresOf(`/sessions/${id}`, leaving, { format: plain, shown: isMoved(problem) }) : "",
    first ? "" : course(shown),
    first ? "" : periods(shown),
  );
}

/** Warns that the noise has changed, if it has. */
function changed({ drift }, { noise: { name } }) {
  if (drift.level === "none") return "";
  const how = drift.level === "alarm" ? "has changed" : "may have changed";
  return h("p", { class: "note wrong" }, `${name} ${how}. If nothing had changed, at most one session in ${count(Math.floor(drift.highest))} would show so clear a sign.`);
}

function figures({ session, history, problem }) {
  const isEarning = (problem.reward ?? null) !== null;
  return h(
    "div",
    { class: "figures" },
    facts([
      ...Object.entries(session.states).map(([name, value]) => [name, plain(value), `${plain(history.initial_state[name])} at the start`]),
      isEarning && ["Earned so far", plain(session.earned), (problem.discount ?? 1) === 1 ? "by the formula" : "by the formula, discounted to the start"],
      [`Values of ${problem.noise.name} known`, count(session.sample_size), `${count(session.period - 1)} of ${count(session.horizon)} periods observed`],
    ]),
  );
}

/** Returns the fields of a period: its noise, the executed actions and the states it led to. `advised` is null if it is that of the time. */
function periodFields({ problem: { noise, actions, states } }, within, advised, date) {
  const isMissing = () => kind.control.value === "missing";
  const seen = input({ within, name: "noise", label: noise.name, note: `What the period brought, ${plain(noise.low)} to ${plain(noise.high)}.` });
  const kind = select({ within, name: "missing", label: "It is", choices: { known: "Known", missing: "Not known" }, changed: () => (seen.control.disabled = isMissing()) });
  const last = dayField(within, date);
  const of = (names, field, label, note) => names.map((name, index) => input({ within: `${within}${index}-`, name: `${field}.${name}`, label: label(name), note: note(name) }));
  const executed = of(Object.keys(actions), "executed", (name) => `${name}, done`, (name) => (advised ? `Blank: ${plain(advised[name])}, as advised.` : "Blank: as advised at that time."));
  const state = of(Object.keys(states), "state", (name) => `${name} after it`, () => "Blank: by the formula.");
  const number = ({ control }) => pointed(control.value);
  const isTyped = ({ control }) => control.value.trim() !== "";
  /** Returns what was typed by name; a blank field is left out, or has the value of `otherwise`. */
  const typed = (fields, names, otherwise) => {
    if (!fields.some(isTyped)) return undefined;
    const values = names.map((name, index) => [name, isTyped(fields[index]) ? number(fields[index]) : otherwise?.[name]]);
    return Object.fromEntries(values.filter(([, value]) => value !== undefined));
  };
  const more = h("details", {}, h("summary", {}, "I did something else, or counted something else"), h("div", { class: "fields" }, [...executed, ...state].map(({ element }) => element)));
  return {
    element: h("div", {}, h("div", { class: "fields" }, [seen, last, kind].map(({ element }) => element)), more),
    fill({ now }) {
      kind.control.value = now.noise === null ? "missing" : "known";
      seen.control.disabled = isMissing();
      seen.control.value = now.noise === null ? "" : String(now.noise);
      last.control.value = now.date ?? "";
      Object.keys(actions).forEach((name, index) => (executed[index].control.value = String(now.executed[name])));
      state.forEach(({ control }) => (control.value = ""));
    },
    report: () => ({
      ...(isMissing() ? { missing: true } : { noise: number(seen) }),
      ...(last.control.value.trim() === "" ? {} : { date: last.control.value.trim() }),
      executed: typed(executed, Object.keys(actions), advised),
      state: typed(state, Object.keys(states)),
    }),
    trouble: () => (isMissing() || isTyped(seen) ? null : { field: "noise", message: `${noise.name} is blank.` }),
  };
}

/** Returns what the advice would be with more or less caution, and after each noise that may come, drawn when it is opened. */
function supposing({ id, session, problem: { actions, noise }, leaving }) {
  const POINTS = 21;
  const drawn = (summary, field, [from, to], x, more) =>
    disclosure(summary, () => {
      const place = h("div", {}, h("p", { class: "note" }, "Solving\u2026"));
      post("/what-if", { session: id, sweep: { [field]: { from, to, points: POINTS } } }, leaving).then(({ points }) => {
        const axis = { ...x, values: points.map((point) => point[field]), domain: [from, to], tick };
        const chart = (title, of) => lineChart({ title, gutter: 64, height: 150, x: axis, y: { format: plain, tick }, series: [{ name: title, kind: "line", values: points.map(of) }] });
        place.replaceChildren(...Object.keys(actions).map((name) => chart(name, (point) => point.actions[name])), ...more(chart));
      }, (error) => leaving.aborted || place.replaceChildren(h("p", { class: "error", role: "alert" }, error.message)));
      return place;
    });
  const times = (value) => `${plain(value)} times the radius`;
  const caution = drawn("With more or less caution", "radius_scale", [0, 2], { label: "Radius, times", format: times, here: times }, (chart) => [chart("Worth under the worst law", (point) => point.value)]);
  if (session.period >= session.horizon) return [caution];
  const came = (value) => `${noise.name} ${plain(value)}`;
  return [caution, drawn(`After each ${noise.name} that may come, in the period after this one`, "noise", [noise.low, noise.high], { label: noise.name, format: came, here: came }, () => [])];
}

/** What a report says, and what stands for its period, in words. */
const words = ({ noise: { name } }) => ({
  typed: ({ noise }) => (noise === undefined ? "a period that is not known" : `${name} ${plain(noise)}`),
  recorded: ({ now }) => (now.noise === null ? "as not known" : `with ${name} ${plain(now.noise)}`),
});

function reporting(shown, advised) {
  const { id, session, problem } = shown;
  const fields = periodFields(shown, "", advised, session.next);
  const message = refusal();
  const button = h("button", { type: "submit" }, `Report ${shown.calendar.inText(session.period)}`);
  const form = h("form", { novalidate: true, "data-needs": "operate" }, fields.element, message, h("p", { class: "send" }, button));
  const compose = () => ({ session: id, period: session.period, ...fields.report() });
  const numbered = (report, count) => ({ ...report, period: report.period + count });
  sendReports(form, { ...shown, button, message, fields, path: "/observe", compose, once: "a period counts once.", numbered, words: words(problem) });
  return form;
}

function correcting(shown) {
  const { id, session, history, problem } = shown;
  const within = "correction-";
  const fields = periodFields(shown, within, null, null);
  const fill = (period) => fields.fill(history.observations[period - 1]);
  const choices = history.observations.map(({ period }) => [period, shown.calendar.name(period)]).reverse();
  const period = select({ within, name: "period", label: "Period", choices, changed: (value) => fill(Number(value)) });
  const place = h("div", {}, fields.element);
  const change = select({ within, name: "change", label: "What is wrong", choices: CHANGES, changed: (value) => (place.hidden = value === "remove") });
  const reason = input({ within, name: "reason", label: "Why", note: "For example: it was counted again.", inputmode: "text", maxlength: 200 });
  fill(history.observations.length);
  const message = refusal();
  const button = h("button", { type: "submit" }, "Correct it");
  const form = correctionFrame([period, change, reason], [place, message], button);
  const compose = () => ({
    correction: session.corrections + 1,
    period: Number(period.control.value),
    reason: reason.control.value,
    change: change.control.value,
    ...(change.control.value === "remove" ? {} : fields.report()),
  });
  const trouble = () => (change.control.value === "remove" ? null : fields.trouble()) ?? unreasoned(reason);
  sendReports(form, { ...shown, button, message, fields: { trouble }, path: `/sessions/${id}/corrections`, compose, once: "a correction counts once.", done: "The period is corrected.", words: words(problem) });
  return form;
}

/** Draws the states after each period, and what was done in it. */
function course({ session, history, problem, calendar }) {
  const { observations } = history;
  const values = Array.from({ length: Math.max(session.horizon, observations.length) + 1 }, (_, k) => k);
  const x = { values, domain: [0, values.length - 1], label: "Period", format: calendar.after, here: calendar.after, tick: calendar.brief, whole: true };
  const row = (k) => observations[k - 1]?.now;
  const chart = (title, kind, of, y = {}, along = {}) =>
    lineChart({ title, gutter: 64, height: 160, x: { ...x, ...along }, y: { format: plain, tick, ...y }, series: [{ name: title, kind, values: values.map(of) }] });
  const bars = (title, of) => chart(title, "bars", of, { also: [0] }, { format: calendar.name, here: calendar.name, between: true });
  return section(
    "So far",
    ...Object.keys(problem.states).map((name) => chart(name, "line", (k) => (k === 0 ? history.initial_state[name] : (row(k)?.state[name] ?? null)))),
    ...Object.keys(problem.actions).map((name) => bars(`${name}, done`, (k) => row(k)?.executed[name] ?? null)),
    bars(problem.noise.name, (k) => row(k)?.noise ?? null),
  );
}

/** Returns the columns of the periods: `[name, value(row)]`. */
const columnsOf = ({ problem: { states, actions, noise, reward } }) => [
  [noise.name, ({ now }) => now.noise],
  ...Object.keys(actions).flatMap((name) => [
    [`${name}, advised`, ({ answered }) => answered?.advised?.[name]],
    [`${name}, done`, ({ now }) => now.executed[name]],
  ]),
  ...((reward ?? null) === null ? [] : [["Earned in it", ({ now }) => now.reward]]),
  ...Object.keys(states).map((name) => [`${name} after it`, ({ now }) => now.state[name]]),
];

function periods(shown) {
  const { id, history, calendar } = shown;
  const columns = columnsOf(shown);
  const number = ([name, of]) => ({ name, numeric: true, cell: (row) => ((of(row) ?? null) === null ? "\u2013" : plain(of(row))) });
  const dates = calendar.dated ? [{ name: "Last day", cell: ({ now }) => (now.date ? day(now.date) : "") }] : [];
  const rows = [...history.observations].reverse();
  const told = table("Observed periods, newest first", [{ name: "Period", cell: ({ period }) => String(period) }, ...dates, ...columns.map(number)], rows);
  const file = () => csvText([["Period", "Last day", ...columns.map(([name]) => name)], ...history.observations.map((row) => [row.period, row.now.date, ...columns.map(([, of]) => of(row))])]);
  const goneOn = [...history.renewals].reverse().map(({ period, policy, renewed_ms }) => h("li", {}, `From ${calendar.inText(period)} on with `, policyLink(policy, true), `, since ${moment(renewed_ms)}`));
  const made = [...history.corrections].reverse().map(({ period, change, reason, corrected_ms }) => h("li", {}, `Period ${period} was ${{ insert: "inserted", remove: "removed" }[change] ?? "corrected"} on ${moment(corrected_ms)}: ${reason}`));
  const fold = disclosure("Correct a period", () => correcting(shown));
  fold.dataset.needs = "operate";
  return section(
    "Periods so far",
    told,
    h("p", { class: "foot" }, h("button", { class: "quiet", onclick: () => save(file(), `session-${short(id)}.csv`, "text/csv") }, "Save as CSV")),
    made.length > 0 ? h("ul", { class: "corrections" }, made) : "",
    goneOn.length > 0 ? h("ul", { class: "renewals" }, goneOn) : "",
    fold,
  );
}
