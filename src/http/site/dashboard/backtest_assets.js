// The report of a backtest of several assets: its strategies, what each earned, and what it held.

import { ranges, results, START } from "./backtest_figures.js";
import { h, quantSection, table } from "./dom.js";
import { count, counted, minus, percent } from "./format.js";
import { investorWords } from "./specification.js";
import { stackedChart } from "./stacked.js";
import { colourOf } from "./strategies.js";

const KNOWN = ["equal_shares", "sixty_equal"];

const sum = (numbers) => numbers.reduce((all, number) => all + number, 0);

/** Returns the strategies in the form of one asset. `market` is the benchmark, `known` are the strategies shown beside each. */
export function ofAssets(report) {
  const { assets } = report;
  const lines = report.strategies.map((figures, index) => {
    const periods = report.periods[index];
    const totals = periods.wealth.map((_, k) => sum(assets.map((name) => periods.allocations[name][k])));
    return {
      ...figures,
      periods: { ...periods, allocation: totals },
      wealth: [START, ...periods.wealth],
      name: figures.strategy,
      colour: colourOf(figures.kind),
    };
  });
  const known = KNOWN.map((wanted) => lines.find(({ kind }) => kind === wanted));
  return { lines, known, market: known[0], main: lines[0], held: "Share held in all assets" };
}

/** Describes the record, the method and the investor. */
export function walkedAssets({ assets, choices, lines, unit, times }) {
  const { every, trading_cost, risk_aversion, strategies } = choices;
  const length = lines[0].wealth.length - 1;
  const investor = investorWords(risk_aversion === 1 ? { kind: "log" } : { kind: "power", risk_aversion });
  const isTrained = strategies.includes("policy");
  const known = isTrained ? "policies are trained with that, and no other strategy takes it into account" : "no strategy takes that into account";
  const cost = trading_cost > 0 ? `Trading costs ${percent(trading_cost, 2)} of what is traded, and ${known}.` : "Trading is free here, so strategies that trade often look better than they would in reality.";
  return h(
    "div",
    { class: "words" },
    h("p", {}, `${count(lines.length)} ways to hold ${count(assets.length)} assets, through ${counted(length, unit)}, ${times.name(1)} to ${times.name(length)}, for ${investor}.`),
    h("p", {}, `Each ${unit} a strategy decides from the returns that it knows, and never from later ones. The caution is set again every ${counted(every, unit)}. ${isTrained ? `As often the next policy is trained, and followed as a session follows it. ` : ""}${cost}`),
  );
}

/** Shows the report's own sentences and the results of each strategy. */
export const resultsOfAssets = (told) => results(told, told.sentences.map(minus));

/** Shows what a strategy held of each asset through time, and on average. */
export function heldOfAssets({ assets, times }, line) {
  const shares = line.periods.wealth.map((_, k) => Object.fromEntries(assets.map((name) => [name, line.periods.allocations[name][k]])));
  const number = (name, cell) => ({ name, numeric: true, cell });
  return [
    stackedChart({ title: "Share of wealth in each asset", assets, shares, x: { name: times.name, tick: times.name } }),
    table(`Held of each asset on average by ${line.name}`, [{ name: "Asset", cell: (name) => name }, number("Share of wealth", (name) => percent(line.mean_allocations[name]))], assets),
  ];
}

/** Shows the estimates with their ranges. */
export function quantOfAssets(told) {
  const { alpha, seed } = told.choices;
  const beside = { beyond_equal: "More than equal shares", beyond_own_mix: "Beyond equal shares at its own total" };
  return quantSection("Ranges and ratios", () => h("div", {}, ranges(told, beside, `Alpha ${alpha}, seed ${count(seed)}.`)));
}
