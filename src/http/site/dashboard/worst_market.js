// The worst market that the advice guards against: its assumptions in words, and the law itself.

import { get } from "./api.js";
import { disclosure, h, section } from "./dom.js";
import { count, figures, minus, oneIn, percent, significant } from "./format.js";
import { lawChart } from "./law_chart.js";

/** Moves within this distance of the deepest one count as equally deep, in log-return. */
const NEAR = 0.01;
/** Other moves are mentioned from this share on. */
const LITTLE = 5e-4;

/** From this many periods on, a number could be read as the year in which it happens. */
const MANY = 1000;
/** The periods of a year, by their unit. */
const A_YEAR = { day: 252, week: 52, month: 12, quarter: 4 };

/** Says how seldom a period of some probability is: "month in 23", or "month in 175 years". */
function seldom(unit, probability) {
  const periods = Math.max(1, Math.round(1 / probability));
  if (periods < MANY) return `${unit} in ${oneIn(probability)}`;
  return unit in A_YEAR ? `${unit} in ${count(Math.round(periods / A_YEAR[unit]))} years` : `${unit} of ${periods.toLocaleString("en-GB")}`;
}

/** Says what the market assumes beyond the returns seen. `unit` is the name of a period, `cautious` whether the policy guards against worse markets. */
export function assumed({ transport }, unit, cautious = true) {
  const moves = transport.filter(({ atom, moved_to, mass }) => atom !== moved_to && mass > 0);
  const share = (some) => some.reduce((sum, { mass }) => sum + mass, 0);
  if (moves.length === 0) return `It assumes that every ${unit} is like those seen${cautious ? ": no allowed market is worse for this advice" : ""}.`;
  const lowest = Math.min(...moves.map(({ moved_to }) => moved_to));
  const deep = moves.filter(({ moved_to }) => moved_to <= lowest + NEAR);
  const rest = share(moves) - share(deep);
  const size = (log) => percent(Math.abs(Math.expm1(log)), Math.abs(Math.expm1(log)) < 0.095 ? 1 : 0);
  const often = (mass) => (mass > 0.6 ? `most ${unit}s` : `one ${seldom(unit, mass)}`);
  const verb = (mass, word) => (mass > 0.6 ? word : `${word}s`);
  const more = rest >= LITTLE ? `, and that ${often(rest)} ${verb(rest, "bring")} less than similar ones did` : "";
  const mass = share(deep);
  if (lowest > 0) {
    const cut = share(moves);
    return `It counts the best ${cut > 0.4 ? `${percent(cut, 0)} of ${unit}s` : seldom(unit, cut)} as only ${size(lowest)}.`;
  }
  return `It assumes that ${often(mass)} ${verb(mass, "lose")} ${size(lowest)}${more}.`;
}

/** Says why nothing is held: what the returns paid beyond the bank, the standard error with `size` returns, and what the worst market leaves of it. */
export function whyNothing({ transport }, rate, size, unit) {
  const mean = (of) => transport.reduce((sum, move) => sum + move.mass * of(move), 0);
  const paid = mean(({ atom }) => Math.expm1(atom));
  const error = Math.sqrt(mean(({ atom }) => (Math.expm1(atom) - paid) ** 2) / (size - 1));
  const left = mean(({ moved_to }) => Math.expm1(moved_to)) - rate;
  const beyond = paid - rate;
  const told = (value) => percent(Math.abs(value), 2);
  if (beyond <= 0) return `The record paid ${told(beyond)} a ${unit} less than the bank, with a standard error of ${told(error)}.`;
  return `The record beat the bank by ${told(beyond)} a ${unit}, with a standard error of ${told(error)}. In this market it ${left > 0 ? `beats the bank by ${told(left)}` : `pays ${told(left)} less than the bank`}.`;
}

/** Returns the section. The robust step takes a while, so it is loaded after the rest of the page; `then()` is called afterwards. */
export function worstMarket({ id, policy, cautious, calendar: { unit }, leaving }, advice, then) {
  const paper = h("div", { class: "words quant" }, advice.quant);
  const holder = h("div", { class: "later" }, h("p", { class: "note" }, "Solving the step again\u2026"));
  const told = async () => {
    const anew = await get(`/action?session=${id}&explain=worst_case`, leaving);
    advice.checked(anew);
    const { worst_case } = anew;
    paper.append(paperWords(anew, unit));
    if (worst_case.transport.length === 0) return [h("p", { class: "sentence" }, assumedNormal(worst_case, unit))];
    const { rate_per_step } = policy.specification.problem;
    const why = cautious && anew.allocation === 0 ? [h("p", { class: "sentence" }, whyNothing(worst_case, rate_per_step, anew.effective_size, unit))] : [];
    return [...why, h("p", { class: "sentence" }, assumed(worst_case, unit, cautious)), lawChart(worst_case)];
  };
  told().then(
    (nodes) => {
      holder.classList.remove("later");
      holder.replaceChildren(...nodes);
      then();
    },
    (error) => {
      if (leaving.aborted) return;
      advice.unchecked(error.message);
      holder.replaceChildren(h("p", { class: "error" }, error.message));
      then();
    },
  );
  return section(cautious ? "The worst market it guards against" : "The market it assumes", holder, disclosure("For the quant", () => paper));
}

/** Describes a market whose returns are a bell curve: its average and spread, beside those seen. */
function assumedNormal({ normal, sentence }, unit) {
  if (!normal) return minus(sentence);
  const [average, spread, seenAverage, seenSpread] = [normal.mean, Math.sqrt(normal.variance), normal.estimated_mean, Math.sqrt(normal.estimated_variance)].map((value) => percent(value, 2));
  return `It assumes that stocks return ${average} a ${unit} on average, give or take ${spread}. The record shows ${seenAverage}, give or take ${seenSpread} (log-returns).`;
}

function paperWords({ worst_case, radius, sample_size, certainty_equivalent, floor }, unit) {
  const { transport, radius_cost, multiplier, duality_gap } = worst_case;
  const moves = transport.filter(({ atom, moved_to }) => atom !== moved_to);
  const moved = moves.reduce((sum, { mass }) => sum + mass, 0);
  const law = transport.length === 0 ? "" : `The worst law within Wasserstein distance ${figures(radius, 3)} of the ${sample_size} returns seen moves ${percent(moved)} of the probability. `;
  // The worth is convex in the radius and never below the floor.
  const most = Math.max(0, Math.min(10 * radius_cost, 1e4 * Math.log(certainty_equivalent / floor)));
  const words = `${law}Widening the ball of this ${unit} alone by 0.001 would cost at most ${significant(most, 2)} basis points of the certainty equivalent. Multiplier of the ball ${significant(multiplier, 3)} (utility lost per unit of radius); duality gap ${significant(1e4 * Math.abs(duality_gap), 2)} bp.`;
  return h("p", { class: "note" }, words);
}
