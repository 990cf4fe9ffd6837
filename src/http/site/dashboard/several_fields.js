// The fields for a period of several assets, in its report and in its correction: the return of each, and further
// details.

import { h } from "./dom.js";
import { standing } from "./flows.js";
import { input, select } from "./form.js";
import { allocation, percent } from "./format.js";
import { inCurrency } from "./money.js";
import { fraction, typed } from "./number_text.js";
import { dayOf } from "./periods.js";
import { dayField, inPercent, LIMITS, spentField } from "./report_fields.js";

const KINDS = { simple: "Gains or losses", partly: "Blank where no price came", missing: "Not known" };

/** Returns the names of a session's present assets; undefined for one asset. */
export const presentAssets = ({ assets, renewals }) => renewals.findLast(({ names }) => names)?.names ?? assets;

/** Returns the names of all assets that a session has or had, the first ones first. */
export const everyAsset = ({ assets = [], renewals }) => [...new Set([...assets, ...renewals.flatMap(({ names }) => names ?? [])])];

/** Returns the log-return of each asset in an observed period, counted from 0, with corrections applied: null for an asset whose price did not
 * come, and for all if they are missing. */
export function assetReturns({ observations }, index) {
  const row = observations[index].now ?? observations[index];
  const lost = (row.notes ?? []).filter(({ reason }) => reason === "total_loss").map(({ asset }) => asset);
  const back = row.assets.log_returns;
  return back && Object.fromEntries(Object.entries(back).map(([name, value]) => [name, lost.includes(name) ? Number.NEGATIVE_INFINITY : value]));
}

/** Returns the simple return of a log-return, NaN if there is none. */
export const simpleReturn = (log_return) => Math.expm1(log_return ?? Number.NaN);

/** Returns the share held of each asset in an observed period, with corrections applied; by default the share advised then. */
export const assetsHeld = (row) => standing(row).executed_allocations ?? row.assets.advised_allocations;

/**
 * Returns the fields. `advised` are the shares that blank fields mean, or null for the advice of that time. `rate` and `contribution` are the
 * policy's; `contribution` is null if it differs from period to period. `date` is the expected last day.
 */
export function severalFields(assets, { within = "", advised, rate, contribution, spending, date = null, changed = null }) {
  const part = (list, label, note) =>
    assets.map((name, index) => input({ within: `${within}asset-${index}-`, name: `${list}.${name}`, label: label(name), note: note(name), unit: "percent", changed }));
  const returns = part("simple_returns", (name) => `Return of ${name}, %`, () => null);
  const held = part("executed_allocations", (name) => `${name} held, %`, (name) => (advised ? `Blank: the ${allocation(advised[name])} advised.` : "Blank: as advised."));
  const field = (name, label, note, more = {}) => input({ within, name, label, note, changed, ...more });
  const day = dayField(within, date);
  const paid = field("rate", "The bank paid, %", `Blank: ${percent(rate, 3)}, the policy\u2019s.`, { unit: "percent" });
  const flow = field("flow", "Money added at the end", `Blank: ${contribution === null ? "the policy\u2019s amount" : `${inCurrency(contribution)}, the policy\u2019s`}. \u2212100 is a withdrawal of 100.`);
  const reached = field("wealth", "Wealth reached", "Blank: computed from the other fields.");
  const spent = spentField(within, spending, changed);
  const isMissing = () => kind.control.value === "missing";
  const isPartly = () => kind.control.value === "partly";
  const silenced = () => returns.forEach(({ control }) => (control.disabled = isMissing()));
  const kind = select({
    within,
    name: "kind",
    label: "Returns",
    choices: KINDS,
    changed: () => {
      silenced();
      changed?.();
    },
  });
  const elements = (fields) => h("div", { class: "fields" }, fields.map(({ element }) => element));
  const more = h("details", {}, h("summary", {}, "I held other shares, or money came or went"), elements([...held, paid, flow, reached]));
  const text = ({ control }) => control.value.trim();
  const byName = (fields, blank) => Object.fromEntries(assets.map((name, index) => [name, text(fields[index]) === "" ? blank(name) : (fraction(text(fields[index])) ?? text(fields[index]))]));
  const isHeldSaid = () => held.some((field) => text(field) !== "");
  return {
    element: h("div", {}, elements([...returns, ...(spent ? [spent] : []), day, kind]), more),
    /** Fills the fields with the report of an observed period, with corrections applied. */
    fill(history, index) {
      const [said, back] = [standing(history.observations[index]), assetReturns(history, index)];
      assets.forEach((name, at) => {
        const known = (back?.[name] ?? null) !== null;
        returns[at].control.value = known ? inPercent(said.simple_returns?.[name] ?? Math.expm1(back[name])) : "";
        held[at].control.value = inPercent(said.executed_allocations?.[name]);
      });
      for (const [{ control }, value] of [[paid, inPercent(said.rate)], [flow, said.flow], [reached, said.wealth], [day, said.date], ...(spent ? [[spent, said.spent]] : [])]) control.value = value ?? "";
      const isPartly = back && assets.some((name) => (back[name] ?? null) === null);
      kind.control.value = !back ? "missing" : isPartly ? "partly" : "simple";
      silenced();
    },
    trouble() {
      const allowed = (field) => fraction(text(field)) !== null || (isPartly() && text(field) === "");
      const wrong = isMissing() ? null : returns.find((field) => !allowed(field));
      if (wrong) return { field: wrong.name, message: text(wrong) === "" ? "The return is blank." : `\u201c${text(wrong)}\u201d is not a percentage.` };
      const bare = isHeldSaid() && !advised ? held.find((field) => text(field) === "") : null;
      return bare ? { field: bare.name, message: "Give the share of every asset, or of none." } : null;
    },
    report() {
      const report = isMissing() ? { missing: true } : { simple_returns: byName(returns, () => null) };
      if (isHeldSaid()) report.executed_allocations = byName(held, (name) => advised[name]);
      for (const [field, read] of [[paid, fraction], [flow, typed], [reached, typed], [day, dayOf], ...(spent ? [[spent, typed]] : [])]) if (text(field) !== "") report[field.name] = read(text(field)) ?? text(field);
      return report;
    },
    /** Returns the values for `foretold`, or null if a field cannot be read; a missing return counts as 0. */
    read() {
      const blank = (field, otherwise, read) => (text(field) === "" ? otherwise : read(text(field)));
      const unmoved = (field) => isMissing() || (isPartly() && text(field) === "");
      const back = returns.map((field) => (unmoved(field) ? 0 : fraction(text(field))));
      const shares = held.map((field, index) => blank(field, advised[assets[index]], fraction));
      const [paying, added, ended] = [blank(paid, rate, fraction), blank(flow, contribution, typed), blank(reached, Number.NaN, typed)];
      const used = spent ? blank(spent, spending?.amount ?? 0, typed) : 0;
      if ([...back, ...shares, paying, added, ended, used].some((number) => typeof number !== "number")) return null;
      const parts = assets.map((_, index) => ({ held: shares[index], growth: 1 + back[index] }));
      const all = (fields, values, limits) => fields.map((field, index) => [field, values[index], limits]);
      const numbers = [...all(returns, back, LIMITS.simple_return), ...all(held, shares, LIMITS.share), [paid, paying, LIMITS.rate], [reached, ended, LIMITS.wealth], ...(spent ? [[spent, used, LIMITS.spent]] : [])];
      return { parts, rate: paying, added, ended, spent: used, missing: isMissing(), numbers, flow, reached };
    },
  };
}
