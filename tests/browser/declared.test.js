// A problem declared in formulas: it is declared and trained on the page, and its policy says what to do in each period.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, visit as visited } from "./page.js";
import { ballast, page } from "./scene.js";

const STOCK = JSON.parse(await readFile(new URL("../../examples/problems/stock.json", import.meta.url), "utf8"));
const visit = (hash) => visited(page, `${ballast.url}/${hash}`);
const main = async () => plain(await page.locator("main").innerText());
const refused = async () => plain(await page.locator("[role=alert]:visible").innerText());
const form = (button) => page.locator("form").filter({ has: page.getByRole("button", { name: button, exact: true }) });
const press = (name) => page.getByRole("button", { name, exact: true }).click();
const wrong = [];
page.on("pageerror", (error) => wrong.push(String(error)));
page.on("console", (message) => message.type() === "error" && !message.text().startsWith("Failed to load resource") && wrong.push(message.text()));
after(() => assert.deepEqual(wrong, []));

let policy;

test("a declaration is refused with its column, kept, and then trained", async () => {
  await visit("#/policies");
  await page.getByRole("link", { name: "Declare a problem" }).click();
  await page.getByRole("heading", { level: 1, name: "Declare a problem" }).waitFor();
  const text = page.getByLabel("Declaration, as JSON");
  const example = await text.inputValue();
  assert.deepEqual(JSON.parse(example), STOCK);
  await text.fill(example.replace('"end"', "end"));
  await press("Train");
  assert.match(await refused(), /^This is no JSON: .*line 9 column 5/);
  await text.fill(example.replace("cost*order", "cost*ordr"));
  await press("Train");
  await page.getByText("column 41").waitFor();
  assert.match(await refused(), /^problem\.reward is price.*: column 41: `ordr` is no name of this formula/);
  assert.ok(await text.evaluate((area) => area === document.activeElement));
  await page.reload();
  await page.getByText("This is what you typed here before.").waitFor();
  await text.fill(example.replace('"horizon": 12', '"horizon": 3').replace('"count": 100', '"count": 30'));
  await page.getByLabel("Name", { exact: true }).fill("The shop");
  await press("Train");
  await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
  await page.getByRole("link", { name: "See the policy" }).click();
  await page.getByRole("heading", { level: 1, name: "The shop" }).waitFor();
  policy = page.url().split("/").pop();
  const { specification } = await call(ballast.url, `/policies/${policy}`);
  assert.deepEqual([specification.problem.horizon, specification.design.count], [3, 30]);
});

test("a formula that jumps is asked about before the form is left", async () => {
  const message = "problem.reward jumps from -1 to 0 at stock = 30.";
  const warned = async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, json: { ...(await response.json()), warnings: [{ code: "jumps", field: "problem.reward", message }] } });
  };
  const address = `${ballast.url}/policies/${policy}`;
  for (const url of ["**/train", address]) await page.route(url, warned);
  await visit("#/declare");
  await press("Train");
  await page.getByRole("group", { name: "Is this right?" }).waitFor();
  assert.ok((await main()).includes(message));
  const cancelled = page.waitForResponse(/\/jobs\/\w+\/cancel$/);
  await press("No, change it");
  assert.ok((await cancelled).ok());
  await page.getByRole("group", { name: "Is this right?" }).waitFor({ state: "detached" });
  await visit(`#/policies/${policy}`);
  assert.ok((await main()).includes(message));
  for (const url of ["**/train", address]) await page.unroute(url, warned);
});

test("its page has the formulas, and no word of an investor", async () => {
  await visit(`#/policies/${policy}`);
  const shown = await main();
  for (const formula of [STOCK.problem.reward, STOCK.problem.end, STOCK.problem.next.stock, "capacity - stock", "4 at the start, always 0 to 60"]) assert.ok(shown.includes(formula), formula);
  assert.doesNotMatch(shown, /undefined|NaN|null|\bbank\b/);
  await page.getByRole("link", { name: "Clone with one thing changed" }).click();
  await page.getByRole("heading", { level: 1, name: "Declare a problem" }).waitFor();
  const { specification } = await call(ballast.url, `/policies/${policy}`);
  assert.deepEqual(JSON.parse(await page.getByLabel("Declaration, as JSON").inputValue()), specification);
});

