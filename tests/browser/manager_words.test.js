// The page in a manager's words and in percent; the paper's words stand behind folds.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, cancelJobs, trained } from "./ballast.js";
import { plain, sentTraining, usable, visit, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
/** What stops a reader who is no mathematician. */
const PAPER = /certainty equivalent|miscoverage|\balpha\b|surrogate|duality|lengthscale|design point|\bWasserstein|worst law|robust|multiplier|log-utility|\bradius\b/i;

let policy;

before(async () => {
  const problem = { horizon: 3, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY, radius: { rule: "bridge", alpha: 0.2, scale: 0.1 } };
  policy = await trained(ballast.url, { problem, design: { count: 10 } });
});

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);

/** Fills the form for a policy of two months. */
async function askFor({ rate, cost }) {
  await go("#/train");
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByLabel("Periods a year").selectOption("12");
  await page.getByLabel("Months ahead").fill("2");
  await page.getByLabel("Bank return per month, %").fill(rate);
  await page.getByLabel("Trading cost, %").fill(cost);
}

test("the first sentence of a policy says what it holds now, as a session of it is advised", async () => {
  const problem = { horizon: 3, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY.map((value) => value + 0.01), radius: { rule: "bridge", alpha: 0.5, scale: 0.05 }, support: { rule: "none" } };
  const first = async (policy) => {
    await go(`#/policies/${policy}`);
    const words = page.locator(".words p").first();
    await words.locator("b").waitFor();
    return plain(await words.innerText());
  };
  const advised = async (policy) => {
    const { session } = await call(ballast.url, "/sessions", { policy });
    return call(ballast.url, `/action?session=${session}`);
  };
  const one = await trained(ballast.url, { problem, design: { count: 10 } });
  const told = /^Now it holds ([\d.]+) % in stocks\. It holds nothing in \d+ % of the situations it was trained for in the last month\.$/.exec(await first(one));
  const { allocation } = await advised(one);
  assert.ok(allocation > 0.1 && Math.abs(Number(told[1]) - 100 * allocation) <= 0.05, `${told} for ${allocation}`);
  const costly = await trained(ballast.url, { problem: { ...problem, trading_cost: 0.002 }, design: { count: 10 } });
  const [, low, high] = /^Now it holds ([\d.]+) % in stocks if everything is in the bank now, and keeps up to ([\d.]+) %\./.exec(await first(costly));
  const { band } = await advised(costly);
  for (const [index, share] of [low, high].entries()) assert.ok(Math.abs(Number(share) - 100 * band[index]) <= 0.05, `${share} for ${band}`);
  const many = await trained(ballast.url, { problem, design: { count: 80, initial_laws: "resampled" } });
  const about = /^Now it holds about ([\d.]+) % in stocks\. It holds nothing in \d+ % of the situations it was trained for in the first month, and in \d+ % of those in the last month\.$/.exec(await first(many));
  const there = (await advised(many)).allocation;
  assert.ok(Math.abs(Number(about[1]) - 100 * there) <= 3, `${about} for ${there}`);
});

