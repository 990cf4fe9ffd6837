// The track record of a session: every figure against one reckoned here from what was reported.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visit, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = Array.from({ length: 24 }, (_, k) => 0.012 + 0.04 * Math.sin(1.7 * k));
const [RATE, MONTHS] = [0.002, 26];
const RETURNS = Array.from({ length: MONTHS }, (_, k) => Number((0.01 + 0.04 * Math.cos(2.1 * k) - (k === 7 ? 0.12 : 0)).toFixed(4)));
/** A deposit as large as the wealth, and a withdrawal: neither is profit. */
const FLOWS = { 3: 100, 15: -40 };
/** The last day of a month, counted from January 2024. */
const day = (k) => new Date(Date.UTC(2024, k + 1, 0)).toISOString().slice(0, 10);
const named = (k) => new Date(`${day(k)}T00:00:00Z`).toLocaleDateString("en-GB", { month: "long", year: "numeric", timeZone: "UTC" });

const percent = (fraction) => `${(100 * fraction).toFixed(1).replace(/^-(?=0\.0$)/, "")} %`;
const cells = async (name) => (await page.getByRole("table", { name }).locator("tr").evaluateAll((rows) => rows.map((row) => [...row.children].map(({ textContent }) => textContent)))).map((row) => row.map(plain));
const main = async () => plain(await page.locator("main").innerText());
const product = (numbers) => numbers.reduce((all, number) => all * number, 1);
const levelsOf = (growths) => growths.reduce((levels, growth) => [...levels, levels.at(-1) * growth], [100]);

/** The figures a year, reckoned by their definitions. */
function expected(growths, rates) {
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const excess = growths.map((growth, k) => growth - 1 - rates[k]);
  const spread = (values) => Math.sqrt(values.map((value) => (value - mean(values)) ** 2).reduce((sum, value) => sum + value, 0) / (values.length - 1));
  const shortfall = Math.sqrt(mean(excess.map((value) => (value < 0 ? value * value : 0))));
  return [
    percent(product(growths) ** (12 / growths.length) - 1),
    percent(spread(growths) * Math.sqrt(12)),
    ((mean(excess) / spread(excess)) * Math.sqrt(12)).toFixed(2),
    ((mean(excess) / shortfall) * Math.sqrt(12)).toFixed(2),
  ];
}

/** The deepest fall of levels: `{depth, from, to, back}`. */
function deepest(levels) {
  let worst = { depth: 0 };
  levels.forEach((level, to) => {
    const top = Math.max(...levels.slice(0, to + 1));
    if (level / top - 1 < worst.depth) worst = { depth: level / top - 1, from: levels.indexOf(top), to, top };
  });
  const back = levels.findIndex((level, at) => at > worst.to && level >= worst.top);
  return { ...worst, back: back < 0 ? null : back };
}

let session, young, history, growths;

before(async () => {
  const problem = { horizon: MONTHS + 1, rate_per_step: RATE, periods_per_year: 12, history: HISTORY, caution: "bold" };
  const policy = await trained(ballast.url, { problem, design: { count: 10 } });
  const open = async (name, months) => {
    const { session } = await call(ballast.url, "/sessions", { policy, name, wealth: 100 });
    // What was held is reported, so that the account does not rest on the advice.
    for (let k = 0; k < months; k++) await call(ballast.url, "/observe", { session, period: k + 1, simple_return: RETURNS[k], date: day(k), executed_allocation: k % 2 === 0 ? 0.8 : 0.5, flow: FLOWS[k] ?? 0, confirm: true });
    return session;
  };
  [session, young] = [await open("Whole", MONTHS), await open("Young", 5)];
  history = await call(ballast.url, `/sessions/${session}/history`);
  growths = RETURNS.map((back, k) => (k % 2 === 0 ? 0.8 : 0.5) * (1 + back) + (k % 2 === 0 ? 0.2 : 0.5) * (1 + RATE));
});

test("the service's wealth is that of the returns reported here, with the deposit and the withdrawal", () => {
  const wealth = growths.reduce((wealth, growth, k) => wealth * growth + (FLOWS[k] ?? 0), 100);
  assert.ok(Math.abs(history.observations.at(-1).wealth - wealth) < 1e-6, `${history.observations.at(-1).wealth} ${wealth}`);
});

