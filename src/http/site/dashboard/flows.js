// Contributions and withdrawals: the amount of each period, and what a start earns in the bank alone.

import { inCurrency } from "./money.js";

/** Returns the money added at the end of `period`, counted from 1; negative if it is withdrawn. */
const added = ({ contributions }, period) =>
  Array.isArray(contributions) ? contributions[period - 1] : contributions;

/** Returns the terms of a session's period, and the first period under them. */
export const termsOf = ({ terms, renewals }, period) =>
  renewals.findLast((renewal) => renewal.period <= period) ?? { terms, period: 1 };

/** Tells whether nothing is ever added or withdrawn. */
const none = ({ contributions }) => [contributions].flat().every((amount) => amount === 0);

/** Returns the report of an observed period, with corrections applied. */
export const standing = (observation) => observation?.now?.reported ?? observation?.reported ?? {};

/** Returns the money added at the end of a period: as reported, otherwise by the policy. */
export function addedIn(history, period) {
  const { terms, period: first } = termsOf(history, period);
  return standing(history.observations[period - 1]).flow ?? added(terms, period - first + 1);
}

/** Returns the bank's rate of a period: as reported, otherwise the policy's. */
export const rateIn = (history, period) => standing(history.observations[period - 1]).rate ?? termsOf(history, period).terms.rate_per_step;

/** Returns the money spent at the start of an observed period, with corrections applied; 0 if nothing was. */
export function spentIn(history, period) {
  return history.observations[period - 1]?.account?.spent ?? 0;
}

/** Returns wealth after each period up to `horizon`, if everything is sold at the start and stays in the bank. Observed periods count as
 * reported. */
export function banked(history, horizon) {
  const held = [history.initial_wealth * (1 - history.terms.trading_cost * history.initial_holding)];
  for (let period = 1; period <= horizon; period++) {
    held.push((held[period - 1] - spentIn(history, period)) * (1 + rateIn(history, period)) + addedIn(history, period));
  }
  return held;
}

/** Says what is added or withdrawn at the end of a period; blank if nothing is. */
export function endWords(amount) {
  if (amount === 0) return "";
  return `At the end of the period ${inCurrency(Math.abs(amount))} is ${amount > 0 ? "added" : "withdrawn"}.`;
}

/** Says all contributions in a sentence. */
export function inWords(problem) {
  const { contributions } = problem;
  if (none(problem)) return "";
  if (Array.isArray(contributions)) {
    const told = (word, amounts) => (amounts.length > 0 ? [`in ${amounts.length} of the periods money is ${word}, ${inCurrency(Math.abs(amounts.reduce((sum, amount) => sum + amount, 0)))} in all`] : []);
    const words = [...told("added", contributions.filter((amount) => amount > 0)), ...told("withdrawn", contributions.filter((amount) => amount < 0))].join(", and ");
    return `${words[0].toUpperCase()}${words.slice(1)}.`;
  }
  return endWords(contributions).replace("the period", "each period");
}

/** Returns the net money added in all observed periods. */
export const netAdded = (history) =>
  history.observations.reduce((net, _, index) => net + addedIn(history, index + 1), 0);
