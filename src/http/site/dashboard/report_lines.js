// Reports for many sessions, line by line: a name and a return, or a table with a header, its columns in any order.

import { csvRows } from "./csv.js";
import { short } from "./format.js";
import { fraction, hundredth, typed } from "./number_text.js";
import { day, dayOf } from "./periods.js";

/** Least letters of an identifier that name a session. */
const LEAST = 6;
/** A session that reported within this time, in milliseconds, may be in the list by mistake. */
export const LATELY = 3_600_000;

/** The accepted headings of each column. */
const COLUMNS = {
  client: ["client", "session", "name", "investor", "account", "identifier", "id"],
  simple_return: ["return", "gain", "gain or loss", "performance"],
  executed_allocation: ["held", "share held", "allocation"],
  rate: ["rate", "bank", "bank paid", "the bank paid"],
  flow: ["flow", "added", "money added", "contribution"],
  wealth: ["wealth", "wealth reached"],
  date: ["date", "last day", "day"],
  period: ["period"],
};
/** The first heading of each, shown to users. */
export const HEADS = Object.values(COLUMNS).map(([head]) => head);
const SHARES = ["simple_return", "executed_allocation", "rate"];

/** Returns that vary this much less or more than the records of their sessions are most likely in another unit. */
const FAR = { less: 0.035, more: 10 };
/** Fewer returns are not enough to doubt the unit: the service asks about each unusual one. */
const FEW = 3;

const folded = (text) => text.trim().toLowerCase();
/** The unit at the end of a heading. */
const PERCENT = /[,\s]*(?:%|\(%\)|in percent)$/;
const headOf = (cell) => folded(cell).replace(PERCENT, "").replaceAll("_", " ");
const columnOf = (head) => Object.keys(COLUMNS).find((name) => COLUMNS[name].includes(head));

/** Returns `find(text)`, which finds the sessions that a text names: by name, otherwise by identifier. */
export function finder(sessions) {
  const index = (keyOf) => {
    const found = new Map();
    for (const entry of sessions) {
      const key = keyOf(entry);
      if (found.has(key)) found.get(key).push(entry);
      else found.set(key, [entry]);
    }
    return found;
  };
  const bare = (id) => id.replace(/^session_/, "");
  const byName = index(({ name }) => folded(name ?? ""));
  const byId = index(({ session }) => bare(session).slice(0, LEAST));
  return (text) => {
    const wanted = folded(text);
    if (wanted !== "" && byName.has(wanted)) return byName.get(wanted);
    const id = bare(wanted);
    return id.length < LEAST ? [] : (byId.get(id.slice(0, LEAST)) ?? []).filter(({ session }) => bare(session).startsWith(id));
  };
}

/**
 * Guesses the unit of returns that do not look like percent. Returns `"fraction"` if all returns without a percent sign are far smaller than
 * the usual variation in the records of their sessions, `"hundredth"` if most are far larger, otherwise null. `deviationOf(entry)` is the
 * deviation of a session's record, undefined while it is not known.
 */
export function otherUnit(rows, deviationOf) {
  const told = rows.filter(({ trouble, said }) => trouble === null && !said).flatMap(({ entry, report }) => {
    const deviation = deviationOf(entry);
    const returns = report.simple_returns ? Object.values(report.simple_returns) : [report.simple_return];
    return deviation > 0 ? returns.filter((value) => value !== undefined && value !== 0).map((value) => Math.abs(value) / deviation) : [];
  });
  if (told.length === 0) return null;
  if (told.every((times) => times < FAR.less)) return "fraction";
  return told.length >= FEW && told.sort((a, b) => a - b)[told.length >> 1] > FAR.more ? "hundredth" : null;
}

/** Returns how a session is written in a line: its name if it is unique, otherwise its identifier. */
export const written = (find, { session, name }) => (name && find(name).length === 1 ? name : short(session));

const saysPercent = (text) => text.endsWith("%");

