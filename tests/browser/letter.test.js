// The letter to a client: one page on paper with the firm on it, and a page each for a whole book.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, chromium, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002, 0.14, -0.12];
const [RATE, COST] = [0.002, 0.001];
/** Three months, the first of which ends a year; money comes in the second and goes in the third. */
const MONTHS = [{ simple_return: 0.04, date: "2025-12-31" }, { simple_return: -0.1, date: "2026-01-31", flow: 5000 }, { simple_return: 0.02, date: "2026-02-28", flow: -300 }];
const HELD = 0.5;
const ASSETS = Array.from({ length: 30 }, (_, k) => `Fund with a longer name ${k + 1}`);
const LONG = "This is computed from past returns, which do not predict the future. ".repeat(20);

let policy, client, ten, completed, wide;

before(async () => {
  const problem = { horizon: 6, rate_per_step: RATE, periods_per_year: 12, trading_cost: COST, history: HISTORY, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  policy = await trained(ballast.url, { problem, design: { count: 10 }, name: "World, monthly" });
  client = (await call(ballast.url, "/sessions", { policy, name: "Client with flows", wealth: 10_000 })).session;
  for (const [index, report] of MONTHS.entries()) await call(ballast.url, "/observe", { session: client, period: index + 1, executed_allocation: HELD, confirm: true, ...report });
  const rolling = await trained(ballast.url, { problem: { ...problem, horizon: 1, trading_cost: 0, history: [...HISTORY, ...HISTORY, ...HISTORY], learning: { kind: "decay", half_life: 2 } }, design: { count: 20, initial_laws: "resampled" } });
  ten = (await call(ballast.url, "/sessions", { policy: rolling, name: "Ten years", rolling: true, wealth: 480_000 })).session;
  for (let period = 1; period <= 120; period++) await call(ballast.url, "/observe", { session: ten, period, simple_return: HISTORY[period % 12], confirm: true, date: new Date(Date.UTC(2016, period, 0)).toISOString().slice(0, 10), flow: period % 12 === 6 ? 1000 : 0 });
  completed = (await call(ballast.url, "/sessions", { policy: await trained(ballast.url, { problem: { ...problem, horizon: 1 }, design: { count: 10 } }), name: "Completed one" })).session;
  await call(ballast.url, "/observe", { session: completed, period: 1, simple_return: 0.02, date: "2026-01-31" });
  const fund = await trained(ballast.url, { problem: { ...problem, horizon: 2, trading_cost: 0, assets: ASSETS, composition: "equal", history: Array.from({ length: 40 }, (_, t) => ASSETS.map((_, k) => 0.004 + 0.0003 * k + 0.04 * Math.sin(1.7 * t + k * k))), radius: { rule: "bridge", alpha: 0.5, scale: 0.02 } }, design: { count: 10 } });
  const uneven = Object.fromEntries(ASSETS.map((name, k) => [name, k % 2 ? 0.05 : 0.01]));
  wide = (await call(ballast.url, "/sessions", { policy: fund, name: "A client with a name of so many words that it takes a line", wealth: 2_500_000, holdings: uneven })).session;
  await call(ballast.url, "/observe", { session: wide, period: 1, date: "2026-10-31", confirm: true, executed_allocations: uneven, simple_returns: Object.fromEntries(ASSETS.map((name, k) => [name, 0.01 - 0.001 * k])) });
});

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const goLetter = async (id = client) => {
  await go(`#/sessions/${id}/letter`);
  await page.locator(".letter").waitFor();
};
const goBook = async (query = "") => {
  await go(`#/letters${query}`);
  await page.getByText("Each is printed on a page of its own.", { exact: false }).waitFor();
};
const words = async () => plain(await page.locator(".letter").first().innerText()).replaceAll("\u00a0", " ");
/** Waits until a letter is written again after something was typed. */
const written = (act) => Promise.all([page.waitForResponse((response) => response.url().includes("/letter?")), act()]);
const fact = async (name) => plain(await page.locator(".letter .facts > div").filter({ has: page.getByText(name, { exact: true }) }).locator("dd").first().innerText()).replaceAll("\u00a0", " ");
const pages = async (format) => ((await page.pdf({ format })).toString("latin1").match(/\/Type\s*\/Page[^s]/g) ?? []).length;
/** A picture of some pixels. */
const picture = () => page.evaluate(() => {
  const canvas = Object.assign(document.createElement("canvas"), { width: 300, height: 90 });
  canvas.getContext("2d").fillRect(20, 20, 200, 40);
  return canvas.toDataURL("image/png").split(",")[1];
});
const choose = (name, buffer, mimeType = "image/png") => page.locator("#firm-logo").setInputFiles({ name, mimeType, buffer });

test("the letter says what to hold and to trade as the service does, in money and as a share", async () => {
  const action = await call(ballast.url, `/action?session=${client}`);
  const session = await call(ballast.url, `/sessions/${client}`);
  await go(`#/sessions/${client}`);
  await page.getByRole("link", { name: "Letter" }).click();
  await page.getByRole("heading", { level: 1, name: "Letter to Client with flows" }).waitFor();
  const told = await words();
  assert.match(told, /Policy: World, monthly\./);
  assert.match(told, /What to hold in March 2026/);
  const whole = session.wealth * (1 - COST * Math.abs(action.trade));
  const amount = action.allocation * whole - action.holding * session.wealth;
  assert.ok(Math.abs(action.trade) > 0.0005, "the test needs a trade");
  const [, verb, size, share] = /(Buy|Sell) ([\d,.]+) of stocks, ([\d.]+) % of your wealth/.exec(told);
  assert.equal(verb, amount > 0 ? "Buy" : "Sell");
  assert.ok(Math.abs(Number(size.replaceAll(",", "")) - Math.abs(amount)) < 0.006, `${size} for ${amount}`);
  assert.ok(Math.abs(Number(share) - (100 * Math.abs(amount)) / session.wealth) <= 0.05, share);
  assert.doesNotMatch(told, /undefined|NaN|null|session_|policy_/);
});

test("returns are of the month, the year and since the start, whatever money came and went", async () => {
  await goLetter();
  const grown = MONTHS.map(({ simple_return }, index) => {
    // The first month pays for the trade from nothing to half; later ones for going back to it, which is little.
    const invested = index === 0 ? 1 - COST * HELD : 1;
    return invested * (1 + (1 - HELD) * RATE + HELD * simple_return);
  });
  const near = async (name, value) => assert.ok(Math.abs(Number.parseFloat(await fact(name)) - 100 * (value - 1)) <= 0.06, `${name}: ${await fact(name)} for ${value}`);
  await near("February 2026", grown[2]);
  await near("2026 so far", grown[1] * grown[2]);
  await near("Since the start", grown[0] * grown[1] * grown[2]);
  assert.equal(await fact("Added, less withdrawn"), "4,700.00");
  assert.match(await words(), /5,000\.00 added, 300\.00 withdrawn/);
  assert.match(await words(), /Worst fall so far\s+-4\.9 %\s+from December 2025 to January 2026/);
});

test("it says in two sentences why, with what would have to change", async () => {
  const { sensitivity } = await call(ballast.url, `/action?session=${client}&sensitivity=true`);
  await goLetter();
  const why = page.locator(".letter .part").filter({ has: page.getByRole("heading", { name: "Why" }) }).locator("p");
  assert.equal(await why.count(), 2);
  assert.match(plain(await why.first().innerText()), /worst market it guards against/);
  const change = plain(await why.last().innerText());
  assert.ok(sensitivity.sentences.map(plain).some((sentence) => sentence === change), change);
  assert.match(change, /next month|^After a return of/);
});

test("what is typed of the firm once is on every letter, in this browser alone", async () => {
  await goLetter();
  const [name, closing, disclaimer] = ["The firm", "Please call us.", "Not a promise."];
  assert.equal(await page.locator(".letterhead").innerText(), "");
  await page.getByLabel("Name of the firm").fill(name);
  await page.getByLabel("Currency").fill("EUR");
  await page.getByLabel("Closing line").fill(closing);
  assert.doesNotMatch(await words(), /promise/);
  await page.getByLabel("Disclaimer").fill(disclaimer);
  await choose("logo.png", Buffer.from(await picture(), "base64"));
  await page.getByRole("img", { name: "Logo of The firm" }).waitFor();
  await page.getByText("The service gets it with each letter and does not keep it.", { exact: false }).waitFor();
  const requests = [];
  page.on("request", (request) => request.method() !== "GET" && requests.push(request));
  await goLetter(ten);
  for (const said of [name, "Amounts in EUR.", closing, disclaimer]) assert.ok((await words()).includes(said), said);
  const drawn = await page.getByRole("img", { name: "Logo of The firm" }).evaluate((logo) => [logo.naturalWidth, logo.naturalHeight]);
  assert.deepEqual([drawn, requests.length], [[300, 90], 1]);
  assert.deepEqual(requests[0].postDataJSON().firm.name, name);
  await page.locator(".firm-form summary").click();
  await choose("large.png", Buffer.alloc(200 * 1024 + 1));
  await page.getByText("The logo has more than 200 KB.", { exact: false }).waitFor();
  await choose("page.png", Buffer.from("<svg onload='x'/>"));
  await page.getByText("This file is not a PNG, JPEG or WebP picture.").waitFor();
  assert.equal(await page.getByRole("img", { name: "Logo of The firm" }).count(), 1, "the earlier logo stays");
  await page.getByRole("button", { name: "Remove the logo" }).click();
  await page.getByRole("img", { name: "Logo of The firm" }).waitFor({ state: "detached" });
});

test("a currency stated once is that of the overview, the session, the letter and a plan, in this browser alone", async () => {
  const { wealth } = await call(ballast.url, `/sessions/${client}`);
  const told = new Intl.NumberFormat("en-GB", { style: "currency", currency: "CHF", useGrouping: "min2" }).format(wealth).replaceAll("\u00a0", " ");
  const main = async () => plain(await page.locator("main").innerText()).replaceAll("\u00a0", " ");
  await go("#/");
  assert.equal(await page.getByLabel("Currency").inputValue(), "EUR", "the field of the firm is the same");
  await page.getByLabel("Currency").fill("");
  assert.doesNotMatch(await main(), /\u20ac|EUR|CHF/);
  await page.getByLabel("Currency").fill("EUO");
  assert.equal(await page.getByLabel("Currency").getAttribute("aria-invalid"), "true");
  assert.doesNotMatch(await main(), /EUO/);
  await page.getByLabel("Currency").fill("chf");
  assert.equal(await page.getByLabel("Currency").getAttribute("aria-invalid"), null);
  assert.ok((await main()).includes(told), `${told} in ${await main()}`);
  await go(`#/sessions/${client}`);
  assert.ok((await main()).includes(told), told);
  await goLetter();
  assert.match(await words(), /Amounts in CHF\..* CHF [\d,.]+/s);
  await page.locator(".firm-form summary").click();
  await written(() => page.getByLabel("Currency").fill(""));
  await page.getByText("Amounts in CHF.").waitFor({ state: "detached" });
  assert.doesNotMatch(await words(), /CHF/);
  await written(() => page.getByLabel("Currency").fill("JPY"));
  await page.getByText("Amounts in JPY.").waitFor();
  assert.match(await words(), /JPY [\d,]+ /);
  await go("#/plan");
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByLabel("Periods a year").selectOption("12");
  await page.getByLabel("Bank return per year, %").fill("2");
  await page.getByLabel("Years", { exact: true }).fill("2");
  await page.getByRole("button", { name: "Make the plan" }).click();
  await page.locator("#plan").getByText(/^Wealth JP\u00a5100,000, 24 months ahead/).waitFor();
  await page.evaluate(() => localStorage.removeItem("ballast-currency"));
});

test("a page on paper holds ten years of months, and thirty assets with the longest texts, on both papers", async () => {
  await goLetter(ten);
  await page.locator(".firm-form summary").click();
  await choose("logo.png", Buffer.from(await picture(), "base64"));
  await page.getByLabel("Closing line").fill(LONG);
  await page.getByLabel("Disclaimer").fill(LONG);
  await page.getByRole("img", { name: "Logo of The firm" }).waitFor();
  for (const id of [ten, wide, client, completed]) {
    await goLetter(id);
    await page.getByRole("img", { name: "Logo of The firm" }).waitFor();
    for (const format of ["A4", "Letter"]) assert.equal(await pages(format), 1, `${id} on ${format}`);
  }
});

test("paper has the letter and nothing to press", async () => {
  await goLetter(ten);
  await page.emulateMedia({ media: "print", colorScheme: "dark" });
  for (const pressed of await page.locator("button, form, nav, a, summary, h1").all()) assert.equal(await pressed.isVisible(), false, await pressed.innerText());
  for (const seen of [".letter h2", ".letter .wealth", ".letter .facts", ".letterfoot"]) assert.ok(await page.locator(seen).first().isVisible(), seen);
  await page.emulateMedia({ media: null, colorScheme: "light" });
});

test("a book has a page for each client, read two at a time, without those that are completed", async () => {
  for (let k = 0; k < 4; k++) await call(ballast.url, "/sessions", { policy, name: `Client ${k}`, tags: ["book"] });
  let [busy, most, asked] = [0, 0, 0];
  const begin = (request) => request.url().includes("/letter?") && ((busy += 1), (asked += 1), (most = Math.max(most, busy)));
  const end = (request) => request.url().includes("/letter?") && (busy -= 1);
  page.on("request", begin);
  page.on("requestfinished", end);
  await goBook();
  page.off("request", begin);
  page.off("requestfinished", end);
  assert.ok(asked >= 7 && most <= 2, `${asked} requests, ${most} at once`);
  const heads = await page.locator(".letter h2").allInnerTexts();
  assert.deepEqual(heads, ["A client with a name of so many words that it takes a line", "Client 0", "Client 1", "Client 2", "Client 3", "Client with flows", "Ten years"]);
  await page.getByText("1 completed session is left out.", { exact: false }).waitFor();
  for (const format of ["A4", "Letter"]) assert.equal(await pages(format), heads.length, format);
  await goBook("?state=completed");
  assert.deepEqual(await page.locator(".letter h2").allInnerTexts(), ["Completed one"]);
});

test("the overview leads to the letters of those ticked, and of those that the filters leave", async () => {
  await go("#/sessions?tag=book");
  for (const name of ["Client 1", "Client 3"]) await page.getByLabel(`Tick session ${name}`).check();
  await page.getByRole("link", { name: "Letters to the 2" }).click();
  await page.getByText("2 letters.", { exact: false }).waitFor();
  assert.deepEqual((await page.locator(".letter h2").allInnerTexts()).sort(), ["Client 1", "Client 3"]);
  await go("#/sessions?tag=book");
  await page.getByRole("link", { name: "Letters", exact: true }).click();
  await page.getByText("4 letters.", { exact: false }).waitFor();
});

test("a trade below the smallest of the overview is left out of the letter, and the adviser is told", async () => {
  await page.evaluate(() => localStorage.setItem("ballast-smallest-trade", "90 %"));
  await goLetter();
  assert.match(await words(), /Nothing to trade: you hold/);
  await page.getByText("Trades below 90 % are left out, as in the overview.").waitFor();
  await goBook("?state=trade");
  assert.equal(await page.locator(".letter").count(), 0);
  await page.evaluate(() => localStorage.removeItem("ballast-smallest-trade"));
  await goLetter();
  assert.doesNotMatch(await words(), /Nothing to trade/);
});

test("a letter that the service refuses, and a session without an investor, are named to the adviser", async () => {
  const stock = JSON.parse(await readFile(new URL("../../examples/problems/stock.json", import.meta.url), "utf8"));
  const declared = await trained(ballast.url, { ...stock, problem: { ...stock.problem, horizon: 2 }, design: { count: 10 } });
  const { session } = await call(ballast.url, "/sessions", { policy: declared, name: "A stock" });
  const refused = { type: "/problems/internal", title: "No", status: 500, detail: "the cause is in the log" };
  await page.route(`**/sessions/${client}/letter*`, (route) => route.fulfill({ status: 500, contentType: "application/problem+json", body: JSON.stringify(refused) }));
  await goBook(`?sessions=${client},${session},${ten}`);
  await page.getByText("No letter to Client with flows: the cause is in the log").waitFor();
  await page.getByText("No letter to A stock:", { exact: false }).waitFor();
  assert.deepEqual(await page.locator(".letter h2").allInnerTexts(), ["Ten years"]);
  await page.unrouteAll();
  await go(`#/sessions/${session}/letter`);
  await page.getByRole("heading", { level: 1, name: "No letter" }).waitFor();
});

test("a letter stands without its second reason if the service is too busy for it", async () => {
  const busy = { type: "/problems/overloaded", title: "The service cannot answer now", status: 503, detail: "too busy" };
  await page.route("**/letter?sensitivity=true", (route) => route.fulfill({ status: 503, contentType: "application/problem+json", body: JSON.stringify(busy) }));
  await goLetter();
  assert.match(await words(), /Even in the worst market/);
  assert.equal(await page.locator(".letter .part").last().locator("p").count(), 1);
  await page.unrouteAll();
});

test("a client reads the letter by a link, without a key, until it is withdrawn", async () => {
  await goLetter();
  await page.getByLabel("Days").fill("0");
  await page.getByRole("button", { name: "Make a link" }).click();
  await page.getByRole("alert").filter({ hasText: /400/ }).waitFor();
  await page.getByLabel("Days").fill("7");
  await page.getByRole("button", { name: "Make a link" }).click();
  const url = await page.locator(".letter-links code").innerText();
  const shown = await chromium.newPage();
  await shown.goto(url);
  const told = await shown.locator(".letter").innerText();
  const firm = await page.evaluate(() => JSON.parse(localStorage.getItem("ballast-firm")).name);
  assert.ok(told.includes("Client with flows") && told.includes(firm), told);
  assert.equal(await shown.locator("script, a, button").count(), 0);
  await page.getByRole("button", { name: "Withdraw" }).click();
  await page.getByText("No link is in force.").waitFor();
  assert.equal((await shown.goto(url)).status(), 404);
  await shown.getByRole("heading", { name: "There is no letter here" }).waitFor();
  await shown.close();
});

test("letters that are not all written cannot be printed unseen", async () => {
  let send;
  const held = new Promise((resolve) => (send = resolve));
  await page.route(`**/sessions/${ten}/letter?*`, async (route) => (await held, route.continue()));
  await page.evaluate(() => (location.hash = "#/key"));
  await page.goto(`${ballast.url}/#/letters?sessions=${client},${ten}`);
  await page.getByText("Writing the letters: 1 of 2", { exact: false }).waitFor();
  const button = page.locator("main button", { hasText: "Print" });
  assert.ok(await button.isDisabled());
  await page.emulateMedia({ media: "print" });
  const said = () => page.locator(".letters").evaluate((letters) => getComputedStyle(letters, "::before").content);
  assert.equal(await said(), '"Not complete: printed when 1 of 2 letters were written."');
  send();
  await page.getByText("Each is printed on a page of its own.", { exact: false }).waitFor({ state: "attached" });
  assert.equal(await said(), "none");
  await page.emulateMedia({ media: null });
  assert.ok(await button.isEnabled());
  await page.unrouteAll();
});

test("the figures of a letter stand apart on a telephone", async () => {
  await page.setViewportSize({ width: 430, height: 844 });
  await page.evaluate(() => localStorage.setItem("ballast-currency", "GBP"));
  await goLetter(ten);
  const over = await page.locator(".letter .facts dd").evaluateAll((found) => found.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.textContent));
  assert.deepEqual(over, []);
  await page.evaluate(() => localStorage.removeItem("ballast-currency"));
  await page.setViewportSize({ width: 1280, height: 900 });
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async (place) => {
    await go(place);
    await page.locator(".letter").first().waitFor();
    await page.locator("main button", { hasText: "Print" }).waitFor();
  }, [`#/sessions/${wide}/letter`, `#/letters?sessions=${client},${ten},${completed}`]);
});
