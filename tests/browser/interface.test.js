// The page /docs in a browser: it shows bodies, defaults and examples, and asks for nothing from elsewhere.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call } from "./ballast.js";
import { ballast, page } from "./scene.js";

const faults = [];

before(async () => {
  page.setDefaultTimeout(60_000);
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("request", (request) => {
    const { protocol, origin } = new URL(request.url());
    if (protocol !== "data:" && origin !== ballast.url) faults.push(`asked for ${request.url()}`);
  });
  await page.goto(`${ballast.url}/docs`);
});

test("every call is listed, and every problem", async () => {
  await page.locator("#operations-jobs-post_train").waitFor();
  const { paths } = await call(ballast.url, "/openapi.json");
  const calls = Object.values(paths).flatMap(Object.keys).length;
  assert.ok(calls > 25);
  assert.equal(await page.locator(".opblock").count(), calls);
  await page.getByRole("cell", { name: "/problems/invalid-field" }).waitFor();
});

test("a call shows its example, its fields and their defaults", async () => {
  const train = page.locator("#operations-jobs-post_train");
  await train.getByRole("button").first().click();
  await train.getByText('"target": "floor_gain"').first().waitFor();
  const walk = page.locator("#operations-jobs-post_backtest");
  await walk.getByRole("button").first().click();
  await walk.getByRole("tab", { name: "Schema" }).first().click();
  await walk.getByText("count", { exact: true }).first().waitFor();
  await walk.getByText("100", { exact: true }).first().waitFor();
});

test("it is dark where the reader's screen is", async () => {
  const ground = () => page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  await page.emulateMedia({ colorScheme: "dark" });
  await page.locator("html.dark-mode").waitFor();
  const dark = await ground();
  await page.emulateMedia({ colorScheme: "light" });
  await page.locator("html:not(.dark-mode)").waitFor();
  assert.notEqual(dark, await ground());
});

test("a call is tried", async () => {
  const live = page.locator("#operations-operations-get_livez");
  await live.getByRole("button").first().click();
  await live.getByRole("button", { name: "Try it out" }).click();
  await live.getByRole("button", { name: "Execute" }).click();
  await live.locator(".live-responses-table").getByText("ok", { exact: true }).waitFor();
});

test("the page and the console held no fault", () => assert.deepEqual(faults, []));
