// Sessions, one investor a row: who must trade and how much, whose report is due, who needs care, and where each stands.

import { advising } from "./advise.js";
import { advised } from "./advised.js";
import { get, remove } from "./api.js";
import { care, careWords } from "./care.js";
import { h, table } from "./dom.js";
import { input, pressed, select } from "./form.js";
import { allocation, count, counted, short, wealth } from "./format.js";
import { holderWords } from "./holder.js";
import { jobList } from "./jobs.js";
import { called, headed, tagList } from "./naming.js";
import { all } from "./pages.js";
import { isoDay, nearDay } from "./periods.js";
import { ticking } from "./ticking.js";
import { smallestField } from "./trades.js";
import { welcome } from "./welcome.js";
import { isWork, orderOf, WORK, worklist } from "./worklist.js";

/** Rows shown at a time: the advice of each needs a call of its own. */
const PAGE = 50;
/** Most sessions renewed together, so that the address is not too long. */
const RENEWED = 200;
/** Pause in typing before the search is sent, in milliseconds. */
const PAUSE = 250;
const STATES = { "": "All", ...WORK, active: "Active", waiting: "Waits for its next policy", completed: "Completed", care: "Needs care", overdue: "Overdue", alarm: "Market has changed", ending: "Completed, or in the last period" };
/** The parameters of the address, with their defaults. */
const CHOICES = { search: "", tag: "", state: "", sort: "" };

export async function view(_, leaving) {
  const said = new URLSearchParams(location.hash.split("?")[1] ?? "");
  const chosen = Object.fromEntries(Object.entries(CHOICES).map(([name, blank]) => [name, said.get(name) ?? blank]));
  if (!(chosen.state in STATES)) chosen.state = "";
  const several = h("a", { class: "button quiet", href: "#/report" }, "Report for several");
  const now = h("a", { class: "button quiet", href: "#/advise" }, "Advice now");
  const actions = h("div", { class: "actions" }, now, several, h("a", { class: "button", href: "#/sessions/new" }, "Open a session"));
  const first = isWork(chosen) ? null : await read(chosen, null, leaving);
  const title = "Overview";
  if (first && isEmpty(first) && !filtered(chosen)) {
    const [{ policies }, { jobs }] = await Promise.all(["/policies?limit=1", "/jobs?limit=1"].map((path) => get(path, leaving)));
    const who = await holderWords(leaving);
    if (policies.length > 0) return { title, actions, body: [lead(), who] };
    return { title, body: [...(jobs.length > 0 ? [lead(), jobList(jobs, leaving).element] : [welcome(advising(leaving))]), who] };
  }
  return { title, actions, body: overview(chosen, first, leaving) };
}

const lead = () =>
  h(
    "p",
    { class: "lead" },
    "No session yet. A session is one investor who follows a policy: report each return as it comes, and read what to hold next.",
  );

/** Names the sessions that are damaged in the store. */
const damagedWords = (damaged) => (damaged.length === 0 ? "" : `. Damaged; ask an operator to restore: ${damaged.join(", ")}`);

const filtered = ({ search, tag, state }) => Boolean(search || tag || state);

/** Returns the entries of `chosen` that differ from the defaults. */
const differing = (chosen) => Object.entries(chosen).filter(([name, value]) => value !== CHOICES[name]);

const isEmpty = ({ sessions, damaged }) => sessions.length + damaged.length === 0;

/** Reads a page of matching sessions, without counting them: rows are shown before all sessions are read. */
function read(chosen, after, signal) {
  const query = new URLSearchParams([["limit", PAGE], ...differing(chosen), ...(after === null ? [] : [["after", after]])]);
  return get(`/sessions?${query}`, signal);
}

/** Counts the matching sessions. */
async function readTotal({ sort, ...which }, signal) {
  const { total } = await get(`/sessions?${new URLSearchParams([["limit", 1], ["count", "total"], ...differing(which)])}`, signal);
  return total;
}

