// A backtest asked for and shown on the page: sentences first, then every strategy, then one of them year by year.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { call } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visit, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const { ordinal } = await dashboardModule("verdict.js");

/** A walk takes some seconds of an idle processor, and other programs may use it. */
const JOB_TIMEOUT = 120_000;
const QUARTERS = 56;
const WINDOW = 8;
/** Quarters from March 2004 on, the newest first, in percent. */
const RETURNS = Array.from({ length: QUARTERS }, (_, k) => Number((2.5 + 7 * Math.sin(1.7 * k) - (k === 30 ? 22 : 0)).toFixed(2)));
const RATES = Array.from({ length: QUARTERS }, (_, k) => (k % 8 < 4 ? 0.5 : 0.3));
const date = (k) => `${2004 + Math.floor(k / 4)}-${String(3 * (k % 4) + 3).padStart(2, "0")}`;
const rows = RETURNS.map((back, k) => `${date(k)},${back},${RATES[k]}`).reverse();
const TEXT = `quarter,fund,rf\n${rows.join("\n")}\n`;

let report;

const main = async () => plain(await page.locator("main").innerText());
const cells = async (name) => {
  const table = page.getByRole("table", { name });
  const read = (locator) => locator.evaluateAll((found) => found.map((row) => [...row.children].map(({ textContent }) => textContent)));
  return (await read(table.locator("tr"))).map((row) => row.map(plain));
};
const percent = (fraction) => `${(100 * fraction).toFixed(1).replace(/^-(?=0\.0$)/, "")} %`;

test("what is asked for is the record as it was read, and few choices", async () => {
  await visitQuiet(page, `${ballast.url}/#/evaluations`);
  await page.getByRole("link", { name: "Backtest a record" }).click();
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await page.getByText("Returns are needed: paste them, or choose a file.").waitFor();
  await page.getByLabel("Returns or prices").fill("0.01 0.02 -0.03 0.04 0.01 -0.02");
  await page.getByText("6 simple returns").waitFor();
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await page.getByText("The bank return is missing").waitFor();
  await page.getByLabel("Periods a year").waitFor();
  await page.getByLabel("Returns or prices").fill(TEXT);
  await page.getByText("Blank: the rates in the column rf, quarter by quarter.").waitFor();
  await page.getByLabel("Periods a year").waitFor({ state: "hidden" });
  await page.getByText("How the backtest works, and for the quant").click();
  await page.getByLabel("Window", { exact: true }).fill("600");
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  // The refusal stands at the field, and opens the fold it is in.
  const refused = page.locator(".error").getByText(/^Window is 600; it must be at most \d+: the record has \d+ periods, and a year of 4 must follow the window\.$/);
  await refused.waitFor();
  const fold = page.locator("details", { has: page.getByLabel("Window", { exact: true }) });
  await fold.evaluate((details) => (details.open = false));
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await refused.waitFor();
  assert.equal(await fold.evaluate((details) => details.open), true);
  await page.getByLabel("Window", { exact: true }).fill(String(WINDOW));
  await page.getByLabel("Train every").fill("9");
  await page.getByLabel("Periods ahead").fill("4");
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await page.locator(".error").getByText("Train every is 9; it must be at least 1 and at most \u201cPeriods ahead\u201d: each policy is used until the next is trained.").waitFor();
  for (const label of ["Train every", "Periods ahead"]) await page.getByLabel(label).fill("");
  await page.getByLabel("Confidence, %").fill("90; 50");
  await page.getByLabel("Design points").fill("10");
  const asked = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/backtest"));
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  const request = (await asked).postDataJSON();
  assert.deepEqual([request.dates[0], request.dates.at(-1)], ["2004-03", date(QUARTERS - 1)]);
  assert.ok(Math.abs(Math.expm1(request.log_returns[3]) - RETURNS[3] / 100) < 1e-12);
  assert.deepEqual([request.rate.length, request.rate[0], request.alpha, request.trading_cost, request.risk_aversion], [QUARTERS, 0.005, [0.1, 0.5], 0.001, 3]);
  // As an advice is.
  assert.deepEqual([request.caution, request.support], ["balanced", { rule: "worst_seen" }]);
});

