// Sessions, one investor a row: who must trade and how much, whose report is due, who needs care, and where each stands.

import { advising } from "./advise.js";
import { advised } from "./advised.js";
import { download, get, isOver, remove } from "./api.js";
import { careWords } from "./care.js";
import { h } from "./dom.js";
import { currencyField } from "./firm.js";
import { input, pressed, select } from "./form.js";
import { count, counted } from "./format.js";
import { holderWords } from "./holder.js";
import { jobList } from "./jobs.js";
import { all } from "./pages.js";
import { sampleBook, sampleDeletion } from "./sample_book.js";
import { isEmpty, sessionRows } from "./session_rows.js";
import { ticking } from "./ticking.js";
import { smallestField } from "./trades.js";
import { welcome } from "./welcome.js";
import { isWork, orderOf, TO_DO, WORK, worklist } from "./worklist.js";

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
  // The address holds the filters, which the letters follow.
  const letters = h("a", { class: "button quiet", href: "#/letters", onclick: ({ currentTarget }) => (currentTarget.href = `#/letters${/\?.*/.exec(location.hash)?.[0] ?? ""}`) }, "Letters");
  const actions = h("div", { class: "actions" }, now, h("a", { class: "button quiet", href: "#/plan" }, "Plan for years"), h("a", { class: "button quiet", href: "#/sleeve" }, "Size a strategy"), several, letters, h("a", { class: "button", href: "#/sessions/new" }, "Open a session"));
  // Also a list in the order of what is to be done reads a page first: it tells whether there is any session.
  const first = isWork(chosen) && orderOf(chosen) !== TO_DO ? null : await read(chosen, null, leaving);
  const title = "Overview";
  if (first && isEmpty(first) && !filtered(chosen)) {
    const [{ policies }, { jobs }] = await Promise.all(["/policies?limit=1", "/jobs?limit=1"].map((path) => get(path, leaving)));
    const who = await holderWords(leaving);
    // While something is trained here, somebody has begun.
    const sample = jobs.some((job) => !isOver(job)) ? "" : sampleBook(leaving, redrawn);
    if (policies.length > 0) return { title, actions, body: [lead(), sample, who] };
    return { title, body: [...(jobs.length > 0 ? [lead(), jobList(jobs, leaving).element] : [welcome(advising(leaving))]), sample, who] };
  }
  return { title, actions, body: overview(chosen, first, leaving) };
}

/** Draws the overview again, without its filters. */
function redrawn() {
  history.replaceState(null, "", "#/");
  dispatchEvent(new HashChangeEvent("hashchange"));
}

const lead = () =>
  h(
    "p",
    { class: "lead" },
    "No session yet. A session is one investor who follows a policy: report each return as it comes, and read what to hold next.",
  );

const filtered = ({ search, tag, state }) => Boolean(search || tag || state);

/** Returns the entries of `chosen` that differ from the defaults. */
const differing = (chosen) => Object.entries(chosen).filter(([name, value]) => value !== CHOICES[name]);

/** Reads a page of matching sessions, without counting them: rows are shown before all sessions are read. */
function read(chosen, after, signal) {
  const order = orderOf(chosen);
  const query = new URLSearchParams([["limit", PAGE], ...differing({ ...chosen, state: chosen.state in WORK ? "" : chosen.state, sort: order === TO_DO ? "" : order }), ...(after === null ? [] : [["after", after]])]);
  return get(`/sessions?${query}`, signal);
}

/** Counts the matching sessions. */
async function readTotal({ sort, ...which }, signal) {
  const { total } = await get(`/sessions?${new URLSearchParams([["limit", 1], ["count", "total"], ...differing(which)])}`, signal);
  return total;
}

/** `first` is the first page, or null if the page must read all sessions for it. */
function overview(chosen, first, leaving) {
  const choose = (state) => {
    filter.state.control.value = state;
    list.ask({ state, sort: "" });
  };
  const redraw = () => {
    advice.redraw();
    work.redraw();
  };
  const smallest = smallestField(() => {
    redraw();
    if (isWork(chosen)) list.ask({});
  });
  const care = careLine(() => choose("care"), leaving);
  const tellBeyond = () => care.tellBeyond(rows.outside());
  const advice = advised(leaving, { changed: tellBeyond, smallest: smallest.smallest });
  const ticks = tickedSessions(async () => {
    await Promise.all([list.ask({}), judgeAll()]);
    if (rows.isEmpty() && !filtered(chosen)) redrawn();
  });
  const sample = sampleDeletion(leaving, redrawn);
  const changed = () => {
    tellBeyond();
    sample.tell(rows.entries);
  };
  const rows = sessionRows(chosen, { first, advice, ticks, ask: (changed) => list.ask(changed), changed });
  const work = worklist({ advice, size: PAGE, show: choose, progress: rows.progress, warned: care.warned, leaving });
  const lookAll = async () => work.look(chosen, await readTotal({ ...chosen, state: "" }, leaving));
  const list = listReading(chosen, { rows, work, advice, lookAll, leaving });
  const filter = filters(chosen, list.ask, rows.tags, smallest, () => {
    rows.redraw();
    redraw();
  });
  // The counts of all sessions, independent of the search.
  const judgeAll = async () => {
    care.judge((await get("/sessions?limit=1&count=care", leaving)).care);
    await lookAll();
  };
  list.start(first).then(judgeAll).catch(rows.failed);
  return [sample.element, work.element, care.element, filter.element, rows.ordered, ticks.link, rows.holder, rows.foot];
}

