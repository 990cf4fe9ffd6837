// Sessions that go on by another policy: one that is there, or the same trained anew on the returns seen.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002, 0.03, -0.02];

let short, long;

before(async () => {
  const of = (horizon, name, more = {}) => trained(ballast.url, { problem: { horizon, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY, ...more }, design: { count: 10 }, name });
  short = await of(2, "Short");
  long = await of(12, "Long");
});

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const opened = async (name, reports) => {
  const { session } = await call(ballast.url, "/sessions", { policy: short, name });
  for (const [index, simple_return] of reports.entries()) await call(ballast.url, "/observe", { session, period: index + 1, simple_return, date: `2026-0${index + 1}-28` });
  return session;
};

test("a completed session goes on by a policy that is there", async () => {
  const session = await opened("Ended", [0.01, -0.02]);
  await go(`#/sessions/${session}`);
  await page.getByRole("link", { name: "Continue with another policy" }).click();
  await page.getByRole("heading", { level: 1, name: "Continue with another policy" }).waitFor();
  await page.getByRole("button", { name: "Continue" }).click();
  await page.getByText("Choose a policy to continue with.").waitFor();
  const choice = page.getByLabel("Continue with");
  await choice.selectOption(await choice.locator("option", { hasText: "Long" }).getAttribute("value"));
  await page.getByRole("button", { name: "Continue" }).click();
  await page.getByText("1 session continues with another policy.").first().waitFor();
  const shown = await call(ballast.url, `/sessions/${session}`);
  assert.deepEqual([shown.policy, shown.state, shown.period, shown.horizon], [long, "active", 3, 14]);
});

test("those ticked that end go on by their policy trained anew, one training for one record", async () => {
  const sessions = [await opened("Last A", [0.01]), await opened("Last B", [0.01])];
  await go("#/?state=ending&sort=name");
  assert.match(plain(await page.getByRole("row", { name: /Last A/ }).innerText()), /In its last period/);
  for (const name of ["Last A", "Last B"]) await page.getByRole("checkbox", { name: `Tick session ${name}` }).check();
  await page.getByRole("link", { name: "Continue the 2" }).click();
  await page.getByLabel("Continue with").selectOption("anew");
  const before = (await call(ballast.url, "/policies")).policies.length;
  await page.getByRole("button", { name: "Continue the 2" }).click();
  await page.getByText("2 sessions continue with another policy.").first().waitFor();
  const { policies } = await call(ballast.url, "/policies");
  assert.equal(policies.length, before + 1);
  const [{ policy, name, tags }] = policies;
  assert.match(name, /^Short \(renewed [A-Z][a-z]+ \d{4}\)$/);
  assert.deepEqual(tags, ["renewed"]);
  const { specification } = await call(ballast.url, `/policies/${policy}`);
  assert.deepEqual(specification.problem.history.slice(0, -1), HISTORY);
  assert.ok(Math.abs(specification.problem.history.at(-1) - Math.log(1.01)) < 1e-12);
  for (const session of sessions) assert.deepEqual([(await call(ballast.url, `/sessions/${session}`)).policy, (await call(ballast.url, `/sessions/${session}`)).horizon], [policy, 3]);
});

test("where wealth matters a training anew starts from the wealth reached", async () => {
  const { anew } = await dashboardModule("renewing.js");
  const specification = { problem: { initial_wealth: 100, rate_per_step: 0.001, utility: { kind: "exponential", risk_aversion: 0.03 }, contributions: 0, history: HISTORY }, design: { count: 10, wealth: { min: 50, max: 200 } }, seed: 1 };
  const history = { history: HISTORY, record: [...HISTORY, 0.02], observations: [{ period: 1, log_return: 0.02, reported: { rate: 0.003 } }, { period: 2, log_return: null, reported: {} }] };
  const asked = anew({ wealth: 150 }, history, { specification: structuredClone(specification), name: "" }, new Date("2026-11-15"));
  assert.deepEqual([asked.problem.history, asked.problem.rate_per_step, asked.problem.initial_wealth, asked.design.wealth, asked.name], [[...HISTORY, 0.02], 0.003, 150, { min: 75, max: 300 }, "Renewed Nov 2026"]);
  specification.problem.utility = { kind: "power", risk_aversion: 3 };
  assert.equal(anew({ wealth: 150 }, history, { specification, name: "World (renewed Nov 2025)" }, new Date("2026-11-15")).problem.initial_wealth, 100);
});

test("to open a session no policy is chosen beforehand, those trained by themselves come last, and what cannot work is greyed", async () => {
  await go("#/sessions/new");
  const policy = page.getByLabel("Policy", { exact: true });
  assert.equal(await policy.inputValue(), "");
  const texts = await policy.locator("option").allInnerTexts();
  assert.match(texts.at(-1), /renewed/);
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByText("Choose a policy for this session.").waitFor();
  await policy.selectOption(long);
  const going = page.getByLabel("How it continues");
  await page.getByText("A rolling session needs a policy that counts older returns less. This one counts all returns equally.", { exact: false }).waitFor();
  assert.deepEqual(await going.locator("option").evaluateAll((options) => options.map(({ disabled }) => disabled)), [false, false, true]);
  await going.selectOption("renews");
  assert.equal(await page.getByLabel("Periods with each policy").inputValue(), "6");
  await page.getByText("1 to 11: this policy looks 12 periods ahead.").waitFor();
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: /^Session/ }).waitFor();
  const { renew } = await call(ballast.url, `/sessions/${page.url().split("/").at(-1)}`);
  assert.equal(renew.every, 6);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  const session = await opened("One more", []);
  await usable(page, (place) => go(place), [`#/renew?sessions=${session}`, "#/renew", "#/sessions/new"]);
});
