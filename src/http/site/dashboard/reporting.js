// One return for each of many sessions: typed, pasted or read from a file, reviewed, sent together, with a result for
// each row.

import { advised } from "./advised.js";
import { get, post } from "./api.js";
import { announce, h, section } from "./dom.js";
import { keptFields } from "./draft.js";
import { doubtWords, missingDays, UNCONFIRMED } from "./doubts.js";
import { fileDrop } from "./file_drop.js";
import { area, fieldset, input, pressed, refusal, select } from "./form.js";
import { count, counted } from "./format.js";
import { all } from "./pages.js";
import { unlikeRecorded, unlikeWords } from "./peers.js";
import { dayOf, isoDay, lastEnd } from "./periods.js";
import { finder, HEADS, inUnit, LATELY, lineReader, otherUnit, written } from "./report_lines.js";
import { outcomes, refused, reportPreview } from "./report_tables.js";

/** Most reports that the service accepts in one call. */
const AT_ONCE = 1000;

/** `query`: `sessions=A,B` puts those sessions into the lines. */
export async function view(query, leaving) {
  // A session without wealth is of a declared problem, whose page has its own report.
  const sessions = (await all("/sessions", "sessions", leaving)).filter(({ wealth }) => wealth !== null);
  const asked = (new URLSearchParams(query ?? "").get("sessions") ?? "").split(",");
  const chosen = sessions.filter(({ session }) => asked.includes(session));
  const trail = h("p", { class: "trail" }, h("a", { href: "#/" }, "Overview"));
  return { title: "Report for several", trail, body: reporting(sessions, chosen, leaving, `#/report?${query ?? ""}`) };
}

/** The units of returns without a percent sign, if the page asks. */
const UNITS = { "": "Choose one", percent: "Percent: 1.2 is 1.2 %", fraction: "Fractions: 0.012 is 1.2 %", hundredth: "Hundredths of a percent: 120 is 1.2 %" };

/** Returns `{of(policy), deviation(policy), read(policies)}`: the names of a policy's assets, null for one asset, and the deviation of its
 * record; both undefined until the policy is read. */
function policiesRead(leaving) {
  const [known, deviations] = [new Map(), new Map()];
  const asked = new Set();
  const one = async (policy) => {
    asked.add(policy);
    const { specification } = await get(`/policies/${policy}`, leaving);
    known.set(policy, specification.fund?.assets ?? null);
    deviations.set(policy, deviationOf(specification.problem.history ?? []));
  };
  const read = (policies) => Promise.all(policies.filter((policy) => !asked.has(policy)).map((policy) => one(policy).catch((error) => (asked.delete(policy), Promise.reject(error)))));
  return { of: (policy) => known.get(policy), deviation: (policy) => deviations.get(policy), read };
}

function deviationOf(returns) {
  const mean = returns.reduce((sum, value) => sum + value, 0) / returns.length;
  return Math.sqrt(returns.reduce((sum, value) => sum + (value - mean) ** 2, 0) / returns.length);
}

