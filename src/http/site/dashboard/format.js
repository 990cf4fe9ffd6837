// Numbers for people: with a unit, and no more digits than mean something.

const NARROW = "\u202f";
export const MINUS = "\u2212";

/** Formatters by their decimals: making one takes far longer than using it. */
const GROUPED = [];

function grouped(value, digits) {
  GROUPED[digits] ??= new Intl.NumberFormat("en-GB", { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: "min2" });
  return GROUPED[digits]
    .format(value)
    .replace(/^-(?=[0.]*$)/, "")
    .replace("-", MINUS);
}

/** Replaces hyphens before numbers by minus signs in a sentence of the service. */
export const minus = (sentence) => sentence.replace(/(^|[\s([\u201c])-(?=[\d.])/g, `$1${MINUS}`);

/** Formats a share or a return, given as a fraction. */
export function percent(fraction, digits = 1) {
  return Number.isFinite(fraction) ? `${grouped(100 * fraction, digits)}${NARROW}%` : "\u2013";
}

/** Formats an allocation; nothing and everything, after rounding, have no decimals. */
export function allocation(fraction) {
  return percent(fraction, [0, 1000].includes(Math.round(1000 * fraction)) ? 0 : 1);
}

/** Formats wealth, in the investor's own unit. */
export function wealth(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.abs(value);
  if (size !== 0 && (size < 0.1 || size >= 1e9)) return significant(value, 4);
  return grouped(value, size >= 1e5 ? 0 : 2);
}

/** Formats `digits` significant digits, with an exponent for very large or small numbers. */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent >= -4 && exponent < 6) return Number(value.toPrecision(digits)).toString().replace("-", MINUS);
  return value
    .toExponential(digits - 1)
    .replace("e+", "e")
    .replaceAll("-", MINUS);
}

/** Formats `digits` significant digits, including trailing zeros, so that all numbers of a column have as many. */
export function figures(value, digits = 3) {
  if (value === 0 || !Number.isFinite(value ?? Number.NaN)) return significant(value, digits);
  const exponent = Math.floor(Math.log10(Math.abs(Number(value.toPrecision(digits)))));
  return exponent >= -4 && exponent < digits ? grouped(value, digits - 1 - exponent) : significant(value, digits);
}

/** Formats a small share in percent, to `digits` significant digits. */
export const percentFigures = (fraction, digits) => `${figures(100 * fraction, digits)}${NARROW}%`;

/** Formats a difference of shares or returns, in percentage points. */
export function points(fraction, digits = 1) {
  return `${grouped(100 * fraction, digits)} points`;
}

/** Returns N for a probability of one in N. */
export const oneIn = (probability) => count(Math.max(1, Math.round(1 / probability)));

/** Formats a number on an axis, with the digits that its `step` needs. */
export function tick(value, step) {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.max(Math.abs(value), Math.abs(step) || Math.abs(value));
  if (size >= 1e7 || (size !== 0 && size < 1e-4)) return significant(value, apart(size, step));
  return grouped(value, Math.min(FINEST, decimals(step)));
}

/** Most decimals on an axis. */
const FINEST = 10;

/** Returns the significant digits that tell numbers of a size apart by steps. */
const apart = (size, step) => (step > 0 ? Math.max(2, power(size) - power(step) + 1) : 2);

const power = (value) => Math.floor(Math.log10(value) + 1e-9);

/** Formats a share on an axis. */
export function percentTick(fraction, step) {
  return percent(fraction, Math.min(FINEST, decimals(100 * step)));
}

/** Returns the decimals that tell multiples of `step` apart. */
function decimals(step) {
  return step > 0 ? Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) : 0;
}

/** Formats a difference of log certainty equivalents, in basis points (1e-4). */
export function basisPoints(value) {
  return value === null || value === undefined ? "\u2013" : `${figures(1e4 * value, 2)}${NARROW}bp`;
}

/** Formats a whole number. */
export function count(value) {
  return grouped(value, 0);
}

/** Formats a count of things with their name. */
export function counted(value, noun, nouns = `${noun}s`) {
  return `${count(value)} ${value === 1 ? noun : nouns}`;
}

/** Formats seconds, to the precision of an estimate. */
export function duration(seconds) {
  if (seconds < 0.95) return `under 1${NARROW}s`;
  if (seconds < 90) return `${Math.round(seconds)}${NARROW}s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)}${NARROW}min`;
  return `${grouped(seconds / 3600, 1)}${NARROW}h`;
}

/** Formats a time by `options`, with months of three letters, as the service writes them. */
export const dateText = (time, options) => new Date(time).toLocaleString("en-GB", options).replace(/\bSept\b/, "Sep");

/** Formats a time, in milliseconds since 1970, in the reader's time zone, which it names. */
export function moment(milliseconds) {
  const options = { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", timeZoneName: "short" };
  return dateText(milliseconds, options);
}

/** Returns the distinctive part of an identifier. */
export function short(id) {
  return id.replace(/^[a-z]+_/, "").slice(0, 10);
}
