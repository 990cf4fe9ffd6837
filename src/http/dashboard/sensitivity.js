// How near the advice is to changing, in sentences; it takes some hundred robust steps, so it is asked for by a button.

import { get } from "./api.js";
import { h, section } from "./dom.js";
import { allocation, count, counted, percent } from "./format.js";

/** Frameworks of policies that learn from returns; by the others no return changes the advice. */
const LEARN = ["adaptive", "plug_in", "parametric_adaptive"];

/** The button, and in its place what `/action` says. */
export function sensitivity({ id, policy, leaving }) {
  if (!LEARN.includes(policy.specification.problem.framework)) return "";
  const holder = h("div", { "aria-live": "polite" });
  const ask = async () => {
    holder.replaceChildren(h("p", { class: "note" }, "Asking for the advice of some hundred other records\u2026"));
    const action = await get(`/action?session=${id}&sensitivity=true`, leaving);
    holder.replaceChildren(...sentences(action).map((words) => h("p", { class: "sentence" }, words)));
  };
  const failed = (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error" }, error.message));
  const note = "What one return fewer, one more, or another mean would change.";
  const button = h("button", { class: "quiet", onclick: () => ask().catch(failed) }, "Ask how near");
  holder.append(h("p", { class: "note" }, note), button);
  return section("How near it is to changing", holder);
}

/** What an answer with its sensitivity says. */
export function sentences(action) {
  const { without_one, next_return, premium } = action.sensitivity;
  return [...lacking(action, without_one), ...coming(next_return), ...paying(premium)];
}

const simple = ({ simple_return }) => percent(simple_return);

function lacking({ allocation: told }, range) {
  if (range === null) return [];
  const differs = [range.lowest, range.highest].filter((end) => allocation(end.allocation) !== allocation(told));
  if (differs.length === 0) return ["No return of the record by itself makes a difference: without any one the advice stays."];
  return differs.map((end) => `Without its return of ${simple(end)} the advice would be ${allocation(end.allocation)}.`);
}

function coming({ to_bank, to_highest, low, high }) {
  const after = `After a return of ${simple(low)} the advice would be ${allocation(low.allocation)}, after one of ${simple(high)} ${allocation(high.allocation)}.`;
  return [
    after,
    to_bank && `A coming return of ${simple(to_bank)} would take the advice to the bank, and a higher one would not.`,
    to_highest && `One of ${simple(to_highest)} would take it to the highest allocation, and a lower one would not.`,
  ].filter(Boolean);
}

function paying({ present, needed, periods_more }) {
  const paid = `The record has paid ${percent(present, 2)} a period beyond the bank`;
  if (needed === null) return [`${paid}; no other mean near it would part the bank from holding something.`];
  const leaves = `${paid}; the advice leaves the bank at ${percent(needed, 2)}.`;
  if (periods_more === 0) return [leaves];
  if (periods_more === null) return [leaves, `No number of periods like those seen, up to ${count(10000)}, would do.`];
  return [leaves, `About ${counted(periods_more, "more period")} like those seen would do as well.`];
}