/** Returns `{element, judge(counts), warned(isWarned), tellBeyond(count)}`: the line that says how many of all sessions need care, with what to press, and that has the calendar of their reports; `show()` lists them. */
function careLine(show, leaving) {
  const element = h("p", { class: "note needs", role: "status" });
  const [beyond, words] = [h("span", {}), h("span", {})];
  let [counts, isWarned] = [null, false];
  const tell = () => counts && (words.textContent = careWords(counts, isWarned));
  const saved = (event) => pressed(event.currentTarget, () => download(event));
  const calendar = h("a", { href: "/reports.ics", download: "reports.ics", title: "The days on which reports are due, for a calendar program.", onclick: saved }, "Calendar (.ics)");
  /** Leads to the renewal of the sessions that are completed or in their last period. */
  const continueEnding = async () => {
    const ending = await all("/sessions?state=ending", "sessions", leaving);
    location.hash = `#/renew?sessions=${ending.slice(0, RENEWED).map(({ session }) => session).join(",")}`;
  };
  return {
    element,
    judge(now) {
      counts = now;
      tell();
      const some = counts.any > 0 ? h("button", { class: "link", onclick: show }, "Show them") : "";
      const goOn = h("button", { class: "link", "data-needs": "operate", onclick: ({ target }) => pressed(target, continueEnding) }, `Continue the ${count(counts.ending)}`);
      element.replaceChildren(words, " ", some, " ", ...(counts.ending > 0 ? [goOn, " "] : []), calendar, " ", beyond);
    },
    warned(now) {
      isWarned = now;
      tell();
    },
    tellBeyond: (count) => (beyond.textContent = outsideWords(count)),
  };
}

/** Says how many of the sessions shown are outside what their policies were trained for; the list itself does not contain that. */
const outsideWords = (count) => (count === 0 ? "" : `Of the sessions shown, ${counted(count, "is", "are")} in a situation that the policy was not trained for.`);

/** Returns the ticking of sessions, with what is done for those ticked; `removed()` is called after a deletion. */
function tickedSessions(removed) {
  return ticking("sessions", {
    links: [
      { at: "#/report", words: (ticked) => `Report for the ${count(ticked)}` },
      { at: "#/renew", words: (ticked) => `Continue the ${count(ticked)}` },
      { at: "#/letters", words: (ticked) => `Letters to the ${count(ticked)}` },
    ],
    asked: (ticked) => `Delete ${counted(ticked, "session")} and all their reports?`,
    remove: (id) => remove(`/sessions/${id}`),
    removed,
  });
}

/** Returns `{ask(changed), start(first)}`: reads the list that `rows` shows, again with each change of `chosen`, and more of it when asked. */
function listReading(chosen, { rows, work, advice, lookAll, leaving }) {
  let [asking, isWorked] = [new AbortController(), false];
  leaving.addEventListener("abort", () => asking.abort());
  /** Reads a page of the list. So many sessions that the advice of all takes long stand newest first, unless the order is chosen. */
  const source = async (after, signal) => {
    const worked = (after === null ? isWork(chosen) : isWorked) ? await work.page(chosen, after, signal) : null;
    if (after === null) {
      isWorked = worked !== null;
      rows.tellOrder(!isWorked && orderOf(chosen) === TO_DO ? "-created" : orderOf(chosen));
    }
    return worked ?? read(chosen, after, signal);
  };
  const countAll = async (signal) => {
    try {
      rows.tellTotal(rows.page.total ?? (await readTotal(chosen, signal)));
    } catch (error) {
      rows.failed(error);
    }
  };
  /** Reads the list again with the changed parameters. */
  const ask = async (changed) => {
    // What is typed just before another page is opened must not change the address of that page.
    if (leaving.aborted) return;
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
      rows.clear();
      rows.add(now);
      await countAll(signal);
      if (isOther) await lookAll();
    } catch (error) {
      rows.failed(error);
    }
  };
  rows.more.addEventListener("click", async () => {
    rows.more.disabled = true;
    const { signal } = asking;
    await source(rows.page.next, signal).then((now) => signal.aborted || rows.add(now), rows.failed);
    rows.more.disabled = false;
  });
  /** Shows the first page: the one read already, unless all sessions must be read for it. */
  const start = async (first) => {
    if (first === null || isWork(chosen)) return ask({});
    rows.tellOrder(orderOf(chosen));
    rows.add(first);
    // One after the other, because each reads all sessions.
    await countAll(asking.signal);
  };
  return { ask, start };
}

/** Returns `{element, state}`: the search and the filters, and the filter by state; calls `ask(changed)` at every change. */
function filters(chosen, ask, tags, smallest, changed) {
  let [typing, typed] = [0, {}];
  const soon = (changed) => {
    clearTimeout(typing);
    Object.assign(typed, changed);
    typing = setTimeout(() => {
      ask(typed);
      typed = {};
    }, PAUSE);
  };
  const text = { inputmode: "text" };
  const search = input({ ...text, name: "search", label: "Search", value: chosen.search, type: "search", placeholder: "Name, tag or policy", maxlength: 100, changed: (text) => soon({ search: text.trim() }) });
  const tag = input({ ...text, name: "tag", label: "Tag", value: chosen.tag, placeholder: "All", list: "tags", changed: (text) => soon({ tag: text.trim() }) });
  const state = select({ name: "state", label: "State", choices: STATES, changed: (value) => ask({ state: value }) });
  state.control.value = chosen.state;
  const fields = h("div", { class: "fields" }, search.element, tag.element, tags, state.element, smallest.element, currencyField(changed).element);
  const element = h("form", { role: "search", class: "filters", onsubmit: (event) => event.preventDefault() }, fields);
  return { element, state };
}