function reporting(sessions, chosen, leaving, place) {
  const find = finder(sessions);
  const policies = policiesRead(leaving);
  let [rows, header, isOpen] = [[], null, false];
  // The doubts about reports that were sent, by session: the report, the reasons, and whether it is right all the same. Only then, or once it is
  // changed, a report is sent again.
  const doubted = new Map();
  const doubtOf = ({ entry, report, trouble }) => {
    const doubt = trouble === null ? doubted.get(entry.session) : undefined;
    return doubt?.report === said(report) ? doubt : null;
  };
  const lines = area({
    name: "lines",
    label: "Sessions and their returns, %",
    note: `One line for each session: its name or identifier, then its return, as in \u201cAda 1.2\u201d. \u22122.5 is a loss of 2.5 %. Or a table with a header, its columns in any order: ${HEADS.join(", ")}. A column with the name of an asset holds its return; add \u201cheld\u201d to the name for its share.`,
    rows: 8,
    value: chosen.map((entry) => written(find, entry)).join("\n"),
    changed: () => soon(),
  });
  const drop = fileDrop(lines.control.id, (text) => {
    lines.control.value = text;
    look();
  });
  const common = input({ name: "common", label: "Return of lines without one, %", note: "For lines that only name a session. May be blank.", unit: "percent", changed: () => soon() });
  const date = input({ name: "date", label: "Last day", note: "For lines without a date, for example 2008-09-30. May be blank.", inputmode: "text", value: likelyDay(chosen.length > 0 ? chosen : sessions, isoDay(new Date())) ?? "", changed: () => soon() });
  const [next, again] = tick("next", "For sessions reported within the last hour, this is the next period", () => lookAnew());
  const unit = select({ name: "unit", label: "These returns are", choices: UNITS, changed: () => look() });
  const unitWords = h("p", { class: "note wrong" });
  const doubt = h("div", { hidden: true, role: "group" }, unitWords, unit.element);
  const preview = reportPreview((entry, isRight) => {
    doubted.set(entry.session, { ...doubted.get(entry.session), isRight });
    look();
  });
  const standing = h("p", { class: "sentence", role: "status" });
  const outcome = h("div", {});
  const message = refusal();
  const button = h("button", { type: "submit" }, "Report");
  const isLate = ({ last_report_ms }) => Boolean(last_report_ms) && Date.now() - last_report_ms < LATELY;
  const say = (words) => {
    message.hidden = false;
    message.textContent = words;
  };
  const readers = Object.fromEntries(Object.keys(UNITS).filter(Boolean).map((unit) => [unit, lineReader(find, { assetsOf: policies.of, lately: (entry) => !next.checked && isLate(entry), unit })]));
  const lookAnew = () => {
    for (const reader of Object.values(readers)) reader.forget();
    look();
  };
  const look = (isTyping = false) => {
    const of = (control, read) => (control.value.trim() === "" ? undefined : (read(control.value.trim()) ?? undefined));
    const terms = (unit) => ({ simple_return: of(common.control, inUnit(unit)), date: of(date.control, (text) => dayOf(text) ?? text) });
    const text = lines.control.value;
    const as = (unit) => readers[unit].read(text, terms(unit));
    const percents = as("percent");
    const seems = otherUnit(percents.rows, (entry) => entry.deviation ?? policies.deviation(entry.policy));
    if (seems === null) unit.control.value = "";
    doubt.hidden = seems === null;
    unitWords.textContent = seems === null ? "" : DOUBTS[seems];
    const read = unit.control.value === "" ? percents : as(unit.control.value);
    rows = read.rows.map((row) => {
      const doubt = doubtOf(row);
      return doubt ? { ...row, doubt, trouble: doubt.isRight ? null : `${doubt.reasons} Change it, or tick that it is right.` } : row;
    });
    header = read.header;
    again.hidden = !rows.some(({ entry, report }) => entry && isLate(entry) && !report.date && report.period === undefined);
    const ready = rows.filter(({ trouble }) => trouble === null).length;
    isOpen = seems !== null && unit.control.value === "";
    button.disabled = ready === 0 || isOpen;
    button.textContent = ready === 0 ? "Report" : `Report for ${count(ready)}`;
    const words = rows.length > 0 ? readyWords(ready, rows.length - ready) : "";
    if (standing.textContent !== words) standing.textContent = words;
    const named = new Set(rows.map(({ entry }) => entry?.session));
    const left = sessions.filter(({ session, state }) => state === "active" && !named.has(session));
    preview.show({ rows, unread: read.unread, left }, isTyping);
    const unknown = [...new Set(rows.flatMap(({ entry }) => (entry && policies.of(entry.policy) === undefined ? [entry.policy] : [])))];
    if (unknown.length > 0) policies.read(unknown).then((found) => found.length > 0 && lookAnew(), (error) => leaving.aborted || say(error.message));
  };
  // A browser may send the input events of a pasted text line by line.
  let waiting = 0;
  const soon = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => look(true));
  };
  /** Doubts the reports that differ from those of other sessions with the policy and day, and returns the rows that may be sent. */
  const judged = (ready) => {
    const unasked = ready.filter(({ doubt }) => !doubt);
    const reports = unasked.map(({ entry, report }) => ({ ...entry, date: report.date, ...logReturns(report) }));
    const unlike = new Map(unlikeRecorded(reports, sessions).map((one) => [one.entry.session, one]));
    for (const { entry, report } of unasked) {
      const one = unlike.get(entry.session);
      if (one) doubted.set(entry.session, { report: said(report), reasons: unlikeWords(one), isRight: false, isOfPage: true });
    }
    return ready.filter(({ entry }) => !unlike.has(entry.session));
  };
  const send = async () => {
    message.hidden = true;
    const sent = judged(rows.filter(({ trouble }) => trouble === null));
    // The service has not doubted what only the page asked about.
    const reports = sent.map(({ entry, report, doubt }) => ({ session: entry.session, period: entry.period, ...report, ...(doubt && !doubt.isOfPage ? { confirm: true } : {}) }));
    const told = [];
    const recorded = new Set();
    try {
      for (let start = 0; start < reports.length; start += AT_ONCE) {
        const answers = await post("/observe", reports.slice(start, start + AT_ONCE));
        for (const [index, answer] of answers.entries()) {
          const row = sent[start + index];
          told.push({ ...row, answer });
          if (answer.status === 404) row.entry.state = "deleted";
          doubted.delete(row.entry.session);
          if (answer.problem?.type === UNCONFIRMED) doubted.set(row.entry.session, { report: said(row.report), reasons: doubtWords(answer.problem).join(" "), isRight: false });
          if (answer.status !== 200) continue;
          recorded.add(row);
          follow(row.entry, row.report, answer);
        }
      }
    } finally {
      // Unrecorded lines stay for another try, even if a later call failed.
      const left = rows.filter((row) => !recorded.has(row)).map(({ text }) => text);
      lines.control.value = (left.length > 0 && header !== null ? [header, ...left] : left).join("\n");
      next.checked = false;
      lookAnew();
      if (left.length > 0) drafts.keep();
      else drafts.settle();
    }
    const failed = told.filter(({ answer }) => answer.status !== 200);
    const words = `${counted(told.length - failed.length, "return is", "returns are")} recorded${rows.length > 0 ? `, and ${count(rows.length)} left above to try again` : ""}.`;
    const heading = h("p", { class: "sentence", tabindex: -1 }, words);
    outcome.replaceChildren(section("Results", heading, filling(failed), outcomes(told, advised(leaving))));
    heading.focus();
    announce(words);
  };
  /** Reports the missing periods as missing, one of each session at a time, then sends the reports after them. */
  const fill = async (gaps) => {
    const most = Math.max(...gaps.map(({ days }) => days.length));
    for (let index = 0; index < most; index += 1) {
      const some = gaps.filter(({ days }) => days.length > index);
      for (let start = 0; start < some.length; start += AT_ONCE) {
        const part = some.slice(start, start + AT_ONCE);
        const answers = await post("/observe", part.map(({ entry, first, days }) => ({ session: entry.session, period: first + index, missing: true, date: days[index] })));
        const wrong = answers.find(({ status }) => status !== 200);
        for (const [place, answer] of answers.entries()) if (answer.status === 200) follow(part[place].entry, {}, answer);
        if (wrong) throw new Error(refused(wrong.problem));
      }
    }
    for (const { entry } of gaps) doubted.delete(entry.session);
    lookAnew();
    await send();
  };
  const filling = (failed) => {
    const gaps = failed.filter(({ answer }) => answer.problem.type === UNCONFIRMED).map(({ entry, answer }) => ({ entry, first: answer.period, days: missingDays(answer.problem) })).filter(({ days }) => days.length > 0);
    if (gaps.length === 0) return "";
    const all = gaps.reduce((sum, { days }) => sum + days.length, 0);
    const words = `Report the ${counted(all, "missing period")} of ${counted(gaps.length, "session")} as missing, then the rest`;
    return h("p", { class: "send" }, h("button", { type: "button", onclick: ({ target }) => pressed(target, () => fill(gaps), ({ message }) => message) }, words));
  };
  const form = h(
    "form",
    { novalidate: true },
    fieldset("The period that ended", [date, common, again]),
    h("fieldset", {}, h("legend", {}, "The sessions"), drop, lines.element, doubt, standing),
    h("div", { class: "reading" }, h("div", {}, preview.element, message), h("div", { class: "send held" }, button)),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    if (!preview.isInSight()) return preview.element.scrollIntoView();
    button.disabled = true;
    await send().catch((error) => {
      say(error.passing ? `${error.message} Sending it again is safe: a period counts once.` : error.message);
      message.focus();
    });
    button.disabled = isOpen || !rows.some(({ trouble }) => trouble === null);
  });
  const drafts = keptFields(form, place);
  look();
  drafts.restore();
  const anew = () => dispatchEvent(new HashChangeEvent("hashchange"));
  return [drafts.isKept ? drafts.note(anew) : "", form, outcome];
}

