// The report of an evaluation: what was compared, and the results in sentences and in wealth. The rest is for the
// quant.

import { lineChart } from "./chart.js";
import { disclosure, h, quantSection, section, table } from "./dom.js";
import { allocation, count, counted, duration, figures, minus, percent, percentTick, significant, tick, wealth } from "./format.js";
import { histogram } from "./histogram.js";
import { intervalChart } from "./interval_chart.js";
import { unitOf } from "./periods.js";
import { investorWords, PAPER } from "./specification.js";
import { colourOf, colourOfMix } from "./strategies.js";
import { changing, interval, ordinal } from "./verdict.js";

/** Histograms shown at once. */
const SHOWN = 4;

/** Draws the report. `policyLink(id)` returns a link to a policy; `drawing(id)`, if present, one to the form that compares it on drawn records. */
export function body(report, policyLink, drawing = null) {
  const ended = outcomes(report);
  return [compared(report, policyLink), results(report, ended, drawing), spreads(report, ended), courses(report), quant(report, ended)];
}

const named = ({ strategy }) => strategy;

const coloured = ({ framework, constant_mix }) => (framework || constant_mix === null ? colourOf(framework ?? "own") : colourOfMix(constant_mix));

/** Returns the money put in over all periods, including the start. */
function putIn({ initial_wealth, contributions, horizon }) {
  const all = Array.isArray(contributions) ? contributions.reduce((sum, amount) => sum + amount, 0) : contributions * horizon;
  return initial_wealth + all;
}

/** Returns every strategy with its name, its colour and the spread of its wealth, sorted by worth. `shares` are those of the bins of wealth,
 * and `banked` is the share of paths that end as all in the bank does. */
export function outcomes({ strategies }) {
  const spread = ({ wealth: { histogram, at_bank } }) => {
    const total = histogram.reduce((sum, count) => sum + count, at_bank);
    return { shares: histogram.map((count) => count / total), banked: at_bank / total };
  };
  return strategies
    .map((strategy) => ({ ...strategy, name: named(strategy), colour: coloured(strategy), ...spread(strategy) }))
    .sort((one, other) => other.certainty_equivalent.value - one.certainty_equivalent.value);
}

/** Describes the strategies, the futures and the investor. */
function compared({ request, histories, strategies }, policyLink) {
  const { problem } = request;
  const unit = unitOf(problem.periods_per_year);
  const drawn = request.histories.kind === "drawn";
  const records = drawn ? `, after each of ${counted(histories.length, "record")} drawn from the market` : `, after a record of ${counted(problem.history.length, "return")}`;
  const followed = strategies.filter(({ policy }) => policy && Object.values(request.policies).includes(policy));
  const links = followed.map(({ policy, strategy }, index) => [index > 0 ? ", " : "", `\u201c${strategy}\u201d is `, policyLink(policy)]);
  return h(
    "div",
    { class: "words" },
    h(
      "p",
      {},
      `${count(strategies.length)} ways to hold stocks, through the same ${counted(request.paths * histories.length, "future")} of ${counted(problem.horizon, unit)}${records}, for ${investorWords(problem.utility)} who starts with ${wealth(problem.initial_wealth)}.`,
    ),
    h(
      "p",
      {},
      `Futures are drawn from ${drawnFrom(problem.law)}; the bank pays ${percent(problem.rate_per_step, 2)} a ${unit}${problem.trading_cost > 0 ? `, and trading costs ${percent(problem.trading_cost, 2)}` : ""}. `,
      links.length > 0 ? [...links, "; the other policies were trained for this."] : "The policies were trained for this.",
    ),
  );
}

const LAWS = { bootstrap: "the record itself, smoothed", gaussian_mixture: "a mixture of bell curves", student_t: "a Student distribution, whose tails are heavier than those of a bell curve" };
const drawnFrom = (law) => LAWS[law?.kind] ?? "the market in the request";

/** Tells whether futures are drawn from the very record that the policies know. */
const isTrue = ({ histories, problem: { law } }) => histories.kind !== "drawn" && law?.kind === "bootstrap";

/** Returns a name within a sentence. */
const called = ({ framework, name }) => (framework ? `\u201c${name}\u201d` : name);

/** Returns the sentences that state the results. */
function conclusions({ reference }, ended) {
  const [best] = ended;
  const bank = ended.find(({ constant_mix }) => constant_mix === 0);
  const stocks = ended.find(({ constant_mix }) => constant_mix === 1);
  const sure = ({ certainty_equivalent: { value } }) => `as much as a sure ${wealth(value)}`;
  const main = ended.find(({ strategy }) => strategy === reference);
  const said = [
    `${called(best)} did best over these futures: it is worth ${sure(best)}${bank && bank !== best ? `; all in the bank is worth ${wealth(bank.certainty_equivalent.value)}` : ""}.`,
  ];
  const place = ended.indexOf(main) + 1;
  if (main && main !== best) {
    const { low, high } = best.difference?.certainty_equivalent ?? { low: -1, high: 1 };
    const far = low > 0 || high < 0 ? "" : ", but the difference is too small for these futures to show";
    said.push(`${called(main)} comes ${ordinal(place)} of ${ended.length}, worth ${sure(main)}${far}.`);
  }
  if (main) {
    const beside = stocks && stocks !== main ? ` For all in stocks these are ${percent(stocks.wealth.chance_of_loss.value, 0)} and ${wealth(stocks.wealth.worst_twentieth.value)}.` : "";
    said.push(`In ${percent(main.wealth.chance_of_loss.value, 0)} of the futures ${called(main)} ends with less than the money put in; the worst 5\u202f% of all futures end with ${wealth(main.wealth.worst_twentieth.value)} on average.${beside}`);
  }
  return main?.own_mix ? [...said, changing({ name: called(main), ...main.own_mix, shown: "these futures do" })] : said;
}

