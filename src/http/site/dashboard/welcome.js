// The text of an empty page.

import { h } from "./dom.js";

/** `start` is what can be done at once. */
export function welcome(start = "") {
  const step = (title, ...text) => h("li", {}, h("h2", {}, title), h("p", {}, text));
  return h(
    "div",
    { class: "welcome" },
    h(
      "p",
      { class: "lead" },
      "Ballast tells an investor how much to hold in stocks when nobody knows what the market will do. Nothing has been trained here yet",
      start === "" ? "." : ", and nothing needs to be: give it a record, and it answers at once.",
    ),
    start === "" ? "" : h("p", { class: "send ahead" }, h("a", { class: "button quiet", href: "#/plan" }, "Plan for years"), h("span", { class: "note" }, "Will it last, and how much may I spend?")),
    start === "" ? "" : h("p", { class: "send ahead" }, h("a", { class: "button quiet", href: "#/sleeve" }, "Size a strategy"), h("span", { class: "note" }, "How much of the capital does its record support?")),
    start,
    start === "" ? "" : h("h2", {}, "To follow a client for years"),
    h(
      "ol",
      { class: "steps" },
      step(
        "Train a policy",
        "Give it the returns seen so far. It prepares for the worst market within your caution, in seconds to minutes.",
      ),
      step("Open a session", "A session is one investor: their wealth, and the returns of the periods so far."),
      step(
        "Report and act",
        "Report each period\u2019s return as it comes. The advice for the next one follows from all of them.",
      ),
    ),
    h("p", {}, h("a", { class: "button", href: "#/train" }, "Train the first policy")),
  );
}
