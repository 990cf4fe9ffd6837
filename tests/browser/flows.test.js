// Money that comes and goes, and trading that costs, on the pages of a policy and of its session.

import assert from "node:assert/strict";
import { test } from "node:test";
import { call, ended, trained } from "./ballast.js";
import { plain, sentTraining, visit } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

const main = async () => plain(await page.locator("main").innerText());

test("a policy is trained with what is added and withdrawn as the form says", async () => {
  await visit(page, `${ballast.url}/#/train`);
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByLabel("Periods ahead").fill("3");
  await page.getByLabel("Periods a year").selectOption("none");
  await page.getByLabel("Bank return per period").fill("0.2 %");
  await page.getByLabel("Trading cost").fill("1 %");
  await page.getByLabel("Added each period").fill("12 500; -20; 3,5");
  const { problem } = await sentTraining(page, ballast.url);
  assert.deepEqual([problem.contributions, problem.trading_cost], [[12500, -20, 3.5], 0.01]);
});

test("a session says what is added at the end of the period, reckons with it, and draws the band", async () => {
  const policy = await trained(ballast.url, {
    problem: {
      horizon: 3,
      rate_per_step: 0.002,
      history: HISTORY,
      utility: { kind: "power", risk_aversion: 3 },
      radius: { rule: "bridge", alpha: 0.5, scale: 0.05 },
      trading_cost: 0.01,
      contributions: [5, -8.25, 0],
    },
    design: { count: 10 },
  });
  await visit(page, `${ballast.url}/#/policies/${policy}`);
  await page.getByText(/In 1 of the periods money is added, 5\.00 in all, and in 1 of the periods money is withdrawn, 8\.25 in all\./).waitFor();
  const { session } = await call(ballast.url, "/sessions", { policy, holding: 0.2 });
  await visit(page, `${ballast.url}/#/sessions/${session}`);
  await page.getByText("At the end of the period 5.00 is added.").first().waitFor();
  assert.match(await main(), /No-trade range, low end/);
  await page.getByLabel("Return in period 1").fill("2");
  const foretold = /Wealth 100\.00 \u2192 ([\d.]+) at/.exec(await main())[1];
  await page.getByRole("button", { name: "Report period 1" }).click();
  await page.getByRole("heading", { name: "Period 2 of 3" }).waitFor();
  const { wealth } = await call(ballast.url, `/sessions/${session}`);
  assert.equal(wealth.toFixed(2), foretold);
  await page.getByText("At the end of the period 8.25 is withdrawn.").first().waitFor();
  assert.match(await main(), /time-weighted; 5\.00 added in all/);
});

test("what the form says will be refused is refused in the same words", async () => {
  const { policies: [{ policy }] } = await call(ballast.url, "/policies");
  const { session } = await call(ballast.url, "/sessions", { policy });
  await visit(page, `${ballast.url}/#/sessions/${session}`);
  await page.getByText("I held another share, or money came or went").click();
  await page.getByLabel("Return in period 1").fill("-2");
  for (const [label, text, words] of [
    ["Money added at the end", "-1000", "Money added at the end is -1000; it must leave an allowed wealth: the return, the allocation and the amount added give a wealth of -8"],
    ["Share held, %", "150", "Share held is 150 %; it must be from 0 % to 100 %."],
    ["The bank paid, %", "-60", "The bank paid is -60 %; it must be from -50 % to 50 %."],
    ["Wealth reached", "0", "Wealth reached is 0; it must be from 0.000001 to"],
    ["Return in period 1", "-100.1", "Return in period 1 is -100.1 %; it must be from -100"],
  ]) {
    const field = page.getByLabel(label);
    const before = await field.inputValue();
    await field.fill(text);
    const foretold = plain(await page.locator("output", { hasText: "This will be refused" }).innerText());
    await page.getByRole("button", { name: "Report period 1" }).click();
    await page.locator("form .error:visible").waitFor();
    const told = plain(await page.locator("form .error:visible").innerText());
    assert.equal(foretold, `This will be refused. ${told}`);
    assert.ok(told.startsWith(words), told);
    await field.fill(before);
  }
  await page.getByText(/^Wealth 100\.00 \u2192 [\d.]+ at/).waitFor();
});

