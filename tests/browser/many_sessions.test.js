// Ten thousand sessions: the overview stands as soon as that of a few, and whoever needs care is found among all.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const SESSIONS = 10_000;
/** The service takes so many reports in one call. */
const AT_ONCE = 1000;
const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
/** Within this many milliseconds a change of the page is seen without a wait. */
const SOON = 300;
/** What else the machine does lengthens a round and never shortens one, so the shortest of so many tells what the page takes. */
const ROUNDS = 5;
const DAY = 86_400_000;

before(async () => {
  const policy = await trained(ballast.url, { problem: { horizon: 3, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY }, design: { count: 20 } });
  const sessions = [];
  const open = async () => {
    while (sessions.length < SESSIONS) {
      const index = sessions.push(null) - 1;
      sessions[index] = (await call(ballast.url, "/sessions", { policy, name: `Client ${index + 1}` })).session;
    }
  };
  await Promise.all(Array.from({ length: 16 }, open));
  const day = (ago) => new Date(Date.now() - ago * DAY).toISOString().slice(0, 10);
  for (let start = 0; start < SESSIONS; start += AT_ONCE) {
    // Every hundredth last reported half a year ago, the others this week.
    const reports = sessions.slice(start, start + AT_ONCE).map((session, index) => ({ session, period: 1, simple_return: 0.01, date: day(index % 100 === 0 ? 180 : 5) }));
    await call(ballast.url, "/observe", reports);
  }
});

/** How long it takes at the least, in milliseconds, from `act` until `seen` holds, after each `visit`. */
async function taking(t, visit, act, seen) {
  const rounds = [];
  while (rounds.length < ROUNDS && !(Math.min(...rounds) < SOON)) {
    await visit();
    rounds.push(await once(act, seen));
    t.diagnostic(`${rounds.at(-1).toFixed(0)} ms`);
  }
  assert.ok(Math.min(...rounds) < SOON, `${rounds} ms`);
}

const once = (act, seen) =>
  page.evaluate(
    ([act, seen]) =>
      new Promise((resolve) => {
        const start = performance.now();
        const holds = new Function(`return ${seen}`);
        const look = () => holds() && requestAnimationFrame(() => resolve(performance.now() - start));
        new MutationObserver(look).observe(document.querySelector("main"), { childList: true, subtree: true, characterData: true });
        new Function(act)();
      }),
    [act, seen],
  );

test("the overview of ten thousand stands at once", (t) =>
  taking(t, () => visitQuiet(page, `${ballast.url}/#/jobs`), 'location.hash = "#/"', 'document.querySelectorAll("tbody tr").length === 50'));

test("those that need care are counted among all, and shown without a wait", async (t) => {
  const overview = async () => {
    await visitQuiet(page, `${ballast.url}/#/jobs`);
    await visitQuiet(page, `${ballast.url}/#/`);
    await page.getByText("100 of 10,000 sessions need care: 100 are overdue.").waitFor();
  };
  const show = '[...document.querySelectorAll("button")].find(({ textContent }) => textContent === "Show them").click()';
  await taking(t, overview, show, '[...document.querySelectorAll("tbody tr")].filter(({ textContent }) => textContent.includes("overdue by")).length === 50');
  await page.getByText("50 of 100", { exact: true }).waitFor();
  assert.match(page.url(), /state=care/);
  await page.getByRole("button", { name: "Show more" }).click();
  await page.getByText("100 of 100", { exact: true }).waitFor();
  assert.equal(await page.getByText(/^overdue by \d+ days$/).count(), 100);
  assert.equal(await page.getByLabel("State").inputValue(), "care");
});

test("the trades of ten thousand are added up when somebody asks for it", async (t) => {
  await visitQuiet(page, `${ballast.url}/#/`);
  assert.doesNotMatch(await page.locator(".work").innerText(), /have a trade/);
  const start = performance.now();
  await page.getByRole("button", { name: "Add up the trades of the 10,000 sessions" }).click();
  await page.locator(".work").getByText(/of 10,000 sessions? (has|have) a trade/).waitFor({ timeout: 300_000 });
  t.diagnostic(`${(performance.now() - start).toFixed(0)} ms`);
});
