// A session of several assets: what to hold of each, and what the worst market does to each.

import { SOURCES, spendWords, why } from "./advice.js";
import { disclosure, h, section, table } from "./dom.js";
import { endWords } from "./flows.js";
import { allocation, figures, minus, percent, points } from "./format.js";
import { cleared, inCurrency } from "./money.js";
import { assetsHeld, everyAsset } from "./several_fields.js";
import { priceFields, shareCount } from "./share_prices.js";
import { stackedChart } from "./stacked.js";

/** A trade of a smaller share of wealth counts as none. */
const LITTLE = 0.0005;

const sum = (numbers) => numbers.reduce((all, number) => all + number, 0);

/** Returns the advice in money, asset by asset, after trading costs. */
export function inMoneyByName(action, assets, { wealth: whole, cost }) {
  const left = whole - (action.spending?.amount ?? 0);
  const all = left * (1 - cost * sum(assets.map((name) => Math.abs(action.trade[name]))));
  const rows = assets.map((name) => {
    const [held, now] = [action.allocation[name] * all, action.holdings[name] * whole];
    const still = Math.abs(action.trade[name]) < LITTLE;
    return { name, share: action.allocation[name], held, holding: action.holdings[name], now, trade: still ? 0 : held - now };
  });
  const [held, now] = [sum(rows.map((row) => row.held)), sum(rows.map((row) => row.now))];
  const total = { name: "All of them", share: action.total, held, holding: now / whole, now, trade: null };
  const bank = { name: "Bank", share: 1 - action.total, held: cleared(all - held, whole), holding: 1 - now / whole, now: cleared(whole - now, whole), trade: null };
  return { rows, total, bank, cost: left - all };
}

/** Shows the advice, followed by `rest`. */
export function severalAdvice(action, place, assets, rest) {
  const { rows, total, bank, cost } = inMoneyByName(action, assets, place);
  const under = (words) => h("span", { class: "under" }, words);
  const money = (share, size) => [allocation(share), under(inCurrency(size))];
  const number = (name, cell) => ({ name, numeric: true, cell });
  const traded = (size) => (size === null ? "" : size === 0 ? "Nothing" : `${size > 0 ? "Buy" : "Sell"} ${inCurrency(Math.abs(size))}`);
  const ordersAt = (prices) => {
    const shares = (name, size) => (name in prices && size !== 0 ? under(`about ${shareCount(Math.abs(size) / prices[name])} shares`) : null);
    const orders = table("What to hold of each asset", [
      { name: "Asset", cell: ({ name }) => name },
      number("To hold", ({ name, share, held }) => [...money(share, held), shares(name, held)]),
      number("Held now", ({ name, holding, now }) => [...money(holding, now), shares(name, now)]),
      number("To trade", ({ name, trade }) => [traded(trade), shares(name, trade ?? 0)]),
    ], [...rows, total, bank]);
    orders.classList.add("by-asset");
    return orders;
  };
  const orders = h("div", {}, ordersAt(place.prices));
  return section(
    place.heading,
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      spendWords(action),
      h("p", { class: "big" }, h("span", {}, "Hold "), h("strong", {}, allocation(action.total)), h("span", {}, ` in ${assets.length} assets`)),
      orders,
      cost > 0 && rows.some(({ trade }) => trade !== 0) ? h("p", { class: "sentence" }, `Trading costs ${inCurrency(cost)}.`) : "",
      action.caution.map(({ sentence }) => h("p", { class: "note wrong caution" }, minus(sentence))),
      h("p", { class: "sentence" }, why({ ...action, allocation: action.total }, place)),
      action.contribution === 0 ? "" : h("p", { class: "sentence" }, endWords(action.contribution)),
      priceFields(assets, place.prices, (prices) => orders.replaceChildren(ordersAt(prices))),
    ),
    rest,
  );
}

/** Returns the average return of each asset as seen, as believed and in the worst market; null if the answer has no worst market. */
function worstRows(action, assets) {
  const means = action.one_step?.worst_means;
  if (!means) return null;
  return assets.map((name) => {
    const { seen, believed = seen, worst } = means[name];
    const of = [seen, believed, worst].map(Math.expm1);
    return { name, seen: of[0], believed: of[1], worst: of[2], less: of[1] - of[2], moved: believed !== seen };
  });
}

/** Says what the worst market takes most from; null if the answer has no worst market. */
function worstWords(action, assets, unit) {
  const rows = worstRows(action, assets);
  if (rows === null) return null;
  const most = rows.reduce((one, other) => (other.less > one.less ? other : one));
  if (most.less < 5e-6) return `It assumes that every asset keeps its average return, because no allowed market is worse for this advice.`;
  return `It takes most from ${most.name}: ${percent(most.worst, 2)} a ${unit} on average, compared with ${percent(most.believed, 2)} ${rows.some(({ moved }) => moved) ? "believed" : "seen"}.`;
}

/** Shows what the worst market of the next period does to the average return of each asset. */
export function severalWorst(action, assets, { unit }) {
  const rows = worstRows(action, assets);
  const quant = disclosure("For the quant", () =>
    h("p", { class: "note" }, `${SOURCES[action.source][0].toUpperCase()}${SOURCES[action.source].slice(1)}. Radius of the fund\u2019s uncertainty set ${figures(action.radius, 3)}, around ${action.sample_size} returns.${action.one_step ? ` The one-step problem is worth at least ${inCurrency(action.one_step.certainty_equivalent)}, and no allocation is worth more than ${inCurrency(action.one_step.bound)}.` : ""}`),
  );
  if (rows === null) return section("How it was found", quant);
  const moved = rows.some((row) => row.moved);
  const number = (name, cell) => ({ name, numeric: true, cell });
  return section(
    "The worst market it guards against",
    h("p", { class: "sentence" }, worstWords(action, assets, unit)),
    table(`Average return of each asset a ${unit}`, [
      { name: "Asset", cell: ({ name }) => name },
      number(`Seen, a ${unit}`, ({ seen }) => percent(seen, 2)),
      ...(moved ? [number("Believed", ({ believed }) => percent(believed, 2))] : []),
      number("In the worst market", ({ worst }) => percent(worst, 2)),
      number("Lower by", ({ less }) => points(less, 3)),
    ], rows),
    quant,
  );
}

/** Draws what was held of each asset, period by period. */
export function severalHeld({ history, calendar }) {
  const none = Object.fromEntries(everyAsset(history).map((name) => [name, 0]));
  const shares = history.observations.map((row) => ({ ...none, ...assetsHeld(row) }));
  if (shares.length === 0) return "";
  return section("What it held", stackedChart({ title: "Share of wealth in each asset", assets: everyAsset(history), shares, x: { name: calendar.name, tick: calendar.brief } }));
}
