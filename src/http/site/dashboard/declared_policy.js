// A policy of a declared problem: its formulas, and what to do in a period, for the states and the noises that the user types.

import { post } from "./api.js";
import { beside, walking } from "./declared_asking.js";
import { announce, facts, h, section, table } from "./dom.js";
import { area, fieldset, input, refusal, sending } from "./form.js";
import { count, percent, significant } from "./format.js";
import { futuresOf } from "./futures.js";
import { pointed } from "./number_text.js";
import { caution, utility, warningList } from "./specification.js";

/** Formats a number of a declared problem, whose unit is not known. */
export const plain = (value) => significant(value, 6);

/** Returns which courses of a declared problem are drawn: what is earned only if periods earn something. */
export const isMoved = ({ reward }) => (name) => name !== "earned" || (reward ?? null) !== null;

/** Says the states of a declared problem. */
export const statesWords = (states) => Object.entries(states).map(([name, value]) => `${name}: ${plain(value)}`).join(", ");

/** Returns the body of the page of policy `id`, with `map`, its map. `isCompared` tells whether the service can compare it. */
export function declaredBody(id, { specification, warnings }, map, leaving) {
  const { problem, design } = specification;
  const { horizon, history } = problem;
  const answer = h("div", { id: "decision" });
  return [
    h("p", { class: "lead" }, "This policy is of ", h("a", { href: "/guide/declared" }, "a problem declared in formulas"), "."),
    ...warningList(warnings, problem),
    facts([
      ["Periods", count(horizon)],
      ["Numbers in the record", count(history.length)],
      ["Caution", caution(problem)],
      [design.accuracy ? "Most states solved in each step" : "States solved in each step", count(design.count)],
      design.accuracy && ["Accuracy asked for", significant(design.accuracy, 3), "of the worth"],
    ]),
    h("p", {}, h("a", { class: "button quiet", href: `#/sessions/new?policy=${id}`, "data-needs": "operate" }, "Open a session")),
    section("What to do in a period", deciding(id, problem, answer)),
    answer,
    map,
    futuresOf(`/policies/${id}`, leaving, { format: plain, shown: isMoved(problem) }),
    beside(id, specification),
    walking(specification),
    section("The problem", formulas(problem)),
    h("p", { class: "again", "data-needs": "train" }, h("a", { href: `#/declare?from=${id}` }, "Clone with one thing changed")),
  ];
}

/** Lists what the declaration says, with its formulas. */
function formulas({ states, actions, noise, parameters = {}, next, reward, end, utility: ofWealth, discount = 1 }) {
  const range = ({ low, high }) => `${plain(low)} to ${plain(high)}`;
  const allowed = ([name, { low, high, values }]) => (values ? [[`${name}, one of`, values.map(plain).join(", ")]] : [[`Least ${name}`, low], [`Most ${name}`, high]]);
  const rows = [
    ...Object.entries(states).map(([name, state]) => [name, `${plain(state.start)} at the start, always ${range(state)}`]),
    ...Object.entries(actions).flatMap(allowed),
    [noise.name, `seen at the end of a period, ${range(noise)}`],
    ...Object.entries(next).map(([name, formula]) => [`Next ${name}`, formula]),
    ["Reward of a period", reward],
    ["Worth at the end", end],
    ["Utility at the end", ofWealth && `${utility(ofWealth)}, of ${ofWealth.of}`],
    ["Discount a period", discount === 1 ? null : plain(discount)],
    ...Object.entries(parameters).map(([name, value]) => [name, plain(value)]),
  ];
  const shown = rows.filter(([, formula]) => formula !== undefined && formula !== null && formula !== "");
  return table("The problem in formulas", [{ name: "What", cell: ([what]) => what }, { name: "Formula", cell: ([, formula]) => h("p", { class: "prose" }, h("code", {}, formula)) }], shown);
}

