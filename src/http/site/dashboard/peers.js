// Sessions whose last report differs from that of most sessions with the same policy and day: a slip, unless they follow different returns.

import { h } from "./dom.js";
import { count, counted, percent } from "./format.js";
import { called } from "./naming.js";
import { day } from "./periods.js";

/** Fewest reports that must agree before another is doubted, and log-returns that count as one: those of the service. */
const FEWEST = 2;
const ROUNDING = 1e-4;

/** Returns the sessions of `entries` that differ from their peers, each with its return, `own`, and theirs, which `agree` of `all` reported. */
export function unlikePeers(entries) {
  const found = new Map();
  for (const one of [...groupsOf(entries).values()].flatMap(different)) if (!found.has(one.entry)) found.set(one.entry, one);
  return [...found.values()];
}

/** Returns those of `reports` that differ from what most `sessions` with the policy reported for the day, as above. Each has the fields of its session's row. */
export function unlikeRecorded(reports, sessions) {
  const recorded = new Map([...groupsOf(sessions)].map(([key, group]) => [key, { ...most(group), all: group.length + 1 }]));
  const differs = ([key, [{ entry, log_return }]]) => {
    const { agree, theirs, all } = recorded.get(key) ?? { agree: 0 };
    return isMajority(agree, all) && Math.abs(log_return - theirs) > ROUNDING ? [unlike(entry, log_return, theirs, agree, all)] : [];
  };
  return reports.flatMap((report) => [...groupsOf([report])].flatMap(differs).slice(0, 1));
}

/** Says what most sessions with the policy reported, where one differs. */
export const unlikeWords = ({ entry, own, theirs, agree, all }) => `${count(agree)} of ${counted(all, "session")} with its policy reported ${percent(theirs, 2)} for ${day(entry.date)}, but this is ${percent(own, 2)}.`;

/** Returns the returns reported for each policy, day and asset, with the sessions. */
function groupsOf(entries) {
  const groups = new Map();
  for (const entry of entries) {
    if (!entry.date) continue;
    for (const [asset, log_return] of Object.entries(entry.log_returns ?? { "": entry.log_return })) {
      if (typeof log_return !== "number") continue;
      const key = JSON.stringify([entry.policy, entry.date, asset]);
      const group = groups.get(key) ?? [];
      group.push({ entry, log_return });
      groups.set(key, group);
    }
  }
  return groups;
}

const isMajority = (agree, all) => agree >= FEWEST && 2 * agree > all;
const unlike = (entry, own, theirs, agree, all) => ({ entry, own: Math.expm1(own), theirs: Math.expm1(theirs), agree, all });

/** Returns the return that most reports of a group agree on, and how many do. */
function most(reports) {
  const sorted = reports.map(({ log_return }) => log_return).sort((one, other) => one - other);
  let [agree, first, end] = [0, 0, 0];
  for (let start = 0; start < sorted.length; start += 1) {
    while (end < sorted.length && sorted[end] - sorted[start] <= ROUNDING) end += 1;
    if (end - start > agree) [agree, first] = [end - start, start];
  }
  return { agree, theirs: sorted[first + Math.floor(agree / 2)] };
}

/** Returns the reports of a group that differ from what most of them say; none if no return has a majority. */
function different(reports) {
  const { agree, theirs } = most(reports);
  if (!isMajority(agree, reports.length)) return [];
  return reports.filter(({ log_return }) => Math.abs(log_return - theirs) > ROUNDING).map(({ entry, log_return }) => unlike(entry, log_return, theirs, agree, reports.length));
}

/** Names the sessions `found` unlike their peers, which `show` lists. */
export function unlikeLine(found, show) {
  if (found.length === 0) return "";
  const [{ entry, own, theirs, agree, all }] = found;
  const others = found.length > 1 ? `, and ${counted(found.length - 1, "other session differs", "other sessions differ")} too` : "";
  return h("p", {}, `${called(entry.session, entry.name)} reported ${percent(own, 2)} for ${day(entry.date)}, where ${count(agree)} of ${counted(all, "session")} with its policy reported ${percent(theirs, 2)}${others}. `,
    h("button", { class: "link", onclick: () => show("unlike") }, "Show which"));
}
