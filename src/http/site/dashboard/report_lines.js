// Reports for many sessions, line by line: a name and a return, or a table with a header, its columns in any order.

import { csvRows } from "./csv.js";
import { percent, short } from "./format.js";
import { fraction, hundredth, typed } from "./number_text.js";
import { day, dayOf, whichDay } from "./periods.js";

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
  return told.length >= FEW && told.filter((times) => times <= FAR.more).length <= told.length >> 1 ? "hundredth" : null;
}

/** Returns how a session is written in a line: its name if it is unique, otherwise its identifier. A semicolon follows a name that may be read
 * as another name and a number. */
export function written(find, { session, name }) {
  if (!name || find(name).length !== 1) return short(session);
  return readings(name, find).length > 1 ? `${name};` : name;
}

const saysPercent = (text) => /%\s*$/.test(text);

/** Returns a reader of shares in `unit`: `percent`, `fraction` or `hundredth` of a percent. A percent sign takes precedence. */
export const inUnit = (unit) => (text) => {
  const value = fraction(text);
  if (value === null || saysPercent(text) || unit === "percent") return value;
  return unit === "fraction" ? typed(text) : hundredth(value);
};

const MARK = /[\t;]/;
/** Digits with any marks between them, if they are a number or not. */
const DIGITS = /^[-+\u2212\u2013]?\d[\d.,'\u2019\s]*%?$/;

/** Returns every cut of a line into a `name` and a `number` that stands after it, from the left, and what stands `between` them. */
const cuts = (line) => [...line.matchAll(/[\t;,\s]+/g)].map(({ 0: between, index }) => ({ name: line.slice(0, index).replace(/[,;:\s]+$/, ""), number: line.slice(index + between.length).trim(), between }));

const isReturn = ({ number, between }) => (number === "" ? /[\t;,]/.test(between) : fraction(number) !== null);

/** Returns the ways to read a line, each a name of sessions and a number, which may be blank. A tab or a semicolon between them leaves no doubt.
 * Otherwise a number at the end may be part of a name, and a comma may stand before a number or within it. */
function readings(line, find) {
  const parts = cuts(line);
  const fit = parts.filter((part) => isReturn(part) && find(part.name).length > 0);
  const marked = fit.filter(({ between }) => MARK.test(between));
  if (marked.length > 0) return marked;
  const whole = find(line).length > 0 ? [{ name: line, number: "" }] : [];
  const longer = (one) => parts.filter((part) => parts.indexOf(part) < parts.indexOf(one) && DIGITS.test(part.number) && !fit.includes(part));
  return [...fit.flatMap((part) => (part.between === "," && part.number !== "" ? [...longer(part), part] : [part])), ...whole];
}

/** Asks which of several readings of a line is meant. */
function whichReading(several, scaled) {
  const means = ({ name, number }) => {
    const value = number === "" ? null : scaled(number);
    return `${number === "" ? "no return" : typeof value === "number" ? percent(value, 2) : `\u201c${number}\u201d`} for \u201c${name}\u201d`;
  };
  return `may be ${several.map(means).join(" or ")}: write ${several.map(({ name, number }) => `\u201c${`${name}; ${number}`.trim()}\u201d`).join(" or ")}`;
}

/** Reads a line: the sessions `found`, the `report` of the period, and the `trouble` with it, or null. */
function readLine(line, find, scaled) {
  const [reading, ...others] = readings(line, find);
  if (others.length > 0) return { found: [], report: UNREAD, trouble: whichReading([reading, ...others], scaled) };
  if (reading) return ofReturn(find(reading.name), reading.name, reading.number, scaled);
  const cells = cellsOf(line);
  if (cells) return readCells(cells, find, scaled);
  const parts = cuts(line);
  const known = parts.filter(({ name }) => find(name).length > 0);
  const numbered = parts.findLast(({ between, number }) => between !== "," && fraction(number) !== null) ?? parts.find(isReturn);
  const unread = known.findLast(({ number }) => DIGITS.test(number)) ?? (numbered ? null : known.at(-1));
  if (unread) return { found: find(unread.name), report: UNREAD, trouble: notPercent(unread.number) };
  return ofReturn([], numbered?.name ?? line, numbered?.number ?? "", scaled);
}

/** A return that is there but not known, in the place of which no other may stand. */
const UNREAD = { simple_return: undefined };
const notPercent = (text) => `\u201c${text}\u201d is not a percentage`;
const ofReturn = (found, name, number, scaled) => ({ found, name, report: number === "" ? {} : { simple_return: scaled(number) }, said: saysPercent(number), trouble: null });
const isDay = (text) => dayOf(text) !== null || whichDay(text) !== null;

/** Returns the cells of a line that is a row of a table, or null: a tab or a semicolon parts them, or commas if one of them is a day. */
function cellsOf(line) {
  const mark = ["\t", ";"].find((mark) => line.includes(mark));
  const cells = csvRows(line, mark ?? ",")[0].cells;
  return mark || cells.some(isDay) ? cells : null;
}

/** Reads the cells of a row without a header: one names a session, one may be its return, and one its last day. */
function readCells(cells, find, scaled) {
  const isName = (cell) => cell !== "" && fraction(cell) === null && !isDay(cell);
  const place = [cells.findIndex((cell) => find(cell).length > 0), cells.findIndex(isName)].find((index) => index >= 0) ?? 0;
  const others = cells.filter((cell, index) => index !== place && cell !== "");
  const days = others.filter(isDay);
  const numbers = others.filter((cell) => fraction(cell) !== null);
  const read = ofReturn(find(cells[place]), cells[place], numbers[0] ?? "", scaled);
  if (others.length === 1 && days.length + numbers.length === 0) return { ...read, report: UNREAD, trouble: notPercent(others[0]) };
  if (days.length > 1 || numbers.length > 1 || days.length + numbers.length < others.length)
    return { ...read, trouble: `has ${cells.length} cells: give a header above, such as \u201cclient;return;date\u201d, with the names ${HEADS.join(", ")}` };
  if (days.length === 0) return read;
  const date = dayOf(days[0]);
  return date === null ? { ...read, trouble: `\u201c${days[0]}\u201d ${whichDay(days[0])}` } : { ...read, report: { ...read.report, date } };
}

/** Returns the header of a table and its rows; null if the first line is not a header. */
function tableOf(text) {
  const [first] = text.trimStart().split("\n", 1);
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
    else if (value === null) read.trouble ??= `\u201c${text}\u201d in the column \u201c${header.cells[index]}\u201d ${(name === "date" && whichDay(text)) || `is not ${WANTED[name] ?? "a percentage"}`}`;
    else read.report[name] = asset ? { ...read.report[name], [asset]: value } : value;
  }
  return read;
}

