// The documents as a site: its pictures, and the way there and back.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, service } from "./ballast.js";

let ballast, chromium, page;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await (await chromium.newContext({ bypassCSP: true })).newPage();
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

test("the guide is a click from the overview, and the overview from the guide", async () => {
  await page.goto(ballast.url);
  await page.getByRole("link", { name: "Guide" }).click();
  await page.getByRole("link", { name: "What it earned and cost" }).click();
  await page.getByRole("heading", { level: 1, name: "What robustness earned and cost" }).waitFor();
  const widths = await page.getByRole("img").evaluateAll(async (pictures) => {
    // Waits for pictures that are still on their way, and refuses one that cannot be drawn.
    await Promise.all(pictures.map((picture) => picture.decode()));
    return pictures.map(({ naturalWidth }) => naturalWidth);
  });
  assert.ok(widths.length >= 3 && widths.every((width) => width > 0), String(widths));
  await page.getByRole("link", { name: "Overview" }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
});
