// A report in a file of its own: its page is drawn of the data that stand beside it.

import { h } from "./dom.js";

/** `body(data)` makes what stands below the title. */
export function show({ body }) {
  const { title, data } = JSON.parse(document.getElementById("report").textContent);
  document.querySelector("main").replaceChildren(h("header", { class: "page" }, h("h1", {}, title)), ...[body(data, (policy) => `policy ${policy.slice(0, 10)}`)].flat(Infinity).filter(Boolean));
}