/** Returns a line without blanks at its ends, but with a tab at its end, after which a cell is blank. */
const lineOf = (text) => text.trimStart().replace(/[^\S\t]+$/, "");

/** Returns what is wrong with a report, or null. */
function wrong({ found, name }, { period, ...report }, { assetsOf, lately }) {
  if (found.length > 1) return `${found.length} sessions have this name: use the identifier`;
  const [entry] = found;
  if (!entry) return `no session is called \u201c${name}\u201d`;
  if (entry.state === "deleted") return "this session was deleted";
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
 * Returns `{read(text, all), forget()}`. `read` turns a text into `{rows, header, unread}`. Each row is `{line, text, entry, report, trouble}`:
 * its line, the session it names, its report of the period, and what is wrong with it, or null. `header` is the first line if it heads
 * columns, `unread` the columns that are ignored. `all` is `{simple_return, date}` for rows without their own. `assetsOf(policy)` are the names
 * of its assets: null for one asset, undefined while unknown. `lately(entry)` tells whether a session reported so recently that it may be in
 * the text by mistake. `unit` is that of shares without a percent sign. If a session is named twice, both rows are refused, because nobody can
 * know which one is right.
 *
 * Only lines between the first and the last that differ from the text before are parsed. After a change of the sessions or of `lately`,
 * `forget` has every row checked again.
 */
export function lineReader(find, { assetsOf, lately, unit = "percent" }) {
  const scaled = inUnit(unit);
  let [known, heading, terms] = [[], null, {}];
  const parsed = (row, table, old) => {
    if (old && (!old.entry || old.assets === assetsOf(old.entry.policy))) return old;
    const read = table ? readRow(row, table, find, assetsOf, scaled) : readLine(row.text, find, scaled);
    const entry = read.found.length === 1 ? read.found[0] : undefined;
    return { ...read, text: row.text, entry, assets: entry && assetsOf(entry.policy) };
  };
  const rowOf = ({ line, text }, read) => {
    if (read.terms === terms && read.row.line === line) return read.row;
    const common = read.assets ? { date: terms.date } : terms;
    const report = Object.fromEntries(Object.entries({ ...common, ...read.report }).filter(([, value]) => value !== undefined));
    read.terms = terms;
    read.row = { line, text, entry: read.entry, report, said: read.said ?? false, unsaid: read.unsaid ?? [], trouble: read.trouble ?? wrong(read, report, { assetsOf, lately }) };
    return read.row;
  };
  const read = (text, all) => {
    const table = tableOf(text);
    const header = table?.header.text ?? null;
    if (header !== heading) [known, heading] = [[], header];
    if (all.simple_return !== terms.simple_return || all.date !== terms.date) terms = { ...all };
    const lines = table?.rows ?? text.split("\n").map((text, index) => ({ line: index + 1, text: lineOf(text) })).filter(({ text }) => text !== "");
    const before = unchanged(lines, known);
    known = lines.map((row, index) => parsed(row, table, before(index)));
    return { ...judged(known.map((read, index) => rowOf(lines[index], read)), table, assetsOf), header };
  };
  return { read, forget: () => (terms = { ...terms }) };
}

/** Returns `before(index)`: the entry of `old` with the text of a line, for the lines before the first change and after the last. */
function unchanged(lines, old) {
  const most = Math.min(lines.length, old.length);
  let [start, end] = [0, 0];
  while (start < most && lines[start].text === old[start].text) start += 1;
  while (end < most - start && lines.at(-1 - end).text === old.at(-1 - end).text) end += 1;
  return (index) => (index < start ? old[index] : index >= lines.length - end ? old[index - lines.length + old.length] : undefined);
}

/** Finds what is wrong with rows beside each other: returns `{rows, unread}`. */
function judged(rows, table, assetsOf) {
  const assets = new Set(rows.flatMap(({ entry }) => (entry && assetsOf(entry.policy)) ?? []));
  const unread = table ? table.header.cells.filter((_, index) => meant(table.heads[index], assets) === null) : [];
  const times = new Map();
  for (const { entry } of rows) if (entry) times.set(entry.session, (times.get(entry.session) ?? 0) + 1);
  const trouble = ({ entry, unsaid, trouble }) => {
    if (entry && times.get(entry.session) > 1) return "is named twice";
    const other = unsaid.find((column) => !unread.includes(column));
    return trouble ?? (other === undefined ? null : `has no asset called \u201c${other}\u201d`);
  };
  const whole = rows.map((row) => {
    const own = trouble(row);
    return own === row.trouble ? row : { ...row, trouble: own };
  });
  return { rows: whole, unread };
}
