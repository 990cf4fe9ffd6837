// A track record: how far wealth lay below its highest, the worst falls, and returns by year, by month and over rolling
// years.

/** How far each level lies below the highest so far, 0 or less. */
export function belowHighest(levels) {
  let highest = 0;
  return levels.map((level) => {
    highest = Math.max(highest, level);
    return level / highest - 1;
  });
}

/**
 * The worst `most` of `falls`, the deepest first: `{depth, from, to, back}`, the positions at which each began, was deepest
 * and was made good; `back` is null where it was not.
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

/** The return of each period, of levels one more than there are periods. */
export const returnsOf = (levels) => levels.slice(1).map((level, index) => level / levels[index] - 1);

/** At each level the return a year since `years` before, of levels `a_year` to the year; null where there is nothing so long before. */
export const rolling = (levels, years, a_year) =>
  levels.map((level, at) => (at < Math.round(years * a_year) ? null : (level / levels[at - Math.round(years * a_year)]) ** (1 / years) - 1));

/** Returns one after the other, as one. */
export const compounded = (returns) => returns.reduce((level, back) => level * (1 + back), 1) - 1;

/**
 * Where each period belongs: `{year, part}`, the part such as its month, or null where years have none that have names. Without
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

/** Indices of the periods that have the same `key`, in their order: `[[key, indices], ...]`. */
export function grouped(places, key) {
  const groups = new Map();
  places.forEach((place, index) => {
    const name = key(place);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(index);
  });
  return [...groups];
}
