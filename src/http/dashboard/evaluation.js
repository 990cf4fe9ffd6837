// The report of one evaluation, as docs/evaluation.md describes it.

import { download, get } from "./api.js";
import { lineChart } from "./chart.js";
import { facts, h, section, table } from "./dom.js";
import { count, counted, duration, percent, percentTick, short, significant, tick, wealth } from "./format.js";
import { intervalChart } from "./interval_chart.js";
import { until } from "./jobs.js";
import { FRAMEWORKS, worth } from "./specification.js";

export async function view(id, leaving) {
  const job = await get(`/jobs/${id}`, leaving);
  const trail = h("p", { class: "trail" }, h("a", { href: "#/evaluations" }, "Evaluations"));
  const title = `Evaluation ${short(id)}`;
  if (job.state !== "succeeded") return { title, trail, body: until(job, leaving) };
  const report = await get(job.report, leaving);
  const names = report.strategies.map(named);
  const export_ = h(
    "a",
    { class: "button quiet", href: job.report, download: `evaluation-${short(id)}.json`, onclick: download },
    "Export",
  );
  return {
    title,
    trail,
    actions: export_,
    body: [summary(report), outcomes(report, names), spreads(report, names), courses(report), coverage(report)],
  };
}

const named = ({ framework, constant_mix }) =>
  framework ? FRAMEWORKS[framework] : constant_mix === 0 ? "All in the bank" : `${percent(constant_mix, 0)} at risk`;

/** An estimate with its interval. */
const interval = ({ value, low, high }, format) => `${format(value)} (${format(low)} to ${format(high)})`;

function summary({ request, histories, level = request.level, costs }) {
  const drawn = request.histories.kind === "drawn";
  const radii = histories.map(({ radius }) => radius).filter(Number.isFinite);
  return h(
    "div",
    {},
    h(
      "div",
      { class: "words" },
      h(
        "p",
        {},
        `Every strategy went through the same ${counted(request.paths * histories.length, "path")} of ${counted(request.problem.horizon, "period")}${drawn ? `, from ${counted(histories.length, "history").replace("historys", "histories")} drawn from the law` : ", all from the given history"}. Ranges bound each figure at ${percent(level, 0)}.`,
      ),
    ),
    facts([
      ["Paths", count(request.paths), drawn ? "per history" : "from one history"],
      ["Histories", count(histories.length), drawn ? "drawn" : "given"],
      radii.length > 0 && [
        "First radius",
        significant(radii.reduce((sum, radius) => sum + radius, 0) / radii.length, 3),
        "mean over histories",
      ],
      ["Training", duration(costs.training_seconds)],
      ["Simulation", duration(costs.simulation_seconds)],
    ]),
  );
}

/** Quantiles and extremes of utility are those of wealth, utility being increasing; its mean and variance are not. */
function outcomes({ strategies, reference, request, sentences }, names) {
  const rows = strategies.map((strategy, index) => ({ ...strategy, name: names[index] }));
  const estimate = (name, read, format) => ({
    name,
    numeric: true,
    cell: (row) => (read(row) ? interval(read(row), format) : "\u2013"),
  });
  const plain = (name, read, digits) => ({ name, numeric: true, cell: (row) => significant(read(row).value, digits) });
  const inWealth = (name, read) => ({
    name,
    numeric: true,
    cell: ({ utility }) => wealth(worth(request.problem.utility, read(utility).value)),
  });
  const referred = names[strategies.findIndex(({ strategy }) => strategy === reference)];
  return section(
    "What each was worth",
    intervalChart({
      title: "Certainty equivalent of terminal wealth",
      rows: rows.map(({ name, certainty_equivalent }) => ({ name, ...certainty_equivalent })),
      format: wealth,
      tick,
    }),
    table(
      "Outcomes of every strategy",
      [
        { name: "Strategy", cell: ({ name }) => name },
        estimate("Certainty equivalent", ({ certainty_equivalent }) => certainty_equivalent, wealth),
        estimate(
          `Less ${referred.toLowerCase()}`,
          ({ difference }) => difference?.certainty_equivalent,
          (value) => tick(value, 0.01),
        ),
        estimate(
          "Beyond its own mix",
          ({ own_mix }) => own_mix?.beyond,
          (value) => tick(value, 0.01),
        ),
        estimate("Mean wealth", (row) => row.wealth.mean, wealth),
        inWealth("20 % below", ({ quantile_20 }) => quantile_20),
        inWealth("90 % below", ({ quantile_90 }) => quantile_90),
        inWealth("Least", ({ min }) => min),
        inWealth("Most", ({ max }) => max),
        plain("Mean utility", ({ utility }) => utility.mean, 7),
        plain("Variance", ({ utility }) => utility.variance, 3),
      ],
      rows,
    ),
    h("div", { class: "words" }, ...sentences.map((sentence) => h("p", {}, sentence))),
  );
}

