// The report of a comparison: policies of a declared problem and rules, through the same noises, drawn or recorded.

import { lineChart } from "./chart.js";
import { h, section, table } from "./dom.js";
import { count, counted, percent, significant, tick } from "./format.js";
import { interval } from "./verdict.js";

/** Most strategies in a chart: each has a colour of its own. */
const DRAWN = 10;

/** Formats a number whose unit is not known. */
export const plain = (value) => significant(value, 5);

/** Formats an estimate with its range, to two digits of the width of the range. An end near 0 keeps a digit, so that it does not look like 0. */
export function ranged(estimate) {
  const { low, high } = estimate;
  if (!(high > low)) return interval(estimate, plain);
  const least = Math.min(...[high - low, 10 * Math.abs(low), 10 * Math.abs(high)].filter((size) => size > 0));
  const step = 10 ** (Math.floor(Math.log10(least)) - 1);
  return interval(estimate, (value) => tick(value, step));
}

const sentence = (words) => words[0].toUpperCase() + words.slice(1);

export const quoted = (name) => `\u201c${name}\u201d`;

/** Draws the report. `policyLink(id)` returns a link to a policy. */
export const body = (report, policyLink) => [compared(report, policyLink), worths(report), courses(report.strategies, "Average ")];

/** Describes what was compared, and what the noises are. */
function compared({ request, problem: { noise, horizon, history, framework }, strategies }, policyLink) {
  const links = Object.entries(request.policies ?? {}).map(([name, id]) => h("p", {}, `${quoted(name)} is `, policyLink(id), "."));
  const drawn = `${counted(strategies.length, "strategy", "strategies")} through the same ${counted(request.paths, "path")} of ${counted(horizon, "period")}, with each ${noise.name} drawn from the record of ${counted(history.length, "number")}.`;
  const trusted = framework !== "plug_in" && "A cautious policy does not trust the record. Where it falls behind on these paths, that is the price of its caution.";
  return h("div", { class: "words" }, h("p", {}, drawn), links, trainedWords(request), ruleWords(request), trusted && h("p", {}, trusted));
}

const TRAINED = {
  adaptive: "stays cautious, and learns each number it sees",
  static: "stays cautious against laws near the record, and learns nothing more",
  plug_in: "learns, and takes what it has learned as the truth",
  known_law: "takes the record as the truth, and learns nothing more",
};

/** Says what each framework is whose policy was trained for a report. */
export const trainedWords = ({ frameworks = [] }) => frameworks.map((name) => h("p", {}, `${quoted(name)} ${TRAINED[name]}.`));

/** Lists the formulas of the rules of a report. */
export const ruleWords = ({ rules = {} }) =>
  Object.entries(rules).flatMap(([name, actions]) =>
    Object.entries(actions).map(([action, formula]) => h("p", {}, `${quoted(name)} has ${action} = `, h("code", {}, formula), ".")),
  );

/** Says whether the worth of a strategy differs from that of the first. */
export function verdict({ strategy, difference }, first, { is = "is worth", each = "", on = "these paths" } = {}) {
  const { value, low, high } = difference;
  if (low === 0 && high === 0) return `${quoted(strategy)} ${is} as much${each} as ${quoted(first)} on ${on}.`;
  const size = value < 0 ? { value: -value, low: -high, high: -low } : difference;
  const said = `${quoted(strategy)} ${is} ${ranged(size)} ${value < 0 ? "less" : "more"}${each} than ${quoted(first)}`;
  if (low > 0 || high < 0) return `${said}. The range does not contain 0: the two can be told apart.`;
  return `${said}. The range contains 0: ${on} cannot tell the two apart.`;
}

/** Shows what each strategy is worth, in sentences and as a table. */
function worths({ request: { level }, problem: { utility }, strategies }) {
  const [first, ...others] = strategies;
  const column = (name, cell) => ({ name, numeric: true, cell });
  const columns = [
    { name: "Strategy", cell: ({ strategy }) => strategy },
    column("Worth", ({ value }) => ranged(value)),
    column(`More than ${quoted(first.strategy)}`, ({ difference }) => (difference ? ranged(difference) : "\u2013")),
    column("Worst twentieth", ({ worst_twentieth }) => ranged(worst_twentieth)),
    column("Under the worst law", ({ robust_value }) => plain(robust_value)),
  ];
  const meaning = utility ? "A worth is the amount that would be as good if it were certain." : "A worth is the average over all paths.";
  const note = `${meaning} The worst twentieth is the average of the worst 5\u202f% of the paths. The worth under the worst law is known for policies only. Ranges hold with ${percent(level, 0)} confidence, each by itself.`;
  const said = others.map((other) => h("p", {}, verdict(other, first.strategy)));
  return section("What each is worth", h("div", { class: "words" }, said), table("Worth of each strategy", columns, strategies), h("p", { class: "note" }, note));
}

/** Draws the states and actions of strategies, period by period; each title begins with `mean`. */
export function courses(strategies, mean) {
  const shown = strategies.slice(0, DRAWN);
  const [{ periods }] = shown;
  const x = { values: periods.map((_, step) => step + 1), label: "Period", format: String, whole: true };
  const chart = (title, kind, name) => lineChart({ title, x, y: { format: plain, tick }, start: 0, series: shown.map(({ strategy, periods }) => ({ name: strategy, kind: "line", values: periods.map((one) => one[kind][name]) })) });
  const charts = (kind, title) => Object.keys(periods[0][kind]).map((name) => chart(title(name), kind, name));
  return section(
    "What each did",
    strategies.length > DRAWN && h("p", { class: "note" }, `The charts show the first ${count(DRAWN)} strategies. The exported report has all.`),
    charts("actions", (name) => sentence(`${mean}${name}`)),
    charts("states", (name) => sentence(`${mean}${name} at the start of a period`)),
  );
}