test("a link leads from the session to its track record, whose figures have no profit from deposits", async () => {
  await visit(page, `${ballast.url}/#/sessions/${session}`);
  await page.getByRole("link", { name: "Track record" }).click();
  await page.getByRole("heading", { level: 1, name: "Track record of Whole", exact: true }).waitFor();
  const words = await main();
  assert.ok(words.includes(`January 2024 to February 2026, 26 months: 100 became ${(100 * product(growths)).toFixed(2)}.`), words);
  const rates = RETURNS.map(() => RATE);
  const rows = await cells("What the session and its comparators earned");
  assert.deepEqual(rows[0], ["Held", "100 became", "Return a year", "Deviation a year", "Sharpe ratio", "Sortino ratio", "Worst fall"]);
  const lines = { "This session": growths, "60/40": RETURNS.map((back) => 0.6 * (1 + back) + 0.4 * (1 + RATE)), "All in stocks": RETURNS.map((back) => 1 + back) };
  for (const [name, growths] of Object.entries(lines)) {
    assert.deepEqual(rows.find(([held]) => held === name), [name, (100 * product(growths)).toFixed(2), ...expected(growths, rates), percent(deepest(levelsOf(growths)).depth)]);
  }
  const bank = 100 * (1 + RATE) ** MONTHS;
  assert.deepEqual(rows.find(([held]) => held === "All in the bank"), ["All in the bank", bank.toFixed(2), percent((1 + RATE) ** 12 - 1), "0.0 %", "\u2013", "\u2013", "0.0 %"]);
  // The comparators are the service's own, without their flows.
  const { bank: kept } = history.observations.at(-1).account.benchmarks;
  const flown = RETURNS.reduce((wealth, _, k) => wealth * (1 + RATE) + (FLOWS[k] ?? 0), 100);
  assert.ok(Math.abs(kept - flown) < 1e-6, `${kept} ${flown}`);
  const facts = Object.fromEntries(await page.locator("dl.facts > div").evaluateAll((facts) => facts.map((fact) => [...fact.children].slice(0, 2).map(({ textContent }) => textContent))));
  assert.deepEqual(["Return a year", "Deviation a year", "Sharpe ratio", "Sortino ratio"].map((name) => plain(facts[name])), expected(growths, rates));
  assert.doesNotMatch(words, /undefined|NaN|null/);
});

test("its worst fall has its days and its recovery, and years, months and rolling years are compounded", async () => {
  const levels = levelsOf(growths);
  const { depth, from, to, back } = deepest(levels);
  assert.ok(back !== null && from > 0, `${from} ${back}`);
  const [, worst] = await cells("The worst falls of This session");
  assert.deepEqual([...worst.slice(0, 4), worst[5]], [named(from - 1), named(to - 1), named(back - 1), percent(depth), `${back - from} months`]);
  const years = await cells("Returns by the year of This session and of others");
  assert.deepEqual(years.slice(1).map(([year, own]) => [year, own]), [["2024", percent(product(growths.slice(0, 12)) - 1)], ["2025", percent(product(growths.slice(12, 24)) - 1)], ["20262 months", percent(product(growths.slice(24)) - 1)]]);
  const months = await cells("Returns of This session month by month");
  assert.deepEqual(months.find(([year]) => year === "2025").slice(1), [...growths.slice(12, 24).map((growth) => percent(growth - 1)), percent(product(growths.slice(12, 24)) - 1)]);
  const rolled = levels.slice(12).map((level, k) => level / levels[k] - 1);
  const note = await page.getByRole("figure", { name: "Return a year over the year before" }).locator("p.note").textContent();
  assert.ok(plain(note).startsWith(`Over any 1 year of the record \u201cThis session\u201d earned between ${percent(Math.min(...rolled))} and ${percent(Math.max(...rolled))} a year.`), note);
});

