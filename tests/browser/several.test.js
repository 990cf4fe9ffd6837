// A session of several assets: what to hold of each, a return reported for each, and what the worst market makes of each.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";
import { call, ended, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visit, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const ASSETS = ["World", "Bonds A/B", "Gold"];
const HISTORY = [
  [0.0131, 0.003, 0.018], [-0.0442, 0.009, -0.046], [0.021, -0.004, 0.028], [0.033, 0.002, 0.015], [-0.012, 0.001, 0.005],
  [0.008, 0.005, -0.006], [0.045, -0.002, 0.03], [-0.027, 0.006, -0.008], [0.016, 0.003, 0.006], [0.002, 0.001, 0.003],
];
const COST = 0.001;

let session;

before(async () => {
  page.setDefaultTimeout(10_000);
  const policy = await trained(ballast.url, {
    problem: { assets: ASSETS, horizon: 4, rate_per_step: 0.001, periods_per_year: 12, history: HISTORY, trading_cost: COST, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } },
    design: { count: 10 },
  });
  ({ session } = await call(ballast.url, "/sessions", { policy, wealth: 250_000, name: "Trust" }));
});

const go = () => visitQuiet(page, `${ballast.url}/#/sessions/${session}`);
const rows = async (name) => {
  const texts = await page.getByRole("table", { name }).locator("tbody tr").allInnerTexts();
  return Object.fromEntries(texts.map((text) => plain(text).replaceAll(",", "").split(/\t|\n/).map((cell) => cell.trim()).filter(Boolean)).map(([name, ...cells]) => [name, cells]));
};
const near = (told, value, within) => assert.ok(Math.abs(Number.parseFloat(told) - value) <= within, `${told} for ${value}`);

test("the advice is told by asset, in percent and in money, and comes to the whole", async () => {
  await go();
  const action = await call(ballast.url, `/action?session=${session}`);
  const told = await rows("What to hold of each asset");
  // From the bank alone all that is held is bought.
  const all = 250_000 * (1 - COST * action.total);
  for (const name of ASSETS) {
    const [share, money, now, nowMoney, trade] = told[name];
    near(share, 100 * action.allocation[name], 0.05);
    near(money, action.allocation[name] * all, 0.51);
    assert.deepEqual([now, nowMoney], ["0 %", "0.00"]);
    if (action.allocation[name] > 0.0005) near(trade.replace("Buy ", ""), action.allocation[name] * all, 0.51);
    else assert.equal(trade, "Nothing");
  }
  near(told["All of them"][0], 100 * action.total, 0.05);
  near(Number(told["All of them"][1]) + Number(told.Bank[1]), all, 1.1);
  const words = plain(await page.locator("#advice").innerText()).replaceAll(",", "");
  near(/Trading costs ([\d.]+)\./.exec(words)[1], 250_000 - all, 0.01);
  const promise = /worth as much as a sure ([\d.]+?)\.? at the end/.exec(words);
  near(promise[1], action.certainty_equivalent, 0.51);
  assert.doesNotMatch(plain(await page.locator("main").innerText()), /undefined|NaN|in stocks|certainty equivalent/);
});

test("each asset is told in shares where its price is typed, and the others are not", async () => {
  await go();
  const action = await call(ballast.url, `/action?session=${session}`);
  const all = 250_000 * (1 - COST * action.total);
  const most = ASSETS.reduce((one, other) => (action.allocation[other] > action.allocation[one] ? other : one));
  assert.ok(action.allocation[most] > 0.01);
  await page.getByText("In shares, at today\u2019s price").click();
  await page.getByLabel(`Price of ${most}`).fill("80");
  const shares = (/about ([\d,.]+) shares/g);
  const row = plain(await page.getByRole("table", { name: "What to hold of each asset" }).getByRole("row", { name: most }).innerText());
  const told = [...row.matchAll(shares)].map(([, number]) => Number(number.replaceAll(",", "")));
  // Held and bought: nothing is held now.
  assert.equal(told.length, 2, row);
  for (const number of told) near(number, (action.allocation[most] * all) / 80, 0.5);
  const table = plain(await page.getByRole("table", { name: "What to hold of each asset" }).innerText());
  assert.equal([...table.matchAll(shares)].length, 2, table);
});

test("the worst market is told of each asset by its average return", async () => {
  const { one_step } = await call(ballast.url, `/action?session=${session}`);
  const told = await rows("Average return of each asset a month");
  for (const name of ASSETS) {
    near(told[name][0], 100 * Math.expm1(one_step.worst_means[name].seen), 0.006);
    near(told[name][1], 100 * Math.expm1(one_step.worst_means[name].worst), 0.006);
  }
  const lowered = (name) => one_step.worst_means[name].seen - one_step.worst_means[name].worst;
  const most = ASSETS.reduce((one, other) => (lowered(other) > lowered(one) ? other : one));
  await page.getByText(`It takes most from ${most}:`, { exact: false }).waitFor();
});

