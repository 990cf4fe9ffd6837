// Buttons whose service is gone: why nothing came of a press stands beside them, and they can be pressed again.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { visit, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
const PROBLEM = { horizon: 4, rate_per_step: 0.002, history: HISTORY, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
const SILENT = "The service did not answer. Is it running?";

let policy, session;

before(async () => {
  page.on("dialog", (dialog) => dialog.accept());
  policy = await trained(ballast.url, { problem: PROBLEM, design: { count: 10 } });
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  await call(ballast.url, "/observe", { session, period: 1, simple_return: 0.01, date: "2008-01-31" });
  await call(ballast.url, `/sessions/${session}/corrections`, { correction: 1, period: 1, reason: "a slip", simple_return: 0.02 });
});

const go = (hash) => visitQuiet(page, `${ballast.url}/#/${hash}`);
const beside = (button) => button.locator("xpath=following-sibling::*[contains(@class, 'error')]");
/** Presses a button while nothing but the page's own files is answered, twice: one reason stands beside it, and it can be pressed. */
async function pressedInVain(button, path) {
  await page.route(path, (route) => route.abort());
  for (let time = 0; time < 2; time++) {
    await button.click();
    await beside(button).getByText(SILENT).waitFor();
    assert.equal(await beside(button).count(), 1);
    assert.ok(await button.isEnabled());
  }
  assert.ok(await button.evaluate((element) => element === document.activeElement), "the focus stays at the button");
  await page.unroute(path);
}

test("what is taken back, undone or deleted on the page of a session", async () => {
  await go(`sessions/${session}`);
  for (const name of ["take it back", "Undo"]) await pressedInVain(page.getByRole("button", { name, exact: true }), "**/corrections");
  const deletion = page.getByRole("button", { name: "Delete", exact: true });
  await pressedInVain(deletion, `**/sessions/${session}`);
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 1 was undone/).waitFor();
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
  assert.equal((await call(ballast.url, "/sessions?count=total")).total, 0);
});

test("a job that is stopped", async () => {
  const { job } = await call(ballast.url, "/train", { problem: { ...PROBLEM, horizon: 400 }, design: { count: 1000 } });
  // A job that is followed never leaves the page quiet.
  await visit(page, `${ballast.url}/#/jobs`);
  const cancel = page.getByRole("button", { name: /^Cancel/ });
  await pressedInVain(cancel, `**/jobs/${job}/cancel`);
  await cancel.click();
  await page.getByText(/^Stopped after/).waitFor();
});

test("a policy that is deleted, and one that is opened for a session", async () => {
  await go(`policies/${policy}`);
  await pressedInVain(page.getByRole("button", { name: "Delete", exact: true }), `**/policies/${policy}`);
  await page.route(`**/policies/${policy}`, (route) => route.abort());
  await go("sessions/new");
  await page.locator("main").getByText(SILENT).waitFor();
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.locator("main").getByText(SILENT).waitFor();
  await page.unroute(`**/policies/${policy}`);
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: /^Session/ }).waitFor();
});

test("the example's returns, and the import of a policy", async () => {
  await go("train");
  await pressedInVain(page.getByRole("button", { name: /^Use the example/ }), "**/us_market_monthly.csv");
  await go("policies");
  const file = { name: "policy.json", mimeType: "application/json", buffer: Buffer.from("{}") };
  await page.route("**/policies/import", (route) => route.abort());
  for (let time = 0; time < 2; time++) {
    const answer = page.waitForRequest("**/policies/import");
    await page.getByLabel("Policy document to import").setInputFiles(file);
    await answer;
    await page.locator("main").getByText(SILENT).waitFor();
    assert.equal(await page.locator("main").getByText(SILENT).count(), 1);
  }
});
