// A table that compares two things and marks their differences.

import { h, table } from "./dom.js";
import { titled } from "./naming.js";

/** The names of the two things in a table and in charts: A is the first. */
export const LETTERS = ["A", "B"];

/**
 * Returns the table. `rows` are `{name, cells: [of A, of B], apart}`; `apart` is the difference in words, if there is more to say than that
 * they differ. `kind` is the path of the two in the address, `names` are their names, empty if they have none.
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