test("where every session knows the same record, what is held is said, and nothing is said as nothing", async () => {
  const problem = { horizon: 1, history: HISTORY.map((value) => value + 0.01), radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const one = async (rate_per_step) => {
    await go(`#/policies/${await trained(ballast.url, { problem: { ...problem, rate_per_step }, design: { count: 10 } })}`);
    return plain(await page.locator(".single").innerText());
  };
  assert.equal(await one(0.1), "Here every session of this policy knows the same record: hold nothing in stocks, because in the worst market nothing beats the bank.");
  assert.match(await one(0.002), /: hold (\d+\.\d|100) % in stocks, worth [\d.]+ % more than the bank even in the worst market/);
});

test("no page says the paper's words outside a fold", async () => {
  const { session } = await call(ballast.url, "/sessions", { policy });
  for (const hash of ["#/jobs", "#/train", "#/policies", `#/policies/${policy}`, "#/sessions", "#/sessions/new", `#/sessions/${session}`, "#/report", "#/compare", "#/evaluations", "#/evaluations/new", "#/backtests/new"]) {
    await go(hash);
    const words = await page.locator("main").innerText();
    assert.doesNotMatch(words, PAPER, hash);
    assert.doesNotMatch(words, /\d-\d\.|[ (]-\d/, `${hash} has a hyphen for a minus`);
    assert.ok(words.length > 40);
  }
});

test("a policy says whom it is for and how cautious it is, and the paper's words are behind its fold", async () => {
  await go(`#/policies/${policy}`);
  const words = plain(await page.locator("main").innerText());
  assert.match(words, /It looks 3 months ahead for a balanced investor \(risk aversion 3\); the bank pays 0\.20 % a month \(2\.43 % a year\), and all of wealth may be in stocks\./);
  assert.match(words, /Its caution: 80 % confidence, × 0\.1\./);
  await page.locator("summary", { hasText: "For the quant" }).click();
  await page.getByText("Adaptive robust: the radius of the ball is 0.1 times the 80\u202f% quantile of the bridge statistic").waitFor();
});

test("the form takes percent and presets, and sends what the service counts in", async () => {
  await askFor({ rate: "0.25", cost: "0,2 %" });
  await page.getByLabel("Confidence, %").fill("95");
  await page.getByLabel("Investor").selectOption({ label: "Cautious" });
  const { problem } = await sentTraining(page, ballast.url);
  await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
  assert.deepEqual([problem.rate_per_step, problem.trading_cost, problem.radius.alpha, problem.horizon], [0.0025, 0.002, 0.05, 2]);
  assert.deepEqual(problem.utility, { kind: "power", risk_aversion: 6 });
});

test("what may be a mistake is asked about in percent", async () => {
  await askFor({ rate: "3", cost: "5" });
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByText("The training is queued. Is this right?").waitFor();
  const words = plain(await page.locator("main").innerText());
  assert.match(words, /The bank pays 3\.00 % a month, 42\.6 % a year, more than banks usually do\. Is that what it pays in one month, or in a year\?/);
  assert.match(words, /The bank pays 3\.00 % a month, 42\.6 % a year, more than the average return of the record\./);
  assert.match(words, /Trading costs 5\.00 % of what is traded\. Is that right\?/);
  assert.doesNotMatch(words, /problem\./);
  await cancelJobs(ballast.url);
});

test("a refusal is the page's own sentence, in the unit of its field and beside it", async () => {
  await go("#/train");
  await page.getByRole("button", { name: "Start again" }).click();
  await page.getByText("This is what you typed here before.").waitFor({ state: "detached" });
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByLabel("Periods a year").selectOption("none");
  const bank = page.getByLabel("Bank return per period");
  const train = page.getByRole("button", { name: "Train", exact: true });
  const refused = async (words) => {
    await train.click();
    await page.locator(".field .error").getByText(words).waitFor();
  };
  await bank.fill("60");
  await refused("Bank return per period is 60\u202f%; it must be from \u221250\u202f% to 50\u202f%.");
  await bank.fill("a lot");
  await refused(/^Bank return per period is \u201ca lot\u201d; it must be a number/);
  await bank.fill("0.2");
  await page.getByLabel("Confidence").fill("100");
  await refused("Confidence is 100\u202f%; it must be from 0.1\u202f% to 99.9\u202f%.");
  await page.getByLabel("Confidence").fill("90");
  await page.locator("summary", { hasText: "For the quant" }).click();
  await page.getByLabel("Seed").fill("1.5");
  await page.locator("summary", { hasText: "For the quant" }).click();
  await refused("Seed is 1.5; it must be a whole number, zero or more.");
  const words = await page.locator("form").innerText();
  assert.doesNotMatch(words, /f64|usize|u64|expected/);
});

test("a key that may not train is told so without an editor springing open", async () => {
  await go("#/train");
  await page.route("**/train", (route) =>
    route.fulfill({ status: 403, contentType: "application/problem+json", body: JSON.stringify({ type: "/problems/forbidden", title: "Not allowed", status: 403, detail: "the call needs the role train" }) }),
  );
  await page.getByLabel("Returns or prices").fill(HISTORY.join("\n"));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByText("the call needs the role train").waitFor();
  await page.getByLabel("Training request as JSON").waitFor({ state: "hidden" });
  await page.unrouteAll();
});

test("a session that is not there leads back to the list", async () => {
  await go("#/sessions/session_of_nobody");
  await page.getByText(/^There is no session '?session_of_nobody'?\. It may have been deleted\./).waitFor();
  await page.getByRole("link", { name: "See the sessions" }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
});

test("a service that stopped answering is said to have, and heard again", async () => {
  await call(ballast.url, "/train", { problem: { horizon: 60, rate_per_step: 0.002, history: HISTORY }, design: { count: 3000 } });
  await page.route("**/jobs/**", (route) => route.abort());
  await visit(page, `${ballast.url}/#/jobs`);
  await page.getByText(/The service did not answer\..*This page shows its last answer, of \d/).waitFor();
  await page.unrouteAll();
  await page.getByText("The service did not answer.", { exact: false }).waitFor({ state: "hidden" });
  await cancelJobs(ballast.url);
});

test("a visit starts at the sessions", async () => {
  await go("");
  assert.equal(await page.locator("h1").innerText(), "Overview");
});

test("axe finds nothing on the form and on the policy, in light, in dark, at 200 % and at 320 pixels", async () => {
  const places = ["#/train", `#/train?newer=${policy}`, `#/policies/${policy}`];
  await usable(page, async (hash) => {
    await go(hash);
    for (const fold of await page.locator("summary", { hasText: "For the quant" }).all()) await fold.click();
  }, places);
});
