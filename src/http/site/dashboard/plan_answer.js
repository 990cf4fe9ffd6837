// The answer of a plan: in sentences, as a fan of paths, beside simple rules, and what must be true for it to last.

import { lineChart } from "./chart.js";
import { h, quantSection, section, table } from "./dom.js";
import { select } from "./form.js";
import { allocation, count, counted, figures, minus, percent, percentTick, significant, tick } from "./format.js";
import { intervalChart } from "./interval_chart.js";
import { yearlyWords } from "./market_terms.js";
import { inCurrency } from "./money.js";
import { unitOf } from "./periods.js";
import { caution, cautionName, INVESTORS, presetOf, warningList } from "./specification.js";

/** The rules in plain names. */
export const RULES = {
  plan: "The plan",
  trusting: "A plan that trusts the record",
  sixty_forty: "The plan\u2019s spending with 60\u202f% held",
  four_percent: "4\u202f% of the first wealth",
  share_of_wealth: "4\u202f% of present wealth",
};
/** The two laws, with the colours that they have elsewhere. */
const LAWS = [
  { law: "record", title: "if returns are like the record", colour: 0 },
  { law: "worst", title: "under the worst law", colour: 3 },
];
const VIEWS = { wealth: "Wealth", spending: "Spending a year" };
/** Positions of the quantiles that a picture shows: the middle, and the ends of its bands. */
const [MIDDLE, HALF, MOST] = [2, [1, 3], [0, 4]];

/** Formats an amount without digits that mean nothing. */
export const money = (value) => (inCurrency(value, value === 0 || Math.abs(value) >= 1000));

/** Returns a sentence of the service with minus signs, and percent signs that stay with their numbers. */
export const worded = (sentence) => minus(sentence).replaceAll(" %", "\u202f%");

/** Returns the sections of an answer; `following` leads to a policy. */
export function planView(plan, question, following) {
  const { problem } = question;
  const [first, ...rest] = plan.sentences.map(worded);
  const breaking = rest.pop();
  const head = section(
    "The plan",
    h(
      "div",
      { class: "advice", id: "plan", tabindex: -1 },
      h("p", { class: "note" }, asked(question)),
      h("p", { class: "first" }, first),
      h("ul", { class: "points" }, rest.map((words) => h("li", {}, words))),
      yearlyWords(plan),
      ...warningList(plan.warnings, problem),
    ),
    following,
  );
  return [head, fans(plan, question), ...states(plan, problem), rules(plan, problem), failing(plan, problem, breaking), exact(plan, problem)];
}

/** What the states of a plan are: the label of the axis, and what a place on it is. */
const STATES = {
  funded: ["Wealth, as a share of what the bank needs to pay for everything", (value) => `${percent(value, 0)} of what the bank needs`],
  of_peak: ["Value of money that stays invested, as a share of its highest", (value) => `${percent(1 - value, 0)} below the highest value`],
};

/** Draws what is held by the state of the plan, in some periods; nothing if the period alone decides. */
function states({ states }, { periods_per_year }) {
  if (!states) return [];
  const [label, here] = STATES[states.described_by];
  // The first period is solved at one state only.
  const later = states.periods.filter(({ states }) => states.length > 1);
  if (later.length === 0) return [];
  const some = [...new Set([0, Math.floor((later.length - 1) / 2), later.length - 1])].map((place) => later[place]);
  const values = some[0].states;
  const title = "What is held, by how the plan stands";
  const picture = lineChart({
    title,
    height: 260,
    x: { values, domain: [values[0], values.at(-1)], label, here, format: (value) => percent(value, 0) },
    y: { format: allocation, tick: percentTick, also: [0, 1] },
    series: some.map(({ period, held }, colour) => ({ name: `After ${counted(period - 1, unitOf(periods_per_year))}`, colour, kind: "line", values: held })),
  });
  return [section(title, picture, h("p", { class: "note" }, "Shares of what is left after spending, in the risky asset."))];
}