/** Presses "Decide" and compares what is shown with the service's answer to `request`. */
async function decided(request) {
  await press("Decide");
  await page.getByRole("heading", { name: `Period ${request.period}`, exact: true }).waitFor();
  const answer = await call(ballast.url, "/decide", { policy, ...request });
  const shown = plain(await page.locator("#decision").innerText());
  const close = (text, value) => assert.ok(Math.abs(Number(plain(text)) - value) < 1e-3 * Math.abs(value), `${text} for ${value}`);
  close(await page.locator("#decision .big strong").innerText(), answer.actions.order);
  const [worth, radius] = await page.locator("#decision dd:not(.note)").allInnerTexts();
  close(worth, answer.value);
  close(radius, answer.radius);
  assert.equal(shown.includes("beyond the states that were trained"), answer.untrained_share > 0, shown);
  const moved = answer.worst_law.filter(({ from, to }) => from !== to);
  assert.ok(moved.length > 0);
  const rows = await page.locator("#decision tbody tr").evaluateAll((rows) => rows.map(({ cells }) => [...cells].map(({ textContent }) => textContent)));
  assert.deepEqual(rows.map(([share]) => plain(share)), moved.map(({ share }) => `${(100 * share).toFixed(1)} %`));
  const stays = 1 - moved.reduce((sum, { share }) => sum + share, 0);
  assert.ok(shown.includes(`The other ${(100 * stays).toFixed(1)} % stays`), shown);
  return answer;
}

test("it says what to do in the first period and in the second, and nothing old stays", async () => {
  await visit(`#/policies/${policy}`);
  const first = await decided({ period: 1, state: { stock: 4 } });
  await page.getByLabel("Period", { exact: true }).fill("2");
  assert.equal(await page.locator("#decision").innerText(), "");
  await page.getByLabel("stock", { exact: true }).fill("7.5");
  await press("Decide");
  await page.getByText("it must have 1").waitFor();
  for (const [typed, words] of [["18,5", /may be one number or several/], ["x", /number 1, is .x.; it must be a number/], ["77", /number 1, is 77; it must be from 0 to 40/]]) {
    await page.getByLabel("demand since the start").fill(typed);
    await press("Decide");
    await page.locator("[role=alert]:visible").waitFor();
    assert.match(await refused(), words);
  }
  await page.getByLabel("demand since the start").fill("18.5");
  const second = await decided({ period: 2, state: { stock: 7.5 }, noises: [18.5] });
  assert.notEqual(first.actions.order, second.actions.order);
  await page.getByLabel("stock", { exact: true }).fill("7,5");
  await press("Decide");
  await page.locator("[role=alert]:visible").waitFor();
  assert.match(await refused(), /^stock is .7,5.; it must be a number/);
  await page.getByLabel("stock", { exact: true }).fill("7.5");
  await page.getByLabel("Period", { exact: true }).fill("3");
  await page.getByLabel("demand since the start").fill("18.5,\n22");
  await decided({ period: 3, state: { stock: 7.5 }, noises: [18.5, 22] });
});

test("it is drawn as a map, of one input and of two", async () => {
  await visit(`#/policies/${policy}`);
  const drawn = page.waitForResponse(/\/decide$/);
  await press("Draw");
  const { across, points } = await (await drawn).json();
  assert.deepEqual([across.map(({ input }) => input), points.length], [["stock", "demand"], 169]);
  const map = page.getByRole("application");
  await map.waitFor();
  await map.press("ArrowLeft");
  const told = plain(await page.locator("#policy-map output").innerText());
  // The cell beside the middle: the stock is 25, the demand 20 each time.
  const place = 5 * 13 + 6;
  assert.ok(Math.abs(Number(told.split("order ")[1]) - points[place].actions.order) < 1e-3 * Math.max(1, points[place].actions.order), `${told} for ${points[place].actions.order}`);
  assert.ok(told.startsWith("stock 25, demand 20:"), told);
  await page.getByLabel("Upward").selectOption("");
  assert.equal(await page.locator("#policy-map").innerText(), "");
  await page.getByLabel("What is drawn").selectOption("");
  await press("Draw");
  await page.getByRole("slider", { name: /^Worth of this period/ }).waitFor();
  await page.locator("#f-map-period").fill("4");
  await press("Draw");
  await page.getByText("In period is 4").waitFor();
});

