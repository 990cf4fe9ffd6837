// The track record of a session: what it earned, how it varied and fell, beside its comparators and a benchmark of one's own.

import { get } from "./api.js";
import { grown, mixed, wealths } from "./comparators.js";
import { benchmarks, besides, worstFallFact } from "./course.js";
import { facts, h, section, table } from "./dom.js";
import { counted, percent, tick, wealth } from "./format.js";
import { titled } from "./naming.js";
import { ownBenchmark } from "./own_benchmark.js";
import { calendar } from "./periods.js";
import { investorsSession } from "./specification.js";
import { belowHighest, yearlyFigures } from "./track.js";
import { courses, falls, GUTTER, rollingYears, years } from "./track_view.js";

export async function view(id, leaving) {
  const session = investorsSession(await get(`/sessions/${id}`, leaving));
  const [history, policy] = await Promise.all([get(`/sessions/${id}/history`, leaving), get(`/policies/${session.policy}`, leaving)]);
  const name = titled("Session", id, session.name);
  const trail = h("p", { class: "trail" }, h("a", { href: "#/sessions" }, "Overview"), " \u203a ", h("a", { href: `#/sessions/${id}` }, name));
  const body = history.observations.length === 0 ? h("p", {}, "No period is reported yet.") : sheet(history, policy.specification.problem.periods_per_year);
  return { title: `Track record of ${name.replace(/^S(?=ession )/, "s")}`, trail, body };
}

/** Returns the sheet; a benchmark of one's own is added to it once its returns are read. */
function sheet(history, periods_per_year) {
  const shown = lived(history, periods_per_year);
  const holder = h("div", {});
  const show = (own) => holder.replaceChildren(...drawn(own ? { ...shown, known: [...shown.known, own] } : shown));
  show(null);
  return [holder, ownBenchmark(shown.calendar, history.observations.length, show)];
}

/** Returns the session as a line beside its comparators, from 100 on, and what is known of its periods. */
function lived(history, periods_per_year) {
  const { observations } = history;
  const days = calendar(history, periods_per_year);
  const dates = observations.map((_, index) => days.date(index + 1));
  const kept = (rule) => [history.initial_wealth, ...observations.map(({ account }) => account.benchmarks[rule])];
  // The service keeps all in the bank, and all in one asset as equal weights.
  const served = (share) => (share === 0 ? "bank" : share === 1 && !history.assets ? "equal_weights" : null);
  const comparators = [...besides(history).map(({ name, share, colour }) => ({ name, colour, wealths: served(share) ? kept(served(share)) : mixed(history, share) })), ...benchmarks(history)];
  const isPaid = ({ wealths }) => wealths.every((amount) => amount > 0);
  const known = comparators.filter(isPaid).map(({ name, colour, wealths }) => ({ name, colour, wealth: grown(history, wealths) }));
  const main = { name: "This session", colour: 0, wealth: grown(history) };
  const market = known.find(({ name }) => name === besides(history).at(-1).name) ?? known[0] ?? main;
  const after = (period) => (period === 0 ? "At the start" : days.name(period));
  return {
    history,
    main,
    known,
    market,
    unpaid: comparators.filter((one) => !isPaid(one)).map(({ name }) => name),
    rates: observations.map(({ account }) => account.rate),
    dates: dates.includes(null) ? null : dates,
    times: { after },
    unit: days.unit,
    calendar: days,
    periods_per_year,
    isYear: observations.length >= periods_per_year,
  };
}

function drawn(shown) {
  const { main, calendar, periods_per_year } = shown;
  const last = main.wealth.length - 1;
  const named = { format: calendar.after, here: calendar.after, tick: calendar.brief };
  const placed = { gutter: GUTTER, x: { values: [...main.wealth.keys()], label: "Period", ...named, whole: true } };
  return [
    h("div", { class: "words" }, h("p", {}, summary(shown))),
    h("div", { class: "figures" }, figures(shown)),
    section("Beside the comparators", compared(shown), h("p", { class: "note" }, notes(shown))),
    section("Through time", ...courses(shown, main, placed), ...(last > periods_per_year ? [rollingYears(shown, main, placed, 1)] : []), ...falls(shown, main), ...(shown.dates || periods_per_year ? years(shown, main) : [])),
  ];
}

/** Says over what time, and what 100 became. */
function summary({ main, calendar, unit, isYear, periods_per_year }) {
  const last = main.wealth.length - 1;
  const over = last === 1 ? calendar.name(1) : `${calendar.name(1)} to ${calendar.inText(last)}`;
  const few = periods_per_year ? `Figures a year need a whole year: ${counted(periods_per_year, unit)}.` : "Its policy does not say how many periods a year has, so there are no figures a year.";
  return `${over}, ${counted(last, unit)}: 100 became ${wealth(main.wealth.at(-1))}. This is time-weighted: money added, withdrawn or spent is neither gain nor loss.${isYear ? "" : ` ${few}`}`;
}

const yearly = ({ rates, periods_per_year }, { wealth }) => yearlyFigures(wealth, rates, periods_per_year);
const ratio = (value) => tick(value, 0.01);

function figures(shown) {
  const { main, isYear, unit } = shown;
  const worst = worstFallFact(shown);
  if (!isYear) return facts([["Return so far", percent(main.wealth.at(-1) / 100 - 1)], worst]);
  const { growth, deviation, sharpe, sortino } = yearly(shown, main);
  return facts([
    ["Return a year", percent(growth), "compounded, after costs"],
    ["Deviation a year", percent(deviation), `of the returns of each ${unit}`],
    ["Sharpe ratio", ratio(sharpe), "return beyond the bank by its deviation"],
    ["Sortino ratio", ratio(sortino), "return beyond the bank by its shortfalls alone"],
    worst,
  ]);
}

/** Returns the table of the session and its comparators. */
function compared(shown) {
  const { main, known, isYear } = shown;
  const number = (name, cell) => ({ name, numeric: true, cell });
  const rows = [main, ...known].map((line) => ({ ...line, yearly: isYear ? yearly(shown, line) : null }));
  const columns = [
    ["Return a year", ({ growth }) => percent(growth)],
    ["Deviation a year", ({ deviation }) => percent(deviation)],
    ["Sharpe ratio", ({ sharpe }) => ratio(sharpe)],
    ["Sortino ratio", ({ sortino }) => ratio(sortino)],
  ].map(([name, read]) => number(name, ({ yearly }) => read(yearly)));
  return table(
    "What the session and its comparators earned",
    [
      { name: "Held", cell: ({ name }) => (name === main.name ? h("b", {}, name) : name) },
      number("100 became", (line) => wealth(line.wealth.at(-1))),
      ...(isYear ? columns : []),
      number("Worst fall", (line) => percent(Math.min(...belowHighest(line.wealth)))),
    ],
    rows,
  );
}

/** Says how the comparators are reckoned, and which are left out. */
function notes({ unpaid }) {
  const left = unpaid.length > 0 ? ` ${unpaid.join(", ")}: left out, because this could not pay the withdrawals or lost everything.` : "";
  return `Comparators start with the same money and have the same flows, rates and trading costs. The bank\u2019s rate is that of each period.${left}`;
}
