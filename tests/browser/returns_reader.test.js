// What the reader of returns makes of texts, good and bad, and what it says of each.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { dashboardModule } from "./modules.js";

const { read } = await dashboardModule("returns_reader.js");

/** Sentences are compared with plain minus signs and spaces. */
const plain = (text) => text?.replaceAll("\u2212", "-").replaceAll("\u202f", " ");
const lines = (...rows) => rows.join("\n");
const MONTHS = Array.from({ length: 120 }, (_, k) => `${2010 + Math.floor(k / 12)}-${String((k % 12) + 1).padStart(2, "0")}`);
const CYCLE = [3.2, -1.4, 2.1, 0.4, -5, 1.1, 2.2, -3.3, 0.7, 1.9, -0.6, 2.5];
const RECORD = MONTHS.map((month, k) => `${month},${CYCLE[k % 12]}`);

/** Text, what it is, how its sentence begins, and its returns as simple ones in percent where they are few. */
const READINGS = [
  ["percent, as everyone pastes", "3.2 -1.4 2.1 0.4 -5", "5 simple returns in percent, without dates, taken oldest first. Mean -0.14 %, standard deviation 2.89 % a period.", [3.2, -1.4, 2.1, 0.4, -5]],
  ["fractions", "0.01, -0.02, 0.03", "3 simple returns as fractions, without dates, taken oldest first.", [1, -2, 3]],
  ["decimal commas between spaces", "3,2 -1,4 2,1", "3 simple returns in percent", [3.2, -1.4, 2.1]],
  ["decimal commas that start with zero", lines("0,032", "-0,014"), "2 simple returns as fractions", [3.2, -1.4]],
  ["decimal commas between semicolons", "3,2; -1,4; 2,1", "3 simple returns in percent", [3.2, -1.4, 2.1]],
  ["commas and spaces", "3.2, -1.4, 2.1", "3 simple returns in percent", [3.2, -1.4, 2.1]],
  ["percent signs", "0.2% -0.1 % 0.3 %", "3 simple returns in percent", [0.2, -0.1, 0.3]],
  ["any minus", "\u22121.4 2 \u20133.5", "3 simple returns in percent", [-1.4, 2, -3.5]],
  ["many months", RECORD.join("\n"), "120 simple returns in percent from column 2, monthly, January 2010 to December 2019, oldest first. Mean 0.32 %, standard deviation 2.38 % a month."],
  ["newest first", [...RECORD].reverse().join("\n"), "120 simple returns in percent from column 2, monthly, January 2010 to December 2019, given newest first and turned round by their dates."],
  ["rows in disorder", lines("date;ret", "2020-03;1,5", "2020-01;-2,5", "2020-02;0,5"), "3 simple returns in percent from ret, monthly, January 2020 to March 2020, sorted by their dates, which were not in order.", [-2.5, 0.5, 1.5]],
  ["dates of digits are no prices", lines("date,market", "20200101,0.01", "20200201,-0.02", "20200301,0.03"), "3 simple returns as fractions from market, monthly, January 2020 to March 2020, oldest first.", [1, -2, 3]],
  ["months of digits", lines("202001 1.5", "202002 -2", "202003 3"), "3 simple returns in percent from column 2, monthly, January 2020 to March 2020", [1.5, -2, 3]],
  ["prices newest first", lines("date,close", "2020-03-31,103", "2020-02-29,101", "2020-01-31,100"), "2 returns of 3 prices from close, monthly, February 2020 to March 2020, given newest first and turned round by their dates.", [1, 100 * (103 / 101 - 1)]],
  ["quoted thousands", lines("month,price", '2020-01,"1,234.50"', '2020-02,"1,240.00"', '2020-03,"1,200.10"'), "2 returns of 3 prices from price, monthly", [100 * (1240 / 1234.5 - 1), 100 * (1200.1 / 1240 - 1)]],
  ["thousands apart by points", lines("Datum;Kurs", "31.01.2020;1.234,50", "29.02.2020;1.240,00", "31.03.2020;1.200,10"), "2 returns of 3 prices from Kurs, monthly", [100 * (1240 / 1234.5 - 1), 100 * (1200.1 / 1240 - 1)]],
  ["log-returns by their heading", lines("month\tlog return", "2020-01\t0.01", "2020-02\t-0.02"), "2 log-returns as fractions from log return, monthly", [100 * Math.expm1(0.01), 100 * Math.expm1(-0.02)]],
  ["percent by the heading", lines("Year,Return (%)", "2019,12", "2020,5", "2021,9"), "3 simple returns in percent from Return (%), yearly, 2019 to 2021", [12, 5, 9]],
  ["days", lines("2020-01-02\t1.5", "2020-01-03\t-1", "2020-01-06\t0.5"), "3 simple returns in percent from column 2, daily, 2 January 2020 to 6 January 2020", [1.5, -1, 0.5]],
  ["days after the month", lines("13/01/2020,1.5", "14/01/2020,-1", "15/01/2020,0.5"), "3 simple returns in percent from column 2, daily, 13 January 2020 to 15 January 2020", [1.5, -1, 0.5]],
  ["American days", lines("1/13/2020,1.5", "1/14/2020,-1", "1/15/2020,0.5"), "3 simple returns in percent from column 2, daily, 13 January 2020 to 15 January 2020", [1.5, -1, 0.5]],
  ["months by name", lines('"Jan 1, 2020",1.2', '"Feb 1, 2020",-2'), "2 simple returns in percent from column 2, monthly, January 2020 to February 2020", [1.2, -2]],
  ["quarters", lines("2020 Q1;1.2", "2020 Q2;-2", "2020 Q3;4"), "3 simple returns in percent from column 2, quarterly, Q1 2020 to Q3 2020", [1.2, -2, 4]],
  ["rows that are numbered", lines("i,r", "0,0.01", "1,0.02", "2,-0.03"), "3 simple returns as fractions from r", [1, 2, -3]],
  ["a heading of nothing above the dates", lines(",0", "2020-01,0.01", "2020-02,-0.02"), "2 simple returns as fractions from 0, monthly", [1, -2]],
  ["blank ends are told", lines("d;r", "2020-01;", "2020-02;0,01", "2020-03;-0,02"), "2 simple returns as fractions from r, monthly, February 2020 to March 2020, oldest first. Mean -0.50 %, standard deviation 1.50 % a month. 1 blank cell before or after the numbers left out.", [1, -2]],
  ["missing months are told", lines("2020-01,0.01", "2020-02,-0.02", "2020-05,0.02"), "3 simple returns as fractions from column 2, monthly, January 2020 to May 2020, oldest first. Mean 0.33 %, standard deviation 1.70 % a month. 2 missing months lie between the rows, the first after February 2020.", [1, -2, 2]],
  ["remarks are told", lines("# from a provider", "0.01", "-0.02"), "2 simple returns as fractions, without dates, taken oldest first. Mean -0.50 %, standard deviation 1.50 % a period. 1 line of remarks passed over.", [1, -2]],
  ["a mark of the order of bytes", "\ufeffr\n0.01\n-0.02", "2 simple returns as fractions from r", [1, -2]],
  ["index levels", "102 103 101.5", "2 returns of 3 prices, without dates, taken oldest first.", [100 * (103 / 102 - 1), 100 * (101.5 / 103 - 1)]],
];

