// The trades of an advice: their amounts, which of them are too small, their sums, and the file of orders.

import { inMoney } from "./advice.js";
import { csvText, hundred } from "./csv.js";
import { input } from "./form.js";
import { inCurrency } from "./money.js";
import { typed } from "./number_text.js";
import { inMoneyByName } from "./several.js";

/** A trade of a smaller share of wealth counts as none, because advice is shown to a tenth of a percent. */
export const LITTLE = 0.0005;
/** Where the browser keeps the smallest trade of its user. */
const PLACE = "ballast-smallest-trade";

export const isOfSeveral = (action) => typeof action.allocation === "object";

/** Reads the smallest trade: `{money}` or `{share}` of wealth. Returns null if the text is blank, and undefined if it is neither. */
export function smallestOf(text) {
  const value = typed(text, { shares: true });
  if (value === null) return null;
  if (typeof value !== "number" || value < 0) return undefined;
  return /%\s*$/.test(text) ? { share: value } : { money: value };
}

/** Returns the trades after trading costs: `{asset, amount, held, kept, holding, share, small}`. `asset` is null if there is only one, `amount`
 * is negative for a sale, `held` is the money in the asset before and `kept` after it, `holding` and `share` are the same as shares of wealth.
 * `small` tells whether the trade is below the `smallest`. */
export function tradesOf(action, { wealth: whole, cost }, smallest = null) {
  const one = () => {
    const { held, now } = inMoney(action, { wealth: whole, cost, price: null });
    return [{ asset: null, held: now, kept: held, holding: action.holding, share: action.allocation, part: action.trade }];
  };
  const several = () =>
    inMoneyByName(action, Object.keys(action.allocation), { wealth: whole, cost }).rows.map(({ name, share, held, holding, now }) => ({
      asset: name, held: now, kept: held, holding, share, part: action.trade[name],
    }));
  const isSmall = ({ amount, part }) => Math.abs(amount) < (smallest?.money ?? 0) || Math.abs(part) < (smallest?.share ?? 0);
  return (isOfSeveral(action) ? several() : one())
    .filter(({ part }) => Math.abs(part) >= LITTLE)
    .map((trade) => ({ ...trade, amount: trade.kept - trade.held }))
    .map((trade) => ({ ...trade, small: isSmall(trade) }));
}

/** Returns the sums `{buy, sell, size}` of the trades that are not too small. */
export function sums(trades) {
  const sum = (sign) => trades.reduce((all, { amount, small }) => all + (small ? 0 : Math.max(0, sign * amount)), 0);
  const [buy, sell] = [sum(1), sum(-1)];
  return { buy, sell, size: buy + sell };
}

/** Returns the words of the sums: "Buy" and "Sell" with amounts of money, or "Nothing". */
export function orderWords({ buy, sell }) {
  const parts = [["Buy", buy], ["Sell", sell]].filter(([, size]) => size > 0);
  return parts.length === 0 ? ["Nothing"] : parts.map(([verb, size]) => `${verb} ${inCurrency(size)}`);
}

/** What the file calls the only asset of a session, which has no name. */
const ONLY = "risky asset";
/** Returns a share in percent with at most four decimals. */
const hundredths = (share) => (share === null ? null : Number(hundred(share).toFixed(4)));

/** Returns the file of orders, one a line, for sessions `{entry, trades}` in their order. */
export function ordersText(found) {
  const head = ["Client", "Session", "Policy", "Asset", "Order", "Amount", "Held", "To hold", "Held, %", "To hold, %", "Last day reported"];
  const rows = found.flatMap(({ entry, trades }) =>
    trades
      .filter(({ small }) => !small)
      .map(({ asset, amount, held, kept, holding, share }) => [
        entry.name, entry.session, entry.policy_name, asset ?? ONLY, amount > 0 ? "buy" : "sell",
        ...[Math.abs(amount), held, kept].map(cents), ...[holding, share].map(hundredths), entry.date ?? null,
      ]),
  );
  return csvText([head, ...rows]);
}

/** Returns the words of the smallest trade that the browser keeps; blank if there is none. */
export const smallestWords = () => (keptSmallest() === null ? "" : localStorage.getItem(PLACE));

/** Returns the smallest trade that the browser keeps, or null. */
export const keptSmallest = () => smallestOf(localStorage.getItem(PLACE) ?? "") ?? null;

const cents = (amount) => Math.round(100 * amount) / 100;

/** Returns `{element, smallest()}`: the field for the smallest trade, which the browser keeps, and its value; `changed()` is called at an edit. */
export function smallestField(changed) {
  const field = input({
    name: "smallest",
    label: "Smallest trade",
    placeholder: "Such as 500 or 1 %",
    inputmode: "text",
    value: localStorage.getItem(PLACE) ?? "",
    changed: (text) => {
      if (text.trim() === "") localStorage.removeItem(PLACE);
      else localStorage.setItem(PLACE, text.trim());
      look();
      changed();
    },
  });
  field.element.title = "An amount of money, or a share of wealth in percent. Smaller trades count as none in this list. This browser keeps it.";
  const look = () => {
    const wrong = smallestOf(field.control.value) === undefined;
    if (wrong) field.control.setAttribute("aria-invalid", "true");
    else field.control.removeAttribute("aria-invalid");
  };
  look();
  return { element: field.element, smallest: () => smallestOf(field.control.value) ?? null };
}
