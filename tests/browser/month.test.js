// A month of an adviser with seven clients, in six stories. Each ends with what the service recorded, of the others too, and nothing may fail in silence.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { afterEach, before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, quiet, visitQuiet } from "./page.js";
import { ballast, chromium, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002, 0.14, -0.12];
const [RATE, COST] = [0.002, 0.001];
const PROBLEM = { horizon: 12, rate_per_step: RATE, periods_per_year: 12, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
/** Returns of the last months, the newest first. */
const MARKET = [0.0213, 0.011, -0.014, 0.02, 0.005];
const WEALTH = { Anna: 50_000, Boris: 80_000, Chen: 120_000, Dora: 200_000, Emil: 30_000, Fay: 60_000, Gus: 10_000 };

/** Returns the last day of the month that ended `ago` months before the newest one that is over. */
const end = (ago) => {
  const tomorrow = new Date();
  tomorrow.setDate(tomorrow.getDate() + 1);
  return new Date(Date.UTC(tomorrow.getFullYear(), tomorrow.getMonth() - ago, 0)).toISOString().slice(0, 10);
};
const slashed = (date) => date.split("-").reverse().join("/");

/** The sessions by name. */
const id = {};
/** What went wrong on the page without a word: errors of its code, and answers that it may not have shown. */
const faults = [];
let world;

before(async () => {
  world = await trained(ballast.url, { name: "World", problem: { ...PROBLEM, trading_cost: COST, history: HISTORY }, design: { count: 10 } });
  const short = await trained(ballast.url, { name: "Short", problem: { ...PROBLEM, horizon: 2, history: HISTORY }, design: { count: 10 } });
  const fund = await trained(ballast.url, { name: "Fund", problem: { ...PROBLEM, assets: ["Stocks", "Bonds"], history: HISTORY.map((back, k) => [back, 0.003 + 0.01 * Math.cos(2.3 * k)]) }, design: { count: 10 } });
  // Where money is saved each month, the share to hold depends on the wealth.
  const saver = await trained(ballast.url, { name: "Saver", problem: { ...PROBLEM, initial_wealth: WEALTH.Gus, contributions: 300, trading_cost: COST, history: HISTORY }, design: { count: 10 } });
  const open = async (name, policy, months, last) => {
    id[name] = (await call(ballast.url, "/sessions", { policy, name, wealth: WEALTH[name] })).session;
    for (let period = 1; period <= months; period++) {
      const ago = last + months - period;
      const returns = policy === fund ? { simple_returns: { Stocks: MARKET[ago], Bonds: 0.003 } } : { simple_return: MARKET[ago] };
      await call(ballast.url, "/observe", { session: id[name], period, date: end(ago), ...returns });
    }
  };
  for (const name of ["Anna", "Boris", "Chen"]) await open(name, world, 2, 1);
  await open("Gus", saver, 2, 1);
  await open("Dora", fund, 2, 1);
  await open("Emil", world, 1, 3);
  await open("Fay", short, 1, 1);
  page.on("pageerror", (error) => faults.push(error.stack));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("response", (response) => response.status() >= 400 && faults.push(`${response.status()} ${response.url()}`));
});

afterEach(() => assert.deepEqual(faults.splice(0), []));

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const main = async () => plain(await page.locator("main").innerText());
const seen = async (name) => (await call(ballast.url, `/sessions/${id[name]}/history`)).observations;
const last = async (name) => (await seen(name)).at(-1);
const near = (value, wanted, why, within = 1e-9) => assert.ok(Math.abs(value - wanted) <= within, `${why}: ${value} for ${wanted}`);
const number = (text) => Number(text.replaceAll(",", ""));
/** An amount below 100,000 as the page writes it. */
const amount = (value) => value.toLocaleString("en-GB", { minimumFractionDigits: 2, maximumFractionDigits: 2, useGrouping: "min2" });
/** The form for the return of the coming month. */
const reporting = () => page.locator("form.observe", { has: page.getByLabel("Given as") }).first();
const listed = () => page.locator("tbody th a").allInnerTexts();
/** All that is recorded of each client. */
const book = async () => Object.fromEntries(await Promise.all(Object.keys(id).map(async (name) => [name, JSON.stringify([await call(ballast.url, `/sessions/${id[name]}`), await call(ballast.url, `/sessions/${id[name]}/history`)])])));
/** Asserts that since `before` something was recorded of these clients, and of nobody else. */
async function changed(before, ...names) {
  const now = await book();
  assert.deepEqual(Object.keys(now).filter((name) => now[name] !== before[name]), names);
}
/** Returns the wealth after a period in which a share is held of one asset. */
const grown = ({ wealth, holding }, held, value) => wealth * (1 - COST * Math.abs(held - holding)) * ((1 - held) * (1 + RATE) + held * (1 + value));

test("who needs care is listed, and the client who is months late is brought up to date", async () => {
  await go("");
  const { sessions, care } = await call(ballast.url, "/sessions?count=care");
  const needing = sessions.filter((entry) => entry.care.length > 0).map(({ name }) => name);
  assert.ok(needing.includes("Emil") && needing.includes("Fay"), needing.join());
  const shown = plain(await page.locator(".needs").innerText());
  assert.ok(shown.startsWith(`${needing.length} of 7 sessions need care: ${care.overdue} `), shown);
  await page.getByRole("button", { name: "Show them" }).click();
  await page.locator(".foot").getByText(`${needing.length} of ${needing.length}`, { exact: true }).waitFor();
  assert.deepEqual((await listed()).sort(), [...needing].sort());
  const before = await book();
  await page.getByRole("link", { name: "Emil" }).click();
  await page.getByRole("heading", { level: 1, name: "Emil" }).waitFor();
  await quiet(page);
  for (const ago of [2, 1, 0]) {
    const form = reporting();
    assert.equal(await form.getByLabel("Last day").inputValue(), end(ago), "the next month is proposed");
    await form.getByLabel(/^Return in /).fill(String(100 * MARKET[ago]));
    await form.getByLabel("Last day").fill(slashed(end(ago)));
    await form.getByRole("button", { name: /^Report / }).click();
    await page.getByRole("heading", { name: `, period ${4 - ago} of 12` }).waitFor();
    await quiet(page);
  }
  const reported = await seen("Emil");
  assert.deepEqual(reported.map(({ date, reported: { simple_return } }) => [date, Number(simple_return.toFixed(9))]), [3, 2, 1, 0].map((ago) => [end(ago), MARKET[ago]]));
  await changed(before, "Emil");
  const after = await call(ballast.url, "/sessions?count=care");
  assert.deepEqual(after.sessions.find(({ name }) => name === "Emil").care, []);
  await go("");
  const now = plain(await page.locator(".needs").innerText());
  assert.ok(now.startsWith(`${needing.length - 1} of 7 sessions need`), now);
});

test("the month of all is one table: a name that is wrong and a return unlike the others are not recorded unseen", async () => {
  const before = await book();
  await go("");
  await page.getByRole("link", { name: "Report for the 6" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  await quiet(page);
  const lines = page.getByLabel("Sessions and their returns, %");
  assert.deepEqual((await lines.inputValue()).split("\n").sort(), ["Anna", "Boris", "Chen", "Dora", "Fay", "Gus"]);
  assert.equal(await page.getByLabel("Last day").inputValue(), end(0));
  const day = slashed(end(0));
  await lines.fill(["client;return;Stocks;Bonds;date", `Anna;2.13;;;${day}`, `Boris;2.31;;;${day}`, `Chen;2.13;;;${day}`, `Dora;;2.13;0.4;${day}`, `Faye;2.13;;;${day}`].join("\n"));
  await page.getByText("no session is called \u201cFaye\u201d", { exact: false }).waitFor();
  await page.getByText("3 active sessions have no line").click();
  // The fold is filled once it has opened.
  const without = page.locator("details[open] .note a");
  await without.nth(2).waitFor();
  assert.deepEqual((await without.allInnerTexts()).sort(), ["Emil", "Fay", "Gus"]);
  await page.getByRole("button", { name: "Report for 4" }).click();
  await page.getByText("3 returns are recorded, and 2 left above to try again.").first().waitFor();
  const outcomes = page.getByRole("table", { name: "Outcomes" });
  await outcomes.getByText(/2 of the 3 reports for this policy and day give 2\.13 %, but this one gives 2\.31 %/).waitFor();
  await changed(before, "Anna", "Chen", "Dora");
  const { allocation } = await call(ballast.url, `/action?session=${id.Chen}`);
  const shown = plain(await outcomes.getByRole("row", { name: /^Chen/ }).locator('[data-name="To hold"]').innerText());
  near(Number.parseFloat(shown), 100 * allocation, "to hold", 0.051);
  // The adviser mends the name, and insists on the return, which is a slip.
  await lines.fill((await lines.inputValue()).replace("Faye", "Fay"));
  await page.getByLabel("It is right: Boris").check();
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("2 returns are recorded.").first().waitFor();
  await quiet(page);
  await changed(before, "Anna", "Boris", "Chen", "Dora", "Fay");
  for (const [name, value] of [["Anna", 0.0213], ["Boris", 0.0231], ["Chen", 0.0213], ["Fay", 0.0213]]) {
    const row = await last(name);
    near(row.reported.simple_return, value, name);
    assert.equal(row.date, end(0), name);
  }
  const row = await last("Dora");
  near(row.assets.log_returns.Stocks, Math.log(1.0213), "Stocks");
  near(row.assets.log_returns.Bonds, Math.log(1.004), "Bonds");
});

test("a slip is found on the overview, corrected with its reason, undone and corrected again", async () => {
  const before = await book();
  const [, previous, slip] = await seen("Boris");
  await go("");
  await page.getByText("Boris reported 2.31 %", { exact: false }).waitFor();
  await page.getByRole("button", { name: "Show which" }).click();
  await page.locator(".foot").getByText("1 of 1", { exact: true }).waitFor();
  await page.getByRole("link", { name: "Boris" }).click();
  await page.getByRole("heading", { level: 1, name: "Boris" }).waitFor();
  const form = page.locator("form", { has: page.getByLabel("What is wrong") });
  const correct = async (value, reason) => {
    await page.getByRole("button", { name: "Correct it", exact: true }).first().click();
    await form.getByLabel("Return, %").fill(value);
    await form.getByLabel("Why").fill(reason);
    await form.getByRole("button", { name: "Correct it" }).click();
    await page.getByText(new RegExp(`was corrected on .*: ${reason}`)).waitFor();
    await quiet(page);
  };
  const stands = async () => {
    const row = await last("Boris");
    return [row.reported.simple_return, Math.expm1((row.now ?? row).log_return)];
  };
  await correct("2.03", "mistyped");
  let [first, now] = await stands();
  near(now, 0.0203, "the correction stands");
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 1 was undone/).waitFor();
  [first, now] = await stands();
  near(now, 0.0231, "what was reported stands again");
  await correct("2.13", "digits were swapped");
  [first, now] = await stands();
  near(first, 0.0231, "the first report stays");
  near(now, 0.0213, "the last correction stands");
  const { corrections } = await call(ballast.url, `/sessions/${id.Boris}/history`);
  assert.deepEqual(corrections.map(({ reason }) => reason), ["mistyped", "Correction 1 was undone", "digits were swapped"]);
  const session = await call(ballast.url, `/sessions/${id.Boris}`);
  near(session.wealth, grown(previous, slip.executed_allocation, 0.0213), "wealth", 1e-6);
  assert.ok((await main()).includes(amount(session.wealth)), "the wealth is shown");
  await changed(before, "Boris");
  await go("");
  assert.doesNotMatch(await main(), /Boris reported/);
});

test("money that came within the month is advised on at once, and recorded with the month's return", async () => {
  const before = await book();
  const now = await call(ballast.url, `/sessions/${id.Gus}`);
  const added = 5000;
  await go(`#/sessions/${id.Gus}`);
  await page.getByText("Money came or went today").click();
  await page.getByLabel("Money that came today").fill(String(added));
  await page.getByRole("button", { name: "Show what to hold" }).click();
  const wealth = now.wealth + added;
  const answer = page.getByText(`With ${amount(wealth)}: `, { exact: false });
  await answer.waitFor();
  const holding = (now.holding * now.wealth) / wealth;
  const [advice, without] = await Promise.all([wealth, now.wealth].map((wealth) => call(ballast.url, "/what-if", { session: id.Gus, wealth, holding })));
  assert.ok(Math.abs(advice.allocation - without.allocation) > 1e-3, "the story needs wealth to matter");
  const words = plain(await answer.innerText());
  near(number(/: ([\d,.]+) of/.exec(words)[1]), advice.allocation * wealth * (1 - COST * Math.abs(advice.trade)), words, 0.006);
  await page.getByText(/^Nothing is recorded\. When you report [A-Z][a-z]+ \d{4}, enter the money as added/).waitFor();
  await changed(before);
  const { allocation } = await call(ballast.url, `/action?session=${id.Gus}`);
  await reporting().getByLabel(/^Return in /).fill("2.13");
  await reporting().getByText("I held another share, or money came or went").click();
  await reporting().getByLabel("Money added at the end").fill(String(added));
  await reporting().getByRole("button", { name: /^Report / }).click();
  await page.getByRole("heading", { name: ", period 4 of 12" }).waitFor();
  await quiet(page);
  await changed(before, "Gus");
  const row = await last("Gus");
  assert.deepEqual([row.date, row.reported.flow, row.reported.simple_return], [end(0), added, 0.0213]);
  near(row.wealth, grown(now, allocation, 0.0213) + added, "wealth", 1e-6);
  assert.match(await main(), new RegExp(`Wealth ${amount(row.wealth)}\\.`));
});

test("the client whose policy has ended goes on with another, with the months lived through", async () => {
  const before = await book();
  const lived = (await seen("Fay")).map(({ date, log_return, wealth }) => [date, log_return, wealth]);
  assert.equal((await call(ballast.url, `/sessions/${id.Fay}`)).state, "completed");
  await go("");
  await page.getByRole("button", { name: "Continue the 1" }).click();
  await page.getByRole("heading", { level: 1, name: "Continue with another policy" }).waitFor();
  assert.deepEqual(await listed(), ["Fay"]);
  await page.getByLabel("Continue with").selectOption(world);
  await page.getByRole("button", { name: "Continue", exact: true }).click();
  await page.getByText("1 session continues with another policy.").first().waitFor();
  await changed(before, "Fay");
  const { policy, state, period, horizon, wealth } = await call(ballast.url, `/sessions/${id.Fay}`);
  assert.deepEqual([policy, state, period, horizon, wealth], [world, "active", 3, 14, lived[1][2]]);
  assert.deepEqual((await seen("Fay")).map(({ date, log_return, wealth }) => [date, log_return, wealth]), lived);
  const { allocation } = await call(ballast.url, `/action?session=${id.Fay}`);
  await page.getByRole("link", { name: "Fay" }).click();
  await page.locator("#advice .big strong").waitFor();
  near(Number.parseFloat(await page.locator("#advice .big strong").innerText()), 100 * allocation, "to hold", 0.051);
});

test("the client sees the advice on the screen, on paper and by a link, and the file has every month", async () => {
  const before = await book();
  const action = await call(ballast.url, `/action?session=${id.Anna}`);
  const { wealth } = await call(ballast.url, `/sessions/${id.Anna}`);
  await go(`#/sessions/${id.Anna}`);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save as CSV" }).click()]);
  const { csvRows } = await dashboardModule("csv.js");
  const [head, , ...rows] = csvRows(await readFile(await download.path(), "utf8"), ",").map(({ cells }) => cells);
  const cells = (name) => rows.map((row) => row[head.indexOf(name)]);
  const months = await seen("Anna");
  assert.deepEqual(cells("Last day"), months.map(({ date }) => date));
  for (const [index, month] of months.entries()) {
    near(Number(cells("Return, %")[index]), 100 * Math.expm1(month.log_return), "return", 1e-8);
    near(Number(cells("Wealth")[index]), month.wealth, "wealth", 1e-6);
  }
  await page.getByRole("switch", { name: "Present" }).click();
  await page.waitForFunction(() => "present" in document.documentElement.dataset);
  near(Number.parseFloat(await page.locator("#advice .big strong").innerText()), 100 * action.allocation, "presented", 0.051);
  assert.doesNotMatch(plain(await page.locator("body").innerText()), /World|Correct it|Delete/);
  await page.keyboard.press("Escape");
  await page.getByRole("link", { name: "Letter", exact: true }).click();
  await page.locator(".letter").waitFor();
  await quiet(page);
  const letter = plain(await page.locator(".letter").innerText()).replaceAll("\u00a0", " ");
  const traded = action.allocation * wealth * (1 - COST * Math.abs(action.trade)) - action.holding * wealth;
  assert.ok(Math.abs(action.trade) > 0.0005, "the story needs a trade");
  near(number(/(?:Buy|Sell) ([\d,.]+) of stocks/.exec(letter)[1]), Math.abs(traded), letter, 0.006);
  assert.equal(((await page.pdf({ format: "A4" })).toString("latin1").match(/\/Type\s*\/Page[^s]/g) ?? []).length, 1);
  await page.getByRole("button", { name: "Make a link" }).click();
  const url = await page.locator(".letter-links code").innerText();
  const client = await chromium.newPage();
  await client.goto(url);
  assert.ok(plain(await client.locator(".letter").innerText()).replaceAll("\u00a0", " ").includes(/(?:Buy|Sell) [\d,.]+ of stocks/.exec(letter)[0]));
  for (const other of Object.keys(id).filter((name) => name !== "Anna")) assert.ok(!(await client.content()).includes(other), other);
  await page.getByRole("button", { name: "Withdraw" }).click();
  await page.getByText("No link is in force.").waitFor();
  assert.equal((await client.goto(url)).status(), 404);
  await client.close();
  await changed(before);
});
