// A table that compares two to four things and marks their differences.

import { h, table } from "./dom.js";
import { titled } from "./naming.js";

/** The names of the things in a table and in charts: A is the first. */
export const LETTERS = ["A", "B", "C", "D"];
/** Most things compared: more lines of one chart cannot be told apart. */
export const MOST = LETTERS.length;

/** Returns the word for how many things are compared. */
export const numbered = (size) => ["none", "one", "two", "three", "four"][size];

/** Joins texts in a sentence: "a, b and c". */
export const joined = (texts) => texts.join(", ").replace(/, (?=[^,]*$)/, " and ");

/** Tells whether all values are the same. */
export const areSame = ([first, ...others]) => others.every((other) => other === first);

/**
 * Returns the table. `rows` are `{name, cells, apart}` with a cell for each thing; `apart` is the difference of two things in words, if there is
 * more to say than that they differ. `kind` is the path of the things in the address, `names` are their names, empty if they have none.
 */
export function beside(caption, kind, noun, ids, names, rows) {
  const link = (index) => [`${LETTERS[index]}: `, h("a", { href: `#/${kind}/${ids[index]}` }, titled(noun, ids[index], names[index]))];
  const differs = ({ cells, apart }) => (areSame(cells) ? "" : (apart ?? "differs"));
  const all = table(
    caption,
    [
      { name: "What", cell: ({ name }) => name },
      ...ids.map((_, index) => ({ name: h("span", {}, link(index)), label: LETTERS[index], cell: ({ cells }) => (differs({ cells }) ? h("b", {}, cells[index]) : cells[index]) })),
      { name: ids.length === 2 ? "B less A" : "Differences", cell: differs },
    ],
    rows,
  );
  all.classList.add("beside");
  return all;
}
