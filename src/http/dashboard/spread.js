// What terminal wealth of a strategy is like, read off its histogram: bins even in utility, each even in wealth within.

import { worth } from "./specification.js";

/** Pieces `{from, to, share}` of a strategy's terminal wealth, ascending; one point where every path ends alike. */
export function pieces({ histogram, utility }, edges, asked) {
  if (utility.max.value - utility.min.value <= 1e-12 * Math.abs(utility.max.value)) {
    const all = worth(asked, utility.mean.value);
    return [{ from: all, to: all, share: 1 }];
  }
  const total = histogram.reduce((sum, count) => sum + count, 0);
  const at = edges.map((edge) => worth(asked, edge));
  return histogram.map((count, bin) => ({ from: at[bin], to: at[bin + 1], share: count / total })).filter(({ share }) => share > 0);
}

/** The part of a piece below a level. */
const below = ({ from, to }, level) => (to > from ? Math.min(1, Math.max(0, (level - from) / (to - from))) : Number(from < level));

/** How likely it is to end below a level. */
export const chanceBelow = (spread, level) => spread.reduce((sum, piece) => sum + piece.share * below(piece, level), 0);

/** Shares in `count` bins even in wealth over `[low, high]`. */
export function binned(spread, [low, high], count) {
  const edge = (k) => low + ((high - low) * k) / count;
  // What ends at the last edge belongs to the last bin.
  return Array.from({ length: count }, (_, k) => chanceBelow(spread, k + 1 === count ? Infinity : edge(k + 1)) - chanceBelow(spread, edge(k)));
}
