// The pages beside the views: the interface, the key, what is not there, and every page of the guide, for everybody in light and in dark.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, service } from "./ballast.js";
import { accessible, visitQuiet } from "./page.js";

let ballast, chromium, page;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await (await chromium.newContext({ bypassCSP: true })).newPage();
  page.setDefaultTimeout(60_000);
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

/** What Swagger UI breaks by its own markup and colours. */
const OF_SWAGGER = ["color-contrast", "heading-order", "nested-interactive", "scrollable-region-focusable"];

/** That axe finds nothing on a page, in light and in dark, once `open` has brought it up. */
async function forEverybody(where, open, apart) {
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme });
    await open();
    await accessible(page, `${where} in ${colorScheme}`, apart);
  }
}

test("every page of the guide", async () => {
  await page.goto(`${ballast.url}/guide`);
  const links = await page.locator("nav a").evaluateAll((links) => links.map(({ href }) => href));
  const pages = [...new Set(links.map((href) => href.split("#")[0]))].filter((href) => new URL(href).pathname.startsWith("/guide"));
  assert.ok(pages.length > 15, `${pages}`);
  for (const address of pages) await forEverybody(address, () => page.goto(address));
});

test("a view that is not there, and a session that is not", async () => {
  await forEverybody("a missing view", () => visitQuiet(page, `${ballast.url}/#/nowhere`));
  await page.getByRole("heading", { level: 1, name: "There is nothing here" }).waitFor();
  await forEverybody("a missing session", () => visitQuiet(page, `${ballast.url}/#/sessions/session_${"0".repeat(32)}`));
  await page.getByRole("heading", { level: 1, name: "It is not here" }).waitFor();
});

test("the page for a key", () => forEverybody("#/key", () => visitQuiet(page, `${ballast.url}/#/key`)));

test("the interface, with a call opened, but for what Swagger UI brings", () => {
  const open = async () => {
    await page.goto(`${ballast.url}/docs`);
    await page.locator("#operations-jobs-train").getByRole("button").first().click();
    await page.locator("#operations-jobs-train").getByText('"target": "floor_gain"').first().waitFor();
  };
  return forEverybody("/docs", open, OF_SWAGGER);
});
