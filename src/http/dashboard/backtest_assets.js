// What the report of several assets walked forward says: who the strategies were, what each came to, and what it held.

import { h, quantSection, section, table } from "./dom.js";
import { allocation, count, counted, minus, percent, tick, wealth } from "./format.js";
import { intervalChart } from "./interval_chart.js";
import { investorWords } from "./specification.js";
import { stackedChart } from "./stacked.js";
import { colourOf } from "./strategies.js";
import { interval } from "./verdict.js";

const START = 100;
const EQUAL = "1/N";
const KNOWN = [EQUAL, "60 % 1/N"];
const NAMES = { "robust scaled_one": "Robust", "robust sup": "Robust, sup norm", "static scaled_one": "Chosen once a stretch", "plug-in": "Trusts the record", "minimum variance": "Least variance", "inverse volatility": "Inverse volatility", "1/N": "Equal shares", "60 % 1/N": "60 % in equal shares" };

const sum = (numbers) => numbers.reduce((all, number) => all + number, 0);

/** A strategy's kind, by its name in the report. */
const familyOf = (strategy) => strategy.split(", ")[0];

/** In words: what it is, how much of the radius it takes, and how much of the past it knows. */
function named(strategy) {
  const [family, ...rest] = strategy.split(", ");
  const scale = rest.find((part) => part.startsWith("scale "));
  const window = rest.find((part) => !part.startsWith("scale "));
  const caution = scale === "scale 0.5" ? "half the caution" : scale && scale !== "scale 1" ? scale : null;
  const knows = window && (window === "all" ? "knows all" : `knows ${window}`);
  return [NAMES[family] ?? family, caution, knows].filter(Boolean).join(", ");
}

/** The strategies as the page of one asset has them; `market` is what they are held against, `known` who stands beside each. */
export function ofAssets(report) {
  const { assets } = report;
  const lines = report.strategies.map((figures, index) => {
    const periods = report.periods[index];
    const totals = periods.wealth.map((_, k) => sum(assets.map((name) => periods.allocations[name][k])));
    return {
      ...figures,
      periods: { ...periods, allocation: totals },
      wealth: [START, ...periods.wealth],
      name: named(figures.strategy),
      colour: colourOf(familyOf(figures.strategy)),
    };
  });
  const known = KNOWN.map((name) => lines.find(({ strategy }) => strategy === name));
  return { lines, known, market: known[0], main: lines[0], held: "Share held in all assets" };
}

/** What was walked through, how, and for whom. */
export function walkedAssets({ assets, choices, lines, unit, times }) {
  const { every, trading_cost, risk_aversion } = choices;
  const length = lines[0].wealth.length - 1;
  const investor = investorWords(risk_aversion === 1 ? { kind: "log" } : { kind: "power", risk_aversion });
  const cost = trading_cost > 0 ? `Trading costs ${percent(trading_cost, 2)} of what is traded, and no strategy knows of it.` : "Trading is free, so who trades much looks better than he would be.";
  return h(
    "div",
    { class: "words" },
    h("p", {}, `${count(lines.length)} ways to hold ${count(assets.length)} assets, through ${counted(length, unit)}, ${times.name(1)} to ${times.name(length)}, for ${investor}.`),
    h("p", {}, `Each ${unit} a strategy chooses from the returns that it knows, and nothing later is used. Caution is measured every ${counted(every, unit)}. ${cost}`),
  );
}

const estimate = ({ value, interval: [low, high] }) => ({ value, low, high });

/** The report's own sentences, and every strategy by what a year of it is worth. */
export function resultsOfAssets({ lines, intervals, sentences }) {
  const rows = [...lines].sort((one, other) => other.yearly_certainty_equivalent.value - one.yearly_certainty_equivalent.value);
  const number = (name, cell) => ({ name, numeric: true, cell });
  return section(
    "What each came to",
    h("div", { class: "words" }, sentences.map((sentence) => h("p", {}, minus(sentence)))),
    intervalChart({
      title: `A year from ${START} is worth as much as a sure`,
      rows: rows.map(({ name, colour, yearly_certainty_equivalent }) => ({ name, colour, ...estimate(yearly_certainty_equivalent) })),
      format: wealth,
      tick,
    }),
    table(
      "Strategies, by what a year of each is worth",
      [
        { name: "Strategy", cell: ({ name }) => name },
        number("A year is worth a sure", (row) => wealth(row.yearly_certainty_equivalent.value)),
        number(`${START} became`, ({ final_wealth }) => wealth(final_wealth)),
        number("Return a year", ({ annual_mean }) => percent(annual_mean.value)),
        number("Deviation a year", ({ annual_volatility }) => percent(annual_volatility.value)),
        number("Worst fall", ({ max_drawdown }) => percent(max_drawdown)),
        number("Held on average", ({ mean_allocation }) => allocation(mean_allocation)),
        number("Assets held in effect", ({ effective_assets }) => (effective_assets === null ? "\u2013" : tick(effective_assets, 0.1))),
        number("Traded a year", ({ annual_turnover }) => percent(annual_turnover.value)),
      ],
      rows,
    ),
    h("p", { class: "note" }, `Ranges in the chart hold with ${percent(intervals.confidence, 0)} confidence as far as the past is one draw of what may come.`),
  );
}

/** What a strategy held of each asset through time, and on average. */
export function heldOfAssets({ assets, times }, line) {
  const shares = line.periods.wealth.map((_, k) => Object.fromEntries(assets.map((name) => [name, line.periods.allocations[name][k]])));
  const number = (name, cell) => ({ name, numeric: true, cell });
  return [
    stackedChart({ title: "Share of wealth in each asset", assets, shares, x: { name: times.name, tick: times.name } }),
    table(`Held of each asset on average by ${line.name}`, [{ name: "Asset", cell: (name) => name }, number("Share of wealth", (name) => percent(line.mean_allocations[name]))], assets),
  ];
}

/** Estimates with their ranges, by the report's own names. */
export function quantOfAssets({ lines, intervals, choices }) {
  const range = (name, read, format) => ({ name, numeric: true, cell: (row) => (read(row) ? interval(estimate(read(row)), format) : "\u2013") });
  const hundredth = (value) => tick(value, 0.01);
  return quantSection("Ranges and ratios", () =>
    h(
      "div",
      {},
      h("p", { class: "note" }, `Each range is the middle ${percent(intervals.confidence, 0)} of ${count(intervals.resamples)} circular block-bootstrap resamples, the same for all strategies: blocks of ${counted(intervals.period_block, "period")}, and of ${counted(intervals.year_block, "year")} for certainty equivalents. Alpha ${choices.alpha}, seed ${count(choices.seed)}.`),
      table(
        "Estimates with their ranges",
        [
          { name: "Strategy", cell: ({ strategy }) => strategy },
          range("Certainty equivalent of a year", (row) => row.yearly_certainty_equivalent, wealth),
          range("More than 1/N", (row) => row.beyond_equal, hundredth),
          range("Beyond 1/N at its own total", (row) => row.beyond_own_mix, hundredth),
          range("Sharpe ratio", (row) => row.sharpe_ratio, hundredth),
          range("Mean return", (row) => row.annual_mean, percent),
          range("Volatility", (row) => row.annual_volatility, percent),
        ],
        lines,
      ),
    ),
  );
}
