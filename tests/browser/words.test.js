// Numbers on axes, numbers typed by themselves, and refusals in the words of the form.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { dashboardModule } from "./modules.js";
import { plain } from "./page.js";

const { allocation, figures, minus, percentTick, tick } = await dashboardModule("format.js");
const { extent, grain, ticks } = await dashboardModule("chart.js");
const { summary } = await dashboardModule("jobs.js");
const { typed } = await dashboardModule("number_text.js");
const { SOURCES } = await dashboardModule("advice.js");
const { problemWords } = await dashboardModule("problem_words.js");
const { doubtWords } = await dashboardModule("doubts.js");
const { WARNED } = await dashboardModule("specification.js");

test("neighbours on an axis have different labels", () => {
  for (const [start, step] of [[0.000266, 2e-7], [0.00495, 0.00005], [2.66e-5, 1e-7], [1e7, 1e6], [0, 20]]) {
    const labels = Array.from({ length: 5 }, (_, k) => tick(start + k * step, step));
    assert.equal(new Set(labels).size, 5, labels.join(", "));
    assert.ok(labels.every((label) => label.length <= 12), labels.join(", "));
  }
});

test("nothing and everything are said alike in a column, however little they are off", () => {
  assert.deepEqual([0, -1e-17, 0.0004, 0.0006, 0.9994, 0.9996, 1, null].map((share) => plain(allocation(share))), ["0 %", "0 %", "0 %", "0.1 %", "99.9 %", "100 %", "100 %", "\u2013"]);
});

test("labels of an axis are told apart, and from 0, also where it has one", () => {
  const labelled = (format, places) => places.map((place) => plain(format(place, grain(places))));
  assert.deepEqual(labelled(percentTick, [0.0005]), ["0.05 %"]);
  assert.deepEqual(labelled(percentTick, [0.00015]), ["0.015 %"]);
  assert.deepEqual(labelled(percentTick, [-0.2]), ["-20 %"]);
  assert.deepEqual(labelled(percentTick, [1 / 3]), ["33.3 %"]);
  assert.deepEqual(labelled(percentTick, [0]), ["0 %"]);
  assert.deepEqual(labelled(percentTick, [0.005, 0.015, 0.03]), ["0.5 %", "1.5 %", "3.0 %"]);
  assert.deepEqual(labelled(percentTick, [0, 0.25, 0.5]), ["0 %", "25 %", "50 %"]);
  assert.deepEqual(labelled(tick, [0.02]), ["0.02"]);
  assert.deepEqual(labelled(tick, [100.25, 100.5]), ["100.25", "100.50"]);
  for (const [low, high] of [[0.0002659, 0.0002672], [0.00031, 0.00069], [0.00041, 0.00059], [-0.03, 0.01], [0.0001, 0.9]])
    for (const wanted of [1, 3, 6]) {
      const places = ticks(low, high, wanted);
      const labels = labelled(percentTick, places);
      assert.ok(places.length > 0, `${wanted} between ${low} and ${high}`);
      assert.equal(new Set(labels).size, places.length, labels.join(", "));
      labels.forEach((label, index) => assert.equal(Number(label.replace(" %", "")) === 0, places[index] === 0, `${label} for ${places[index]}`));
    }
});

test("numbers that differ by rounding alone are drawn as one, by labels of few digits", () => {
  const values = [102.426576795, 102.426576795 + 3e-11];
  const places = ticks(...extent(values), 3);
  const labels = places.map((place) => tick(place, grain(places)));
  assert.ok(labels.length >= 2 && labels.every((label) => label.length <= 6), labels.join(", "));
  assert.deepEqual(extent([0, 0]), [-0.5, 0.5]);
  const near = [0.0002659, 0.0002672];
  assert.ok(extent(near)[0] > 0.000265 && extent(near)[1] < 0.000268);
});

test("what is left of a job is told where it can be known", () => {
  const told = (kind, phase, seconds_left, steps_done) =>
    plain(summary({ kind, state: "running", progress: { phase, seconds_left, steps_done, steps_total: 73, step: 1, points_done: 30, points_total: 3000 } }));
  assert.equal(told("train", "solving", 74.2, 2), "Step 3, solving: 30 of 3000 situations, about 74 s left");
  assert.equal(told("train", "solving", 0.4, 2), "Step 3, solving: 30 of 3000 situations, under 1 s left");
  assert.equal(told("train", "solving", 74.2, 1), "Step 2, solving: 30 of 3000 situations");
  assert.equal(told("evaluate", "simulating", 0.4, 72), "Simulating: 30 of 3000 paths");
});

