// A book of invented clients to explore: the returns are the example's, moved to the months before this one.

import { get, post, remove, text, trained } from "./api.js";
import { csvRows } from "./csv.js";
import { h } from "./dom.js";
import { pressed } from "./form.js";
import { count } from "./format.js";
import { all } from "./pages.js";
import { isoDay, lastEnd } from "./periods.js";
import { EXAMPLE } from "./returns_field.js";

/** The tag of all that is invented. */
const TAG = "sample";
/** Returns in the record of a policy, and periods that it advises. */
const [RECORD, HORIZON] = [120, 12];
const MONTHS = RECORD + HORIZON;
/** The policies. The second market is the example's of as many months before. */
const POLICIES = [
  { name: "Sample: balanced", caution: "balanced" },
  { name: "Sample: bold", caution: "bold" },
  { name: "Sample: two markets", caution: "balanced", assets: ["Market A", "Market B"] },
];
/** The clients: by which policy, their wealth, periods reported, and months since the last of them. `last` changes their last report. */
const CLIENTS = [
  { name: "new client", policy: 0, wealth: 150_000, reported: 0, ago: 0 },
  { name: "up to date", policy: 0, wealth: 420_000, reported: 6, ago: 0 },
  { name: "up to date, a small account", policy: 0, wealth: 2000, reported: 6, ago: 0 },
  { name: "reported ten times the return", policy: 0, wealth: 80_000, reported: 6, ago: 0, last: ({ simple_return }) => ({ simple_return: 10 * simple_return }) },
  { name: "a large trade", policy: 0, wealth: 900_000, reported: 6, ago: 0, last: () => ({ executed_allocation: 0 }) },
  { name: "money came", policy: 1, wealth: 60_000, reported: 8, ago: 0, last: () => ({ flow: 25_000 }) },
  { name: "report is due", policy: 1, wealth: 300_000, reported: 5, ago: 1 },
  { name: "two reports are late", policy: 1, wealth: 1_400_000, reported: 4, ago: 2 },
  { name: "in the last month", policy: 1, wealth: 250_000, reported: HORIZON - 1, ago: 0 },
  { name: "completed", policy: 1, wealth: 75_000, reported: HORIZON, ago: 0 },
  { name: "two markets", policy: 2, wealth: 200_000, reported: 3, ago: 0 },
].map((client, index) => ({ ...client, name: `Sample ${index + 1}: ${client.name}` }));

/** Tells whether a session or a policy, as in its list, belongs to the book: a tag alone may be another's. */
const isOf = (entries) => ({ name, tags }) => tags.includes(TAG) && entries.some((entry) => entry.name === name);

/** Returns the last day of the month `ago` months before that of `day`. */
export function monthEnd(day, ago) {
  const [year, month] = day.split("-").map(Number);
  return new Date(Date.UTC(year, month - ago, 0)).toISOString().slice(0, 10);
}

/** Returns the offer of the book; `opened()` is called once it is there. */
export function sampleBook(leaving, opened) {
  const note = h("span", { class: "note", role: "status" }, ` ${count(CLIENTS.length)} invented clients, tagged \u201c${TAG}\u201d. None of it is advice.`);
  const button = h("button", { type: "button", class: "link", onclick: () => pressed(button, () => open(leaving, (words) => (note.textContent = ` ${words}`)).then(opened)) }, "Explore a sample book");
  return h("p", { "data-needs": "train" }, button, note);
}

/** Returns `{element, tell(entries)}`: what deletes the book, hidden unless the sessions listed have some of it; `deleted()` is called afterwards. */
export function sampleDeletion(leaving, deleted) {
  const button = h("button", { type: "button", class: "link", onclick: () => pressed(button, () => close(leaving, deleted)) }, "Delete the sample book");
  const element = h("p", { class: "note", "data-needs": "train", hidden: true }, `Clients tagged \u201c${TAG}\u201d are invented, and nothing shown for them is advice. `, button);
  return { element, tell: (entries) => (element.hidden = !entries.some(isOf(CLIENTS))) };
}

async function close(leaving, deleted) {
  const sessions = (await all(`/sessions?tag=${TAG}`, "sessions", leaving)).filter(isOf(CLIENTS));
  if (!confirm(`Delete the ${count(sessions.length)} invented clients, all their reports, and their policies?`)) return;
  for (const { session } of sessions) await remove(`/sessions/${session}`);
  for (const { policy } of (await all("/policies", "policies", leaving)).filter(isOf(POLICIES))) {
    await remove(`/policies/${policy}`).catch((error) => {
      // It stays for a client who is not of the book.
      if (error.type !== "/problems/in-use") throw error;
    });
  }
  deleted();
}

/** Returns the request that trains a policy of the book on `markets`, each the returns of as many months. */
function training({ name, caution, assets }, markets, rate_per_step) {
  const record = markets.map((returns) => returns.slice(0, RECORD).map((value) => Math.log1p(value)));
  const history = assets ? record[0].map((_, month) => assets.map((_, asset) => record[asset][month])) : record[0];
  const problem = { horizon: HORIZON, periods_per_year: 12, rate_per_step, history, caution, ...(assets ? { assets } : {}) };
  return { name, tags: [TAG], problem, design: { count: assets ? 10 : 20, initial_laws: "given" } };
}

async function open(leaving, tell) {
  if ((await get("/sessions?limit=1", leaving)).sessions.length > 0) throw new Error("There are sessions now: the sample book is for an empty server.");
  const [header, ...rows] = csvRows(await text(EXAMPLE), ",");
  const column = (name) => rows.map(({ cells }) => Number(cells[header.cells.indexOf(name)]));
  const market = column("market_return");
  const markets = [market.slice(-MONTHS), market.slice(-2 * MONTHS, -MONTHS)];
  const policies = [];
  for (const policy of POLICIES) {
    tell(`Training policy ${count(policies.length + 1)} of ${count(POLICIES.length)}\u2026`);
    policies.push(await trained(training(policy, markets, column("risk_free_return").at(-1)), leaving));
  }
  tell("Opening sessions\u2026");
  const clients = [];
  for (const { name, policy, wealth, ...client } of CLIENTS) {
    const { session } = await post("/sessions", { policy: policies[policy], name, tags: [TAG], wealth }, leaving);
    clients.push({ ...client, session, assets: POLICIES[policy].assets });
  }
  const end = lastEnd(12, isoDay(new Date()));
  for (let period = 1; period <= HORIZON; period += 1) {
    const report = ({ session, assets, reported, ago, last }) => {
      const back = ago + reported - period;
      const of = (index) => markets[index].at(-1 - back);
      const returns = assets ? { simple_returns: Object.fromEntries(assets.map((name, index) => [name, of(index)])) } : { simple_return: of(0) };
      const plain = { session, period, ...returns, date: monthEnd(end, back), confirm: true };
      return { ...plain, ...(period === reported ? last?.(plain) : {}) };
    };
    const reports = clients.filter(({ reported }) => reported >= period).map(report);
    tell(`Reporting month ${count(period)} of ${count(HORIZON)}\u2026`);
    const refused = reports.length > 0 && (await post("/observe", reports, leaving)).find(({ problem }) => problem);
    if (refused) throw new Error(refused.problem.detail);
  }
}
