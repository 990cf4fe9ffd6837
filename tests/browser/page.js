// What tests of the page do on every one: go there, read it as one reads it, and look whether everybody can use it.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { cancelJobs } from "./ballast.js";

const AXE = fileURLToPath(new URL("node_modules/axe-core/axe.min.js", import.meta.url));
/** The second is a screen of 1280 by 800 at 200 %. */
const LOOKS = [
  { colorScheme: "light", width: 320, height: 900 },
  { colorScheme: "dark", width: 640, height: 400, deviceScaleFactor: 2 },
  { colorScheme: "light", width: 1280, height: 900 },
];
/** A page asks for nothing more if it did not for so long, in milliseconds. */
const QUIET = 60;
/** Longest wait for an answer, in milliseconds. */
const ANSWERED = 60_000;

/** A text with common spaces and hyphens. */
export const plain = (text) => text.replaceAll("\u202f", " ").replaceAll("\u2212", "-");

/** Loads the page of an address anew: a new hash alone would leave the old view standing for a moment. */
export async function load(page, url) {
  await page.goto("about:blank");
  await page.goto(url);
  await page.locator("main:not([aria-busy]) h1").waitFor();
}

/** Shows the view of an address. A page of the dashboard that is open follows its address, in a fifth of the time of a load. */
export async function visit(page, url) {
  const { origin, pathname, hash } = new URL(url);
  // Present mode changes what stands, so no view is drawn anew.
  const shown = page.url();
  const isOpen = pathname === "/" && shown.startsWith(`${origin}/`) && new URL(shown).pathname === "/" && !`${shown} ${hash}`.includes("?present");
  if (!isOpen) return load(page, url);
  await page.evaluate((hash) => {
    document.querySelector("main h1")?.setAttribute("data-left", "");
    if (location.hash !== hash && hash !== "") location.hash = hash;
    else {
      history.replaceState(null, "", `/${hash}`);
      dispatchEvent(new HashChangeEvent("hashchange"));
    }
  }, hash);
  await page.locator("main:not([aria-busy]) h1:not([data-left])").waitFor();
}

/** As `visit`, until nothing is asked for any more. */
export async function visitQuiet(page, url) {
  requests(page);
  await visit(page, url);
  await quiet(page);
}

/** What the form of a training sends once Train is pressed. The training itself is stopped: others would wait for it. */
export async function sentTraining(page, url) {
  const answered = page.waitForResponse((response) => response.request().method() === "POST" && response.url().endsWith("/train"));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  const response = await answered;
  await cancelJobs(url);
  return response.request().postDataJSON();
}

/** The requests of a page since this was first called: those without an answer, and how many there were. Streams of events have no end. */
const known = new WeakMap();
function requests(page) {
  if (known.has(page)) return known.get(page);
  const told = { open: new Set(), count: 0, answered: () => {} };
  const context = page.context();
  const of = (act) => (request) => {
    if (request.url().endsWith("/events") || request.serviceWorker() || request.frame().page() !== page) return;
    act(request);
  };
  const ended = of((request) => {
    told.open.delete(request);
    if (told.open.size === 0) told.answered();
  });
  context.on("request", of((request) => {
    told.open.add(request);
    told.count += 1;
  }));
  context.on("requestfinished", ended);
  context.on("requestfailed", ended);
  known.set(page, told);
  return told;
}

/** Waits until everything that the page asked for is answered and drawn, and nothing more is asked for. */
export async function quiet(page) {
  const told = requests(page);
  for (let seen = -1; told.open.size > 0 || told.count !== seen; ) {
    if (told.open.size > 0) await answered(told);
    seen = told.count;
    await page.evaluate((pause) => new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn, pause))), QUIET);
  }
}

function answered(told) {
  return new Promise((resolve, reject) => {
    const late = setTimeout(() => reject(new Error(`no answer: ${[...told.open].map((request) => request.url())}`)), ANSWERED);
    told.answered = () => {
      clearTimeout(late);
      resolve();
    };
  });
}

/** That axe finds nothing on the page as it stands, but what the rules `apart` find. */
export async function accessible(page, where, apart = []) {
  if (!(await page.evaluate(() => "axe" in window))) await page.evaluate(await readFile(AXE, "utf8"));
  const { told, passes } = await page.evaluate(async (apart) => {
    // Only the violations are of interest in full, and no rule in force reads style sheets or media beforehand.
    const { violations, passes } = await window.axe.run(document, { resultTypes: ["violations"], preload: false });
    const found = violations.filter(({ id }) => !apart.includes(id));
    return { told: found.map(({ id, nodes }) => `${id}: ${nodes.map(({ html, any }) => `${html} ${any[0]?.message ?? ""}`).join("\n")}`), passes: passes.length };
  }, apart);
  assert.deepEqual(told, [], where);
  assert.ok(passes > 10, `${where}: ${passes}`);
}

/** In the page: waits until it is drawn for another screen, and colours that fade have arrived. */
async function turned() {
  await new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
  const ending = document.getAnimations().filter(({ effect }) => effect.getComputedTiming().endTime < Infinity);
  await Promise.allSettled(ending.map(({ finished }) => finished));
}

/** At 320 pixels, in dark at 200 % and in light, each place opened by `open`: that axe finds nothing, but what the rules `apart` find, and
 * that nothing scrolls sideways. A page is opened once, and follows the screen as it does in the hand of somebody who turns it. */
export async function usable(page, open, places = [""], apart = []) {
  const zoom = await page.context().newCDPSession(page);
  for (const place of places) {
    for (const [index, { colorScheme, width, height, deviceScaleFactor = 1 }] of LOOKS.entries()) {
      await page.emulateMedia({ colorScheme });
      await page.setViewportSize({ width, height });
      if (deviceScaleFactor !== 1) await zoom.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor, mobile: false });
      if (index === 0) await open(place);
      else await page.evaluate(turned);
      const where = `${place} in ${colorScheme} at ${width}`;
      assert.equal(await page.evaluate(() => devicePixelRatio), deviceScaleFactor, where);
      await accessible(page, where, apart);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth), 0, where);
      if (deviceScaleFactor !== 1) await zoom.send("Emulation.clearDeviceMetricsOverride");
    }
  }
  await zoom.detach();
}