/** Kinds of policy without caution. */
const BOLD = ["plug_in", "known_law"];

/** Says that caution can only cost if futures are drawn from the record, how much it costs, and where to see what it saves. */
function onlyCosts({ request, reference }, ended, drawing) {
  const main = ended.find(({ strategy }) => strategy === reference);
  if (!isTrue(request) || !main?.framework || BOLD.includes(main.framework)) return null;
  const trusting = ended.find(({ framework }) => framework === "plug_in");
  const cost = trusting ? trusting.certainty_equivalent.value - main.certainty_equivalent.value : 0;
  const step = trusting?.certainty_equivalent.value >= 1e5 ? 1 : 0.01;
  const size = cost >= step / 2 ? `: ${tick(cost, step)} of the ${wealth(trusting.certainty_equivalent.value)} that ${called(trusting)} is worth` : "";
  const policy = request.policies[main.framework];
  const words = `Here the record is the true market, so caution can only cost${size}. To see what it saves when the record misleads, compare on records drawn from the market.`;
  return [h("p", {}, words), drawing && policy ? h("p", { class: "actions" }, drawing(policy)) : null];
}

function results(report, ended, drawing) {
  const money = (name, figure) => ({ name, numeric: true, cell: ({ wealth: { [figure]: found } }) => wealth(found.value ?? found) });
  const share = (name, figure) => ({ name, numeric: true, cell: (row) => percent(row.wealth[figure].value) });
  return section(
    "What each is worth",
    h("div", { class: "words" }, conclusions(report, ended).map((sentence) => h("p", {}, sentence)), onlyCosts(report, ended, drawing)),
    intervalChart({
      title: "Worth as much as a sure",
      rows: ended.map(({ name, colour, strategy, certainty_equivalent }) => ({ name, colour, isMain: strategy === report.reference, ...certainty_equivalent })),
      format: wealth,
      tick,
    }),
    table(
      "How wealth ended, by what it is worth",
      [
        { name: "Strategy", cell: ({ name, strategy }) => (strategy === report.reference ? h("b", {}, name) : name) },
        { name: "Worth as much as a sure", numeric: true, cell: ({ certainty_equivalent }) => wealth(certainty_equivalent.value) },
        money("Average", "mean"),
        share("Chance of loss", "chance_of_loss"),
        money("Worst 5\u202f%, average", "worst_twentieth"),
        share("Worst fall, average", "max_drawdown"),
        money("One in five below", "quantile_20"),
        money("One in ten above", "quantile_90"),
        money("Least", "min"),
        money("Most", "max"),
      ],
      ended,
    ),
    h("p", { class: "note" }, `A loss means ending with less than the ${wealth(putIn(report.request.problem))} put in. A worst fall is the largest fall below the highest wealth so far. Ranges in the chart hold with ${percent(report.request.level, 0)} confidence.`),
  );
}

/** Returns the strategies drawn first: the reference, the best, all in stocks, and the next kinds of policy. */
function foremost(ended, reference) {
  const wanted = [ended.find(({ strategy }) => strategy === reference), ended[0], ended.find(({ constant_mix }) => constant_mix === 1)];
  const rest = [...ended].sort((one, other) => Number(Boolean(other.framework)) - Number(Boolean(one.framework)));
  return [...new Set([...wanted, ...rest].filter(Boolean))].slice(0, SHOWN);
}

/** Draws a histogram for each strategy, all on one scale. Paths that end as the bank does have a bar of their own; if all paths do, there is
 * nothing to draw. */
function spreads({ request, reference, wealth_edges: edges, floor }, ended) {
  const spread = ended.filter((one) => one.banked < 1);
  if (spread.length === 0) return "";
  const domain = [edges[0], edges.at(-1)];
  const shown = foremost(spread, reference);
  const rest = spread.filter((one) => !shown.includes(one));
  const highest = (some) => Math.max(...some.flatMap((one) => [...one.shares, one.banked]));
  const top = highest(shown);
  const marks = [{ name: "All in the bank", at: floor }];
  const drawn = (some, top) =>
    h("div", { class: "duo" }, some.map((one) => histogram({ title: one.name, shares: one.shares, point: { at: floor, share: one.banked, name: "same as all in the bank" }, domain, top, colour: one.colour, marks })));
  const dashed = ` The dashed line is all in the bank, ${wealth(floor)}; futures that end there have a bar of their own.`;
  const others = () => drawn(rest, Math.max(top, highest(rest)));
  return section(
    "How wealth spreads at the end",
    h("p", { class: "note" }, `How often each final wealth occurs after ${counted(request.problem.horizon, unitOf(request.problem.periods_per_year))}. All charts share one scale.${dashed}`),
    drawn(shown, top),
    rest.length > 0 ? disclosure(`The other ${count(rest.length)}`, others) : "",
  );
}