test("it is compared with a rule, whose formula is refused with its column", async () => {
  await visit(`#/policies/${policy}`);
  const rule = form("Compare").getByLabel("order", { exact: true });
  await rule.fill("max(25 - stok, 0)");
  await press("Compare");
  await page.getByText("column 10").waitFor();
  assert.match(await refused(), /^order: column 10: `stok` is no name of this formula/);
  assert.ok(await rule.evaluate((field) => field === document.activeElement));
  await rule.fill("max(12 - stock, 0)");
  await page.getByLabel("Paths").fill("5");
  await press("Compare");
  await page.getByText("Paths is 5").waitFor();
  assert.match(await refused(), /^Paths is 5; it must lie from 100 to 100,000\.$|^Paths is 5; it must be from 100 to 100,000\.$/);
  await page.getByLabel("Paths").fill("100");
  await press("Compare");
  await page.getByRole("heading", { level: 1, name: "Evaluation of The shop", exact: true }).waitFor();
  const job = page.url().split("/").pop();
  const report = await call(ballast.url, `/jobs/${job}/report`);
  assert.deepEqual([report.request.policies, report.request.rules, report.request.paths], [{ policy }, { rule: { order: "max(12 - stock, 0)" } }, 100]);
  const shown = await main();
  assert.ok(shown.includes(`2 strategies through the same 100 paths of 3 periods, with each demand drawn from the record of ${STOCK.problem.history.length} numbers.`), shown);
  assert.match(shown, /.rule. is worth [\d.]+ \([\d.]+ to [\d.]+\) less than .policy.\. The range does not contain 0: the two can be told apart\./);
  assert.doesNotMatch(shown, /undefined|NaN|null/);
  const rows = await page.getByRole("table", { name: "Worth of each strategy" }).locator("tbody tr").allInnerTexts();
  const cells = rows.map((row) => plain(row).split(/\s*\t\s*/));
  assert.deepEqual(cells.map(([name]) => name), ["policy", "rule"]);
  report.strategies.forEach(({ value, difference, worst_twentieth, robust_value }, index) =>
    [value, difference, worst_twentieth].forEach((estimate, column) => {
      const text = cells[index][column + 1];
      if (estimate === null) return assert.equal(text, "\u2013");
      const numbers = text.replaceAll(",", "").match(/-?[\d.]+/g).map(Number);
      const close = 0.1 * (estimate.high - estimate.low);
      [estimate.value, estimate.low, estimate.high].forEach((number, k) => assert.ok(Math.abs(numbers[k] - number) <= close, `${text} for ${number}`));
      assert.equal(cells[index][4] === "\u2013", robust_value === null);
    }),
  );
  for (const title of ["Average order", "Average stock at the start of a period"]) await page.getByRole("slider", { name: title, exact: true }).waitFor();
  await page.getByRole("slider", { name: "Average order" }).focus();
  await page.keyboard.press("End");
  const last = plain(await page.getByRole("slider", { name: "Average order" }).getAttribute("aria-valuetext"));
  const [first, second] = report.strategies.map(({ periods }) => Number(periods[2].actions.order.toPrecision(5)));
  assert.equal(last, `Period 3: policy ${first}, rule ${second}`);
});

test("it is compared with other frameworks, which are trained for it", async () => {
  await visit(`#/policies/${policy}`);
  await form("Compare").getByLabel("Trusts the record, learns nothing more").check();
  await form("Compare").getByLabel("Paths").fill("100");
  await press("Compare");
  await page.getByRole("heading", { level: 1, name: "Evaluation of The shop", exact: true }).waitFor();
  const { request, strategies } = await call(ballast.url, `/jobs/${page.url().split("/").pop()}/report`);
  assert.deepEqual([request.frameworks, request.design.count, request.rules], [["known_law"], 30, {}]);
  assert.deepEqual(strategies.map(({ strategy }) => strategy), ["policy", "known_law"]);
  const shown = await main();
  assert.ok(shown.includes("\u201cknown_law\u201d takes the record as the truth, and learns nothing more."), shown);
  assert.match(shown, /.known_law. is worth [\d.]+ \([-\d.]+ to [\d.]+\) (more|less) than .policy.\./);
});

