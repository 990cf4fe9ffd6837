// Numbers as people and programs write them: either decimal mark, with or without thousands separators, a percent sign,
// any minus.
//
// No number may start with a zero before another digit: 012 remains of 0,012 if the comma was misread. The same holds
// for -0.

const WHOLE = "(?:0|[1-9]\\d*)";
const pattern = (mark, apart) =>
  new RegExp(
    `^[+-]?(?:(?:${WHOLE}|[1-9]\\d{0,2}(?:${apart}\\d{3})+)(?:${mark}\\d*)?|${mark}\\d+)(?:e[+-]?\\d+)?$`,
    "i",
  );
const PATTERNS = {
  point: pattern("\\.", "[,'\u2019\u00a0\u202f ]"),
  comma: pattern(",", "[.'\u2019\u00a0\u202f ]"),
};
/** The thousands separators for each decimal mark. */
const APART = { point: /[,'\u2019\u00a0\u202f ]/g, comma: /[.'\u2019\u00a0\u202f ]/g };

const bare = (text) =>
  text
    .trim()
    .replace(/^[\u2212\u2013]/, "-")
    .replace(/\s*%$/, "");

/** Tells whether `text` is a number with the given decimal mark. */
function isNumber(text, decimal) {
  const plain = bare(text);
  return plain !== "-0" && PATTERNS[decimal].test(plain);
}

/** Returns the number in `text`, for which `isNumber` must hold. A percent sign does not divide it. */
function numberOf(text, decimal) {
  const joined = bare(text).replace(APART[decimal], "");
  return Number(decimal === "comma" ? joined.replace(",", ".") : joined);
}

const hasPercent = (text) => /%\s*$/.test(text);

/**
 * Reads a number typed by itself. Returns null if the text is blank, and the text if it is not a number or is ambiguous, such as 100,000.
 * With `shares`, 0.2 % is 0.002.
 */
export function typed(text, { shares = false } = {}) {
  if (text.trim() === "") return null;
  const values = ["point", "comma"]
    .filter((decimal) => isNumber(text, decimal))
    .map((decimal) => numberOf(text, decimal));
  if (new Set(values).size !== 1 || (hasPercent(text) && !shares)) return text.trim();
  return hasPercent(text) ? hundredth(values[0]) : values[0];
}

/** Reads a number with a decimal point and no commas, as formulas and JSON have it. Returns null if the text is blank, and the text if it is not
 * one. */
export function pointed(text) {
  if (text.trim() === "") return null;
  return isNumber(text, "point") && !/[,%]/.test(text) ? numberOf(text, "point") : text.trim();
}

/** Returns a number typed in percent as a fraction, or null if it is not a number. */
export function fraction(text) {
  const value = typed(bare(text));
  return typeof value === "number" ? hundredth(value) : null;
}

/** Turns percent into a fraction without rounding: the decimal point moves in the text. */
export function hundredth(percent) {
  const [digits, power = "0"] = String(percent).split("e");
  return Number(`${digits}e${Number(power) - 2}`);
}
