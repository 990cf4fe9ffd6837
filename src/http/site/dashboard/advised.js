// The advice for many sessions: requested for a few at a time, and shown as it arrives.

import { inMoney } from "./advice.js";
import { get } from "./api.js";
import { h } from "./dom.js";
import { allocation, significant, wealth } from "./format.js";
import { inMoneyByName } from "./several.js";

/** Browsers keep six connections to one address: this many leave room for what the user clicks meanwhile. */
const AT_ONCE = 4;
/** A trade of a smaller share of wealth counts as none, because advice is shown to a tenth of a percent. */
const LITTLE = 0.0005;

/** Returns `{of(entry), isOutside(entry), forget()}`. `of` gives the elements `{hold, trade}` of a session's row and requests the advice once.
 * `forget()` drops the requests that still wait, until their rows are shown again. `isOutside(entry)` tells whether the answer so far puts
 * the session outside what its policy was trained for; `changed()` is called for each such session. */
export function advised(leaving, changed = () => {}) {
  const cells = new Map();
  const costs = new Map();
  const outside = new Set();
  let [waiting, busy] = [[], 0];
  const costOf = (policy) => {
    if (!costs.has(policy)) costs.set(policy, get(`/policies/${policy}`, leaving).then(({ specification }) => specification.problem.trading_cost));
    return costs.get(policy);
  };
  const fill = async ({ entry, hold, trade }) => {
    const [action, cost] = await Promise.all([get(`/action?session=${entry.session}`, leaving), costOf(entry.policy)]);
    if (action.actions) {
      hold.replaceChildren(Object.entries(action.actions).map(([name, value]) => `${name} ${significant(value, 4)}`).join(", "));
      trade.replaceChildren("\u2013");
      return;
    }
    hold.replaceChildren(...held(action));
    trade.replaceChildren(...traded(action, entry.wealth, cost));
    if (action.in_design) return;
    outside.add(state(entry));
    changed();
  };
  const turn = async () => {
    const row = waiting.shift();
    if (!row || leaving.aborted) return;
    busy += 1;
    await fill(row).catch((error) => {
      row.hold.replaceChildren(none(error.message));
      row.trade.replaceChildren("\u2013");
    });
    busy -= 1;
    turn();
  };
  const of = (entry) => {
    const key = state(entry);
    if (!cells.has(key)) {
      const row = { entry, hold: h("span", {}, "\u2026"), trade: h("span", {}, "\u2026") };
      cells.set(key, row);
      if (entry.state === "completed") for (const cell of [row.hold, row.trade]) cell.replaceChildren("\u2013");
      else {
        waiting.push(row);
        if (busy < AT_ONCE) turn();
      }
    }
    return cells.get(key);
  };
  const forget = () => {
    for (const { entry } of waiting) cells.delete(state(entry));
    waiting = [];
  };
  return { of, isOutside: (entry) => outside.has(state(entry)), forget };
}

/** Returns the key of a row's advice: another report or another policy requests it again. */
const state = ({ session, policy, last_report_ms }) => [session, policy, last_report_ms].join();

/** Says that there is no advice, and why. */
const none = (reason) => h("span", {}, "\u2013 ", h("span", { class: "under" }, reason));

const isOfSeveral = (action) => typeof action.allocation === "object";

function held(action) {
  const beyond = action.in_design ? "" : h("span", { class: "under wrong" }, "Outside its training");
  if (!isOfSeveral(action)) return [allocation(action.allocation), beyond];
  const names = Object.keys(action.allocation).filter((name) => action.allocation[name] >= LITTLE);
  return [allocation(heldInAll(action)), h("span", { class: "under" }, `in ${names.length} of ${Object.keys(action.allocation).length} assets`), beyond];
}

/** Returns the share of wealth to hold, in one asset or in several together. */
export const heldInAll = (action) => (isOfSeveral(action) ? action.total : action.allocation);

/** Returns the orders, "Buy" and "Sell" with amounts of money after trading costs. */
export function orders(action, whole, cost) {
  const trades = isOfSeveral(action)
    ? inMoneyByName(action, Object.keys(action.allocation), { wealth: whole, cost }).rows.map(({ trade }) => trade)
    : [Math.abs(action.trade) < LITTLE ? 0 : inMoney(action, { wealth: whole, cost, price: null }).trade];
  const sum = (sign) => trades.reduce((all, trade) => all + Math.max(0, sign * trade), 0);
  const parts = [["Buy", sum(1)], ["Sell", sum(-1)]].filter(([, size]) => size > 0);
  return parts.length === 0 ? ["Nothing"] : parts.map(([verb, size]) => `${verb} ${wealth(size)}`);
}

const traded = (action, whole, cost) => orders(action, whole, cost).map((words) => h("span", { class: "line-of-two" }, words));
