// A table that compares two things and marks their differences.

import { h, table } from "./dom.js";
import { titled } from "./naming.js";

/** What two things are called in a table and in charts: A is the first. */
export const LETTERS = ["A", "B"];

/**
 * `rows`: `{name, cells: [of A, of B], apart}`; `apart` is the difference in words, where it is more than that they differ.
 * `kind` is where the two are, `names` what they are called, empty where nothing.
 */
export function beside(caption, kind, noun, ids, names, rows) {
  const link = (index) => [`${LETTERS[index]}: `, h("a", { href: `#/${kind}/${ids[index]}` }, titled(noun, ids[index], names[index]))];
  const differs = ({ cells: [one, other], apart }) => (one === other ? "" : (apart ?? "differs"));
  const both = table(
    caption,
    [
      { name: "What", cell: ({ name }) => name },
      ...[0, 1].map((index) => ({ name: h("span", {}, link(index)), cell: ({ cells }) => (differs({ cells }) ? h("b", {}, cells[index]) : cells[index]) })),
      { name: "B less A", cell: differs },
    ],
    rows,
  );
  both.classList.add("beside");
  return both;
}
