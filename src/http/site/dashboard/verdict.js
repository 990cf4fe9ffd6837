// The results of comparisons of strategies, in sentences: for simulated futures and for walk-forward backtests alike.

import { percent, tick } from "./format.js";

export const ordinal = (place) => `${place}${{ 1: "st", 2: "nd", 3: "rd" }[place % 100 > 10 && place % 100 < 14 ? 0 : place % 10] ?? "th"}`;

/** Formats an estimate with its range. */
export const interval = ({ value, low, high }, format) => `${format(value)} (${format(low)} to ${format(high)})`;

/** Says whether changing the share held earned more than holding its average throughout. `beyond` is an estimate, `shown` the evidence, such as "the record does". */
export function changing({ name, allocation, beyond, shown }) {
  const { value, low, high } = beyond;
  const size = interval(value < 0 ? { value: -value, low: -high, high: -low } : beyond, (amount) => tick(amount, 0.01));
  const verdict = low > 0 || high < 0 ? "" : `: ${shown} not show that it made a difference`;
  return `${name} holds ${percent(allocation)} on average; changing the share ${value < 0 ? "cost" : "earned"} ${size} compared with holding that average throughout${verdict}.`;
}
