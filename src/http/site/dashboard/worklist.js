// What is to be done in all sessions: who trades and how much in all, and whose report is due. The service does not
// know the advice of a list, so the page requests it for each session.

import { get } from "./api.js";
import { h } from "./dom.js";
import { count, counted } from "./format.js";
import { inCurrency } from "./money.js";
import { called } from "./naming.js";
import { all } from "./pages.js";
import { unlikeLine, unlikePeers } from "./peers.js";
import { day, isoDay } from "./periods.js";
import { save } from "./picture.js";
import { ordersText, sums } from "./trades.js";

/** Up to this many sessions the trades are added up without being asked. */
const AUTOMATIC = 500;
/** Up to this many sessions stand in the order of what is to be done without being asked: the list waits for the advice of all. */
const ORDERED = 200;
/** Most sessions named in an address. */
const NAMED = 200;
/** The states that only the page can tell. */
export const WORK = { trade: "Has a trade", due: "Report is due", unlike: "Reported unlike its peers" };

/** What is to be done first: trades, the biggest first, then reports that are due. */
export const TO_DO = "work";
/** Where the browser keeps another order of its user. */
const PLACE = "ballast-order";
/** The orders that are kept: those of the service, which need no advice. */
const KEPT = /^-?(name|wealth|last_report|created)$/;
const keptOrder = () => KEPT.exec(localStorage.getItem(PLACE) ?? "")?.[0] ?? null;

/** Keeps an order for the next visits of this browser; what is to be done first is kept by dropping any other. */
export function keepOrder(order) {
  if (KEPT.test(order)) localStorage.setItem(PLACE, order);
  else if (order === TO_DO) localStorage.removeItem(PLACE);
}

/** Returns the order of a list; those with a trade start with the biggest one. */
export const orderOf = ({ state, sort }) => sort || (state === "trade" ? "-trade" : (keptOrder() ?? TO_DO));

/** Tells whether the page must read all sessions for a list, because the service cannot choose or sort them. */
export const isWork = (chosen) => chosen.state in WORK || orderOf(chosen).endsWith("trade") || orderOf(chosen) === TO_DO;

/** Tells whether the report of a session is due: its period has ended. */
export const isDue = ({ state, next }, today) => state === "active" && Boolean(next) && next <= today;

/** Sorts entries by what is to be done: trades by `sizeOf`, the biggest first, then reports by how long they are due, then the others as they are. */
export function toDo(entries, sizeOf, today) {
  const ranked = entries.map((entry) => ({ entry, size: sizeOf(entry), due: isDue(entry, today) ? entry.next : "9999" }));
  const byDay = (one, other) => (one < other ? -1 : Number(one > other));
  return ranked.sort((one, other) => other.size - one.size || byDay(one.due, other.due)).map(({ entry }) => entry);
}

/** Returns `{element, page(chosen, start, signal), look(chosen, total), redraw()}`. `warned(isWarned)` is told whether a report unlike others is named. `page` returns a page of a list of work from place `start`
 * as the service returns others, with `damaged` sessions, and calls `progress(done, all)` meanwhile; it returns null if so many sessions are
 * put in the order of what is to be done only if asked. `look` adds up the sessions that match search and tag. */
export function worklist({ advice, size, show, progress, warned, leaving }) {
  const element = h("div", { class: "work", role: "status" });
  const note = h("span", { class: "note", role: "status" });
  let [list, damaged, book, looking, isWanted, isLarge] = [[], [], null, new AbortController(), false, false];
  leaving.addEventListener("abort", () => looking.abort());
  const queryOf = ({ search, tag, state }, more) => new URLSearchParams(Object.entries({ search, tag, state: state in WORK ? "" : state, ...more }).filter(([, value]) => value));
  const matching = (chosen, sort, signal) => all(`/sessions?${queryOf(chosen, { sort })}`, "sessions", signal);
  const sizeOf = (entry) => sums(advice.trades(entry) ?? []).size;
  /** Reads all matching sessions, or returns null if they are too many to be ordered without being asked. */
  const found = async (chosen, order, signal) => {
    damaged = [];
    if (order !== TO_DO) return matching(chosen, order.endsWith("trade") ? "" : order, signal);
    // Of a large book a part is not ordered either: its advice is not known, and the list would wait.
    if (isLarge && chosen.sort !== TO_DO) return null;
    const first = await get(`/sessions?${queryOf(chosen, { limit: ORDERED })}`, signal);
    damaged = first.damaged;
    if (first.next === null) return first.sessions;
    isLarge = true;
    return chosen.sort === TO_DO ? matching(chosen, "", signal) : null;
  };
  const read = async (chosen, signal) => {
    const order = orderOf(chosen);
    const byTrade = order.endsWith("trade");
    const today = isoDay(new Date());
    const all = await found(chosen, order, signal);
    if (all === null) return null;
    const unlike = new Set(unlikePeers(all).map(({ entry }) => entry));
    const keep = { trade: (entry) => sizeOf(entry) > 0, due: (entry) => isDue(entry, today), unlike: (entry) => unlike.has(entry) }[chosen.state] ?? (() => true);
    if (byTrade || order === TO_DO || chosen.state === "trade") await advice.read(all, { signal, progress: (done) => progress(done, all.length) });
    const kept = all.filter(keep);
    if (order === TO_DO) return toDo(kept, sizeOf, today);
    const way = order.startsWith("-") ? -1 : 1;
    return byTrade ? kept.map((entry) => [sizeOf(entry), entry]).sort(([one], [other]) => way * (one - other)).map(([, entry]) => entry) : kept;
  };
  const page = async (chosen, start, signal) => {
    if (start === null) list = await read(chosen, signal);
    if (list === null) return null;
    const from = Number(start ?? 0);
    return { sessions: list.slice(from, from + size), damaged: start === null ? damaged : [], next: list.length > from + size ? String(from + size) : null, total: list.length + damaged.length };
  };
  const look = async (chosen, total) => {
    looking.abort();
    looking = new AbortController();
    const { signal } = looking;
    if (total > AUTOMATIC && !isWanted) {
      const want = () => {
        isWanted = true;
        look(chosen, total);
      };
      book = null;
      warned(false);
      return element.replaceChildren(h("p", {}, h("button", { class: "link", onclick: want }, `Add up the trades of the ${count(total)} sessions`)));
    }
    try {
      const found = await matching({ ...chosen, state: "" }, "", signal);
      if (total > AUTOMATIC) element.replaceChildren(h("p", {}, `Reading the advice of ${counted(found.length, "session")}\u2026`));
      await advice.read(found, { signal });
      book = found;
      note.textContent = "";
      redraw();
    } catch (error) {
      if (error.name !== "AbortError") element.replaceChildren(h("p", { class: "error" }, error.message));
    }
  };
  const redraw = () => {
    if (book === null) return;
    const unlike = unlikePeers(book);
    element.replaceChildren(...lines(book, { advice, show, note, unlike }));
    warned(unlike.length > 0);
  };
  return { element, page, look, redraw };
}

