// The letters of one client, of those ticked, or of all: the service writes them, and each is printed on a page of its own.

import { get, page } from "./api.js";
import { h } from "./dom.js";
import { firm, firmForm } from "./firm.js";
import { letterLinks } from "./letter_links.js";
import { count, counted, short } from "./format.js";
import { currency } from "./money.js";
import { called } from "./naming.js";
import { all } from "./pages.js";
import { isoDay } from "./periods.js";
import { keptSmallest, smallestWords } from "./trades.js";
import { isDue } from "./worklist.js";

/** Letters asked for at a time: what would change an advice is a heavy call. */
const AT_ONCE = 2;
/** Pauses before a refused call is sent again, in milliseconds. */
const PAUSES = [1000, 4000];
/** Letters are asked for again once nothing was typed for so long, in milliseconds. */
const TYPED = 600;
/** The filters of the overview that the letters follow. */
const FILTERS = ["search", "tag", "state"];
/** The states that only the page can tell, with the rule that a letter must meet. */
const KEEP = {
  trade: ({ trades }) => trades !== "Nothing",
  due: ({ session }) => isDue(session, isoDay(new Date())),
};

/** The one text that becomes elements is a letter of the service, which escapes all that it did not write. No script in it would run. */
const LETTERS = globalThis.trustedTypes?.createPolicy("ballast-letter", { createHTML: (text) => text }) ?? { createHTML: (text) => text };

/** Returns the name of a client on a letter. */
const recipient = ({ id, session }) => session.name || `Client ${short(id)}`;

/** Returns what the service is told of letters: what this browser keeps of the firm, the currency and the smallest trade, and the reader's day. */
function request() {
  const { name = "", closing = "", disclaimer = "", logo } = firm();
  const smallest = keptSmallest();
  return { firm: { name, closing, disclaimer, logo }, currency: currency() ?? undefined, smallest_trade: smallest ? { amount: smallest.money, share: smallest.share } : undefined, date: isoDay(new Date()) };
}

/** Returns what a link keeps of that: the letter has the day on which it is read, and no logo. */
function dress() {
  const { firm: { logo, ...rest }, date, ...others } = request();
  return { firm: rest, ...others };
}

/** Asks for a letter, again if the service is busy; at last for one without the sentence on what would change the advice. */
async function written(id, signal) {
  const path = `/sessions/${id}/letter`;
  for (const pause of PAUSES) {
    try {
      return await page(`${path}?sensitivity=true`, request(), signal);
    } catch (error) {
      if (signal.aborted || !error.passing) throw error;
      await new Promise((resolve) => setTimeout(resolve, pause));
    }
  }
  return page(path, request(), signal);
}

/** Returns a session and its letter `{id, session, trades, element}`, or `{id, name, refused}` if there is none. */
async function readAll(id, signal) {
  const session = await get(`/sessions/${id}`, signal);
  try {
    const { text, headers } = await written(id, signal);
    // The page has the style of letters, and refuses the document's own.
    const read = new DOMParser().parseFromString(LETTERS.createHTML(text.slice(text.indexOf("<article"))), "text/html");
    return { id, session, trades: headers.get("ballast-trades"), element: document.importNode(read.querySelector(".letter"), true) };
  } catch (error) {
    if (signal.aborted) throw error;
    return { id, name: session.name, refused: error.message };
  }
}

/** Returns `{now(), typed()}`: the one runs `work(signal)` at once, the other once nothing was typed for a while. Both abort the run before. */
function rewriting(work, leaving) {
  let [timer, running] = [0, new AbortController()];
  const now = () => {
    running.abort();
    running = new AbortController();
    work(AbortSignal.any([leaving, running.signal])).catch(() => {});
  };
  const typed = () => {
    clearTimeout(timer);
    timer = setTimeout(now, TYPED);
  };
  return { now, typed };
}

/** Returns the page of one session's letter. */
export async function ofSession(id, leaving) {
  const read = await readAll(id, leaving);
  if (read.refused) return { title: "No letter", trail: trail(), body: h("p", {}, `${read.refused} `, h("a", { href: `#/sessions/${id}` }, "See the session"), ".") };
  const holder = h("div", { class: "letters" }, read.element);
  const again = async (signal) => {
    const now = await readAll(id, signal);
    holder.replaceChildren(now.element ?? h("p", { class: "note wrong" }, now.refused));
  };
  const back = h("p", { class: "trail" }, h("a", { href: "#/sessions" }, "Overview"), " \u203a ", h("a", { href: `#/sessions/${id}` }, recipient(read)));
  return { title: `Letter to ${recipient(read)}`, trail: back, actions: printing(), body: [firmForm(rewriting(again, leaving).typed), warnings([read]), holder, await letterLinks(id, dress, leaving)] };
}