test("it is followed to its end, and what it says comes first", async () => {
  await page.getByRole("heading", { name: "Results of each strategy" }).waitFor({ timeout: JOB_TIMEOUT });
  const job = page.url().split("/").at(-1);
  assert.equal(await page.locator("h1").textContent(), "Backtest of stocks, March 2006 to December 2017");
  await page.locator(`header.page [title="${job}"]`).getByText(/^Requested on \d+ \w+ \d{4}/).waitFor();
  report = await call(ballast.url, `/jobs/${job}/report`);
  const words = await main();
  assert.match(words, /8 ways to hold stocks, through 48 quarters, March 2006 to December 2017, for a balanced investor/);
  assert.match(words, /Every 4 quarters policies are trained on the 8 quarters before, and followed until the next training\. The cautious ones act at the balanced level of caution\./);
  assert.match(words, /Each of them rests on 8 returns: with fewer than 24, the record has not yet shown most of what the asset can do\./);
  const [, second] = report.strategies;
  assert.ok(words.includes(`was all in the bank in ${(100 * second.all_bank_share).toFixed(0)} % of the quarters`), words);
  const shown = await cells("Strategies, by what a year of each is worth");
  const worths = shown.slice(1).map(([, worth]) => Number(worth));
  assert.equal(worths.length, report.strategies.length);
  assert.equal(worths.length, 9);
  assert.match(words, /Nobody knew that share beforehand, so it is not ranked with the others\./);
  assert.deepEqual(worths, [...worths].sort((one, other) => other - one));
  // Each has one name and one place, here as in the report.
  assert.deepEqual(shown.slice(1).map(([name]) => name).sort(), report.strategies.map(({ strategy }) => plain(strategy)).sort());
  if (second.place > 1) assert.ok(words.includes(`comes ${ordinal(second.place)} of 8`), `${second.place}: ${words}`);
  const mixed = report.strategies.find(({ strategy }) => strategy === "60/40");
  const row = shown.find(([name]) => name === "60/40");
  const grown = (mixed.final_wealth / 100) ** (4 / report.periods[0].wealth.length) - 1;
  assert.deepEqual(shown[0].slice(3, 5), ["Growth a year", "Mean return a year"]);
  assert.deepEqual(row.slice(1, 6), [mixed.yearly_certainty_equivalent.value.toFixed(2), mixed.final_wealth.toFixed(2), percent(grown), percent(mixed.annual_mean.value), percent(mixed.annual_volatility.value)]);
  assert.doesNotMatch(words, /undefined|NaN|null|alpha|plug-in|risky asset/);
});

test("one strategy is told by its worst falls, its years and its quarters", async () => {
  await page.getByLabel("Strategy", { exact: true }).selectOption("All in stocks");
  // Bought once at a cost of a thousandth, then what the record says.
  const lived = RETURNS.slice(WINDOW).map((back) => 1 + back / 100);
  lived[0] *= 1 - 0.001;
  const wealth = lived.reduce((levels, growth) => [...levels, levels.at(-1) * growth], [100]);
  const worst = wealth.reduce((worst, level, to) => {
    const depth = level / Math.max(...wealth.slice(0, to + 1)) - 1;
    return depth < worst.depth ? { depth, to } : worst;
  }, { depth: 0 });
  const named = (k) => new Date(`${date(WINDOW + k - 1)}-01T00:00:00Z`).toLocaleDateString("en-GB", { month: "long", year: "numeric", timeZone: "UTC" });
  const peak = Math.max(...wealth.slice(0, worst.to));
  const made = wealth.findIndex((level, k) => k > worst.to && level >= peak);
  const [, deepest] = await cells("The worst falls of All in stocks");
  assert.deepEqual(deepest, [named(wealth.indexOf(peak)), named(worst.to), named(made), percent(worst.depth), `${made - wealth.indexOf(peak)} quarters`]);
  const years = await cells("Returns by the year of All in stocks and of others");
  const of2008 = lived.slice(8, 12).reduce((product, growth) => product * growth) - 1;
  assert.equal(years.find(([year]) => year === "2008")[1], percent(of2008));
  const five = wealth.slice(20).map((level, k) => (level / wealth[k]) ** (1 / 5) - 1);
  const rolled = page.getByRole("figure", { name: "Return a year over the 5 years before" });
  assert.equal(plain(await rolled.locator("p.note").textContent()), `Over any 5 years of the record \u201cAll in stocks\u201d earned between ${percent(Math.min(...five))} and ${percent(Math.max(...five))} a year.`);
  const map = await cells("Returns of All in stocks quarter by quarter");
  assert.deepEqual(map[0].slice(1), ["Mar", "Jun", "Sep", "Dec", "Whole year"]);
  assert.deepEqual(map.find(([year]) => year === "2008").slice(1), [...lived.slice(8, 12).map((growth) => percent(growth - 1)), percent(of2008)]);
});

