// From a file to an advice in a second, and from the advice to a client who follows it.

import assert from "node:assert/strict";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { call } from "./ballast.js";
import { plain, quiet, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const RETURNS = fileURLToPath(new URL("../../data/us_market_monthly.csv", import.meta.url));
/** The service answers in a fifth of a second; the rest is the reader of the file and a busy machine. */
const SOON = 5000;

const EXAMPLE = "Use the example: US stock market, monthly";
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
/** Opens a form as one that nobody has typed in. */
const fresh = async (hash) => {
  if (page.url().startsWith(ballast.url)) await page.evaluate(() => sessionStorage.clear());
  await go(hash);
};
const big = async () => plain(await page.locator("#advice .big strong").innerText());
const changed = (before) => page.waitForFunction((old) => document.querySelector("#advice .big strong")?.textContent !== old && document.querySelector("#advice"), before);
/** The body of the next call for advice, and its answer. */
const asked = async (act) => {
  const [response] = await Promise.all([page.waitForResponse((one) => one.url().endsWith("/advise") && one.ok()), act()]);
  return { request: response.request().postDataJSON(), answer: await response.json() };
};

test("on the first page a file is advised at once, with the bank's rate and the periods of a year out of it", async () => {
  await go("");
  const start = performance.now();
  const { request, answer } = await asked(() => page.locator("input[type=file]").setInputFiles(RETURNS));
  await page.locator("#advice .big strong").waitFor();
  const took = performance.now() - start;
  assert.ok(took < SOON, `${took} ms`);
  assert.equal(await big(), `${(100 * answer.allocation).toFixed(1)} %`);
  assert.equal(await page.getByLabel("Periods a year").inputValue(), "12");
  assert.equal(await page.getByLabel("The bank return is").inputValue(), "year");
  await page.getByText("The last of column risk_free_return.").waitFor();
  assert.equal(request.problem.periods_per_year, 12);
  assert.ok(Math.abs(request.problem.rate_per_step - 0.0018) < 2e-6, `${request.problem.rate_per_step}`);
  assert.equal(request.problem.history.length, 1109);
  assert.deepEqual((await call(ballast.url, "/jobs")).jobs, [], "nothing is trained");
});

test("every setting changes the advice at once, and a yearly rate is counted per period", async () => {
  await fresh("#/advise");
  await asked(() => page.getByRole("button", { name: EXAMPLE }).click());
  await page.locator("#advice").waitFor();
  const balanced = await big();
  const { answer } = await asked(() => page.getByLabel("Investor").selectOption("cautious"));
  await changed(balanced);
  assert.ok(Number.parseFloat(await big()) < Number.parseFloat(balanced));
  const { request } = await asked(() => page.getByLabel("Bank return per year, %").fill("3"));
  assert.ok(Math.abs((1 + request.problem.rate_per_step) ** 12 - 1.03) < 1e-9);
  const held = await asked(async () => {
    await page.getByLabel("Held now, %").fill("100");
    await page.getByLabel("Wealth now").fill("250000");
  });
  const last = held.request.wealth === 250_000 ? held : await asked(async () => {});
  assert.deepEqual([last.request.wealth, last.request.holding], [250_000, 1]);
  await page.locator("#advice").getByText(/^Sell \d/).waitFor();
  assert.ok(answer.levels.levels.length === 4);
  assert.equal(await page.getByRole("region", { name: "What each level of caution would hold" }).locator("tbody tr").count(), 4);
});

test("a record without dates is asked for its periods before it is advised", async () => {
  await fresh("#/advise");
  await page.getByLabel("Returns or prices").fill("1.2 -0.4 2.1 0.8 1.7 -0.9 1.1 0.4 -2.2 1.9");
  await page.getByText("The record has no dates that show it: choose how many periods make a year.", { exact: true }).waitFor();
  assert.equal(await page.getByLabel("Returns or prices").evaluate((field) => field === document.activeElement), true, "whoever types stays there");
  assert.equal(await page.locator("#advice").count(), 0);
  await asked(() => page.getByLabel("Periods a year").selectOption("52"));
  await page.getByRole("heading", { name: "The coming week" }).waitFor();
  assert.equal(await page.locator("form .error:visible").count(), 0);
});

test("what a record filled in is as at the start again once another record is read that does not say it, and what was typed stays", async () => {
  const terms = async () => [await page.getByLabel("Bank return per").inputValue(), await page.getByLabel("The bank return is").inputValue(), await page.getByLabel("Periods a year").inputValue()];
  const paste = (text) => page.getByLabel(/^Returns(, prices)? or (prices|trades)/).fill(text);
  const months = Array.from({ length: 12 }, (_, k) => `2020-${String(k + 1).padStart(2, "0")},${(1 + 3 * Math.sin(1.7 * k)).toFixed(2)} %`);
  for (const place of ["", "#/advise", "#/plan", "#/sleeve"]) {
    await fresh(place);
    await page.getByRole("button", { name: EXAMPLE }).click();
    await page.getByText("The last of column risk_free_return.").waitFor();
    assert.deepEqual(await terms(), ["2.18", "year", "12"], place);
    await paste(["month,return", ...months].join("\n"));
    await page.waitForFunction(() => document.querySelector("[name='problem.rate_per_step']").value === "2");
    assert.deepEqual(await terms(), ["2", "year", "12"], place);
    await page.getByLabel("Bank return per").fill("1.5");
    await paste("1.2 -0.4 2.1 0.8 1.7 -0.9 1.1 0.4 -2.2 1.9");
    await page.waitForFunction(() => document.querySelector("[name='problem.periods_per_year']").value === "");
    assert.deepEqual(await terms(), ["1.5", "year", ""], place);
    await page.getByLabel("Periods a year").selectOption("52");
    await paste("1.3 -0.4 2.1 0.8 1.7 -0.9 1.1 0.4 -2.2 1.9");
    await quiet(page);
    assert.deepEqual(await terms(), ["1.5", "year", "52"], place);
  }
  await fresh("#/train");
  await page.getByRole("button", { name: EXAMPLE }).click();
  await page.getByRole("button", { name: /^Take the bank.s rate from risk_free_return/ }).click();
  assert.equal(await page.getByLabel("Bank return per").inputValue(), "0.18");
  await paste(["month,return", ...months].join("\n"));
  await page.waitForFunction(() => document.querySelector("[name='problem.rate_per_step']").value === "");
});

test("a pasted record and what was typed with it survive a reload", async () => {
  for (const place of ["", "#/advise"]) {
    await fresh(place);
    await asked(() => page.getByRole("button", { name: EXAMPLE }).click());
    await asked(() => page.getByLabel("Held now, %").fill("25"));
    await asked(() => page.getByLabel("Investor").selectOption("bold"));
    const { request } = await asked(() => page.getByLabel("Bank return per year, %").fill("3"));
    const again = await asked(() => page.reload());
    assert.deepEqual(again.request, request);
    await page.getByText("This is what you typed here before.", { exact: false }).waitFor();
    await page.getByRole("button", { name: "Start again" }).click();
    await page.getByRole("button", { name: "Start again" }).waitFor({ state: "detached" });
    assert.deepEqual([await page.getByLabel("Returns or prices").inputValue(), await page.getByLabel("Held now, %").inputValue()], ["", ""]);
  }
});

test("several columns are several assets, each with what is held of it", async () => {
  await fresh("#/advise");
  const lines = Array.from({ length: 24 }, (_, k) => `${2020 + Math.floor(k / 12)}-${String((k % 12) + 1).padStart(2, "0")},${(1 + 4 * Math.sin(1.7 * k)).toFixed(2)},${(0.4 + Math.cos(2.3 * k)).toFixed(2)}`);
  await page.getByLabel("Returns or prices").fill(["month,Stocks,Bonds", ...lines].join("\n"));
  for (const name of ["Stocks", "Bonds"]) await page.getByRole("checkbox", { name: new RegExp(`^${name} `) }).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByLabel(/^Percent/).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.locator("#advice").waitFor();
  const { request } = await asked(() => page.getByLabel("Bonds held now, %").fill("40"));
  assert.deepEqual([request.problem.assets, request.holdings], [["Stocks", "Bonds"], { Stocks: 0, Bonds: 0.4 }]);
  await page.getByRole("region", { name: "What to hold of each asset" }).waitFor();
});

test("limits on the shares of several assets are sent as they are typed, and the answer keeps and tells them", async () => {
  const [World, Bonds, Gold] = ["World", "Bonds", "Gold"];
  await fresh("#/advise");
  const lines = Array.from({ length: 24 }, (_, k) => `${2020 + Math.floor(k / 12)}-${String((k % 12) + 1).padStart(2, "0")},${(1.5 + 4 * Math.sin(1.7 * k)).toFixed(2)},${(0.4 + Math.cos(2.3 * k)).toFixed(2)},${(0.6 + 3 * Math.sin(2.9 * k)).toFixed(2)}`);
  await page.getByLabel("Returns or prices").fill([`month,${World},${Bonds},${Gold}`, ...lines].join("\n"));
  for (const name of [World, Bonds, Gold]) await page.getByRole("checkbox", { name: new RegExp(`^${name} `) }).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await page.getByLabel(/^Percent/).check();
  const free = await asked(() => page.getByRole("button", { name: "Read it this way" }).click());
  assert.equal(free.request.problem.limits, undefined);
  await page.getByText("Limits on the shares", { exact: true }).click();
  await asked(() => page.getByLabel("Highest share of World, %").fill("20"));
  await asked(() => page.getByLabel("Lowest share of Gold, %").fill("5"));
  await asked(() => page.getByLabel("Highest share of Gold, %").fill("12,5"));
  await page.getByRole("button", { name: "Add a group" }).click();
  const group = page.getByRole("group", { name: "Group 1" });
  await group.getByLabel("Name of the group").fill("Risky");
  await group.getByLabel(World).check();
  await group.getByLabel(Gold).check();
  await asked(() => group.getByLabel("Highest share of the group, %").fill("30"));
  const { request, answer } = await asked(() => page.getByLabel("Largest turnover, %").fill("150"));
  assert.deepEqual(request.problem.limits, { assets: { World: { max: 0.2 }, Gold: { min: 0.05, max: 0.125 } }, groups: [{ name: "Risky", assets: [World, Gold], max: 0.3 }], max_turnover: 1.5 });
  const part = (name) => answer.allocation[name] / answer.total;
  assert.ok(answer.total > 0 && part(World) <= 0.2 + 1e-9 && part(Gold) >= 0.05 - 1e-9 && part(World) + part(Gold) <= 0.3 + 1e-9, JSON.stringify(answer.allocation));
  const told = page.locator(".answered").getByText(/^Limits on the shares of what is held: /);
  await told.filter({ hasText: "turnover" }).waitFor();
  const words = plain(await told.innerText());
  assert.match(words, /World at most 20\.0 %( \(reached\))?; Gold 5\.0 % to 12\.5 %( \(reached\))?; Risky \(World, Gold\) at most 30\.0 %( \(reached\))?; turnover at most 150\.0 %\.$/);
  assert.equal(words.includes("World at most 20.0 % (reached)"), Math.abs(part(World) - 0.2) < 0.0005, words);
  await page.getByLabel("Lowest share of Bonds, %").fill("99");
  await page.getByText(/^No advice yet\. /).waitFor();
  await asked(() => page.getByLabel("Lowest share of Bonds, %").fill(""));
  const without = await asked(() => group.getByRole("button", { name: "Remove the group" }).click());
  assert.equal(without.request.problem.limits.groups, undefined);
  await usable(page, () => {});
});

test("an advice is followed for a client: the same record and settings are trained, and the session opens with the same wealth", async () => {
  await fresh("#/advise");
  await asked(() => page.getByRole("button", { name: EXAMPLE }).click());
  const { request } = await asked(async () => {
    await page.getByLabel("Wealth now").fill("80000");
    await page.getByLabel("Held now, %").fill("25");
    await page.getByLabel("Investor").selectOption("bold");
  });
  await page.locator("#advice").waitFor();
  await page.getByRole("link", { name: "Follow this for a client" }).click();
  await page.getByRole("heading", { level: 1, name: "Train a policy" }).waitFor();
  await page.getByText("The latest 240 of 1109 monthly simple returns", { exact: false }).waitFor();
  await page.getByLabel("Months ahead").fill("2");
  await page.getByText("For the quant", { exact: true }).click();
  await page.getByLabel("Design points").fill("30");
  const [training] = await Promise.all([page.waitForRequest((one) => one.url().endsWith("/train") && one.method() === "POST"), page.getByRole("button", { name: "Train", exact: true }).click()]);
  const { problem } = training.postDataJSON();
  const { horizon, ...same } = request.problem;
  assert.deepEqual(Object.fromEntries(Object.keys(same).map((name) => [name, problem[name]])), { ...same, utility: { kind: "power", risk_aversion: 1.5 }, initial_wealth: 80_000 });
  await page.getByRole("heading", { level: 1, name: "Open a session" }).waitFor();
  assert.deepEqual([await page.getByLabel("Wealth", { exact: true }).inputValue(), await page.getByLabel("Held now, %").inputValue()], ["80000", "25"]);
  await page.getByLabel("Name", { exact: true }).fill("Clara");
  await page.reload();
  await page.getByText("This is what you typed here before.", { exact: false }).waitFor();
  assert.equal(await page.getByLabel("Name", { exact: true }).inputValue(), "Clara");
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: "Clara" }).waitFor();
  const [{ wealth, holding }] = (await call(ballast.url, "/sessions")).sessions;
  assert.deepEqual([wealth, holding], [80_000, 0.25]);
  await go("#/sessions/new");
  assert.equal(await page.getByLabel("Name", { exact: true }).inputValue(), "");
});

test("half a month of reports survives a reload, and what is recorded does not come back", async () => {
  await go("#/report");
  await page.getByLabel("Sessions and their returns, %").fill("Clara 1.2\nNobody 3");
  await go("#/");
  await go("#/report");
  assert.equal(await page.getByLabel("Sessions and their returns, %").inputValue(), "Clara 1.2\nNobody 3");
  await page.getByText("This is what you typed here before.", { exact: false }).waitFor();
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 return is recorded, and 1 left above to try again.").first().waitFor();
  await page.reload();
  await quiet(page);
  assert.equal(await page.getByLabel("Sessions and their returns, %").inputValue(), "Nobody 3");
  await page.getByRole("button", { name: "Start again" }).click();
  await page.getByRole("button", { name: "Start again" }).waitFor({ state: "detached" });
  assert.equal(await page.getByLabel("Sessions and their returns, %").inputValue(), "");
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async (place) => {
    await go(place);
    await page.getByRole("button", { name: EXAMPLE }).click();
    await page.locator("#advice").waitFor();
    await quiet(page);
  }, ["#/advise"]);
});
