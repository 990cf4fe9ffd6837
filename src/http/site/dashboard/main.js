// The frame: which view belongs to which address, and what happens on a change from one to the next.

import { Problem, WAS_DELETED } from "./api.js";
import { announce, h } from "./dom.js";
import * as advise from "./advise.js";
import * as backtestAsking from "./backtest_asking.js";
import * as compare from "./compare.js";
import * as declare from "./declare.js";
import * as evaluationAsking from "./evaluation_asking.js";
import * as evaluations from "./evaluations.js";
import { holderWords, lacking, lackWords } from "./holder.js";
import { ofBacktest, ofEvaluation, ofFrontier } from "./job_report.js";
import * as jobs from "./jobs.js";
import { askForKey, held, keyForm } from "./key.js";
import * as letters from "./letters.js";
import * as plan from "./plan.js";
import * as policies from "./policies.js";
import * as policy from "./policy.js";
import { leaveByEscape, pageOf, present, presentOnly } from "./present.js";
import * as renewing from "./renewing.js";
import * as reporting from "./reporting.js";
import * as session from "./session.js";
import * as sessionOpening from "./session_opening.js";
import * as sessions from "./sessions.js";
import * as sleeve from "./sleeve.js";
import * as subscriptions from "./subscriptions.js";
import * as tearSheet from "./tear_sheet.js";
import * as train from "./train.js";

/** Address, view, navigation entry, and the role that the view needs, if any. A view is `async (id, leaving) => {title, body}`. */
const ROUTES = [
  [/^#\/jobs(?:\?(.*))?$/, jobs.view, "jobs"],
  [/^#\/advise$/, advise.view, "sessions"],
  [/^#\/plan$/, plan.view, "plan"],
  [/^#\/sleeve$/, sleeve.view, "sessions"],
  [/^#\/train(?:\?(.*))?$/, train.view, "jobs", "train"],
  [/^#\/declare(?:\?(.*))?$/, declare.view, "jobs", "train"],
  [/^#\/policies$/, policies.view, "policies"],
  [/^#\/policies\/([^/]+)$/, policy.view, "policies"],
  [/^#\/(?:sessions)?(?:\?.*)?$/, sessions.view, "sessions"],
  [/^#\/report(?:\?(.*))?$/, reporting.view, "sessions", "operate"],
  [/^#\/renew(?:\?(.*))?$/, renewing.view, "sessions", "operate"],
  [/^#\/sessions\/new(?:\?(.*))?$/, sessionOpening.view, "sessions", "operate"],
  [/^#\/sessions\/([^/?]+)(?:\?present)?$/, session.view, "sessions"],
  [/^#\/sessions\/([^/]+)\/letter$/, letters.ofSession, "sessions"],
  [/^#\/sessions\/([^/]+)\/track$/, tearSheet.view, "sessions"],
  [/^#\/letters(?:\?(.*))?$/, letters.view, "sessions"],
  [/^#\/evaluations$/, evaluations.view, "evaluations"],
  [/^#\/evaluations\/new(?:\?(.*))?$/, evaluationAsking.view, "evaluations", "train"],
  [/^#\/evaluations\/([^/]+)$/, ofEvaluation, "evaluations"],
  [/^#\/backtests\/new$/, backtestAsking.view, "evaluations", "train"],
  [/^#\/backtests\/([^/]+)$/, ofBacktest, "evaluations"],
  [/^#\/compare(?:\?(.*))?$/, compare.view, "compare"],
  [/^#\/frontiers\/([^/]+)$/, ofFrontier, "jobs"],
  [/^#\/subscriptions$/, subscriptions.view, "key"],
  [/^#\/key$/, key, "key"],
];

const main = document.querySelector("main");
let leaving = new AbortController();
let first = true;
let shown = "";

/** Shows the view of the address. Focus goes to its heading, as it would on a new page. */
async function show() {
  leaving.abort();
  leaving = new AbortController();
  const { signal } = leaving;
  main.setAttribute("aria-busy", "true");
  let [page, route, match, lacks] = [, , , []];
  try {
    const hash = location.hash || "#/";
    shown = pageOf(hash);
    present();
    [route, match] = ROUTES.map((route) => [route, route[0].exec(hash)]).find(([, match]) => match) ?? [];
    lacks = await lacking();
    // Hiding by style keeps elements hidden that a view adds later.
    document.documentElement.dataset.lacks = lacks.join(" ");
    if (lacks.includes(route?.[3])) page = { title: "Not allowed with this key", body: "" };
    else page = route ? await route[1](match[1] && decodeURIComponent(match[1]), signal) : missing(hash);
  } catch (error) {
    if (signal.aborted) return;
    page = failed(error, route?.[2]);
  }
  if (signal.aborted) return;
  for (const link of document.querySelectorAll(".bar [data-view]")) {
    if (link.dataset.view === route?.[2]) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  const heading = h("h1", { tabindex: -1 }, page.title);
  main.replaceChildren(
    h("header", { class: "page" }, h("div", {}, page.trail ?? null, heading, page.under ?? null), page.actions ?? null),
    ...lacks.map((role) => h("p", { class: "note lacked", "data-lacked": role, "data-whole": role === route?.[3] }, lackWords(role))),
    ...[page.body].flat(),
  );
  main.removeAttribute("aria-busy");
  document.title = `${page.title} \u00b7 Ballast`;
  if (!first) {
    heading.focus({ preventScroll: true });
    scrollTo(0, 0);
  }
  first = false;
}

/** The view where a key is entered or forgotten. */
async function key(_, signal) {
  const note = "If the service asks for keys, it shows nothing without one. Only this tab keeps the key, until you close it.";
  return { title: "Key", body: [await holderWords(signal), h("p", {}, note), keyForm(() => location.assign("#/")), h("p", {}, h("a", { href: "#/subscriptions" }, "Tell another program of events"), ".")] };
}

const capital = (sentence) => `${sentence[0].toUpperCase()}${sentence.slice(1)}`;

function missing(hash) {
  return {
    title: "Page not found",
    body: h("p", {}, `There is no page at ${hash}. `, h("a", { href: "#/" }, "Go to the overview"), "."),
  };
}

function failed(error, view) {
  if (!(error instanceof Problem)) console.error(error);
  if (error.status === 401)
    return { title: "A key is needed", body: [h("p", { role: "alert", class: held() ? "error" : null }, capital(error.message)), keyForm(show)] };
  const again = h("button", { onclick: show }, "Try again");
  if (error.status === 404 && view) {
    const list = h("a", { href: `#/${view}` }, `See the ${view}`);
    return { title: "Not found", body: [h("p", { role: "alert" }, `${capital(error.message).replace(/\.?$/, ".")} It may have been deleted. `, list, ".")] };
  }
  return { title: error.title ?? "This page failed", body: [h("p", { role: "alert" }, capital(error.message)), again] };
}

document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
addEventListener("keydown", leaveByEscape);
addEventListener("hashchange", () => {
  if (presentOnly(shown)) return;
  announce("");
  show();
});
addEventListener("session-deleted", ({ detail }) => {
  // Nothing that its page shows stands any more.
  if (!shown.includes(detail)) return;
  leaving.abort();
  const heading = h("h1", { tabindex: -1 }, "Session deleted");
  main.replaceChildren(h("header", { class: "page" }, heading), h("p", { role: "alert" }, `${WAS_DELETED} `, h("a", { href: "#/sessions" }, "See the sessions"), "."));
  heading.focus();
});
addEventListener("key-refused", ({ detail }) => askForKey(detail));
show();
