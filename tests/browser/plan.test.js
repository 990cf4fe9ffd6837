// From a file to a plan for years: the question, the answer beside that of the interface, and the policy that keeps to it.

import assert from "node:assert/strict";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { call } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, quiet, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const RETURNS = fileURLToPath(new URL("../../data/us_market_monthly.csv", import.meta.url));
const { RULES, money } = await dashboardModule("plan_answer.js");
const { allocation, wealth } = await dashboardModule("format.js");

const EXAMPLE = "Use the example: US stock market, monthly";
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const make = () => page.getByRole("button", { name: "Make the plan" });
/** Returns the request of the next plan and its answer. */
const planned = async (act) => {
  const [response] = await Promise.all([page.waitForResponse((one) => one.url().endsWith("/plan") && one.ok()), act()]);
  await page.locator("#plan").waitFor();
  return { request: response.request().postDataJSON(), answer: await response.json() };
};
const example = async () => {
  await page.getByRole("button", { name: EXAMPLE }).click();
  await page.getByText("The latest 240 of 1109", { exact: false }).waitFor();
};
const focused = (locator) => locator.evaluate((element) => element === document.activeElement);

let first;

test("a file is planned for: years count as periods, and the sentences are the service's", async () => {
  await go("");
  await page.getByRole("link", { name: "Plan for years" }).click();
  await page.getByRole("heading", { level: 1, name: "Will it last, and how much may I spend?" }).waitFor();
  await page.locator("input[type=file]").setInputFiles(RETURNS);
  await page.getByText("1109 monthly simple returns", { exact: false }).waitFor();
  for (const [label, text] of [["Wealth now", "500000"], ["Amount wanted a year", "24,000.00"], ["Wealth wanted at the end", "50000"], ["Years of spending at the end", "2"]]) await page.getByLabel(label).fill(text);
  first = await planned(() => make().click());
  const { problem, ...rest } = first.request;
  assert.deepEqual([problem.horizon, problem.periods_per_year, problem.initial_wealth, problem.history.length, problem.caution, problem.spending.bequest], [360, 12, 500_000, 1109, "balanced", 24]);
  assert.ok(Math.abs((1 + problem.spending.inflation) ** 12 - 1.02) < 1e-10);
  assert.ok(Math.abs(problem.rate_per_step - 0.0018) < 2e-6, `${problem.rate_per_step}`);
  assert.deepEqual(rest, { wanted: 2000, goal: 50_000, certainty: 0.9, paths: 4000, seed: 1 });
  assert.deepEqual(await call(ballast.url, "/plan", first.request), first.answer, "the same question in a program");
  const shown = (await page.locator(".planned :is(.first, .points li, .sentence)").allInnerTexts()).map(plain);
  assert.deepEqual(shown, first.answer.sentences.map(plain));
  assert.deepEqual([(await call(ballast.url, "/jobs")).jobs, (await call(ballast.url, "/policies")).policies], [[], []], "nothing is trained");
});

test("the table has the figures of the answer, by the year, under both laws", async () => {
  const rows = page.getByRole("region", { name: "The plan beside simple rules" }).locator("tbody tr");
  const { strategies } = first.answer;
  assert.equal(await rows.count(), strategies.length);
  const yearly = (value) => money(12 * value);
  const columns = [["ruin", allocation], ["mean_spending", yearly], ["lowest_spending", yearly], ["bequest", money], ["max_drawdown", allocation], ["reaches_goal", allocation], ["shortfall", money], ["certainty_equivalent", yearly]];
  for (const [index, strategy] of strategies.entries()) {
    const cells = await rows.nth(index).locator("th, td").allInnerTexts();
    const wanted = columns.map(([name, format]) => `${format(strategy[name].record.value)}\nworst ${format(strategy[name].worst.value)}`);
    assert.deepEqual(cells.map(plain), [RULES[strategy.rule], ...wanted].map(plain));
  }
});

