// The names of a session's periods: their dates if those are reported, and otherwise their numbers.

import { standing } from "./flows.js";
import { dateText } from "./format.js";

const DAY = 86_400_000;
/** A day less than so many days away needs no year. */
const NEAR = 200;
/** The units of time: the least and most days between two last days, and the unit's months or days. */
const UNITS = [
  { unit: "day", least: 1, most: 4 },
  { unit: "week", least: 6, most: 8, days: 7 },
  { unit: "month", least: 26, most: 33, months: 1 },
  { unit: "quarter", least: 86, most: 95, months: 3 },
  { unit: "year", least: 360, most: 371, months: 12 },
];
/** The unit for a number of periods in a year. */
const A_YEAR = { 1: "year", 4: "quarter", 12: "month", 52: "week" };
/** This many periods a year or more are trading days. */
const DAILY = 200;

/** Returns the unit of a period, such as "month", by the periods a year; "period" if they are unknown. */
export const unitOf = (periods_per_year) =>
  periods_per_year >= DAILY ? "day" : (A_YEAR[Math.round(periods_per_year)] ?? "period");

/** Returns midnight, UTC, of a day such as "2008-09-30". */
const parsed = (date) => Date.parse(`${date}T00:00:00Z`);
const written = (time) => new Date(time).toISOString().slice(0, 10);
const told = (time, options) => dateText(time, { timeZone: "UTC", ...options });

/** Returns the days that a text may mean: year first, as 30.9.2008, or with slashes in both orders. None if it is not a day. */
function daysOf(text) {
  const [, ...yearFirst] = /^(\d{4})-(\d\d?)-(\d\d?)$/.exec(text) ?? [];
  const [, ...dayFirst] = /^(\d\d?)\.(\d\d?)\.(\d{4})$/.exec(text) ?? [];
  const [, one, two, year] = /^(\d\d?)\/(\d\d?)\/(\d{4})$/.exec(text) ?? [];
  const orders = [yearFirst, dayFirst.reverse(), ...(year ? [[year, two, one], [year, one, two]] : [])];
  const days = orders.map((parts) => parts.map((part) => part.padStart(2, "0")).join("-"));
  return [...new Set(days)].filter((date) => Number.isFinite(parsed(date)) && written(parsed(date)) === date);
}

/** Reads a day and returns it as 2008-09-30. Null if the text is not a day, or may be two, as 1/2/2008. */
export function dayOf(text) {
  const [date = null, other] = daysOf(text);
  return other === undefined ? date : null;
}

/** Asks which of two days a text such as 1/2/2008 means; null if it does not mean two. */
export function whichDay(text) {
  const days = daysOf(text);
  return days.length === 2 ? `may be ${days.map(day).join(" or ")}: write ${days.join(" or ")}` : null;
}

/** Formats a day as 30 Sep 2008. */
export const day = (date) => told(parsed(date), { day: "numeric", month: "short", year: "numeric" });

/** Formats a day as above, without the year if it is near `today`. */
export const nearDay = (date, today) => (Math.abs(parsed(date) - parsed(today)) < NEAR * DAY ? told(parsed(date), { day: "numeric", month: "short" }) : day(date));

/** Formats a day with its year, a month as September 2008, and leaves a year as it is. */
export const dated = (date) => (date.length > 7 ? day(date) : date.length > 4 ? told(parsed(`${date}-01`), { month: "long", year: "numeric" }) : date);

/** Returns the time some months later; the last day of a month stays the last day. */
function later(time, months) {
  const from = new Date(time);
  const last = (year, month) => new Date(Date.UTC(year, month + 1, 0)).getUTCDate();
  const isLast = from.getUTCDate() === last(from.getUTCFullYear(), from.getUTCMonth());
  const [year, month] = [from.getUTCFullYear(), from.getUTCMonth() + months];
  return Date.UTC(year, month, isLast ? last(year, month) : Math.min(from.getUTCDate(), last(year, month)));
}

/** Returns the reader's local day, as 2008-09-30. */
export const isoDay = (now) => [now.getFullYear(), now.getMonth() + 1, now.getDate()].map((part) => String(part).padStart(2, "0")).join("-");

