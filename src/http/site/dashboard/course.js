// How a session went: its wealth beside that of the comparators, its worst fall, and what it held.

import { lineChart } from "./chart.js";
import { falls, mixed, risky, wealths } from "./comparators.js";
import { h, section } from "./dom.js";
import { banked } from "./flows.js";
import { allocation, percent, percentTick, tick } from "./format.js";
import { inCurrency } from "./money.js";
import { isCautious } from "./specification.js";
import { colourOf } from "./strategies.js";
import { worstFalls } from "./track.js";

/** The comparators of a session, each held through the same returns. */
export const besides = (history) => [
  { name: "All in the bank", share: 0, colour: colourOf("all_bank") },
  { name: "60/40", share: 0.6, colour: colourOf("sixty_forty") },
  { name: `All in ${risky(history)}`, share: 1, colour: colourOf("all_stock") },
];
/** Returns the benchmarks that the service keeps for several assets: `{name, colour, wealths}`, wealth at the start and after each period. */
export const benchmarks = (history) =>
  history.assets
    ? [
        ["Equal weights", "equal_weights"],
        ["First composition", "initial_composition"],
      ].map(([name, rule]) => ({ name, colour: colourOf(rule), wealths: [history.initial_wealth, ...history.observations.map(({ account }) => account.benchmarks[rule])] }))
    : [];

/** Returns the name of a session's own line: its client, if it has a name. */
const ownName = ({ name }) => name || "This session";

/** The common left margin of charts above each other, in pixels. */
const GUTTER = 64;

/** A chart's axis spans at least this much. */
export const LEAST_FALL = 0.01;
export const LEAST_SHARE = 0.1;

/** Returns the positions of the periods from the start to the horizon, with their names. */
function periodsOf({ session, history, calendar }) {
  const lived = history.observations.length;
  const horizon = session.rolling ? Math.max(12, lived + 1) : Math.max(session.horizon, lived);
  const values = Array.from({ length: horizon + 1 }, (_, k) => k);
  const x = { values, domain: [0, horizon], label: "Period", format: calendar.after, here: calendar.after, tick: calendar.brief, whole: true };
  return { values, x };
}

/** Draws wealth and falls, the part that a client is shown. */
export function wealthCourse(shown) {
  const { history } = shown;
  const { values, x } = periodsOf(shown);
  const own = wealths(history);
  const along = (of) => values.map((k) => of[k] ?? null);
  const deep = falls(history);
  const stocks = falls(history, mixed(history, 1));
  const charts = [lineChart({ title: "Wealth", gutter: GUTTER, height: 230, x, y: { format: inCurrency, tick }, series: wealthLines(shown, values, Boolean(shown.policy.specification.problem.spending)) })];
  if (own.length > 1) {
    charts.push(
      lineChart({
        title: "Below the highest so far",
        gutter: GUTTER,
        height: 120,
        x,
        y: { format: percent, tick: percentTick, also: [0, -LEAST_FALL] },
        series: [
          { name: ownName(shown.session), kind: "line", values: along(deep) },
          { name: `All in ${risky(history)}`, kind: "line", bare: true, values: along(stocks) },
        ],
      }),
    );
  }
  return section("So far", own.length > 1 ? h("p", { class: "sentence" }, comparison(shown)) : "", ...charts);
}

/**
 * Returns the lines of a session's wealth and of its comparators after the periods in `values`, the start being 0. If it `spends`, what is spent
 * ahead is not known, and the bank is drawn no further than the session.
 */
function wealthLines({ session, history }, values, spends) {
  const bank = banked(history, spends ? history.observations.length : values.at(-1));
  const along = (of) => values.map((k) => of[k] ?? null);
  return [
    { name: ownName(session), kind: "line", values: along(wealths(history)) },
    ...besides(history).map(({ name, share, colour }) => ({ name, colour, kind: "line", bare: true, values: along(share === 0 ? bank : mixed(history, share)) })),
    ...benchmarks(history).map(({ name, colour, wealths }) => ({ name, colour, kind: "line", bare: true, values: along(wealths) })),
  ];
}

/** Compares the session's wealth with the comparators, in a sentence. */
export function comparison({ history }) {
  const own = wealths(history);
  const worth = (share) => inCurrency(mixed(history, share).at(-1));
  return `It is worth ${inCurrency(own.at(-1))} now. The same start would have come to ${worth(0)} all in the bank, ${worth(0.6)} at 60/40 and ${worth(1)} all in ${risky(history)}.`;
}

/** Returns the worst fall as a fact: `[name, value, note]`. */
export function worstFallFact({ history, calendar }) {
  const [worst] = worstFalls(falls(history), 1);
  if (!worst) return ["Worst fall so far", "None", "never below its highest"];
  const from = worst.from === 0 ? "from the start" : `from ${calendar.inText(worst.from)}`;
  return ["Worst fall so far", percent(worst.depth), `${from} to ${calendar.inText(worst.to)}`];
}

/** Draws what was held, and the caution, through time. */
export function holdings(shown, action) {
  const { history, policy, calendar, session } = shown;
  const { values, x } = periodsOf(shown);
  const { observations } = history;
  const row = (period) => observations[period - 1] ?? null;
  const stands = (period, name) => (row(period) ? (row(period).now ?? row(period))[name] : null);
  const told = (now, then) => values.map((k) => (action && k === action.period ? now(action) : row(k) && then(row(k))));
  const ends = ["low", "high"].map((name, end) => ({
    name: `No-trade range, ${name} end`,
    kind: "levels",
    colour: [9, 6][end],
    values: told(
      ({ band }) => band[end],
      ({ band }) => band[end],
    ),
  }));
  const advised = {
    name: "Advised",
    colour: 9,
    kind: "levels",
    values: told(
      ({ allocation }) => allocation,
      (then) => then.advised_allocation,
    ),
  };
  const costly = policy.specification.problem.trading_cost > 0;
  const chart = lineChart({
    title: "Share held in stocks",
    gutter: GUTTER,
    height: 150,
    x: { ...x, here: calendar.name, format: calendar.name, between: true },
    y: { format: allocation, tick: percentTick, also: [0, LEAST_SHARE] },
    series: [{ name: "Held", kind: "bars", values: values.map((k) => stands(k, "executed_allocation")) }, ...(costly ? ends : [advised])],
  });
  if (!isCautious(policy.specification.problem)) return [chart];
  const radii = values.map((k) => (k === session.period - 1 && action ? action.radius : k === 0 ? history.initial_radius : stands(k, "radius")));
  const perPoint = shown.cautionScale;
  const caution = lineChart({
    title: `Caution: how much lower the average return a ${calendar.unit} may really be`,
    gutter: GUTTER,
    height: 130,
    x,
    y: { format: (value) => percent(value, 2), tick: percentTick },
    series: [{ name: "", kind: "line", values: radii.map((radius) => (radius === null ? null : radius * perPoint)) }],
  });
  caution.classList.add("inside");
  return [chart, caution];
}
