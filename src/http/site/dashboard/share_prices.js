// Prices typed on the page, which express advice in shares. They are neither sent nor kept.

import { h } from "./dom.js";
import { input } from "./form.js";
import { figures, wealth } from "./format.js";
import { typed } from "./number_text.js";

/** Formats a number of shares. */
export const shareCount = (shares) => (shares >= 100 ? wealth(Math.round(shares)).replace(/\.00$/, "") : figures(shares, 3));

/**
 * Returns a fold with a field for the price of each asset in `names`; an empty name means "one share". `known` are the prices last reported, by
 * name; `changed(prices)` is called at every edit, with the valid prices by name.
 */
export function priceFields(names, known, changed) {
  const note = h("p", { class: "note wrong", role: "status" });
  const fields = names.map((name, index) =>
    input({ within: `price-${index}-`, name: `price.${name}`, label: `Price of ${name || "one share"}`, value: known?.[name] ?? "", changed: () => read() }),
  );
  const read = () => {
    const given = names.map((name, index) => [name, fields[index].control.value.trim()]).filter(([, text]) => text !== "");
    const values = given.map(([name, text]) => [name, typed(text)]);
    const bad = given.find((_, index) => !(values[index][1] > 0));
    note.textContent = bad ? `\u201c${bad[1]}\u201d is not a price.` : "";
    changed(Object.fromEntries(values.filter(([, price]) => price > 0)));
  };
  return h("details", { class: "prices" }, h("summary", {}, "In shares, at today\u2019s price"), h("div", { class: "fields" }, fields.map(({ element }) => element)), note);
}