/** The reasons to ask for the unit. */
const DOUBTS = {
  fraction: "Read as percent, all of these returns are less than a twentieth of the usual variation in the records of their sessions. Are they fractions?",
  hundredth: "Read as percent, most of these returns are more than ten times the usual variation in the records of their sessions. What unit are they in?",
};

/** Returns `[box, element]`: a checkbox with its text, hidden at first. */
function tick(name, words, changed) {
  const box = h("input", { type: "checkbox", name, onchange: changed ?? null });
  return [box, h("div", { class: "field checks", hidden: true }, h("label", {}, box, words))];
}

const readyWords = (ready, bad) => `${counted(ready, "return is", "returns are")} ready${bad > 0 ? `, and ${counted(bad, "line is", "lines are")} not` : ""}.`;

/** Returns the log-returns of a report as a row of the sessions has them. */
const logReturns = ({ simple_return, simple_returns }) => ({
  log_return: typeof simple_return === "number" ? Math.log1p(simple_return) : null,
  log_returns: simple_returns && Object.fromEntries(Object.entries(simple_returns).map(([asset, value]) => [asset, Math.log1p(value)])),
});

/** Returns the key of a report, to tell whether it was changed. */
const said = (report) => JSON.stringify(Object.entries(report).sort());

/** Updates a session after an answer. */
const follow = (entry, report, { period, answer: { wealth, date, completed } }) =>
  Object.assign(entry, logReturns(report), { period: Math.max(entry.period, period + 1), wealth, date, last_report_ms: Date.now(), state: completed ? "completed" : entry.state });

/** Returns the next date of most sessions that is not in the future; sessions without dates count with the end of the last period. */
function likelyDay(sessions, today) {
  const counts = new Map();
  for (const { state, date, next, periods_per_year } of sessions) {
    const day = state !== "active" ? null : date ? next : lastEnd(periods_per_year, today);
    if (day && day <= today) counts.set(day, (counts.get(day) ?? 0) + 1);
  }
  return [...counts].sort(([one, some], [other, more]) => more - some || (one < other ? 1 : -1))[0]?.[0] ?? null;
}