test("a return is reported for each asset, and other shares where they were held", async () => {
  await go();
  const report = () => page.getByRole("button", { name: /^Report/ }).click();
  await page.getByLabel("Return of World, %").fill("1.5");
  await page.getByLabel("Return of Bonds A/B, %").fill("0,2");
  await report();
  await page.locator(".field .error").getByText("The return is blank.").waitFor();
  await page.getByLabel("Return of Gold, %").fill("-1");
  await page.getByLabel("Last day").fill("31.10.2020");
  const foretold = /\u2192 ([\d,.]+?) at/.exec(await page.locator(".observe output").innerText())[1].replaceAll(",", "");
  await report();
  await page.getByRole("heading", { name: "November 2020, period 2 of 4" }).waitFor();
  const [first] = (await call(ballast.url, `/sessions/${session}/history`)).observations;
  assert.deepEqual(first.reported.simple_returns, { World: 0.015, "Bonds A/B": 0.002, Gold: -0.01 });
  assert.equal("executed_allocations" in first.reported, false);
  near(foretold, first.wealth, 0.51);
  await page.getByText("I held other shares").click();
  await page.getByLabel("World held, %").fill("40");
  await page.getByLabel("Bonds A/B held, %").fill("10");
  await page.getByLabel("Gold held, %").fill("60");
  for (const name of ASSETS) await page.getByLabel(`Return of ${name}, %`).fill("1");
  await page.getByText("This will be refused: the shares held add up to 110.0\u202f%, more than 100\u202f%.").waitFor();
  await page.getByLabel("Gold held, %").fill("20");
  await page.getByLabel("Money added at the end").fill("-1000000");
  await page.getByText(/^This will be refused\. Money added at the end is \u22121,000,000; it must leave an allowed wealth: .* give a wealth of \u2212\d{3},\d{3}, and/).waitFor();
  await page.getByLabel("Money added at the end").fill("");
  await report();
  await page.getByRole("heading", { name: "December 2020, period 3 of 4" }).waitFor();
  const second = (await call(ballast.url, `/sessions/${session}/history`)).observations[1];
  assert.deepEqual(second.reported.executed_allocations, { World: 0.4, "Bonds A/B": 0.1, Gold: 0.2 });
});

test("what was held stands one above the other, read by keyboard and as a table", async () => {
  await go();
  const chart = page.getByRole("slider", { name: "Share of wealth in each asset" });
  await chart.press("End");
  assert.equal(plain(await chart.getAttribute("aria-valuetext")), "November 2020: World 40.0 %, Bonds A/B 10.0 %, Gold 20.0 %, Bank 30.0 %");
  // Seven tenths of the height between nothing and all are filled.
  const heights = await chart.locator("path.bar").evaluateAll((areas) => areas.map((area) => /M\S+ (\S+)H\S+V(\S+)H\S+Z$/.exec(area.getAttribute("d"))).map(([, top, foot]) => foot - top));
  near(heights.reduce((sum, height) => sum + height, 0), 0.7 * 150, 0.2);
  const told = await rows("Observed periods, newest first");
  assert.ok(told["November 2020"].filter((cell) => cell === "1.00 %").length >= 3, `${told["November 2020"]}`);
});

