// A standalone report: its page is drawn from the data in the same file.

import { h } from "./dom.js";

/** Shows the report; `body(data)` draws the part below the title. */
export function show({ body }) {
  const { title, data } = JSON.parse(document.getElementById("report").textContent);
  document.querySelector("main").replaceChildren(h("header", { class: "page" }, h("h1", {}, title)), ...[body(data, (policy) => `policy ${policy.slice(0, 10)}`)].flat(Infinity).filter(Boolean));
}
