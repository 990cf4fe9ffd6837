// The report of a backtest of one asset: what the strategies earned, and one of them year by year.

import { heldOfAssets, ofAssets, quantOfAssets, resultsOfAssets, walkedAssets } from "./backtest_assets.js";
import { estimate, FEWEST_YEARS, isShort, ranges, results, START } from "./backtest_figures.js";
import { lineChart } from "./chart.js";
import { csvText, hundred } from "./csv.js";
import { h, quantSection, section } from "./dom.js";
import { select } from "./form.js";
import { allocation, count, counted, figures, minus, percent, percentTick, tick, wealth } from "./format.js";
import { dated, unitOf } from "./periods.js";
import { investorWords } from "./specification.js";
import { colourOf, colourOfLevel } from "./strategies.js";
import { returnsOf } from "./track.js";
import { courses, falls, GUTTER, lineOf, rollingYears, years } from "./track_view.js";
import { changing, ordinal } from "./verdict.js";

/** A smaller difference of a certainty equivalent is rounding: wealth starts at 100. */
const ROUNDING = 1e-6;
/** Lengths of rolling windows, in years: the first that fits twice into the record is used. */
const ROLLING = [5, 1];
/** With fewer returns the service warns about its advice. */
const SHORT_RECORD = 24;
/** How cautious the policies are, by the level of caution. */
const ACTING = { paper: "The cautious ones guard against all that the confidence implies.", bold: "The cautious ones act at the bold level of caution.", balanced: "The cautious ones act at the balanced level of caution.", cautious: "The cautious ones act at the cautious level of caution." };
const KNOWN = ["all_bank", "sixty_forty", "all_stock"];

/** Returns the report with the values that the page shows and draws. */
const tell = (report) => ({ ...report, ...(report.assets ? ofAssets(report) : ofOne(report)), unit: unitOf(report.periods_per_year), times: times(report) });

export function body(report) {
  const told = tell(report);
  const [head, foot] = report.assets ? [[walkedAssets(told), resultsOfAssets(told)], quantOfAssets(told)] : [[walked(told), resultsOfOne(told)], quant(told)];
  const read = report.read ? h("p", { class: "note" }, minus(report.read.replaceAll("\n", " "))) : "";
  return [...head, chosen(told), read, foot];
}

/** Returns the strategies of one asset. `market` is the benchmark, `known` are the strategies shown beside each, `main` is the one described most. */
function ofOne(report) {
  const told = { ...report, lines: lines(report) };
  const beside = KNOWN.map((kind) => known(told, kind));
  return { lines: told.lines, known: beside, market: known(told, "all_stock"), main: mainOf(told), held: "Share held in stocks" };
}

/** Returns every strategy with its name, its colour and its wealth from the start on, in the report's order. */
const lines = (report) =>
  report.strategies.map((figures, index) => ({
    ...figures,
    periods: report.periods[index],
    wealth: [START, ...report.periods[index].wealth],
    name: figures.strategy,
    colour: figures.kind === "adaptive" ? colourOfLevel(index, report.choices.alpha.length) : colourOf(figures.kind),
  }));

/** Returns the strategy described most: the second cautious one that learns, or the only one. */
const mainOf = ({ lines, choices }) => lines[Math.min(1, choices.alpha.length - 1)];
const known = ({ lines }, wanted) => lines.find(({ kind }) => kind === wanted);

/** Returns the positions of the ends of the periods on an axis, in years, and their names. */
function times({ dates, periods_per_year, periods }) {
  const length = periods[0].wealth.length;
  const [first, last] = dates ? [inYears(dates[0]), inYears(dates[length - 1])] : [0, (length - 1) / periods_per_year];
  const step = length > 1 ? (last - first) / (length - 1) : 1;
  const values = Array.from({ length: length + 1 }, (_, k) => first + k * step);
  const name = (period) => (dates ? dated(dates[period - 1]) : `period ${count(period)}`);
  const index = (value) => Math.round((value - first) / step);
  const during = (value) => name(1 + index(value));
  return { values, index, name, during: { format: during, here: during }, after: (k) => (k === 0 ? "At the start" : `${dates ? "" : "After "}${name(k)}`) };
}

/** Returns the start of a day, a month or a year, counted in years. */
function inYears(date) {
  const [year, month = 1, day = 1] = date.split("-").map(Number);
  return year + (month - 1) / 12 + (day - 1) / 372;
}