test("both laws are drawn on one scale, wealth or spending, and the needed return beside the one seen", async () => {
  const ends = async () => {
    const sliders = page.locator(".planned .duo [role=slider]");
    assert.equal(await sliders.count(), 2);
    const ticks = await page.locator(".planned .duo figure").evaluateAll((figures) => figures.map((figure) => [...figure.querySelectorAll(".tick")].map(({ textContent }) => textContent).join()));
    assert.equal(ticks[0], ticks[1]);
    return plain(await sliders.first().getAttribute("aria-valuetext"));
  };
  const { fan, breaking } = first.answer;
  const said = ({ after }, values) => `After ${after / 12} years: Middle ${money(values[2])}, Half of all, dark ${money(values[1])} to ${money(values[3])}, 90 %, light ${money(values[0])} to ${money(values[4])}`;
  assert.equal(await ends(), plain(said(fan.record.at(-1), fan.record.at(-1).wealth)));
  await page.getByLabel("Show").selectOption("spending");
  const last = fan.record.findLast(({ spending }) => spending);
  assert.match(await ends(), new RegExp(`Middle ${money(12 * last.spending[2])}, `));
  await page.getByText("As a table").last().click();
  const needed = page.getByRole("region", { name: "Mean return a year" }).getByRole("row", { name: /^Needed/ });
  assert.ok(plain(await needed.innerText()).includes(`${(100 * ((1 + breaking.mean_return) ** 12 - 1)).toFixed(1)} %`));
});

test("a plan aims at the wealth wanted, or limits how far money falls, and draws what it holds", async () => {
  const sections = async () => [await page.locator(".planned h2").allInnerTexts(), await page.getByRole("button", { name: "Follow this plan" }).count()];
  const fill = async (entries) => {
    for (const [label, text] of entries) await page.getByLabel(label, { exact: true }).fill(text);
  };
  const drawn = "What is held, by how the plan stands";
  await page.getByLabel("The plan aims at").selectOption("goal");
  await fill([["Years", "5"], ["Amount wanted a year", ""], ["Wealth wanted at the end", "600000"]]);
  const goal = await planned(() => make().click());
  assert.deepEqual([goal.request.aim, goal.request.goal, goal.request.problem.spending.bequest, "wanted" in goal.request], ["goal", 600_000, undefined, false]);
  assert.equal(goal.answer.states.described_by, "funded");
  let [titles, follows] = await sections();
  assert.deepEqual([titles.includes(drawn), follows], [true, 0]);
  const slider = page.getByRole("figure", { name: drawn }).getByRole("slider");
  await slider.focus();
  await page.keyboard.press("End");
  assert.match(plain(await slider.getAttribute("aria-valuetext")), /^100 % of what the bank needs: .* 0 %/, "what the bank pays for is left to it");
  await fill([["Put in a year", "12000"]]);
  const saving = await planned(() => make().click());
  assert.deepEqual([saving.request.saved, "wanted" in saving.request], [1000, false]);
  assert.ok(saving.answer.sentences[0].startsWith("Put in 1000 this month."), saving.answer.sentences[0]);
  const heads = await page.getByRole("region", { name: "The plan beside simple rules" }).locator("thead th").allInnerTexts();
  assert.deepEqual(heads.map(plain), ["Rule", "Left at the end", "Largest fall", "Reaches the wealth wanted", "Missing on average"]);
  await page.getByLabel("The plan aims at").selectOption("spending");
  await fill([["Put in a year", ""], ["Greatest fall, %", "15"]]);
  const limited = await planned(() => make().click());
  assert.deepEqual([limited.request.drawdown_limit, limited.request.drawdown, limited.answer.states.described_by], [0.15, 0, "of_peak"]);
  [titles, follows] = await sections();
  assert.deepEqual([titles.includes(drawn), follows], [true, 0]);
  assert.ok(limited.answer.strategies[0].max_drawdown.worst.value <= 0.15 + 1e-9);
  // Amounts of the answer are written anew in a currency that is named.
  await page.getByText("More: caution and the investor").click();
  await fill([["Currency", "EUR"]]);
  assert.match(await page.getByRole("region", { name: "The plan beside simple rules" }).locator("tbody tr").first().innerText(), /\u20ac/);
  await fill([["Currency", ""]]);
});

