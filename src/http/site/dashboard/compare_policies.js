// Two to four policies: what they were trained for, and what they hold at the same average return.

import { get } from "./api.js";
import { areSame, beside, joined, LETTERS, numbered } from "./beside.js";
import { lineChart } from "./chart.js";
import { h, section } from "./dom.js";
import { inWords as flowsInWords } from "./flows.js";
import { count, counted, percent, percentTick, points, significant, wealth } from "./format.js";
import { policyLink } from "./naming.js";
import { unitOf } from "./periods.js";
import { caution, centreInWords, FRAMEWORKS, isDeclared, moments, utility } from "./specification.js";
import { surfaceCurve } from "./surface_view.js";

/** Number of points at which each is evaluated. */
const ALONG = 61;

export async function policiesBeside(ids, leaving) {
  const all = await Promise.all(ids.map((id) => get(`/policies/${id}`, leaving)));
  const asked = all.map(({ specification }) => specification);
  const declared = asked.filter(isDeclared).length;
  if (declared > 0) {
    const many = declared < ids.length ? `${numbered(declared)} ${declared === 1 ? "is" : "are"}` : ids.length === 2 ? "both are" : "all are";
    return h("p", { class: "lead" }, `Only policies of investors can be compared. Of these, ${many} of a declared problem: see `, ids.map((id, index) => [index === 0 ? "" : index === ids.length - 1 ? " and " : ", ", policyLink(id)]), ".");
  }
  const size = numbered(ids.length);
  const table = beside(`${size[0].toUpperCase()}${size.slice(1)} policies side by side`, "policies", "Policy", ids, all.map(({ name }) => name), rows(asked));
  return [h("p", { class: "lead" }, differences(asked, "They")), table, curves(ids, all, leaving)];
}

/** Says what differs. It never calls equal what differs, even if no row shows the difference. */
export function differences(asked, subject) {
  const apart = rows(asked).filter(({ cells }) => !areSame(cells)).map(({ name }) => name.toLowerCase());
  const text = (value) => JSON.stringify(value);
  if (apart.length === 0) return areSame(asked.map(text)) ? `The ${numbered(asked.length)} requests are the same.` : `${subject} differ in details that the table below does not show. See each policy's own page.`;
  const parts = asked.map(({ problem, fund, design: { count, ...design }, surrogate, seed }) => ({ ...problem, ...fund, count, design, surrogate, seed }));
  const fields = [...new Set(parts.flatMap(Object.keys))];
  const untold = fields.filter((field) => !apart.includes(ROW_OF[field]) && !areSame(parts.map((part) => text(part[field]))));
  const rest = untold.length === 0 ? "everything else is the same" : "other details also differ";
  return `${subject} differ in ${joined(apart)}; ${rest}.`;
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

/** Returns the rows that compare specifications, `{problem, fund, design, seed}` each. */
export function rows(asked) {
  const problems = asked.map(({ problem }) => problem);
  const row = (name, read, apart) => {
    const cells = asked.map((one) => read(one.problem, one));
    return { name, cells, apart };
  };
  const [one, other] = problems;
  /** Returns the difference of two in words; more have none. */
  const less = (read, words) => (problems.length === 2 ? words(read(other) - read(one)) : undefined);
  const signed = (value, words) => `${value > 0 ? "+" : ""}${words(value)}`;
  const meanOf = ({ history }) => moments(history.map(Math.expm1)).mean;
  /** Returns the text of a field for each, marked if it reads like that of the first and differs from it. */
  const marked = (words, field, mark) =>
    problems.map((problem, index) => (index > 0 && words(problem) === words(one) && JSON.stringify(problem[field]) !== JSON.stringify(one[field]) ? `${words(problem)} (${mark})` : words(problem)));
  const added = (problem) => flowsInWords(problem) || "None";
  const record = ({ history }) => {
    const { mean, deviation } = moments(history.map(Math.expm1));
    return `${counted(history.length, "return")}: mean ${percent(mean, 2)}, deviation ${percent(deviation, 2)}`;
  };
  return [
    row("Framework", ({ framework }) => FRAMEWORKS[framework]),
    row("Assets", (_, { fund }) => (fund ? fund.assets.join(", ") : "One")),
    row("Mix of assets", (_, { fund }) => (fund ? mix(fund.composition) : "None")),
    row("Distance of markets", (_, { fund }) => (fund ? NORMS[fund.ground_norm] : "One asset only")),
    row("Investor", (problem) => utility(problem.utility)),
    row("Caution", (problem) => caution(problem)),
    row("Periods ahead", ({ horizon, periods_per_year }) => counted(horizon, unitOf(periods_per_year)), less(({ horizon }) => horizon, (value) => signed(value, count))),
    row("Bank", ({ rate_per_step }) => percent(rate_per_step, 3), less(({ rate_per_step }) => rate_per_step, (value) => signed(value, (size) => points(size, 3)))),
    row("Trading cost", ({ trading_cost }) => percent(trading_cost, 2), less(({ trading_cost }) => trading_cost, (value) => signed(value, (size) => points(size, 2)))),
    row("Wealth at the start", ({ initial_wealth }) => wealth(initial_wealth), less(({ initial_wealth }) => initial_wealth, (value) => signed(value, wealth))),
    { name: "Money added", cells: marked(added, "contributions", "other amounts or periods") },
    row("Share allowed outside the bank", ({ action_interval: [least, most] }) => `${percent(least, 0)} to ${percent(most, 0)}`),
    row("Moves assumed possible", ({ support }) => moves(support)),
    row("Older returns", ({ learning }) => (learning.kind === "decay" ? `half after ${significant(learning.half_life)}` : "count as much as new ones")),
    row("Centre", ({ centre }) => centreInWords(centre) || "The returns seen"),
    { name: "Record", cells: marked(record, "history", "other returns"), apart: less(meanOf, (value) => `mean ${signed(value, (size) => points(size, 2))}`) },
    row("Precision", (_, { design, seed }) => `${counted(design.count, "situation")}, seed ${count(seed)}`),
  ];
}

/** Draws what each holds near the start, by the average return of the record. */
function curves(ids, all, leaving) {
  const holder = h("div", {}, h("p", { class: "note" }, "Reading the policies\u2026"));
  const known = all.map(({ specification: { problem } }) => moments(problem.history));
  Promise.all(ids.map((id, index) => surfaceCurve(id, Math.min(1, all[index].horizon - 1), leaving))).then(
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
