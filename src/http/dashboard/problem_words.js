// A refusal in the words of the form: the field by its label, the value and its bounds in the unit of the field.

const MINUS = "\u2212";
/** What the service's parser calls the types of numbers. */
const WANTED = [
  [/expected (u8|u16|u32|u64|usize)/, "a whole number, zero or more"],
  [/expected (i32|i64)/, "a whole number"],
  [/expected (f32|f64)/, "a number, with nothing between its thousands"],
];
const BOUNDS = /(?:lie|be a number|be a whole number)? ?in ([[(])(-?[\d.e+-]+), (-?[\d.e+-]+)([\])])/;

/** One sentence for a problem with a `rule`; `unit` is "percent" where the field counts so and the request does not. */
export function problemWords({ value, rule }, label, unit) {
  const name = label.replace(/, %$/, "");
  return `${name} ${given(value, unit)}; it ${ruled(rule, unit)}.`;
}

function given(value, unit) {
  if (value === null || value === undefined || value === "") return "is blank";
  return typeof value === "number" ? `is ${number(value, unit)}` : `is \u201c${value}\u201d`;
}

function ruled(rule, unit) {
  const wanted = WANTED.find(([pattern]) => pattern.test(rule));
  if (wanted) return `must be ${wanted[1]}`;
  const whole = rule.includes("whole number") ? "a whole number " : "";
  return rule.replace(BOUNDS, (_, opening, low, high, closing) => {
    if (opening === "[" && closing === "]")
      return `be ${whole}from ${number(low, unit, Math.ceil)} to ${number(high, unit, Math.floor)}`;
    const [above, below] = [opening === "[" ? "at least" : "above", closing === "]" ? "at most" : "below"];
    return `be ${whole}${above} ${number(low, unit)} and ${below} ${number(high, unit)}`;
  });
}

/** A number in the field's unit; bounds in percent are rounded inward, so that what is told is taken. */
function number(value, unit, round = Math.round) {
  const size = Number(value);
  const shown = unit === "percent" ? round(1e4 * size) / 100 : size;
  const text = shown.toLocaleString("en-GB", { maximumFractionDigits: 6, useGrouping: "min2" }).replace("-", MINUS);
  return unit === "percent" ? `${text}\u202f%` : text;
}