test("a number typed is one number or none", () => {
  const cases = [["100", 100], ["0,032", 0.032], ["3.2", 3.2], ["1,234.50", 1234.5], ["1.234,50", 1234.5], ["\u22125", -5], ["", null], ["100,000", "100,000"], ["ten", "ten"], ["5 %", "5 %"], ["012", "012"]];
  for (const [text, value] of cases) assert.equal(typed(text), value, text);
  assert.equal(typed("0.2 %", { shares: true }), 0.002);
  assert.equal(typed("0.07%", { shares: true }), 0.0007);
});

test("a name in a file is never a formula, and a number stays a number", async () => {
  const { csvRows, csvText } = await dashboardModule("csv.js");
  const names = ["=1+1", "+cmd", "-2,5", "@SUM(A1)", "\tx", "\rx", "A=1", "B \"C\"", "two\nlines"];
  const text = csvText([names, [-0.5, 1e-7, 1e21, 0, null]]);
  assert.equal(text, '\'=1+1,\'+cmd,"\'-2,5",\'@SUM(A1),\'\tx,"\'\rx",A=1,"B ""C""","two\nlines"\r\n-0.5,1e-7,1e+21,0,\r\n');
  // What is written is read again cell by cell, and the second row begins in the third line.
  const [head, numbers] = csvRows(text, ",");
  assert.deepEqual(head.cells, names.map((name) => (/^[=+@\t\r-]/.test(name) ? `'${name}` : name)));
  assert.deepEqual([numbers.line, numbers.cells.map(Number)], [3, [-0.5, 1e-7, 1e21, 0, 0]]);
});

test("every warning of the service has words here, and names the record it is about", async () => {
  const description = JSON.parse(await readFile(new URL("../../api/openapi.json", import.meta.url), "utf8"));
  const codes = description.components.schemas.WarningCode;
  assert.deepEqual(Object.keys(WARNED).sort(), (codes.enum ?? codes.oneOf.flatMap((one) => one.enum)).sort());
  assert.match(WARNED.record_in_percent({}, "problem.history"), /^The returns vary/);
  assert.match(WARNED.record_in_percent({}, "problem.centre.history"), /^The assumed returns vary/);
  assert.equal(WARNED.rate_high({ rate_per_step: [0.03, 0.04], periods_per_year: 12 }), "The bank pays more than banks usually do. Is that what it pays in one month, or in a year?");
});

test("a doubt is told in a sentence, with its asset where there are several, and its periods where they are missing", () => {
  const sentence = "a return of 90.00 % lies 24.8 standard deviations from the record";
  const one = (doubt) => doubtWords({ doubts: [doubt] })[0];
  assert.equal(one({ reason: "unusual_return", field: "simple_return", sentence }), "A return of 90.00 % lies 24.8 standard deviations from the record.");
  assert.equal(one({ reason: "unusual_return", field: "simple_returns.Bonds A/B", sentence }), "Bonds A/B: a return of 90.00 % lies 24.8 standard deviations from the record.");
  assert.equal(one({ reason: "unusual_return", field: "simple_return", sentence: "a return of -90.00 % is unusual" }), "A return of \u221290.00 % is unusual.");
  const gap = (missing) => one({ reason: "missing_periods", field: "date", value: "2026-11-30", sentence, missing });
  assert.equal(gap(["2026-10-31"]), "The period that ends on 31 Oct 2026 is missing before 30 Nov 2026.");
  assert.equal(gap(["2026-09-30", "2026-10-31"]), "2 periods are missing before 30 Nov 2026: the first ends on 30 Sep 2026, the last on 31 Oct 2026.");
});