test("errors stand at their fields: too many years before anything is sent, and what the service refuses", async () => {
  await go("#/plan");
  await page.getByRole("button", { name: "Start again" }).click();
  await page.getByRole("button", { name: "Start again" }).waitFor({ state: "detached" });
  await make().click();
  await page.getByText("Returns are needed: paste them, or choose a file.").waitFor();
  await example();
  let sent = 0;
  const count = (request) => request.url().endsWith("/plan") && (sent += 1);
  page.on("request", count);
  const refused = async (label, text, words) => {
    const field = page.getByLabel(label, { exact: true });
    const before = await field.inputValue();
    await field.fill(text);
    await make().click();
    await page.locator(".field", { has: field }).locator(".error").waitFor();
    assert.equal(plain(await page.locator("form .error:visible").innerText()), words);
    assert.ok(await focused(field));
    await field.fill(before);
  };
  await refused("Years", "60", "Years is 60; a plan looks at most 520 months ahead, which is 43.3 years.");
  await refused("Years", "0", "Years is 0; it must be at least one month.");
  await refused("Amount wanted a year", "-12000", "Amount wanted a year is -12,000; it must be above 0.");
  await refused("Prices rise a year, %", "-100", "Prices rise a year is -100 %; it must be above -100 %.");
  await refused("Years of spending at the end", "-1", "Years of spending at the end is -1; it must be 0 or more.");
  assert.equal(sent, 0);
  await refused("Wealth now", "", "Wealth now is blank; it must be a number without thousands separators.");
  await refused("Wealth wanted at the end", "a house", "Wealth wanted at the end is \u201ca house\u201d; it must be a number without thousands separators.");
  await page.getByText("More: caution and the investor").click();
  await refused("Certainty, %", "30", "Certainty is 30 %; it must be from 50 % to 99.9 %.");
  assert.equal(sent, 3);
  page.off("request", count);
});

test("the form is kept while the tab is open, with the record and the terms", async () => {
  await page.getByLabel("Years", { exact: true }).fill("25");
  await page.getByLabel("Bank return per year, %").fill("3");
  await page.getByLabel("Caution", { exact: true }).selectOption("cautious");
  await page.reload();
  await page.getByText("This is what you typed here before.", { exact: false }).waitFor();
  await page.getByText("The latest 240 of 1109", { exact: false }).waitFor();
  assert.deepEqual(await Promise.all(["Years", "Bank return per year, %", "Periods a year", "Caution"].map((label) => page.getByLabel(label, { exact: true }).inputValue())), ["25", "3", "12", "cautious"]);
});

test("by the keyboard alone: from the record to the answer, and along the paths", async () => {
  await page.getByRole("button", { name: "Start again" }).focus();
  await page.keyboard.press("Enter");
  await page.getByRole("button", { name: "Start again" }).waitFor({ state: "detached" });
  const reach = async (locator) => {
    for (let press = 0; press < 60 && !(await focused(locator)); press++) await page.keyboard.press("Tab");
    assert.ok(await focused(locator), `${locator} is not reached`);
  };
  await reach(page.getByRole("button", { name: EXAMPLE }));
  await page.keyboard.press("Enter");
  await page.getByText("The latest 240 of 1109", { exact: false }).waitFor();
  await reach(page.getByLabel("Years", { exact: true }));
  await page.keyboard.type("10");
  const { request } = await planned(() => page.keyboard.press("Enter"));
  assert.deepEqual([request.problem.horizon, "wanted" in request, "goal" in request], [120, false, false]);
  assert.ok(await focused(page.locator("#plan")), "who asked reads on from the answer");
  const slider = page.locator(".planned [role=slider]").first();
  await reach(slider);
  await page.keyboard.press("Home");
  assert.match(await slider.getAttribute("aria-valuetext"), /^After 0 years: /);
});

