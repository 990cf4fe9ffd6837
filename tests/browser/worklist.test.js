// The morning of an adviser: who trades, how much in all, as a file of orders, and whose report is due.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";
import { call, service, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, chromium, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002, 0.14, -0.12];
const BONDS = HISTORY.map((_, k) => 0.003 + 0.01 * Math.cos(2.3 * k));
const COST = 0.001;
const DAY = 86_400_000;
const PROBLEM = { horizon: 3, rate_per_step: 0.002, periods_per_year: 52, trading_cost: COST, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
/** What each client has and holds; the fund is of two assets. */
const CLIENTS = [
  { name: "Little", wealth: 100, holding: 0.1 },
  { name: "Large", wealth: 900_000, holding: 0 },
  { name: "Mid, of \"quotes\"", wealth: 40_000, holding: 0.02 },
  { name: "All in", wealth: 5000, holding: 1 },
  { name: "Content", wealth: 5000, holding: 0.45 },
];

let policy, fund, sessions;
const isoDay = (ago) => new Date(Date.now() - ago * DAY).toISOString().slice(0, 10);
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const names = () => page.locator("tbody th a").allInnerTexts();
const work = async () => plain(await page.locator(".work").innerText());
const shown = (line) => page.locator(".foot").getByText(line, { exact: true }).waitFor();

before(async () => {
  policy = await trained(ballast.url, { problem: { ...PROBLEM, history: HISTORY }, design: { count: 10 }, name: "World, weekly" });
  fund = await trained(ballast.url, { problem: { ...PROBLEM, trading_cost: 0, assets: ["Stocks", "Bonds"], history: HISTORY.map((back, k) => [back, BONDS[k]]) }, design: { count: 10 }, name: "Fund" });
  sessions = [];
  for (const client of CLIENTS) sessions.push({ ...client, ...(await call(ballast.url, "/sessions", { policy, ...client })) });
  const of = { name: "Two assets", wealth: 2000, holdings: { Stocks: 0.9, Bonds: 0.05 } };
  sessions.push({ ...of, ...(await call(ballast.url, "/sessions", { policy: fund, ...of })) });
});

/** The trades of every session by the service's own answers, in money. */
async function trades() {
  const found = [];
  for (const { session, name } of sessions) {
    const now = await call(ballast.url, `/sessions/${session}`);
    const action = await call(ballast.url, `/action?session=${session}`);
    const isFund = typeof action.allocation === "object";
    const [held, advised, trade] = isFund ? [action.holdings, action.allocation, action.trade] : [{ "": action.holding }, { "": action.allocation }, { "": action.trade }];
    const turned = Object.values(trade).reduce((sum, part) => sum + Math.abs(part), 0);
    const whole = now.wealth * (1 - (isFund ? 0 : COST) * turned);
    for (const asset of Object.keys(trade)) if (Math.abs(trade[asset]) >= 0.0005) found.push({ name, session, asset, amount: advised[asset] * whole - held[asset] * now.wealth, held: held[asset] * now.wealth, kept: advised[asset] * whole });
  }
  return found;
}

const sum = (found, sign) => found.reduce((all, { amount }) => all + Math.max(0, sign * amount), 0);
const number = (text) => Number(text.replaceAll(",", ""));
const near = (one, other, why) => assert.ok(Math.abs(one - other) <= 0.51, `${why}: ${one} for ${other}`);

test("how many have a trade, and what is bought and sold in all", async () => {
  const found = await trades();
  const clients = new Set(found.map(({ session }) => session)).size;
  assert.ok(clients === 5, `${clients}`);
  await go("");
  const told = await work();
  const [, some, all] = /^(\d+) of (\d+) sessions have a trade/.exec(told);
  assert.deepEqual([some, all], [String(clients), "6"]);
  near(number(/buy ([\d,.]+) in/.exec(told)[1]), sum(found, 1), "bought");
  near(number(/sell ([\d,.]+) in/.exec(told)[1]), sum(found, -1), "sold");
});

test("those with a trade stand with the biggest first, also where the address leads there", async () => {
  const found = await trades();
  const size = (name) => found.filter((one) => one.name === name).reduce((all, { amount }) => all + Math.abs(amount), 0);
  const wanted = [...new Set(found.map(({ name }) => name))].sort((one, other) => size(other) - size(one));
  await go("");
  await page.getByRole("button", { name: "Show the trades" }).click();
  await shown(`${wanted.length} of ${wanted.length}`);
  assert.deepEqual(await names(), wanted);
  assert.equal(await page.getByRole("columnheader", { name: "To trade" }).getAttribute("aria-sort"), "descending");
  assert.match(page.url(), /state=trade/);
  await go(new URL(page.url()).hash);
  assert.deepEqual(await names(), wanted);
  await page.getByRole("button", { name: "To trade" }).click();
  await page.waitForFunction(() => document.querySelector("[aria-sort=ascending]"));
  assert.deepEqual(await names(), [...wanted].reverse());
  await page.getByLabel("Search").fill("large");
  await shown("1 of 1");
  await page.locator(".work").getByText("1 of 1 session has a trade", { exact: false }).waitFor();
});

test("a trade below the smallest counts as none, and the browser keeps what is smallest", async () => {
  await go("#/sessions?state=trade");
  const before = await names();
  await page.getByLabel("Smallest trade").fill("150");
  await page.waitForFunction((count) => document.querySelectorAll("tbody tr").length < count, before.length);
  assert.ok(!(await names()).includes("Little"));
  assert.match(await work(), /\d trades? (is|are) too small and left out\./);
  await go("");
  assert.equal(await page.getByLabel("Smallest trade").inputValue(), "150");
  const little = page.getByRole("row").filter({ has: page.getByRole("link", { name: "Little", exact: true }) });
  assert.match(plain(await little.locator('[data-name="To trade"]').innerText()), /^Nothing\s+Buy [\d.]+: too small$/);
  await page.getByLabel("Smallest trade").fill("1,000");
  assert.equal(await page.getByLabel("Smallest trade").getAttribute("aria-invalid"), "true");
  await page.getByLabel("Smallest trade").fill("");
  await page.waitForFunction(() => !document.querySelector(".work").textContent.includes("too small"));
});

test("the smallest trade is an amount or a share of wealth", async () => {
  const { smallestOf, sums, tradesOf } = await dashboardModule("trades.js");
  assert.deepEqual(["", "500", "1 %", "0,5%", "1,000", "x", "-3"].map(smallestOf), [null, { money: 500 }, { share: 0.01 }, { share: 0.005 }, undefined, undefined, undefined]);
  const action = { allocation: 0.52, holding: 0.5, trade: 0.02 };
  const size = (smallest, cost = 0) => sums(tradesOf(action, { wealth: 1000, cost }, smallest)).size;
  assert.deepEqual([null, { money: 20 }, { money: 21 }, { share: 0.02 }, { share: 0.03 }].map((smallest) => Math.round(size(smallest))), [20, 20, 0, 20, 0]);
  assert.ok(Math.abs(size(null, 0.01) - 0.52 * 1000 * (1 - 0.01 * 0.02) + 500) < 1e-9);
  assert.equal(tradesOf({ ...action, allocation: 0.5004, trade: 0.0004 }, { wealth: 1e9, cost: 0 }).length, 0);
});

test("the orders are saved as a file, and a line tells how many", async () => {
  const found = await trades();
  await go("");
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save orders as CSV" }).click()]);
  assert.match(download.suggestedFilename(), /^orders-\d{4}-\d\d-\d\d\.csv$/);
  const { csvRows } = await dashboardModule("csv.js");
  const [head, ...rows] = csvRows(await readFile(await download.path(), "utf8"), ",").map(({ cells }) => cells);
  assert.deepEqual(head.slice(0, 8), ["Client", "Session", "Policy", "Asset", "Order", "Amount", "Held", "To hold"]);
  assert.equal(rows.length, found.length);
  for (const { name, session, asset, amount, held, kept } of found) {
    const row = rows.find((cells) => cells[1] === session && cells[3] === (asset || "risky asset"));
    assert.deepEqual([row[0], row[4]], [name, amount > 0 ? "buy" : "sell"]);
    for (const [index, value] of [[5, Math.abs(amount)], [6, held], [7, kept]]) assert.ok(Math.abs(Number(row[index]) - value) <= 0.0051, `${name}: ${row[index]} for ${value}`);
    for (const cell of row.slice(8, 10)) assert.match(cell, /^\d+(\.\d{1,4})?$/);
  }
  const sizes = rows.filter((cells) => cells[3] === "risky asset").map((cells) => Number(cells[5]));
  assert.deepEqual(sizes, [...sizes].sort((one, other) => other - one));
  await page.getByText(`Saved ${found.length} orders of ${new Set(found.map(({ session }) => session)).size} sessions.`).waitFor();
});

test("the days of reports are saved as a calendar", async () => {
  await go("");
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Calendar (.ics)" }).click()]);
  assert.equal(download.suggestedFilename(), "reports.ics");
  const text = await readFile(await download.path(), "utf8");
  const ids = [...text.matchAll(/^UID:(.*)@ballast\r$/gm)].map(([, id]) => id);
  assert.deepEqual(ids.sort(), sessions.map(({ session }) => session).sort());
});

test("whose report is due is told, and a link has their lines ready", async () => {
  await call(ballast.url, "/observe", { session: sessions[1].session, period: 1, simple_return: 0.01, date: isoDay(8) });
  await call(ballast.url, "/observe", { session: sessions[2].session, period: 1, simple_return: 0.01, date: isoDay(2) });
  await go("");
  assert.match(await work(), /1 of these sessions lacks the report that is due, so the trade may change\./);
  assert.match(await work(), /The report to \d+ \w+ \d{4} of 1 session is due\./);
  await page.getByRole("button", { name: "Show whose" }).click();
  await shown("1 of 1");
  assert.deepEqual(await names(), ["Large"]);
  await page.getByRole("link", { name: "Report for the 1" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  assert.match(await page.getByLabel("Sessions and their returns, %").inputValue(), /^Large/);
});

test("trades come before reports that are due, and these before what can wait", async () => {
  const { toDo } = await dashboardModule("worklist.js");
  const entry = (name, size, next) => ({ name, size, next, state: "active" });
  const entries = [entry("new", 0, "2026-12-31"), entry("a week late", 0, "2026-11-23"), entry("small", 5, "2026-12-31"), entry("a month late", 0, "2026-10-31"), entry("large and late", 90, "2026-10-31"), entry("old", 0, null), { ...entry("completed", 0, "2026-10-31"), state: "completed" }];
  assert.deepEqual(toDo(entries, ({ size }) => size, "2026-11-30").map(({ name }) => name), ["large and late", "small", "a month late", "a week late", "new", "old", "completed"]);
});

test("a report unlike those of its peers is found, by policy and day, for one asset or several", async () => {
  const { unlikePeers } = await dashboardModule("peers.js");
  const of = (values, more = {}) => values.map((value, index) => ({ session: `${index}`, policy: "p", date: "2026-11-30", log_return: value === null ? null : Math.log1p(value), log_returns: null, ...more }));
  const found = (entries) => unlikePeers(entries).map(({ entry }) => Number(entry.session));
  assert.deepEqual(found(of([0.0213, 0.213, 0.0213, 0.0213])), [1]);
  assert.deepEqual(found(of([0.0167, 0.01672, 0.01668, null])), [], "rounded otherwise, or missing");
  assert.deepEqual([found(of([0.0213, 0.213])), found(of([0.01, 0.02, 0.03])), found(of([0.01, 0.01, 0.03, 0.03]))], [[], [], []], "nobody knows who is right");
  const apart = of([0.0213, 0.213, 0.0213, 0.0213]);
  apart[1].date = "2026-10-31";
  apart[2].policy = "q";
  assert.deepEqual(found(apart), [], "another day, another policy");
  const assets = of([0, 0, 0], { log_return: 0.5 }).map((entry, index) => ({ ...entry, log_returns: { stocks: 0.01, bonds: index === 2 ? 0.02 : 0.002 } }));
  assert.deepEqual(unlikePeers(assets).map(({ entry, agree, all }) => [entry.session, agree, all]), [["2", 2, 3]]);
});

test("the overview names who reported unlike the others, and lists them", async () => {
  const own = await service();
  try {
    const policy = await trained(own.url, { problem: { ...PROBLEM, history: HISTORY }, design: { count: 10 } });
    for (const [name, simple_return] of [["Ada", 0.0167], ["Ben", 0.0167], ["Jo\u00e3o", 0.167]]) {
      const { session } = await call(own.url, "/sessions", { policy, name });
      await call(own.url, "/observe", { session, period: 1, simple_return, date: "2026-11-30", confirm: true });
    }
    const other = await (await chromium.newContext()).newPage();
    await visitQuiet(other, `${own.url}/`);
    await other.getByText("Jo\u00e3o reported 16.70 % for 30 Nov 2026, where 2 of 3 sessions with its policy reported 1.67 %.", { exact: false }).waitFor();
    await other.getByRole("button", { name: "Show which" }).click();
    await other.waitForFunction(() => document.querySelectorAll("tbody th a").length === 1);
    assert.deepEqual(await other.locator("tbody th a").allInnerTexts(), ["Jo\u00e3o"]);
    await other.context().close();
  } finally {
    await own.stop();
  }
});

test("the overview opens with what is to be done first, and another order is kept in this browser alone", async () => {
  const found = await trades();
  const size = (name) => found.filter((one) => one.name === name).reduce((all, { amount }) => all + Math.abs(amount), 0);
  const byTrade = [...new Set(found.map(({ name }) => name))].sort((one, other) => size(other) - size(one));
  await go("");
  await page.getByText("What is to be done stands first", { exact: false }).waitFor();
  assert.ok(byTrade.length >= 3, `${byTrade}`);
  assert.deepEqual((await names()).slice(0, byTrade.length), byTrade);
  await page.getByRole("button", { name: "Wealth", exact: true }).click();
  await page.waitForFunction(() => document.querySelector("[aria-sort=descending]")?.textContent.startsWith("Wealth"));
  const byWealth = await names();
  assert.notDeepEqual(byWealth, byTrade);
  await go("");
  assert.deepEqual([await names(), new URL(page.url()).hash], [byWealth, ""]);
  assert.equal(await page.getByRole("columnheader", { name: "Wealth" }).getAttribute("aria-sort"), "descending");
  const other = await (await chromium.newContext()).newPage();
  await visitQuiet(other, `${ballast.url}/`);
  assert.deepEqual((await other.locator("tbody th a").allInnerTexts()).slice(0, byTrade.length), byTrade);
  await other.context().close();
  await page.getByRole("button", { name: "Put first what is to be done" }).click();
  await page.getByText("What is to be done stands first", { exact: false }).waitFor();
  await go("");
  assert.deepEqual((await names()).slice(0, byTrade.length), byTrade);
});

test("damaged sessions are named in that order too", async () => {
  await page.route("**/sessions?*limit=200*", async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, json: { ...(await response.json()), damaged: ["session_broken"] } });
  });
  await go("");
  await shown("6 of 7. Damaged; ask an operator to restore: session_broken");
  await page.unrouteAll();
});