test("a strategy has one colour in every chart", async () => {
  const stroke = (locator) => locator.evaluate((element) => getComputedStyle(element).stroke);
  await page.getByLabel("Strategy", { exact: true }).selectOption("Trusts the record");
  const [, own] = [await page.getByText("Radius").count(), await stroke(page.locator("figure:has-text('Growth of 100') path.line").first())];
  // The record is too short for ranges: estimates alone are drawn, and the page says why.
  assert.ok(report.whole_years < 30, `${report.whole_years}`);
  assert.equal(await page.locator("line.range").count(), 0);
  assert.match(await main(), /The chart has no ranges: with fewer than 30 years they would promise too much\./);
  const dots = page.locator("figure:has-text('is worth as much as a sure') circle.dot");
  const names = await page.locator("figure:has-text('is worth as much as a sure') text.name").allTextContents();
  assert.equal(await dots.nth(names.indexOf("Trusts the record")).evaluate((dot) => getComputedStyle(dot).fill), own);
  const colours = await dots.evaluateAll((dots) => dots.map((dot) => getComputedStyle(dot).fill));
  assert.equal(new Set(colours).size, report.strategies.length);
});

test("what every strategy did is saved as a file", async () => {
  const saving = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save as CSV" }).click();
  const lines = (await readFile(await (await saving).path(), "utf8")).trim().split("\r\n");
  assert.equal(lines.length, 2 + QUARTERS - WINDOW);
  assert.equal(lines[0].match(/: wealth/g).length, report.strategies.length);
  const last = lines.at(-1).split(",");
  assert.deepEqual(last.slice(0, 2), ["48", "2017-12"]);
  assert.ok(Math.abs(last.at(-1) - report.strategies.at(-1).final_wealth) < 1e-6);
});

test("falls, years and months of a track record are those of its levels", async () => {
  const { belowHighest, compounded, grouped, places, returnsOf, rolling, worstFalls } = await dashboardModule("track.js");
  const levels = [100, 110, 99, 121, 60.5, 90, 121, 120];
  assert.deepEqual(worstFalls(belowHighest(levels), 2).map(({ depth, from, to, back }) => [Number(depth.toFixed(6)), from, to, back]), [[-0.5, 3, 4, 6], [-0.1, 1, 2, 3]]);
  assert.equal(worstFalls(belowHighest(levels), 9).at(-1).back, null);
  assert.ok(Math.abs(compounded(returnsOf(levels)) - 0.2) < 1e-12);
  assert.deepEqual(rolling(levels, 1.5, 2).map((back) => (back === null ? null : Number(((1 + back) ** 1.5).toFixed(6)))), [null, null, null, 1.21, 0.55, 0.909091, 1, 1.983471]);
  const days = places(["2008-01-30", "2008-01-31", "2008-02-01", "2009-02-02"], 4, 252);
  assert.deepEqual(grouped(days, ({ year, part }) => `${year} ${part}`), [["2008 01", [0, 1]], ["2008 02", [2]], ["2009 02", [3]]]);
  assert.deepEqual(places(null, 14, 12).slice(11, 13), [{ year: "1", part: "12" }, { year: "2", part: "1" }]);
  assert.deepEqual([places(null, 2, 1)[1], places(["2008", "2009"], 2, 1)[1]], [{ year: "2", part: null }, { year: "2009", part: null }]);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, folds open", async () => {
  await page.getByText("Ranges, ratios and radii").click();
  await page.getByRole("table", { name: "Estimates with their ranges" }).waitFor();
  await usable(page, () => {});
  await usable(page, () => visitQuiet(page, `${ballast.url}/#/backtests/new`));
});

test("on paper the months of a year stand beside each other in its width", async () => {
  const dates = Array.from({ length: 48 }, (_, k) => `${2004 + Math.floor(k / 12)}-${String((k % 12) + 1).padStart(2, "0")}`);
  const log_returns = dates.map((_, k) => 0.008 + 0.25 * Math.sin(1.7 * k));
  const { job } = await call(ballast.url, "/backtest", { log_returns, dates, rate: 0.002, window: 24, alpha: [0.5], count: 10 });
  await visitQuiet(page, `${ballast.url}/#/backtests/${job}`);
  await page.getByRole("heading", { name: "Results of each strategy" }).waitFor({ timeout: JOB_TIMEOUT });
  assert.doesNotMatch(await main(), /most of what the asset can do|false/);
  await page.getByLabel("Strategy", { exact: true }).selectOption("All in stocks");
  await page.emulateMedia({ media: "print" });
  // A4 without its margins.
  await page.setViewportSize({ width: 672, height: 1000 });
  const map = page.locator(".map table");
  assert.equal(await map.locator("thead th").count(), 14);
  const [right, edge] = await map.evaluate((table) => [table.getBoundingClientRect().right, document.documentElement.clientWidth]);
  assert.ok(right <= edge, `${right} of ${edge}`);
  await page.emulateMedia({ media: "screen" });
  await page.setViewportSize({ width: 1280, height: 900 });
});

const OTHER = Array.from({ length: QUARTERS }, (_, k) => Number((1.5 + 4 * Math.cos(2.9 * k)).toFixed(2)));

