// The figures of a backtest, of one asset or of several: what each strategy earned, and within what ranges.

import { h, section, table } from "./dom.js";
import { allocation, count, counted, percent, tick, wealth } from "./format.js";
import { intervalChart } from "./interval_chart.js";
import { interval } from "./verdict.js";

export const START = 100;

export const estimate = ({ value, interval: [low, high] }) => ({ value, low, high });

/** With fewer years no strategy is called better than another, and no range is drawn: many shorter records miss a crash that comes once in ten years. */
export const FEWEST_YEARS = 30;

/** Tells whether a record is too short to rank strategies. */
export const isShort = ({ whole_years }) => whole_years < FEWEST_YEARS;

/** Returns the return a year that compounds to the final wealth; the mean return is higher, because losses count more in growth. */
const growth = ({ wealth, final_wealth }, periods_per_year) => (final_wealth / START) ** (periods_per_year / (wealth.length - 1)) - 1;

/** Shows the sentences, and all strategies by what a year of each is worth; `more` is added to the note below. */
export function results({ lines, intervals, assets, unit, whole_years, periods_per_year }, sentences, more = "") {
  const short = isShort({ whole_years });
  const grown = lines.map((line) => ({ ...line, growth: growth(line, periods_per_year) }));
  const rows = grown.sort((one, other) => other.yearly_certainty_equivalent.value - one.yearly_certainty_equivalent.value);
  const estimated = (format) => ({ value }) => format(value);
  const columns = [
    ["yearly_certainty_equivalent", "A year is worth a sure", estimated(wealth)],
    ["final_wealth", `${START} became`, wealth],
    ["growth", "Growth a year", percent],
    ["annual_mean", "Mean return a year", estimated(percent)],
    ["annual_volatility", "Deviation a year", estimated(percent)],
    ["chance_of_loss", "Chance of loss", estimated(percent)],
    ["worst_twentieth", "Worst 5\u202f% of years", estimated(percent)],
    ["max_drawdown", "Worst fall", percent],
    ["mean_allocation", "Held on average", allocation],
    assets && ["effective_assets", "Effective number of assets", (number) => (number === null ? "\u2013" : tick(number, 0.1))],
    ["annual_turnover", "Traded a year", estimated(percent)],
  ].filter(Boolean);
  return section(
    "Results of each strategy",
    h("div", { class: "words" }, sentences.map((sentence) => h("p", {}, sentence))),
    intervalChart({
      title: `A year from ${START} is worth as much as a sure`,
      rows: rows.map(({ name, colour, yearly_certainty_equivalent: worth }) => ({ name, colour, ...(short ? { value: worth.value } : estimate(worth)) })),
      format: wealth,
      tick,
    }),
    table(
      "Strategies, by what a year of each is worth",
      [{ name: "Strategy", cell: ({ name }) => name }, ...columns.map(([key, name, format]) => ({ name, numeric: true, cell: (row) => format(row[key]) }))],
      rows,
    ),
    h("p", { class: "note" }, `${short ? `The chart has no ranges: with fewer than ${FEWEST_YEARS} years they would promise too much.` : `Each range in the chart holds by itself with ${percent(intervals.confidence, 0)} confidence, if coming years are like those seen.`}${more} A loss is a year that ends with less than it began with. The worst 5\u202f% of years are given by their average return. A year starts with every ${unit}, so years overlap.`),
  );
}

/** Shows the estimates with their ranges under the report's own names. `names` maps the report's fields of differences to column titles;
 * `more` ends the note above. */
export function ranges({ lines, intervals }, names, more) {
  const hundredth = (value) => tick(value, 0.01);
  const columns = [
    ["yearly_certainty_equivalent", "Certainty equivalent of a year", wealth],
    ...Object.entries(names).map(([key, name]) => [key, name, hundredth]),
    ["sharpe_ratio", "Sharpe ratio", hundredth],
    ["annual_mean", "Mean return a year", percent],
    ["annual_volatility", "Volatility", percent],
    ["chance_of_loss", "Chance of loss", percent],
    ["worst_twentieth", "Worst 5\u202f% of years", percent],
  ];
  const cell = (key, format) => (row) => (row[key] ? interval(estimate(row[key]), format) : "\u2013");
  return [
    h("p", { class: "note" }, `Ranges hold with ${percent(intervals.confidence, 0)} confidence. The ranges of certainty equivalents rest on what each year adds, and allow ${counted(intervals.year_block, "year")} in a row to depend on each other. The ranges of differences hold all at once: ${count(intervals.comparisons)} comparisons with one strategy. A chance of loss counts whole years. The other ranges come from ${count(intervals.resamples)} circular block-bootstrap resamples, the same for all strategies. Blocks have ${counted(intervals.period_block, "period")}, and ${counted(intervals.year_block, "year")} for the worst years. ${more}`),
    table(
      "Estimates with their ranges",
      [{ name: "Strategy", cell: ({ strategy }) => strategy }, ...columns.map(([key, name, format]) => ({ name, numeric: true, cell: cell(key, format) }))],
      lines,
    ),
  ];
}
