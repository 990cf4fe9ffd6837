// A session's page as a client may be shown it: advice first, beside what else the start would have come to, on paper too.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visit } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
const RETURNS = [0.04, -0.1, 0.02];
const DATES = ["2008-01-31", "2008-02-29", "2008-03-31"];
const RATE = 0.002;

let session, policy;

before(async () => {
  policy = await trained(ballast.url, {
    problem: { horizon: 6, rate_per_step: RATE, history: HISTORY, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } },
    design: { count: 10 },
  });
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  let price = 50;
  for (const [index, simple_return] of RETURNS.entries()) {
    const previous_price = price;
    price *= 1 + simple_return;
    await call(ballast.url, "/observe", { session, period: index + 1, price, previous_price, date: DATES[index], executed_allocation: 0.5, confirm: true });
  }
});

const main = async () => plain(await page.locator("main").innerText());
const go = async (id = session) => {
  await visit(page, `${ballast.url}/#/sessions/${id}`);
  await page.getByRole("slider", { name: "Worth as much as a sure, by caution" }).waitFor();
};

test("a month has its name, and its money stands beside its percent", async () => {
  await go();
  await page.getByRole("heading", { name: "April 2008, period 4 of 6" }).waitFor();
  const words = await main();
  assert.match(words, /worth as much as a sure [\d.]+ at the end of June 2008|nothing beats the bank, which reaches [\d.]+ at the end of June 2008/);
  assert.match(words, /about [\d.]+ shares at 47\.74/);
  assert.match(words, /assumes that (one month in \d+|most months|every month)|counts the best (month in \d+|\d+ % of months) as only/);
  assert.doesNotMatch(words, /certainty equivalent|duality|multiplier|Radius|worst law|surrogate|read off/i);
  assert.doesNotMatch(words, /Period \d+ of|undefined|NaN/);
});

test("the same start is told in the bank, in stocks and at 60/40", async () => {
  const bank = 100 * (1 + RATE) ** 3;
  const stocks = 100 * RETURNS.reduce((grown, back) => grown * (1 + back), 1);
  const mixed = 100 * RETURNS.reduce((grown, back) => grown * (1 + 0.4 * RATE + 0.6 * back), 1);
  const told = /come to ([\d.]+) all in the bank, ([\d.]+) at 60\/40 and ([\d.]+) all in stocks/.exec(await main());
  assert.deepEqual(told.slice(1), [bank, mixed, stocks].map((value) => value.toFixed(2)));
});

test("the worst fall is that of the wealth lived through", async () => {
  const grown = RETURNS.map((back) => 1 + 0.5 * RATE + 0.5 * back);
  assert.match(await main(), new RegExp(`Worst fall so far\\s+-${(100 * (1 - grown[1])).toFixed(1)} %\\s+from January 2008 to February 2008`));
});

test("money that comes and goes is no fall and no gain", async () => {
  const { falls, mixed } = await dashboardModule("comparators.js");
  const { worstFalls } = await dashboardModule("track.js");
  const row = (flow, wealth) => ({ log_return: 0, reported: { flow, rate: 0.01 }, wealth });
  const history = {
    initial_wealth: 100,
    initial_holding: 0.5,
    terms: { rate_per_step: 0.01, trading_cost: 0.02, contributions: 0 },
    renewals: [],
    observations: [row(-50, 50), row(0, 45), row(10, 60)],
  };
  assert.deepEqual(falls(history).map((fall) => fall.toFixed(4)), ["0.0000", "0.0000", "-0.1000", "0.0000"]);
  const [worst] = worstFalls(falls(history), 1);
  assert.deepEqual([worst.from, worst.to, worst.depth.toFixed(2)], [1, 2, "-0.10"]);
  // Half is sold at 2 %, the bank pays 1 %, and the money moves.
  const bank = [100, 99 * 1.01 - 50];
  bank.push(bank[1] * 1.01, bank[1] * 1.01 ** 2 + 10);
  for (const [index, value] of mixed(history, 0).entries()) assert.ok(Math.abs(value - bank[index]) < 1e-9, `${value} is not ${bank[index]}`);
});

