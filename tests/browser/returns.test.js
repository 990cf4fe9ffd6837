// Returns on the page: what is pasted, dropped or typed is read as what it is, told, asked about or refused.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, call, service } from "./ballast.js";

let ballast, chromium, page;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(20_000);
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

const area = () => page.locator('textarea[name="problem.history"]');
const note = () => page.locator("#f-problem-history-note");

/** The form afresh, with a text in its field as if pasted. */
async function pasted(text) {
  await page.goto("about:blank");
  await page.goto(`${ballast.url}/#/train`);
  await area().fill(text);
}

async function chosen(name, text) {
  await page.goto("about:blank");
  await page.goto(`${ballast.url}/#/train`);
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

test("dates of digits are not prices", async () => {
  await chosen("market.csv", "date,market\n20200101,0.01\n20200201,-0.02\n20200301,0.03\n");
  await note()
    .getByText("3 simple returns as fractions from market, monthly, January 2020 to March 2020, oldest first.")
    .waitFor();
  close(await history(), [0.01, -0.02, 0.03].map(Math.log1p));
});

test("a file that is newest first is turned round by its dates, and says so", async () => {
  await chosen("prices.csv", "date,close\n2020-03-31,103\n2020-02-29,101\n2020-01-31,100\n");
  await note().getByText("given newest first and turned round by their dates").waitFor();
  close(await history(), [Math.log(101 / 100), Math.log(103 / 101)]);
});

test("what the numbers do not say is asked, and nothing is trained before the answer", async () => {
  await pasted("0.2 -0.15 0.3 -0.1");
  await note().getByText("Are the returns fractions or percent?").waitFor();
  assert.deepEqual(await history(), []);
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByText(/^To be answered first: Are the returns fractions or percent/).waitFor();
  assert.deepEqual((await call(ballast.url, "/jobs")).jobs, []);
  await page.getByRole("button", { name: /^Percent: 0\.2 is 0\.20/ }).click();
  await note().getByText("4 simple returns in percent").waitFor();
  close(
    await history(),
    [0.2, -0.15, 0.3, -0.1].map((value) => Math.log1p(value / 100)),
  );
});

test("two columns of numbers are asked about, and another answer reads the file anew", async () => {
  await chosen("two.csv", "month,fund,index\n2020-01,1.5,100\n2020-02,-2.5,99\n2020-03,3,101\n");
  await page.getByRole("button", { name: /^fund / }).click();
  await note().getByText("3 simple returns in percent from fund").waitFor();
  await page.getByLabel("Column").selectOption({ label: "index (100; 99; 101 \u2026)" });
  await note().getByText("2 returns of 3 prices from index").waitFor();
  close(await history(), [Math.log(99 / 100), Math.log(101 / 99)]);
});

test("a bad cell is named, and the numbers before it are no longer in force", async () => {
  await pasted("1.5 -2 3");
  await note().getByText("3 simple returns in percent").waitFor();
  await chosen("bad.csv", "month,fund\n2020-01,1.5\n2020-02,NA\n2020-03,3\n");
  await note().getByText("Line 3, column 2: \u201cNA\u201d is not a number.").waitFor();
  assert.deepEqual(await history(), []);
});

test("a deviation above 30 % a period is not taken without a word", async () => {
  await pasted("0.5 -0.4 0.9 -0.3");
  await page.getByRole("button", { name: /^Fractions/ }).click();
  await note()
    .getByText(/standard deviation of 54\.49.% a period\. Is that right\?/)
    .waitFor();
  assert.deepEqual(await history(), []);
  await page.getByRole("button", { name: "Yes, take them so" }).click();
  await note().getByText("4 simple returns as fractions").waitFor();
  assert.equal((await history()).length, 4);
});

test("the example says what it takes", async () => {
  await page.goto("about:blank");
  await page.goto(`${ballast.url}/#/train`);
  await page.getByRole("button", { name: /^Use the example/ }).click();
  await note()
    .getByText(
      /^The latest 240 of 1109 simple returns as fractions from market_return, monthly, December 1998 to November 2018/,
    )
    .waitFor();
  assert.equal((await history()).length, 240);
});

test("what is typed is judged at a pause, and by the time it is sent", async () => {
  await pasted("");
  await area().pressSequentially("1.5 -2 3 x");
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.locator(".error").getByText("Line 1, column 4: \u201cx\u201d is not a number.").waitFor();
});