for (const [name, text, sentence, simple] of READINGS) {
  test(`reads ${name}`, () => {
    const answer = read(text);
    assert.equal(answer.outcome, "reading", answer.message);
    assert.ok(plain(answer.sentence).startsWith(sentence), `${plain(answer.sentence)}\nis not\n${sentence}`);
    for (const [index, value] of (simple ?? []).entries()) {
      assert.ok(Math.abs(100 * Math.expm1(answer.returns[index]) - value) < 1e-9, `return ${index} of ${answer.returns}`);
    }
    if (simple) assert.equal(answer.returns.length, simple.length);
  });
}

/** Text, what is asked, the answers, and how the sentence begins after each. */
const QUESTIONS = [
  ["whole numbers on both sides of a comma", lines("3,2", "-1,4", "2,1"), "comma", ["3 simple returns in percent", null]],
  ["thousands or decimals", lines("1,234", "1,240", "1,250"), "comma", [null, null]],
  ["fractions or percent", "0.2 -0.15 0.3 -0.1", "unit", ["4 simple returns as fractions", "4 simple returns in percent"]],
  ["prices or gains", "12.1 12.3 12.2", "kind", ["2 returns of 3 prices", "3 simple returns in percent"]],
  ["two columns of numbers", lines("date,a,b", "2020-01,0.01,0.02", "2020-02,-0.01,0.03"), "column", ["2 simple returns as fractions from a", null]],
  ["lines or columns", lines("0.1 0.2", "-0.3 0.1", "0.4 0.2"), "layout", [null, null]],
  ["day or month first", lines("01/02/2020,1.5", "01/03/2020,-2.5", "01/04/2020,3"), "dates", ["3 simple returns in percent from column 2, monthly, February 2020 to April 2020", "3 simple returns in percent from column 2, daily, 2 January 2020 to 4 January 2020"]],
  ["dates of two-digit years", lines("Date,r", "Jan-20,1.5", "Feb-20,-2.5", "Mar-20,3"), "order", ["3 simple returns in percent from r, without dates, taken oldest first", "3 simple returns in percent from r, without dates, taken newest first and turned round"]],
  ["too much deviation", "500 -60 90 -30", "confirmed", ["4 simple returns in percent", null]],
];

for (const [name, text, asks, sentences] of QUESTIONS) {
  test(`asks about ${name}`, () => {
    const asked = read(text);
    assert.equal(asked.outcome, "question", plain(asked.sentence));
    assert.equal(asked.asks, asks);
    assert.equal(asked.choices.length, sentences.length);
    for (const [index, { said }] of asked.choices.entries()) {
      const answer = read(text, said);
      if (sentences[index]) assert.ok(plain(answer.sentence)?.startsWith(sentences[index]), plain(answer.sentence) ?? answer.message);
      else assert.notEqual(answer.asks, asks, "an answer settles its question");
    }
  });
}