test("a calendar is told by its dates, forward too", async () => {
  const { calendar } = await dashboardModule("periods.js");
  const of = (dates, periods_per_year) => calendar({ observations: dates.map((date, index) => ({ period: index + 1, reported: { date } })) }, periods_per_year);
  const months = of(["2008-01-31", "2008-02-29"]);
  assert.deepEqual([months.unit, months.name(2), months.name(5), months.after(0)], ["month", "February 2008", "May 2008", "At the start"]);
  const weeks = of(["2024-02-23", "2024-03-01"]);
  assert.deepEqual([weeks.unit, weeks.inText(3)], ["week", "week to 8 Mar 2024"]);
  const one = of(["2008-11-30"], 12);
  assert.equal(one.name(2), "December 2008");
  const none = of([undefined, undefined], 12);
  assert.deepEqual([none.unit, none.name(2)], ["month", "Period 2"]);
  const days = of(["2024-03-01", "2024-03-04", "2024-03-05"]);
  assert.deepEqual([days.unit, days.name(3), days.name(4)], ["day", "5 Mar 2024", "Period 4"]);
});

test("the worst market is told in months and losses", async () => {
  const { assumed } = await dashboardModule("worst_market.js");
  const move = (atom, moved_to, mass) => ({ atom, moved_to, mass });
  const stay = move(0.01, 0.01, 0.9);
  const said = (moves) => plain(assumed({ transport: [stay, ...moves] }, "month"));
  assert.equal(said([move(-0.17, Math.log(0.81), 0.0435)]), "It assumes that one month in 23 loses 19 %.");
  assert.equal(said([move(0.05, Math.log(1.036), 0.25)]), "It counts the best month in 4 as only 3.6 %.");
  assert.equal(said([move(-0.17, Math.log(0.5), 1 / 2099)]), "It assumes that one month in 175 years loses 50 %.");
  assert.match(said([move(-0.17, -0.3, 0.02), move(0.05, 0.03, 0.1)]), /one month in 50 loses 26 %, and that one month in 10 brings less/);
  assert.match(said([]), /every month is like those seen/);
});

test("nothing held is told with what was paid, its chance error and what the market leaves", async () => {
  const { whyNothing } = await dashboardModule("worst_market.js");
  const move = (atom, moved_to) => ({ atom: Math.log(atom), moved_to: Math.log(moved_to), mass: 0.5 });
  const said = (best, rate) => plain(whyNothing({ transport: [move(1.03, best), move(0.99, 0.99)] }, rate, 5, "month"));
  // Paid 1 % on average, 2 % either side: over the root of four.
  assert.equal(said(1.01, 0.002), "The record beat the bank by 0.80 % a month, with a standard error of 1.00 %. In this market it pays 0.20 % less than the bank.");
  assert.match(said(1.02, 0.002), /In this market it beats the bank by 0\.30 %\.$/);
  assert.equal(said(1.01, 0.012), "The record paid 0.20 % a month less than the bank, with a standard error of 1.00 %.");
});

test("on a phone the advice comes first, and nothing to press stands above it", async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await go();
  const top = async (locator) => (await locator.boundingBox()).y;
  const advice = await top(page.locator(".big"));
  assert.ok(advice < 300, `the advice stands at ${advice}`);
  for (const below of [page.getByRole("button", { name: "Delete" }), page.locator(".facts"), page.getByRole("slider", { name: "Wealth", exact: true })])
    assert.ok((await top(below)) > advice);
  await page.setViewportSize({ width: 1280, height: 900 });
});