/** Returns the form that asks what to do; the answer is shown in `answer`. */
function deciding(id, problem, answer) {
  const { states, noise, horizon } = problem;
  const period = input({ name: "period", label: "Period", note: `1 to ${horizon}.`, value: "1", inputmode: "numeric" });
  const field = ([name, { start, low, high }], index) =>
    input({ within: `${index}-`, name: `state.${name}`, label: name, note: `Now, ${plain(low)} to ${plain(high)}.`, value: String(start) });
  const now = Object.entries(states).map(field);
  const seen = area({
    name: "noises",
    label: `${noise.name} since the start`,
    note: "One number for each period before this one, oldest first, apart by spaces, commas or lines. Blank in period 1. Decimals have a point.",
  });
  seen.element.classList.add("broad");
  const send = h("button", { type: "submit" }, "Decide");
  const form = h("form", { novalidate: true }, fieldset("The situation", [period, ...now, seen]), refusal(), h("p", { class: "send" }, send));
  form.addEventListener("input", () => answer.replaceChildren());
  sending(form, send, async () => {
    answer.replaceChildren();
    const state = Object.fromEntries(Object.keys(states).map((name, index) => [name, pointed(now[index].control.value)]));
    const request = { policy: id, period: pointed(period.control.value), state, noises: numbers(seen.control.value) };
    const decision = await post("/decide", request);
    answer.replaceChildren(decided(decision, problem));
    announce(Object.entries(decision.actions).map(([name, value]) => `${name}: ${plain(value)}`).join(", "));
  });
  return form;
}

/** Returns the numbers of a text. A comma between digits may be a decimal mark: it parts two numbers only if both have a point. */
function numbers(text) {
  const parts = (word) => {
    const both = word.split(",");
    if (both.length > 1 && !both.every((part) => part.includes(".")))
      throw { field: "noises", message: `\u201c${word}\u201d may be one number or several. Write decimals with a point, and a space after a comma.` };
    return both;
  };
  const words = text.split(/[\s;]+/).map((word) => word.replace(/^,|,$/g, ""));
  return words.filter(Boolean).flatMap(parts).map(pointed);
}

/** Shows the actions of a period, an answer of `/decide` or `/action`, under a heading. `last` is the last period of the horizon. */
export function decided({ period, actions, several_peaks, value, value_error, radius, worst_law, duality_gap, untrained_share }, { noise: { name: noise }, horizon, utility: ofWealth }, { heading = `Period ${period}`, last = horizon } = {}) {
  const warning = (words) => h("p", { class: "note wrong" }, words);
  const share = untrained_share >= 0.01 ? percent(untrained_share, 0) : "Less than 1\u202f%";
  return section(
    heading,
    h(
      "div",
      { class: "words" },
      Object.entries(actions).map(([name, amount]) => h("p", { class: "big" }, h("span", {}, name), h("strong", {}, plain(amount)))),
      untrained_share > 0 && warning(`${share} of the outcomes lie beyond the states that were trained: their worth is a guess.`),
      several_peaks.length > 0 && warning(`Quite another ${several_peaks.join(" and ")} may be nearly as good: the worth has several peaks.`),
    ),
    facts([
      [`Worth of ${period === last ? "the last period" : `periods ${period} to ${last}`}`, plain(value), `${ofWealth ? "certainty equivalent, " : ""}under the worst law${value_error > 0 ? `, to about ${significant(value_error, 2)}` : ""}`],
      ["Radius", significant(radius, 4), `in the unit of ${noise}`],
    ]),
    h("h3", {}, `The worst law of ${noise} in this period`),
    moves(worst_law, duality_gap),
  );
}

/** Lists what the worst law moves, and says how much stays. */
function moves(law, gap) {
  const moved = law.filter(({ from, to }) => from !== to);
  if (moved.length === 0) return h("p", {}, "It is the law that was learned: nothing is moved.");
  const stays = law.reduce((sum, { from, to, share }) => sum + (from === to ? share : 0), 0);
  const columns = [
    { name: "Share of the mass", cell: ({ share }) => percent(share) },
    { name: "From", numeric: true, cell: ({ from }) => plain(from) },
    { name: "To", numeric: true, cell: ({ to }) => plain(to) },
  ];
  return [table("What the worst law moves", columns, moved), h("p", { class: "note" }, `The other ${percent(stays)} stays where it was seen. Duality gap ${significant(Math.abs(gap), 2)}.`)];
}
