// The session's page says how close the advice is to changing, in the sentences of the service.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { plain, visit } from "./page.js";

test("the page asks by itself, and says it", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(20_000);
    const history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
    const problem = { horizon: 2, rate_per_step: 0.002, history, radius: { rule: "bridge", alpha: 0.1, scale: 0.2 } };
    const policy = await trained(ballast.url, { problem, design: { count: 10 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await visit(page, `${ballast.url}/#/sessions/${session}`);
    await page.getByText(/The record has paid/).waitFor();
    const { sensitivity } = await call(ballast.url, `/action?session=${session}&sensitivity=true`);
    const shown = plain(await page.locator("main").innerText());
    assert.ok(sensitivity.sentences.length >= 4);
    for (const words of sensitivity.sentences) assert.ok(shown.includes(words), words);
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
