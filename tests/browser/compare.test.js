// Two to four policies or sessions side by side, reached by ticking rows of their list.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let careful, bold, one, other;

before(async () => {
  const problem = { horizon: 4, rate_per_step: 0.002, history: HISTORY, radius: { rule: "bridge", alpha: 0.1, scale: 0.3 } };
  const design = { count: 10 };
  careful = await trained(ballast.url, { problem, design });
  bold = await trained(ballast.url, { problem: { ...problem, radius: { ...problem.radius, scale: 0.05 }, trading_cost: 0.003 }, design });
  [one, other] = await Promise.all([careful, bold].map(async (policy) => (await call(ballast.url, "/sessions", { policy })).session));
  for (const [session, held, wealth] of [[one, 0, [0.02]], [other, 1, [0.02, -0.1]]]) {
    for (const [index, simple_return] of wealth.entries())
      await call(ballast.url, "/observe", { session, period: index + 1, simple_return, executed_allocation: held, confirm: true, flow: index === 1 ? 50 : 0, date: `2008-0${index + 1}-28` });
  }
});

const rows = async () => {
  const texts = await page.locator("tbody tr").allInnerTexts();
  return Object.fromEntries(texts.map((text) => plain(text).split("\t").map((cell) => cell.trim())).map(([name, ...cells]) => [name, cells]));
};
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const tick = async (kind, ids) => {
  await go(`#/${kind}`);
  for (const id of ids) await page.getByRole("row", { name: id.replace(/^[a-z]+_/, "").slice(0, 10) }).first().getByRole("checkbox").check();
  await page.getByRole("link", { name: `Compare the ${["two", "three", "four"][ids.length - 2]}` }).click();
};

test("two sessions ticked are told side by side", async () => {
  await tick("sessions", [one, other]);
  await page.getByRole("heading", { level: 1, name: "Two sessions" }).waitFor();
  const told = await rows();
  // Of the second the first period alone: the first has lived no more.
  assert.deepEqual(told["100 has become since the start"].slice(0, 2), ["100.20", (100 * (1 - 0.003) * 1.02).toFixed(2)]);
  // The money of one less that of the other means nothing.
  assert.deepEqual(told["Money added, less withdrawn"], ["0.00", "50.00", "differs"]);
  assert.deepEqual(told.Wealth[2], "differs");
  assert.deepEqual(told["Worst fall"], ["0.0 %", "-10.0 %", "differs"]);
  assert.deepEqual(told["Last period"].slice(0, 2), ["28 Jan 2008", "February 2008"]);
  const actions = await Promise.all([one, other].map((session) => call(ballast.url, `/action?session=${session}`)));
  for (const [index, { allocation }] of actions.entries()) assert.ok(Math.abs(Number.parseFloat(told["To hold in stocks"][index]) - 100 * allocation) <= 0.05);
  const chart = page.getByRole("slider", { name: "What 100 has become" });
  await chart.press("Home");
  assert.match(plain(await chart.getAttribute("aria-valuetext")), /At the start: A 100\.00, B 100\.00/);
});

test("two sessions of other months are lined up by their dates, from where both are on", async () => {
  const { lined, common } = await dashboardModule("compare_sessions.js");
  const { calendar } = await dashboardModule("periods.js");
  const lived = (dates) => ({ grown: [100, ...dates.map((_, k) => 101 + k)], calendar: calendar({ observations: dates.map((date, k) => ({ period: k + 1, reported: { date } })) }, 12) });
  const both = [lived(["2026-03-31", "2026-04-30", "2026-05-31"]), lived(["2026-05-31", "2026-06-30"])];
  const line = lined(both);
  assert.deepEqual(line.places.map(({ name }) => name), ["February 2026", "March 2026", "April 2026", "May 2026", "June 2026"]);
  assert.deepEqual(both.map(line.of), [[0, 1, 2, 3, null], [null, null, 0, 1, 2]]);
  assert.deepEqual(common(both, line), [2, 3]);
  const apart = [both[0], lived(["2027-01-31", "2027-02-28"])];
  assert.equal(common(apart, lined(apart)), null);
});

test("a session's page has the return of the comparison, whatever money came and went", async () => {
  await go(`#/sessions/${other}`);
  await page.getByText(/since the start/).waitFor();
  const words = plain(await page.locator("main").innerText());
  const change = (100 * ((1 - 0.003) * 1.02 * 0.9 - 1)).toFixed(1);
  assert.ok(words.includes(`${change} % since the start, time-weighted; 50.00 added in all`), words);
});

test("policies that differ are never said to be the same", async () => {
  const problem = { horizon: 4, rate_per_step: 0.002, history: HISTORY, radius: { rule: "bridge", alpha: 0.1, scale: 0.3 } };
  const design = { count: 10 };
  const bounded = await trained(ballast.url, { problem: { ...problem, support: { rule: "between", min: -0.4, max: 0.4 } }, design });
  const calibrated = await trained(ballast.url, { problem: { ...problem, radius: { ...problem.radius, rule: "calibrated" } }, design });
  for (const [policy, what] of [[bounded, /They differ in moves assumed possible; everything else/], [calibrated, /They differ in caution; everything else/]]) {
    await tick("policies", [careful, policy]);
    await page.getByRole("heading", { level: 1, name: "Two policies" }).waitFor();
    assert.match(plain(await page.locator(".lead").innerText()), what);
  }
});

