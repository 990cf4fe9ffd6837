// From a policy to another like it: the form filled with what it was trained by.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { sentTraining, visit } from "./page.js";

test("a policy is cloned with one thing changed, and retrained on newer returns", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(20_000);
    const history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008];
    const problem = { horizon: 2, rate_per_step: 0.0021, history, utility: { kind: "power", risk_aversion: 6 }, radius: { rule: "bridge", alpha: 0.3, scale: 0.4 }, trading_cost: 0.01 };
    const policy = await trained(ballast.url, { problem, design: { count: 10 }, seed: 7 });
    const { specification } = await call(ballast.url, `/policies/${policy}`);
    const sent = async () => {
      const body = await sentTraining(page, ballast.url);
      await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
      return body;
    };
    await visit(page, `${ballast.url}/#/policies/${policy}`);
    await page.getByRole("link", { name: "Clone with one thing changed" }).click();
    await page.getByRole("heading", { level: 1, name: "Train a policy" }).waitFor();
    assert.equal(await page.getByLabel("Investor").inputValue(), "cautious");
    assert.equal(await page.getByLabel("Confidence, %").inputValue(), "70");
    assert.equal(await page.getByLabel("Bank return per period, %").inputValue(), "0.21");
    await page.getByLabel("Confidence, %").fill("80");
    const changed = structuredClone(specification);
    changed.problem.radius.alpha = 0.2;
    assert.deepEqual(await sent(), changed);

    await visit(page, `${ballast.url}/#/policies/${policy}`);
    await page.getByRole("link", { name: "Retrain on newer returns" }).click();
    await page.getByRole("heading", { level: 1, name: "Train on newer returns" }).waitFor();
    await page.getByLabel("Returns or prices").fill(`${history.join("\n")}\n0.05\n-0.01`);
    const newer = await sent();
    assert.equal(newer.problem.history.length, 8);
    assert.deepEqual({ ...newer.problem, history }, { ...specification.problem, history });
    assert.equal(newer.seed, 7);
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
