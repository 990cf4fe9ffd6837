// Two policies: what they were trained for, and what they hold at the same average return.

import { get } from "./api.js";
import { beside, LETTERS } from "./beside.js";
import { lineChart } from "./chart.js";
import { h, section } from "./dom.js";
import { inWords as flowsInWords } from "./flows.js";
import { count, counted, percent, percentTick, points, significant, wealth } from "./format.js";
import { policyLink } from "./naming.js";
import { unitOf } from "./periods.js";
import { caution, centreInWords, FRAMEWORKS, isDeclared, moments, utility } from "./specification.js";
import { surfaceCurve } from "./surface_view.js";

/** Number of points at which the two are evaluated. */
const ALONG = 61;

export async function policiesBeside(ids, leaving) {
  const both = await Promise.all(ids.map((id) => get(`/policies/${id}`, leaving)));
  const asked = both.map(({ specification }) => specification);
  if (asked.some(isDeclared)) return h("p", { class: "lead" }, "Only policies of investors can be compared. Of these, ", asked.every(isDeclared) ? "both are" : "one is", " of a declared problem: see ", ids.map((id, index) => [index ? " and " : "", policyLink(id)]), ".");
  const table = beside("Two policies side by side", "policies", "Policy", ids, both.map(({ name }) => name), rows(asked));
  return [h("p", { class: "lead" }, differences(asked, "They")), table, curves(ids, both, leaving)];
}

/** Says what differs. It never calls equal what differs, even if no row shows the difference. */
export function differences([one, other], subject) {
  const all = rows([one, other]);
  const apart = all.filter(({ cells: [left, right] }) => left !== right).map(({ name }) => name.toLowerCase());
  const alike = JSON.stringify(one) === JSON.stringify(other);
  if (apart.length === 0) return alike ? "The two requests are the same." : `${subject} differ in details that the table below does not show. See each policy's own page.`;
  const [left, right] = [one, other].map(({ problem, fund, design: { count, ...design }, surrogate, seed }) => ({ ...problem, ...fund, count, design, surrogate, seed }));
  const fields = new Set([...Object.keys(left), ...Object.keys(right)]);
  const untold = [...fields].filter((field) => !apart.includes(ROW_OF[field]) && JSON.stringify(left[field]) !== JSON.stringify(right[field]));
  const rest = untold.length === 0 ? "everything else is the same" : "other details also differ";
  return `${subject} differ in ${apart.length === 1 ? apart[0] : `${apart.slice(0, -1).join(", ")} and ${apart.at(-1)}`}; ${rest}.`;
}

/** The row that shows each field of the problem. */
const ROW_OF = {
  framework: "kind",
  utility: "investor",
  radius: "caution",
  horizon: "periods ahead",
  periods_per_year: "periods ahead",
  rate_per_step: "bank",
  trading_cost: "trading cost",
  initial_wealth: "wealth at the start",
  contributions: "money added",
  action_interval: "share allowed outside the bank",
  learning: "older returns",
  centre: "centre",
  history: "record",
  assets: "assets",
  composition: "mix of assets",
  ground_norm: "distance of markets",
  support: "moves assumed possible",
  count: "precision",
  seed: "precision",
};

/** How the total is split between the assets. */
const MIXES = { one_step: "Best against the worst market", equal: "Equal shares", inverse_volatility: "By inverse volatility" };
const mix = (composition) => MIXES[composition] ?? composition.given.map((share) => percent(share, 0)).join(", ");
const moves = (support) => {
  const end = (log) => percent(Math.expm1(log), 1);
  const said = {
    worst_seen: ({ factor }) => `${factor} times the worst seen`,
    between: ({ min, max }) => `from ${end(min)} to ${end(max)}`,
  };
  return said[support?.rule]?.(support) ?? "Any";
};
const NORMS = { scaled_one: "Each asset by its own volatility", sup: "All assets at once" };

