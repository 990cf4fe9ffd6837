// Jobs: what is being computed, its progress, and how to stop it.

import { follow, get, isOver, post } from "./api.js";
import { announce, h } from "./dom.js";
import { pressed } from "./form.js";
import { count, counted, duration, moment } from "./format.js";
import { all, foot, Pages } from "./pages.js";
import { byDay, KINDS, whenSeen } from "./report_title.js";
import { welcome } from "./welcome.js";

/** Browsers keep six connections to one address: following two jobs leaves room for all other calls. */
const FOLLOWED = 2;
/** Jobs that are not followed are polled at this interval, in milliseconds. */
const POLL = 1000;

/** The address of a report's page. */
const REPORTS = { evaluate: "evaluations", backtest: "backtests", frontier: "frontiers" };
const named = (job) => `${KINDS[job.kind]}${byDay(job)}`;

/** `query`: `follow=JOB` leads on to the form that opens a session, once the job has trained its policy. */
export async function view(query, leaving) {
  const followed = new URLSearchParams(query ?? "").get("follow");
  const pages = new Pages("/jobs", "jobs", leaving);
  const entries = await pages.next();
  const actions = h("a", { class: "button", href: "#/train" }, "Train a policy");
  if (entries.length === 0) return { title: "Jobs", body: welcome() };
  const ahead = ({ job, policy }) => job === followed && policy && location.replace(`#/sessions/new?policy=${policy}`);
  const jobs = jobList(entries, leaving, ahead);
  const lead = entries.some(({ job, state }) => job === followed && !["failed", "cancelled"].includes(state)) ? h("p", { class: "lead" }, "Once the policy is trained, the form that opens the session comes by itself.") : "";
  return { title: "Jobs", actions, body: [lead, jobs.element, foot(pages, ["job", "jobs"], entries.length, jobs.add)] };
}

/** Shows a job until it succeeds; then the page reloads and shows its report. */
export function until(job, leaving) {
  const again = ({ state }) => state === "succeeded" && dispatchEvent(new HashChangeEvent("hashchange"));
  return jobList([job], leaving, again).element;
}

/** Returns the warning that the service does not answer and the jobs shown may be out of date. */
function silence() {
  const element = h("p", { class: "note wrong", role: "alert", hidden: true });
  let since = null;
  /** `error` is null if the service answered. */
  const hear = (error) => {
    if (error?.name === "AbortError") return;
    if (error === null) since = null;
    else since ??= Date.now();
    element.hidden = since === null;
    if (since !== null) element.textContent = `${error.message} This page shows its last answer, of ${moment(since)}.`;
  };
  return { element, hear };
}

/** Returns `{element, add(entries)}`: a list of jobs that stays up to date until `leaving`; `changed(job)` is called at every change. */
export function jobList(entries, leaving, changed = () => {}) {
  const list = h("ol", { class: "cards" });
  const silent = silence();
  const element = h("div", {}, silent.element, list);
  const cards = [];
  const names = policyNames(leaving);
  const wake = watch(cards, leaving, silent.hear);
  const add = (more) => {
    const added = more.map((job) => card(job, changed, names));
    cards.push(...added);
    list.append(...added.map((card) => card.element));
    wake();
  };
  add(entries);
  return { element, add };
}

/** Returns `(policy, then)`: calls `then(name)` with a policy's name, once the names of all policies are read together. The name is "" if the
 * policy has none, and null if it was deleted. */
function policyNames(leaving) {
  const names = new Map();
  let asked = null;
  const read = async () => {
    for (const { policy, name } of await all("/policies", "policies", leaving)) names.set(policy, name);
  };
  return async (policy, then) => {
    if (!names.has(policy)) await (asked ??= read().finally(() => (asked = null)));
    if (!names.has(policy)) names.set(policy, null);
    then(names.get(policy));
  };
}

/** Returns the card of a job, with `update(job)`; `names` gives the name of its policy. */
function card(job, changed, names) {
  const element = h("li", { class: "card job" });
  const card = { element, job, names };
  card.update = (now) => {
    // The answer to a cancellation may arrive after the event that the job has ended.
    if (isOver(card.job) && !isOver(now)) return;
    const ended = isOver(now) && !isOver(card.job);
    const moved = now.state === card.job.state && now.cancel_requested === card.job.cancel_requested;
    card.job = now;
    // Progress arrives many times a second: a button replaced between press and release would not be clicked.
    if (moved && element.firstChild) advanced(element, now);
    else {
      const kept = element.contains(document.activeElement);
      element.replaceChildren(...contents(card));
      if (kept) element.querySelector("a, button")?.focus();
    }
    changed(now);
    if (ended) announce(`${element.querySelector("h2").textContent}: ${now.state}.`);
  };
  card.update(job);
  return card;
}

/** Updates the moving parts of a running job. */
function advanced(element, job) {
  element.querySelector(".summary").textContent = summary(job);
  const progress = element.querySelector("progress");
  if (!progress) return;
  progress.value = done(job.progress);
  progress.nextSibling.textContent = stepsDone(job.progress);
}

