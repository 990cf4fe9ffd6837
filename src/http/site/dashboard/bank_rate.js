// The bank's return, typed per period or per year; the service counts per period.

import { input, select } from "./form.js";
import { fraction, typed } from "./number_text.js";

/** The ending of a number that is meant for a year. */
const A_YEAR = /\s*(?:(?:a|per|\/)\s*(?:year|annum)|p\.?\s?a\.?)$/i;

const short = (value) => String(Number(value.toPrecision(10)));

/** Returns `{parts, read(periods), show(rate, periods), named(unit)}`. `read` gives the rate of a period as a fraction: null if the field is
 * blank, undefined if the rate is for a year and the periods a year are unknown, and the text if it is not a number. `changed()` is called
 * at every edit. */
export function bankRate({ name, note, changed = () => {} }) {
  const rate = input({
    name,
    label: "Bank return per period, %",
    note,
    unit: "percent",
    changed: (text) => {
      if (A_YEAR.test(text)) {
        per.control.value = "year";
        named(unit);
      }
      changed();
    },
  });
  const per = select({
    name: `${name}.told`,
    label: "The bank return is",
    choices: { period: "for a period", year: "for a year" },
    changed: () => {
      named(unit);
      changed();
    },
  });
  let unit = "period";
  const isYearly = () => per.control.value === "year";
  const named = (word) => {
    unit = word;
    rate.element.querySelector("label").textContent = `Bank return per ${isYearly() ? "year" : unit}, %`;
    per.control.options[0].textContent = `for a ${unit}`;
  };
  const read = (periods) => {
    const text = rate.control.value.trim().replace(A_YEAR, "");
    if (text === "") return null;
    const value = fraction(text) ?? typed(text);
    if (!isYearly() || typeof value !== "number") return value;
    return periods > 0 ? Number(Math.expm1(Math.log1p(value) / periods).toPrecision(12)) : undefined;
  };
  const show = (value, periods) => {
    if (rate.control === document.activeElement || per.control === document.activeElement) return;
    if (value === null || value === undefined) {
      if (read(periods) !== undefined) rate.control.value = "";
      return;
    }
    if (typeof value !== "number") return;
    if (isYearly() && !(periods > 0)) per.control.value = "period";
    rate.control.value = short(100 * (isYearly() ? Math.expm1(periods * Math.log1p(value)) : value));
    named(unit);
  };
  return { rate, per, parts: [rate, per], read, show, named, isYearly };
}
