// The one reader of returns: text from a box, a file or a spreadsheet in, one reading out.
//
// Text does not say what its numbers are. What follows from them is taken and told in a sentence; what does not follow is
// asked; and a cell that is neither is named by its line and column. Nothing is passed over in silence: an investor who is
// misread gets wrong advice that looks right. The module knows no page, so the same reading can be tested without one.

import { dateOf, formOf, rhythmOf, told } from "./dates.js";
import { decimalOf, rowsOf } from "./delimited.js";
import { counted } from "./format.js";
import { hasPercent, isNumber, looksNumeric, numberOf } from "./number_text.js";
import { Question, Refusal } from "./outcomes.js";
import { sentence } from "./reading_sentence.js";
import { kindAndUnit, logReturns } from "./return_kind.js";

/** What the service takes. */
const FEWEST = 2;
/** Headings of columns that are dates even where their cells are not understood. */
const DATE_HEADING = /^(date|dates|month|year|quarter|week|day|time|timestamp|period ending|datum|monat|jahr)$/i;
/** What stands where a number is missing: never the name of a column. */
const MISSING = /^(#?n\/?a|nan|null|none|-|\.)$/i;
/** What may be asked, in the order in which one answer opens the next question. */
export const ASKED = ["comma", "layout", "column", "decimal", "dates", "order", "kind", "unit", "confirmed"];

/**
 * Reads `text`, with what a person said of it: any of `comma` ("inside", "parts"), `layout` ("run", "columns"), `column`
 * (its place), `decimal` ("point", "comma"), `dates` ("day", "month" first), `order` ("oldest", "newest" first), `kind`
 * ("simple", "log", "price"), `unit` ("fraction", "percent"), `confirmed`, and `latest`, how many of the last returns count.
 *
 * `{outcome: "nothing"}`, `{outcome: "refused", message, place}`, `{outcome: "question", asks, message, choices}` or
 * `{outcome: "reading", returns, sentence, settled}`, the returns as log-returns, oldest first.
 */
export function read(text, said = {}) {
  try {
    const plain = text.replace(/^\ufeff/, "");
    return plain.trim() === "" ? { outcome: "nothing" } : reading(plain, said);
  } catch (error) {
    if (error instanceof Question || error instanceof Refusal) return error;
    throw error;
  }
}

function reading(text, said) {
  const { rows, remarks } = rowsOf(text, said);
  const record = { ...recordOf(rows, said), remarks };
  const decimal = decimalOf(record.cells, said);
  const filled = withoutBlankEnds(record);
  for (const cell of filled.cells) if (!isNumber(cell.text, decimal)) throw misfit(cell, decimal);
  const values = filled.cells.map(({ text }) => numberOf(text, decimal));
  const ordered = inOrder({ ...filled, values }, said);
  if (ordered.values.length < FEWEST) throw new Refusal("One number is no record of returns: at least two are needed.");
  const meant = kindAndUnit(ordered, percentSigns(filled.cells), said);
  return latest({ ...ordered, ...meant, returns: logReturns(ordered, meant) }, said);
}

/** What the rows hold: the cells of one column or of the whole run, its heading, and the dates beside them. */
function recordOf(rows, said) {
  const headed = rows.length > 1 && isHeading(rows, said);
  const heading = headed ? rows[0] : null;
  const body = headed ? rows.slice(1) : rows;
  const flat = body.flat().filter(({ text }) => text !== "");
  const widths = new Set(body.map((row) => row.length));
  const numbersOnly = flat.every(({ text }) => isNumber(text));
  const single = body.length === 1 || (widths.size === 1 && widths.has(1));
  if (single || (!headed && numbersOnly && (widths.size > 1 || said.layout === "run"))) return run(flat, heading, said);
  refuseRagged(heading ?? body[0], body);
  return columnOf(body, heading, said);
}

/** The first row names the columns where it holds words alone, or nothing above a column of dates. */
function isHeading([first, ...rest], said) {
  const named = ({ text }) => !isNumber(text) && !MISSING.test(text) && formOf([text], said, { alone: true }) === null;
  const above = ({ text }, index) =>
    text === "" &&
    formOf(
      rest.map((row) => row[index]?.text ?? ""),
      said,
    ) !== null;
  return first.every(named) || first.some(above);
}

/** Numbers one after the other, line by line. */
function run(cells, heading, said) {
  const form = formOf(
    cells.map(({ text }) => text),
    said,
    { alone: true },
  );
  if (form) throw new Refusal("These are dates, without returns beside them.", cells[0]);
  return { name: heading?.[0].text ?? "", cells, dates: null, dated: false };
}

function refuseRagged(first, body) {
  const odd = body.find((row) => row.length !== first.length);
  if (!odd) return;
  const { line } = odd[0];
  const cells = `Line ${line} has ${counted(odd.length, "cell")}, line ${first[0].line} has ${first.length}.`;
  throw new Refusal(
    `${cells} A number with a comma in it must stand in quotes, or cells be parted by semicolons.`,
    odd[0],
  );
}

function columnOf(body, heading, said) {
  const columns = body[0].map((_, index) => ({
    index,
    name: heading?.[index].text || "",
    cells: body.map((row) => row[index]),
  }));
  const dates = datesAmong(columns, said);
  const numeric = columns.filter(
    (column) => column !== dates.column && !dates.others.includes(column) && mostlyNumbers(column),
  );
  const candidates = numeric.filter((column) => numeric.length === 1 || !countsRows(column));
  if (candidates.length === 0) throw noNumbers(columns, dates);
  if (!heading && !dates.column && candidates.length === columns.length && said.layout === undefined)
    throw layoutQuestion(body);
  const chosen = candidates.length === 1 ? candidates[0] : candidates.find(({ index }) => index === said.column);
  if (chosen === undefined) throw columnQuestion(candidates);
  const asked = candidates.length > 1 ? candidates.map(choiceOf) : null;
  return { name: chosen.name || `column ${chosen.index + 1}`, cells: chosen.cells, columns: asked, ...dates.read };
}

/** The column of dates: read where its form is known, set aside where its heading alone says what it is. */
function datesAmong(columns, said) {
  const formed = columns.flatMap((column) => {
    const texts = column.cells.map(({ text }) => text).filter((text) => text !== "");
    const form = texts.length > 0 ? formOf(texts, said) : null;
    return form ? [{ column, form }] : [];
  });
  const named = columns.filter(
    (column) => DATE_HEADING.test(column.name) || (!mostlyNumbers(column) && labels(column)),
  );
  const others = [...named, ...formed.map(({ column }) => column)];
  if (formed.length === 0) return { column: named[0] ?? null, others, read: { dates: null, dated: named.length > 0 } };
  const { column, form } = formed[0];
  const dates = column.cells.map((cell) => {
    const date = dateOf(cell.text, form);
    if (date) return { ...date, line: cell.line };
    throw new Refusal(`${place(cell)}: \u201c${cell.text}\u201d is not a date like the others.`, cell);
  });
  return { column, others, read: { dates, dated: true } };
}

/** Words with digits, another in every row: dates in a form that is not known here, most likely. */
const labels = ({ cells }) =>
  cells.every(({ text }) => /\d/.test(text)) && new Set(cells.map(({ text }) => text)).size === cells.length;

const mostlyNumbers = ({ cells }) => {
  const given = cells.filter(({ text }) => text !== "");
  return given.length > 0 && given.filter(({ text }) => looksNumeric(text) || isNumber(text)).length > given.length / 2;
};

/** Whether a column only counts: 0, 1, 2 and so on, as spreadsheets and programs number their rows. */
function countsRows({ index, cells }) {
  const from = Number(cells[0].text);
  return index === 0 && (from === 0 || from === 1) && cells.every(({ text }, row) => text === String(from + row));
}

const choiceOf = ({ index, name, cells }) => ({
  words: `${name || `Column ${index + 1}`} (${cells
    .slice(0, 3)
    .map(({ text }) => text)
    .join("; ")} \u2026)`,
  said: { column: index },
});

const columnQuestion = (candidates) =>
  new Question("column", "Which column holds the returns or prices?", candidates.map(choiceOf));

function layoutQuestion(body) {
  const count = body.flat().length;
  return new Question(
    "layout",
    `Are these ${counted(count, "number")} of one record, or columns of different things?`,
    [
      { words: "One record, read line by line", said: { layout: "run" } },
      { words: `${body[0].length} columns`, said: { layout: "columns" } },
    ],
  );
}

function noNumbers(columns, { column: dates }) {
  const cell = columns
    .filter((column) => column !== dates)
    .flatMap(({ cells }) => cells)
    .find(({ text }) => text !== "");
  if (!cell) return new Refusal("There are dates, and no returns beside them.");
  return new Refusal(`No column holds numbers: ${place(cell).toLowerCase()} is \u201c${cell.text}\u201d.`, cell);
}

/** Blank cells before the first number and after the last are left out and told; within, they are holes in the record. */
function withoutBlankEnds(record) {
  const given = record.cells.map(({ text }) => text !== "");
  const [first, last] = [given.indexOf(true), given.lastIndexOf(true)];
  if (first < 0) throw new Refusal("The column is blank.", record.cells[0]);
  const cells = record.cells.slice(first, last + 1);
  const hole = cells.find(({ text }) => text === "");
  if (hole) throw new Refusal(`${place(hole)} is blank: a record must not have holes.`, hole);
  return { ...record, cells, dates: record.dates?.slice(first, last + 1) ?? null, blank: given.length - cells.length };
}

function misfit(cell, decimal) {
  const mark = isNumber(cell.text) ? ` as the others are, with a decimal ${decimal}` : "";
  return new Refusal(`${place(cell)}: \u201c${cell.text}\u201d is not a number${mark}.`, cell);
}

const place = ({ line, column }) => `Line ${line}, column ${column}`;

/** A percent sign counts for the column; where some cells have one and others none, they cannot mean the same. */
function percentSigns(cells) {
  const marked = cells.filter(({ text }) => hasPercent(text)).length;
  if (marked === 0 || marked === cells.length) return marked > 0;
  const odd = cells.find(({ text }) => hasPercent(text) !== hasPercent(cells[0].text));
  throw new Refusal(
    `${place(odd)}: \u201c${odd.text}\u201d ${hasPercent(odd.text) ? "has" : "lacks"} a percent sign, unlike the cells before it.`,
    odd,
  );
}

/** Values oldest first, and how that was known: by their dates, or by what was said. */
function inOrder(record, said) {
  const { dates, values, cells } = record;
  if (!dates) {
    if (record.dated && !said.order) throw orderQuestion();
    const turned = said.order === "newest";
    const order = turned ? "taken newest first and turned round" : "taken oldest first";
    return {
      ...record,
      ...(turned ? { values: [...values].reverse(), cells: [...cells].reverse() } : {}),
      order: `without dates, ${order}`,
    };
  }
  const ranks = dates.map(({ rank }) => rank);
  const places = ranks.map((_, index) => index).sort((a, b) => ranks[a] - ranks[b]);
  const twin = places.findIndex((at, k) => k > 0 && ranks[at] === ranks[places[k - 1]]);
  if (twin > 0) throw sameDate(dates, places[twin - 1], places[twin], cells);
  const sorted = places.map((at) => dates[at]);
  const rising = places.every((at, k) => at === k);
  const falling = places.every((at, k) => at === places.length - 1 - k);
  return {
    ...record,
    values: places.map((at) => values[at]),
    cells: places.map((at) => cells[at]),
    dates: sorted,
    rhythm: rhythmOf(sorted),
    order: rising
      ? "oldest first"
      : falling
        ? "given newest first and turned round by their dates"
        : "sorted by their dates, which were not in order",
  };
}

function orderQuestion() {
  return new Question("order", "The dates are not understood. Which row is the oldest?", [
    { words: "The first row", said: { order: "oldest" } },
    { words: "The last row", said: { order: "newest" } },
  ]);
}

function sameDate(dates, one, other, cells) {
  const lines = [dates[one].line, dates[other].line].sort((a, b) => a - b);
  return new Refusal(
    `Lines ${lines[0]} and ${lines[1]} have the same date, ${told(dates[one].moment, dates[one].fine)}.`,
    cells[other],
  );
}

/** The last returns of a reading, as many as were asked for, and the sentence that tells what they are. */
function latest(record, said) {
  const all = record.returns.length;
  const count = Math.min(all, Math.max(FEWEST, said.latest ?? all));
  const { kind, unit, columns = null, dated } = record;
  return {
    outcome: "reading",
    returns: record.returns.slice(-count),
    sentence: sentence(record, count),
    settled: { kind, unit, columns, dated, all },
  };
}
