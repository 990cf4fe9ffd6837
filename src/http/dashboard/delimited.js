// Text as rows of cells. A cell knows its line, its column and its place in the text, so that whatever is wrong with it can
// be pointed at. What a cell means is not decided here, but for one thing: whether a comma parts numbers or is in them.

import { commaDecimal, isNumber, looksNumeric } from "./number_text.js";
import { couldBeDate } from "./dates.js";
import { Question, Refusal } from "./outcomes.js";

/** Marks that part cells wherever they occur; a comma or a space does so only where nothing else can be meant. */
const PLAIN_DELIMITERS = ["\t", ";", "|"];
const WHITESPACE = " ";
/** Lines by which the meaning of a comma is told: it is the same in all of them. */
const FIRST = 200;

/** A remark; #N/A is what a spreadsheet leaves where a number is missing. */
const REMARK = /^\s*#(?!N\/A)/i;

/** `{rows: [[{text, line, column, start}]], remarks}`; blank lines are passed over, and remarks counted. */
export function rowsOf(text, said) {
  refuseBinary(text);
  const given = linesOf(text);
  const lines = given.filter(({ content }) => !REMARK.test(content));
  if (lines.length === 0) throw new Refusal("There are remarks only, and no numbers.");
  const delimiter = delimiterOf(lines, said);
  return { rows: evened(lines.map((line) => cellsOf(line, delimiter))), remarks: given.length - lines.length };
}

/** Without the blank cells that delimiters at the ends of lines make. */
function evened(rows) {
  const filled = (row) => row.findLastIndex(({ text }) => text !== "") + 1;
  const width = rows.reduce((most, row) => Math.max(most, filled(row)), 0);
  return rows.map((row) => row.slice(0, width));
}

function linesOf(text) {
  const found = [];
  let start = 0;
  for (const [index, raw] of text.split(/\n/).entries()) {
    const content = raw.replace(/\r$/, "");
    if (content.trim() !== "") found.push({ content, line: index + 1, start });
    start += raw.length + 1;
  }
  return found;
}

function refuseBinary(text) {
  if (text.startsWith("PK\u0003\u0004"))
    throw new Refusal("This is a spreadsheet file. Save it as CSV, or copy the column and paste it.");
  if (/[\0\ufffd]/.test(text)) throw new Refusal("This is no text in UTF-8. Save it as CSV in UTF-8.");
}

function delimiterOf(lines, said) {
  const outside = lines.map(({ content }) => content.replace(/"[^"]*"/g, ""));
  const plain = PLAIN_DELIMITERS.find((mark) => outside.some((line) => line.includes(mark)));
  if (plain) return plain;
  if (!outside.some((line) => line.includes(",")))
    return outside.some((line) => line.includes('"')) ? "," : spaced(lines);
  if (said.comma) return said.comma === "parts" ? "," : WHITESPACE;
  return commaOf(lines);
}

/** Without commas: words are cells, unless a quoted cell or a date of several words holds the spaces. */
function spaced(lines) {
  const whole = lines.every(({ content }) => !/\s/.test(content.trim()) || couldBeDate(content.trim()));
  return whole || lines.some(({ content }) => content.includes('"')) ? "," : WHITESPACE;
}

/** A comma parts cells, or it is a decimal or thousands mark within them; where the text allows both, a reader must say. */
function commaOf(lines) {
  const [parting, inside] = [",", WHITESPACE].map((delimiter) => strangers(lines, delimiter));
  if (parting < inside) return ",";
  const word = lines.flatMap((line) => cellsOf(line, WHITESPACE)).find(({ text }) => text.includes(","));
  if (word === undefined || !looksNumeric(word.text)) return ",";
  if (inside < parting) return WHITESPACE;
  const parted = word.text.split(",").join(" and ");
  throw new Question("comma", `Is ${word.text} one number, or are ${parted} numbers of their own?`, [
    { words: `One number: ${word.text}`, said: { comma: "inside" } },
    { words: `Numbers of their own: ${parted}`, said: { comma: "parts" } },
  ]);
}

/** How many cells would be neither numbers nor dates, were the lines parted so; headings are none of them. */
function strangers(lines, delimiter) {
  const rows = lines.slice(0, FIRST).map((line) => cellsOf(line, delimiter));
  const known = ({ text }) => text === "" || isNumber(text) || couldBeDate(text);
  const body = rows.length > 1 && !rows[0].some(known) ? rows.slice(1) : rows;
  return body.flat().filter((cell) => !known(cell)).length;
}

/** The cells of a line; quotes hold a delimiter together and are taken off. */
function cellsOf(source, delimiter) {
  return delimiter === WHITESPACE ? words(source) : fields(source, delimiter);
}

/** A comma at the end of a word ends it, quotes around it are taken off, and a percent sign belongs to the number before it. */
function words({ content, start, line }) {
  const found = [];
  for (const { 0: word, index } of content.matchAll(/\S+(?:[ \u00a0\u202f]+%)?/g)) {
    const bare = word.replace(/,$/, "");
    const text = bare.replace(/^"(.*)"$/, "$1");
    if (text !== "") found.push({ text, line, column: found.length + 1, start: start + index + bare.indexOf(text) });
  }
  return found;
}

function fields({ content, start, line }, delimiter) {
  const found = [];
  let at = 0;
  while (at <= content.length) {
    let from = at;
    while (content[from] === " " || content[from] === "\u00a0") from++;
    const quoted = content[from] === '"';
    const close = quoted ? closing(content, from + 1) : at;
    if (close === null)
      throw openQuote({ line, column: found.length + 1, start: start + from, text: content.slice(from) });
    const next = content.indexOf(delimiter, close);
    const end = next < 0 ? content.length : next;
    const raw = content.slice(from, end).trim();
    const text = quoted ? raw.slice(1, raw.lastIndexOf('"')).replaceAll('""', '"').trim() : raw;
    found.push({ text, line, column: found.length + 1, start: start + from });
    at = end + 1;
  }
  return found;
}

/** Where a quoted cell that starts before `from` ends; null where it does not. */
function closing(content, from) {
  for (let at = from; at < content.length; at++) {
    if (content[at] !== '"') continue;
    if (content[at + 1] !== '"') return at + 1;
    at++;
  }
  return null;
}

const openQuote = (cell) => new Refusal(`Line ${cell.line} opens a quote and does not close it.`, cell);

/** Which of `,` and `.` is the decimal mark of `cells`: "point" or "comma". A reader is asked where 1,234 may be both. */
export function decimalOf(cells, said) {
  const numeric = cells.filter(({ text }) => looksNumeric(text));
  if (said.decimal) return said.decimal;
  const fits = (decimal) => numeric.filter(({ text }) => isNumber(text, decimal)).length;
  const [point, comma] = [fits("point"), fits("comma")];
  const doubtful = numeric.find(({ text }) => text.includes(","));
  if (doubtful === undefined || point > comma) return "point";
  if (comma > point) return "comma";
  const plain = commaDecimal(doubtful.text);
  throw new Question("decimal", `Is the comma in ${doubtful.text} a decimal mark?`, [
    { words: `Yes: ${doubtful.text} is ${plain}`, said: { decimal: "comma" } },
    { words: `No: ${doubtful.text} is ${doubtful.text.replaceAll(",", "")}`, said: { decimal: "point" } },
  ]);
}
