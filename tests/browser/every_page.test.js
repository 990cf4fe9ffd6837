// Every page on every screen, for everybody: each view where there is nothing yet and where there is something, the interface and the guide.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, before, test } from "node:test";
import { browser, call, ended, service, trained } from "./ballast.js";
import { usable, visitQuiet } from "./page.js";

let ballast, chromium, page;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await (await chromium.newContext({ bypassCSP: true })).newPage();
  page.setDefaultTimeout(60_000);
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

const visit = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const nothing = `session_${"0".repeat(32)}`;
/** Views that need nothing to be there. */
const BARE = ["#/", "#/advise", "#/plan", "#/sleeve", "#/jobs", "#/train", "#/declare", "#/policies", "#/report", "#/sessions/new", "#/evaluations", "#/evaluations/new", "#/backtests/new", "#/compare", "#/letters", "#/subscriptions", "#/key", "#/nowhere", `#/sessions/${nothing}`];

test("every view where there is nothing yet", () => usable(page, visit, BARE));

const HISTORY = Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k));
const BONDS = HISTORY.map((_, k) => 0.003 + 0.01 * Math.cos(2.3 * k));
const STOCK = JSON.parse(await readFile(new URL("../../examples/problems/stock.json", import.meta.url), "utf8"));
const both = (k) => [HISTORY[k], BONDS[k]];

/** A job once it has ended. */
const done = async (path, request) => (await ended(ballast.url, (await call(ballast.url, path, request)).job)).job;

test("every view where there is something, of one asset and of several", async () => {
  const design = { count: 10 };
  const problem = { horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY };
  const wide = { ...problem, assets: ["Stocks", "Bonds"], history: HISTORY.map((_, k) => both(k)), radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const [one, several] = [await trained(ballast.url, { problem, design, name: "A name of so many words that they take more than a line" }), await trained(ballast.url, { problem: wide, design })];
  const declared = await trained(ballast.url, { ...STOCK, problem: { ...STOCK.problem, horizon: 2 }, design });
  const [lived, other] = [(await call(ballast.url, "/sessions", { policy: one, name: "Ada" })).session, (await call(ballast.url, "/sessions", { policy: several })).session];
  await call(ballast.url, "/observe", { session: lived, period: 1, simple_return: 0.02, date: "2026-01-31" });
  await call(ballast.url, "/observe", { session: other, period: 1, log_returns: { Stocks: 0.02, Bonds: -0.01 } });
  const walk = { rate: 0.002, periods_per_year: 4, log_returns: HISTORY };
  const dates = HISTORY.map((_, k) => `${2004 + Math.floor(k / 4)}-${String(3 * (k % 4) + 3).padStart(2, "0")}`);
  const jobs = {
    evaluations: [await done("/evaluate", { problem, design, frameworks: ["adaptive"], paths: 100 }), await done("/evaluate", { policies: { policy: declared }, rules: { rule: { order: "max(25 - stock, 0)" } }, paths: 100 })],
    backtests: [await done("/backtest", { ...walk, window: 8, every: 4, count: 10, alpha: [0.5] }), await done("/backtest", { ...walk, dates, assets: ["Stocks", "Bonds"], log_returns: wide.history, windows: [8], alpha: 0.5 })],
    frontiers: [await done("/frontier", { problem: { history: HISTORY, rate_per_step: 0.002 } })],
  };
  // One that was stopped.
  const { job: stopped } = await call(ballast.url, "/evaluate", { problem: { ...problem, horizon: 200 }, design: { count: 1000 }, frameworks: ["adaptive"] });
  const places = [
    ...["#/", "#/jobs", "#/policies", "#/sessions/new", "#/evaluations", "#/evaluations/new", `#/train?like=${one}`, `#/train?newer=${several}`, `#/report?sessions=${lived},${other}`, `#/renew?sessions=${lived}`],
    ...[one, several, declared].map((policy) => `#/policies/${policy}`),
    `#/declare?from=${declared}`,
    ...[lived, other].flatMap((session) => [`#/sessions/${session}`, `#/sessions/${session}?present`, `#/sessions/${session}/letter`, `#/sessions/${session}/track`]),
    `#/letters?sessions=${lived},${other}`,
    ...Object.entries({ ...jobs, evaluations: [...jobs.evaluations, stopped] }).flatMap(([at, all]) => all.map((job) => `#/${at}/${job}`)),
    `#/compare?policies=${one},${several}`,
    `#/compare?sessions=${lived},${other}`,
  ];
  const routes = [...(await readFile(new URL("../../src/http/site/dashboard/main.js", import.meta.url), "utf8")).matchAll(/^ {2}\[\/(\S+)\/, /gm)].map(([, route]) => new RegExp(route));
  assert.ok(routes.length > 15, `${routes}`);
  const unseen = routes.filter((route) => ![...BARE, ...places].some((place) => route.test(place)));
  assert.deepEqual(unseen, [], "a view is on no list of this test");
  const cancel = (job) => fetch(`${ballast.url}/jobs/${job}/cancel`, { method: "POST" });
  await cancel(stopped);
  let running = null;
  await usable(page, async (hash) => {
    // A job runs as long as the jobs are looked at, and takes the processor no longer.
    if (running) await cancel(running);
    running = hash === "#/jobs" ? (await call(ballast.url, "/train", { problem: { ...problem, horizon: 200 }, design: { count: 1000 } })).job : null;
    await visit(hash);
    if (running) return page.locator("progress").waitFor();
    if (hash !== `#/policies/${declared}`) return;
    await page.getByRole("button", { name: "Decide" }).click();
    await page.locator("#decision .big").waitFor();
  }, places);
});

test("the page that asks for a key", async () => {
  await ballast.key("read");
  await page.goto("about:blank");
  for (;;) {
    const { status } = await fetch(`${ballast.url}/policies`);
    if (status === 401) break;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  await usable(page, async () => {
    await visit("#/policies");
    await page.getByRole("heading", { level: 1, name: "A key is needed" }).waitFor();
  });
});

/** What Swagger UI breaks by its own markup. */
const OF_SWAGGER = ["heading-order", "landmark-unique", "nested-interactive", "scrollable-region-focusable"];

test("the interface, with calls opened, but for what Swagger UI brings", async () => {
  const open = async () => {
    await page.goto("about:blank");
    await page.goto(`${ballast.url}/docs`);
    await page.locator("#operations-jobs-post_train").getByRole("button").first().click();
    await page.locator("#operations-jobs-post_train").getByText('"target": "floor_gain"').first().waitFor();
    const tried = page.locator("#operations-jobs-get_jobs");
    await tried.getByRole("button").first().click();
    await tried.getByRole("button", { name: "Try it out" }).click();
    await tried.getByRole("button", { name: "Execute" }).waitFor();
  };
  await usable(page, open, ["/docs"], OF_SWAGGER);
});

test("every page of the guide", async () => {
  await page.goto(`${ballast.url}/guide`);
  const links = await page.locator("nav a").evaluateAll((links) => links.map(({ href }) => href));
  const pages = [...new Set(links.map((href) => href.split("#")[0]))].filter((href) => new URL(href).pathname.startsWith("/guide"));
  assert.ok(pages.length > 15, `${pages}`);
  await usable(page, (address) => page.goto(address), pages);
});