/** `first` is the first page, or null if the page must read all sessions for it. */
function overview(chosen, first, leaving) {
  const needs = h("p", { class: "note needs", role: "status" });
  const beyond = h("span", {});
  const smallest = smallestField(() => {
    advice.redraw();
    work.redraw();
    if (isWork(chosen)) ask({});
  });
  const advice = advised(leaving, { changed: () => tellBeyond(), smallest: smallest.smallest });
  const choose = (state) => {
    control.value = state;
    ask({ state, sort: "" });
  };
  const progress = (done, all) => (line.textContent = done < all ? `Reading the advice: ${count(done)} of ${count(all)}\u2026` : "");
  const work = worklist({ advice, size: PAGE, show: choose, progress, leaving });
  const ticks = ticking("sessions", {
    links: [
      { at: "#/report", words: (ticked) => `Report for the ${count(ticked)}` },
      { at: "#/renew", words: (ticked) => `Continue the ${count(ticked)}` },
    ],
    asked: (ticked) => `Delete ${counted(ticked, "session")} and all their reports?`,
    remove: (id) => remove(`/sessions/${id}`),
    removed: async () => {
      await Promise.all([ask({}), judgeAll()]);
      if (isEmpty(page) && !filtered(chosen)) dispatchEvent(new HashChangeEvent("hashchange"));
    },
  });
  const tags = h("datalist", { id: "tags" });
  const known = new Set();
  const holder = h("div", { class: "listing", onkeydown: moveBetweenRows });
  const line = h("p", { class: "note", role: "status" });
  const more = h("button", { class: "quiet" }, "Show more");
  let [entries, damaged, page, total, asking] = [[], [], first, null, new AbortController()];
  leaving.addEventListener("abort", () => asking.abort());
  const tellBeyond = () => (beyond.textContent = outsideWords(entries.filter(advice.isOutside).length));
  const sort = (column) => {
    const kept = holder.contains(document.activeElement);
    const down = column !== "name";
    const [one, other] = down ? [`-${column}`, column] : [column, `-${column}`];
    ask({ sort: orderOf(chosen) === one ? other : one }).then(() => kept && holder.querySelector("[aria-sort] button")?.focus());
  };
  const add = (now) => {
    page = now;
    entries.push(...page.sessions);
    damaged.push(...page.damaged);
    for (const tag of page.sessions.flatMap(({ tags }) => tags)) known.add(tag);
    tags.replaceChildren(...[...known].sort().map((value) => h("option", { value })));
    holder.replaceChildren(entries.length > 0 ? listed(entries, { ticks, advice, sorted: orderOf(chosen), sort }) : h("p", {}, "No session matches."));
    ticks.drawn(entries.map(({ session }) => session));
    more.hidden = page.next === null;
    tellBeyond();
    tellTotal();
  };
  const tellTotal = () => {
    if (total !== null) more.hidden ||= entries.length + damaged.length >= total;
    line.textContent = `${count(entries.length)} of ${total === null ? "\u2026" : count(total)}${damagedWords(damaged)}`;
  };
  const countAll = async (signal) => {
    try {
      total = page.total ?? (await readTotal(chosen, signal));
      tellTotal();
    } catch (error) {
      failed(error);
    }
  };
  const failed = (error) => {
    if (error.name !== "AbortError") line.textContent = error.message;
  };
  const source = (after, signal) => (isWork(chosen) ? work.page(chosen, after, signal) : read(chosen, after, signal));
  /** Reads the list again with the changed parameters. */
  const ask = async (changed) => {
    const isOther = ["search", "tag"].some((name) => name in changed);
    Object.assign(chosen, changed);
    asking.abort();
    asking = new AbortController();
    const { signal } = asking;
    const query = new URLSearchParams(differing(chosen)).toString();
    history.replaceState(null, "", query ? `#/sessions?${query}` : "#/");
    try {
      const now = await source(null, signal);
      advice.forget();
      [entries, damaged, total] = [[], [], null];
      add(now);
      await countAll(signal);
      if (isOther) await lookAll();
    } catch (error) {
      failed(error);
    }
  };
  more.addEventListener("click", async () => {
    more.disabled = true;
    const { signal } = asking;
    await source(page.next, signal).then((now) => signal.aborted || add(now), failed);
    more.disabled = false;
  });
  const { element, state: { control } } = filters(chosen, ask, tags, smallest);
  const judge = (counts) => {
    const some = counts.any > 0 ? h("button", { class: "link", onclick: () => choose("care") }, "Show them") : "";
    const goOn = h("button", { class: "link", "data-needs": "operate", onclick: ({ target }) => pressed(target, continueEnding) }, `Continue the ${count(counts.ending)}`);
    needs.replaceChildren(careWords(counts), " ", some, " ", ...(counts.ending > 0 ? [goOn, " "] : []), beyond);
  };
  /** Leads to the renewal of the sessions that are completed or in their last period. */
  const continueEnding = async () => {
    const ending = await all("/sessions?state=ending", "sessions", leaving);
    location.hash = `#/renew?sessions=${ending.slice(0, RENEWED).map(({ session }) => session).join(",")}`;
  };
  // The counts of all sessions, independent of the search.
  const judgeAll = async () => {
    const { care } = await get("/sessions?limit=1&count=care", leaving);
    judge(care);
    await lookAll();
  };
  const lookAll = async () => work.look(chosen, await readTotal({ ...chosen, state: "" }, leaving));
  const start = async () => {
    if (first) add(first);
    else await ask({});
    // One after the other, because each reads all sessions.
    if (first) await countAll(asking.signal);
    await judgeAll();
  };
  start().catch(failed);
  return [work.element, needs, element, ticks.link, holder, h("div", { class: "foot" }, line, more)];
}

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

