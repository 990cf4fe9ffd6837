// The advice for many sessions: requested for a few at a time, and shown as it arrives.

import { get } from "./api.js";
import { h } from "./dom.js";
import { allocation, significant } from "./format.js";
import { isOfSeveral, LITTLE, orderWords, sums, tradesOf } from "./trades.js";

/** Browsers keep six connections to one address: this many leave room for what the user clicks meanwhile. */
const AT_ONCE = 4;

/**
 * Returns `{of(entry), read(entries, options), trades(entry), failure(entry), isOutside(entry), redraw(), forget()}`. `of` gives the elements
 * `{hold, trade}` of a session's row and requests the advice once. `read` waits for the advice of all entries. `trades` gives the trades of an
 * entry, undefined until they are known or if the advice was refused; `failure` gives the reason of that. `isOutside` tells whether the answer
 * so far puts the session outside what its policy was trained for; `changed()` is called for each such session. `redraw()` shows the trades
 * for another `smallest()`. `forget()` drops the requests that still wait, until their rows are shown again.
 */
export function advised(leaving, { changed = () => {}, smallest = () => null } = {}) {
  const rows = new Map();
  const costs = new Map();
  let [waiting, busy] = [[], 0];
  const costOf = (policy) => {
    if (!costs.has(policy)) costs.set(policy, get(`/policies/${policy}`, leaving).then(({ specification }) => specification.problem.trading_cost));
    return costs.get(policy);
  };
  const fill = async (row) => {
    const { entry, hold } = row;
    const [action, cost] = await Promise.all([get(`/action?session=${entry.session}`, leaving), costOf(entry.policy)]);
    Object.assign(row, { action, cost });
    if (action.actions) hold.replaceChildren(Object.entries(action.actions).map(([name, value]) => `${name} ${significant(value, 4)}`).join(", "));
    else hold.replaceChildren(...held(action));
    drawTrade(row);
    if (!action.actions && !action.in_design) changed();
  };
  const tradesIn = ({ entry, action, cost }) => (action && !action.actions ? tradesOf(action, { wealth: entry.wealth, cost }, smallest()) : undefined);
  const drawTrade = (row) => {
    const trades = tradesIn(row);
    if (trades === undefined) return row.trade.replaceChildren("\u2013");
    const small = trades.filter(({ small }) => small);
    const words = orderWords(sums(trades)).map((words) => h("span", { class: "line-of-two" }, words));
    const left = small.length === 0 ? [] : [" ", h("span", { class: "under" }, `${orderWords(sums(small.map((one) => ({ ...one, small: false })))).join(", ")}: too small`)];
    row.trade.replaceChildren(...words, ...left);
  };
  const turn = async () => {
    const row = waiting.shift();
    if (!row || leaving.aborted) return;
    busy += 1;
    await fill(row).catch((error) => {
      row.failure = error.message;
      row.hold.replaceChildren(none(error.message));
      row.trade.replaceChildren("\u2013");
    });
    row.settle();
    busy -= 1;
    turn();
  };
  const rowOf = (entry) => {
    const key = state(entry);
    if (!rows.has(key)) {
      const row = { entry, hold: h("span", {}, "\u2026"), trade: h("span", {}, "\u2026"), pinned: false };
      row.settled = new Promise((settle) => (row.settle = settle));
      rows.set(key, row);
      if (entry.state === "completed") {
        for (const cell of [row.hold, row.trade]) cell.replaceChildren("\u2013");
        row.settle();
      } else {
        waiting.push(row);
        if (busy < AT_ONCE) turn();
      }
    }
    return rows.get(key);
  };
  /** Waits for the advice of `entries` until `signal` aborts; `progress(done)` is called as they arrive. */
  const read = async (entries, { signal, progress = () => {} }) => {
    const wanted = entries.map(rowOf);
    let done = 0;
    for (const row of wanted) row.pinned = true;
    const unpin = () => wanted.forEach((row) => (row.pinned = false));
    await new Promise((resolve, reject) => {
      signal.addEventListener("abort", () => (unpin(), reject(signal.reason)), { once: true });
      Promise.all(wanted.map(({ settled }) => settled.then(() => progress((done += 1))))).then(resolve);
    });
    unpin();
  };
  const forget = () => {
    const dropped = waiting.filter(({ pinned }) => !pinned);
    for (const { entry } of dropped) rows.delete(state(entry));
    waiting = waiting.filter(({ pinned }) => pinned);
  };
  const known = (entry) => rows.get(state(entry)) ?? {};
  const isOutside = (entry) => known(entry).action?.in_design === false;
  const redraw = () => [...rows.values()].filter(({ action }) => action).forEach(drawTrade);
  return { of: rowOf, read, trades: (entry) => tradesIn(known(entry)), failure: (entry) => known(entry).failure, isOutside, redraw, forget };
}

/** Returns the key of a row's advice: another report or another policy requests it again. */
const state = ({ session, policy, last_report_ms }) => [session, policy, last_report_ms].join();

/** Says that there is no advice, and why. */
const none = (reason) => h("span", {}, "\u2013 ", h("span", { class: "under" }, reason));

function held(action) {
  const beyond = action.in_design ? [] : [" ", h("span", { class: "under wrong" }, "Outside its training")];
  if (!isOfSeveral(action)) return [allocation(action.allocation), ...beyond];
  const names = Object.keys(action.allocation).filter((name) => action.allocation[name] >= LITTLE);
  return [allocation(heldInAll(action)), " ", h("span", { class: "under", title: `In ${names.length} of ${Object.keys(action.allocation).length} assets` }, `in ${names.length} of ${Object.keys(action.allocation).length}`), ...beyond];
}

/** Returns the share of wealth to hold, in one asset or in several together. */
export const heldInAll = (action) => (isOfSeveral(action) ? action.total : action.allocation);

/** Returns the orders, "Buy" and "Sell" with amounts of money after trading costs. */
export const orders = (action, whole, cost) => orderWords(sums(tradesOf(action, { wealth: whole, cost })));
