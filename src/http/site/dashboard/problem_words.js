// A refusal in the words of the form: the field by its label, its value and bounds in the unit of the field.

import { inCurrency } from "./money.js";
import { whichDay } from "./periods.js";

const MINUS = "\u2212";
/** The parser's names for types of numbers, and the page's. */
const WANTED = [
  [/expected (u8|u16|u32|u64|usize)/, "a whole number, zero or more"],
  [/expected (i32|i64)/, "a whole number"],
  [/expected (f32|f64)/, "a number without thousands separators"],
];
/** The start of a parser's message, before what it expects. */
const PARSER = /^(?:invalid (?:type|value|length)|unknown (?:variant|field)|missing field)[^]*?, expected /;
const BOUNDS = /(lies?|be a number|be a whole number)? ?in ([[(])(-?[\d.e+-]+), (-?[\d.e+-]+)([\])])/;

/** Replacements for the names of request fields in a rule; `ahead` is the label of the field for the horizon. */
const places = (ahead) => [
  [/problem\.horizon = (?=\d)/g, ""],
  [/problem\.contributions/g, "the money added"],
  [/(?:the )?(?:problem\.)?\bhorizon\b/g, ahead ? `\u201c${ahead}\u201d` : "the number of periods ahead"],
  [/(?<=\bgive a wealth of )-?[\d.e+-]+/g, (amount) => inCurrency(Number(amount))],
];
/** The messages of the parser of dates. */
const NO_DAY = /^(?:failed to parse|unexpected|expected)[^]*\b(?:year|month|day|date)\b/;

/** Returns one sentence for a problem with a `rule`. `unit` is that of the field, if it differs from the request's: "percent", or "confidence",
 * which is 100 % minus the request's share. `ahead` is as above, if the form has such a field. */
export function problemWords({ value, rule }, label, unit, ahead) {
  const name = label.replace(/, %(?=$|,)/, "");
  const which = NO_DAY.test(rule) && whichDay(String(value));
  if (which) return `${name} ${given(value)}; it ${which}.`;
  const words = ruled(rule, unit, ahead);
  // A rule without "must" gives a reason instead of a bound on the value.
  return /^must\b/.test(words) ? `${name} ${given(value, unit)}; it ${words}.` : `${name}: ${words}.`;
}

function given(value, unit) {
  if (value === null || value === undefined || value === "" || value === "0 letters") return "is blank";
  if (typeof value === "object") return "has the wrong form";
  return typeof value === "number" ? `is ${number(value, unit)}` : `is \u201c${value}\u201d`;
}

function ruled(rule, unit, ahead) {
  const wanted = WANTED.find(([pattern]) => pattern.test(rule));
  if (wanted) return `must be ${wanted[1]}`;
  if (PARSER.test(rule)) return `must be ${rule.replace(PARSER, "").replaceAll("`", "")}`;
  if (NO_DAY.test(rule)) return "must be a date such as 2008-09-30";
  const whole = rule.includes("whole number") ? "a whole number " : "";
  const named = places(ahead).reduce((words, [place, name]) => words.replace(place, name), rule);
  return named.replace(BOUNDS, (_, verb, opening, low, high, closing) => {
    const be = verb === "lies" ? "lies" : "be";
    const turned = unit === "confidence";
    const [ends, marks] = turned ? [[high, low], [closing, opening]] : [[low, high], [opening, closing]];
    const closed = marks.map((mark) => mark === "[" || mark === "]");
    if (closed[0] && closed[1]) return `${be} ${whole}from ${number(ends[0], unit, Math.ceil)} to ${number(ends[1], unit, Math.floor)}`;
    const [above, below] = [closed[0] ? "at least" : "above", closed[1] ? "at most" : "below"];
    return `${be} ${whole}${above} ${number(ends[0], unit)} and ${below} ${number(ends[1], unit)}`;
  });
}

/** Formats a number in the field's unit; bounds in percent are rounded inward, so that the bounds shown are accepted. */
function number(value, unit, round = Math.round) {
  const size = unit === "confidence" ? 1 - Number(value) : Number(value);
  // Removes the error of the double first, so that it does not change the rounding.
  const shown = unit ? round(Number((1e4 * size).toPrecision(12))) / 100 : size;
  const text = shown.toLocaleString("en-GB", { maximumFractionDigits: 6, useGrouping: "min2" }).replace("-", MINUS);
  return unit ? `${text}\u202f%` : text;
}