/** Draws what the policies held through time. */
function courses({ strategies, request }) {
  const deciding = strategies.filter(({ periods }) => periods);
  if (deciding.length === 0) return "";
  const unit = unitOf(request.problem.periods_per_year);
  const series = deciding.map((one) => ({ name: named(one), colour: coloured(one), kind: "line", values: one.periods.map(({ allocation }) => allocation.mean) }));
  const x = { values: deciding[0].periods.map(({ period }) => period), label: unit[0].toUpperCase() + unit.slice(1), format: String, whole: true };
  return section(
    "What each held",
    lineChart({ title: "Average share in stocks", x, y: { format: allocation, tick: percentTick, also: [0] }, series }),
  );
}

/** Shows utility, differences, radii, coverage and run times. */
function quant(report, ended) {
  const { request, reference, sentences, costs, histories } = report;
  const referred = ended.find(({ strategy }) => strategy === reference)?.name.toLowerCase() ?? "the reference";
  const estimate = (name, read, format) => ({ name, numeric: true, cell: (row) => (read(row) ? interval(read(row), format) : "\u2013") });
  const build = () =>
    h(
      "div",
      {},
      h("p", { class: "note" }, sentences.map((sentence) => minus(sentence)).join(" ")),
      h("p", { class: "note" }, `${counted(request.paths, "path")} a history of ${count(histories.length)}; training took ${duration(costs.training_seconds)}, simulation ${duration(costs.simulation_seconds)}.`),
      table(
        "Certainty equivalents, losses and utility",
        [
          { name: "Strategy", cell: ({ framework, name }) => (framework ? PAPER[framework] : name) },
          estimate("Certainty equivalent", ({ certainty_equivalent }) => certainty_equivalent, wealth),
          estimate(`More than ${referred}`, ({ difference }) => difference?.certainty_equivalent, (value) => tick(value, 0.01)),
          estimate("Beyond its own mix", ({ own_mix }) => own_mix?.beyond, (value) => tick(value, 0.01)),
          estimate("Chance of loss", (row) => row.wealth.chance_of_loss, percent),
          estimate("Worst 5\u202f%", (row) => row.wealth.worst_twentieth, wealth),
          estimate("Worst fall", (row) => row.wealth.max_drawdown, percent),
          { name: "Mean utility", numeric: true, cell: ({ utility }) => figures(utility.mean.value, 7) },
          { name: "Variance", numeric: true, cell: ({ utility }) => significant(utility.variance.value, 3) },
        ],
        ended,
      ),
      radii(report),
      coverage(report),
    );
  return quantSection("Utility, radii and coverage", build);
}

function radii({ strategies }) {
  const guarding = strategies.filter(({ periods }) => periods?.[0].radius);
  if (guarding.length === 0) return "";
  return lineChart({
    title: "Mean radius",
    x: { values: guarding[0].periods.map(({ period }) => period), label: "Period", format: String, whole: true },
    y: { format: (value) => figures(value, 3), tick },
    series: guarding.map((one) => ({ name: named(one), colour: coloured(one), kind: "line", values: one.periods.map(({ radius }) => radius?.mean ?? null) })),
  });
}

function coverage({ strategies, request }) {
  const covered = strategies.filter(({ coverage }) => coverage);
  if (covered.length === 0) return "";
  const together = request.problem.radius?.rule === "joint";
  const rows = covered.flatMap((strategy) =>
    strategy.coverage.by_sample_size.map((row) => ({ ...row, strategy, target: together ? null : strategy.coverage.target })),
  );
  const aim = ({ coverage: { target } }) => (together ? ` The radius aims at ${percent(1 - target, 0)}.` : "");
  const left = covered.map(
    (strategy) => `${named(strategy)}: the law left the ball at some period on ${interval(strategy.coverage.ever_left, percent)} of the paths.${aim(strategy)}`,
  );
  return [
    ...left.map((sentence) => h("p", { class: "note" }, sentence)),
    table(
      "Coverage by sample size",
      [
        { name: "Strategy", cell: ({ strategy }) => named(strategy) },
        { name: "Returns seen", numeric: true, cell: ({ sample_size }) => count(sample_size) },
        { name: "Ball held the law", numeric: true, cell: (row) => interval(row.covered, percent) },
        { name: "Aimed at", numeric: true, cell: ({ target }) => (target === null ? "\u2013" : percent(target, 0)) },
        { name: "Inside the first ball", numeric: true, cell: (row) => interval(row.inside_first, percent) },
      ],
      rows,
    ),
  ];
}
