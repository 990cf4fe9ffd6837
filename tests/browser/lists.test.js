// Lists longer than a page: everything in them can be reached, and what does not stand there is said to be missing.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, ended, trained } from "./ballast.js";
import { quiet, visit } from "./page.js";
import { ballast, page } from "./scene.js";

const SESSIONS = 211;
/** More than a page of every list that the dashboard asks for. */
const JOBS = 205;
const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let policy, oldest, evaluation;

before(async () => {
  const problem = { horizon: 2, rate_per_step: 0.002, history: HISTORY };
  const design = { count: 20 };
  policy = await trained(ballast.url, { problem, design });
  ({ job: evaluation } = await call(ballast.url, "/evaluate", {
    problem,
    design,
    frameworks: ["plug_in"],
    paths: 100,
  }));
  await ended(ballast.url, evaluation);
  oldest = (await call(ballast.url, "/sessions", { policy })).session;
  for (let k = 1; k < SESSIONS; k++) await call(ballast.url, "/sessions", { policy });
  for (let k = 0; k < JOBS; k++) {
    const { job } = await call(ballast.url, "/train", {
      problem: { ...problem, horizon: 200 },
      design: { count: 1000 },
      seed: k,
    });
    await fetch(`${ballast.url}/jobs/${job}/cancel`, { method: "POST" });
  }
});

async function go(hash) {
  await visit(page, `${ballast.url}/${hash}`);
}

/** Asks for more until there is no more; how often that was. */
async function unrolled() {
  const button = page.getByRole("button", { name: "Show more" });
  let times = 0;
  while (await button.isVisible()) {
    const line = await page.locator(".foot .note").textContent();
    assert.match(line, /^The newest \d+ \w+\. There are older ones\.$/);
    await button.click();
    await page.waitForFunction((before) => document.querySelector(".foot .note").textContent !== before, line);
    times++;
  }
  return times;
}

test("every session can be reached", async () => {
  await go("#/");
  assert.equal(await page.locator(`a[href="#/sessions/${oldest}"]`).count(), 0);
  for (const shown of [50, 100, 150, 200]) {
    await page.getByText(`${shown} of 211`, { exact: true }).waitFor();
    await page.getByRole("button", { name: "Show more" }).click();
  }
  await page.getByText("211 of 211", { exact: true }).waitFor();
  await page.getByRole("button", { name: "Show more" }).waitFor({ state: "hidden" });
  assert.equal(await page.locator("tbody tr").count(), SESSIONS);
  await page.locator(`a[href="#/sessions/${oldest}"]`).click();
  await page.getByRole("heading", { level: 1, name: /^Session / }).waitFor();
});

test("more than two hundred sessions stand newest first, and what is to be done first if asked", async () => {
  let asked = 0;
  const note = (request) => (asked += request.url().includes("/action?") ? 1 : 0);
  await go("#/");
  await page.getByText("50 of 211", { exact: true }).waitFor();
  assert.equal(await page.getByRole("columnheader", { name: "Opened" }).getAttribute("aria-sort"), "descending");
  await quiet(page);
  page.on("request", note);
  await page.getByRole("button", { name: "Put first what is to be done" }).click();
  await page.getByText("What is to be done stands first", { exact: false }).waitFor();
  await page.getByText("50 of 211", { exact: true }).waitFor();
  page.off("request", note);
  assert.equal(asked, 0, "the advice of all was read for the sums before");
});

test("every job can be reached, the first of all too", async () => {
  await go("#/jobs");
  await unrolled();
  await page.locator(`a[href="#/policies/${policy}"]`).waitFor();
  assert.equal(await page.locator(".card.job").count(), JOBS + 2);
});

test("an evaluation older than many jobs stands in its list", async () => {
  await go("#/evaluations");
  await page.locator(`a[href="#/evaluations/${evaluation}"]`).waitFor();
});

test("whoever opens a session from a policy stands before the form", async () => {
  await go(`#/policies/${policy}`);
  await page.getByRole("link", { name: "Open a session" }).click();
  await page.getByRole("heading", { level: 1, name: "Open a session" }).waitFor();
  const field = page.getByLabel("Policy", { exact: true });
  assert.equal(await field.inputValue(), policy);
  const open = await page.getByRole("button", { name: "Open", exact: true }).boundingBox();
  assert.ok(open.y + open.height < 900, `the button stands at ${open.y} pixels`);
  await page.getByText("Use other known returns").click();
  await page.getByLabel("Returns or prices known").fill("3.2 -1.4 2.1 0.4 -5");
  await page.getByText("5 simple returns in percent").waitFor();
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: /^Session / }).waitFor();
  const { history } = await call(ballast.url, `/sessions/${page.url().split("/").pop()}/history`);
  assert.ok(Math.abs(history[0] - Math.log(1.032)) < 1e-11, `${history}`);
});

test("the form of an evaluation stands before whoever asks from a policy", async () => {
  await go(`#/policies/${policy}`);
  await page.getByRole("link", { name: "Evaluate" }).click();
  await page.getByRole("heading", { level: 1, name: "Compare out of sample" }).waitFor();
  assert.equal(await page.getByLabel("Policy", { exact: true }).inputValue(), policy);
});

test("the table of policies stands whole at 1280 pixels, whatever its words, with boxes of one size", async () => {
  const problem = { horizon: 2, rate_per_step: 0.002, history: HISTORY, utility: { kind: "exponential", risk_aversion: 0.01 }, radius: { rule: "concentration", alpha: 0.1 }, support: { rule: "between", min: -1, max: 1 } };
  await trained(ballast.url, { problem, design: { count: 20 }, name: "A name of so many words that it takes more than a line of the table" });
  await go("#/policies");
  const table = page.getByRole("region", { name: "Policies, newest first" });
  assert.equal(await table.evaluate(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth), 0);
  assert.deepEqual(await table.locator(".tickbox").evaluateAll((boxes) => boxes.map(({ offsetWidth }) => offsetWidth)), [16, 16]);
});