/** Returns the rows that compare two specifications, `{problem, fund, design, seed}` each. */
export function rows(asked) {
  const problems = asked.map(({ problem }) => problem);
  const row = (name, read, apart) => {
    const cells = asked.map((one) => read(one.problem, one));
    return { name, cells, apart };
  };
  const [one, other] = problems;
  const less = (read, words) => words(read(other) - read(one));
  const signed = (value, words) => `${value > 0 ? "+" : ""}${words(value)}`;
  const records = problems.map(({ history }) => moments(history.map(Math.expm1)));
  const changed = (field) => JSON.stringify(one[field]) !== JSON.stringify(other[field]);
  const added = problems.map((problem) => flowsInWords(problem) || "None");
  const record = ({ history }) => {
    const { mean, deviation } = moments(history.map(Math.expm1));
    return `${counted(history.length, "return")}: mean ${percent(mean, 2)}, deviation ${percent(deviation, 2)}`;
  };
  return [
    row("Kind", ({ framework }) => FRAMEWORKS[framework]),
    row("Assets", (_, { fund }) => (fund ? fund.assets.join(", ") : "One")),
    row("Mix of assets", (_, { fund }) => (fund ? mix(fund.composition) : "None")),
    row("Distance of markets", (_, { fund }) => (fund ? NORMS[fund.ground_norm] : "One asset only")),
    row("Investor", (problem) => utility(problem.utility)),
    row("Caution", (problem) => caution(problem)),
    row("Periods ahead", ({ horizon, periods_per_year }) => counted(horizon, unitOf(periods_per_year)), less(({ horizon }) => horizon, (value) => signed(value, count))),
    row("Bank", ({ rate_per_step }) => percent(rate_per_step, 3), less(({ rate_per_step }) => rate_per_step, (value) => signed(value, (size) => points(size, 3)))),
    row("Trading cost", ({ trading_cost }) => percent(trading_cost, 2), less(({ trading_cost }) => trading_cost, (value) => signed(value, (size) => points(size, 2)))),
    row("Wealth at the start", ({ initial_wealth }) => wealth(initial_wealth), less(({ initial_wealth }) => initial_wealth, (value) => signed(value, wealth))),
    { name: "Money added", cells: [added[0], added[1] === added[0] && changed("contributions") ? `${added[1]} (other amounts or periods)` : added[1]] },
    row("Share allowed outside the bank", ({ action_interval: [least, most] }) => `${percent(least, 0)} to ${percent(most, 0)}`),
    row("Moves assumed possible", ({ support }) => moves(support)),
    row("Older returns", ({ learning }) => (learning.kind === "decay" ? `half after ${significant(learning.half_life)}` : "count as much as new ones")),
    row("Centre", ({ centre }) => centreInWords(centre) || "The returns seen"),
    { name: "Record", cells: [record(one), `${record(other)}${changed("history") && record(other) === record(one) ? " (other returns)" : ""}`], apart: `mean ${signed(records[1].mean - records[0].mean, (value) => points(value, 2))}` },
    row("Precision", (_, { design, seed }) => `${counted(design.count, "situation")}, seed ${count(seed)}`),
  ];
}

/** Draws what each holds near the start, by the average return of the record. */
function curves(ids, both, leaving) {
  const holder = h("div", {}, h("p", { class: "note" }, "Reading the two policies\u2026"));
  const known = both.map(({ specification: { problem } }) => moments(problem.history));
  Promise.all(ids.map((id, index) => surfaceCurve(id, Math.min(1, both[index].horizon - 1), leaving))).then(
    (found) => {
      const ranges = found.map(({ range }, index) => range ?? [known[index].mean - known[index].deviation, known[index].mean + known[index].deviation]);
      const [low, high] = [Math.min(...ranges.map(([from]) => from)), Math.max(...ranges.map(([, to]) => to))];
      const means = Array.from({ length: ALONG }, (_, k) => low + ((high - low) * k) / (ALONG - 1));
      const series = found.map(({ at }, index) => ({ name: LETTERS[index], kind: "line", bare: true, values: means.map(at) }));
      const start = Math.max(0, means.findIndex((mean) => mean >= known[0].mean));
      const x = { values: means, label: "Average return", format: (value) => percent(value, 2), tick: percentTick };
      holder.replaceChildren(lineChart({ title: "Share in stocks by average return", height: 240, start, x, y: { format: percent, tick: percentTick, also: [0] }, series }));
    },
    (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error" }, error.message)),
  );
  return section(
    "What they hold",
    h("p", { class: "note" }, "After the first period, by the average log-return of the whole record. Wealth, or the standard deviation, is in the middle of what the policy was trained for."),
    holder,
  );
}
