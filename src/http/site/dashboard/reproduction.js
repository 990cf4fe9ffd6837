// The paper's section 3 computed anew: which claims hold and which do not, then each of its tables and figures.

import { lineChart } from "./chart.js";
import { disclosure, h, section, table } from "./dom.js";
import { count, minus, percent, percentTick, significant, tick } from "./format.js";
import { histogram } from "./histogram.js";
import { PAPER } from "./specification.js";
import { colourOf, colourOfMix } from "./strategies.js";
import { interval } from "./verdict.js";

const STATISTICS = [["mean", "Mean"], ["variance", "Variance"], ["quantile_20", "20 % quantile"], ["quantile_90", "90 % quantile"], ["max", "Most"], ["min", "Least"]];
/** The columns of the paper's tables, with their frameworks and names. It names a fourth framework and prints no column of it. */
const PRINTED = { adaptive: ["adaptive", "Adaptive robust"], known_law: ["known_law", "True law"], static_robust: ["static", "Static robust"], none: ["parametric_static", "Parametric static robust"] };
const BINS = 30;

const four = (value) => tick(value, 0.0001);
const estimate = (found) => interval(found, four);
/** An extreme has no interval. */
const statistic = (found) => (typeof found === "number" ? four(found) : estimate(found));
const named = ({ strategy }) => strategy;
const find = ({ strategies }, wanted) => strategies.find(({ framework }) => framework === wanted);
const number = (name, cell) => ({ name, numeric: true, cell });
const note = (...words) => h("p", { class: "note" }, words);

export function body({ plan, quick, sample_size, findings, section: found, study, changes, guesses, printed }) {
  return [
    h(
      "div",
      { class: "words" },
      h("p", {}, `Bayraktar and Chen, Nonparametric Adaptive Robust Control Under Model Uncertainty, section 3: ${plan.horizon} steps, the bank pays 0.002 a step, exponential utility with risk aversion 0.01, wealth 100, a mixture of two normals, ${sample_size} returns of history, alpha 0.1. Ranges hold with 95 % confidence over initial histories.`),
      quick ? h("p", {}, "This is the quick run: tiny designs and few histories. It is too little for a verdict on the paper.") : "",
    ),
    section("What holds and what does not", h("div", { class: "duo" }, Object.keys(VERDICTS).map((verdict) => verdicts(verdict, findings.filter((finding) => finding.verdict === verdict))))),
    quantiles(found),
    ...found.cases.map((one, index) => whole(one, index, printed[index], found)),
    mixes(found.all, printed),
    coverage(found.all),
    smaller(found.shrunk),
    larger(changes),
    firstGuess(guesses),
    convergence(study),
  ];
}

const VERDICTS = { agrees: "Agrees", differs: "Differs", undecided: "Not enough to tell", too_small: "Too small a run to tell" };

const verdicts = (verdict, some) =>
  some.length > 0 &&
  h("div", {}, h("h3", {}, `${VERDICTS[verdict]}: ${count(some.length)}`), h("ul", { class: `verdicts ${verdict}` }, some.map(({ statement, found }) => h("li", {}, h("b", {}, minus(statement)), " ", minus(found)))));

function quantiles({ quantiles: { shown, drawn, mean }, all }) {
  const domain = [Math.min(...shown), Math.max(...shown)];
  const bin = (value) => Math.min(BINS - 1, Math.floor((BINS * (value - domain[0])) / (domain[1] - domain[0])));
  const shares = Array.from({ length: BINS }, (_, k) => shown.filter((value) => bin(value) === k).length / shown.length);
  const periods = find(all, "adaptive").periods.filter(({ radius }) => radius);
  const sizes = { values: periods.map(({ sample_size }) => sample_size), label: "Returns seen", format: String, whole: true };
  return section(
    "Figure 1",
    note(`The first ${count(shown.length)} of ${count(drawn)} simulated quantiles Q of the bridge statistic at t0 = 20 and alpha = 0.1, whose mean is ${four(mean.value)}, and the radius as returns come in.`),
    histogram({ title: "Simulated quantiles", of: "Q", format: four, shares, domain, top: Math.max(...shares), colour: 0, marks: [] }),
    lineChart({
      title: "Radius",
      x: sizes,
      y: { format: four, tick },
      series: [
        { name: "Median, and the middle 80 % of paths", kind: "line", bare: true, colour: 0, values: periods.map(({ radius }) => radius.quantile_50), band: periods.map(({ radius }) => [radius.quantile_10, radius.quantile_90]) },
        { name: "One path", kind: "line", bare: true, colour: 1, values: periods.map(({ radius }) => radius.first_path) },
      ],
    }),
  );
}

