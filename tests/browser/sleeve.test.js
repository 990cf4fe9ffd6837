// From a file to the share of a strategy: one record, several, and trades.

import assert from "node:assert/strict";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { call } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const RETURNS = fileURLToPath(new URL("../../data/us_market_monthly.csv", import.meta.url));
const { share } = await dashboardModule("sleeve_answer.js");
const { percent } = await dashboardModule("format.js");

const TRADES = [0.6, -0.4, 0.5, 0.3, -0.5, 0.7, 0.4, -0.3, 0.5, 0.6, -0.4, 0.2];
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const size = () => page.getByRole("button", { name: "Size the strategy" });
/** Returns the next request and its answer. */
const sized = async (act) => {
  const [response] = await Promise.all([page.waitForResponse((one) => one.url().endsWith("/sleeve") && one.ok()), act()]);
  await page.locator("#sleeve").waitFor();
  return { request: response.request().postDataJSON(), answer: await response.json() };
};
const sentences = async () => (await page.locator("#sleeve :is(.first, .points li)").allInnerTexts()).map(plain);
const cells = async (region) => (await page.getByRole("region", { name: region }).locator("tbody tr").evaluateAll((rows) => rows.map((row) => [...row.children].map((cell) => cell.innerText)))).map((row) => row.map(plain));

test("a file is sized: the answer is that of the interface, in its sentences, beside the Kelly share", async () => {
  await go("");
  await page.getByRole("link", { name: "Size a strategy" }).click();
  await page.getByRole("heading", { level: 1, name: "How much of this strategy?" }).waitFor();
  await page.locator("input[type=file]").setInputFiles(RETURNS);
  await page.getByText("1109 monthly simple returns", { exact: false }).waitFor();
  const { request, answer } = await sized(() => size().click());
  const { problem } = request;
  assert.deepEqual([problem.history.length, problem.periods_per_year, problem.caution, request.record_of], [1109, 12, "paper", "periods"]);
  assert.deepEqual(await call(ballast.url, "/sleeve", request), answer, "the same question in a program");
  assert.deepEqual(await sentences(), answer.sentences.map(plain));
  const { share: own, kelly, growth_a_year: growth } = answer;
  const rows = [["The share", own, growth.share], ["The Kelly share", kelly, growth.kelly], ["The bank alone", 0, { record: growth.bank, worst: growth.bank }]];
  assert.deepEqual(await cells("The share beside the Kelly share"), rows.map(([name, part, { record, worst }]) => [name, share(part), percent(record), percent(worst)].map(plain)));
  assert.deepEqual((await call(ballast.url, "/jobs")).jobs, [], "nothing is trained");
});

test("trades need no bank and no periods, and are staked", async () => {
  await go("#/sleeve");
  await page.getByLabel("Returns, prices or trades").fill(TRADES.join("\n"));
  await page.getByLabel("Each value is").selectOption("trades");
  assert.equal(await page.getByLabel("Periods a year").isVisible(), false);
  await page.getByLabel(/^Fractions/).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  // Trades spread more than months do.
  await page.getByLabel(/^Yes, that is right/).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByText("12 simple returns as fractions", { exact: false }).waitFor();
  const { request, answer } = await sized(() => size().click());
  assert.deepEqual([request.record_of, request.problem.rate_per_step, "periods_per_year" in request.problem], ["trades", 0, false]);
  assert.match((await sentences())[0], /on each trade|nothing/);
  assert.deepEqual(await sentences(), answer.sentences.map(plain));
});

test("several columns are several strategies", async () => {
  await go("#/sleeve");
  await page.getByRole("button", { name: "Start again" }).click();
  const lines = TRADES.map((value, at) => `2020-${String(at + 1).padStart(2, "0")},${value / 10},${(TRADES.at(-1 - at) / 12).toFixed(4)}`);
  await page.getByLabel("Returns, prices or trades").fill(["month,trend,carry", ...lines].join("\n"));
  await page.getByLabel("trend").check();
  await page.getByLabel("carry").check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByText("as in columns trend, carry", { exact: false }).waitFor();
  const { request, answer } = await sized(() => size().click());
  assert.deepEqual(request.problem.assets, ["trend", "carry"]);
  const rows = Object.entries(answer.strategies).map(([name, one]) => [name, share(one.share), share(one.kelly), percent(one.mean.seen, 2), percent(one.mean.worst, 2)].map(plain));
  assert.deepEqual(await cells("The strategies"), rows);
});

test("errors stand at their fields", async () => {
  await go("#/sleeve");
  await page.getByRole("button", { name: "Start again" }).click();
  await size().click();
  await page.getByText("Returns are needed: paste them, or choose a file.").waitFor();
});
