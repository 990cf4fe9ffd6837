// One return for each of many sessions: typed, pasted or read from a file, reviewed, sent together, with a result for
// each row.

import { advised } from "./advised.js";
import { get, post } from "./api.js";
import { announce, disclosure, h, section, table } from "./dom.js";
import { keptFields } from "./draft.js";
import { doubtWords, missingDays, UNCONFIRMED } from "./doubts.js";
import { fileDrop } from "./file_drop.js";
import { area, fieldset, input, pressed, refusal, select } from "./form.js";
import { count, counted, percent, wealth } from "./format.js";
import { called, headed } from "./naming.js";
import { all, firstOf } from "./pages.js";
import { dayOf, isoDay, lastEnd } from "./periods.js";
import { problemWords } from "./problem_words.js";
import { finder, HEADS, inUnit, LATELY, otherUnit, readLines, written } from "./report_lines.js";

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
  // The reports doubted in the last list, by session: only these can be confirmed, and unchanged they are sent only if confirmed.
  const doubted = new Map();
  const isDoubted = ({ entry, report }) => doubted.get(entry.session) === said(report);
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
  const common = input({ name: "common", label: "Return of the others, %", note: "For sessions without a return of their own. May be blank.", unit: "percent", changed: () => soon() });
  const date = input({ name: "date", label: "Last day", note: "For lines without a date, for example 2008-09-30. May be blank.", inputmode: "text", value: likelyDay(chosen.length > 0 ? chosen : sessions, isoDay(new Date())) ?? "", changed: () => soon() });
  const [meant, sure] = tick("confirm", "The doubted returns are right", () => look());
  const [next, again] = tick("next", "For sessions reported within the last hour, this is the next period", () => look());
  const unit = select({ name: "unit", label: "These returns are", choices: UNITS, changed: () => look() });
  const unitWords = h("p", { class: "note wrong" });
  const doubt = h("div", { hidden: true, role: "group" }, unitWords, unit.element);
  const preview = h("div", {});
  const standing = h("div", {});
  const outcome = h("div", {});
  const message = refusal();
  const button = h("button", { type: "submit" }, "Report");
  const isLate = ({ last_report_ms }) => Boolean(last_report_ms) && Date.now() - last_report_ms < LATELY;
  const say = (words) => {
    message.hidden = false;
    message.textContent = words;
  };
  const look = () => {
    const of = (control, read) => (control.value.trim() === "" ? undefined : (read(control.value.trim()) ?? undefined));
    const terms = (unit) => ({ simple_return: of(common.control, inUnit(unit)), date: of(date.control, (text) => dayOf(text) ?? text) });
    const as = (unit) => readLines(lines.control.value, find, terms(unit), { assetsOf: policies.of, lately: (entry) => !next.checked && isLate(entry), unit });
    const seems = otherUnit(as("percent").rows, (entry) => entry.deviation ?? policies.deviation(entry.policy));
    if (seems === null) unit.control.value = "";
    doubt.hidden = seems === null;
    unitWords.textContent = seems === null ? "" : DOUBTS[seems];
    const read = as(unit.control.value || "percent");
    const held = (row) => row.trouble === null && !meant.checked && isDoubted(row);
    rows = read.rows.map((row) => (held(row) ? { ...row, trouble: "is doubted: change it, or tick above that it is right" } : row));
    header = read.header;
    sure.hidden = !rows.some((row) => row.entry && isDoubted(row));
    again.hidden = !rows.some(({ entry, report }) => entry && isLate(entry) && !report.date && report.period === undefined);
    const ready = rows.filter(({ trouble }) => trouble === null).length;
    isOpen = seems !== null && unit.control.value === "";
    button.disabled = ready === 0 || isOpen;
    button.textContent = ready === 0 ? "Report" : `Report for ${count(ready)}`;
    standing.replaceChildren(rows.length > 0 ? looked(rows, ready) : "");
    const isUnfolded = preview.querySelector("details")?.open === true;
    const missing = withoutLine(sessions, rows);
    if (missing !== "") missing.open = isUnfolded;
    preview.replaceChildren(rows.length > 0 ? section("What will be reported", leftOut(read.unread), missing, previewed(rows)) : "");
    const unknown = [...new Set(rows.flatMap(({ entry }) => (entry && policies.of(entry.policy) === undefined ? [entry.policy] : [])))];
    if (unknown.length > 0) policies.read(unknown).then((found) => found.length > 0 && look(), (error) => leaving.aborted || say(error.message));
  };
  // A browser may send the input events of a pasted text line by line.
  let waiting = 0;
  const soon = () => {
    clearTimeout(waiting);
    waiting = setTimeout(look);
  };
  const send = async () => {
    message.hidden = true;
    const sent = rows.filter(({ trouble }) => trouble === null);
    const reports = sent.map(({ entry, report }) => {
      const isMeant = meant.checked && isDoubted({ entry, report });
      return { session: entry.session, period: entry.period, ...report, ...(isMeant ? { confirm: true } : {}) };
    });
    for (const { entry } of sent) doubted.delete(entry.session);
    const told = [];
    const recorded = new Set();
    try {
      for (let start = 0; start < reports.length; start += AT_ONCE) {
        const answers = await post("/observe", reports.slice(start, start + AT_ONCE));
        for (const [index, answer] of answers.entries()) {
          const row = sent[start + index];
          told.push({ ...row, answer });
          if (answer.status !== 200) continue;
          recorded.add(row);
          follow(row.entry, answer);
        }
      }
    } finally {
      // Unrecorded lines stay for another try, even if a later call failed.
      const left = rows.filter((row) => !recorded.has(row)).map(({ text }) => text);
      lines.control.value = (left.length > 0 && header !== null ? [header, ...left] : left).join("\n");
      next.checked = false;
      meant.checked = false;
      for (const { entry, report, answer } of told) if (answer.problem?.type === UNCONFIRMED) doubted.set(entry.session, said(report));
      look();
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
        for (const [place, answer] of answers.entries()) if (answer.status === 200) follow(part[place].entry, answer);
        if (wrong) throw new Error(refused(wrong.problem));
      }
    }
    for (const { entry } of gaps) doubted.delete(entry.session);
    look();
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
    fieldset("The period that ended", [date, common, sure, again]),
    h("fieldset", {}, h("legend", {}, "The sessions"), drop, lines.element, doubt),
    preview,
    message,
    h("div", { class: "send held" }, standing, button),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
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

