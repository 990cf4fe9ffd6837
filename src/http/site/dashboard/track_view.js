// A track record as charts and tables, of a strategy in a backtest and of a session: one line described, with others beside it.
//
// `shown` holds `{known, market, times, unit, dates, periods_per_year}`: the lines beside, the line that falls are compared with, and the names
// of the ends of the periods, `times.after(k)`. A line is `{name, colour, wealth}`, with the level 100 at the start and after each period.

import { lineChart } from "./chart.js";
import { h, table } from "./dom.js";
import { counted, percent, percentTick, tick, wealth } from "./format.js";
import { belowHighest, compounded, grouped, places, returnsOf, rolling, worstFalls } from "./track.js";

/** Number of falls listed. */
const FALLS = 5;
/** The common left margin of charts above each other, in pixels. */
export const GUTTER = 64;

/** Returns the line and the known ones, each once. */
const beside = (shown, line) => [line, ...shown.known.filter((other) => other !== line)];

/** Returns a line as a chart draws it, with `values` at its positions. */
export const lineOf = ({ name, colour }, values) => ({ name, colour, kind: "line", bare: true, values });

/** Draws levels and falls; `placed` is the axis `x` of the charts and their `gutter`. */
export function courses(shown, line, placed) {
  return [
    lineChart({ ...placed, title: "Growth of 100, log scale", height: 250, y: { format: wealth, tick, log: true }, series: beside(shown, line).map((one) => lineOf(one, one.wealth)) }),
    lineChart({ ...placed, title: "Below the highest so far", height: 130, y: { format: percent, tick: percentTick, also: [0] }, series: [...new Set([line, shown.market])].map((one) => lineOf(one, belowHighest(one.wealth))) }),
  ];
}

/** Draws the yearly return over rolling windows of `span` years, so that no single start or end decides. */
export function rollingYears(shown, line, placed, span) {
  const { periods_per_year, market } = shown;
  const of = (one) => rolling(one.wealth, span, periods_per_year);
  const [own, theirs] = [of(line), of(market)];
  const all = own.filter((back) => back !== null);
  const behind = own.filter((back, k) => back !== null && back < theirs[k]).length;
  const against = line === market ? "" : ` In ${percent(behind / all.length, 0)} of them that was less than \u201c${market.name}\u201d earned.`;
  return lineChart({
    ...placed,
    title: `Return a year over the ${span > 1 ? `${span} years` : "year"} before`,
    height: 170,
    y: { format: percent, tick: percentTick, also: [0] },
    series: beside(shown, line).map((one) => lineOf(one, of(one))),
    note: `Over any ${counted(span, "year")} of the record \u201c${line.name}\u201d earned between ${percent(Math.min(...all))} and ${percent(Math.max(...all))} a year.${against}`,
  });
}

/** Lists the worst falls of a line: when they began and how long they lasted. */
export function falls(shown, line) {
  const { times, unit, market } = shown;
  const worst = worstFalls(belowHighest(line.wealth), FALLS);
  if (worst.length === 0) return [h("p", { class: "note" }, `\u201c${line.name}\u201d never fell below its highest.`)];
  const number = (name, cell) => ({ name, numeric: true, cell });
  const back = ({ from, to }, wealth) => wealth[to] / wealth[from] - 1;
  const columns = [
    { name: "Highest before", cell: ({ from }) => times.after(from) },
    { name: "Lowest", cell: ({ to }) => times.after(to) },
    { name: "Recovered", cell: ({ back }) => (back === null ? "Not yet" : times.after(back)) },
    number("Fall", ({ depth }) => percent(depth)),
    ...(line === market ? [] : [number(`${market.name} meanwhile`, (fall) => percent(back(fall, market.wealth)))]),
    number("Lasted", ({ from, back }) => counted((back ?? line.wealth.length - 1) - from, unit)),
  ];
  return [h("h3", {}, "Its worst falls"), table(`The worst falls of ${line.name}`, columns, worst)];
}

/** Shows returns by year beside those of the other lines, and by month as a map. Less than a year has the map alone. */
export function years(shown, line) {
  const { dates, periods_per_year } = shown;
  const of = (one) => returnsOf(one.wealth);
  const where = places(dates, line.wealth.length - 1, periods_per_year);
  const byYear = grouped(where, ({ year }) => year);
  const called = dates ? "" : "Year ";
  const most = Math.max(...byYear.map(([, indices]) => indices.length));
  const part = (indices) => (indices.length < Math.min(most, periods_per_year) - 5 * (periods_per_year > 100) ? h("span", { class: "under" }, counted(indices.length, shown.unit)) : "");
  const others = beside(shown, line).map((one) => ({ one, returns: of(one) }));
  const over = (returns, indices) => compounded(indices.map((index) => returns[index]));
  const yearly = table(
    `Returns by the year of ${line.name} and of others`,
    [
      { name: "Year", cell: ([year, indices]) => [`${called}${year}`, part(indices)] },
      ...others.map(({ one, returns }) => ({ name: one.name, numeric: true, cell: ([, indices]) => percent(over(returns, indices)) })),
    ],
    byYear,
  );
  const isYear = where.length >= periods_per_year;
  return [...(isYear ? [h("h3", {}, "Year by year"), yearly] : []), ...map(shown, line, where, byYear, called, isYear)];
}

const MONTHS = Array.from({ length: 12 }, (_, month) => new Date(Date.UTC(2000, month)).toLocaleDateString("en-GB", { timeZone: "UTC", month: "short" }).slice(0, 3));
/** Number of shades of gain and of loss in the stylesheet. */
const SHADES = 4;

/** Shows the parts of each year as cells with their returns: the darker, the larger the gain or loss. */
function map({ dates, unit }, line, where, byYear, called, isYear) {
  const parts = [...new Set(where.map(({ part }) => part))].filter(Boolean).sort((one, other) => one - other);
  if (parts.length === 0) return [];
  const returns = returnsOf(line.wealth);
  const cells = new Map(grouped(where, ({ year, part }) => `${year} ${part}`).map(([key, indices]) => [key, compounded(indices.map((index) => returns[index]))]));
  const largest = Math.max(1e-12, ...[...cells.values()].map(Math.abs));
  const shade = (back) => (Math.abs(back) < 5e-5 ? "" : `${back > 0 ? "gain" : "loss"}${Math.ceil((SHADES * Math.abs(back)) / largest)}`);
  const cell = (part) => ([year]) => {
    const back = cells.get(`${year} ${part}`);
    return back === undefined ? "" : h("span", { class: `shaded ${shade(back)}` }, percent(back));
  };
  const whole = { name: "Whole year", numeric: true, cell: ([, indices]) => h("span", { class: "shaded" }, percent(compounded(indices.map((index) => returns[index])))) };
  const name = (part) => (dates ? MONTHS[part - 1] : part);
  const grain = dates && parts.length > 4 ? "month" : unit;
  const drawn = table(
    `Returns of ${line.name} ${grain} by ${grain}`,
    [{ name: "Year", cell: ([year]) => `${called}${year}` }, ...parts.map((part) => ({ name: name(part), numeric: true, cell: cell(part) })), ...(isYear ? [whole] : [])],
    byYear,
  );
  drawn.classList.add("map");
  return [h("h3", {}, `${grain[0].toUpperCase()}${grain.slice(1)} by ${grain}`), drawn];
}