const trail = () => h("p", { class: "trail" }, h("a", { href: "#/sessions" }, "Overview"));

const printing = (disabled = false) => h("div", { class: "actions" }, h("button", { disabled, onclick: () => print() }, "Print"));

/** `query`: `sessions=A,B`, or the filters of the overview; without either all sessions. */
export async function view(query, leaving) {
  const asked = new URLSearchParams(query ?? "");
  const only = asked.get("state") ?? "";
  const entries = asked.has("sessions") ? asked.get("sessions").split(",").filter(Boolean).map((session) => ({ session })) : await listed(asked, leaving);
  // A completed session has a letter only if it is asked for.
  const wanted = entries.filter(({ state }) => only !== "" || state !== "completed");
  const ids = wanted.map(({ session }) => session);
  const left = entries.length - ids.length;
  const leftOut = left > 0 ? h("p", { class: "note" }, `${counted(left, "completed session is", "completed sessions are")} left out. Choose the state Completed in the overview for their letters.`) : "";
  if (ids.length === 0) return { title: "Letters", trail: trail(), body: [h("p", {}, "No session matches."), leftOut] };
  const line = h("p", { class: "note", role: "status" });
  const told = h("div", {});
  const holder = h("div", { class: "letters" });
  const actions = printing(true);
  const button = actions.querySelector("button");
  const writing = async (signal) => {
    button.disabled = true;
    actions.hidden = false;
    const letters = await fill(ids, { keep: KEEP[only] ?? (() => true), holder, line, told, leaving: signal });
    if (signal.aborted) return;
    actions.hidden = letters === 0;
    button.disabled = false;
  };
  const { now, typed } = rewriting(writing, leaving);
  now();
  return { title: "Letters", trail: trail(), actions, body: [firmForm(typed), leftOut, line, told, holder] };
}

/** Returns the sessions that match the filters, in the order of their names. */
function listed(asked, leaving) {
  const filters = FILTERS.map((name) => [name, asked.get(name) ?? ""]).filter(([name, value]) => value !== "" && !(name === "state" && value in KEEP));
  return all(`/sessions?${new URLSearchParams([...filters, ["sort", "name"]])}`, "sessions", leaving);
}

/** Reads all letters, a few at a time, shows each in its place, and names those that there are none of. Returns how many there are. */
async function fill(ids, { keep, holder, line, told, leaving }) {
  const places = ids.map(() => h("div", {}));
  holder.replaceChildren(...places);
  const writing = (done) => {
    line.textContent = `Writing the letters: ${count(done)} of ${count(ids.length)}\u2026`;
    holder.dataset.unfinished = `Not complete: printed when ${count(done)} of ${count(ids.length)} letters were written.`;
  };
  writing(0);
  const [found, failed] = [[], []];
  let [next, done] = [0, 0];
  const turn = async () => {
    while (next < ids.length && !leaving.aborted) {
      const at = next++;
      const one = await readAll(ids[at], leaving).catch((error) => ({ id: ids[at], refused: error.message }));
      if (leaving.aborted) return;
      if (one.refused) failed.push(one);
      else if (keep(one)) {
        places[at].replaceWith(one.element);
        found.push(one);
      }
      done += 1;
      writing(done);
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, turn));
  if (leaving.aborted) return found.length;
  delete holder.dataset.unfinished;
  line.textContent = `${counted(found.length, "letter")}. Each is printed on a page of its own.`;
  told.replaceChildren(warnings(found), ...failed.map(({ id, name, refused }) => h("p", { class: "note wrong" }, `No letter to ${called(id, name)}: ${refused}`)));
  return found.length;
}

/** Says on the screen what the adviser must know before sending: reports that are due, and trades left out. */
function warnings(found) {
  const today = isoDay(new Date());
  const late = found.filter(({ session }) => isDue(session, today));
  const due = late.length > 0 ? h("p", { class: "note wrong" }, `The report of ${late.map(recipient).join(", ")} is due, so the advice may change.`) : null;
  const small = smallestWords();
  return h("div", { class: "warnings" }, due, small ? h("p", { class: "note" }, `Trades below ${small} are left out, as in the overview.`) : null);
}