test("of several assets, of their distance, of what may be held and of money added each difference is told in words", async () => {
  const design = { count: 20, initial_laws: "resampled" };
  const one = { horizon: 2, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const pair = { ...one, assets: ["Stocks", "Bonds"], history: HISTORY.map((value, k) => [value, 0.003 + 0.004 * Math.cos(k)]) };
  const asked = { one, pair, sup: { ...pair, ground_norm: "sup" }, other: { ...pair, assets: ["Stocks", "Gold"] }, half: { ...one, action_interval: [0, 0.5] }, adding: { ...one, contributions: 5 }, early: { ...one, contributions: [10, 0] }, late: { ...one, contributions: [0, 10] } };
  const policies = {};
  for (const [name, problem] of Object.entries(asked)) policies[name] = await trained(ballast.url, { problem, design });
  const cases = [
    ["one", "pair", /differ in assets, mix of assets, distance of markets,.* and record; other details also differ\./, { Assets: ["One", "Stocks, Bonds"], "Distance of markets": ["One asset only", "Each asset by its own volatility"] }],
    ["pair", "other", /differ in assets; everything else is the same\./, { Assets: ["Stocks, Bonds", "Stocks, Gold"] }],
    ["pair", "sup", /differ in distance of markets/, { "Distance of markets": ["Each asset by its own volatility", "All assets at once"] }],
    ["one", "half", /differ in share allowed outside the bank; everything else is the same\./, { "Share allowed outside the bank": ["0 % to 100 %", "0 % to 50 %"] }],
    ["one", "adding", /differ in money added; everything else is the same\./, { "Money added": ["None", "At the end of each period 5.00 is added."] }],
    ["adding", "late", /differ in money added; everything else is the same\./, { "Money added": ["At the end of each period 5.00 is added.", "In 1 of the periods money is added, 10.00 in all."] }],
    ["early", "late", /differ in money added; everything else is the same\./, { "Money added": ["In 1 of the periods money is added, 10.00 in all.", "In 1 of the periods money is added, 10.00 in all. (other amounts or periods)"] }],
  ];
  const sessions = Object.fromEntries(await Promise.all(Object.entries(policies).map(async ([name, policy]) => [name, (await call(ballast.url, "/sessions", { policy })).session])));
  for (const [kind, ids, who] of [["policies", policies, "They"], ["sessions", sessions, "Their policies"]])
    for (const [left, right, words, cells] of cases) {
      await go(`#/compare?${kind}=${ids[left]},${ids[right]}`);
      const main = plain(await page.locator("main").innerText());
      assert.match(main, new RegExp(`${who} ${words.source}`), `${kind}: ${left} and ${right}`);
      assert.doesNotMatch(main, /NaN|undefined|null/, `${kind}: ${left} and ${right}`);
      const told = await rows();
      for (const [name, both] of Object.entries(cells)) assert.deepEqual(told[name], [...both, "differs"], `${kind}: ${left} and ${right}`);
    }
});

test("of policies a fifth tick takes the place of the first, of sessions as many are ticked as are reported for", async () => {
  const more = [];
  for (let k = 0; k < 3; k++) more.push((await call(ballast.url, "/sessions", { policy: careful })).session);
  const box = (id) => page.getByRole("row", { name: id.replace(/^[a-z]+_/, "").slice(0, 10) }).first().getByRole("checkbox");
  await go("#/sessions");
  for (const id of [one, other, ...more]) await box(id).check();
  await page.getByRole("link", { name: /^Compare/ }).waitFor({ state: "hidden" });
  await page.getByRole("link", { name: "Report for the 5" }).waitFor();
  for (const id of [one, ...more.slice(1)]) await box(id).uncheck();
  await page.getByRole("link", { name: "Compare the two" }).click();
  await page.getByRole("heading", { level: 1, name: "Two sessions" }).waitFor();
  assert.ok(page.url().endsWith(`#/compare?sessions=${other},${more[0]}`), page.url());
  const policies = [careful, bold];
  for (const rate_per_step of [0.001, 0.0012, 0.0014]) policies.push(await trained(ballast.url, { problem: { horizon: 1, rate_per_step, history: HISTORY }, design: { count: 10 } }));
  await go("#/policies");
  for (const id of policies) await box(id).check();
  await page.getByRole("link", { name: "Compare the four" }).click();
  await page.getByRole("heading", { level: 1, name: "Four policies" }).waitFor();
  assert.ok(page.url().endsWith(`#/compare?policies=${policies.slice(1).join(",")}`), page.url());
});

test("four sessions have a line each on one axis, a column each, and no difference of two", async () => {
  const third = (await call(ballast.url, "/sessions", { policy: bold })).session;
  const fourth = (await call(ballast.url, "/sessions", { policy: careful })).session;
  for (const [session, returns] of [[third, [0.03, 0.01]], [fourth, [-0.02]]])
    for (const [index, simple_return] of returns.entries()) await call(ballast.url, "/observe", { session, period: index + 1, simple_return, executed_allocation: 1, confirm: true, date: `2008-0${index + 1}-28` });
  await tick("sessions", [one, other, third, fourth]);
  await page.getByRole("heading", { level: 1, name: "Four sessions" }).waitFor();
  const heads = (await page.locator(".beside thead th").allInnerTexts()).map((head) => head[0]);
  assert.deepEqual(heads, ["W", "A", "B", "C", "D", "D"]);
  const told = await rows();
  assert.deepEqual(told["Worst fall"], ["0.0 %", "-10.0 %", "0.0 %", "-2.0 %", "differs"]);
  assert.equal(told["100 has become since the start"].length, 5);
  assert.equal(told["100 has become since the start"][4], "differs");
  for (const name of ["What 100 has become", "Below the highest so far", "Share held in stocks"]) {
    const chart = page.locator("figure").filter({ has: page.getByRole("slider", { name }) });
    assert.deepEqual((await chart.locator(".legend > span:has(svg)").allInnerTexts()).map((words) => words.trim()[0]), ["A", "B", "C", "D"], name);
    assert.equal(await chart.locator(".plot svg").count(), 1);
  }
  const lines = page.locator("figure").filter({ has: page.getByRole("slider", { name: "What 100 has become" }) }).locator(".plot path.line");
  const drawn = await lines.evaluateAll((paths) => paths.map((path) => `${getComputedStyle(path).stroke} ${getComputedStyle(path).strokeDasharray}`));
  assert.equal(new Set(drawn).size, 4, `${drawn}`);
  assert.match(plain(await page.locator(".lead").innerText()), /100 in A has become [\d.]+, in B [\d.]+, in C [\d.]+ and in D [\d.]+\. The advice now is to hold .* in stocks in A, .* in B, .* in C and .* in D\./);
});

test("three policies are told by what differs between any of them, and drawn on one axis", async () => {
  const third = await trained(ballast.url, { problem: { horizon: 4, rate_per_step: 0.002, history: HISTORY, radius: { rule: "bridge", alpha: 0.1, scale: 0.3 }, support: { rule: "between", min: -0.4, max: 0.4 } }, design: { count: 10 } });
  await tick("policies", [careful, third, bold]);
  await page.getByText("They differ in caution, trading cost and moves assumed possible; everything else is the same.").waitFor();
  const told = await rows();
  assert.deepEqual(told["Trading cost"], ["0.00 %", "0.00 %", "0.30 %", "differs"]);
  assert.deepEqual(told["Moves assumed possible"][3], "differs");
  assert.deepEqual(told.Record[3], "");
  const chart = page.getByRole("slider", { name: "Share in stocks by average return" });
  assert.match(plain(await chart.getAttribute("aria-valuetext")), /A [\d.]+ %, B [\d.]+ %, C [\d.]+ %/);
});

test("two policies ticked are told by what differs, and by what they hold", async () => {
  await tick("policies", [careful, bold]);
  await page.getByText("They differ in caution and trading cost; everything else is the same.").waitFor();
  const told = await rows();
  assert.deepEqual(told.Caution, ["90 % confidence, × 0.3", "90 % confidence, × 0.05", "differs"]);
  assert.deepEqual(told["Trading cost"], ["0.00 %", "0.30 %", "+0.30 points"]);
  assert.deepEqual(told.Record[2], "");
  const chart = page.getByRole("slider", { name: "Share in stocks by average return" });
  await chart.press("Home");
  const at = async () => plain(await chart.getAttribute("aria-valuetext"));
  const low = /A ([\d.]+) %, B ([\d.]+) %/.exec(await at()).slice(1).map(Number);
  await chart.press("End");
  const high = /A ([\d.]+) %, B ([\d.]+) %/.exec(await at()).slice(1).map(Number);
  // The bold one holds no less at either end, and more where the average return is higher.
  assert.ok(low[1] >= low[0] && high[1] > high[0] && high[1] > low[1], `${low} to ${high}`);
});

test("an address that names one or five says how to come by two to four", async () => {
  for (const ids of ["only", "a,b,c,d,e"]) {
    await go(`#/compare?sessions=${ids}`);
    await page.getByText("Tick two to four rows of the policies or of the sessions.").waitFor();
  }
});

test("on a phone both stand beside each other", async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await go(`#/compare?sessions=${one},${other}`);
  const [wide, room] = await page.locator(".table.beside").evaluate((table) => [table.scrollWidth, table.clientWidth]);
  assert.ok(wide <= room, `${wide} of ${room}`);
});

test("axe finds nothing on the pages of two and on the lists, in light, in dark, at 200 % and at 320 pixels", async () => {
  const places = ["#/sessions", "#/policies", `#/compare?policies=${careful},${bold}`, `#/compare?sessions=${one},${other}`, `#/compare?sessions=${(await call(ballast.url, "/sessions?limit=4")).sessions.map(({ session }) => session).join(",")}`];
  await usable(page, go, places);
});
