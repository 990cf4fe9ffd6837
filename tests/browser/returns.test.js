// Returns on the page: what is pasted, dropped or typed is read as what it is, told, asked about or refused.

import assert from "node:assert/strict";
import { test } from "node:test";
import { call } from "./ballast.js";
import { usable, visit } from "./page.js";
import { ballast, page } from "./scene.js";

const area = () => page.locator('textarea[name="problem.history"]');
const note = () => page.locator("#f-problem-history-note");

/** The form without what was typed in it before. */
async function afresh() {
  await visit(page, `${ballast.url}/#/nowhere`);
  await page.evaluate(() => sessionStorage.clear());
  await visit(page, `${ballast.url}/#/train`);
}

/** The form afresh, with a text in its field as if pasted. */
async function pasted(text) {
  await afresh();
  await area().fill(text);
}

async function chosen(name, text) {
  await afresh();
  await page.locator('input[type="file"]').setInputFiles({ name, mimeType: "text/csv", buffer: Buffer.from(text) });
}

/** The log-returns of the request as it will be sent. */
async function history() {
  const request = await page.locator("#json").inputValue();
  return JSON.parse(request).problem.history;
}

function close(found, expected) {
  assert.equal(found.length, expected.length, `${found}`);
  for (const [index, value] of found.entries())
    assert.ok(Math.abs(value - expected[index]) < 1e-11, `${found} is not ${expected}`);
}

test("pasted percent are percent", async () => {
  await pasted("3.2 -1.4 2.1 0.4 -5");
  await note().getByText("5 simple returns in percent").waitFor();
  close(
    await history(),
    [3.2, -1.4, 2.1, 0.4, -5].map((value) => Math.log1p(value / 100)),
  );
});

test("what is said and asked of negative numbers has minus signs", async () => {
  await pasted("-3.2 -1.4 2.1 0.4 -5");
  await note().getByText("Mean \u22121.42 %").waitFor();
  await pasted("-0.3 -0.2 -0.1 0.2");
  await note().getByText("What is \u22120.3?").waitFor();
  const asked = await page.locator(".asked").innerText();
  assert.match(asked, /Fractions: \u22120\.3 is \u221230\.00 %.* Mean \u221210\.00 %/);
  assert.doesNotMatch(asked, /-\d/);
});

test("dates beside returns are dates and no prices, however they are written", async () => {
  const returns = [0.012, -0.034, 0.021, -0.005];
  const expected = returns.map((value) => Math.log1p(value));
  for (const dates of [["2020-01", "2020-02", "2020-03", "2020-04"], ["20200131", "20200229", "20200331", "20200430"]]) {
    await pasted(`month,fund\n${dates.map((date, index) => `${date},${returns[index]}`).join("\n")}\n`);
    await note().getByText("4 monthly simple returns as fractions, January 2020 to April 2020").waitFor();
    close(await history(), expected);
  }
});

test("a file that is newest first is turned round, said and drawn", async () => {
  await chosen("prices.csv", "date,close\n2020-03-31,103\n2020-02-29,101\n2020-01-31,100\n");
  await note().getByText("The rows came newest first and are reversed.").waitFor();
  close(await history(), [Math.log(101 / 100), Math.log(103 / 101)]);
  await page.getByText("Returns read, 2020-02 to 2020-03").waitFor();
});

test("a file in UTF-16 is read", async () => {
  await afresh();
  const buffer = Buffer.from("\ufeffdate\tr\r\n2020-01\t0.01\r\n2020-02\t-0.02\r\n", "utf16le");
  await page.locator('input[type="file"]').setInputFiles({ name: "excel.txt", mimeType: "text/plain", buffer });
  await note().getByText("2 monthly simple returns as fractions, January 2020 to February 2020").waitFor();
});

test("a file as a spreadsheet in Europe saves it is read, and what stands above its table is named", async () => {
  await visit(page, `${ballast.url}/#/train`);
  const buffer = Buffer.from("Depot M\u00fcller\r\nDatum;Kurs\r\n28.01.2020;100,5\r\n28.02.2020;101,5\r\n28.03.2020;99,5\r\n", "latin1");
  await page.locator('input[type="file"]').setInputFiles({ name: "depot.csv", mimeType: "text/csv", buffer });
  await note().getByText("2 monthly returns of prices, February 2020 to March 2020, as in column Kurs.").waitFor();
  await note().getByText('Line 1 before the table is left out: "Depot M\u00fcller".').waitFor();
});

test("questions are answered by the keyboard alone, and nothing is trained before the answer", async () => {
  await pasted("01/02/2020,0.2\n01/03/2020,-0.15\n01/04/2020,0.3\n01/05/2020,-0.1");
  await note().getByText("Are the returns fractions or percent?").waitFor();
  assert.deepEqual(await history(), []);
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByText(/^Answer this first: Which day is 01\/02\/2020/).waitFor();
  assert.deepEqual((await call(ballast.url, "/jobs")).jobs, []);
  await page.getByRole("radio", { name: /^1 February 2020/ }).focus();
  await page.keyboard.press("Space");
  await page.keyboard.press("Tab");
  await page.keyboard.press("ArrowDown");
  assert.ok(await page.getByRole("radio", { name: /^Percent: 0\.2 is 0\.20 %/ }).isChecked());
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await note().getByText("4 monthly simple returns in percent, February 2020 to May 2020, as in column 2.").waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.id), "f-problem-history-note");
  close(
    await history(),
    [0.2, -0.15, 0.3, -0.1].map((value) => Math.log1p(value / 100)),
  );
});

