// The page of an evaluation: sentences first, wealth, one colour a strategy, histograms on one scale.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, cancelJobs, ended, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visit } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k));

let policy, report, evaluation;

before(async () => {
  const problem = { horizon: 3, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY, caution: "paper", support: { rule: "none" } };
  const design = { count: 10 };
  policy = await trained(ballast.url, { problem, design });
  const { specification } = await call(ballast.url, `/policies/${policy}`);
  const { framework, ...asked } = specification.problem;
  const request = { ...specification, problem: asked, policies: { [framework]: policy }, frameworks: ["adaptive", "static", "plug_in"], paths: 400, weights: { "My own": "if(mean3 > mean, 0.35, 0)" } };
  evaluation = (await call(ballast.url, "/evaluate", request)).job;
  await ended(ballast.url, evaluation);
  report = await call(ballast.url, `/jobs/${evaluation}/report`);
  await visit(page, `${ballast.url}/#/evaluations/${evaluation}`);
  await page.getByRole("table", { name: "How wealth ended, by what it is worth" }).waitFor();
});

test("what was compared, on which policy and for whom, comes first, and then what came of it", async () => {
  const words = plain(await page.locator("main").innerText());
  const [first] = words.split("What each is worth");
  assert.match(first, /15 ways to hold stocks, through the same 400 futures of 3 months, after a record of 24 returns, for a balanced investor \(risk aversion 3\) who starts with 100\.00\./);
  assert.match(first, /the bank pays 0\.20 % a month\. .Cautious, learns. is policy [0-9a-f]{10}; the other policies were trained for this\./);
  await page.locator(`a[href="#/policies/${policy}"]`).waitFor();
  const best = report.strategies.reduce((best, one) => (one.certainty_equivalent.value > best.certainty_equivalent.value ? one : best));
  assert.ok(words.includes(`did best over these futures: it is worth as much as a sure ${best.certainty_equivalent.value.toFixed(2)}`), words);
  assert.match(words, /In \d+ % of the futures .Cautious, learns. ends with less than the money put in; the worst 5 % of all futures end with [\d.]+ on average\./);
  const main = report.strategies.find(({ strategy }) => strategy === report.reference);
  assert.notEqual(main, best);
  // The cost of caution is that beside the policy that trusts the record.
  const trusting = report.strategies.find(({ framework }) => framework === "plug_in").certainty_equivalent.value;
  const cost = trusting - main.certainty_equivalent.value;
  assert.ok(cost > 0, `${cost}`);
  assert.ok(words.includes(`Here the record is the true market, so caution can only cost: ${cost.toFixed(2)} of the ${trusting.toFixed(2)} that \u201cTrusts the record\u201d is worth. To see what it saves when the record misleads, compare on records drawn from the market.`), words);
  assert.deepEqual(await page.locator("tbody th b").allInnerTexts(), ["Cautious, learns"]);
  assert.doesNotMatch(words, /utility|Variance|Less adaptive|undefined|NaN/);
});

