// Comparators of a session: what fixed shares would have earned from the same start, with the same returns, rates and
// flows.

import { addedIn, rateIn, spentIn, termsOf } from "./flows.js";
import { belowHighest } from "./track.js";

/** Returns the name of what is held besides the bank. */
export const risky = ({ assets }) => (assets ? "the assets" : "stocks");

/** Returns the log-return of an observed period, with corrections applied: minus infinity if everything held was lost, and null if it is missing. */
function returnOf(row) {
  const { log_return, notes = [] } = row.now ?? row;
  const isLost = log_return === null && notes.some(({ reason }) => reason === "total_loss");
  return isLost ? Number.NEGATIVE_INFINITY : log_return;
}

/** Returns the growth of the asset, the bank's rate, and the money added and spent in each observed period, with corrections applied. */
const lived = (history) =>
  history.observations.map((row, index) => ({
    growth: Math.exp(returnOf(row) ?? 0),
    rate: rateIn(history, index + 1),
    cost: termsOf(history, index + 1).terms.trading_cost,
    added: addedIn(history, index + 1),
    spent: spentIn(history, index + 1),
  }));

/** Returns wealth at the start and after each observed period, if the risky asset is rebalanced to `share` in each. */
export function mixed(history, share) {
  let [wealth, holding] = [history.initial_wealth, history.initial_holding];
  return [
    wealth,
    ...lived(history).map(({ growth, rate, cost, added, spent }) => {
      const invested = (wealth - spent) * (1 - cost * Math.abs(share - holding));
      const grown = (1 - share) * (1 + rate) + share * growth;
      const before = invested * grown;
      wealth = before + added;
      // Money added goes to the bank.
      holding = wealth > 0 ? (invested * share * growth) / wealth : share;
      return wealth;
    }),
  ];
}

/** Returns the session's own wealth at the start and after each observed period, with corrections applied. */
export const wealths = (history) => [history.initial_wealth, ...history.observations.map((row) => (row.now ?? row).wealth)];

/** Returns what 100 at the start has become after each period, without money added, withdrawn or spent: the time-weighted return. */
export function grown(history, wealth = wealths(history)) {
  let level = 100;
  return wealth.map((value, index) => (index === 0 ? level : (level *= (value - addedIn(history, index)) / (wealth[index - 1] - spentIn(history, index)))));
}

/** Returns how far wealth lies below its highest so far, 0 or less, without money added or withdrawn. */
export const falls = (history, wealth = wealths(history)) => belowHighest(grown(history, wealth));