/** Text, line and column of the fault, and the words for it. */
const REFUSALS = [
  ["one bad cell of a table", lines("m,r", "2020-01,0.01", "2020-02,NA", "2020-03,0.02"), [3, 2], "Line 3, column 2: \u201cNA\u201d is not a number."],
  ["one bad word of a run", "3.2 abc 2", [1, 2], "Line 1, column 2: \u201cabc\u201d is not a number."],
  ["what a spreadsheet leaves for a missing number", lines("#N/A", "0.01", "-0.02"), [1, 1], "Line 1, column 1: \u201c#N/A\u201d is not a number."],
  ["a missing number at the top is no heading", lines("NA", "0.01", "-0.02"), [1, 1], "Line 1, column 1: \u201cNA\u201d is not a number."],
  ["one bad date", lines("2020-01,0.01", "2020-13,0.02", "2020-03,-0.02"), [2, 1], "Line 2, column 1: \u201c2020-13\u201d is not a date like the others."],
  ["a blank within", lines("d;r", "2020-01;0,01", "2020-02;", "2020-03;-0,02"), [3, 2], "Line 3, column 2 is blank: a record must not have holes."],
  ["two rows of one date", lines("2020-01,0.01", "2020-02,0.02", "2020-01,-0.02"), [3, 2], "Lines 1 and 3 have the same date, January 2020."],
  ["decimal commas between commas", lines("month,r", "2020-01,0,012", "2020-02,0,02"), [2, 1], "Line 2 has 3 cells, line 1 has 2."],
  ["mixed percent signs", "3.2 -1.4 2.1% 0.4", [1, 3], "Line 1, column 3: \u201c2.1%\u201d has a percent sign, unlike the cells before it."],
  ["mixed decimal marks", lines("0,5", "-0,3", "0.4"), [3, 1], "Line 3, column 1: \u201c0.4\u201d is not a number as the others are, with a decimal comma."],
  ["a quote left open", lines("date,r", '2020-01,"1'), [2, 2], "Line 2 opens a quote and does not close it."],
  ["dates alone", "20200101 20200201 20200301", [1, 1], "These are dates, without returns beside them."],
  ["numbers that do not vary", "1.5% 1.5% 1.5%", [1, 1], "The numbers do not vary"],
  ["a spreadsheet", "PK\u0003\u0004 and so on", null, "This is a spreadsheet file."],
  ["another encoding", "0\u0000.\u00000\u0000", null, "This is no text in UTF-8."],
  ["one number", "5", null, "One number is no record of returns"],
  ["a price of nothing", lines("date,price", "2020-01,10", "2020-02,0", "2020-03,11"), [3, 2], "Line 3, column 2: \u201c0\u201d is not above zero, as a price is.", { kind: "price" }],
  ["a loss of all", "3.2 -1.4 2.1", [1, 2], "Line 1, column 2: \u201c-1.4\u201d would be a loss of all and more.", { unit: "fraction" }],
];

for (const [name, text, place, message, said] of REFUSALS) {
  test(`refuses ${name}`, () => {
    const answer = read(text, said);
    assert.equal(answer.outcome, "refused", plain(answer.sentence ?? answer.message));
    assert.ok(answer.message.startsWith(message), answer.message);
    assert.deepEqual(answer.place && [answer.place.line, answer.place.column], place);
    if (place) assert.ok(text.startsWith(answer.place.text, answer.place.start), "its place in the text");
  });
}

test("a doubtful deviation is confirmed, or read otherwise", () => {
  const said = { unit: "fraction" };
  const asked = read("0.5 -0.4 0.9 -0.3", said);
  assert.equal(asked.asks, "confirmed");
  assert.match(plain(asked.message), /^Read as simple returns as fractions, the 4 numbers give a standard deviation of 54\.49 % a period\. Is that right\?$/);
  const [yes, no] = asked.choices.map((choice) => plain(read("0.5 -0.4 0.9 -0.3", { ...said, ...choice.said }).sentence));
  assert.match(yes, /^4 simple returns as fractions.*standard deviation 54\.49 %/);
  assert.match(no, /^4 simple returns in percent.*standard deviation 0\.54 %/);
});

test("the latest of the bundled returns are told to be so", async () => {
  const text = await readFile(new URL("../../data/us_market_monthly.csv", import.meta.url), "utf8");
  assert.equal(read(text).asks, "column");
  const { returns, sentence } = read(text, { column: 1, latest: 240 });
  assert.equal(returns.length, 240);
  assert.match(sentence, /^The latest 240 of 1109 simple returns as fractions from market_return, monthly, December 1998 to November 2018, oldest first\./);
});

test("nothing is nothing", () => assert.equal(read(" \n").outcome, "nothing"));