/** Says how many of the sessions shown are outside what their policies were trained for; the list itself does not contain that. */
const outsideWords = (count) => (count === 0 ? "" : `Of the sessions shown, ${counted(count, "is", "are")} in a situation that the policy was not trained for.`);

/** Returns `{element, state}`: the search and the filters, and the filter by state; calls `ask(changed)` at every change. */
function filters(chosen, ask, tags, smallest) {
  let typing = 0;
  const soon = (changed) => {
    clearTimeout(typing);
    typing = setTimeout(() => ask(changed), PAUSE);
  };
  const text = { inputmode: "text" };
  const search = input({ ...text, name: "search", label: "Search", value: chosen.search, type: "search", placeholder: "Name, tag or policy", maxlength: 100, changed: (text) => soon({ search: text.trim() }) });
  const tag = input({ ...text, name: "tag", label: "Tag", value: chosen.tag, placeholder: "All", list: "tags", changed: (text) => soon({ tag: text.trim() }) });
  const state = select({ name: "state", label: "State", choices: STATES, changed: (value) => ask({ state: value }) });
  state.control.value = chosen.state;
  const fields = h("div", { class: "fields" }, search.element, tag.element, tags, state.element, smallest.element);
  const element = h("form", { role: "search", class: "filters", onsubmit: (event) => event.preventDefault() }, fields);
  return { element, state };
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
    { ...by("Wealth", "wealth"), numeric: true, cell: ({ wealth: now }) => (now === null ? "\u2013" : wealth(now)) },
    { name: "Held now", numeric: true, cell: ({ holding }) => (holding === null ? "\u2013" : allocation(holding)) },
    { name: "Last period", numeric: true, cell: change },
    { ...by("Last report", "last_report"), cell: (entry) => lastReport(entry, care(entry)) },
    { name: "To hold", numeric: true, cell: (entry) => advice.of(entry).hold },
    { ...by("To trade", "trade"), numeric: true, cell: (entry) => advice.of(entry).trade },
    { name: "State", cell: (entry) => standing(entry) },
    { ...by("Opened", "created"), cell: ({ created_ms, policy, policy_name }) => [nearMoment(created_ms), " ", h("span", { class: "under" }, "by ", h("a", { href: `#/policies/${policy}` }, called(policy, policy_name)))] },
  ], entries);
}

/** Returns the change of wealth in the last period, including money added: an amount, because as a share it would not be a return. */
function change({ wealth_change }) {
  if (wealth_change === null || wealth_change === undefined) return "\u2013";
  return `${wealth_change > 0 ? "+" : ""}${wealth(wealth_change)}`;
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
