// The service's doubts about a report, as a question: each doubt in a sentence, and what the user can do about all of
// them.

import { h } from "./dom.js";
import { pressed } from "./form.js";
import { counted, minus } from "./format.js";
import { day } from "./periods.js";

export const UNCONFIRMED = "/problems/unconfirmed";

/** Returns a sentence for every doubt of a problem. */
export const doubtWords = ({ doubts }) => doubts.map((doubt) => minus(inWords(doubt)));

function inWords({ reason, field, value, sentence, missing = [] }) {
  if (missing.length === 1) return `The period that ends on ${day(missing[0])} is missing before ${day(value)}.`;
  if (missing.length > 1) return `${missing.length} periods are missing before ${day(value)}: the first ends on ${day(missing[0])}, the last on ${day(missing.at(-1))}.`;
  const asset = ["total_loss", "unusual_return", "differs_from_peers"].includes(reason) ? field.slice(field.indexOf(".") + 1) : field;
  return asset === field ? `${sentence[0].toUpperCase()}${sentence.slice(1)}.` : `${asset}: ${sentence}.`;
}

/** Returns the last days of the periods that are missing before a report. */
export const missingDays = ({ doubts }) => doubts.flatMap(({ missing = [] }) => missing);

/** Returns the question. `meant()` sends the report as it is; `filled(days)`, if given, first reports the missing periods as missing. */
export function question(problem, { meant, filled }) {
  const days = filled ? missingDays(problem) : [];
  const button = (words, act) => h("button", { type: "button", onclick: ({ target }) => pressed(target, act) }, words);
  const element = h(
    "div",
    { class: "doubts", role: "alert", tabindex: -1 },
    h("p", { class: "error" }, "Not recorded yet."),
    h("ul", {}, doubtWords(problem).map((words) => h("li", {}, words))),
    h(
      "p",
      { class: "send" },
      days.length > 0 ? button(`Report ${counted(days.length, "period")} as missing, then this one`, () => filled(days)) : null,
      button("It is right: record it", meant),
    ),
  );
  return element;
}