test("it walks through its record", async () => {
  await visit(`#/policies/${policy}`);
  const walk = form("Walk");
  await walk.getByLabel("Window").fill("7");
  await press("Walk");
  await page.getByText(/Window is 7/).waitFor();
  await walk.getByLabel("Window").fill("4");
  await walk.getByLabel("Train every").fill("2");
  await walk.getByLabel("Learns, and trusts what it learned").check();
  await walk.getByLabel("order", { exact: true }).fill("max(12 - stock, 0)");
  await press("Walk");
  await page.getByRole("heading", { level: 1, name: "Backtest of order, 3 periods", exact: true }).waitFor();
  const { request, strategies } = await call(ballast.url, `/jobs/${page.url().split("/").pop()}/report`);
  assert.deepEqual([request.window, request.every, request.frameworks], [4, 2, ["adaptive", "plug_in"]]);
  const shown = await main();
  assert.ok(shown.includes("3 strategies lived the last 3 periods of the record of demand, one after another."), shown);
  assert.doesNotMatch(shown, /undefined|NaN|null/);
  const rows = await page.getByRole("table", { name: "Gain of each strategy" }).locator("tbody tr").allInnerTexts();
  const cells = rows.map((row) => plain(row).split(/\s*\t\s*/));
  assert.deepEqual(cells.map(([name]) => name), ["adaptive", "plug_in", "rule"]);
  strategies.forEach(({ earned, left }, index) =>
    [earned, left].forEach((number, column) => {
      const text = cells[index][3 + column].replaceAll(",", "");
      assert.ok(Math.abs(Number(text) - number) <= 1e-4 * Math.abs(number), `${text} for ${number}`);
    }),
  );
  for (const title of ["Order", "Stock at the start of a period", "Rewards so far", "The record of demand"]) await page.getByRole("slider", { name: title, exact: true }).waitFor();
  const [download] = await Promise.all([page.waitForEvent("download"), press("Save as CSV")]);
  const lines = (await readFile(await download.path(), "utf8")).trim().split("\r\n");
  assert.equal(lines[0], "strategy,period,demand,reward,radius,state stock,action order");
  assert.equal(lines.length, 10);
  const third = strategies[2].periods[2];
  assert.deepEqual(lines[9].split(",").slice(0, 2), ["rule", "3"]);
  assert.ok(Math.abs(Number(lines[9].split(",")[6]) - third.actions.order) < 1e-9);
});

test("a comparison of a policy without a name is called by its actions, in the lists too", async () => {
  const named = (name) => fetch(`${ballast.url}/policies/${policy}`, { method: "PATCH", headers: { "content-type": "application/json" }, body: JSON.stringify({ name }) });
  await named("");
  for (const hash of ["#/evaluations", "#/jobs"]) {
    await visit(hash);
    await page.getByRole("heading", { level: 2, name: "Evaluation of order, 3 periods ahead", exact: true }).first().waitFor();
    assert.doesNotMatch(await main(), /undefined|NaN/);
  }
  await named("The shop");
});

test("a verdict says whether the range contains 0", async () => {
  const { verdict } = await dashboardModule("comparison.js");
  const said = (value, low, high) => plain(verdict({ strategy: "mine", difference: { value, low, high } }, "robust"));
  const told = "The range does not contain 0: the two can be told apart.";
  assert.equal(said(-4.34, -6.77, -1.92), `\u201cmine\u201d is worth 4.3 (1.9 to 6.8) less than \u201crobust\u201d. ${told}`);
  assert.equal(said(43.4, 19.2, 67.7), `\u201cmine\u201d is worth 43 (19 to 68) more than \u201crobust\u201d. ${told}`);
  assert.equal(said(0.02, -0.01, 0.05), "\u201cmine\u201d is worth 0.020 (-0.010 to 0.050) more than \u201crobust\u201d. The range contains 0: these paths cannot tell the two apart.");
  assert.equal(said(2.4, 0.03, 4.8), `\u201cmine\u201d is worth 2.40 (0.03 to 4.80) more than \u201crobust\u201d. ${told}`);
  assert.equal(said(0, 0, 0), "\u201cmine\u201d is worth as much as \u201crobust\u201d on these paths.");
  assert.equal(said(2, 2, 2), `\u201cmine\u201d is worth 2 (2 to 2) more than \u201crobust\u201d. ${told}`);
});

