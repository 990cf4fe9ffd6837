// The futures of a policy and a session: played when they are opened, in the words and figures of the service.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { plain, visit } from "./page.js";

test("the worst of every period is played and drawn beside the record", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
    const problem = { horizon: 3, rate_per_step: 0.002, history, radius: { rule: "bridge", alpha: 0.1, scale: 0.2 } };
    const policy = await trained(ballast.url, { problem, design: { count: 10 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    for (const [path, place] of [["policies", policy], ["sessions", session]]) {
      const page = await chromium.newPage();
      page.setDefaultTimeout(20_000);
      await visit(page, `${ballast.url}/#/${path}/${place}`);
      await page.getByText("Play this policy against the worst case of every period").click();
      await page.getByText("and the range of the middle 80").waitFor();
      const { sentence } = await call(ballast.url, `/${path}/${place}/futures`);
      assert.ok(plain(await page.locator("main").innerText()).includes(plain(sentence)), sentence);
    }
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