/** Shows a table of the paper and its part of the second figure. */
function whole({ quantile, found, report }, index, printed, { quantiles, all }) {
  const tables = () => Object.entries(PRINTED).map(([column, [framework, name]]) => statistics(`${name}, Q near ${quantile}`, printed[column], find(report, framework), find(all, framework), report, all));
  return section(
    `Table ${index + 1} and Figure 2, Q near ${quantile}`,
    note(`${count(found)} of ${count(quantiles.drawn)} simulated histories have a Q within 2 % of it${found > 0 ? `: one in ${count(Math.round(quantiles.drawn / found))}` : ""}.`),
    report ? [...tables(), utilities(report)] : "",
  );
}

function statistics(name, paper, own, all, report, everywhere) {
  const columns = [
    { name: "Terminal utility", cell: ([, label]) => label },
    number("Paper", ([, , k]) => (paper ? four(paper[k]) : "not printed")),
    number(`Here, ${count(report.histories.length)} such histories of ${count(report.request.paths)} paths`, ([key]) => statistic(own.utility[key])),
    number(`Here, ${count(everywhere.histories.length)} histories of ${count(everywhere.request.paths)} paths`, ([key]) => statistic(all.utility[key])),
  ];
  return [h("h3", {}, name), table(name, columns, STATISTICS.map(([key, label], k) => [key, label, k]))];
}

/** Draws the distribution of terminal utility, on one scale. */
function utilities({ strategies, histogram_edges: edges }) {
  const some = ["adaptive", "known_law"].map((name) => find({ strategies }, name)).filter(Boolean);
  const shares = ({ histogram: counts }) => counts.map((one) => one / counts.reduce((sum, other) => sum + other, 0));
  const top = Math.max(...some.flatMap(shares));
  const drawn = (one) => histogram({ title: `Terminal utility: ${named(one).toLowerCase()}`, of: "Utility", format: (value) => tick(value, 0.1), shares: shares(one), domain: [edges[0], edges.at(-1)], top, colour: colourOf(one.framework), marks: [] });
  return h("div", { class: "duo" }, some.map(drawn));
}

/** Draws mean and variance of all strategies, and what they held. */
function mixes(all, printed) {
  const points = all.strategies.map((one) => ({ one, at: one.utility.variance.value, mean: one.utility.mean.value, constant: one.constant_mix !== null }));
  const paper = printed.map(({ adaptive: [mean, variance] }) => ({ at: variance, mean, paper: true }));
  const placed = [...points, ...paper].sort((one, other) => one.at - other.at);
  const series = (name, colour, is, more) => ({ name, colour, kind: "line", values: placed.map((point) => (is(point) ? point.mean : null)), ...more });
  const deciding = all.strategies.filter(({ periods }) => periods);
  const ranked = [...all.strategies].sort((one, other) => other.certainty_equivalent.value - one.certainty_equivalent.value);
  const held = (one) => ({
    name: named(one),
    colour: colourOf(one.framework),
    kind: "line",
    values: one.periods.map(({ allocation }) => allocation.mean),
    band: one.framework === "adaptive" ? one.periods.map(({ allocation }) => [allocation.quantile_10, allocation.quantile_90]) : null,
  });
  return section(
    "The frontier of constant mixes",
    note("What a constant share in stocks, nothing to everything by tenths, earns at what variance, and the frameworks beside it."),
    lineChart({
      title: "Mean and variance of terminal utility",
      height: 300,
      x: { values: placed.map(({ at }) => at), label: "Variance", format: (value) => tick(value, 0.01), tick },
      y: { format: four, tick },
      series: [
        series("Constant mixes", colourOfMix(0.5), ({ constant }) => constant, { joined: true }),
        ...deciding.map((one) => series(named(one), colourOf(one.framework), (point) => point.one === one, { apart: true })),
        series("Adaptive as printed", colourOf("own_mix"), (point) => point.paper, { apart: true }),
      ],
    }),
    table(
      "All strategies, all histories, by what each is worth",
      [
        { name: "Strategy", cell: named },
        number("Certainty equivalent", (row) => estimate(row.certainty_equivalent)),
        number("Mean utility", (row) => estimate(row.utility.mean)),
        number("Variance", (row) => interval(row.utility.variance, (value) => tick(value, 0.001))),
        number("Mean less adaptive", ({ difference }) => (difference ? estimate(difference.utility) : "\u2013")),
      ],
      ranked,
    ),
    lineChart({
      title: "Average share in stocks; the middle 80 % of adaptive paths shaded",
      x: { values: deciding[0].periods.map(({ period }) => period), label: "Period", format: String, whole: true },
      y: { format: percent, tick: percentTick, also: [0] },
      series: deciding.map(held),
    }),
  );
}

