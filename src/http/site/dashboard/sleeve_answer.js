// The answer to how much of a strategy: in sentences, beside the Kelly share, and under the worst law.

import { h, quantSection, section, table } from "./dom.js";
import { counted, figures, percent } from "./format.js";
import { lawChart } from "./law_chart.js";
import { unitOf } from "./periods.js";
import { worded } from "./plan_answer.js";
import { cautionName, warningList } from "./specification.js";

/** Formats a share of the capital, which may have no limit. */
export const share = (value) => (value === null ? "no limit" : percent(value));

/** Returns the sections of an answer. */
export function sleeveView(report, { problem, record_of }) {
  const noun = record_of === "trades" ? "trade" : unitOf(problem.periods_per_year);
  const [first, ...rest] = report.sentences.map(worded);
  const head = section(
    "How much",
    h(
      "div",
      { class: "advice", id: "sleeve", tabindex: -1 },
      h("p", { class: "note" }, asked(problem, noun)),
      h("p", { class: "first" }, first),
      h("ul", { class: "points" }, rest.map((words) => h("li", {}, words))),
      ...report.caution.map(({ sentence }) => h("p", { class: "sentence" }, worded(sentence))),
      ...warningList(report.warnings, problem),
    ),
  );
  return [head, beside(report, noun), ...strategies(report), ...worst(report)];
}

/** Says what was asked, so that the answer stands by itself. */
function asked({ history, caution, assets, rate_per_step }, noun) {
  return `${assets ? `${assets.length} strategies, ` : ""}${counted(history.length, noun)}, ${cautionName(caution)} caution; the bank pays ${percent(rate_per_step, 2)} a ${noun}.`;
}

/** Compares the growth of the share with that of the Kelly share and of the bank. */
function beside({ share: own, kelly, growth, growth_a_year }, noun) {
  const { bank, share: ofShare, kelly: ofKelly } = growth_a_year ?? growth;
  const rows = [
    { name: h("b", {}, "The share"), part: own, growth: ofShare },
    { name: "The Kelly share", part: kelly, growth: ofKelly },
    { name: "The bank alone", part: 0, growth: { record: bank, worst: bank } },
  ];
  const digits = growth_a_year ? 1 : 2;
  const grows = (value) => (value === null || value === undefined ? "\u2013" : percent(value, digits));
  const period = growth_a_year ? "year" : noun;
  const shown = table("The share beside the Kelly share", [
    { name: "", cell: ({ name }) => name },
    { name: "Of the capital", numeric: true, cell: ({ part }) => share(part) },
    { name: `Growth a ${period}`, numeric: true, cell: ({ growth }) => grows(growth?.record) },
    { name: `Growth a ${period}, worst law`, numeric: true, cell: ({ growth }) => grows(growth?.worst) },
  ], rows);
  return section("Beside the Kelly share", shown, h("p", { class: "note" }, "The Kelly share takes the record as the truth, and borrows at the bank\u2019s rate what exceeds the capital. Both are judged by the law that is worst for the share."));
}

/** Shows the shares of several strategies. */
function strategies({ strategies: found }) {
  if (!found) return [];
  const rows = Object.entries(found).map(([name, one]) => ({ name, ...one }));
  const mean = (value) => percent(value, 2);
  return [section("The strategies", table("The strategies", [
    { name: "Strategy", cell: ({ name }) => name },
    { name: "Of the capital", numeric: true, cell: (row) => share(row.share) },
    { name: "Kelly", numeric: true, cell: ({ kelly }) => share(kelly) },
    { name: "Mean log-return", numeric: true, cell: (row) => mean(row.mean.seen) },
    { name: "Under the worst law", numeric: true, cell: (row) => mean(row.mean.worst) },
  ], rows))];
}

/** Draws the worst law of one strategy. */
function worst({ worst_case, worst: moments, radius }) {
  if (!worst_case || !moments) return [];
  const build = () => h("div", {}, h("p", { class: "sentence" }, worded(worst_case.sentence)), lawChart(worst_case), h("p", { class: "note" }, `Radius of the uncertainty set ${figures(radius, 3)}.`));
  return [quantSection("The worst law", build)];
}