function looked(rows, ready) {
  const bad = rows.length - ready;
  return h("p", { class: "sentence", role: "status" }, `${counted(ready, "return is", "returns are")} ready${bad > 0 ? `, and ${counted(bad, "line is", "lines are")} not` : ""}.`);
}

/** Lists the active sessions without a row, which may have been left out by mistake. */
function withoutLine(sessions, rows) {
  const named = new Set(rows.map(({ entry }) => entry?.session));
  const left = sessions.filter(({ session, state }) => state === "active" && !named.has(session));
  if (left.length === 0) return "";
  const names = () => h("p", { class: "note" }, left.map(({ session, name }, index) => [index > 0 ? ", " : "", h("a", { href: `#/sessions/${session}` }, called(session, name))]));
  return disclosure(`${counted(left.length, "active session")} ${left.length === 1 ? "has" : "have"} no line`, names);
}

/** Says which columns are ignored, and which names are read. */
function leftOut(columns) {
  if (columns.length === 0) return "";
  const names = columns.map((name) => `\u201c${name}\u201d`).join(", ");
  return h("p", { class: "note wrong" }, `Nothing is read from ${columns.length === 1 ? "the column" : "the columns"} ${names}. Use the names ${HEADS.join(", ")} or the name of an asset of these sessions, each once.`);
}

/** Returns the key of a report, to tell whether it was changed. */
const said = ({ simple_return, simple_returns, date }) => JSON.stringify([simple_return, simple_returns, date]);

/** Updates a session after an answer. */
const follow = (entry, { period, answer: { wealth, date, completed } }) =>
  Object.assign(entry, { period: Math.max(entry.period, period + 1), wealth, date, last_report_ms: Date.now(), state: completed ? "completed" : entry.state });

/** Returns the next date of most sessions that is not in the future; sessions without dates count with the end of the last period. */
function likelyDay(sessions, today) {
  const counts = new Map();
  for (const { state, date, next, periods_per_year } of sessions) {
    const day = state !== "active" ? null : date ? next : lastEnd(periods_per_year, today);
    if (day && day <= today) counts.set(day, (counts.get(day) ?? 0) + 1);
  }
  return [...counts].sort(([one, some], [other, more]) => more - some || (one < other ? 1 : -1))[0]?.[0] ?? null;
}

