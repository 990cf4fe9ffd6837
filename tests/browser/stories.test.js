// What happens to people: a first advice out of a file, two houses at one screen, and a service that dies while a month is reported.

import assert from "node:assert/strict";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { visitQuiet } from "./page.js";

const RETURNS = fileURLToPath(new URL("../../data/us_market_monthly.csv", import.meta.url));
const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
/** From the first look at an empty service to the first advice, in milliseconds. */
const FIRST_ADVICE = 120_000;
/** The service takes so many reports in one call. */
const REPORTS = 1000;

let chromium;

before(async () => {
  chromium = await browser();
});

after(() => chromium?.close());

async function opened() {
  const page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(FIRST_ADVICE);
  return page;
}

test("from an empty service and a file of returns to the first advice takes less than two minutes", async () => {
  const ballast = await service();
  const page = await opened();
  try {
    const start = performance.now();
    await page.goto(ballast.url);
    await page.getByRole("link", { name: "Train the first policy" }).click();
    await page.locator("input[type=file]").first().setInputFiles(RETURNS);
    await page.getByText("1109 monthly simple returns as fractions", { exact: false }).waitFor();
    // The last twenty years of them.
    await page.getByLabel("Latest returns used, of 1109").fill("240");
    await page.getByLabel("Latest returns used, of 1109").blur();
    await page.getByText("The latest 240 of 1109 monthly simple returns", { exact: false }).waitFor();
    await page.getByRole("button", { name: /^Take the bank.s rate from risk_free_return/ }).click();
    await page.getByRole("button", { name: "Train", exact: true }).click();
    await page.getByRole("link", { name: "See the policy" }).click();
    await page.getByRole("link", { name: "Open a session" }).click();
    await page.getByLabel("Name", { exact: true }).fill("Ada");
    await page.getByRole("button", { name: "Open", exact: true }).click();
    await page.getByRole("heading", { level: 1, name: "Ada" }).waitFor();
    await page.locator("#advice .big strong").waitFor();
    const took = performance.now() - start;
    assert.ok(took < FIRST_ADVICE, `${took} ms`);
    const { sessions } = await call(ballast.url, "/sessions");
    const { allocation } = await call(ballast.url, `/action?session=${sessions[0].session}`);
    const told = Number.parseFloat(await page.locator("#advice .big strong").innerText());
    assert.ok(Math.abs(told - 100 * allocation) <= 0.05, `${told} for ${allocation}`);
  } finally {
    await page.close();
    await ballast.stop();
  }
});

test("two tenants in two tabs of one browser see nothing of each other", async () => {
  const ballast = await service();
  const context = await chromium.newContext();
  try {
    const houses = await Promise.all(
      ["north", "south"].map(async (tenant) => {
        const key = await ballast.keyOf(tenant, "read", "operate", "train");
        const headers = { authorization: `Bearer ${key}`, "content-type": "application/json" };
        while ((await fetch(`${ballast.url}/key`, { headers }).then((answer) => answer.json())).tenant !== tenant) await new Promise((resolve) => setTimeout(resolve, 50));
        const ask = async (path, body) => (await fetch(ballast.url + path, { headers, ...(body ? { method: "POST", body: JSON.stringify(body) } : {}) })).json();
        const { job } = await ask("/train", { problem: { horizon: 1, rate_per_step: 0.002, history: HISTORY }, design: { count: 10 }, name: `Policy of ${tenant}` });
        let policy = null;
        for (;;) {
          ({ policy } = await ask(`/jobs/${job}`));
          if (policy) break;
          await new Promise((resolve) => setTimeout(resolve, 50));
        }
        const { session } = await ask("/sessions", { policy, name: `Client of ${tenant}` });
        return { tenant, key, policy, session, job, page: await context.newPage() };
      }),
    );
    // Both sign in before either looks, so that a key kept for the browser and not for the tab would show.
    for (const { page, key } of houses) {
      await page.goto(ballast.url);
      await page.getByLabel("Key", { exact: true }).fill(key);
      await page.getByRole("button", { name: "Use this key" }).click();
      await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
    }
    for (const [index, { tenant, page }] of houses.entries()) {
      const other = houses[1 - index];
      const text = async (hash) => {
        await visitQuiet(page, `${ballast.url}/${hash}`);
        return page.locator("main").innerText();
      };
      for (const [hash, own] of [["#/", `Client of ${tenant}`], ["#/policies", `Policy of ${tenant}`], ["#/jobs", `Policy of ${tenant}`], ["#/key", `tenant ${tenant}`]]) {
        const words = await text(hash);
        assert.ok(words.includes(own) && !words.includes(other.tenant), `${hash} of ${tenant}: ${words}`);
      }
      for (const hash of [`#/sessions/${other.session}`, `#/evaluations/${other.job}`, `#/?search=${other.tenant}`, `#/compare?sessions=${other.session},${other.session}`]) {
        const words = await text(hash);
        assert.doesNotMatch(words.replace(/search=\w+/, ""), new RegExp(`of ${other.tenant}`), hash);
      }
      await text(`#/sessions/${other.session}`);
      await page.getByRole("heading", { level: 1, name: "Not found" }).waitFor();
    }
  } finally {
    await context.close();
    await ballast.stop();
  }
});

test("a service killed while it records a report is started again, and the report sent again counts once", async () => {
  const ballast = await service();
  const page = await opened();
  try {
    const policy = await trained(ballast.url, { problem: { horizon: 3, rate_per_step: 0.002, history: HISTORY }, design: { count: 10 } });
    const sessions = Array.from({ length: REPORTS }, () => null);
    let next = 0;
    const open = async () => {
      while (next < REPORTS) {
        const index = next++;
        sessions[index] = (await call(ballast.url, "/sessions", { policy, name: `Client ${index + 1}`, wealth: 100 })).session;
      }
    };
    await Promise.all(Array.from({ length: 8 }, open));
    await visitQuiet(page, `${ballast.url}/#/report`);
    const back = (index) => (index - REPORTS / 2) / 100;
    await page.getByLabel("Sessions and their returns, %").fill(["client,return", ...sessions.map((_, index) => `Client ${index + 1},${back(index)}`)].join("\n"));
    const button = page.getByRole("button", { name: "Report for 1000" });
    await button.click();
    // Once the first are recorded it is killed, wherever it is in the list.
    while (!(await call(ballast.url, "/sessions?sort=-last_report&limit=1")).sessions[0].last_report_ms) await new Promise((resolve) => setTimeout(resolve, 2));
    await ballast.kill();
    // What was recorded is in the file, and the page has heard of none of it.
    await page.getByText("The service did not answer. Is it running? Sending it again is safe: a period counts once.").waitFor();
    assert.equal(await ballast.start(), ballast.url);
    await button.click();
    await page.getByText("1000 returns are recorded.").first().waitFor();
    for (const [index, session] of sessions.entries()) {
      const { observations } = await call(ballast.url, `/sessions/${session}/history`);
      assert.equal(observations.length, 1, `client ${index + 1}`);
      assert.ok(Math.abs(observations[0].reported.simple_return - back(index) / 100) < 1e-12, `client ${index + 1}`);
    }
  } finally {
    await page.close();
    await ballast.stop();
  }
});