function lines(book, { advice, show, note, unlike }) {
  const traded = book.map((entry) => ({ entry, trades: advice.trades(entry) ?? [] })).map((one) => ({ ...one, ...sums(one.trades) }));
  const found = traded.filter(({ size }) => size > 0).sort((one, other) => other.size - one.size);
  const today = isoDay(new Date());
  const due = book.filter((entry) => isDue(entry, today));
  const small = traded.reduce((sum, { trades }) => sum + trades.filter((trade) => trade.small).length, 0);
  const refused = book.filter((entry) => advice.failure(entry) !== undefined);
  const part = (verb) => {
    const some = found.filter((one) => one[verb] > 0);
    return some.length === 0 ? [] : [[`${verb} `, h("b", {}, inCurrency(some.reduce((sum, one) => sum + one[verb], 0))), ` in ${count(some.length)}`]];
  };
  const parts = [...part("buy"), ...part("sell")];
  const late = found.filter(({ entry }) => isDue(entry, today)).length;
  const left = [
    late > 0 && `${counted(late, "of these sessions lacks", "of these sessions lack")} the report that is due, so the trade may change.`,
    small > 0 && `${counted(small, "trade is", "trades are")} too small and left out.`,
    refused.length > 0 && `${counted(refused.length, "session has", "sessions have")} no advice now and ${refused.length === 1 ? "is" : "are"} left out: ${refused.slice(0, 5).map(({ session, name }) => called(session, name)).join(", ")}${refused.length > 5 ? " and others" : ""}.`,
  ].filter(Boolean);
  const saved = () => {
    save(ordersText(found), `orders-${today}.csv`, "text/csv");
    const orders = found.reduce((sum, { trades }) => sum + trades.filter((trade) => !trade.small).length, 0);
    note.textContent = `Saved ${counted(orders, "order")} of ${counted(found.length, "session")}.`;
  };
  const trades = found.length === 0
    ? h("p", {}, `None of ${counted(book.length, "session")} has a trade.`)
    : h("p", {}, `${count(found.length)} of ${counted(book.length, "session")} ${found.length === 1 ? "has" : "have"} a trade: `, parts.map((one, index) => [index > 0 ? ", " : "", one]), ". ",
        h("button", { class: "link", onclick: () => show("trade") }, "Show the trades"), " ", h("button", { class: "link", onclick: saved }, "Save orders as CSV"), " ", note);
  return [trades, left.length > 0 ? h("p", { class: "note" }, left.join(" ")) : "", dueLine(due, show), unlikeLine(unlike, show)].filter(Boolean);
}

/** Says whose report is due, and leads to it. */
function dueLine(due, show) {
  if (due.length === 0) return "";
  const days = [...new Set(due.map(({ next }) => next))];
  const until = days.length === 1 ? ` to ${day(days[0])}` : "";
  const ids = due.slice(0, NAMED).map(({ session }) => session);
  return h("p", {}, `The report${until} of ${counted(due.length, "session")} is due. `,
    h("button", { class: "link", onclick: () => show("due") }, "Show whose"), " ",
    h("a", { href: `#/report?sessions=${ids.join(",")}` }, due.length > NAMED ? `Report for the first ${count(NAMED)}` : `Report for the ${count(due.length)}`));
}