test("on paper stand the question and the answer, and nothing to press", async () => {
  await page.emulateMedia({ media: "print" });
  const seen = (selector) => page.locator(selector).first().isVisible();
  assert.deepEqual(await Promise.all(["form", "button", ".planned details:not([open])"].map(seen)), [false, false, false]);
  assert.deepEqual(await Promise.all(["#plan .note", "#plan .first", ".planned .duo svg", ".planned table"].map(seen)), [true, true, true, true]);
  assert.match(plain(await page.locator("#plan .note").first().innerText()), /^Wealth 100,000, 120 months ahead, prices rise 2\.0 % a year, /);
  await page.emulateMedia({ media: "screen" });
});

test("a plan is followed: the same problem is trained without learning, and the session says what to spend", async () => {
  const [training] = await Promise.all([page.waitForRequest((one) => one.url().endsWith("/train") && one.method() === "POST"), page.getByRole("button", { name: "Follow this plan" }).click()]);
  const { problem, design } = training.postDataJSON();
  assert.deepEqual([problem.framework, problem.horizon, design], ["static", 120, undefined]);
  await page.getByRole("heading", { level: 1, name: "Open a session" }).waitFor();
  assert.equal(await page.getByLabel("Wealth", { exact: true }).inputValue(), "100000");
  await page.getByLabel("Name", { exact: true }).fill("Ada");
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: "Ada" }).waitFor();
  const [{ session }] = (await call(ballast.url, "/sessions")).sessions;
  const { spending, allocation: held } = await call(ballast.url, `/action?session=${session}`);
  const words = plain(await page.locator("#advice").innerText());
  assert.ok(words.includes(`Spend ${plain(wealth(spending.amount))} (${(100 * spending.share).toFixed(2)} % of wealth) before this period.`), words);
  assert.equal(plain(await page.locator("#advice .big").innerText()).replace(/\s+/g, " "), `Hold ${plain(allocation(held))} of the rest in stocks`);
  await page.getByLabel("Return in period 1, %").fill("1");
  await page.getByLabel("Spent").fill("600");
  const left = (100_000 - 600) * ((1 - held) * (1 + problem.rate_per_step) + held * 1.01);
  await page.getByText(`Wealth 100,000 \u2192 ${wealth(left)} at `, { exact: false }).waitFor();
  await page.getByRole("button", { name: "Report period 1" }).click();
  await page.locator(".receipt").waitFor();
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.equal(observations[0].spent, 600);
  assert.ok(Math.abs(observations[0].wealth - left) < 1e-6, `${observations[0].wealth}`);
  const row = page.getByRole("region", { name: "Observed periods, newest first" }).locator("tbody tr").first();
  assert.equal(await row.locator("[data-name=Spent]").innerText(), "600.00");
});

test("an advice leads to the plan with its record, its wealth and its bank", async () => {
  await go("#/advise");
  await page.getByRole("button", { name: EXAMPLE }).click();
  await page.locator("#advice").waitFor();
  await page.getByLabel("Wealth now").fill("250000");
  await page.getByLabel("Investor").selectOption("cautious");
  await quiet(page);
  await page.getByRole("link", { name: "Plan for years" }).click();
  await page.getByText("The record and the settings are those of the advice.", { exact: false }).waitFor();
  await page.getByText("The latest 240 of 1109", { exact: false }).waitFor();
  assert.deepEqual(await Promise.all(["Wealth now", "Bank return per year, %", "Periods a year"].map((label) => page.getByLabel(label, { exact: true }).inputValue())), ["250000", "2.18", "12"]);
  const { request } = await planned(() => make().click());
  assert.deepEqual([request.problem.initial_wealth, request.problem.utility.risk_aversion, request.problem.history.length], [250_000, 6, 240]);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async (place) => {
    await go(place);
    await page.getByRole("button", { name: "Start again" }).click().catch(() => {});
    await example();
    await page.getByLabel("Years", { exact: true }).fill("5");
    await planned(() => make().click());
    await quiet(page);
  }, ["#/plan"]);
});
