// What numbers of a record are: simple returns, log-returns or prices, in percent or as fractions.
//
// A heading or percent signs say so, or the numbers leave one choice; where they leave two, a reader is asked. The bounds
// are those of investments: returns of a tenth of a percent to a third a period.

import { counted, percent } from "./format.js";
import { Question, Refusal } from "./outcomes.js";
import { moments } from "./specification.js";

/** A standard deviation a period above which a reading holds only where a person confirms it. */
const DOUBTFUL_DEVIATION = 0.3;
/** Numbers whose standard deviation, as written, is below the first are fractions, above the second percent. */
const [SURELY_FRACTIONS, SURELY_PERCENT] = [0.1, 1];
/** Numbers above zero that average more than this, as a return a period, are rather prices. */
const LARGEST_MEAN = 0.2;
/** The service's bound on a log-return. */
const LARGEST_LOG_RETURN = 5;

const HEADINGS = [
  ["log", /log/i],
  ["simple", /ret|perf|gain|change|chg|%|pct|percent|yield/i],
  ["price", /price|close|nav\b|level|index|value|adj/i],
];
const IN_PERCENT = /%|pct|percent/i;
const WORDS = { simple: "Simple returns", log: "Log-returns", price: "Prices" };

/** `{kind, unit}` of a record's values, oldest first; `signs` where every number has a percent sign. */
export function kindAndUnit({ values, name, cells }, signs, said) {
  const heading = HEADINGS.find(([, pattern]) => pattern.test(name))?.[0];
  const units = unitsOf(values, signs || IN_PERCENT.test(name), said);
  const kind = said.kind ?? kindOf(values, heading, signs);
  if (kind === "price") return confirmed({ kind, unit: null }, values, cells, said);
  if (units.length === 1) return confirmed({ kind, unit: units[0] }, values, cells, said);
  const one = cells.find((_, index) => values[index] !== 0).text;
  throw new Question("unit", `Are the returns fractions or percent? What is ${one}?`, [
    { words: `Fractions: ${one} is ${percent(valueOf(one, values, cells), 2)}`, said: { unit: "fraction" } },
    { words: `Percent: ${one} is ${percent(valueOf(one, values, cells) / 100, 2)}`, said: { unit: "percent" } },
  ]);
}

const valueOf = (text, values, cells) => values[cells.findIndex((cell) => cell.text === text)];

/** The units that returns may be in: as said or written, or by how much they vary. A loss of all and more is in percent. */
function unitsOf(values, written, said) {
  if (said.unit) return [said.unit];
  if (written) return ["percent"];
  const { mean, deviation } = moments(values);
  if (deviation >= SURELY_PERCENT || values.some((value) => value <= -1)) return ["percent"];
  if (deviation >= SURELY_FRACTIONS) return ["fraction", "percent"];
  return [Math.abs(mean) <= LARGEST_MEAN ? "fraction" : "percent"];
}

/** By its heading; numbers that are all above zero may be prices without one. */
function kindOf(values, heading, signs) {
  if (signs || values.some((value) => value <= 0)) return heading === "log" ? "log" : "simple";
  if (heading) return heading;
  const asReturns = moments(values).mean / 100 <= LARGEST_MEAN;
  const asPrices = moments(steps(values)).deviation <= DOUBTFUL_DEVIATION;
  if (asReturns && asPrices) {
    throw new Question("kind", "Are these prices, or returns that are all above zero?", [
      { words: "Prices", said: { kind: "price" } },
      { words: "Returns", said: { kind: "simple" } },
    ]);
  }
  return asPrices ? "price" : "simple";
}

const steps = (prices) => prices.slice(1).map((price, index) => Math.log(price / prices[index]));

/** A reading that stands, or one to confirm, or a cell that it cannot be. */
function confirmed(meant, values, cells, said) {
  const returns = logReturns({ values, cells }, meant);
  const { deviation } = moments(meant.kind === "log" ? returns : returns.map(Math.expm1));
  if (deviation === 0) throw new Refusal("The numbers do not vary: there is nothing to learn from them.", cells[0]);
  if (deviation <= DOUBTFUL_DEVIATION || said.confirmed) return meant;
  const { kind, unit } = meant;
  const as =
    kind === "price" ? "prices" : `${WORDS[kind].toLowerCase()} ${unit === "percent" ? "in percent" : "as fractions"}`;
  const question = `Read as ${as}, the ${counted(values.length, "number")} give a standard deviation of ${percent(deviation, 2)} a period. Is that right?`;
  throw new Question("confirmed", question, [
    { words: "Yes, take them so", said: { confirmed: true } },
    ...otherwise(meant),
  ]);
}

function otherwise({ kind, unit }) {
  if (kind === "price") return [{ words: "No, they are returns", said: { kind: "simple" } }];
  if (unit === "fraction") return [{ words: "No, they are in percent", said: { unit: "percent" } }];
  return [{ words: "No, they are prices", said: { kind: "price" } }];
}

/** Log-returns of a record's values. Refuses the cell that cannot be what it is said to be. */
export function logReturns({ values, cells }, { kind, unit }) {
  if (kind === "price") {
    refuseWhere(values, cells, (value) => value <= 0, "is not above zero, as a price is");
    return bounded(steps(values), cells.slice(1));
  }
  const fractions = values.map((value) => (unit === "percent" ? value / 100 : value));
  if (kind === "log") return bounded(fractions, cells);
  refuseWhere(fractions, cells, (value) => value <= -1, "would be a loss of all and more");
  return bounded(fractions.map(Math.log1p), cells);
}

function bounded(returns, cells) {
  refuseWhere(returns, cells, (value) => Math.abs(value) > LARGEST_LOG_RETURN, "would be a return beyond all bounds");
  return returns.map(rounded);
}

function refuseWhere(values, cells, fails, words) {
  const at = values.findIndex(fails);
  if (at < 0) return;
  const { line, column, text } = cells[at];
  throw new Refusal(`Line ${line}, column ${column}: \u201c${text}\u201d ${words}.`, cells[at]);
}

/** Twelve digits: far more than any return is known to, and short enough to read. */
const rounded = (value) => Number(value.toPrecision(12));