/** Returns a reader of shares in `unit`: `percent`, `fraction` or `hundredth` of a percent. A percent sign takes precedence. */
export const inUnit = (unit) => (text) => {
  const value = fraction(text);
  if (value === null || saysPercent(text) || unit === "percent") return value;
  return unit === "fraction" ? typed(text) : hundredth(value);
};

/** The ways to split a line into a name and a number, the likeliest first. */
const SPLITS = [/^(.*)[\t;]\s*([^\t;]*)$/, /^(.*)\s([^\s]+(?:\s*%)?)$/, /^([^,]*),(.*)$/];

/** Reads a line: the sessions `found`, the `report` of the period, and the `trouble` with it, or null. */
function readLine(line, find, scaled) {
  const whole = find(line);
  if (whole.length > 0) return { found: whole, report: {}, trouble: null };
  const parts = SPLITS.map((split) => split.exec(line)).filter(Boolean).map(([, name, number]) => [name.replace(/[,;:\s]+$/, ""), number.trim()]);
  const numbered = parts.find(([, number]) => number !== "" && fraction(number) !== null);
  const known = parts.find(([name]) => find(name).length > 0);
  if (numbered) return { found: find(numbered[0]), name: numbered[0], report: { simple_return: scaled(numbered[1]) }, said: saysPercent(numbered[1]), trouble: null };
  if (!known) return { found: [], name: line, report: {}, trouble: null };
  const [name, number] = known;
  return { found: find(name), report: {}, trouble: number === "" ? null : `\u201c${number}\u201d is not a percentage` };
}

/** Returns the header of a table and its rows; null if the first line is not a header. */
function tableOf(text) {
  const first = text.split("\n").find((line) => line.trim() !== "") ?? "";
  const mark = ["\t", ";"].find((mark) => first.includes(mark)) ?? ",";
  const [header, ...rows] = csvRows(text, mark);
  // Of two columns with one heading only the first is read, except that several may name the client.
  const heads = (header?.cells ?? []).map(headOf).map((head, index, all) => (columnOf(head) !== "client" && all.indexOf(head) < index ? null : head));
  return heads.some((head) => columnOf(head) === "client") ? { header, heads, rows } : null;
}

/** Reads a cell of a share, an amount, a day or a period; null if it is not valid. */
function cellValue(name, text, scaled) {
  if (name === "date") return dayOf(text);
  const value = SHARES.includes(name) ? scaled(text) : typed(text);
  return typeof value !== "number" || (name === "period" && !(Number.isInteger(value) && value > 0)) ? null : value;
}

const WANTED = { date: "a date such as 2008-09-30", period: "a period number", flow: "a number", wealth: "a number" };

/** Returns the meaning of a column for a session of `assets`, which are null for one asset: `[list, asset]`, `[field]` or null. */
function meant(head, assets) {
  for (const name of assets ?? []) {
    if (head === folded(name)) return ["simple_returns", name];
    if (head === `${folded(name)} held`) return ["executed_allocations", name];
  }
  return columnOf(head) ? [columnOf(head)] : null;
}

function readRow({ cells }, { header, heads }, find, assetsOf, scaled) {
  const named = heads.flatMap((head, index) => (columnOf(head) === "client" && cells[index] ? [cells[index]] : []));
  const found = named.map(find).find((sessions) => sessions.length > 0) ?? [];
  const read = { found, name: named.join(", "), report: {}, unsaid: [], said: false, trouble: null };
  if (cells.length > heads.length) read.trouble = `has ${cells.length} cells, but the header has ${heads.length}`;
  if (found.length !== 1) return read;
  const assets = assetsOf(found[0].policy);
  for (const [index, head] of heads.entries()) {
    const text = cells[index] ?? "";
    const [name, asset] = meant(head, assets) ?? [];
    if (text === "" || name === "client") continue;
    const isSaid = saysPercent(text) || PERCENT.test(folded(header.cells[index]));
    const value = name && cellValue(asset ? "simple_return" : name, text, isSaid ? fraction : scaled);
    if (isSaid && name?.startsWith("simple_return")) read.said = true;
    if (name === undefined) read.unsaid.push(header.cells[index]);
    else if (value === null) read.trouble ??= `\u201c${text}\u201d in the column \u201c${header.cells[index]}\u201d is not ${WANTED[name] ?? "a percentage"}`;
    else read.report[name] = asset ? { ...read.report[name], [asset]: value } : value;
  }
  return read;
}