/** Describes the record, the method and the investor. */
function walked({ choices, lines, unit, times }) {
  const { every, window, horizon, trading_cost, risk_aversion, caution } = choices;
  const length = lines[0].wealth.length - 1;
  const investor = investorWords(risk_aversion === 1 ? { kind: "log" } : { kind: "power", risk_aversion });
  const cost = trading_cost > 0 ? `Trading costs ${percent(trading_cost, 2)} of what is traded.` : "Trading is free here, so strategies that trade often look better than they would in reality.";
  const ahead = horizon === every ? "" : `, looking ${counted(horizon, unit)} ahead`;
  const few = `Each of them rests on ${counted(window, "return")}: with fewer than ${SHORT_RECORD}, the record has not yet shown most of what the asset can do.`;
  return h(
    "div",
    { class: "words" },
    h("p", {}, `${count(lines.filter(({ hindsight }) => !hindsight).length)} ways to hold stocks, through ${counted(length, unit)}, ${times.name(1)} to ${times.name(length)}, for ${investor}.`),
    h("p", {}, `Every ${counted(every, unit)} policies are trained on the ${counted(window, unit)} before${ahead}, and followed until the next training. ${ACTING[caution] ?? `The cautious ones act on ${percent(caution.scale, 0)} of the radius.`} No holding uses later returns. ${cost}`),
    window < SHORT_RECORD && h("p", { class: "note wrong" }, few),
  );
}

/** Returns the sentences that state the results. */
function conclusions(told) {
  const { lines, whole_years, uncounted_periods } = told;
  const main = mainOf(told);
  const [bank, stocks] = [known(told, "all_bank"), known(told, "all_stock")];
  const worth = ({ yearly_certainty_equivalent: { value } }) => value;
  const real = lines.filter(({ place }) => place !== null);
  const best = main.place === 1 ? main : real.find(({ place }) => place === 1);
  const quoted = `\u201c${main.name}\u201d`;
  const said = [
    `${best === main || !KNOWN.includes(best.kind) ? `\u201c${best.name}\u201d` : best.name} did best for this investor in this record: a year from ${START} is worth as much as a sure ${wealth(worth(best))}${best === bank ? "" : `; all in the bank is worth ${wealth(worth(bank))}`}.`,
  ];
  if (best !== main) said.push(`${quoted} comes ${ordinal(main.place)} of ${real.length}, with ${wealth(worth(main))}.`);
  if (uncounted_periods > 0) said.push(`The first ${uncounted_periods === 1 ? `${told.unit} is` : `${counted(uncounted_periods, told.unit)} are`} left out of the years, because the years are counted back from the last ${told.unit}.`);
  if (isShort(told)) said.push(`The record has ${counted(whole_years, "whole year")} of decisions, fewer than ${FEWEST_YEARS}, so it cannot rank the strategies. A crash that comes once in ten years is missing from many records this short.`);
  else said.push(apart(told, main, quoted));
  said.push(`The worst fall of ${quoted} was ${percent(main.max_drawdown)}, that of all in stocks ${percent(stocks.max_drawdown)}; from ${START} it came to ${wealth(main.final_wealth)}, all in stocks to ${wealth(stocks.final_wealth)}.`);
  if (!isShort(told) && main.beyond_own_mix) said.push(changing({ name: quoted, allocation: main.mean_allocation, beyond: estimate(main.beyond_own_mix), shown: "the record does" }));
  said.push(`It was all in the bank in ${percent(main.all_bank_share, 0)} of the ${told.unit}s.`);
  return said;
}

/** Says which strategies the main one is ahead of and behind, and which it cannot be told apart from. */
function apart({ lines, intervals }, main, quoted) {
  const others = lines.filter((line) => line !== main);
  const ahead = others.filter(({ adaptive_ahead: { interval } }) => interval[0] > ROUNDING);
  const behind = others.filter(({ adaptive_ahead: { interval } }) => interval[1] < -ROUNDING);
  const compared = `${counted(others.length, "comparison")} at once, with ${percent(intervals.confidence, 0)} confidence`;
  const list = (some) => some.map(({ name }) => `\u201c${name}\u201d`).join(", ").replace(/, (?=[^,]*$)/, some.length > 1 && !some.at(-1).name.includes(",") ? " and " : ", ");
  const parts = [ahead.length > 0 && `ahead of ${list(ahead)}`, behind.length > 0 && `behind ${list(behind)}`].filter(Boolean);
  if (parts.length === 0) return `The record cannot tell ${quoted} from any of the others (${compared}).`;
  const rest = others.length - ahead.length - behind.length;
  return `The record shows ${quoted} ${parts.join(" and ")}${rest > 0 ? `; it cannot tell it from the other ${rest}` : ""} (${compared}).`;
}

