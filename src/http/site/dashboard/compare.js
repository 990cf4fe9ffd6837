// Two to four policies or sessions side by side.

import { MOST, numbered } from "./beside.js";
import { policiesBeside } from "./compare_policies.js";
import { sessionsBeside } from "./compare_sessions.js";
import { h } from "./dom.js";

const KINDS = { policies: policiesBeside, sessions: sessionsBeside };

/** `query`: `policies=A,B` or `sessions=A,B`, with up to four of them. */
export async function view(query, leaving) {
  const asked = new URLSearchParams(query ?? "");
  const kind = Object.keys(KINDS).find((name) => asked.has(name));
  const ids = (asked.get(kind) ?? "").split(",").filter(Boolean);
  if (!kind || ids.length < 2 || ids.length > MOST) {
    const lists = Object.keys(KINDS).map((name, index) => [index > 0 ? " or of the " : "", h("a", { href: `#/${name}` }, name)]);
    return { title: "Compare", body: h("p", { class: "lead" }, `Tick two to ${numbered(MOST)} rows of the `, lists, ".") };
  }
  const trail = h("p", { class: "trail" }, h("a", { href: `#/${kind}` }, kind === "policies" ? "Policies" : "Overview"));
  const size = numbered(ids.length);
  return { title: `${size[0].toUpperCase()}${size.slice(1)} ${kind}`, trail, body: await KINDS[kind](ids, leaving) };
}