test("a session without advice is left out of the sums and named", async () => {
  const refused = { type: "/problems/overloaded", title: "The service cannot answer now", status: 503, detail: "too busy" };
  await page.route(`**/action?session=${sessions[1].session}`, (route) => route.fulfill({ status: 503, contentType: "application/problem+json", body: JSON.stringify(refused) }));
  await go("");
  assert.match(await work(), /1 session has no advice now and is left out: Large\./);
  assert.doesNotMatch(await work(), /buy \d{3},\d{3} in/);
  await page.unrouteAll();
});

test("a row is one line, and what to do with ticked rows stays in sight", async () => {
  for (let k = 0; k < 30; k++) await call(ballast.url, "/sessions", { policy, name: `Client ${k}` });
  await page.setViewportSize({ width: 1440, height: 900 });
  await go("");
  const heights = await page.locator("tbody tr").evaluateAll((rows) => rows.map(({ offsetHeight }) => offsetHeight));
  assert.ok(heights.filter((height) => height <= 34).length >= 33, `${heights}`);
  await page.getByRole("button", { name: "Tick all 36" }).click();
  await page.getByText("36 ticked.").waitFor();
  await page.mouse.wheel(0, 5000);
  await page.waitForFunction(() => scrollY > 300);
  for (const [width, height] of [[1440, 900], [390, 844]]) {
    await page.setViewportSize({ width, height });
    await page.locator(".foot").scrollIntoViewIfNeeded();
    const { y } = await page.getByRole("link", { name: "Report for the 36" }).boundingBox();
    assert.ok(y >= 0 && y < height / 2, `at ${width} the link stands at ${y}`);
  }
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.getByLabel("Search").fill("client 1");
  await page.getByText(/36 ticked, \d+ of them not shown here\./).waitFor();
  await page.getByRole("button", { name: "Untick all" }).click();
  assert.equal(await page.getByRole("link", { name: /^Report for the/ }).count(), 0);
});