/** Shows the sentences and the results of each strategy. */
function resultsOfOne(told) {
  const more = ` \u201cHindsight\u201d holds what \u201c${mainOf(told).name}\u201d held on average. Nobody knew that share beforehand, so it is not ranked with the others.`;
  return results(told, conclusions(told), more);
}

/** Shows one strategy, chosen here, beside the three well-known ones. */
function chosen(told) {
  const { lines } = told;
  const names = lines.map(({ name }, index) => [index, name]);
  const holder = h("div", {});
  const show = (line) => holder.replaceChildren(...course(told, line), ...(told.assets ? heldOfAssets(told, line) : []), ...falls(told, line), ...years(told, line));
  const strategy = select({ name: "strategy", label: "Strategy", choices: names, changed: (index) => show(lines[index]) });
  strategy.element.classList.add("choosing");
  strategy.control.value = lines.indexOf(told.main);
  show(told.main);
  return section("One strategy through the years", strategy.element, holder);
}

function course(told, line) {
  const { times, held } = told;
  const span = ROLLING.find((years) => line.wealth.length > 2 * years * told.periods_per_year);
  const at = (value) => times.after(times.index(value));
  const placed = { gutter: GUTTER, x: { values: times.values, label: "Period", format: at, here: at, tick: String, whole: true } };
  return [
    ...courses(told, line, placed),
    ...(span ? [rollingYears(told, line, placed, span)] : []),
    lineChart({
      ...placed,
      title: held,
      height: 130,
      x: { ...placed.x, ...times.during },
      y: { format: allocation, tick: percentTick, also: [0, 0.1] },
      series: [lineOf(line, [...line.periods.allocation, null])],
    }),
  ];
}

/** Shows the rest for the quant: the report's own sentences, estimates with their ranges, and radii. */
function quant(told) {
  const { sentences, lines, choices, times } = told;
  const guarding = lines.filter(({ periods }) => periods.radius.some((radius) => radius > 0));
  const behind = ({ value, interval: [low, high] }) => ({ value: -value, interval: [-high, -low] });
  const measured = { ...told, lines: lines.map((line) => ({ ...line, ahead: behind(line.adaptive_ahead) })) };
  const beside = { ahead: `More than ${mainOf(told).strategy}`, beyond_own_mix: "Beyond its own mix" };
  const build = () =>
    h(
      "div",
      {},
      h("p", { class: "note" }, sentences.map((sentence) => minus(sentence)).join(" ")),
      ranges(measured, beside, `${counted(choices.count, "design point")} a step, seed ${count(choices.seed)}.`),
      guarding.length > 0
        ? lineChart({
            title: "Radius",
            x: { values: times.values.slice(0, -1), label: "Period", ...times.during, tick: String, whole: true },
            y: { format: (value) => figures(value, 3), tick, also: [0] },
            series: guarding.map(({ name, colour, periods }) => ({ name, colour, kind: "line", bare: true, values: periods.radius })),
          })
        : "",
    );
  return quantSection("Ranges, ratios and radii", build);
}

/** Returns the CSV of all strategies, one period a line. */
export function csv(report) {
  const { lines, dates } = tell(report);
  const head = ["Period", "Date", ...lines.flatMap(({ name }) => [`${name}: held, %`, `${name}: return, %`, `${name}: wealth`])];
  const returns = lines.map(({ wealth }) => returnsOf(wealth));
  const rows = lines[0].periods.wealth.map((_, k) => [
    k + 1,
    dates?.[k] ?? "",
    ...lines.flatMap(({ periods, wealth }, index) => [hundred(periods.allocation[k]), hundred(returns[index][k]), wealth[k + 1]]),
  ]);
  return csvText([head, [0, "Start", ...lines.flatMap(() => ["", "", START])], ...rows]);
}
