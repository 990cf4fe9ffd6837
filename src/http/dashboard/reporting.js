// One return for many sessions at once: typed or pasted by name, looked over, sent together, and told row by row.

import { post } from "./api.js";
import { announce, h, section, table } from "./dom.js";
import { area, fieldset, input } from "./form.js";
import { count, counted, percent, short } from "./format.js";
import { headed } from "./naming.js";
import { fraction } from "./number_text.js";
import { all } from "./pages.js";
import { problemWords, unusualWords } from "./problem_words.js";

/** The service takes so many reports in one call. */
const AT_ONCE = 1000;
/** So much of an identifier tells whose it is. */
const LEAST = 6;

/** `query`: `sessions=A,B` puts those into the table. */
export async function view(query, leaving) {
  const sessions = await all("/sessions", "sessions", leaving);
  const asked = (new URLSearchParams(query ?? "").get("sessions") ?? "").split(",");
  const chosen = sessions.filter(({ session }) => asked.includes(session));
  const trail = h("p", { class: "trail" }, h("a", { href: "#/" }, "Overview"));
  return { title: "Report for several", trail, body: reporting(sessions, chosen) };
}

/** What a session is written as: its name, where no other has it. */
const written = (sessions, { session, name }) => (name && sessions.filter((other) => same(other.name, name)).length === 1 ? name : short(session));

const same = (one, other) => one.trim().toLowerCase() === other.trim().toLowerCase();

/** The sessions that a text names. */
function named(sessions, text) {
  const byName = sessions.filter(({ name }) => name && same(name, text));
  if (byName.length > 0) return byName;
  const id = text.trim().toLowerCase();
  return id.length < LEAST ? [] : sessions.filter(({ session }) => session === id || short(session) === id || session.replace(/^session_/, "").startsWith(id));
}

/** The ways in which a line may be a name and a number, the likeliest first. */
const SPLITS = [/^(.*)[\t;]\s*([^\t;]*)$/, /^(.*)\s([^\s]+(?:\s*%)?)$/, /^([^,]*),(.*)$/];

/** A line as `{line, found, back, trouble}`: the sessions found, the return as a fraction, and what is wrong. `common` is the return of those
 * that have none of their own, or null. */
export function readLine(line, sessions, common) {
  const told = (found, back) => {
    if (found.length > 1) return { line, back, trouble: `${found.length} sessions are called so: write the identifier` };
    const [entry] = found;
    const trouble = entry.state === "completed" ? "has reached its end" : back === null ? "has no return" : null;
    return { line, entry, back, trouble };
  };
  const whole = named(sessions, line);
  if (whole.length > 0) return told(whole, common);
  const parts = SPLITS.map((split) => split.exec(line)).filter(Boolean).map(([, name, number]) => [name.replace(/[,;:\s]+$/, ""), number.trim()]);
  const numbered = parts.find(([, number]) => number !== "" && fraction(number) !== null);
  const known = parts.find(([name]) => named(sessions, name).length > 0);
  if (numbered) {
    const found = named(sessions, numbered[0]);
    return found.length > 0 ? told(found, fraction(numbered[1])) : { line, back: fraction(numbered[1]), trouble: `no session is called \u201c${numbered[0]}\u201d` };
  }
  if (known) {
    const [name, number] = known;
    return number === "" ? told(named(sessions, name), common) : { ...told(named(sessions, name), null), trouble: `\u201c${number}\u201d is not a number of percent` };
  }
  return { line, back: null, trouble: `no session is called \u201c${line}\u201d` };
}

/** The lines of a text. Of a session that is named twice neither line is taken: nobody can know which is meant. */
export function readLines(text, sessions, common) {
  const rows = text.split("\n").map((line) => line.trim()).filter(Boolean).map((line) => readLine(line, sessions, common));
  const times = new Map();
  for (const { entry } of rows) if (entry) times.set(entry.session, (times.get(entry.session) ?? 0) + 1);
  return rows.map((row) => (row.entry && times.get(row.entry.session) > 1 ? { ...row, trouble: "is named twice" } : row));
}

