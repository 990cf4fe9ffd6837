// Every page on paper: nothing to press, nothing cut, no heading of nothing, dark on white.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";
import { call, ended, trained } from "./ballast.js";
import { quiet, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k));
const BOTH = HISTORY.map((value, k) => [value, 0.003 + 0.01 * Math.cos(2.3 * k)]);
const STOCK = JSON.parse(await readFile(new URL("../../examples/problems/stock.json", import.meta.url), "utf8"));
const CLIENTS = ["Ada", "Maximilian Oberhuber-Schwarzenberg", "Trust"];
/** The width of A4 between margins of 16 mm, in pixels: upright, and across as the overview is printed. */
const [UPRIGHT, ACROSS] = [672, 1001];
const EXAMPLE = "Use the example: US stock market, monthly";

let places;

const done = async (path, request) => (await ended(ballast.url, (await call(ballast.url, path, request)).job)).job;

before(async () => {
  const design = { count: 10 };
  const problem = { horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY };
  const wide = { ...problem, assets: ["Stocks", "Bonds"], history: BOTH, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const one = await trained(ballast.url, { problem, design, name: "Balanced" });
  const several = await trained(ballast.url, { problem: wide, design });
  const declared = await trained(ballast.url, { ...STOCK, problem: { ...STOCK.problem, horizon: 2 }, design });
  const sessions = [];
  for (const name of CLIENTS) sessions.push((await call(ballast.url, "/sessions", { policy: name === "Trust" ? several : one, name, wealth: 510_101.5, tags: ["pension"] })).session);
  await call(ballast.url, "/observe", { session: sessions[0], period: 1, simple_return: 0.02, date: "2026-01-31" });
  await call(ballast.url, "/observe", { session: sessions[2], period: 1, log_returns: { Stocks: 0.02, Bonds: -0.01 } });
  const dates = HISTORY.map((_, k) => `${2004 + Math.floor(k / 4)}-${String(3 * (k % 4) + 3).padStart(2, "0")}`);
  const walk = { rate: 0.002, periods_per_year: 4, dates, log_returns: HISTORY };
  places = [
    ...["#/", "#/policies", "#/jobs", "#/plan", "#/sleeve", "#/advise", "#/train", "#/evaluations", "#/subscriptions", "#/key", `#/report?sessions=${sessions[0]}`],
    ...[one, several, declared].map((policy) => `#/policies/${policy}`),
    ...[sessions[0], sessions[2]].map((session) => `#/sessions/${session}`),
    `#/letters?sessions=${sessions[0]},${sessions[2]}`,
    `#/compare?policies=${one},${several}`,
    `#/compare?sessions=${sessions[0]},${sessions[2]}`,
    `#/evaluations/${await done("/evaluate", { problem, design, frameworks: ["adaptive"], paths: 100 })}`,
    `#/backtests/${await done("/backtest", { ...walk, window: 8, every: 4, count: 10, alpha: [0.5] })}`,
    `#/backtests/${await done("/backtest", { ...walk, assets: ["Stocks", "Bonds"], log_returns: BOTH, windows: [8], alpha: 0.5 })}`,
    `#/frontiers/${await done("/frontier", { problem: { history: HISTORY, rate_per_step: 0.002 } })}`,
  ];
  await page.emulateMedia({ media: "print", colorScheme: "dark" });
});

/** Returns the faults of the page as it is printed. A choice is printed as the words that are chosen. */
const faults = () =>
  page.evaluate(() => {
    const main = document.querySelector("main");
    const box = (element) => element.getBoundingClientRect();
    const isSeen = (element) => element.checkVisibility() && box(element).width > 1;
    const words = (element) => `${element.tagName} ${element.textContent.trim().slice(0, 40)}`;
    const seen = (selector, within = main) => [...within.querySelectorAll(selector)].filter(isSeen);
    const isBright = (colour) => /\d+/g.exec(colour) && Math.max(...colour.match(/[\d.]+/g).slice(0, 3)) > 140;
    const heads = [...main.querySelectorAll("h1, h2, h3")];
    const isLeftOut = (element) => element.closest("form, details:not([open]), .asked-for, .caution-choice") !== null;
    const shows = (section) => [...section.querySelectorAll("figure, table, .sentence")].some((element) => !isLeftOut(element));
    return {
      pressed: seen("button, .button, input, textarea, nav, summary", document.body).map(words),
      wide: seen("*").filter((element) => box(element).right > document.documentElement.clientWidth + 1 && !element.closest(".unseen")).map(words),
      cut: seen("pre, td, th").filter((element) => element.scrollWidth > element.clientWidth + 1 && getComputedStyle(element).overflowX !== "visible").map(words),
      alone: seen("section > h2").filter((head) => seen("*", head.parentElement).every((element) => element === head || head.contains(element))).map(words),
      lost: heads.filter((head) => !isSeen(head) && !isLeftOut(head) && (head.matches("h1") ? !main.querySelector(".letter") : shows(head.parentElement))).map(words),
      bright: [...seen("p, h1, h2, td, th"), ...seen("svg text")].filter((element) => isBright(getComputedStyle(element)[element.matches("text") ? "fill" : "color"]) && !element.closest(".shaded, .wrong, .error")).map(words),
      outlined: [document.activeElement].filter((element) => element !== document.body && isSeen(element) && getComputedStyle(element).outlineStyle !== "none").map(words),
    };
  });

const NONE = { pressed: [], wide: [], cut: [], alone: [], lost: [], bright: [], outlined: [] };

test("every view is printed whole, and without anything to press", async () => {
  for (const place of places) {
    await page.setViewportSize({ width: place === "#/" ? ACROSS : UPRIGHT, height: 950 });
    await visitQuiet(page, `${ballast.url}/${place}`);
    assert.deepEqual(await faults(), NONE, place);
  }
});

test("the overview is printed with a line for each client, and its head on each page", async () => {
  await page.setViewportSize({ width: ACROSS, height: 950 });
  await visitQuiet(page, `${ballast.url}/#/`);
  const heights = await page.locator("tbody tr").evaluateAll((rows) => rows.map((row) => row.getBoundingClientRect().height));
  assert.equal(heights.length, CLIENTS.length);
  assert.ok(Math.max(...heights) < 1.1 * Math.min(...heights) && Math.max(...heights) < 30, `${heights}`);
  assert.match(await page.locator("tbody").innerText(), /overdue by \d+ days/);
  // A button in a head is printed on the first page only.
  const displays = await page.locator("thead").evaluate((head) => [head, ...head.querySelectorAll("button")].map((element) => getComputedStyle(element).display));
  assert.deepEqual([displays[0], new Set(displays.slice(1))], ["table-header-group", new Set(["contents"])]);
});

test("a plan is printed with its answer", async () => {
  await page.emulateMedia({ media: "screen" });
  await visitQuiet(page, `${ballast.url}/#/plan`);
  await page.getByRole("button", { name: EXAMPLE }).click();
  await page.getByText("The latest 240", { exact: false }).waitFor();
  await page.getByLabel("Years", { exact: true }).fill("5");
  await page.getByRole("button", { name: "Make the plan" }).click();
  await page.locator("#plan").waitFor();
  await quiet(page);
  await page.setViewportSize({ width: UPRIGHT, height: 950 });
  await page.emulateMedia({ media: "print" });
  assert.deepEqual(await faults(), NONE);
});

test("a page of the guide is printed without the list of pages, and its code whole", async () => {
  await page.goto(`${ballast.url}/guide`);
  const links = await page.locator("nav a").evaluateAll((links) => links.map(({ href }) => href.split("#")[0]));
  for (const address of new Set(links)) {
    await page.goto(address);
    assert.deepEqual(await faults(), NONE, address);
  }
});