test("paper holds the charts in its width, and nothing to press", async () => {
  await page.emulateMedia({ media: "print", colorScheme: "dark" });
  await page.setViewportSize({ width: 700, height: 1000 });
  await go();
  for (const pressed of await page.locator("button, form, nav, a.button").all()) assert.equal(await pressed.isVisible(), false);
  for (const seen of [page.locator(".big"), page.locator(".bar.s0").first(), page.getByRole("heading", { name: "Periods so far" })])
    assert.equal(await seen.isVisible(), true);
  const [ink, paper] = await page.evaluate(() => [getComputedStyle(document.body).color, getComputedStyle(document.documentElement).backgroundColor]);
  assert.deepEqual([ink, paper], ["rgb(0, 0, 0)", "rgb(255, 255, 255)"]);
  await page.setViewportSize({ width: 500, height: 1000 });
  const wide = await page.evaluate(() => Math.max(...[...document.querySelectorAll(".plot svg")].map((svg) => svg.getBoundingClientRect().right)));
  assert.ok(wide <= 500, `a chart ends at ${wide}`);
  await page.emulateMedia({ media: "screen", colorScheme: "light" });
  await page.setViewportSize({ width: 1280, height: 900 });
});

test("charts are drawn anew for paper, where letters keep their size, and again for the screen", async () => {
  await go();
  const widths = () => page.evaluate(() => [...document.querySelectorAll(".plot svg")].map(({ width }) => width.baseVal.value));
  const seen = await widths();
  await page.evaluate(() => addEventListener("beforeprint", () => (window.printed = [...document.querySelectorAll(".plot svg")].map(({ width }) => width.baseVal.value))));
  await page.pdf({ format: "A4" });
  assert.deepEqual(await page.evaluate(() => window.printed), seen.map(() => 672));
  assert.deepEqual([await widths(), seen.length > 3], [seen, true]);
});

const saved = async (button) => {
  const [file] = await Promise.all([page.waitForEvent("download"), button.click()]);
  return { name: file.suggestedFilename(), bytes: await readFile(await file.path()) };
};

test("the periods are saved as a file of numbers", async () => {
  await go();
  const { name, bytes } = await saved(page.getByRole("button", { name: "Save as CSV" }));
  assert.match(name, /^session-[0-9a-f]+\.csv$/);
  const { csvRows } = await dashboardModule("csv.js");
  const rows = csvRows(bytes.toString(), ",").map(({ cells }) => cells);
  const [head, start, ...lines] = rows;
  assert.deepEqual(head, ["Period", "Name", "Last day", "Return, %", "The bank paid, %", "Money added", "Advised, %", "Held, %", "Traded, %", "Wealth", "All in the bank", "60/40", "All in stocks", "Below the highest, %", "Caution, % a month", "Returns seen", "Reported"]);
  assert.deepEqual([start[1], start[9], start.length, lines.length], ["Start", "100", head.length, 3]);
  assert.deepEqual(lines[1].slice(0, 3), ["2", "February 2008", "2008-02-29"]);
  assert.deepEqual([Number(lines[1][3]).toFixed(9), ...[4, 5, 7].map((column) => lines[1][column])], ["-10.000000000", "0.2", "0", "50"]);
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  const [last, { wealth, radius, sample_size, observed_ms }] = [lines[2], observations[2]];
  for (const [column, value] of [[9, wealth], [14, 100 * radius]]) assert.ok(Math.abs(Number(last[column]) - value) < 1e-9, `${last[column]} is not ${value}`);
  assert.deepEqual(last.slice(-2), [String(sample_size), new Date(observed_ms).toISOString()]);
});

