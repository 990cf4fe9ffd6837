// What is to be done in all sessions: who trades and how much in all, and whose report is due. The service does not
// know the advice of a list, so the page requests it for each session.

import { h } from "./dom.js";
import { count, counted, wealth } from "./format.js";
import { called } from "./naming.js";
import { all } from "./pages.js";
import { day, isoDay } from "./periods.js";
import { save } from "./picture.js";
import { ordersText, sums } from "./trades.js";

/** Up to this many sessions the trades are added up without being asked. */
const AUTOMATIC = 500;
/** Most sessions named in an address. */
const NAMED = 200;
/** The states that only the page can tell. */
export const WORK = { trade: "Has a trade", due: "Report is due" };

/** Returns the order of a list; those with a trade start with the biggest one. */
export const orderOf = ({ state, sort }) => sort || (state === "trade" ? "-trade" : "-created");

/** Tells whether the page must read all sessions for a list, because the service cannot choose or sort them. */
export const isWork = (chosen) => chosen.state in WORK || orderOf(chosen).endsWith("trade");

/** Tells whether the report of a session is due: its period has ended. */
const isDue = ({ state, next }, today) => state === "active" && Boolean(next) && next <= today;

/** Returns `{element, page(chosen, start, signal), look(chosen, total), redraw()}`. `page` returns a page of a list of work from place `start`
 * as the service returns others, and calls `progress(done, all)` meanwhile. `look` adds up the sessions that match search and tag. */
export function worklist({ advice, size, show, progress, leaving }) {
  const element = h("div", { class: "work", role: "status" });
  const note = h("span", { class: "note", role: "status" });
  let [list, book, looking, isWanted] = [[], null, new AbortController(), false];
  leaving.addEventListener("abort", () => looking.abort());
  const matching = ({ search, tag, state }, sort, signal) => {
    const query = new URLSearchParams(Object.entries({ search, tag, state: state in WORK ? "" : state, sort }).filter(([, value]) => value));
    return all(`/sessions?${query}`, "sessions", signal);
  };
  const sizeOf = (entry) => sums(advice.trades(entry) ?? []).size;
  const read = async (chosen, signal) => {
    const order = orderOf(chosen);
    const byTrade = order.endsWith("trade");
    const today = isoDay(new Date());
    const keep = { trade: (entry) => sizeOf(entry) > 0, due: (entry) => isDue(entry, today) }[chosen.state] ?? (() => true);
    const found = await matching(chosen, byTrade ? "" : order, signal);
    if (byTrade || chosen.state === "trade") await advice.read(found, { signal, progress: (done) => progress(done, found.length) });
    const kept = found.filter(keep);
    const way = order.startsWith("-") ? -1 : 1;
    return byTrade ? kept.map((entry) => [sizeOf(entry), entry]).sort(([one], [other]) => way * (one - other)).map(([, entry]) => entry) : kept;
  };
  const page = async (chosen, start, signal) => {
    if (start === null) list = await read(chosen, signal);
    const from = Number(start ?? 0);
    return { sessions: list.slice(from, from + size), damaged: [], next: list.length > from + size ? String(from + size) : null, total: list.length };
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
    if (book !== null) element.replaceChildren(...lines(book, { advice, show, note }));
  };
  return { element, page, look, redraw };
}

function lines(book, { advice, show, note }) {
  const traded = book.map((entry) => ({ entry, trades: advice.trades(entry) ?? [] })).map((one) => ({ ...one, ...sums(one.trades) }));
  const found = traded.filter(({ size }) => size > 0).sort((one, other) => other.size - one.size);
  const today = isoDay(new Date());
  const due = book.filter((entry) => isDue(entry, today));
  const small = traded.reduce((sum, { trades }) => sum + trades.filter((trade) => trade.small).length, 0);
  const refused = book.filter((entry) => advice.failure(entry) !== undefined);
  const part = (verb) => {
    const some = found.filter((one) => one[verb] > 0);
    return some.length === 0 ? [] : [[`${verb} `, h("b", {}, wealth(some.reduce((sum, one) => sum + one[verb], 0))), ` in ${count(some.length)}`]];
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
  return [trades, left.length > 0 ? h("p", { class: "note" }, left.join(" ")) : "", dueLine(due, show)].filter(Boolean);
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
