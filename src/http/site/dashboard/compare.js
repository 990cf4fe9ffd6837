// Two policies or two sessions side by side.

import { policiesBeside } from "./compare_policies.js";
import { sessionsBeside } from "./compare_sessions.js";
import { h } from "./dom.js";

const KINDS = { policies: policiesBeside, sessions: sessionsBeside };

/** `query`: `policies=A,B` or `sessions=A,B`. */
export async function view(query, leaving) {
  const asked = new URLSearchParams(query ?? "");
  const kind = Object.keys(KINDS).find((name) => asked.has(name));
  const ids = (asked.get(kind) ?? "").split(",").filter(Boolean);
  if (!kind || ids.length !== 2) {
    const lists = Object.keys(KINDS).map((name, index) => [index > 0 ? " or of the " : "", h("a", { href: `#/${name}` }, name)]);
    return { title: "Compare two", body: h("p", { class: "lead" }, "Tick two rows of the ", lists, ".") };
  }
  const trail = h("p", { class: "trail" }, h("a", { href: `#/${kind}` }, kind === "policies" ? "Policies" : "Overview"));
  return { title: kind === "policies" ? "Two policies" : "Two sessions", trail, body: await KINDS[kind](ids, leaving) };
}
