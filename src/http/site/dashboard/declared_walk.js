// The report of a walk-forward of a declared problem: policies, trained again and again, and rules, through the record itself.

import { lineChart } from "./chart.js";
import { courses, plain, quoted, ranged, ruleWords, trainedWords, verdict } from "./comparison.js";
import { csvText } from "./csv.js";
import { h, section, table } from "./dom.js";
import { counted, percent, tick } from "./format.js";

/** Draws the report. */
export const body = (report) => [walked(report), gains(report), course(report), courses(report.strategies, "")];

/** Makes a CSV file of all periods of all strategies. */
export function csv({ request: { problem }, strategies }) {
  const [{ periods: [first] }] = strategies;
  const [states, actions] = [first.states, first.actions].map(Object.keys);
  const head = ["strategy", "period", problem.noise.name, "reward", "radius", ...states.map((name) => `state ${name}`), ...actions.map((name) => `action ${name}`)];
  const row = (strategy, one, index) => [strategy, index + 1, one.noise, one.reward, one.radius ?? "", ...states.map((name) => one.states[name]), ...actions.map((name) => one.actions[name])];
  return csvText([head, ...strategies.flatMap(({ strategy, periods }) => periods.map((one, index) => row(strategy, one, index)))]);
}

/** Describes what walked, and how. */
function walked({ request, strategies }) {
  const { problem: { noise, history, horizon }, window, every } = request;
  const lived = `${counted(strategies.length, "strategy", "strategies")} lived the last ${counted(history.length - window, "period")} of the record of ${noise.name}, one after another.`;
  const trained = `Every ${counted(every, "period")} each policy was trained anew on the ${counted(window, "number")} before, from the states it had reached, over ${counted(horizon, "period")}.`;
  return h("div", { class: "words" }, h("p", {}, lived), h("p", {}, trained), trainedWords(request), ruleWords(request));
}

/** Shows what each strategy gained a period. */
function gains({ request: { problem: { utility }, level, every }, strategies }) {
  const [first, ...others] = strategies;
  const column = (name, cell) => ({ name, numeric: true, cell });
  const columns = [
    { name: "Strategy", cell: ({ strategy }) => strategy },
    column("Gain of a period", ({ gain }) => ranged(gain)),
    column(`More than ${quoted(first.strategy)}`, ({ difference }) => (difference ? ranged(difference) : "\u2013")),
    !utility && column("Earned in all", ({ earned }) => plain(earned)),
    column(utility ? "Amount at the end" : "Worth of what is left", ({ left }) => plain(left)),
  ].filter(Boolean);
  const meaning = utility
    ? "The gain of a period is what the amount grew by, on average."
    : "The gain of a period is its reward, and how much more the states are worth after it by the formula for the end, on average.";
  const note = `${meaning} Ranges hold with about ${percent(level, 0)} confidence, each by itself. They resample the record in blocks of ${counted(every, "period")}, and are too narrow if it has few of them.`;
  const said = others.map((other) => h("p", {}, verdict(other, first.strategy, { is: "gained", each: " a period", on: "this record" })));
  return section("What each gained", h("div", { class: "words" }, said), table("Gain of each strategy", columns, strategies), h("p", { class: "note" }, note));
}

/** Draws what each strategy earned so far, if periods have rewards. */
function course({ request: { problem: { reward, noise } }, strategies }) {
  const [{ periods }] = strategies;
  const x = { values: periods.map((_, index) => index + 1), label: "Period", format: String, whole: true };
  const chart = (title, series) => lineChart({ title, x, y: { format: plain, tick }, start: 0, series });
  const sums = (periods) => {
    let sum = 0;
    return periods.map(({ reward }) => (sum += reward));
  };
  const earned = strategies.slice(0, 10).map(({ strategy, periods }) => ({ name: strategy, kind: "line", values: sums(periods) }));
  return section(
    "What happened",
    chart(`The record of ${noise.name}`, [{ name: noise.name, kind: "line", values: periods.map((one) => one.noise) }]),
    reward && chart("Rewards so far", earned),
  );
}