/** One histogram a strategy, on common bins: even in utility, labelled by the wealth that has it. */
function spreads({ strategies, histogram_edges, request }, names) {
  const bins = histogram_edges.length - 1;
  if (histogram_edges[0] === histogram_edges[bins]) return "";
  const edge = (place) => wealth(worth(request.problem.utility, histogram_edges[Math.round(place)]));
  const x = {
    values: Array.from({ length: bins }, (_, k) => k + 1),
    domain: [0, bins],
    label: "Wealth",
    whole: true,
    format: (place) => `${edge(place - 1)} to ${edge(place)}`,
    tick: edge,
  };
  const charts = strategies.map(({ histogram }, index) => {
    const total = histogram.reduce((sum, value) => sum + value, 0);
    return lineChart({
      title: names[index],
      height: 120,
      start: histogram.indexOf(Math.max(...histogram)),
      x,
      y: { format: percent, tick: percentTick, also: [0] },
      series: [{ name: "", kind: "bars", values: histogram.map((value) => value / total) }],
    });
  });
  return section("How terminal wealth spreads", h("div", { class: "trio" }, charts));
}

/** Allocation and radius through time, where a framework decides. */
function courses({ strategies }) {
  const deciding = strategies.filter(({ periods }) => periods);
  if (deciding.length === 0) return "";
  const values = deciding[0].periods.map(({ period }) => period);
  const x = { values, label: "Period", format: String, whole: true };
  const line = (strategy, read) => ({ name: named(strategy), kind: "line", values: strategy.periods.map(read) });
  const guarding = deciding.filter(({ periods }) => periods[0].radius);
  const radius =
    guarding.length > 0 &&
    lineChart({
      title: "Mean radius",
      x,
      y: { format: (value) => significant(value, 3), tick },
      series: guarding.map((strategy) => line(strategy, ({ radius }) => radius.mean)),
    });
  return section(
    "What each held",
    lineChart({
      title: "Mean allocation",
      x,
      y: { format: percent, tick: percentTick, also: [0] },
      series: deciding.map((strategy) => line(strategy, ({ allocation }) => allocation.mean)),
    }),
    radius || null,
  );
}

function coverage({ strategies }) {
  const covered = strategies.filter(({ coverage }) => coverage);
  if (covered.length === 0) return "";
  const rows = covered.flatMap((strategy) =>
    strategy.coverage.by_sample_size.map((row) => ({ ...row, strategy, target: strategy.coverage.target })),
  );
  const left = covered.map(
    (strategy) =>
      `${named(strategy)}: the law left the ball at some period on ${interval(strategy.coverage.ever_left, percent)} of the paths.`,
  );
  return section(
    "How often the ball held the true law",
    left.map((sentence) => h("p", {}, sentence)),
    table(
      "Coverage by sample size",
      [
        { name: "Strategy", cell: ({ strategy }) => named(strategy) },
        { name: "Returns seen", numeric: true, cell: ({ sample_size }) => count(sample_size) },
        { name: "Ball held the law", numeric: true, cell: (row) => interval(row.covered, percent) },
        { name: "Aimed at", numeric: true, cell: ({ target }) => (target === null ? "\u2013" : percent(target, 0)) },
      ],
      rows,
    ),
  );
}
