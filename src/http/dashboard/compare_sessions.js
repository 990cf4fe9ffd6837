// Two sessions: what each is advised now, and how they went.

import { heldInAll, orders } from "./advised.js";
import { get } from "./api.js";
import { beside, LETTERS } from "./beside.js";
import { lineChart } from "./chart.js";
import { falls, risky, wealths } from "./comparators.js";
import { differences, rows as asked } from "./compare_policies.js";
import { LEAST_FALL, LEAST_SHARE } from "./course.js";
import { h, section } from "./dom.js";
import { addedIn, netAdded } from "./flows.js";
import { allocation, count, percent, percentTick, points, tick, wealth } from "./format.js";
import { called } from "./naming.js";
import { calendar } from "./periods.js";
import { worstFalls } from "./track.js";

export async function sessionsBeside(ids, leaving) {
  const both = await Promise.all(ids.map((id) => read(id, leaving)));
  const table = beside("Two sessions side by side", "sessions", "Session", ids, both.map(({ session }) => session.name), rows(both));
  const specifications = both.map(({ policy }) => policy.specification);
  const policies = both[0].policy.policy === both[1].policy.policy ? "" : h("p", { class: "sentence" }, differences(specifications, "Their policies"));
  return [h("p", { class: "lead" }, sentence(both)), policies, table, courses(both)];
}

async function read(id, leaving) {
  const session = await get(`/sessions/${id}`, leaving);
  const [history, policy, action] = await Promise.all([
    get(`/sessions/${id}/history`, leaving),
    get(`/policies/${session.policy}`, leaving),
    session.state === "active" ? get(`/action?session=${id}`, leaving) : null,
  ]);
  const { problem } = policy.specification;
  return { session, history, policy, problem, action, calendar: calendar(history, problem.periods_per_year), grown: grown(history) };
}

/** What 100 at the start has become after each period, without what was added or taken. */
function grown(history) {
  const wealth = wealths(history);
  const levels = [100];
  for (let period = 1; period < wealth.length; period++) levels.push((levels[period - 1] * (wealth[period] - addedIn(history, period))) / wealth[period - 1]);
  return levels;
}

/** What the two hold beside the bank, in words. */
const besideBank = (both) => risky(both.find(({ history }) => history.assets)?.history ?? both[0].history);

function sentence([one, other]) {
  const [first, second] = [one.grown.at(-1), other.grown.at(-1)];
  const after = ({ session }) => `${count(session.period - 1)} period${session.period === 2 ? "" : "s"}`;
  const held = [one, other].every(({ action }) => action)
    ? ` A is to hold ${allocation(heldInAll(one.action))} in ${besideBank([one, other])} now, B ${allocation(heldInAll(other.action))}.`
    : "";
  return `100 in A has become ${wealth(first)} in ${after(one)}, and in B ${wealth(second)} in ${after(other)}.${held}`;
}

/** Rows of the policies that are told also where they do not differ. */
const ALWAYS = ["Investor", "Caution"];

function rows(both) {
  const row = (name, read, apart) => {
    const values = both.map(read);
    return { name, cells: values.map((value) => (typeof value === "object" && value !== null ? value.words : (value ?? "\u2013"))), apart: apart && values.every((value) => value !== null) ? apart(values[1].size - values[0].size) : undefined };
  };
  const signed = (words) => (value) => `${value > 0 ? "+" : ""}${words(value)}`;
  const money = (size) => ({ size, words: wealth(size) });
  const share = (size) => ({ size, words: allocation(size) });
  const trade = ({ action, session, problem }) => orders(action, session.wealth, problem.trading_cost).join(", ").toLowerCase();
  const deepest = ({ history }) => worstFalls(falls(history), 1)[0]?.depth ?? 0;
  const active = (read) => (one) => (one.action ? read(one) : null);
  const last = ({ calendar, session }) => (session.period === 1 ? "none yet" : calendar.name(session.period - 1));
  return [
    row(`To hold in ${besideBank(both)}`, active(({ action }) => share(heldInAll(action))), signed(points)),
    row("To trade", active(trade)),
    row("Worth as much as a sure", active(({ action }) => money(action.certainty_equivalent)), signed(wealth)),
    row("All in the bank", active(({ action }) => money(action.floor)), signed(wealth)),
    row("Wealth", ({ session }) => money(session.wealth), signed(wealth)),
    row("100 has become", (one) => money(one.grown.at(-1)), signed(wealth)),
    row("Money added, less taken", ({ history }) => money(netAdded(history)), signed(wealth)),
    row("Worst fall", (one) => ({ size: deepest(one), words: percent(deepest(one)) }), signed(points)),
    row("Last period", last),
    row("Returns seen", ({ session }) => ({ size: session.sample_size, words: count(session.sample_size) }), signed(count)),
    row("Policy", ({ policy }) => called(policy.policy, policy.name)),
    ...asked(both.map(({ policy }) => policy.specification)).filter(({ name, cells: [left, right] }) => ALWAYS.includes(name) || left !== right),
  ];
}

/** Growth and holdings, by the calendar where both have the same one. */
function courses(both) {
  const long = both.reduce((longest, one) => (one.grown.length > longest.grown.length ? one : longest));
  if (long.grown.length < 2) return "";
  const values = long.grown.map((_, k) => k);
  const together = values.slice(1).every((k) => new Set(both.filter(({ grown }) => grown.length > k).map(({ calendar }) => calendar.name(k))).size === 1);
  const name = (k) => (together ? long.calendar.name(k) : `Period ${k}`);
  const x = {
    values,
    label: "Period",
    format: (k) => (k === 0 ? "Start" : name(k)),
    here: (k) => (k === 0 ? "At the start" : `After ${name(k).replace(/^P(?=eriod)/, "p")}`),
    tick: together ? long.calendar.brief : String,
    whole: true,
  };
  const series = (of, more) => both.map((one, index) => ({ name: LETTERS[index], kind: "line", values: values.map((k) => of(one)[k] ?? null), ...more }));
  const held = ({ history }) => [null, ...history.observations.map((row) => (row.now ?? row).executed_allocation)];
  return section(
    "How they went",
    lineChart({ title: "What 100 has become", gutter: 64, height: 220, x, y: { format: wealth, tick }, series: series(({ grown }) => grown) }),
    lineChart({ title: "Below the highest so far", gutter: 64, height: 130, x, y: { format: percent, tick: percentTick, also: [0, -LEAST_FALL] }, series: series(({ history }) => falls(history)) }),
    lineChart({ title: `Share held in ${besideBank(both)}`, gutter: 64, height: 150, x: { ...x, here: name, between: true }, y: { format: allocation, tick: percentTick, also: [0, LEAST_SHARE] }, series: series(held, { kind: "levels" }) }),
  );
}