function coverage(all) {
  const told = find(all, "adaptive").coverage;
  if (!told) return "";
  const { by_sample_size: sizes, ever_left, target } = told;
  return section(
    "Does the ball hold the true law?",
    note(`On ${interval(ever_left, percent)} of the paths the ball of some period does not.`),
    lineChart({
      title: "Share of steps at which the ball held the true law",
      x: { values: sizes.map(({ sample_size }) => sample_size), label: "Returns seen", format: String, whole: true },
      y: { format: percent, tick: percentTick },
      series: [
        { name: "Held it, and the range of that", kind: "line", colour: 0, values: sizes.map(({ covered }) => covered.value), band: sizes.map(({ covered: { low, high } }) => [low, high]) },
        { name: "Aimed at", kind: "line", colour: 2, bare: true, values: sizes.map(() => target) },
      ],
    }),
  );
}

function smaller(rows) {
  if (rows.length === 0) return "";
  const shares = [...new Set(rows.map(({ radius_share }) => radius_share))].sort((one, other) => one - other);
  const of = (framework) => shares.map((share) => rows.find((row) => row.framework === framework && row.radius_share === share));
  return section(
    "Static with a smaller radius",
    note("The paper finds static trivial and says that Q must be reduced further for static to hold stocks. Here both frameworks use shares of the radius, over histories with Q near the average."),
    lineChart({
      title: "Share of histories after which nothing is ever held in stocks",
      x: { values: shares, label: "Share of the radius", format: percent, tick: percentTick, log: true },
      y: { format: percent, tick: percentTick, also: [0, 1] },
      series: ["static", "adaptive"].map((framework) => ({ name: PAPER[framework], kind: "line", joined: true, colour: colourOf(framework), values: of(framework).map(({ trivial }) => trivial.value) })),
    }),
    table(
      "Static and adaptive with shares of the radius",
      [
        { name: "Framework", cell: ({ framework }) => PAPER[framework] },
        number("Share of the radius", ({ radius_share }) => percent(radius_share, 0)),
        number("Histories that never hold stocks", ({ trivial }) => interval(trivial, percent)),
        number("First share in stocks", ({ first }) => interval(first, percent)),
        number("Its deviation", ({ first_variance }) => percent(Math.sqrt(first_variance.value))),
        number("Mean utility", ({ mean }) => estimate(mean)),
        number("Variance", ({ variance }) => interval(variance, tenth)),
      ],
      rows,
    ),
  );
}

const tenth = (value) => tick(value, 0.1);

function larger(rows) {
  const change = (name, key, format) => [number(`${name}, average Q`, (row) => format(row[`${key}s`][0].value)), number(`${name}, smallest Q`, (row) => format(row[`${key}s`][1].value)), number(`Change of ${name.toLowerCase()}`, (row) => interval(row[`change_of_${key}`], format))];
  return section(
    "Larger t0 and T",
    note("What a small Q changes for adaptive: histories with an average Q against those with the smallest of all that were drawn. The paper expects the change to be more significant for larger t0 and T."),
    table(
      "Adaptive after an average and a small Q",
      [{ name: "t0, T", cell: (row) => `${row.sample_size}, ${row.horizon}` }, number("Average Q", (row) => four(row.quantiles[0])), number("Smallest Q", (row) => four(row.quantiles[1])), ...change("Mean", "mean", four), ...change("Variance", "variance", tenth)],
      rows,
    ),
  );
}

/** Names a strategy by its framework and the share of the radius, and gives its colour. */
const followed = ({ framework, radius_share: share }) => (share !== null && share < 1 ? `${PAPER[framework]}, ${percent(share, 0)} of the radius` : PAPER[framework]);
const colourOfFollowed = ({ framework, radius_share: share }) => (share !== null && share < 1 ? colourOf({ adaptive: "parametric_adaptive", static: "own_mix" }[framework]) : colourOf(framework));

