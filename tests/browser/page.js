// What tests of the page do on every one: go there, read it as one reads it, and look whether everybody can use it.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";

const AXE = fileURLToPath(new URL("node_modules/axe-core/axe.min.js", import.meta.url));
/** The second is a screen of 1280 by 800 at 200 %. */
const LOOKS = [
  { colorScheme: "light", width: 1280, height: 900 },
  { colorScheme: "dark", width: 640, height: 400, deviceScaleFactor: 2 },
  { colorScheme: "light", width: 320, height: 900 },
];

/** A text with common spaces and hyphens. */
export const plain = (text) => text.replaceAll("\u202f", " ").replaceAll("\u2212", "-");

/** Loads the page of an address anew: a new hash alone would leave the old view standing for a moment. */
export async function visit(page, url) {
  await page.goto("about:blank");
  await page.goto(url);
  await page.locator("main:not([aria-busy]) h1").waitFor();
}

/** As `visit`, until nothing is asked for any more. */
export async function visitQuiet(page, url) {
  await visit(page, url);
  await page.waitForLoadState("networkidle");
}

/** That axe finds nothing on the page as it stands, but what the rules `apart` find. */
export async function accessible(page, where, apart = []) {
  await page.evaluate(await readFile(AXE, "utf8"));
  const { violations, passes } = await page.evaluate(() => window.axe.run(document));
  const told = violations.filter(({ id }) => !apart.includes(id)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html, any }) => `${html} ${any[0]?.message ?? ""}`).join("\n")}`);
  assert.deepEqual(told, [], where);
  assert.ok(passes.length > 10);
}

/** In light, in dark at 200 % and at 320 pixels, each opened by `open`: that axe finds nothing, but what the rules `apart` find, and that nothing scrolls sideways. */
export async function usable(page, open, places = [""], apart = []) {
  for (const { colorScheme, width, height, deviceScaleFactor = 1 } of LOOKS) {
    await page.emulateMedia({ colorScheme });
    await page.setViewportSize({ width, height });
    const zoom = deviceScaleFactor === 1 ? null : await page.context().newCDPSession(page);
    await zoom?.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor, mobile: false });
    for (const place of places) {
      await open(place);
      const where = `${place} in ${colorScheme} at ${width}`;
      assert.equal(await page.evaluate(() => devicePixelRatio), deviceScaleFactor, where);
      await accessible(page, where, apart);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth), 0, where);
    }
    await zoom?.send("Emulation.clearDeviceMetricsOverride");
    await zoom?.detach();
  }
}