test("a period that passed is put right by name, and what was reported stays on record", async () => {
  await go();
  await page.getByText("Last report, November 2020: 1.00\u202f% of the assets together").waitFor();
  await page.getByText("Correct a period").click();
  const form = page.locator("form", { has: page.getByRole("button", { name: "Correct it" }) });
  assert.equal(await form.getByLabel("Return of World, %").inputValue(), "1");
  await form.getByText("I held other shares").click();
  assert.equal(await form.getByLabel("World held, %").inputValue(), "40");
  await form.getByLabel("Period").selectOption({ label: "October 2020" });
  assert.equal(await form.getByLabel("Return of World, %").inputValue(), "1.5");
  assert.equal(await form.getByLabel("World held, %").inputValue(), "");
  await form.getByLabel("World held, %").fill("30");
  await form.getByLabel("Why").fill("a slip");
  await form.getByRole("button", { name: "Correct it" }).click();
  await form.getByText("Give the share of every asset, or of none.").waitFor();
  await form.getByLabel("Bonds A/B held, %").fill("10");
  await form.getByLabel("Gold held, %").fill("5");
  await form.getByLabel("Return of World, %").fill("0.5");
  await form.getByRole("button", { name: "Correct it" }).click();
  await page.getByText(/October 2020 was corrected on .*: a slip/).waitFor();
  const history = await call(ballast.url, `/sessions/${session}/history`);
  assert.deepEqual(history.observations[0].now.reported.simple_returns, { World: 0.005, "Bonds A/B": 0.002, Gold: -0.01 });
  assert.deepEqual(history.observations[0].now.reported.executed_allocations, { World: 0.3, "Bonds A/B": 0.1, Gold: 0.05 });
  const told = await rows("Observed periods, newest first");
  assert.ok(told["October 2020"].includes("0.50 %"), `${told["October 2020"]}`);
  const chart = page.getByRole("slider", { name: "Share of wealth in each asset" });
  await chart.press("Home");
  assert.equal(plain(await chart.getAttribute("aria-valuetext")), "October 2020: World 30.0 %, Bonds A/B 10.0 %, Gold 5.0 %, Bank 55.0 %");
  const [file] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save as CSV" }).click()]);
  const { csvRows } = await dashboardModule("csv.js");
  const [head, , october] = csvRows(await readFile(await file.path(), "utf8"), ",").map(({ cells }) => cells);
  const cell = Object.fromEntries(head.map((name, index) => [name, october[index]]));
  // Of wealth 45 % was held: 30 of the first, 10 of the second and 5 of the third.
  const wanted = { "Return, %": (0.3 * 0.5 + 0.1 * 0.2 - 0.05) / 0.45, "Held, %": 45, "World returned, %": 0.5, "World held, %": 30, "Bonds A/B returned, %": 0.2, "Bonds A/B held, %": 10, "Gold returned, %": -1, "Gold held, %": 5, Wealth: history.observations[0].now.wealth, "Wealth told first": history.observations[0].wealth };
  for (const [name, value] of Object.entries(wanted)) near(cell[name], value, 1e-6);
  assert.equal(cell["Put right because"], "a slip");
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 1 was undone/).waitFor();
  const undone = (await call(ballast.url, `/sessions/${session}/history`)).observations[0].now;
  assert.deepEqual(undone.reported.simple_returns, { World: 0.015, "Bonds A/B": 0.002, Gold: -0.01 });
  near(undone.wealth, history.observations[0].wealth, 1e-6);
});

test("the last report of several is taken back, and returns by price are told by asset", async () => {
  page.once("dialog", (dialog) => dialog.accept());
  await page.getByRole("button", { name: "take it back" }).click();
  await page.getByText("The report was taken back").waitFor();
  const { now } = (await call(ballast.url, `/sessions/${session}/history`)).observations[1];
  assert.deepEqual([now.log_return, now.reported.executed_allocations.World], [null, 0.4]);
  await page.getByText("Last report, November 2020: no return is known.").waitFor();
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 3 was undone/).waitFor();
  const { assetReturns } = await dashboardModule("several_fields.js");
  const notes = [{ reason: "total_loss", asset: "b", sentence: "b lost everything" }];
  const row = (log_returns, more = {}) => ({ assets: { log_returns }, ...more });
  const observations = [row({ a: 0.1, b: null }), row({ a: 0.1, b: null }, { notes }), row({ a: 0.1, b: 0 }, { now: row({ a: 0.2, b: 0 }) }), row(null)];
  const told = observations.map((_, index) => assetReturns({ observations }, index));
  assert.deepEqual(told, [{ a: 0.1, b: null }, { a: 0.1, b: Number.NEGATIVE_INFINITY }, { a: 0.2, b: 0 }, null]);
});

test("it stands beside another session by what it holds in all", async () => {
  const { policy } = await call(ballast.url, `/sessions/${session}`);
  const other = (await call(ballast.url, "/sessions", { policy })).session;
  await visit(page, `${ballast.url}/#/compare?sessions=${session},${other}`);
  await page.getByRole("heading", { level: 1, name: "Two sessions" }).waitFor();
  const told = await rows("Two sessions side by side");
  const actions = await Promise.all([session, other].map((id) => call(ballast.url, `/action?session=${id}`)));
  for (const [index, { total }] of actions.entries()) near(told["To hold in the assets"][index], 100 * total, 0.05);
  assert.match(told["To trade"][1], /^buy [\d.]+$/);
  assert.doesNotMatch(plain(await page.locator("main").innerText()), /NaN|undefined|in stocks/);
  await visit(page, `${ballast.url}/#/policies/${policy}`);
  await page.getByText("It is for World, Bonds A/B and Gold.", { exact: false }).waitFor();
});

test("a session of several that has ended says so, and what it held", async () => {
  // No price of gold comes in the third period, and in the last one its return covers both.
  await call(ballast.url, "/observe", { session, period: 3, simple_returns: { World: 0.01, "Bonds A/B": 0, Gold: null } });
  await call(ballast.url, "/observe", { session, period: 4, simple_returns: { World: 0.01, "Bonds A/B": 0, Gold: 0.01 } });
  await go();
  await page.getByText("the price of Gold did not come: its holding counts as unmoved until it does", { exact: false }).waitFor();
  await page.getByText("the return of Gold covers every period since its last price", { exact: false }).waitFor();
  await page.getByRole("heading", { name: "Completed" }).waitFor();
  await page.getByRole("slider", { name: "Share of wealth in each asset" }).waitFor();
});

