// The rows of the overview, one session each, in the order that was chosen, and how many there are.

import { care } from "./care.js";
import { h, table } from "./dom.js";
import { allocation, count, counted, percent, short } from "./format.js";
import { inCurrency } from "./money.js";
import { called, headed, tagList } from "./naming.js";
import { isoDay, nearDay } from "./periods.js";
import { keepOrder, orderOf, TO_DO, WORK } from "./worklist.js";

/** Names the sessions that are damaged in the store. */
const damagedWords = (damaged) => (damaged.length === 0 ? "" : `. Damaged; ask an operator to restore: ${damaged.join(", ")}`);

/**
 * Returns the rows of the pages read so far, what stands around them, and what changes them. `first` is the first page, or null; `ask(changed)`
 * reads the list in another order, and `changed()` is called when there are other rows.
 */
export function sessionRows(chosen, { first, advice, ticks, ask, changed }) {
  const [tags, known] = [h("datalist", { id: "tags" }), new Set()];
  const holder = h("div", { class: "listing", onkeydown: moveBetweenRows });
  const line = h("p", { class: "note", role: "status" });
  const ordered = h("p", { class: "note ordered" });
  const more = h("button", { class: "quiet" }, "Show more");
  let [entries, damaged, page, total, sorted] = [[], [], first, null, orderOf(chosen)];
  const sort = (column) => {
    const kept = holder.contains(document.activeElement);
    const down = column !== "name";
    const [one, other] = down ? [`-${column}`, column] : [column, `-${column}`];
    const order = sorted === one ? other : one;
    if (!(chosen.state in WORK)) keepOrder(order);
    ask({ sort: order }).then(() => kept && holder.querySelector("[aria-sort] button")?.focus());
  };
  const draw = () => holder.replaceChildren(entries.length > 0 ? listed(entries, { ticks, advice, sorted, sort }) : h("p", {}, "No session matches."));
  const putFirst = () => {
    keepOrder(TO_DO);
    ask({ sort: TO_DO });
  };
  const tellLine = () => {
    if (total !== null) more.hidden ||= entries.length + damaged.length >= total;
    line.textContent = `${count(entries.length)} of ${total === null ? "\u2026" : count(total)}${damagedWords(damaged)}`;
  };
  return {
    tags,
    holder,
    ordered,
    more,
    foot: h("div", { class: "foot" }, line, more),
    /** Shows another page below those shown. */
    add(now) {
      page = now;
      entries.push(...page.sessions);
      damaged.push(...page.damaged);
      for (const tag of page.sessions.flatMap(({ tags }) => tags)) known.add(tag);
      tags.replaceChildren(...[...known].sort().map((value) => h("option", { value })));
      draw();
      ticks.drawn(entries.map(({ session }) => session));
      more.hidden = page.next === null;
      changed();
      tellLine();
    },
    redraw: draw,
    /** Forgets the rows; those shown stay until others are added. */
    clear: () => ([entries, damaged, total] = [[], [], null]),
    tellTotal(now) {
      total = now;
      tellLine();
    },
    tellOrder(order) {
      sorted = order;
      ordered.replaceChildren(sorted === TO_DO ? "What is to be done stands first: trades, the biggest first, then reports that are due." : h("button", { class: "link", onclick: putFirst }, "Put first what is to be done"));
    },
    progress: (done, all) => (line.textContent = done < all ? `Reading the advice: ${count(done)} of ${count(all)}\u2026` : ""),
    failed(error) {
      if (error.name !== "AbortError") line.textContent = error.message;
    },
    /** Counts the sessions shown that are in a situation that the policy was not trained for. */
    outside: () => entries.filter(advice.isOutside).length,
    /** The sessions shown. */
    get entries() {
      return entries;
    },
    /** Tells whether the page read last has no session. */
    isEmpty: () => isEmpty(page),
    /** The page read last. */
    get page() {
      return page;
    },
  };
}

/** Tells whether a page of the list has no session. */
export const isEmpty = ({ sessions, damaged }) => sessions.length + damaged.length === 0;

