// A client's month by the keyboard alone: from a file to the advice, the session, a report, its correction and the letter. The focus is in
// sight and never lost.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { call } from "./ballast.js";
import { plain, quiet, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

/** The last ten years, which are trained soon. */
const [HEADER, ...MONTHS] = (await readFile(new URL("../../data/us_market_monthly.csv", import.meta.url), "utf8")).trim().split("\n");
const RETURNS = { name: "market.csv", mimeType: "text/csv", buffer: Buffer.from([HEADER, ...MONTHS.slice(-120)].join("\n")) };
/** Most presses of Tab from one thing to the next. */
const FAR = 90;

/** Returns what is wrong with the focus, or null: it is on nothing, out of sight, or not marked. */
const lost = () =>
  page.evaluate(() => {
    const at = document.activeElement;
    if (at === document.body) return "nothing is in focus";
    const box = (at.matches(".unseen") && at.labels?.[0] ? at.labels[0] : at).getBoundingClientRect();
    const words = `${at.tagName} ${at.name ?? ""} ${at.textContent.trim().slice(0, 30)}`;
    if (box.bottom < 0 || box.top > innerHeight) return `out of sight: ${words}`;
    const style = getComputedStyle(at.matches(".unseen") && at.labels?.[0] ? at.labels[0] : at);
    const isReadFrom = at.tabIndex < 0;
    return isReadFrom || style.outlineStyle !== "none" ? null : `without a mark: ${words}`;
  });

const focused = (locator) => locator.evaluate((element) => element === document.activeElement);

/** Goes on to an element by Tab; every step has its mark. */
async function reach(locator) {
  await locator.waitFor({ state: "attached" });
  for (let press = 0; press < FAR && !(await focused(locator)); press++) {
    await page.keyboard.press("Tab");
    const trouble = await lost();
    // Beyond the last element the browser's own bar has the focus.
    if (trouble !== null && trouble !== "nothing is in focus") assert.fail(`${trouble} on the way to ${locator}`);
  }
  assert.ok(await focused(locator), `${locator} is not reached`);
}

/** Presses a key on an element; `seen` is there afterwards, and the focus is not lost. */
async function press(locator, key, seen) {
  await reach(locator);
  await page.keyboard.press(key);
  await seen.waitFor();
  await quiet(page);
  assert.equal(await lost(), null, `after ${key} on ${locator}`);
}

async function type(label, text) {
  await reach(page.getByLabel(label, { exact: true }));
  await page.keyboard.press("Control+A");
  await page.keyboard.type(text);
}

const button = (name) => page.getByRole("button", { name, exact: true });
const heading = (name) => page.getByRole("heading", { level: 1, name });

let session;

test("a file becomes an advice, and the advice a session", async () => {
  await visitQuiet(page, `${ballast.url}/#/`);
  const file = page.locator("input[type=file]");
  // The browser is told to pass on its file dialog well before the dialog opens.
  const chooser = page.waitForEvent("filechooser");
  await reach(file);
  await page.keyboard.press("Enter");
  await (await chooser).setFiles(RETURNS);
  await page.getByText("120 monthly simple returns", { exact: false }).first().waitFor();
  await page.locator("#advice").waitFor();
  assert.equal(await lost(), null, "after the file");
  await type("Wealth now", "250000");
  await quiet(page);
  const follow = page.getByRole("link", { name: "Follow this for a client" });
  await press(follow, "Enter", heading("Train a policy"));
  await type("Months ahead", "3");
  await reach(button("Train"));
  await page.keyboard.press("Enter");
  await heading("Open a session").waitFor({ timeout: 120_000 });
  await quiet(page);
  assert.equal(await lost(), null, "after the training");
  await type("Name", "Ada");
  await press(button("Open"), "Enter", heading("Ada"));
  [{ session }] = (await call(ballast.url, "/sessions")).sessions;
  const { allocation } = await call(ballast.url, `/action?session=${session}`);
  assert.match(plain(await page.locator("#advice .big").innerText()), new RegExp(`\\b${(100 * allocation).toFixed(1).replace(/\.0$/, "(\\.0)?")} %`));
});

test("a month is reported, and the next advice has the focus", async () => {
  const field = page.locator("form.observe input").first();
  await reach(field);
  await page.keyboard.type("1.5");
  await page.keyboard.press("Enter");
  await page.locator(".receipt").waitFor();
  await quiet(page);
  assert.equal(await lost(), null, "after the report");
  assert.ok(await page.evaluate(() => document.activeElement.closest("#advice, .receipt") !== null), "the advice is read next");
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.deepEqual(observations.map(({ reported }) => reported.simple_return), [0.015]);
});

test("the month is corrected", async () => {
  await press(page.getByRole("button", { name: "Correct it", exact: true }).first(), "Enter", page.locator('[name="reason"]'));
  await type("Why", "a typing error");
  await type("Return, %", "-1.5");
  await page.keyboard.press("Enter");
  await page.getByText(/was corrected on .*: a typing error/).waitFor();
  await quiet(page);
  assert.equal(await lost(), null, "after the correction");
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.equal(observations[0].now.reported.simple_return, -0.015);
});

test("a report is taken back after the question, and stays if the answer is no", async () => {
  const missing = async () => (await call(ballast.url, `/sessions/${session}/history`)).observations[0].now.reported.missing === true;
  for (const [answer, words, wanted] of [["dismiss", null, false], ["accept", /The report was taken back/, true]]) {
    page.once("dialog", (dialog) => dialog[answer]());
    await reach(page.getByRole("button", { name: "take it back" }));
    await page.keyboard.press("Enter");
    if (words) await page.getByText(words).waitFor();
    await quiet(page);
    assert.equal(await lost(), null, `after ${answer}`);
    assert.equal(await missing(), wanted, answer);
  }
});

test("the letter is opened and printed", async () => {
  await press(page.getByRole("link", { name: "Letter", exact: true }), "Enter", page.locator(".letter"));
  await page.evaluate(() => (window.print = () => (window.wasPrinted = true)));
  await reach(button("Print"));
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => window.wasPrinted), true);
  assert.equal(await lost(), null, "after the print");
});
