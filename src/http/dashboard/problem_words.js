// A refusal in the words of the form: the field by its label, its value and bounds in the unit of the field.

import { wealth } from "./format.js";

const MINUS = "\u2212";
/** What the service's parser calls the types of numbers. */
const WANTED = [
  [/expected (u8|u16|u32|u64|usize)/, "a whole number, zero or more"],
  [/expected (i32|i64)/, "a whole number"],
  [/expected (f32|f64)/, "a number without thousands separators"],
];
/** What else the parser says before what it wants. */
const PARSER = /^(?:invalid (?:type|value|length)|unknown (?:variant|field)|missing field)[^]*?, expected /;
const BOUNDS = /(lies?|be a number|be a whole number)? ?in ([[(])(-?[\d.e+-]+), (-?[\d.e+-]+)([\])])/;

/** What a rule names by its place in the request; `ahead` is the label of the field that says how far is looked ahead. */
const places = (ahead) => [
  [/problem\.horizon = (?=\d)/g, ""],
  [/problem\.contributions/g, "the money added"],
  [/(?:the )?(?:problem\.)?\bhorizon\b/g, ahead ? `\u201c${ahead}\u201d` : "the number of periods ahead"],
  [/(?<=\bgive a wealth of )-?[\d.e+-]+/g, (amount) => wealth(Number(amount))],
];
/** What the parser of days says of what is none. */
const NO_DAY = /^(?:failed to parse|unexpected|expected)[^]*\b(?:year|month|day|date)\b/;

/** One sentence for a problem with a `rule`; `unit` is that of the field where it is not the request's: "percent", or "confidence",
 * which is what a share leaves of 100 %; `ahead` as above, where the form has such a field. */
export function problemWords({ value, rule }, label, unit, ahead) {
  const name = label.replace(/, %(?=$|,)/, "");
  const words = ruled(rule, unit, ahead);
  // Of what is asked for and cannot be had, the rule says why, and does not bound a value.
  return /^must\b/.test(words) ? `${name} ${given(value, unit)}; it ${words}.` : `${name}: ${words}.`;
}

function given(value, unit) {
  if (value === null || value === undefined || value === "") return "is blank";
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

/** A number in the field's unit; bounds in percent are rounded inward, so that what is told is taken. */
function number(value, unit, round = Math.round) {
  const size = unit === "confidence" ? 1 - Number(value) : Number(value);
  // Inward, but not by what a double is off.
  const shown = unit ? round(Number((1e4 * size).toPrecision(12))) / 100 : size;
  const text = shown.toLocaleString("en-GB", { maximumFractionDigits: 6, useGrouping: "min2" }).replace("-", MINUS);
  return unit ? `${text}\u202f%` : text;
}
