// Present mode: the page beside a client, without what is not for the client's eyes, and left by Escape.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { plain, quiet, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let session, several;

before(async () => {
  const problem = { horizon: 3, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const policy = await trained(ballast.url, { problem, design: { count: 10 }, name: "World" });
  ({ session } = await call(ballast.url, "/sessions", { policy, name: "Ada", tags: ["private"], notes: "pays late" }));
  for (const [index, simple_return] of [0.04, -0.1].entries()) await call(ballast.url, "/observe", { session, period: index + 1, simple_return, date: `2008-0${index + 1}-${31 - 2 * index}`, confirm: true });
  await call(ballast.url, `/sessions/${session}/corrections`, { correction: 1, period: 1, reason: "a slip of ours", simple_return: 0.03, date: "2008-01-31", confirm: true });
  const fund = await trained(ballast.url, { problem: { ...problem, assets: ["Stocks", "Bonds"], history: HISTORY.map((value, k) => [value, 0.003 + 0.004 * Math.cos(k)]) }, design: { count: 10 } });
  several = (await call(ballast.url, "/sessions", { policy: fund, name: "Two assets" })).session;
  await call(ballast.url, "/observe", { session: several, period: 1, simple_returns: { Stocks: 0.02, Bonds: 0.01 }, confirm: true });
});

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const toggle = page.getByRole("switch", { name: "Present" });
/** The visible elements that match. */
const visible = (selector) => page.locator(selector).evaluateAll((found) => found.filter((one) => one.checkVisibility()).map((one) => one.outerHTML.slice(0, 120)));
const NOT_FOR_CLIENTS = "header.bar a, nav, form, input, select, textarea, main a, .trail, .labels, .corrections, .renewals, .end, main button:not([role=switch])";

test("what is not for the client is gone, the advice and the course stand, and the type is larger", async () => {
  await go(`#/sessions/${session}`);
  await page.getByRole("slider", { name: "Worth as much as a sure, by caution" }).waitFor();
  assert.ok((await visible(NOT_FOR_CLIENTS)).length > 15, "the page has what is hidden later");
  const size = () => page.locator(".big").evaluate((big) => Number.parseFloat(getComputedStyle(big).fontSize));
  const before = await size();
  await toggle.click();
  await page.waitForFunction(() => "present" in document.documentElement.dataset);
  assert.match(page.url(), new RegExp(`#/sessions/${session}\\?present$`));
  assert.deepEqual(await visible(NOT_FOR_CLIENTS), []);
  const words = plain(await page.locator("body").innerText());
  assert.doesNotMatch(words, /slip|private|pays late|World|Caution|This session|period 3|moved here|Returns seen|Key|Guide|Reported|Last report|4\.00 %/);
  for (const said of ["Ada", "Hold", "in stocks", "So far", "Worst fall so far", "How close the advice is to changing"]) assert.ok(words.includes(said), said);
  for (const seen of [".big", ".plot svg", ".plot .bar", ".facts"]) assert.ok((await visible(seen)).length > 0, seen);
  assert.ok((await size()) > 1.2 * before);
  assert.equal(await toggle.getAttribute("aria-checked"), "true");
});

test("Escape leaves it, what was typed stays, and nothing is asked of the service again", async () => {
  await go(`#/sessions/${session}`);
  const field = page.getByLabel("Return in March 2008, %");
  await field.fill("1.7");
  await quiet(page);
  const requests = [];
  // The browser itself may ask for the icon of the page.
  const note = (request) => request.url().includes("/icon.svg") || requests.push(request.url());
  page.on("request", note);
  await toggle.click();
  await field.waitFor({ state: "hidden" });
  await page.keyboard.press("Escape");
  await field.waitFor();
  page.off("request", note);
  assert.deepEqual([await field.inputValue(), requests], ["1.7", []]);
  assert.match(page.url(), new RegExp(`#/sessions/${session}$`));
  assert.equal(await toggle.getAttribute("aria-checked"), "false");
  await page.keyboard.press("Escape");
  assert.match(page.url(), new RegExp(`#/sessions/${session}$`));
});

test("the keyboard enters and leaves it by the switch, and Back leaves it too", async () => {
  await go(`#/sessions/${session}`);
  await toggle.focus();
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => "present" in document.documentElement.dataset);
  assert.ok(await toggle.evaluate((control) => control === document.activeElement));
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => !("present" in document.documentElement.dataset));
  await toggle.click();
  await page.goBack();
  await page.waitForFunction(() => !("present" in document.documentElement.dataset));
  assert.ok(await page.getByRole("navigation", { name: "Views" }).isVisible());
});

test("the address alone keeps it", async () => {
  await go(`#/sessions/${session}?present`);
  assert.deepEqual(await visible("header.bar a, form"), []);
  assert.deepEqual(await page.evaluate(() => [Object.keys(localStorage), Object.keys(sessionStorage)].flat().filter((key) => /present/i.test(key))), []);
  await go(`#/sessions/${session}`);
  assert.ok((await visible("header.bar a")).length > 0);
  // Another page is never presented.
  await go(`#/sessions/${session}?present`);
  await page.evaluate(() => (location.hash = "#/sessions"));
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
  assert.ok((await visible("header.bar a")).length > 0);
});

test("a session of several assets is presented too", async () => {
  await go(`#/sessions/${several}?present`);
  assert.deepEqual(await visible(NOT_FOR_CLIENTS), []);
  assert.ok((await visible(".by-asset td")).length > 5);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, go, [`#/sessions/${session}?present`, `#/sessions/${several}?present`]);
});