/** Says what was asked, so that the answer stands by itself. */
function asked({ problem, wanted, goal, saved, aim, drawdown_limit, certainty }) {
  const { horizon, periods_per_year: periods, initial_wealth, spending, utility } = problem;
  const parts = [
    `Wealth ${money(initial_wealth)}`,
    `${counted(horizon, unitOf(periods))} ahead`,
    wanted === undefined ? null : `${money(wanted * periods)} wanted a year`,
    goal === undefined ? null : `${money(goal)} wanted at the end`,
    aim && "which the plan aims at",
    saved === undefined ? null : `${money(saved * periods)} put in a year`,
    drawdown_limit === undefined ? null : `no fall beyond ${percent(drawdown_limit, 0)}`,
    spending.secured ? `${money(spending.secured * periods)} secured a year` : null,
    spending.secured_left ? `${money(spending.secured_left)} secured at the end` : null,
    `prices rise ${percent(Math.expm1(periods * Math.log1p(spending.inflation)), 1)} a year`,
    aim ? null : `what is left counts as ${counted(Number((spending.bequest / periods).toPrecision(6)), "year")} of spending`,
    `${cautionName(problem.caution)} caution`,
    `${presetOf(utility)} investor (risk aversion ${significant(INVESTORS[presetOf(utility)])})`,
    `certainty ${percent(certainty, 0)}`,
    counted(problem.history.length, "return"),
  ];
  return `${parts.filter(Boolean).join(", ")}. All amounts are in money of now.`;
}

/** Draws the paths of the plan under both laws on one scale: wealth, or what is spent in a year. */
function fans({ fan }, { problem, paths }) {
  const place = h("div", { class: "duo" });
  const periods = problem.periods_per_year;
  const draw = (view) => {
    const points = (law) => fan[law].map(({ after, ...quantiles }) => ({ years: after / periods, values: quantiles[view] })).filter(({ values }) => values);
    const scaled = (values) => values.map((value) => (view === "wealth" ? value : periods * value));
    const top = Math.max(...LAWS.flatMap(({ law }) => points(law).flatMap(({ values }) => scaled(values))));
    place.replaceChildren(...LAWS.map(({ law, title, colour }) => fanned(`${VIEWS[view]}, ${title}`, points(law).map(({ years, values }) => ({ years, values: scaled(values) })), colour, top)));
  };
  const choice = select({ name: "plan-view", label: "Show", choices: VIEWS, changed: draw });
  draw("wealth");
  const note = `In money of now, over ${count(paths)} paths. The line has half of them below it. The dark band holds the middle half of all paths, the light one 90\u202f% of them.`;
  return section("Over the years", h("div", { class: "controls" }, choice.element), place, h("p", { class: "note" }, note));
}

/** Draws a fan; `points` are the years and their quantiles, `top` ends the scale. */
function fanned(title, points, colour, top) {
  const years = points.map(({ years }) => years);
  const ends = ([low, high]) => points.map(({ values }) => [values[low], values[high]]);
  const named = (value) => `${Number(value.toFixed(1))}`;
  return lineChart({
    title,
    height: 260,
    x: { values: years, domain: [0, years.at(-1)], label: "Years", here: (value) => `After ${named(value)} years`, format: named, whole: true },
    y: { format: money, tick, also: [0, top] },
    series: [
      { name: "Middle", colour, kind: "line", bare: true, values: points.map(({ values }) => values[MIDDLE]) },
      { name: "Half of all, dark", colour, values: null, band: ends(HALF) },
      { name: "90\u202f%, light", colour, values: null, band: ends(MOST) },
    ],
  });
}