const who = ({ entry, text }) => (entry ? headed(`#/sessions/${entry.session}`, entry.session, entry.name) : text);

const byName = (shares, digits) => Object.entries(shares).map(([name, share]) => h("span", { class: "line-of-two" }, `${name} ${percent(share, digits)}`));

const returned = ({ report }) => (report.simple_returns ? byName(report.simple_returns, 2) : percent(report.simple_return, 2));

/** Returns the other fields of a row. */
function besides({ report }) {
  const { executed_allocation, executed_allocations, rate, flow, wealth: reached, date } = report;
  const words = [
    executed_allocation !== undefined && `${percent(executed_allocation)} held`,
    rate !== undefined && `the bank paid ${percent(rate, 3)}`,
    flow !== undefined && `${wealth(Math.abs(flow))} ${flow < 0 ? "withdrawn" : "added"}`,
    reached !== undefined && `wealth ${wealth(reached)}`,
    date && `to ${date}`,
  ].filter(Boolean);
  return [words.join(", "), executed_allocations ? byName(executed_allocations, 1).map((line) => (line.append(" held"), line)) : null];
}

const isBeside = ({ report }) => Object.keys(report).some((name) => !["simple_return", "simple_returns", "period"].includes(name));

/** Most rows drawn at once, because the list is drawn again at every letter. */
const DRAWN = 100;

const firstFew = (rows, draw) => {
  const { holder, all } = firstOf(rows, DRAWN, draw);
  return [holder, all && h("p", { class: "foot" }, all)];
};

/** Lines that cannot be sent stand first, each with the reason below the name. */
const previewed = (rows) =>
  firstFew([...rows].sort((one, other) => Number(one.trouble === null) - Number(other.trouble === null)), (some) => table("Returns to report", [
    { name: "Session", cell: (row) => [h("div", { class: "said" }, who(row)), row.trouble ? wrongLine(row.line, row.trouble) : null] },
    { name: "Period", numeric: true, cell: ({ entry, report }) => (entry ? count(report.period ?? entry.period) : "\u2013") },
    { name: "Return", numeric: true, cell: returned },
    ...(rows.some(isBeside) ? [{ name: "Also", cell: besides }] : []),
  ], some));

const outcomes = (told, advice) => {
  const isRecorded = ({ answer }) => answer.status === 200;
  const now = (name) => (row) => (isRecorded(row) ? advice.of(row.entry)[name] : "\u2013");
  const failedFirst = [...told].sort((one, other) => Number(isRecorded(one)) - Number(isRecorded(other)));
  return firstFew(failedFirst, (some) => table("Outcomes", [
    { name: "Session", cell: who },
    { name: "Return", numeric: true, cell: returned },
    { name: "Outcome", cell: ({ line, answer }) => (answer.status === 200 ? `recorded as period ${count(answer.period)}` : wrongLine(line, refused(answer.problem))) },
    { name: "To hold", numeric: true, cell: now("hold") },
    { name: "To trade", numeric: true, cell: now("trade") },
  ], some));
};

const wrongLine = (line, words) => h("span", { class: "under wrong" }, `Line ${count(line)}: ${words}`);

/** The names of a report's fields on this page, and their units. */
const FIELDS = {
  simple_return: ["The return", "percent"],
  simple_returns: ["The return", "percent"],
  executed_allocation: ["The share held", "percent"],
  executed_allocations: ["The share held", "percent"],
  rate: ["What the bank paid", "percent"],
  flow: ["The money added"],
  wealth: ["The wealth reached"],
  date: ["The last day"],
};

/** Says why a report was refused, in the words and the unit of the form. */
function refused(problem) {
  const { type, title, detail, field, value, rule } = problem;
  if (type === UNCONFIRMED) return doubtWords(problem).join(" ");
  const [name, asset] = (field ?? "").split(/\.(.*)/);
  if (!(name in FIELDS) || !rule) return detail ?? title;
  const [label, unit] = FIELDS[name];
  return problemWords({ value, rule }, asset ? `${label} of ${asset}` : label, unit);
}
