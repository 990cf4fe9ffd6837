// The next policy of a session that renews itself.

import { h } from "./dom.js";

/** Says that the next policy is due, and what it waits for. */
export function due({ session: { renewal } }) {
  if (!renewal) return "";
  const job = renewal.job ? h("a", { href: "#/jobs" }, "its training") : "its training";
  const states = {
    due: ["The next policy is about to be trained: ", job, "."],
    training: ["The next policy is being trained: ", job, ". Until then this one continues."],
    trained: ["The next policy is trained and about to take over: ", job, "."],
    failed: ["The next policy is missing: ", job, ` failed${renewal.error ? ` (${renewal.error})` : ""}. The service will try again; until then this one continues.`],
  };
  return h("p", { class: renewal.state === "failed" ? "note wrong" : "note" }, ...states[renewal.state]);
}
