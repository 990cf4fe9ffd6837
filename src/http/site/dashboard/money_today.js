// Advice for money that came or went within a period: at once, and without recording anything.

import { order } from "./advice.js";
import { post } from "./api.js";
import { disclosure, h } from "./dom.js";
import { input, refusal, sending } from "./form.js";
import { allocation } from "./format.js";
import { inCurrency } from "./money.js";
import { typed } from "./number_text.js";
import { presentAssets } from "./several_fields.js";
import { inMoneyByName } from "./several.js";

/** Returns the part of a session's page that asks for an amount and says what to hold with it; `place` gives the terms in money. */
export function moneyToday({ id, session, history, leaving, calendar }, action, place) {
  const assets = presentAssets(history);
  const build = () => {
    const amount = input({ within: "today", name: "wealth", label: "Money that came today", note: "\u2212100 is a withdrawal of 100." });
    const answer = h("div", { role: "status" });
    const button = h("button", { type: "submit", class: "quiet" }, "Show what to hold");
    const form = h("form", { class: "observe", novalidate: true }, h("div", { class: "fields" }, amount.element), refusal(), h("p", { class: "send" }, button));
    sending(form, button, async () => {
      answer.replaceChildren();
      const added = typed(amount.control.value);
      const wealth = session.wealth + added;
      if (typeof added !== "number" || !(wealth > 0)) throw Object.assign(new Error(`Type an amount, such as 100, or \u2212100 for a withdrawal: less than the wealth of ${inCurrency(session.wealth)}.`), { field: "wealth" });
      const advice = await post("/what-if", { session: id, wealth, ...held(action, assets, session.wealth / wealth) }, leaving);
      const words = assets ? orders(advice, assets, { ...place, wealth }) : order(advice, { ...place, wealth });
      answer.replaceChildren(
        h("p", { class: "sentence" }, `With ${inCurrency(wealth)}: `, words),
        h("p", { class: "note" }, `Nothing is recorded. When you report ${calendar.inText(action.period)}, enter the money as added, and the wealth reached if it was invested meanwhile.`),
      );
    });
    return h("div", {}, form, answer);
  };
  return disclosure("Money came or went today", build);
}

/** Returns the shares held of a wealth that is larger by 1 / `part`: the same amounts. A withdrawal of more than the bank holds sells the rest. */
function held(action, assets, part) {
  if (!assets) return { holding: Math.min(1, action.holding * part) };
  const all = assets.reduce((sum, name) => sum + action.holdings[name], 0) * part;
  return { holdings: Object.fromEntries(assets.map((name) => [name, (action.holdings[name] * part) / Math.max(1, all)])) };
}

/** Says what to hold of several assets, and what to trade of each. */
function orders(advice, assets, place) {
  const { rows, total, bank } = inMoneyByName(advice, assets, place);
  const trades = rows.filter(({ trade }) => trade !== 0).map(({ name, trade }) => `${trade > 0 ? "buy" : "sell"} ${inCurrency(Math.abs(trade))} of ${name}`);
  return [`${inCurrency(total.held)} in the assets, ${allocation(total.share)}, and ${inCurrency(bank.held)} in the bank. `, h("b", {}, trades.length > 0 ? `${trades.join(", ").replace(/^./, (first) => first.toUpperCase())}.` : "Nothing to trade.")];
}
