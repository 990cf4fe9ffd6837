// The advice on a session's page, in money and in percent. A newly solved step checks it, behind a fold.

import { h, section } from "./dom.js";
import { endWords } from "./flows.js";
import { allocation, figures, minus, percent, points, significant } from "./format.js";
import { cleared, inCurrency } from "./money.js";
import { priceFields, shareCount } from "./share_prices.js";

/** Advice is shown to a tenth of a percent: within this distance the policy and the step solved again agree. */
const TOLERANCE = 0.001;

/** The text for each source of advice that the service names. */
export const SOURCES = {
  policy_surrogate: "read off the policy",
  resolved: "solved again on request",
  resolved_other_radius: "solved again for another radius",
  resolved_outside_design: "solved again, because this state lies outside the policy\u2019s design",
  unsolved:
    "everything stays in the bank, because the step has no finite solution here or wealth cannot cover the planned withdrawals",
};

/** Tells whether two allocations are the same advice. */
const agrees = (one, other) => Math.abs(one - other) <= TOLERANCE;

/**
 * Shows the advice of `action`, followed by the elements `rest`. `place` is `{heading, end, cautious, price, cost, wealth}`: the title of the
 * period, when the horizon ends, whether the policy guards against markets worse than the record, the last price reported or null, and the
 * session's terms. Returns `{element, quant, checked(anew), unchecked(words)}`: `checked` takes the answer of `/action` for the same state
 * with the step solved again, `unchecked` the reason why that failed.
 */
export function adviceView(action, place, rest) {
  const note = h("p", { class: "note", id: "check" }, `${exactly(action)}. Solving the step again as a check\u2026`);
  const sentence = h("p", { class: "sentence order" });
  const tell = (price) => sentence.replaceChildren(...order(action, { ...place, price }));
  tell(place.price);
  const element = section(
    place.heading,
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      spendWords(action),
      h("p", { class: "big" }, h("span", {}, "Hold "), h("strong", {}, allocation(action.allocation)), h("span", {}, action.spending ? " of the rest in stocks" : " in stocks")),
      sentence,
      action.caution.map(({ sentence }) => h("p", { class: "note wrong caution" }, minus(sentence))),
      h("p", { class: "sentence" }, why(action, place)),
      action.contribution === 0 ? "" : h("p", { class: "sentence" }, endWords(action.contribution)),
      priceFields([""], { "": place.price }, (prices) => tell(prices[""] ?? null)),
    ),
    rest,
  );
  const checked = (anew) => {
    const apart = points(Math.abs(anew.allocation - action.allocation));
    const found = anew.source === "unsolved" ? exactly(anew) : `The step solved again holds ${percent(anew.allocation)}`;
    note.textContent = agrees(anew.allocation, action.allocation)
      ? `${exactly(action)}. Checked: the step solved again is within ${points(TOLERANCE)} of it.`
      : `${exactly(action)}. ${found}, ${apart} away from it.`;
  };
  const unchecked = (words) => (note.textContent = `${exactly(action)}. It could not be checked: ${words}`);
  return { element, quant: [note, h("p", { class: "note" }, quantWords(action))], checked, unchecked };
}

const exactly = ({ allocation, source }) => `Allocation ${percent(allocation, 2)}, ${SOURCES[source]}`;

/** Says what to spend before the period, if the policy plans it. */
export function spendWords({ spending }) {
  if (!spending) return "";
  return h("p", { class: "sentence lead" }, h("b", {}, `Spend ${inCurrency(spending.amount)}`), ` (${percent(spending.share, 2)} of wealth) before this period.`);
}

/** Returns the advice in money, after spending and trading costs, and in shares if a price is known. */
export function inMoney({ allocation: advised, holding, trade, spending }, { wealth: whole, cost, price }) {
  const left = whole - (spending?.amount ?? 0);
  const all = left * (1 - cost * Math.abs(trade));
  const [held, now] = [advised * all, holding * whole];
  const parts = { all, held, now, bank: cleared(all - held, whole), trade: held - now, cost: left - all };
  return price === null ? parts : { ...parts, shares: held / price, traded: (held - now) / price };
}

/** Says what to trade. A trade smaller than the precision of the advice counts as none. */
export function order(action, place) {
  const { all, held, now, trade, bank, cost, shares, traded } = inMoney(action, place);
  const [low, high] = action.band;
  const still = Math.abs(action.trade) < TOLERANCE / 2;
  const stocks = `${inCurrency(held)} of ${inCurrency(all)} in stocks, ${inCurrency(bank)} in the bank`;
  const sized = traded === undefined ? "" : ` (about ${shareCount(Math.abs(traded))} shares at ${inCurrency(place.price)})`;
  const paid = cost > 0 && !still ? `, which costs ${inCurrency(cost)}` : "";
  const act = still
    ? [h("b", {}, "Nothing to trade"), `: you hold ${inCurrency(now)} now.`]
    : [h("b", {}, `${trade > 0 ? "Buy" : "Sell"} ${inCurrency(Math.abs(trade))}`), `${sized}${paid}: you hold ${inCurrency(now)} now, ${allocation(action.holding)}.`];
  const kept = low < high ? ` The no-trade range is ${allocation(low)} to ${allocation(high)}: do not trade inside it.` : "";
  return [`${stocks}${shares === undefined || shares === 0 ? "" : `, ${shareCount(shares)} shares`}. `, ...act, kept];
}

/** Says what the advice is worth in the worst market, as the parts of a sentence. */
export function why({ allocation, certainty_equivalent, floor }, { end, cautious }) {
  const worst = "n the worst market it guards against";
  const [even, market] = cautious ? [`Even i${worst}`, `I${worst}`] : Array(2).fill("If the market is what this policy assumes");
  if (allocation === 0) return [`${market}, nothing beats the bank, which reaches `, h("b", {}, inCurrency(floor)), ` ${end}.`];
  return [
    `${even}, this is worth as much as a sure `,
    h("b", {}, inCurrency(certainty_equivalent)),
    ` ${end}; all in the bank comes to `,
    h("b", {}, inCurrency(floor)),
    cautious ? ". That is a comparison, and no guarantee." : ".",
  ];
}

/** The figures behind the advice, in the paper's terms. */
function quantWords({ radius, sample_size, effective_size, certainty_equivalent, floor, surrogate_sd }) {
  const weighed = effective_size < sample_size - 0.5 ? `, worth ${significant(effective_size, 3)} of equal weight` : "";
  return [
    `Radius of the uncertainty set ${figures(radius, 3)}, around ${sample_size} returns${weighed}.`,
    `Certainty equivalent ${inCurrency(certainty_equivalent)}, floor ${inCurrency(floor)}; predicted standard deviation of its log ${significant(1e4 * surrogate_sd, 2)} bp.`,
  ].join(" ");
}