/** A table as it is pasted: dates, three columns, the bank. */
const TABLE = ["month\tWorld\tBonds A/B\tGold\trf", ...HISTORY.map((row, k) => [`2025-${String(k + 1).padStart(2, "0")}`, ...row.map((value) => (100 * Math.expm1(value)).toFixed(4)), "0.1"].join("\t"))].join("\n");

test("a policy of several is trained from a table that is pasted, and its columns are the assets", async () => {
  await visitQuiet(page, `${ballast.url}/#/train`);
  await page.getByLabel("Returns or prices").fill(TABLE);
  const columns = page.getByRole("group", { name: "Which column holds the returns or prices? Several columns mean several assets." });
  for (const name of ["World", "Bonds A/B", "Gold"]) await columns.getByLabel(name, { exact: false }).first().check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByLabel(/^Percent/).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByText("as in columns World, Bonds A/B, Gold").waitFor();
  await page.getByLabel("Framework").waitFor({ state: "hidden" });
  await page.getByLabel("How the assets are mixed").selectOption("Less of what varies more");
  await page.getByRole("button", { name: /Take the bank.s rate from rf/ }).click();
  await page.getByRole("group", { name: "Columns" }).getByLabel("Gold").click();
  await page.getByText("as in columns World, Bonds A/B.").waitFor();
  await page.getByRole("group", { name: "Columns" }).getByLabel("Gold").click();
  await page.getByText("as in columns World, Bonds A/B, Gold").waitFor();
  await page.getByLabel("Months ahead").fill("2");
  await page.getByText("For the quant", { exact: true }).click();
  await page.getByLabel("Design points").fill("10");
  const sent = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/train"));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  const { problem } = (await sent).postDataJSON();
  assert.deepEqual([problem.assets, problem.composition, problem.rate_per_step], [ASSETS, "inverse_volatility", 0.001]);
  for (const [date, row] of HISTORY.entries()) for (const [asset, value] of row.entries()) near(problem.history[date][asset], value, 1e-6);
  await page.getByRole("link", { name: "See the policy" }).first().click();
  await page.getByText("It is for World, Bonds A/B and Gold.", { exact: false }).waitFor();
});

test("a session of it is opened with what is held of each", async () => {
  await page.getByRole("link", { name: "Open a session" }).first().click();
  await page.getByLabel("World held now, %").fill("30");
  await page.getByLabel("Gold held now, %").fill("12,5");
  await page.getByLabel("Held now, %", { exact: true }).waitFor({ state: "hidden" });
  await page.getByText("Use other known returns").click();
  await page.getByLabel("Returns or prices known").fill(["Gold,World,Bonds A/B", ...HISTORY.slice(0, 8).map(([world, bonds, gold]) => [gold, world, bonds].join())].join("\n"));
  const columns = page.getByRole("group", { name: /^Which column/ });
  for (const name of ["Gold", "World", "Bonds A/B"]) await columns.getByLabel(name, { exact: false }).first().check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByLabel("They are").selectOption("log");
  await page.getByText(/8 log-returns as fractions/).waitFor();
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("table", { name: "What to hold of each asset" }).waitFor();
  const opened = await call(ballast.url, `/sessions/${page.url().split("/").at(-1)}`);
  near(opened.holding, 0.425, 1e-12);
  near(opened.assets.holdings.Gold, 0.125, 1e-12);
  const { history } = await call(ballast.url, `/sessions/${opened.session}/history`);
  assert.equal(history.length, 8);
  for (const [asset, value] of HISTORY[0].entries()) near(history[0][asset], value, 1e-9);
});

test("the form is filled from a policy of several by its assets, and trains the same policy", async () => {
  const { policy } = await call(ballast.url, `/sessions/${session}`);
  await visitQuiet(page, `${ballast.url}/#/train?from=${policy}`);
  await page.getByText("as in columns World, Bonds A/B, Gold").waitFor();
  const sent = page.waitForResponse((response) => response.request().method() === "POST" && response.url().endsWith("/train"));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  const { job } = await (await sent).json();
  assert.equal((await ended(ballast.url, job)).policy, policy);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  const { policy } = await call(ballast.url, `/sessions/${session}`);
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  await call(ballast.url, "/observe", { session, period: 1, simple_returns: { World: 0.01, "Bonds A/B": 0, Gold: 0.01 } });
  await usable(page, () => go());
  const forms = [`train?from=${policy}`, `sessions/new?policy=${policy}`];
  await usable(page, (form) => visitQuiet(page, `${ballast.url}/#/${form}`), forms);
});
