// Two to four sessions: the present advice for each, and how they went, by the calendar if all have one.

import { heldInAll, orders } from "./advised.js";
import { get } from "./api.js";
import { areSame, beside, joined, LETTERS, numbered } from "./beside.js";
import { lineChart } from "./chart.js";
import { falls, grown, risky } from "./comparators.js";
import { differences, rows as asked } from "./compare_policies.js";
import { LEAST_FALL, LEAST_SHARE } from "./course.js";
import { h, section } from "./dom.js";
import { netAdded } from "./flows.js";
import { allocation, count, percent, percentTick, points, tick, wealth } from "./format.js";
import { called } from "./naming.js";
import { calendar } from "./periods.js";
import { investorsSession } from "./specification.js";
import { worstFalls } from "./track.js";

export async function sessionsBeside(ids, leaving) {
  const all = await Promise.all(ids.map((id) => read(id, leaving)));
  const line = lined(all);
  const span = common(all, line);
  const size = numbered(ids.length);
  const table = beside(`${size[0].toUpperCase()}${size.slice(1)} sessions side by side`, "sessions", "Session", ids, all.map(({ session }) => session.name), rows(all, line, span));
  const specifications = all.map(({ policy }) => policy.specification);
  const isOne = new Set(all.map(({ policy }) => policy.policy)).size === 1;
  const policies = isOne ? "" : h("p", { class: "sentence" }, differences(specifications, "Their policies"));
  return [h("p", { class: "lead" }, sentence(all, line, span)), policies, table, courses(all, line, span)];
}

async function read(id, leaving) {
  const session = investorsSession(await get(`/sessions/${id}`, leaving));
  const [history, policy, action] = await Promise.all([
    get(`/sessions/${id}/history`, leaving),
    get(`/policies/${session.policy}`, leaving),
    session.state !== "completed" ? get(`/action?session=${id}`, leaving) : null,
  ]);
  const { problem } = policy.specification;
  return { session, history, policy, problem, action, calendar: calendar(history, problem.periods_per_year), grown: grown(history) };
}

/** Returns the name of what they hold besides the bank. */
const besideBank = (all) => risky(all.find(({ history }) => history.assets)?.history ?? all[0].history);

/** Puts the periods of all on one line: by date if all have dates of one unit, otherwise by number. Returns `{isDated, places, of(one)}`:
 * each place is `{name, brief}`, and `of` gives the period of a session at each place, null if it has none. */
export function lined(all) {
  const isDated = all.every(({ calendar, grown }) => calendar.dated && grown.every((_, k) => calendar.date(k) !== null)) && new Set(all.map(({ calendar }) => calendar.unit)).size === 1;
  const nameOf = ({ calendar }, k) => (isDated ? calendar.name(k) : k === 0 ? "Start" : `Period ${k}`);
  const found = new Map();
  for (const one of all)
    one.grown.forEach((_, k) => {
      const name = nameOf(one, k);
      if (!found.has(name)) found.set(name, { name, order: isDated ? one.calendar.date(k) : k, brief: isDated && k > 0 ? one.calendar.brief(k) : String(k) });
    });
  const places = [...found.values()].sort((a, b) => (a.order < b.order ? -1 : Number(a.order > b.order)));
  const of = (one) => {
    const periods = new Map(one.grown.map((_, k) => [nameOf(one, k), k]));
    return places.map(({ name }) => periods.get(name) ?? null);
  };
  return { isDated, places, of };
}

/** Returns the first and the last place that all have, or null if they share fewer than two. */
export function common(all, { of, places }) {
  const periods = all.map(of);
  const shared = places.map((_, at) => at).filter((at) => periods.every((one) => one[at] !== null));
  return shared.length < 2 ? null : [shared[0], shared.at(-1)];
}

/** Returns what 100 at the place `from` has become at each place. */
function levels(one, line, from) {
  const periods = line.of(one);
  const start = one.grown[periods[from] ?? 0];
  return periods.map((k) => (k === null ? null : (100 * one.grown[k]) / start));
}

function sentence(all, line, span) {
  const shares = all.map(({ action }, index) => action && `${allocation(heldInAll(action))} ${index === 0 ? `in ${besideBank(all)} ` : ""}in ${LETTERS[index]}`);
  const held = shares.every(Boolean) ? ` The advice now is to hold ${joined(shares)}.` : "";
  if (span === null) return `They have no period in common, so their growth cannot be compared.${held}`;
  const grew = all.map((one, index) => `${index === 0 ? "100 in " : "in "}${LETTERS[index]} ${index === 0 ? "has become " : ""}${wealth(levels(one, line, span[0])[span[1]])}`);
  const periods = span[1] - span[0];
  const when = line.isDated ? `From the end of ${line.places[span[0]].name} to the end of ${line.places[span[1]].name}, which ${all.length === 2 ? "both" : "all"} sessions cover,` : `In their first ${periods === 1 ? "period" : `${count(periods)} periods`}`;
  return `${when} ${joined(grew)}.${held}`;
}