test("two columns of numbers are asked about, and another answer reads the file anew", async () => {
  await chosen("two.csv", "month,fund,bonds\n2020-01,1.5,-0.4\n2020-02,-2.5,1.9\n2020-03,3,-1.2\n");
  await page.getByRole("checkbox", { name: /^fund / }).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await note().getByText("3 monthly simple returns in percent, January 2020 to March 2020, as in column fund.").waitFor();
  const column = (name) => page.getByRole("group", { name: "Columns" }).getByLabel(name).click();
  await column("bonds");
  await note().getByText("as in columns fund, bonds").waitFor();
  await column("fund");
  await note().getByText("3 monthly simple returns in percent, January 2020 to March 2020, as in column bonds.").waitFor();
  close(
    await history(),
    [-0.4, 1.9, -1.2].map((value) => Math.log1p(value / 100)),
  );
});

test("a bad cell is named and shown, and the numbers before it are no longer in force", async () => {
  await pasted("1.5 -2 3");
  await note().getByText("3 simple returns in percent").waitFor();
  await chosen("bad.csv", "month,fund\n2020-01,1.5\n2020-02,abc\n2020-03,3\n");
  await note().getByText('Line 3: fund is "abc": must be a number').waitFor();
  assert.deepEqual(await history(), []);
  await page.getByRole("button", { name: "Show the place" }).click();
  assert.equal(await area().evaluate(({ value, selectionStart, selectionEnd }) => value.slice(selectionStart, selectionEnd)), "abc");
});

test("what a file says of the bank is taken where that is wanted", async () => {
  await chosen("rates.csv", "month,fund,RF\n2020-01,1.5,0.2\n2020-02,-2,0.21\n2020-03,3,0.22\n");
  await page.getByRole("button", { name: /bank.s rate from RF: 0\.220.% a period/ }).click();
  assert.equal(await page.getByLabel(/^Bank return per/).inputValue(), "0.22");
  assert.equal(await page.getByLabel("Periods a year").inputValue(), "12");
});

test("a deviation above 30 % a period is not taken without a word", async () => {
  await pasted("500 -60 90 -30");
  await note().getByText("give a standard deviation of 258.26 % a period").waitFor();
  assert.deepEqual(await history(), []);
  await page.getByRole("radio", { name: /^Yes, that is right/ }).check();
  await page.getByRole("button", { name: "Read it this way" }).click();
  await note().getByText("4 simple returns in percent").waitFor();
  assert.equal((await history()).length, 4);
});

test("the example says what it takes", async () => {
  await afresh();
  await page.getByRole("button", { name: /^Use the example/ }).click();
  await note()
    .getByText(
      /^The latest 240 of 1109 monthly simple returns as fractions, December 1998 to November 2018, as in column market_return\./,
    )
    .waitFor();
  assert.equal((await history()).length, 240);
});

test("what is typed is judged at a pause, and by the time it is sent", async () => {
  await pasted("");
  await area().pressSequentially("1.5 -2 3 x");
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.locator(".error").getByText('Line 1: column 4 is "x": must be a number').waitFor();
});

test("what is asked, read and refused breaks no rule of accessibility", async () => {
  for (const text of ["0.2 -0.15 0.3 -0.1", "month,fund,rf\n2020-01,1,0.1\n2020-02,-2,0.1\n2020-03,3,0.1", "1 x"]) {
    await pasted(text);
    await page.locator(".note.telling, .note.wrong").first().waitFor();
    await usable(page, () => {}, [text]);
    await page.setViewportSize({ width: 1280, height: 900 });
  }
});

test("a long text is read once its field is left, and not at every pause", async () => {
  const rows = Array.from({ length: 4000 }, (_, k) => (1.5 * Math.sin(1.7 * k)).toFixed(9).padEnd(60));
  assert.ok(rows.join("\n").length > 200_000);
  await chosen("long.csv", rows.join("\n"));
  await note().getByText("4000 simple returns in percent").waitFor();
  const asked = [];
  page.on("request", (request) => request.url().endsWith("/returns") && asked.push(request.url()));
  await area().press("Control+End");
  await page.keyboard.type("\n0.5");
  await note().getByText("It is read once you leave the field.").waitFor();
  assert.deepEqual(await history(), []);
  await page.waitForTimeout(600);
  assert.deepEqual(asked, []);
  await page.keyboard.press("Tab");
  await note().getByText("4001 simple returns in percent").waitFor();
  assert.equal(asked.length, 1);
  await area().fill("1.5 -2 3");
  await note().getByText("3 simple returns in percent").waitFor();
});