test("the keyboard goes from row to row, on one control", async () => {
  await go("#/sessions?sort=name");
  const focused = () => page.evaluate(() => document.activeElement.getAttribute("aria-label") ?? document.activeElement.textContent);
  const links = await names();
  await page.locator("tbody th a").first().focus();
  await page.keyboard.press("ArrowDown");
  await page.keyboard.press("ArrowDown");
  assert.equal(await focused(), links[2]);
  await page.keyboard.press("ArrowUp");
  assert.equal(await focused(), links[1]);
  await page.keyboard.press("End");
  assert.equal(await focused(), links.at(-1));
  await page.keyboard.press("ArrowDown");
  assert.equal(await focused(), links.at(-1));
  await page.keyboard.press("Home");
  await page.keyboard.press("Shift+Tab");
  await page.keyboard.press("ArrowDown");
  assert.equal(await focused(), `Tick session ${links[1]}`);
  await page.keyboard.press("Space");
  await page.getByText("1 ticked.", { exact: false }).waitFor();
});

test("those that are completed or end are continued together from the line that names them", async () => {
  const ids = [];
  for (const [name, periods] of [["Ends", 2], ["Is completed", 3]]) {
    const { session } = await call(ballast.url, "/sessions", { policy, name });
    ids.push(session);
    for (let period = 1; period <= periods; period++) await call(ballast.url, "/observe", { session, period, simple_return: 0.01, date: isoDay(7 * (periods - period)) });
  }
  await go("");
  await page.locator(".needs").getByText("2 are completed or in their last period", { exact: false }).waitFor();
  await page.getByRole("button", { name: "Continue the 2" }).click();
  await page.getByRole("heading", { level: 1, name: "Continue with another policy" }).waitFor();
  assert.deepEqual((await names()).sort(), ["Ends", "Is completed"]);
  assert.deepEqual(new URLSearchParams(page.url().split("?")[1]).get("sessions").split(",").sort(), [...ids].sort());
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async (place) => {
    await go(place);
    await page.getByLabel("Tick session Large").check();
  }, ["#/sessions?state=trade"]);
});