test("a benchmark of one's own is drawn by its name once it covers all months, and is not kept", async () => {
  await page.getByText("Compare with a benchmark of your own").click();
  await page.getByLabel("Its name").fill("World index");
  const index = RETURNS.map((_, k) => Number((0.006 + 0.02 * Math.sin(k)).toFixed(4)));
  // The days of an index need not be those of the session.
  const text = (some) => `date,index\n${some.map((back, k) => `${day(k).slice(0, 8)}26,${back}`).join("\n")}\n`;
  const field = page.getByLabel("Its returns or prices, with dates");
  await field.fill(text(index.slice(0, 20)));
  await page.getByText(`No return for ${named(20)}, ${named(21)}, ${named(22)} and others.`).waitFor();
  assert.equal(await page.getByRole("row", { name: "World index" }).count(), 0);
  await field.fill(text(index));
  await page.getByRole("row", { name: "World index" }).first().waitFor();
  const growths = index.map((back) => 1 + back);
  const row = (await cells("What the session and its comparators earned")).find(([held]) => held === "World index");
  assert.deepEqual(row.slice(0, 6), ["World index", (100 * product(growths)).toFixed(2), ...expected(growths, RETURNS.map(() => RATE))]);
  const [head, first] = await cells("Returns by the year of This session and of others");
  assert.equal(first[head.indexOf("World index")], percent(product(growths.slice(0, 12)) - 1));
  await usable(page, () => {});
  await visit(page, `${ballast.url}/#/sessions/${session}/track`);
  assert.equal(await page.getByRole("row", { name: "World index" }).count(), 0);
  assert.deepEqual(await call(ballast.url, `/sessions/${session}/history`), history);
});

test("returns finer than the periods are compounded, and a period that they do not cover is missing", async () => {
  const { inPeriods } = await dashboardModule("own_benchmark.js");
  const ends = ["2023-12-31", "2024-01-31", "2024-02-29"];
  const days = ["2023-12-29", "2024-01-02", "2024-01-30", "2024-02-01", "2024-02-28", "2024-03-01"];
  const found = inPeriods(days, [9, 0.01, 0.02, -0.01, -0.03, 9], ends, "month");
  assert.ok(Math.abs(found[0] - Math.expm1(0.03)) < 1e-12 && Math.abs(found[1] - Math.expm1(-0.04)) < 1e-12, `${found}`);
  assert.deepEqual(inPeriods(["2024-01", "2024-03"], [0, 0], ends, "month"), [0, null]);
  assert.deepEqual(inPeriods(["2024-01-05", "2024-01-12"], [0, 0], ["2023-12-29", "2024-01-05", "2024-01-12"], "week"), [0, 0]);
  // One day of twenty is not a month.
  const daily = ["01", "02"].flatMap((month) => Array.from({ length: 20 }, (_, k) => `2024-${month}-${String(k + 1).padStart(2, "0")}`));
  assert.deepEqual(inPeriods([...daily, "2024-03-01"], Array(41).fill(0), [...ends, "2024-03-31"], "month"), [0, 0, null]);
});

test("with fewer than twelve months there is no figure a year", async () => {
  await visitQuiet(page, `${ballast.url}/#/sessions/${young}/track`);
  const words = await main();
  assert.match(words, /Figures a year need a whole year: 12 months\./);
  assert.doesNotMatch(words, /Return a year|Deviation a year|Sharpe|Sortino|Whole year|Year by year|undefined|NaN/);
  assert.deepEqual((await cells("What the session and its comparators earned"))[0], ["Held", "100 became", "Worst fall"]);
  assert.deepEqual((await cells("Returns of This session month by month"))[1], ["2024", ...growths.slice(0, 5).map((growth) => percent(growth - 1))]);
});

test("a session of several assets stands beside the benchmarks that the service keeps", async () => {
  const assets = ["Stocks", "Bonds"];
  const both = HISTORY.map((back, k) => [back, 0.003 + 0.01 * Math.cos(2.3 * k)]);
  const problem = { assets, horizon: 3, rate_per_step: RATE, periods_per_year: 12, history: both, radius: { rule: "bridge", alpha: 0.5, scale: 0.05 } };
  const policy = await trained(ballast.url, { problem, design: { count: 10 } });
  const { session } = await call(ballast.url, "/sessions", { policy, name: "Two" });
  for (let k = 0; k < 2; k++) await call(ballast.url, "/observe", { session, period: k + 1, log_returns: { Stocks: 0.02 - 0.05 * k, Bonds: -0.01 }, date: day(k), confirm: true });
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  await visitQuiet(page, `${ballast.url}/#/sessions/${session}/track`);
  const rows = await cells("What the session and its comparators earned");
  const { equal_weights, initial_composition, bank } = observations.at(-1).account.benchmarks;
  const start = 100;
  for (const [name, kept] of [["Equal weights", equal_weights], ["First composition", initial_composition], ["All in the bank", bank], ["This session", observations.at(-1).wealth]]) {
    assert.equal(rows.find(([held]) => held === name)?.[1], ((100 * kept) / start).toFixed(2), name);
  }
  await usable(page, () => {});
});