test("a policy that forgets is asked for by the form, and sessions by it renew themselves or roll", async () => {
  await visit(page, `${ballast.url}/#/train`);
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByLabel("Periods ahead").fill("2");
  await page.getByLabel("Periods a year").selectOption("none");
  await page.getByLabel("Bank return per period").fill("0.2 %");
  await page.getByLabel("Half-life of returns").fill("1");
  const request = await sentTraining(page, ballast.url);
  assert.deepEqual(request.problem.learning, { kind: "decay", half_life: 1 });
  const design = { count: 20, initial_laws: "resampled" };
  const { job } = await call(ballast.url, "/train", { ...request, design });
  const now = await ended(ballast.url, job);
  assert.equal(now.state, "succeeded", JSON.stringify(now));
  for (const [choice, told] of [
    ["Renewed automatically", { renew: { every: 1, window: null }, rolling: false }],
    ["Rolling", { renew: null, rolling: true }],
  ]) {
    await visit(page, `${ballast.url}/#/sessions/new?policy=${now.policy}`);
    await page.getByLabel("How it continues").selectOption(choice);
    if (choice === "Renewed automatically") await page.getByLabel("Periods with each policy").fill("1");
    await page.getByRole("button", { name: "Open" }).click();
    await page.getByRole("heading", { name: /^Period 1/ }).waitFor();
    const session = page.url().split("/").at(-1);
    const { renew, rolling } = await call(ballast.url, `/sessions/${session}`);
    assert.deepEqual({ renew, rolling }, told);
  }
  assert.equal(await page.getByRole("heading", { name: "Period 1 of 2" }).count(), 0);
  await page.getByRole("slider", { name: "Returns seen and the worst market" }).waitFor();
  const words = await main();
  assert.match(words, /0 periods observed\n/);
  assert.doesNotMatch(words, /undefined|at the horizon/);
});

test("money that came or went today has its advice at once, and nothing is recorded", async () => {
  const problem = { horizon: 3, rate_per_step: 0.002, utility: { kind: "power", risk_aversion: 3 }, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const one = await trained(ballast.url, { problem: { ...problem, history: HISTORY, trading_cost: 0.01 }, design: { count: 10 } });
  const two = await trained(ballast.url, { problem: { ...problem, assets: ["Stocks", "Bonds"], history: HISTORY.map((back, k) => [back, 0.004 + 0.01 * Math.cos(2.3 * k)]) }, design: { count: 10 } });
  for (const [policy, more, assets] of [[one, { holding: 0.2 }, null], [two, { holdings: { Stocks: 0.3, Bonds: 0.6 } }, ["Stocks", "Bonds"]]]) {
    const { session } = await call(ballast.url, "/sessions", { policy, wealth: 1000, ...more });
    const before = await call(ballast.url, `/sessions/${session}`);
    await visit(page, `${ballast.url}/#/sessions/${session}`);
    await page.getByText("Money came or went today").click();
    const field = page.getByLabel("Money that came today");
    for (const refused of ["", "a lot", "-1000"]) {
      await field.fill(refused);
      await page.getByRole("button", { name: "Show what to hold" }).click();
      await page.getByText("Type an amount, such as 100", { exact: false }).waitFor();
    }
    // The second takes more than the bank holds, so the assets are sold for it.
    for (const added of [600, -500]) {
      await field.fill(String(added));
      await page.getByRole("button", { name: "Show what to hold" }).click();
      const wealth = 1000 + added;
      const words = page.getByText(`With ${wealth}.00: `, { exact: false });
      await words.waitFor();
      const own = assets ? { holdings: Object.fromEntries(assets.map((name) => [name, (more.holdings[name] * 1000) / Math.max(wealth, 900)])) } : { holding: (more.holding * 1000) / wealth };
      const advice = await call(ballast.url, "/what-if", { session, wealth, ...own });
      const cost = assets ? 0 : 0.01 * Math.abs(advice.trade);
      const share = assets ? advice.total : advice.allocation;
      const shown = Number(/: ([\d,.]+) (?:of|in)/.exec(plain(await words.innerText()))[1].replaceAll(",", ""));
      assert.ok(Math.abs(shown - share * wealth * (1 - cost)) < 0.006, `${shown} for ${share * wealth * (1 - cost)}`);
      if (assets) for (const name of assets) assert.ok(advice.trade[name] === 0 || plain(await words.innerText()).includes(` of ${name}`));
    }
    assert.deepEqual(await call(ballast.url, `/sessions/${session}`), before, "nothing is recorded");
  }
});
