// How close the advice is to changing, in sentences. This takes about a hundred robust steps, so it is loaded after the rest.

import { get } from "./api.js";
import { h, section } from "./dom.js";
import { allocation, count, counted, percent, points } from "./format.js";

/** The frameworks that learn from returns; with the others no return changes the advice. */
const LEARN = ["adaptive", "plug_in", "parametric_adaptive"];

const HEADING = "How close the advice is to changing";

/** Returns `{element, ask()}`: the section, and the function that fills it from `/action`. */
export function nearness({ id, policy, leaving, unit }) {
  const said = (words) => ({ element: section(HEADING, h("p", { class: "sentence" }, words)), ask: async () => {} });
  if (!LEARN.includes(policy.specification.problem.framework)) return said("No return changes the advice, because the policy does not learn from new returns.");
  const holder = h("div", { "aria-live": "polite" }, h("p", { class: "note" }, "Computing the advice for about a hundred other records\u2026"));
  const ask = async () => {
    try {
      const action = await get(`/action?session=${id}&sensitivity=true`, leaving);
      const words = sentences(action, unit).map((words) => h("p", { class: "sentence" }, words));
      holder.replaceChildren(h("p", { class: "sentence lead" }, headline(action, unit)), ...words);
    } catch (error) {
      if (!leaving.aborted) holder.replaceChildren(h("p", { class: "error" }, error.message));
    }
  };
  return { element: section(HEADING, holder), ask };
}

/** Advice is steady if an ordinary next return moves it by less than the first, and close to changing if by more than the second. */
const [STEADY, NEAR] = [0.02, 0.1];

/** Says how close the advice is to changing, in one sentence. */
export function headline({ allocation: told, sensitivity: { next_return } }, unit = "period") {
  const move = Math.max(...[next_return.low, next_return.high].map((end) => Math.abs(end.allocation - told)));
  if (move < STEADY) return `It is steady: nine in ten ${unit}s would move it by less than ${points(STEADY, 0)}.`;
  const by = points(move, move < 0.1 ? 1 : 0);
  return move < NEAR ? `It moves a little: an unusual ${unit} would move it by up to ${by}.` : `It is close to changing: an unusual ${unit} would move it by ${by}.`;
}

/** Returns the sentences for an answer with its sensitivity. */
export function sentences(action, unit = "period") {
  const { without_one, next_return, premium } = action.sensitivity;
  return [...lacking(action, without_one), ...coming(action, next_return, unit), ...paying(premium, unit)];
}

const simple = ({ simple_return }) => percent(simple_return);

function lacking({ allocation: told }, range) {
  if (range === null) return [];
  const differs = [range.lowest, range.highest].filter((end) => allocation(end.allocation) !== allocation(told));
  if (differs.length === 0) return ["No single return of the record matters: without any one of them the advice stays the same."];
  return differs.map((end) => `Without its return of ${simple(end)} the advice would be ${allocation(end.allocation)}.`);
}

function coming({ allocation: told }, { to_bank, to_highest, low, high }, unit) {
  const [now, after_low, after_high] = [told, low.allocation, high.allocation].map(allocation);
  const stays = now === after_low && now === after_high;
  const after = stays
    ? `After a return of ${simple(low)} or of ${simple(high)} it would stay at ${now}.`
    : `After a return of ${simple(low)} the advice would be ${after_low}; after one of ${simple(high)} it would be ${after_high}.`;
  return [
    after,
    to_bank && now === allocation(0) && `The advice leaves the bank only if the next ${unit} returns more than ${simple(to_bank)}.`,
    to_bank && now !== allocation(0) && `A return of ${simple(to_bank)} next ${unit} would move the advice fully into the bank.`,
    to_highest && now === allocation(1) && `It stays there unless the next ${unit} returns less than ${simple(to_highest)}.`,
    to_highest && now !== allocation(1) && `A return of ${simple(to_highest)} next ${unit} would move it to the highest allocation.`,
  ].filter(Boolean);
}

/** Returns the decimals, from 2 to 6, at which two numbers differ by at least five units of the last. */
const deciding = (one, other) => (one === other ? 2 : Math.min(6, Math.max(2, Math.ceil(Math.log10(5 / Math.abs(one - other))))));

function paying({ present, needed, periods_more }, unit) {
  const digits = needed === null ? 2 : deciding(100 * present, 100 * needed);
  const paid = `The record has paid ${percent(present, digits)} a ${unit} more than the bank pays now`;
  if (needed === null) return [`${paid}; at no similar average does the advice enter or leave the bank.`];
  const leaves = `${paid}; the advice leaves the bank at ${percent(needed, digits)}.`;
  if (periods_more === 0) return [leaves];
  if (periods_more === null) return [leaves, `No number of ${unit}s like those seen, up to ${count(10000)}, would be enough.`];
  return [leaves, `About ${counted(periods_more, `more ${unit}`)} like those seen would also be enough.`];
}
