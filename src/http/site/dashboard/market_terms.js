// What a record says about its periods: how many make a year, and what the bank pays. A user can change both.

import { bankRate } from "./bank_rate.js";
import { h } from "./dom.js";
import { select } from "./form.js";
import { percent } from "./format.js";
import { unitOf } from "./periods.js";
import { CALENDARS } from "./train_fields.js";

/** What the bank pays in a year until somebody says otherwise, in percent. */
const BANK = "2";
const ASSUMED = "Assumed until you change it.";

/** Returns `{parts, take(reading), periods(), rate(), choices(), keep(), restore(kept)}`. `take` takes over the periods a year and the bank's
 * rate of a record; what an earlier record filled in and this one does not say is as at the start again. `rate()` gives the rate of a period; `{field, message}` is thrown if it or the periods a year are missing. `choices()` are
 * those of a training's form. `changed()` is called at every edit. */
export function marketTerms(changed) {
  let [isRateTyped, isOfDates, held] = [false, false, null];
  const named = () => bank.named(unitOf(periods()));
  const yearly = select({
    name: "problem.periods_per_year",
    label: "Periods a year",
    note: "By the dates of the record, if it has any.",
    choices: CALENDARS,
    changed: () => {
      isOfDates = false;
      named();
      changed();
    },
  });
  const bank = bankRate({
    name: "problem.rate_per_step",
    note: ASSUMED,
    changed: () => {
      isRateTyped = true;
      note.textContent = "";
      changed();
    },
  });
  const note = bank.rate.element.querySelector(".note");
  const assume = () => {
    bank.per.control.value = "year";
    bank.rate.control.value = BANK;
    note.textContent = ASSUMED;
  };
  assume();
  bank.named("period");
  const periods = () => Number(yearly.control.value) || null;
  const offer = (value) => {
    if (![...yearly.control.options].some((option) => option.value === value)) yearly.control.append(h("option", { value }, `${value} periods`));
    yearly.control.value = value;
  };
  const take = ({ periods_per_year, rate }) => {
    const kept = held;
    held = null;
    if (kept) return named();
    if (periods_per_year) offer(String(periods_per_year));
    else if (isOfDates) yearly.control.value = "";
    isOfDates = Boolean(periods_per_year);
    if (!isRateTyped) assume();
    if (rate && !isRateTyped) {
      bank.show(rate.rates.at(-1), periods());
      bank.rate.control.value = Number(bank.rate.control.value).toFixed(2);
      note.textContent = `The last of column ${rate.column}.`;
    }
    named();
  };
  const rate = () => {
    if (yearly.control.value === "") throw { field: yearly.name, message: "The record has no dates that show it: choose how many periods make a year." };
    const value = bank.read(periods());
    if (value === null) throw { field: bank.rate.name, message: "Say what the bank pays; 0 if nothing." };
    if (value === undefined) throw { field: bank.rate.name, message: "A bank return per year needs the periods a year." };
    return value;
  };
  const choices = () => ({ told: bank.per.control.value, periods: yearly.control.value });
  const keep = () => ({ ...choices(), rate: bank.rate.control.value, note: note.textContent, isRateTyped, isOfDates });
  /** Shows the terms that were kept, which the next reading of the record leaves as they are. */
  const restore = (kept) => {
    held = kept;
    [isRateTyped, isOfDates] = [kept.isRateTyped, kept.isOfDates];
    offer(kept.periods);
    bank.per.control.value = kept.told;
    bank.rate.control.value = kept.rate;
    note.textContent = kept.note;
    named();
  };
  return { parts: [...bank.parts, yearly], take, periods, rate, choices, keep, restore };
}

/** Says what the bank and the record paid in a year, if the service says it. */
export function yearlyWords({ annualised }, ofWhat = "") {
  if (!annualised) return "";
  const { rate, mean_return, deviation } = annualised;
  return h("p", { class: "note" }, `The bank pays ${percent(rate, 2)} a year. The record has a mean of ${percent(mean_return)} a year, with a deviation of ${percent(deviation)}${ofWhat}.`);
}
