// Returns out of a text file: which columns hold numbers, and what kind of numbers they are.

/** Columns of numbers in delimited text: `{rows, columns: [{name, values, kind, inPercent}]}`. Blank cells are left out. */
export function read(text) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() !== "" && !line.startsWith("#"));
  if (lines.length < 2) throw new Error("The file holds fewer than two lines.");
  const delimiter = [";", "\t", ","].find((mark) => lines[1].includes(mark)) ?? ",";
  const cells = lines.map((line) => line.split(delimiter).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1")));
  const headed =
    cells[0].some((cell) => cell !== "" && !isNumber(cell, delimiter)) &&
    cells[1].some((cell) => isNumber(cell, delimiter));
  const names = headed ? cells.shift() : cells[0].map((_, index) => `Column ${index + 1}`);
  const columns = names.flatMap((name, index) => {
    const given = cells.map((row) => row[index] ?? "").filter((cell) => cell !== "");
    const values = given.filter((cell) => isNumber(cell, delimiter)).map((cell) => number(cell, delimiter));
    return given.length >= 2 && values.length === given.length ? [{ name, values, ...guess(name, values) }] : [];
  });
  if (columns.length === 0) throw new Error("No column holds numbers only.");
  return { rows: cells.length, columns };
}

/** Where fields are separated by semicolons, a comma is a decimal point. */
const plain = (cell, delimiter) => (delimiter === ";" ? cell.replace(",", ".") : cell).replace(/\s*%$/, "");
const isNumber = (cell, delimiter) => /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain(cell, delimiter));
const number = (cell, delimiter) => Number(plain(cell, delimiter));

/** What a column holds, by its name and its numbers; the reader can say otherwise. */
function guess(name, values) {
  const kind = /log/i.test(name)
    ? "log"
    : /price|close|index|level/i.test(name) || values.every((value) => value > 2)
      ? "price"
      : "simple";
  return { kind, inPercent: kind !== "price" && Math.max(...values.map(Math.abs)) > 1 };
}

/** Log-returns of a column. Throws where a number cannot be what it is said to be. */
export function logReturns(values, kind, inPercent) {
  if (kind === "price") {
    if (values.some((value) => value <= 0)) throw new Error("A price is not above zero.");
    return values.slice(1).map((value, index) => rounded(Math.log(value / values[index])));
  }
  const fractions = values.map((value) => (inPercent ? value / 100 : value));
  if (kind === "log") return fractions;
  if (fractions.some((value) => value <= -1))
    throw new Error("A simple return is not above \u2212100 %. Are they percentages?");
  return fractions.map((value) => rounded(Math.log1p(value)));
}

/** Twelve digits: far more than any return is known to, and short enough to read. */
const rounded = (value) => Number(value.toPrecision(12));
