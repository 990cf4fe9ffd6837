// A track record: how far wealth lay below its highest, the worst falls, and returns by year, by month and over rolling
// years.

/** Returns how far each level lies below the highest so far, 0 or less. */
export function belowHighest(levels) {
  let highest = 0;
  return levels.map((level) => {
    highest = Math.max(highest, level);
    return level / highest - 1;
  });
}

/**
 * Returns the worst `most` of `falls`, the deepest first: `{depth, from, to, back}`, with the positions at which each began, was deepest and
 * was recovered; `back` is null if it was not.
 */
export function worstFalls(falls, most) {
  const found = [];
  let fall = null;
  falls.forEach((value, at) => {
    if (value >= 0) {
      if (fall) fall.back = at;
      fall = null;
      return;
    }
    if (!fall) found.push((fall = { depth: 0, from: at - 1, to: at, back: null }));
    if (value < fall.depth) Object.assign(fall, { depth: value, to: at });
  });
  return found.sort((one, other) => one.depth - other.depth).slice(0, most);
}

/** Returns the return of each period, from levels that number one more than the periods. */
export const returnsOf = (levels) => levels.slice(1).map((level, index) => level / levels[index] - 1);

/** Returns at each level the yearly return over the `years` before, with `a_year` levels a year; null if the record is too short there. */
export const rolling = (levels, years, a_year) =>
  levels.map((level, at) => (at < Math.round(years * a_year) ? null : (level / levels[at - Math.round(years * a_year)]) ** (1 / years) - 1));

/** A smaller deviation is rounding. */
const ROUNDING = 1e-12;

/**
 * Returns the figures a year of levels, with `a_year` periods a year and the bank's `rates`: the growth, the deviation of the returns, and the
 * mean excess over the bank by its deviation (Sharpe) and by the deviation of its shortfalls alone (Sortino). A ratio is NaN if it has no
 * deviation.
 */
export function yearlyFigures(levels, rates, a_year) {
  const returns = returnsOf(levels);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const deviation = (values) => {
    const middle = mean(values);
    return Math.sqrt(values.reduce((sum, value) => sum + (value - middle) ** 2, 0) / (values.length - 1));
  };
  const excess = returns.map((back, index) => back - rates[index]);
  const ratio = (size) => (size > ROUNDING ? (mean(excess) / size) * Math.sqrt(a_year) : Number.NaN);
  return {
    growth: (levels.at(-1) / levels[0]) ** (a_year / returns.length) - 1,
    deviation: deviation(returns) * Math.sqrt(a_year),
    sharpe: ratio(deviation(excess)),
    sortino: ratio(Math.sqrt(mean(excess.map((back) => Math.min(0, back) ** 2)))),
  };
}

/** Compounds successive returns into one. */
export const compounded = (returns) => returns.reduce((level, back) => level * (1 + back), 1) - 1;

/**
 * Returns where each period belongs: `{year, part}`. The part is, for example, the month, or null if the years have no named parts. Without
 * dates years are counted from 1.
 */
export function places(dates, length, periods_per_year) {
  if (dates) return dates.map((date) => ({ year: date.slice(0, 4), part: date.slice(5, 7) || null }));
  const parted = periods_per_year > 1 && periods_per_year <= 12;
  return Array.from({ length }, (_, k) => ({
    year: String(Math.floor(k / periods_per_year) + 1),
    part: parted ? String((k % periods_per_year) + 1) : null,
  }));
}

/** Groups the indices of the periods by `key`, in their order: `[[key, indices], ...]`. */
export function grouped(places, key) {
  const groups = new Map();
  places.forEach((place, index) => {
    const name = key(place);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(index);
  });
  return [...groups];
}