function contents(card) {
  const { job } = card;
  const about = h("span", {}, byDay(job));
  const title = h("h2", { title: job.job }, KINDS[job.kind], about);
  const open = links(card);
  if (job.policy)
    card.names(job.policy, (name) => {
      if (name === null) open.replaceWith(h("p", { class: "note" }, "Its policy was deleted."));
      else if (name) about.textContent = ` of ${name}`;
    }).catch(() => {});
  if (job.report) whenSeen(card.element, job, (words) => (about.textContent = words));
  const state = h(
    "span",
    { class: `state ${job.state}` },
    job.cancel_requested && !isOver(job) ? "stopping" : job.state,
  );
  return [
    h("div", { class: "row" }, title, state),
    h("p", { class: "summary" }, summary(job)),
    bar(job),
    h("div", { class: "row" }, times(job), open),
  ].filter(Boolean);
}

/** Says how far a job is, in a sentence. */
export function summary({ state, progress, error, kind }) {
  if (state === "failed") return error ?? "No reason was recorded.";
  if (state === "queued") return "Waiting for the jobs before it.";
  if (state === "cancelled") return `Stopped after ${progress.steps_done} of ${progress.steps_total} steps.`;
  if (state === "succeeded")
    return kind === "train"
      ? `${counted(progress.steps_total, "period")} solved, from the last to the first.`
      : `${counted(progress.steps_total, "step")} done.`;
  const left = timeLeft(kind, progress);
  if (kind === "backtest") return `Training policies and following them${left}`;
  if (kind === "frontier") return `${count(progress.points_done ?? 0)} records advised${left}`;
  const { steps_done, step, phase, points_done, points_total } = progress;
  const idle = steps_done > 0 ? "Between two steps" : "Starting";
  // Steps are numbered in the order of solving, which is from the last period to the first.
  const at = phase === "simulating" ? "Simulating" : step === null || phase === null ? idle : `Step ${count(steps_done + 1)}, ${phase}`;
  const points = points_total ? `: ${count(points_done)} of ${counted(points_total, phase === "simulating" ? "path" : "situation")}` : "";
  return `${at}${points}${left}`;
}

/** Steps needed for an estimate of the time left: the first step differs from those after it. */
const TELLING = 2;

/** Says the time left of a job, if it can be estimated: an evaluation ends with a simulation, which differs from the steps before it. */
function timeLeft(kind, { seconds_left, steps_done }) {
  if (seconds_left === null || steps_done < TELLING || kind === "evaluate") return "";
  const left = duration(seconds_left);
  return `, ${left.startsWith("under") ? "" : "about "}${left} left`;
}

function bar(job) {
  const { state, progress } = job;
  if (state !== "running") return null;
  return h(
    "div",
    { class: "progress" },
    h("progress", { max: progress.steps_total, value: done(progress), "aria-label": `Progress of ${named(job)}` }),
    h("span", {}, stepsDone(progress)),
  );
}

const stepsDone = ({ steps_done, steps_total }) => `${steps_done} of ${counted(steps_total, "step")} done`;

/** Returns the steps done, plus nine tenths of the current one by its points: the rest is fitting. */
function done({ steps_done, steps_total, points_done, points_total, phase }) {
  const share = phase === "fitting" ? 1 : points_total ? points_done / points_total : 0;
  return Math.min(steps_total, steps_done + 0.9 * share);
}

function times({ created_ms, started_ms, finished_ms }) {
  const ran = started_ms !== null && finished_ms !== null ? `, ran ${duration((finished_ms - started_ms) / 1000)}` : "";
  return h("p", { class: "note" }, `Submitted ${moment(created_ms)}${ran}`);
}

function links(card) {
  const { job } = card;
  if (job.policy) return h("a", { class: "button quiet", href: `#/policies/${job.policy}` }, "See the policy");
  if (job.state === "succeeded")
    return h("a", { class: "button quiet", href: `#/${REPORTS[job.kind]}/${job.job}` }, "See the report");
  if (isOver(job)) return null;
  const stop = h(
    "button",
    { class: "quiet", "data-needs": "train", disabled: job.cancel_requested, "aria-label": `Cancel ${named(job)}` },
    "Cancel",
  );
  const act = async () => {
    card.update(await post(`/jobs/${job.job}/cancel`));
    announce("Requested it to stop.");
  };
  stop.addEventListener("click", () => pressed(stop, act));
  return h("span", {}, stop);
}

/** Follows the first running jobs and polls the others; returns a function that starts this for new jobs. */
function watch(cards, leaving, hear) {
  const followed = new Set();
  let awake = false;
  const turn = async () => {
    awake = true;
    const pending = cards.filter(({ job }) => !isOver(job));
    for (const card of pending.filter(({ job }) => job.state === "running")) {
      const live = [...followed].filter((one) => !isOver(one.job)).length;
      if (live >= FOLLOWED || followed.has(card)) continue;
      followed.add(card);
      follow(card.job.job, card.update, leaving, hear);
    }
    const others = pending.filter((card) => !followed.has(card));
    const asked = (card) => get(`/jobs/${card.job.job}`, leaving).then((job) => (card.update(job), hear(null)), hear);
    await Promise.all(others.map(asked));
    awake = pending.length > 0 && !leaving.aborted;
    if (awake) setTimeout(turn, POLL);
  };
  return () => awake || turn();
}