function reporting(sessions, chosen) {
  let rows = [];
  // The returns that were last refused as unusual, by session: those alone can be meant.
  let unusual = new Map();
  const lines = area({
    name: "lines",
    label: "Sessions and their returns, %",
    note: "A line for each: its name or identifier, and its return, as in \u201cAda 1.2\u201d or pasted from a spreadsheet. \u22122.5 is a loss of 2.5 %.",
    rows: 8,
    value: chosen.map((entry) => written(sessions, entry)).join("\n"),
    changed: () => look(),
  });
  const common = input({ name: "common", label: "Return of the others, %", note: "Of those that have none of their own. May be blank.", unit: "percent", changed: () => look() });
  const date = input({ name: "date", label: "Last day", note: "Of all, such as 2008-09-30. May be blank.", inputmode: "text" });
  const meant = h("input", { type: "checkbox", name: "confirm" });
  const sure = h("div", { class: "field checks", hidden: true }, h("label", {}, meant, "The returns are meant, however unusual"));
  const preview = h("div", {});
  const outcome = h("div", {});
  const message = h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });
  const button = h("button", { type: "submit" }, "Report");
  const look = () => {
    const text = common.control.value.trim();
    rows = readLines(lines.control.value, sessions, text === "" ? null : fraction(text));
    const ready = rows.filter(({ trouble }) => trouble === null).length;
    button.disabled = ready === 0;
    button.textContent = ready === 0 ? "Report" : `Report for ${count(ready)}`;
    preview.replaceChildren(rows.length > 0 ? section("Who gets what", looked(rows, ready), previewed(rows)) : "");
  };
  const send = async () => {
    message.hidden = true;
    const sent = rows.filter(({ trouble }) => trouble === null);
    const day = date.control.value.trim();
    const reports = sent.map(({ entry, back }) => ({
      session: entry.session,
      period: entry.period,
      simple_return: back,
      ...(day ? { date: day } : {}),
      ...(meant.checked && unusual.get(entry.session) === back ? { confirm: true } : {}),
    }));
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
          Object.assign(row.entry, { period: answer.period + 1, wealth: answer.answer.wealth, state: answer.answer.completed ? "completed" : row.entry.state });
        }
      }
    } finally {
      // What is not recorded stays for another try, also where a later list was not answered.
      lines.control.value = rows.filter((row) => !recorded.has(row)).map(({ line }) => line).join("\n");
      look();
    }
    const left = rows;
    const failed = told.filter(({ answer }) => answer.status !== 200);
    const odd = failed.filter(({ answer }) => answer.problem.type === "/problems/unusual-return");
    unusual = new Map(odd.map(({ entry, back }) => [entry.session, back]));
    meant.checked = false;
    sure.hidden = odd.length === 0;
    const words = `${counted(told.length - failed.length, "return is", "returns are")} recorded${left.length > 0 ? `, and ${count(left.length)} left above for another try` : ""}.`;
    const heading = h("p", { class: "sentence", tabindex: -1 }, words);
    outcome.replaceChildren(section("What came of it", heading, outcomes(told)));
    heading.focus();
    announce(words);
  };
  const form = h(
    "form",
    { novalidate: true },
    fieldset("The period that ended", [date, common, sure]),
    h("fieldset", {}, h("legend", {}, "Who"), lines.element),
    preview,
    message,
    h("p", { class: "send" }, button),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (button.disabled) return;
    button.disabled = true;
    try {
      await send();
    } catch (error) {
      message.hidden = false;
      message.textContent = error.passing ? `${error.message} Sending it again is safe: a period counts once.` : error.message;
      message.focus();
      button.disabled = false;
    }
  });
  look();
  return [form, outcome];
}

function looked(rows, ready) {
  const wrong = rows.length - ready;
  return h("p", { class: "sentence", role: "status" }, `${counted(ready, "return is", "returns are")} ready${wrong > 0 ? `, and ${counted(wrong, "line is", "lines are")} not` : ""}.`);
}

const who = ({ entry, line }) => (entry ? headed(`#/sessions/${entry.session}`, entry.session, entry.name) : line);

const previewed = (rows) =>
  table("Returns to report", [
    { name: "Session", cell: who },
    { name: "Period", numeric: true, cell: ({ entry }) => (entry ? count(entry.period) : "\u2013") },
    { name: "Return", numeric: true, cell: ({ back }) => percent(back, 2) },
    { name: "Ready", cell: ({ trouble }) => (trouble ? h("span", { class: "under wrong" }, trouble) : "yes") },
  ], rows);

const outcomes = (told) =>
  table("Outcomes", [
    { name: "Session", cell: who },
    { name: "Return", numeric: true, cell: ({ back }) => percent(back, 2) },
    { name: "Outcome", cell: ({ answer }) => (answer.status === 200 ? `recorded as period ${count(answer.period)}` : h("span", { class: "under wrong" }, refused(answer.problem))) },
  ], told);

/** What the fields of a report are called here, and their units. */
const FIELDS = { simple_return: ["The return", "percent"], date: ["The last day"] };

/** Why a report was refused, in the words and the unit of the form. */
function refused({ type, title, detail, field, value, rule }) {
  if (type === "/problems/unusual-return") return unusualWords({ field, rule });
  return field in FIELDS && rule ? problemWords({ value, rule }, ...FIELDS[field]) : (detail ?? title);
}
