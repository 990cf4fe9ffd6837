// The reports of a list before they are sent and after: a row for each line, with what is wrong with it.

import { GONE, WAS_DELETED } from "./api.js";
import { disclosure, h, section, table } from "./dom.js";
import { doubtWords, UNCONFIRMED } from "./doubts.js";
import { count, counted, percent } from "./format.js";
import { inCurrency } from "./money.js";
import { called, headed } from "./naming.js";
import { firstOf } from "./pages.js";
import { problemWords } from "./problem_words.js";
import { HEADS } from "./report_lines.js";

/** Lists the active sessions without a row, which may have been left out by mistake. */
function withoutLine(left) {
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

const who = ({ entry, text }) => (entry ? headed(`#/sessions/${entry.session}`, entry.session, entry.name) : text);

const byName = (shares, digits) => Object.entries(shares).map(([name, share]) => h("span", { class: "line-of-two" }, `${name} ${percent(share, digits)}`));

const returned = ({ report }) => (report.simple_returns ? byName(report.simple_returns, 2) : percent(report.simple_return, 2));

/** Returns the other fields of a row. */
function besides({ report }) {
  const { executed_allocation, executed_allocations, rate, flow, wealth: reached, date } = report;
  const words = [
    executed_allocation !== undefined && `${percent(executed_allocation)} held`,
    rate !== undefined && `the bank paid ${percent(rate, 3)}`,
    flow !== undefined && `${inCurrency(Math.abs(flow))} ${flow < 0 ? "withdrawn" : "added"}`,
    reached !== undefined && `wealth ${inCurrency(reached)}`,
    date && `to ${date}`,
  ].filter(Boolean);
  return [words.join(", "), executed_allocations ? byName(executed_allocations, 1).map((line) => (line.append(" held"), line)) : null];
}

const isBeside = ({ report }) => Object.keys(report).some((name) => !["simple_return", "simple_returns", "period"].includes(name));

/** Most rows drawn at once. */
const DRAWN = 100;
/** Pause in typing before a long list is drawn again, in milliseconds. */
const PAUSE = 200;

const firstFew = (rows, draw, now) => {
  const { holder, all } = firstOf(rows, DRAWN, draw, now);
  return [holder, all && h("p", { class: "foot" }, all)];
};

/** Shows the reasons to doubt a row, and a tick that it is right all the same. */
function doubtful({ line, entry, doubt, trouble }, sure) {
  const box = h("input", { type: "checkbox", name: `sure.${entry.session}`, "aria-label": `It is right: ${called(entry.session, entry.name)}`, onchange: () => sure(entry, box.checked) });
  box.checked = doubt.isRight;
  return [trouble === null ? h("span", { class: "under" }, lineWords(line, doubt.reasons)) : wrongLine(line, trouble), h("div", { class: "checks" }, h("label", {}, box, "It is right"))];
}

const reason = (row, sure) => (row.doubt ? doubtful(row, sure) : row.trouble ? wrongLine(row.line, row.trouble) : null);

const previewed = (rows, now, sure) =>
  firstFew(rows, (some) => table("Returns to report", [
    { name: "Session", cell: (row) => [h("div", { class: "said" }, who(row)), reason(row, sure)] },
    { name: "Period", numeric: true, cell: ({ entry, report }) => (entry ? count(report.period ?? entry.period) : "\u2013") },
    { name: "Return", numeric: true, cell: returned },
    ...(some.some(isBeside) ? [{ name: "Also", cell: besides }] : []),
  ], some), now);

/** Returns `{element, isInSight(), show(reports, isTyping)}`, which shows what will be reported: lines that cannot be sent first, each with the reason below
 * the name; the columns that are ignored; and the sessions that are left out. `reports` is `{rows, unread, left}`. A long list is drawn again
 * in a pause of typing, and only if what is in sight changed. A doubted row keeps its place, and `sure(entry, isRight)` is told of its tick. */
export function reportPreview(sure) {
  const element = h("div", {});
  let [ordered, drawn, waiting] = [[], "", 0];
  const draw = ({ unread, left }) => {
    const isWhole = element.querySelectorAll("tbody tr").length > DRAWN;
    const now = JSON.stringify([ordered.length, unread, left.map(({ session }) => session), ordered.slice(0, DRAWN)]);
    if (now === drawn && !isWhole) return;
    drawn = now;
    const missing = withoutLine(left);
    if (missing !== "") missing.open = element.querySelector("details")?.open === true;
    const focused = element.contains(document.activeElement) ? document.activeElement.name : "";
    element.replaceChildren(ordered.length > 0 ? section("What will be reported", leftOut(unread), missing, previewed(ordered, () => ordered, sure)) : "");
    if (focused) element.querySelector(`[name="${focused}"]`)?.focus();
  };
  const show = (reports, isTyping) => {
    const isPlain = ({ trouble, doubt }) => Number(trouble === null && !doubt);
    ordered = [...reports.rows].sort((one, other) => isPlain(one) - isPlain(other));
    clearTimeout(waiting);
    if (isTyping && ordered.length > DRAWN && element.querySelector("tr")) waiting = setTimeout(() => draw(reports), PAUSE);
    else draw(reports);
  };
  const isInSight = () => (element.querySelector("tbody tr")?.getBoundingClientRect().top ?? 0) < innerHeight;
  return { element, isInSight, show };
}

export const outcomes = (told, advice) => {
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

const lineWords = (line, words) => `Line ${count(line)}: ${words}`;
const wrongLine = (line, words) => h("span", { class: "under wrong" }, lineWords(line, words));

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
export function refused(problem) {
  const { type, title, detail, field, value, rule } = problem;
  if (type === UNCONFIRMED) return doubtWords(problem).join(" ");
  if (type === GONE && field === "session") return WAS_DELETED;
  const [name, asset] = (field ?? "").split(/\.(.*)/);
  if (!(name in FIELDS) || !rule) return detail ?? title;
  const [label, unit] = FIELDS[name];
  return problemWords({ value, rule }, asset ? `${label} of ${asset}` : label, unit);
}
