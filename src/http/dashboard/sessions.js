// Sessions: the investors who live by a policy.

import { h, table } from "./dom.js";
import { count, moment, short, wealth } from "./format.js";
import { foot, Pages } from "./pages.js";
import { ticking } from "./ticking.js";

export async function view(_, leaving) {
  const pages = new Pages("/sessions", "sessions", leaving);
  const entries = await pages.next();
  const actions = h("a", { class: "button", href: "#/sessions/new" }, "Open a session");
  const lead =
    "No session yet. A session is one investor who lives by a policy: report each return as it comes, and read what to hold next.";
  if (entries.length === 0) return { title: "Sessions", actions, body: h("p", { class: "lead" }, lead) };
  const ticks = ticking("sessions");
  const holder = h("div", {}, listed(entries, ticks));
  const add = (older) => {
    entries.push(...older);
    holder.replaceChildren(listed(entries, ticks));
  };
  return { title: "Sessions", actions, body: [ticks.link, holder, foot(pages, ["session", "sessions"], entries.length, add)] };
}

function listed(entries, ticks) {
  return table(
    "Sessions, newest first",
    [
      {
        name: "Session",
        cell: ({ session }) => [
          ticks.box(session, `session ${short(session)}`),
          h("a", { href: `#/sessions/${session}` }, h("code", {}, short(session))),
        ],
      },
      { name: "State", cell: ({ state }) => h("span", { class: `state ${state}` }, state) },
      { name: "Observed", numeric: true, cell: ({ period, horizon }) => `${count(period - 1)} of ${count(horizon)}` },
      { name: "Initial wealth", numeric: true, cell: ({ initial_wealth }) => wealth(initial_wealth) },
      { name: "Policy", cell: ({ policy }) => h("a", { href: `#/policies/${policy}` }, h("code", {}, short(policy))) },
      { name: "Opened", cell: ({ created_ms }) => moment(created_ms) },
    ],
    entries,
  );
}
