// What things are called: by the name that somebody gave, else by the part of the identifier that tells it from others.

import { h } from "./dom.js";
import { short } from "./format.js";

/** What a thing is called in a sentence. */
export const called = (id, name) => name || short(id);

/** What heads the row of a thing: its name with the identifier behind it, or the identifier alone. */
export function headed(href, id, name) {
  const code = h("code", {}, short(id));
  return name ? [h("a", { href }, name), h("span", { class: "under" }, code)] : h("a", { href }, code);
}