test("a button leads from there to the form, with the policy and drawn records chosen", async () => {
  await page.getByRole("link", { name: "Draw records" }).click();
  await page.getByRole("heading", { level: 1, name: "Compare out of sample" }).waitFor();
  assert.deepEqual([await page.getByLabel("Policy", { exact: true }).inputValue(), await page.getByLabel("Records", { exact: true }).inputValue()], [policy, "drawn"]);
  const sent = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/evaluate"));
  await page.getByRole("button", { name: "Evaluate", exact: true }).click();
  assert.deepEqual((await sent).postDataJSON().histories, { kind: "drawn", count: 50 });
  await page.waitForURL(/#\/evaluations\/(?!new)./);
  await cancelJobs(ballast.url);
  await visit(page, `${ballast.url}/#/evaluations/${evaluation}`);
  await page.getByRole("table", { name: "How wealth ended, by what it is worth" }).waitFor();
});

test("the table is in wealth and sorted by what each is worth", async () => {
  const rows = await page.getByRole("table", { name: "How wealth ended, by what it is worth" }).locator("tbody tr").allInnerTexts();
  assert.equal(rows.length, report.strategies.length);
  const cells = rows.map((row) => plain(row).split("\t"));
  const worths = cells.map((row) => Number(row[1]));
  assert.deepEqual(worths, [...worths].sort((a, b) => b - a));
  const bank = cells.find(([name]) => name === "All in the bank");
  const sure = (100 * 1.002 ** 3).toFixed(2);
  assert.deepEqual(bank, ["All in the bank", sure, sure, "0.0 %", sure, "0.0 %", sure, sure, sure, sure]);
});

test("at most four histograms stand, on one scale of wealth and of height", async () => {
  const charts = page.locator("section", { hasText: "How wealth spreads at the end" }).locator("figure");
  assert.equal(await charts.count(), 4);
  const labels = await charts.evaluateAll((figures) => figures.map((figure) => [...figure.querySelectorAll("text.tick")].map(({ textContent }) => textContent).join()));
  assert.equal(new Set(labels).size, 1, labels.join(" | "));
  const varying = report.strategies.filter(({ utility }) => utility.max > utility.min);
  assert.ok(varying.length >= 10 && varying.length < report.strategies.length);
  await page.getByText(`The other ${varying.length - 4}`).click();
  await charts.nth(varying.length - 1).waitFor();
  assert.equal(await charts.count(), varying.length);
});

test("what ends as the bank does is a bar of its own, of as many futures as ended there", async () => {
  const { outcomes } = await dashboardModule("evaluation.js");
  const ends = (histogram, at_bank) => ({ framework: "adaptive", certainty_equivalent: { value: 1 }, wealth: { histogram, at_bank } });
  // Three quarters of all futures end at the bank, so that the fifth and the ninetieth hundredth are the same.
  const [one] = outcomes({ strategies: [ends([50, 0, 0, 200], 750)] });
  assert.deepEqual([one.shares, one.banked], [[0.05, 0, 0, 0.2], 0.75]);
  for (const { wealth } of report.strategies) assert.equal(wealth.histogram.reduce((sum, count) => sum + count, wealth.at_bank), 400);
  const charts = page.locator("section", { hasText: "How wealth spreads at the end" });
  const name = { adaptive: "Cautious, learns", static: "Cautious, fixed", plug_in: "Trusts the record" };
  const banked = report.strategies.find(({ framework, wealth }) => framework && wealth.at_bank > 0 && wealth.at_bank < 400);
  assert.ok(banked, "no strategy is in the bank on some paths alone");
  const rows = charts.getByRole("table", { name: name[banked.framework], exact: true, includeHidden: true });
  await page.evaluate(() => document.querySelectorAll("figure details, figure button[aria-expanded]").forEach((element) => element.open !== undefined && (element.open = true)));
  const text = plain(await rows.innerText());
  assert.ok(text.includes(`${report.floor.toFixed(2)}, same as all in the bank`) && text.includes(`${(banked.wealth.at_bank / 4).toFixed(1)} %`), text);
});

test("a strategy has one colour in every chart", async () => {
  const stroke = (locator) => locator.evaluate((element) => getComputedStyle(element).stroke);
  const fill = (locator) => locator.evaluate((element) => getComputedStyle(element).fill);
  const seen = { adaptive: [], plug_in: [] };
  for (const [kind, name, colour] of [["adaptive", "Cautious, learns", "s0"], ["plug_in", "Trusts the record", "s5"]]) {
    seen[kind].push(await stroke(page.locator(`figure:has-text("Average share in stocks") path.line.${colour}`).first()));
    seen[kind].push(await stroke(page.locator(`figure:has-text("Worth as much as a sure") line.range.${colour}`).first()));
    seen[kind].push(await fill(page.getByRole("slider", { name, exact: true }).locator("rect.bar").first()));
    assert.equal(new Set(seen[kind]).size, 1, seen[kind].join());
  }
  assert.notEqual(seen.adaptive[0], seen.plug_in[0]);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, folds open", async () => {
  await page.getByText("Utility, radii and coverage").click();
  await page.getByRole("table", { name: "Certainty equivalents, losses and utility" }).waitFor();
  await usable(page, () => {});
});

test("it is called by the policy it is of, and by its record while that has no name", async () => {
  const heading = (level, name) => page.getByRole("heading", { level, name, exact: true }).waitFor();
  const unnamed = "Evaluation of stocks, on 24 returns, 3 months ahead";
  await heading(1, unnamed);
  await visit(page, `${ballast.url}/#/evaluations`);
  await heading(2, unnamed);
  await fetch(`${ballast.url}/policies/${policy}`, { method: "PATCH", headers: { "content-type": "application/json" }, body: JSON.stringify({ name: "Careful" }) });
  await visit(page, `${ballast.url}/#/jobs`);
  await heading(2, "Evaluation of Careful");
  await visit(page, `${ballast.url}/#/evaluations/${evaluation}`);
  await heading(1, "Evaluation of Careful");
  assert.match(await page.title(), /^Evaluation of Careful/);
});

test("a formula of one's own is sent with an evaluation, and its fault stands at its field", async () => {
  await page.goto(`${ballast.url}/#/evaluations/new?policy=${policy}`);
  await page.getByLabel("A formula of your own").fill("wealth");
  await page.getByRole("button", { name: "Evaluate", exact: true }).click();
  await page.locator(".error").getByText("column 1", { exact: false }).waitFor();
  assert.equal(await page.getByLabel("A formula of your own").getAttribute("aria-invalid"), "true");
  await page.getByLabel("A formula of your own").fill("0.25 + 2*last");
  const asked = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/evaluate"));
  await page.getByRole("button", { name: "Evaluate", exact: true }).click();
  assert.deepEqual((await asked).postDataJSON().weights, { "Your formula": "0.25 + 2*last" });
  await page.waitForURL(/#\/evaluations\/./);
});
