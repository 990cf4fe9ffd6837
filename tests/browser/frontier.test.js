// What more or less caution would lose: asked for on a session's page, drawn when it is there.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { plain, usable, visit } from "./page.js";

test("a session's page asks, and the report is drawn with its sentences and a table for each law", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(60_000);
    const history = Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k));
    const problem = { horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history };
    const policy = await trained(ballast.url, { problem, design: { count: 10 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await visit(page, `${ballast.url}/#/sessions/${session}`);
    await page.getByRole("button", { name: "How much caution?" }).click();
    await page.getByText("The best allocation would be").waitFor();
    const asked = page.url().split("/").at(-1);
    const report = await call(ballast.url, `/jobs/${asked}/report`);
    assert.equal(report.request.problem.history.length, 24);
    const shown = plain(await page.locator("main").innerText());
    // The two numbers of the trade-off, in percent, from the losses that the report has in basis points.
    const lost = (kind, scale) => report.resampled.find(({ bootstrap }) => bootstrap.kind === kind).points.find((point) => point.scale === scale).lost.value;
    const words = (amount, verb, opposite) => `${amount < 0 ? opposite : verb} ${(Math.abs(amount) / 100).toFixed(2)} % a year`;
    const [cost, saved] = [lost("smoothed", 1) - lost("smoothed", 0), lost("without_premium", 0) - lost("without_premium", 1)];
    assert.ok(cost > 0 && saved > 0, `${cost} ${saved}`);
    assert.ok(shown.includes(`this caution ${words(cost, "costs", "saves")} if returns are like the record\u2019s, and ${words(saved, "saves", "costs")} if the market pays no more than the bank.`), shown);
    assert.ok(shown.includes(`by ${Math.abs(report.evidence).toFixed(1)} standard errors, which ${Math.abs(report.evidence) < 2 ? "may be" : "is hardly"} chance`), shown);
    assert.match(shown, /The best allocation would be [\d.]+ % if returns are like the record\u2019s, [\d.]+ % if \d+ in a row follow each other as they did and 0 % if the market pays no more than the bank\./);
    assert.doesNotMatch(shown, /basis point|premium|\bscale\b/);
    // All kinds of records stand in one chart, on one axis from nothing on.
    assert.equal(await page.locator("main figure").count(), 1);
    assert.equal(await page.locator("main figure path.line").count(), 3);
    assert.equal(await page.locator("main figure path.band").count(), 3);
    const lowest = await page.locator("main figure text.tick[text-anchor=end]").first().textContent();
    assert.match(plain(lowest), /^0(\.0+)? %$/);
    await page.getByText("As a table").click();
    const rows = await page.getByRole("table", { name: "Lost on average a year" }).locator("tbody tr").allInnerTexts();
    for (const [index, { lost: { value, low, high } }] of report.resampled[0].points.entries()) assert.ok(plain(rows[index]).includes([value, low, high].map((figure) => `${(figure / 100).toFixed(3)} %`).join("|").replace("|", " (").replace("|", " to ")), rows[index]);
    await page.getByText("Sentences of the report, and a table for each kind of record").click();
    const tables = page.locator("section:has-text('For the quant')").getByRole("table");
    await tables.nth(2).waitFor();
    assert.equal(await tables.count(), 3);
    const whole = plain(await page.locator("main").innerText());
    for (const sentence of report.sentences) assert.ok(whole.includes(plain(sentence)), sentence);
    assert.ok(!/undefined|NaN|null/.test(whole), whole);
    await usable(page, () => {});
    await visit(page, `${ballast.url}/#/jobs`);
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
    const policy = await trained(ballast.url, { problem, design: { count: 10 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await call(ballast.url, "/observe", { session, period: 1, log_returns: { Stocks: 0.02, Bonds: -0.01 } });
    await visit(page, `${ballast.url}/#/sessions/${session}`);
    await page.getByRole("button", { name: "How much caution?" }).click();
    await page.getByText("The best allocation would be").waitFor();
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