test("a refusal names the field, the value and the rule in the unit of the field", () => {
  const cases = [
    [{ value: 0, rule: "must lie in [1, 520]" }, "Decisions", null, "Decisions is 0; it must be from 1 to 520."],
    [{ value: 0.5, rule: "must lie in (1, 100]; at 1 use the log utility" }, "Risk aversion", null, "Risk aversion is 0.5; it must be above 1 and at most 100; at 1 use the log utility."],
    [{ value: "100,000", rule: 'invalid type: string "100,000", expected f64' }, "Initial wealth", null, "Initial wealth is \u201c100,000\u201d; it must be a number without thousands separators."],
    [{ value: null, rule: "invalid type: null, expected f64" }, "Initial wealth", null, "Initial wealth is blank; it must be a number without thousands separators."],
    [{ value: 1.5, rule: "invalid type: floating point `1.5`, expected u64" }, "Seed", null, "Seed is 1.5; it must be a whole number, zero or more."],
    [{ value: 1, rule: "must lie in [0.001, 0.999]" }, "Confidence, %", "confidence", "Confidence is 0 %; it must be from 0.1 % to 99.9 %."],
    [{ value: 0.6, rule: "must lie in [-0.5, 0.5]" }, "Bank return per month, %", "percent", "Bank return per month is 60 %; it must be from -50 % to 50 %."],
    [{ value: 7, rule: "must lie in [-5, 5]" }, "Returns or prices, number 4,", null, "Returns or prices, number 4, is 7; it must be from -5 to 5."],
    [{ value: "x", rule: "unknown variant `x`, expected one of `log`, `power`" }, "Kind", null, "Kind is \u201cx\u201d; it must be one of log, power."],
    [{ value: -1000, rule: "must leave a wealth that lies in [0.000001, 1000000]" }, "Money added", null, "Money added is -1000; it must leave a wealth that lies from 0.000001 to 1,000,000."],
    [{ value: "31.01.2020", rule: "failed to parse four digit integer as year: invalid digit, expected 0-9 but got ." }, "Last day", null, "Last day is \u201c31.01.2020\u201d; it must be a date such as 2008-09-30."],
    [{ value: "3/10/2026", rule: "failed to parse four digit integer as year: invalid digit, expected 0-9 but got /" }, "Last day", null, "Last day is \u201c3/10/2026\u201d; it may be 3 Oct 2026 or 10 Mar 2026: write 2026-10-03 or 2026-03-10."],
    [{ value: true, rule: "a rolling session needs a policy that learns" }, "How it continues", null, "How it continues: a rolling session needs a policy that learns."],
    [{ value: [1], rule: "must hold problem.horizon = 12 numbers" }, "Money added", null, "Money added has the wrong form; it must hold 12 numbers."],
    [{ value: 40, rule: "must be at most horizon" }, "Window", null, "Window is 40; it must be at most the number of periods ahead."],
    [{ value: -1, rule: "must be a number in [-0.9932620530009145, 147.4131591025766]" }, "Return in period 2, %", "percent", "Return in period 2 is -100 %; it must be from -99.32 % to 14,741.31 %."],
  ];
  for (const [problem, label, unit, words] of cases) assert.equal(plain(problemWords(problem, label, unit)), words);
  const every = { value: 40, rule: "must be at most the horizon" };
  assert.equal(problemWords(every, "Train every", null, "Periods ahead"), "Train every is 40; it must be at most \u201cPeriods ahead\u201d.");
});

test("what rounding leaves of wealth in the bank is nothing", async () => {
  const { inMoneyByName } = await dashboardModule("several.js");
  const { inMoney } = await dashboardModule("advice.js");
  const action = { allocation: { A: 0.1, B: 0.9 }, holdings: { A: 0.1 + 2e-16, B: 0.9 }, trade: { A: 0, B: 0 }, total: 0.1 + 0.9 };
  const { bank } = inMoneyByName({ ...action, allocation: { A: 0.1, B: 0.9 + 3e-16 } }, ["A", "B"], { wealth: 123_456.78, cost: 0 });
  assert.deepEqual([bank.held, bank.now], [0, 0]);
  assert.equal(inMoney({ allocation: 1 + 3e-16, holding: 1, trade: 0 }, { wealth: 123_456.78, cost: 0, price: null }).bank, 0);
});

test("numbers of a column have the digits of each other, and a sentence has minus signs", () => {
  assert.deepEqual([0.0048, 0.00475, 1.5, 12.34, 0].map((value) => figures(value, 3)), ["0.00480", "0.00475", "1.50", "12.3", "0"]);
  assert.equal(minus("from -18.9 % on 2008-09-30, well-known (-2)"), "from \u221218.9 % on 2008-09-30, well-known (\u22122)");
});

test("every source of an advice has words", async () => {
  const description = JSON.parse(await readFile(new URL("../../api/openapi.json", import.meta.url), "utf8"));
  assert.deepEqual(Object.keys(SOURCES).sort(), [...description.components.schemas.AdviceSource.enum].sort());
});