/** Rows of the policies that are shown even if they do not differ. */
const ALWAYS = ["Investor", "Caution"];

function rows(all, line, span) {
  const row = (name, read, apart) => {
    const values = all.map(read);
    return { name, cells: values.map((value) => (typeof value === "object" && value !== null ? value.words : (value ?? "\u2013"))), apart: apart && values.length === 2 && values.every((value) => value !== null) ? apart(values[1].size - values[0].size) : undefined };
  };
  const signed = (words) => (value) => `${value > 0 ? "+" : ""}${words(value)}`;
  const money = (size) => ({ size, words: wealth(size) });
  const share = (size) => ({ size, words: allocation(size) });
  const trade = ({ action, session, problem }) => orders(action, session.wealth, problem.trading_cost).join(", ").toLowerCase();
  const deepest = ({ history }) => worstFalls(falls(history), 1)[0]?.depth ?? 0;
  const active = (read) => (one) => (one.action ? read(one) : null);
  // Differences of amounts of money of several clients mean nothing, so they are not shown.
  const since = span && (line.isDated ? ` since the end of ${line.places[span[0]].name}` : " since the start");
  const last = ({ calendar, session }) => (session.period === 1 ? "none yet" : calendar.name(session.period - 1));
  return [
    row(`To hold in ${besideBank(all)}`, active(({ action }) => share(heldInAll(action))), signed(points)),
    row("To trade", active(trade)),
    row("Worth as much as a sure", active(({ action }) => money(action.certainty_equivalent))),
    row("All in the bank", active(({ action }) => money(action.floor))),
    row("Wealth", ({ session }) => money(session.wealth)),
    ...(span ? [row(`100 has become${since}`, (one) => money(levels(one, line, span[0])[span[1]]), signed(wealth))] : []),
    row("Money added, less withdrawn", ({ history }) => money(netAdded(history))),
    row("Worst fall", (one) => ({ size: deepest(one), words: percent(deepest(one)) })),
    row("Last period", last),
    row("Returns seen", ({ session }) => ({ size: session.sample_size, words: count(session.sample_size) }), signed(count)),
    row("Policy", ({ policy }) => called(policy.policy, policy.name)),
    ...asked(all.map(({ policy }) => policy.specification)).filter(({ name, cells }) => ALWAYS.includes(name) || !areSame(cells)),
  ];
}

/** Draws growth and holdings on one time line; growth starts from 100 at the first common place. */
function courses(all, line, span) {
  const { places } = line;
  if (places.length < 2) return "";
  const values = places.map((_, at) => at);
  const name = (at) => places[at].name;
  const x = {
    values,
    label: "Period",
    format: name,
    here: (at) => (line.isDated ? `At the end of ${name(at)}` : at === 0 ? "At the start" : `After ${name(at).replace(/^P/, "p")}`),
    tick: (at) => places[at].brief,
    whole: true,
  };
  const series = (of, more) => all.map((one, index) => ({ name: LETTERS[index], kind: "line", values: of(one), ...more }));
  const at = (one, of) => line.of(one).map((k) => (k === null ? null : (of[k] ?? null)));
  const held = ({ history }) => [null, ...history.observations.map((row) => (row.now ?? row).executed_allocation)];
  const from = span ? span[0] : 0;
  const note = span ? [] : [h("p", { class: "note" }, "They have no period in common, so each line starts from its own 100.")];
  return section(
    "How they went",
    note,
    lineChart({ title: span && from > 0 ? `What 100 at the end of ${name(from)} has become` : "What 100 has become", gutter: 64, height: 220, x, y: { format: wealth, tick }, series: series((one) => levels(one, line, from)) }),
    lineChart({ title: "Below the highest so far", gutter: 64, height: 130, x, y: { format: percent, tick: percentTick, also: [0, -LEAST_FALL] }, series: series((one) => at(one, falls(one.history))) }),
    lineChart({ title: `Share held in ${besideBank(all)}`, gutter: 64, height: 150, x: { ...x, here: name, between: true }, y: { format: allocation, tick: percentTick, also: [0, LEAST_SHARE] }, series: series((one) => at(one, held(one)), { kind: "levels" }) }),
  );
}
