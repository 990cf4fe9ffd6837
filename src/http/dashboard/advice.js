// The one advice of a session's page. It is read off the policy and stands at once; the step solved anew checks it, and
// takes its place where the two differ by more than the page says.

import { announce, h, section } from "./dom.js";
import { endWords } from "./flows.js";
import { allocation, percent, significant, wealth } from "./format.js";

/** The advice is told to a tenth of a percent, so this far the policy and the step solved anew say the same. */
const TOLERANCE = 0.001;

/** Where an advice comes from, in words: every source that the service names. */
export const SOURCES = {
  policy_surrogate: "read off the policy",
  resolved: "solved anew on request",
  resolved_other_radius: "solved anew for another radius",
  resolved_outside_design: "solved anew, because this state lies outside the policy\u2019s design",
  unsolved:
    "because the step has no finite solution here, or wealth does not last for what is withdrawn: all stays in the bank, which no law can hurt",
};

/** Whether two allocations are the same advice. */
export const agrees = (one, other) => Math.abs(one - other) <= TOLERANCE;

/**
 * The advice of `action`, above `rest`; `horizon` is null where there is none. `checked(anew)` takes what `/action` says of the same state with the step solved
 * anew, and gives the advice that stands; `unchecked(words)` says that it could not be.
 */
export function adviceView(action, horizon, rest) {
  const amount = h("strong", {}, allocation(action.allocation));
  const order = h("p", { class: "sentence" }, trade(action));
  const then = horizon === null ? "a horizon of the policy from now" : "at the horizon";
  const sentence = h("p", { class: "sentence" }, why(action, then));
  const end = action.contribution === 0 ? "" : h("p", { class: "sentence" }, endWords(action.contribution));
  const read = action.source === "policy_surrogate";
  const note = h(
    "p",
    { class: "note", id: "check" },
    read ? `${exactly(action)}. Being checked\u2026` : `${exactly(action)}.`,
  );
  const big = h("p", { class: "big" }, h("span", {}, "Hold "), amount, h("span", {}, " in the risky asset"));
  const element = section(
    `Period ${action.period}${horizon === null ? "" : ` of ${horizon}`}`,
    h("div", { class: "advice", id: "advice", tabindex: -1 }, big, order, sentence, end, note),
    rest,
  );
  const checked = (anew) => {
    if (!read) return action;
    if (agrees(anew.allocation, action.allocation)) {
      note.textContent = `${exactly(action)}. Checked: the step solved anew is within ${percent(TOLERANCE).replace("%", "points")} of it.`;
      return action;
    }
    amount.textContent = allocation(anew.allocation);
    order.textContent = trade(anew);
    sentence.replaceChildren(...why(anew, then));
    const apart = percent(Math.abs(anew.allocation - action.allocation)).replace("%", "points");
    const found = anew.source === "unsolved" ? exactly(anew) : "Solved anew";
    note.textContent = `${found}: what was read off the policy, ${allocation(action.allocation)}, is ${apart} away from it.`;
    announce(`The advice was solved anew: hold ${amount.textContent}.`);
    return { ...anew, replaced: true };
  };
  const unchecked = (words) => (note.textContent = `${exactly(action)}. It could not be checked: ${words}`);
  return { element, checked, unchecked };
}

const exactly = ({ allocation, source }) => `Allocation ${significant(allocation, 4)}, ${SOURCES[source]}`;

/** What to do about the share held now. Less than the advice is told to is nothing. */
function trade({ holding, band: [low, high], trade: change }) {
  const kept = low < high ? ` Anything from ${allocation(low)} to ${allocation(high)} is best kept as it is.` : "";
  const now = `${allocation(holding)} is held now: `;
  if (Math.abs(change) < TOLERANCE / 2) return `${now}nothing to trade.${kept}`;
  return `${now}${change > 0 ? "buy" : "sell"} ${percent(Math.abs(change))} of wealth.${kept}`;
}

function why({ allocation, certainty_equivalent, floor }, then) {
  if (allocation === 0)
    return [
      "Against the worst law the returns seen cannot rule out, nothing beats the bank, which reaches ",
      h("b", {}, wealth(floor)),
      ".",
    ];
  return [
    "Against the worst law the returns seen cannot rule out, this is worth ",
    h("b", {}, wealth(certainty_equivalent)),
    ` for certain ${then}, where the bank alone reaches `,
    h("b", {}, wealth(floor)),
    ".",
  ];
}
