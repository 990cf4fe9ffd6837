// How amounts of money are written: in the currency that the user of this browser states, or without one.

import { count, MINUS, wealth } from "./format.js";

/** Where the browser keeps the currency of its user. */
const PLACE = "ballast-currency";
/** The letters of a code. */
export const LETTERS = 3;
/** From this size on an amount has no decimals. */
const WHOLE = 1e5;
/** Beyond these sizes an amount has four significant digits. */
const [SMALLEST, LARGEST] = [0.1, 1e9];

const codes = new Set(Intl.supportedValuesOf("currency"));

/** Returns the currency code (ISO 4217) that this browser keeps, or null. */
export function currency() {
  const kept = globalThis.localStorage?.getItem(PLACE);
  return codes.has(kept) ? kept : null;
}

const formats = new Map();

/** Returns the format of a currency with some options, made once: making it takes longer than formatting. */
function format(code, options) {
  const key = `${code} ${JSON.stringify(options)}`;
  if (!formats.has(key)) formats.set(key, new Intl.NumberFormat("en-GB", { style: "currency", currency: code, useGrouping: "min2", ...options }));
  return formats.get(key);
}

/** Formats an amount, without decimals if it is `whole`. */
export function inCurrency(value, whole = false) {
  const code = currency();
  if (code === null || !Number.isFinite(value)) return whole ? count(value) : wealth(value);
  const size = Math.abs(value);
  const isExtreme = size !== 0 && (size < SMALLEST || size >= LARGEST);
  const digits = isExtreme ? { maximumSignificantDigits: 4 } : whole || size >= WHOLE ? { maximumFractionDigits: 0 } : {};
  // An amount that is rounded to nothing has no sign.
  return format(code, digits).format(value).replace(/^-(?=[^1-9]*$)/, "").replace("-", MINUS);
}

/** A smaller share of wealth is left by rounding. */
const ROUNDING = 1e-9;

/** Returns an amount, which is 0 if it is but the rounding of `whole`. */
export const cleared = (amount, whole) => (Math.abs(amount) < ROUNDING * Math.abs(whole) ? 0 : amount);

/** Keeps the currency that a text names, or none; returns whether the text may stand: it names one, is blank, or is not finished. */
export function keepCurrency(text) {
  const code = text.trim().toUpperCase();
  if (codes.has(code)) localStorage.setItem(PLACE, code);
  else localStorage.removeItem(PLACE);
  return codes.has(code) || code.length < LETTERS;
}