test("money, the bank's rate, the band and what was put right stand in the file too", async () => {
  const { csv } = await dashboardModule("observed.js");
  const { calendar } = await dashboardModule("periods.js");
  const row = { period: 1, log_return: 0, band: [0.2, 0.4], advised_allocation: 0.2, executed_allocation: 0.2, wealth: 90, radius: 0.01, sample_size: 11, observed_ms: 0, reported: { date: "2008-01-31" }, account: { turnover: 0.25, cost: 0.25 } };
  const now = { reported: { date: "2008-01-31", rate: 0.004, flow: -5 }, log_return: Math.log(1.5), advised_allocation: 0.3, executed_allocation: 0.25, wealth: 105, radius: 0.02 };
  const made = (correction, reason) => ({ correction, period: 1, reason, corrected_ms: 1000 * correction });
  const terms = { rate_per_step: 0.002, trading_cost: 0.01, contributions: 3 };
  const history = { initial_wealth: 100, initial_holding: 0, terms, observations: [{ ...row, corrections: [1, 2], now }], corrections: [made(1, "=a slip"), made(2, "the index, revised")], renewals: [] };
  const problem = { framework: "adaptive", radius: { rule: "bridge" }, trading_cost: 0.01 };
  const { csvRows } = await dashboardModule("csv.js");
  const text = csv({ history, calendar: calendar(history, 12), policy: { specification: { problem } }, cautionScale: 0.5 });
  const [heads, , told] = csvRows(text, ",").map(({ cells }) => cells);
  const of = Object.fromEntries(heads.map((name, index) => [name, told[index]]));
  assert.deepEqual(
    ["Return, %", "Return told first, %", "The bank paid, %", "Money added", "Advised, %", "Best kept from, %", "Best kept to, %", "Held, %", "Held told first, %", "Traded, %", "Trading cost", "Wealth", "Wealth told first", "Caution, % a month", "Reported", "Put right", "Put right because"].map((name) => of[name]),
    ["50", "0", "0.4", "-5", "30", "20", "40", "25", "20", "25", "0.25", "105", "90", "1", "1970-01-01T00:00:00.000Z", "1970-01-01T00:00:02.000Z", "'=a slip; the index, revised"],
  );
});

test("a chart is saved as a drawing and as a picture, dark on white from a dark page", async () => {
  await page.emulateMedia({ colorScheme: "dark" });
  await go();
  const svg = await saved(page.getByRole("button", { name: "Save Wealth as SVG" }));
  assert.equal(svg.name, "wealth.svg");
  const drawn = svg.bytes.toString();
  assert.match(drawn, /^<svg xmlns="http:\/\/www\.w3\.org\/2000\/svg"/);
  assert.match(drawn, /<rect[^>]*width="100%"[^>]*fill="rgb\(255, 255, 255\)"/);
  for (const words of ["Wealth", "60/40", "All in stocks", "Mar 08"]) assert.ok(drawn.includes(`>${words}<`), words);
  assert.doesNotMatch(drawn, /class=|var\(/);
  const png = await saved(page.getByRole("button", { name: "Save Wealth as PNG" }));
  assert.equal(png.bytes.subarray(1, 4).toString(), "PNG");
  assert.ok(png.bytes.readUInt32BE(16) > 600 && png.bytes.length > 5000);
  await page.emulateMedia({ colorScheme: "light" });
});

test("a long session shows its newest periods, and all where asked", async () => {
  const rolling = await trained(ballast.url, {
    problem: { horizon: 1, rate_per_step: RATE, history: [...HISTORY, ...HISTORY, ...HISTORY], learning: { kind: "decay", half_life: 2 } },
    design: { count: 20, initial_laws: "resampled" },
  });
  const long = (await call(ballast.url, "/sessions", { policy: rolling, rolling: true })).session;
  for (let period = 1; period <= 300; period++) await call(ballast.url, "/observe", { session: long, period, log_return: HISTORY[period % 10], confirm: true });
  await go(long);
  const rows = page.getByRole("table", { name: "Observed periods, newest first" }).getByRole("row");
  assert.equal(await rows.count(), 25);
  assert.equal(await page.locator(".plot rect.bar").count(), 0, "bars of a pixel are drawn as one shape");
  await page.getByRole("button", { name: "Show all 300" }).click();
  assert.equal(await rows.count(), 301);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, () => go());
});