function firstGuess(rows) {
  const [sizes, horizons] = ["sample_size", "horizon"].map((key) => [...new Set(rows.map((row) => row[key]))].sort((one, other) => one - other));
  const some = (guess, size, horizon) => rows.filter((row) => row.guess === guess && row.sample_size === size && row.horizon === horizon);
  const longest = horizons.at(-1);
  const held = (guess) =>
    lineChart({
      title: `Average share in stocks after ${sizes[0]} returns; guess: ${guess}`,
      x: { values: Array.from({ length: longest }, (_, k) => k + 1), label: "Period", format: String, whole: true },
      y: { format: percent, tick: percentTick, also: [0, 1] },
      series: some(guess, sizes[0], longest).map((row) => ({ name: followed(row), kind: "line", bare: true, colour: colourOfFollowed(row), values: row.held.map(({ mean }) => mean) })),
    });
  const results = (guess, size) => {
    const at = (row, horizon) => some(guess, size, horizon).find((other) => followed(other) === followed(row));
    const columns = [
      { name: "Strategy", cell: followed },
      ...horizons.map((horizon) => number(`Bias, T = ${horizon}`, (row) => interval(at(row, horizon).bias, (value) => tick(value, 0.01)))),
      number(`Variance, T = ${longest}`, ({ variance }) => tenth(variance.value)),
      number("20 % quantile", ({ quantile_20: low }) => tick(low.value, 0.01)),
      number("Off the known share, first period", ({ distance }) => percent(distance[0].value, 0)),
      number("Last period", ({ distance }) => percent(distance.at(-1).value, 0)),
    ];
    return [h("h3", {}, `Guess: ${guess}, ${count(size)} returns`), table(`Guess: ${guess}, ${size} returns`, columns, some(guess, size, longest))];
  };
  const guesses = [...new Set(rows.map(({ guess }) => guess))];
  return section(
    "A wrong first guess",
    note("Histories are drawn from a guessed law and the returns after them from the true one, so the initial law is wrong. The bias is mean terminal utility less the known law's on the same returns. The last columns hold at the longest horizon; the last two are the mean distance of the share in stocks from the known law's. first_guess.csv has every interval."),
    h("div", { class: "duo" }, guesses.map(held)),
    guesses.map((guess) => results(guess, sizes[0])),
    sizes.length > 1 && disclosure(`After ${sizes.slice(1).map(count).join(" and ")} returns`, () => h("div", {}, sizes.slice(1).flatMap((size) => guesses.map((guess) => results(guess, size))).flat())),
  );
}

function convergence({ rows, slopes }) {
  const sizes = [...new Set(rows.map(({ sample_size }) => sample_size))].sort((one, other) => one - other);
  const of = (framework, gap) => sizes.map((size) => rows.find((row) => row.framework === framework && row.sample_size === size)?.[gap].value ?? null).map((value) => (value > 0 ? value : null));
  const gaps = (gap, title) => {
    const adaptive = of("adaptive", gap);
    const rate = sizes.map((size) => adaptive[0] && adaptive[0] * (size / sizes[0]) ** -0.5);
    const series = [["adaptive", adaptive], ["static", of("static", gap)]].map(([framework, values]) => ({ colour: colourOf(framework), name: PAPER[framework], kind: "line", joined: true, values }));
    return lineChart({
      title,
      height: 240,
      x: { values: sizes, label: "Returns of history", format: String, log: true },
      y: { format: (value) => significant(value), tick: (value) => significant(value), log: true },
      series: [...series, { name: "Rate \u22121/2", kind: "line", bare: true, colour: 2, values: rate }],
    });
  };
  return section(
    "Convergence to the known law",
    note("The value gap is what the known law is worth at the start less what the framework promises there, the gap of section 2.4; the realised gap is what it cost on the same simulated returns."),
    gaps("value_gap", "Value gap"),
    gaps("realised_gap", "Realised gap"),
    table(
      "Gaps to the known law, in terminal utility",
      [
        { name: "Returns of history", cell: ({ sample_size }) => count(sample_size) },
        { name: "Framework", cell: ({ framework }) => PAPER[framework] },
        number("Mean radius", ({ radius }) => four(radius)),
        number("Value gap", ({ value_gap }) => estimate(value_gap)),
        number("Realised gap", ({ realised_gap }) => estimate(realised_gap)),
      ],
      rows,
    ),
    h("h3", {}, "Fitted powers of the length of history; section 2.4 predicts \u22120.5 for the value gap of adaptive"),
    table(
      "Fitted powers of the length of history",
      [{ name: "Framework", cell: ({ framework }) => PAPER[framework] }, { name: "Gap", cell: ({ gap }) => gap }, number("All", ({ all }) => tick(all, 0.01)), number("Last two", ({ last }) => interval(last, (value) => tick(value, 0.01)))],
      slopes,
    ),
  );
}
