// Contributions and withdrawals: the amount of each period, the present value of all, and what a start earns in the
// bank alone.

import { wealth } from "./format.js";

/** What is added at the end of `period`, counted from 1; negative where it is withdrawn. */
const added = ({ contributions }, period) =>
  Array.isArray(contributions) ? contributions[period - 1] : contributions;

/** The terms of a period of a session, and the first period by them. */
export const termsOf = ({ terms, renewals }, period) =>
  renewals.findLast((renewal) => renewal.period <= period) ?? { terms, period: 1 };

/** True where nothing is ever added or withdrawn. */
const none = ({ contributions }) => [contributions].flat().every((amount) => amount === 0);

/** The report of an observed period as it stands. */
export const standing = (observation) => observation?.now?.reported ?? observation?.reported ?? {};

/** What was added at the end of a period as it is reported, and what would be of one that is not. */
export function addedIn(history, period) {
  const { terms, period: first } = termsOf(history, period);
  return standing(history.observations[period - 1]).flow ?? added(terms, period - first + 1);
}

/** What the bank paid in a period as it is reported, and what the policy says of one that is not. */
export const rateIn = (history, period) => standing(history.observations[period - 1]).rate ?? termsOf(history, period).terms.rate_per_step;

/** Wealth of selling everything at the start and staying in the bank, after each period up to `horizon`; of those observed as
 * they were reported. */
export function banked(history, horizon) {
  const held = [history.initial_wealth * (1 - history.terms.trading_cost * history.initial_holding)];
  for (let period = 1; period <= horizon; period++) {
    held.push(held[period - 1] * (1 + rateIn(history, period)) + addedIn(history, period));
  }
  return held;
}

/** `{toCome, reserve}` after `step` periods: what later contributions are worth now, and what must stay in the bank for them. */
export function flowsAfter(problem, step) {
  const bank = 1 + problem.rate_per_step;
  let [toCome, reserve] = [0, 0];
  for (let period = problem.horizon; period > step; period--) {
    const amount = added(problem, period);
    [toCome, reserve] = [(amount + toCome) / bank, Math.max(0, (reserve - amount) / bank)];
  }
  return { toCome, reserve };
}

/** What happens at the end of a period, in words; nothing where nothing does. */
export function endWords(amount) {
  if (amount === 0) return "";
  return `At the end of the period ${wealth(Math.abs(amount))} is ${amount > 0 ? "added" : "withdrawn"}.`;
}

/** All contributions, in a sentence. */
export function inWords(problem) {
  const { contributions } = problem;
  if (none(problem)) return "";
  if (Array.isArray(contributions)) {
    const told = (word, amounts) => (amounts.length > 0 ? [`in ${amounts.length} of the periods money is ${word}, ${wealth(Math.abs(amounts.reduce((sum, amount) => sum + amount, 0)))} in all`] : []);
    const words = [...told("added", contributions.filter((amount) => amount > 0)), ...told("withdrawn", contributions.filter((amount) => amount < 0))].join(", and ");
    return `${words[0].toUpperCase()}${words.slice(1)}.`;
  }
  return endWords(contributions).replace("the period", "each period");
}

/** What was added and withdrawn in the periods observed, in all. */
export const netAdded = (history) =>
  history.observations.reduce((net, _, index) => net + addedIn(history, index + 1), 0);