test("a record of several assets is asked for, and its report shows what was held of each", async () => {
  await visitQuiet(page, `${ballast.url}/#/backtests/new`);
  const table = RETURNS.map((back, k) => `${date(k)},${back},${OTHER[k]},${RATES[k]}`);
  await page.getByLabel("Returns or prices").fill(`quarter,fund,bonds,rf\n${table.join("\n")}\n`);
  const question = page.getByRole("group", { name: /Several columns mean several assets/ });
  for (const name of ["fund", "bonds"]) await question.getByLabel(name, { exact: false }).first().check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByText("How the backtest works, and for the quant").click();
  await page.getByLabel("Windows").waitFor();
  assert.equal(await page.getByLabel("Design points").isVisible(), false);
  await page.getByLabel("Strategies").selectOption({ label: "The trained policy of a session" });
  assert.equal(await page.getByLabel("Design points").isVisible(), true);
  await page.getByLabel("Strategies").selectOption({ label: "The one-step rule" });
  await page.getByLabel("Windows").fill("1; all");
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await page.getByText("Windows is 1; it must be from 2 to 10,000.").waitFor();
  await page.getByLabel("Windows").fill("8; all");
  await page.getByLabel("A formula of your own").fill("1/deviation8 +");
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  await page.locator(".error").getByText("column 15", { exact: false }).waitFor();
  assert.equal(await page.getByLabel("A formula of your own").getAttribute("aria-invalid"), "true");
  await page.getByLabel("A formula of your own").fill("1/deviation8");
  const asked = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/backtest"));
  await page.getByRole("button", { name: "Backtest", exact: true }).click();
  const request = (await asked).postDataJSON();
  assert.deepEqual([request.assets, request.strategies, request.windows, request.alpha, request.log_returns.length], [["fund", "bonds"], ["one_step"], [8, null], 0.1, QUARTERS]);
  assert.deepEqual(request.weights, { "Your formula": "1/deviation8" });
  await page.getByRole("heading", { name: "Results of each strategy" }).waitFor({ timeout: JOB_TIMEOUT });
  const told = await call(ballast.url, `/jobs/${page.url().split("/").at(-1)}/report`);
  assert.equal(await page.locator("h1").textContent(), "Backtest of fund and bonds, March 2006 to December 2017");
  const words = await main();
  assert.match(words, /23 ways to hold 2 assets, through 48 quarters, March 2006 to December 2017, for a balanced investor/);
  for (const sentence of told.sentences) assert.ok(words.includes(plain(sentence)), sentence);
  const shown = await cells("Strategies, by what a year of each is worth");
  assert.equal(shown.length, 1 + told.strategies.length);
  const equal = told.strategies.find(({ strategy }) => strategy === "Equal shares");
  const row = shown.find(([name]) => name === "Equal shares");
  assert.deepEqual([row[1], row[2], row[10]], [equal.yearly_certainty_equivalent.value.toFixed(2), equal.final_wealth.toFixed(2), "2.0"]);
  assert.doesNotMatch(words, /undefined|NaN|null/);

  await page.getByLabel("Strategy", { exact: true }).selectOption("Equal shares");
  assert.deepEqual((await cells("Held of each asset on average by Equal shares")).slice(1), [["fund", "50.0 %"], ["bonds", "50.0 %"]]);
  // Equal shares, bought at a cost of a thousandth and brought back to a half each quarter.
  let [level, held] = [100, [0, 0]];
  const lived = RETURNS.slice(WINDOW).map((back, k) => [back, OTHER[WINDOW + k]].map((part) => 1 + part / 100));
  const wealth = lived.map((growths) => {
    const traded = held.reduce((all, share) => all + Math.abs(0.5 - share), 0);
    const grown = (growths[0] + growths[1]) / 2;
    level *= (1 - 0.001 * traded) * grown;
    held = growths.map((growth) => growth / 2 / grown);
    return level;
  });
  const years = await cells("Returns by the year of Equal shares and of others");
  assert.equal(years.find(([year]) => year === "2008")[1], percent(wealth[11] / wealth[7] - 1));
  await page.getByRole("table", { name: "The worst falls of Equal shares" }).waitFor();
  await page.getByRole("table", { name: "Returns of Equal shares quarter by quarter" }).waitFor();
  await page.getByText("Ranges and ratios").click();
  await page.getByRole("table", { name: "Estimates with their ranges" }).waitFor();
  await usable(page, () => {});
});

test("the list calls each by what it is about, and none by its identifier", async () => {
  await visit(page, `${ballast.url}/#/evaluations`);
  for (const name of ["Backtest of stocks, March 2006 to December 2017", "Backtest of fund and bonds, March 2006 to December 2017"]) await page.getByRole("heading", { level: 2, name, exact: true }).waitFor();
  assert.doesNotMatch(await page.locator("body").innerText(), /[0-9a-f]{10}/);
});