/** Returns what is wrong with a report, or null. */
function wrong({ found, name }, { period, ...report }, { assetsOf, lately }) {
  if (found.length > 1) return `${found.length} sessions have this name: use the identifier`;
  const [entry] = found;
  if (!entry) return `no session is called \u201c${name}\u201d`;
  const assets = assetsOf(entry.policy);
  if (assets === undefined) return "its policy is being read";
  if (entry.state === "completed" && period === undefined) return "is completed";
  const { simple_return, simple_returns = {}, executed_allocations: held } = report;
  const without = (list) => (assets ?? []).filter((asset) => !(asset in list));
  if (assets && (simple_return !== undefined || without(simple_returns).length > 0))
    return `holds several assets: give a header, and a return in each of the columns ${assets.map((asset) => `\u201c${asset}\u201d`).join(", ")}`;
  if (held && without(held).length > 0) return `gives the share held of some assets, but not of ${without(held).join(", ")}`;
  if (!assets && simple_return === undefined) return "has no return";
  if (period !== undefined) return null;
  if (report.date && entry.date && report.date <= entry.date) return `is already reported up to ${day(entry.date)}`;
  return !report.date && lately(entry) ? "was reported within the last hour: give its last day, or tick that this is the next period" : null;
}

/**
 * Reads a text as `{rows, header, unread}`. Each row is `{line, text, entry, report, trouble}`: its line, the session it names, its report of
 * the period, and what is wrong with it, or null. `header` is the first line if it heads columns, `unread` the columns that are ignored.
 * `all` is `{simple_return, date}` for rows without their own. `assetsOf(policy)` are the names of its assets: null for one asset, undefined
 * while unknown. `lately(entry)` tells whether a session reported so recently that it may be in the text by mistake. `unit` is that of shares
 * without a percent sign. If a session is named twice, both rows are refused, because nobody can know which one is right.
 */
export function readLines(text, find, all, { assetsOf, lately, unit = "percent" }) {
  const [table, scaled] = [tableOf(text), inUnit(unit)];
  const lines = text.split("\n").map((text, index) => ({ line: index + 1, text: text.trim() })).filter(({ text }) => text !== "");
  const rows = (table?.rows ?? lines).map((row) => {
    const read = table ? readRow(row, table, find, assetsOf, scaled) : readLine(row.text, find, scaled);
    const entry = read.found.length === 1 ? read.found[0] : undefined;
    const common = entry && assetsOf(entry.policy) ? { date: all.date } : all;
    const report = Object.fromEntries(Object.entries({ ...common, ...read.report }).filter(([, value]) => value !== undefined));
    return { ...row, entry, report, said: read.said ?? false, unsaid: read.unsaid ?? [], trouble: read.trouble ?? wrong(read, report, { assetsOf, lately }) };
  });
  const assets = new Set(rows.flatMap(({ entry }) => (entry && assetsOf(entry.policy)) ?? []));
  const unread = table ? table.header.cells.filter((_, index) => meant(table.heads[index], assets) === null) : [];
  const times = new Map();
  for (const { entry } of rows) if (entry) times.set(entry.session, (times.get(entry.session) ?? 0) + 1);
  const trouble = ({ entry, unsaid, trouble }) => {
    if (entry && times.get(entry.session) > 1) return "is named twice";
    const other = unsaid.find((column) => !unread.includes(column));
    return trouble ?? (other === undefined ? null : `has no asset called \u201c${other}\u201d`);
  };
  return { rows: rows.map((row) => ({ ...row, trouble: trouble(row) })), header: table?.header.text ?? null, unread };
}