test("it stands in the list, and is no policy for an evaluation, a comparison or an investor's form", async () => {
  const investor = await trained(ballast.url, { problem: { horizon: 2, rate_per_step: 0.002, history: [0.01, -0.02, 0.03, 0.01] }, design: { count: 10 } });
  await visit("#/policies");
  const row = page.getByRole("row").filter({ hasText: "The shop" });
  assert.match(await row.innerText(), /None: decides order/);
  assert.doesNotMatch(await main(), /undefined|NaN/);
  await visit(`#/compare?policies=${policy},${investor}`);
  assert.match(await main(), /Only policies of investors can be compared\. Of these, one is of a declared problem/);
  await visit(`#/train?from=${policy}`);
  assert.match(await main(), /This policy is of a declared problem/);
  // The form for a session asks each kind of policy what it needs.
  await visit(`#/sessions/new?policy=${policy}`);
  await page.getByLabel("stock now").waitFor();
  await page.getByLabel("Policy", { exact: true }).selectOption(investor);
  await page.getByLabel("Wealth", { exact: true }).waitFor();
  assert.equal(await page.getByLabel("stock now").count(), 0);
  await press("Open");
  await page.getByRole("heading", { level: 1, name: /^Session / }).waitFor();
  await visit(`#/evaluations/new?policy=${policy}`);
  await press("Evaluate");
  await page.locator("[role=alert]:visible").waitFor();
  assert.match(await refused(), /^This policy is of a declared problem/);
});

test("a number with a decimal point is read, and one with a comma is not", async () => {
  const { pointed } = await dashboardModule("number_text.js");
  assert.deepEqual(["", " 4.605 ", "1.234", "\u22120.5", "1e-3", "3,5", "1,234", "5%", "x"].map(pointed), [null, 4.605, 1.234, -0.5, 0.001, "3,5", "1,234", "5%", "x"]);
});

