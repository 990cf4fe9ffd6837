// What more or less caution would lose: asked for on a session's page, drawn when it is there.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { usable } from "./page.js";

test("a session's page asks, and the report is drawn with its sentences and a table for each law", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(60_000);
    const history = Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k));
    const problem = { horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history };
    const policy = await trained(ballast.url, { problem, design: { count: 50 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await page.goto(`${ballast.url}/#/sessions/${session}`);
    await page.getByRole("button", { name: "How much caution?" }).click();
    await page.getByText("The best allocation for this market is").first().waitFor();
    const asked = page.url().split("/").at(-1);
    const report = await call(ballast.url, `/jobs/${asked}/report`);
    assert.equal(report.request.problem.history.length, 24);
    const shown = await page.locator("main").innerText();
    const plain = (text) => text.replaceAll("\u2212", "-");
    for (const words of report.sentences) assert.ok(plain(shown).includes(plain(words)), words);
    assert.match(shown, /loses least on average: \d+\.\d{3} % a year/);
    assert.doesNotMatch(shown, /basis point|premium|\bscale\b/);
    assert.equal(await page.locator("main svg").count(), 3);
    assert.equal(await page.getByRole("table").count(), 3);
    // What is lost is drawn on one scale from nothing on.
    const scales = await page.locator("main svg").evaluateAll((drawings) => drawings.map((drawing) => [...drawing.querySelectorAll("text.tick:not(.name)")].map(({ textContent }) => textContent)));
    assert.match(scales[0][0], /^0(\.0+)?$/);
    assert.deepEqual(scales.slice(1), [scales[0], scales[0]]);
    assert.ok(!/undefined|NaN|null/.test(shown), shown);
    await usable(page, () => {});
    await page.goto(`${ballast.url}/#/jobs`);
    await page.getByRole("link", { name: "See the report" }).click();
    await page.getByRole("heading", { name: "Frontier of caution of stocks, on 24 returns", exact: true, level: 1 }).waitFor();
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});

test("a session of several assets asks of all of them, with the returns it observed and the scale that was asked for", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(60_000);
    const assets = ["Stocks", "Bonds"];
    const history = Array.from({ length: 24 }, (_, k) => [0.01 + 0.05 * Math.sin(1.7 * k), 0.003 + 0.01 * Math.cos(2.3 * k)]);
    const radius = { rule: "bridge", alpha: 0.2, scale: 0.4 };
    const problem = { assets, ground_norm: "sup", horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history, radius };
    const policy = await trained(ballast.url, { problem, design: { count: 20 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await call(ballast.url, "/observe", { session, period: 1, log_returns: { Stocks: 0.02, Bonds: -0.01 } });
    await page.goto(`${ballast.url}/#/sessions/${session}`);
    await page.getByRole("button", { name: "How much caution?" }).click();
    await page.getByText("The best allocation for this market is").first().waitFor();
    const { request } = await call(ballast.url, `/jobs/${page.url().split("/").at(-1)}/report`);
    assert.deepEqual([request.problem.assets, request.problem.ground_norm, request.resamples], [assets, "sup", 60]);
    assert.deepEqual([request.problem.history.length, request.problem.history.at(-1)], [25, [0.02, -0.01]]);
    assert.ok(Math.abs(request.problem.radius.scale - 0.4) < 1e-12, `${request.problem.radius.scale}`);
    const shown = await page.locator("main").innerText();
    assert.ok(!/undefined|NaN|null/.test(shown), shown);
    await usable(page, () => {});
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