/** Returns the last day on or before `today` that ended a period; null if the periods a year fit no calendar. */
export function lastEnd(periods_per_year, today) {
  const [unit, now] = [unitOf(periods_per_year), new Date(parsed(today))];
  const [year, month, weekday] = [now.getUTCFullYear(), now.getUTCMonth(), now.getUTCDay()];
  const ends = {
    day: () => parsed(today) - DAY * [2, 0, 0, 0, 0, 0, 1][weekday],
    week: () => parsed(today) - DAY * ((weekday + 2) % 7),
    month: () => Date.UTC(year, month, 0),
    quarter: () => Date.UTC(year, month - (month % 3), 0),
    year: () => Date.UTC(year, 0, 0),
  };
  if (!(unit in ends)) return null;
  // A month that ends today has ended.
  const tomorrow = new Date(parsed(today) + DAY);
  const isOver = { month: tomorrow.getUTCDate() === 1, quarter: tomorrow.getUTCDate() === 1 && tomorrow.getUTCMonth() % 3 === 0, year: tomorrow.getUTCDate() === 1 && tomorrow.getUTCMonth() === 0 };
  return isOver[unit] ? today : written(ends[unit]());
}

/** Returns by how many days `today` is later than `next`. */
export const daysLate = (next, today) => Math.max(0, Math.round((parsed(today) - parsed(next)) / DAY));

/** Returns the unit that the dates follow, or null. */
function rhythm(dated) {
  const gaps = dated.slice(1).map(({ time, period }, index) => (time - dated[index].time) / DAY / (period - dated[index].period));
  if (gaps.length === 0) return null;
  const middle = gaps.sort((a, b) => a - b)[gaps.length >> 1];
  return UNITS.find(({ least, most }) => middle >= least && middle <= most) ?? null;
}

/**
 * Returns the calendar of a session: `unit` is the name of a period's unit, `name(k)` the name of period k from 1, `brief(k)` its short name
 * on an axis, `after(k)` that of its end, `date(k)` its last day or null. `dated` tells whether there are dates.
 */
export function calendar(history, periods_per_year) {
  const known = (row) => (row?.now ?? row)?.date;
  // A period without a date gets the next date due. If that is unknown, its date repeats that of the period before, so it counts as none.
  const dayIn = (row, index, rows) => standing(row).date ?? (known(row) === known(rows[index - 1]) ? null : known(row));
  const dated = history.observations
    .map((row, index, rows) => ({ period: row.period, date: dayIn(row, index, rows) }))
    .filter(({ date }) => date)
    .map(({ period, date }) => ({ period, time: parsed(date) }));
  const said = periods_per_year ? UNITS.find(({ unit }) => unit === unitOf(periods_per_year)) : null;
  const kept = rhythm(dated) ?? (dated.length > 0 ? said : null);
  const unit = (kept ?? said)?.unit ?? "period";
  const moved = (time, steps) => {
    if (steps === 0) return time;
    if (kept?.months) return later(time, steps * kept.months);
    return kept?.days ? time + steps * kept.days * DAY : null;
  };
  /** Returns the last day of a period: as reported, or counted from the nearest dated one. */
  const end = (period) => {
    const nearest = dated.reduce((best, one) => (best && Math.abs(best.period - period) <= Math.abs(one.period - period) ? best : one), null);
    return nearest && moved(nearest.time, period - nearest.period);
  };
  // Periods are named by month only if no two of them end in one month.
  const months = dated.map(({ time }) => written(time).slice(0, 7));
  const byMonth = kept?.months === 1 && new Set(months).size === months.length;
  const name = (period) => {
    const time = end(period);
    if (time === null) return `Period ${period}`;
    if (byMonth) return told(time, { month: "long", year: "numeric" });
    return `${unit === "day" || unit === "period" ? "" : `${unit[0].toUpperCase()}${unit.slice(1)} to `}${day(written(time))}`;
  };
  const brief = (period) => {
    const time = period < 1 ? null : end(period);
    if (time === null) return period === 0 && dated.length > 0 ? "Start" : String(period);
    return told(time, byMonth ? { month: "short", year: "2-digit" } : { day: "numeric", month: "short", year: "2-digit" });
  };
  const inText = (period) => name(period).replace(/^[PWQY](?=eriod|eek|uarter|ear)/, (letter) => letter.toLowerCase());
  const after = (period) => (period === 0 ? "At the start" : `After ${inText(period)}`);
  const date = (period) => {
    const time = end(period);
    return time === null ? null : written(time);
  };
  return { unit, name, inText, brief, after, date, dated: dated.length > 0 };
}