test("a session lives it: opened at a state, reported, corrected, and ended", async () => {
  await visit(`#/policies/${policy}`);
  await page.getByRole("link", { name: "Open a session" }).click();
  await page.getByRole("heading", { level: 1, name: "Open a session" }).waitFor();
  await page.getByLabel("stock now").fill("61");
  assert.equal(await page.getByLabel("Wealth", { exact: true }).isVisible(), false);
  await press("Open");
  await page.getByText("stock now is 61; it must be from 0 to 60").waitFor();
  await page.getByLabel("stock now").fill("7");
  await page.getByLabel("Name", { exact: true }).fill("The shop lives");
  await press("Open");
  await page.getByRole("heading", { level: 1, name: "The shop lives" }).waitFor();
  const session = page.url().split("/").pop();
  const asked = () => call(ballast.url, `/action?session=${session}`);
  const order = async () => Number(plain(await page.locator("#advice .big strong").innerText()));
  const first = await asked();
  assert.ok(Math.abs((await order()) - first.actions.order) < 1e-3 * first.actions.order);
  assert.doesNotMatch(await main(), /undefined|NaN|null|\bbank\b|wealth/i);
  // More caution and each demand that may come are solved when they are asked for, and record nothing.
  const swept = page.waitForResponse(/\/what-if$/);
  await page.getByText("With more or less caution").click();
  const { points } = await (await swept).json();
  assert.deepEqual([points.length, points[10].actions.order], [21, first.actions.order]);
  await page.getByRole("slider", { name: "Worth under the worst law" }).waitFor();
  await page.getByText("After each demand that may come").click();
  await page.waitForResponse(/\/what-if$/);
  await page.getByRole("slider", { name: "order", exact: true }).nth(1).waitFor();
  assert.equal((await call(ballast.url, `/sessions/${session}`)).period, 1);
  // Nothing is recorded that is blank or beyond its support.
  await press("Report period 1");
  assert.match(await refused(), /^demand is blank/);
  await page.locator("#f-noise").fill("41");
  await press("Report period 1");
  await page.getByText("demand is 41; it must be from 0 to 40").waitFor();
  await page.locator("#f-noise").fill("18.5");
  await page.getByText("I did something else").first().click();
  await page.locator("#f-0-executed-order").fill("12");
  await press("Report period 1");
  await page.locator("#main").getByText("Period 1 is recorded. stock: 0.5.").waitFor();
  const [, second] = [await asked(), await call(ballast.url, `/sessions/${session}`)];
  assert.deepEqual([second.period, second.states], [2, { stock: 0.5 }]);
  // As advised, and by what was counted.
  const advised = (await asked()).actions.order;
  await page.locator("#f-noise").fill("20");
  await page.getByText("I did something else").first().click();
  await page.locator("#f-0-state-stock").fill("3");
  await press("Report period 2");
  await page.locator("#main").getByText("Period 2 is recorded. stock: 3.").waitFor();
  const history = async () => call(ballast.url, `/sessions/${session}/history`);
  assert.deepEqual((await history()).observations.map(({ now }) => [now.noise, now.executed.order, now.state.stock]), [[18.5, 12, 0.5], [20, advised, 3]]);
  const cells = await page.locator("table:has(caption:text('Observed periods')) tbody tr").evaluateAll((rows) => rows.map(({ cells }) => [...cells].map(({ textContent }) => textContent)));
  assert.deepEqual(cells.map((row) => [row[0], row[1], row.at(-1)]), [["2", "20", "3"], ["1", "18.5", "0.5"]]);
  // A correction moves what comes after it, as far as nothing was counted there.
  await page.getByText("Correct a period").click();
  await page.locator("#f-correction-period").selectOption("1");
  await page.locator("#f-correction-noise").fill("10");
  await page.getByLabel("Why").fill("it was counted again");
  await press("Correct it");
  await page.locator("#main").getByText("The period is corrected. stock: 3.").waitFor();
  assert.deepEqual((await history()).observations.map(({ now }) => [now.noise, now.state.stock]), [[10, 9], [20, 3]]);
  assert.ok((await main()).includes("Period 1 was corrected on"));
  const saved = page.waitForEvent("download");
  await press("Save as CSV");
  const lines = (await readFile(await (await saved).path(), "utf8")).trim().split("\r\n");
  assert.equal(lines[0], 'Period,Last day,demand,"order, advised","order, done",Earned in it,stock after it');
  assert.match(lines[1], /^1,,10,[\d.]+,12,[-\d.]+,9$/);
  await page.locator("#f-missing").selectOption("missing");
  await page.getByText("I did something else").first().click();
  await page.locator("#f-0-state-stock").fill("4");
  await press("Report period 3");
  await page.getByText("Its horizon is reached.").waitFor();
  await page.getByRole("link", { name: "Continue with another policy" }).click();
  await page.getByLabel("Continue with").selectOption("anew");
  await press("Continue");
  await page.getByText("1 session continues with another policy.").last().waitFor();
  await page.getByRole("link", { name: "The shop lives" }).click();
  await page.getByRole("heading", { name: "Period 4", exact: true }).waitFor();
  const renewed = (await history()).renewals[0];
  assert.deepEqual([renewed.period, renewed.horizon], [4, 6]);
  const { specification: anew } = await call(ballast.url, `/policies/${renewed.policy}`);
  assert.deepEqual(anew.problem.history, [...STOCK.problem.history, 10, 20]);
  assert.equal(anew.problem.states.stock.start, 4);
  assert.ok((await main()).includes("From period 4 on with"));
  await visit("#/");
  const row = page.locator("tbody tr", { hasText: "The shop lives" });
  assert.match(plain(await row.innerText()), /\u2013[\s\S]*active[\s\S]*3 of 6/);
  await visit(`#/compare?sessions=${session},${session}`);
  await page.getByText("This session is of a declared problem").waitFor();
});