/** Returns the figures of a rule: each with its name, what it says of a rule, and how it is written. `periods` are those of a year. */
function columns(strategies, periods) {
  const yearly = (value) => money(periods * value);
  const spends = strategies.some(({ mean_spending }) => mean_spending.record.value > 0);
  return [
    spends && ["Runs out", ({ ruin }) => ruin, allocation],
    spends && ["Mean spending a year", ({ mean_spending }) => mean_spending, yearly],
    spends && ["Lowest spending a year", ({ lowest_spending }) => lowest_spending, yearly],
    ["Left at the end", ({ bequest }) => bequest, money],
    ["Largest fall", ({ max_drawdown }) => max_drawdown, allocation],
    strategies.some(({ reaches_goal }) => reaches_goal) && ["Reaches the wealth wanted", ({ reaches_goal }) => reaches_goal, allocation],
    strategies.some(({ shortfall }) => shortfall) && ["Missing on average", ({ shortfall }) => shortfall, money],
    strategies.some(({ certainty_equivalent }) => certainty_equivalent) && ["Sure spending a year", ({ certainty_equivalent }) => certainty_equivalent, yearly],
  ].filter(Boolean);
}

/** Compares the plan with simple rules under both laws. */
function rules({ strategies }, { periods_per_year }) {
  const cell = ([name, of, format]) => ({
    name,
    numeric: true,
    cell: (row) => [format(of(row).record.value), h("span", { class: "under" }, `worst ${format(of(row).worst.value)}`)],
  });
  const shown = table("The plan beside simple rules", [{ name: "Rule", cell: ({ rule }) => (rule === "plan" ? h("b", {}, RULES[rule]) : RULES[rule]) }, ...columns(strategies, periods_per_year).map(cell)], strategies);
  const note = "The first figure is for returns like the record, \u201cworst\u201d for the worst law. Spending and what is left are those of the middle path. The largest fall is that of money that stays invested, in one of twenty paths. Sure spending is the fixed amount that is worth as much; it is 0 if the money may run out.";
  return section("Beside simple rules", shown, h("p", { class: "note" }, note));
}

/** Says what mean return the amount needs, beside the one seen and its standard error. */
function failing({ breaking, annualised }, { periods_per_year, rate_per_step }, sentence) {
  const title = "What must be true for it to last";
  const words = h("p", { class: "sentence" }, sentence);
  if (!breaking) return section(title, words);
  const { mean_return, mean_seen, standard_errors } = breaking;
  const yearly = (mean) => Math.expm1(periods_per_year * Math.log1p(mean));
  const error = standard_errors === 0 ? 0 : (mean_return - mean_seen) / standard_errors;
  const point = (name, mean, colour) => ({ name, colour, value: yearly(mean), low: yearly(mean), high: yearly(mean) });
  const rows = [
    { ...point("Seen in the record", mean_seen, 0), low: yearly(mean_seen - 2 * error), high: yearly(mean_seen + 2 * error), isMain: true },
    point("Needed", mean_return, 3),
    { ...point("Paid by the bank", rate_per_step, 2), ...(annualised ? { value: annualised.rate } : {}) },
  ];
  const note = "The line spans two standard errors on either side of the return seen.";
  return section(title, words, intervalChart({ title: "Mean return a year", noun: "Return", rows, format: percent, tick: percentTick }), h("p", { class: "note" }, note));
}

/** Returns the figures with their intervals, and those of the solution. */
function exact({ strategies, advice, worst_case }, problem) {
  const build = () => {
    const cells = columns(strategies, problem.periods_per_year).flatMap(([name, of, format]) =>
      LAWS.map(({ law }) => ({ name: `${name}${law === "worst" ? ", worst law" : ""}`, numeric: true, cell: (row) => h("span", {}, format(of(row)[law].value), h("span", { class: "under" }, `${format(of(row)[law].low)} to ${format(of(row)[law].high)}`)) })),
    );
    return h(
      "div",
      {},
      worst_case ? h("p", { class: "sentence" }, worded(worst_case.sentence)) : "",
      h("p", { class: "note" }, `Radius of the uncertainty set ${figures(advice.radius, 3)}, around ${counted(advice.sample_size, "return")}. Intervals hold with 95\u202f% confidence.`),
      table("Figures with intervals", [{ name: "Rule", cell: ({ rule }) => RULES[rule] }, ...cells], strategies),
    );
  };
  return quantSection("The worst law, and intervals of the figures", build);
}