/** Moves the focus with the arrow keys, Home and End to the same control of another row. */
function moveBetweenRows(event) {
  const row = event.target.closest("tbody tr");
  const rows = row ? [...row.parentElement.children] : [];
  const at = { ArrowDown: rows.indexOf(row) + 1, ArrowUp: rows.indexOf(row) - 1, Home: 0, End: rows.length - 1 }[event.key];
  if (at === undefined || !rows[at] || event.altKey || event.ctrlKey || event.metaKey) return;
  const controls = (one) => [...one.querySelectorAll("a, input")];
  event.preventDefault();
  controls(rows[at])[controls(row).indexOf(event.target)]?.focus();
}

function listed(entries, { ticks, advice, sorted, sort }) {
  const by = (words, column) => {
    const [up, down] = [sorted === column, sorted === `-${column}`];
    const mark = up ? "\u2191" : down ? "\u2193" : "";
    const button = h("button", { class: "link sorting", onclick: () => sort(column) }, words, h("span", { "aria-hidden": "true" }, ` ${mark}`));
    return { name: button, label: words, sorted: up ? "ascending" : down ? "descending" : null };
  };
  // The identifier tells apart those of one name.
  const isAlone = (name) => name !== "" && entries.filter((other) => other.name === name).length === 1;
  return table("Sessions", [
    {
      ...by("Session", "name"),
      cell: ({ session, name, tags }) =>
        h(
          "div",
          { class: "ticked" },
          ticks.box(session, `session ${called(session, name)}`),
          h("div", {}, isAlone(name) ? h("a", { href: `#/sessions/${session}`, title: short(session) }, name) : headed(`#/sessions/${session}`, session, name), " ", tagList(tags)),
        ),
    },
    { ...by("Wealth", "wealth"), numeric: true, cell: ({ wealth: now }) => (now === null ? "\u2013" : inCurrency(now)) },
    { name: "Held now", numeric: true, cell: ({ holding }) => (holding === null ? "\u2013" : allocation(holding)) },
    { name: "Last return", numeric: true, cell: lastReturn },
    { ...by("Last report", "last_report"), cell: (entry) => lastReport(entry, care(entry)) },
    { name: "To hold", numeric: true, cell: (entry) => advice.of(entry).hold },
    { ...by("To trade", "trade"), numeric: true, cell: (entry) => advice.of(entry).trade },
    { name: "State", cell: (entry) => standing(entry) },
    { ...by("Opened", "created"), cell: ({ created_ms, policy, policy_name }) => [nearMoment(created_ms), " ", h("span", { class: "under" }, "by ", h("a", { href: `#/policies/${policy}` }, called(policy, policy_name)))] },
  ], entries);
}

/** Returns the return of what is held in the last period: the change of wealth would count money that came or went as a gain or a loss. */
function lastReturn({ log_return }) {
  if (log_return === null || log_return === undefined) return "\u2013";
  return `${log_return > 0 ? "+" : ""}${percent(Math.expm1(log_return), 2)}`;
}

const near = (date) => nearDay(date, isoDay(new Date()));
const nearMoment = (milliseconds) => near(isoDay(new Date(milliseconds)));

/** Shows the last day reported, and when the next report is due or how late it is. */
function lastReport({ date, last_report_ms }, { next, late }) {
  const under = (words, wrong) => [" ", h("span", { class: wrong ? "under wrong" : "under" }, words)];
  const reported = date ? near(date) : last_report_ms ? nearMoment(last_report_ms) : "None yet";
  const coming = late > 0 ? under(`overdue by ${counted(late, "day")}`, true) : next === null ? null : under(`next ${date ? "" : "about "}${near(next)}`);
  return [reported, last_report_ms && !date ? under("without a date") : null, coming];
}

/** Shows the state of a session, its progress, and what needs care. */
function standing({ state, period, horizon, drift, care }) {
  const drifting = { warning: "Market may have changed", alarm: "Market has changed" }[drift];
  const wrong = [state === "waiting" && "for its next policy", care.includes("ending") && state === "active" && "In its last period", drifting].filter(Boolean);
  return [
    h("span", { class: `state ${state}` }, state),
    " ",
    h("span", { class: "under" }, `${count(period - 1)} of ${count(horizon)}`),
    wrong.map((words) => [" ", h("span", { class: "under wrong" }, words)]),
  ];
}
