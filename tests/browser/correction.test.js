// A period put right on the page of its session: what was reported and told stays beside what stands.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";

let ballast, chromium, page, session;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(20_000);
  const policy = await trained(ballast.url, {
    problem: {
      horizon: 4,
      rate_per_step: 0.002,
      history: [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002],
      radius: { rule: "bridge", alpha: 0.5, scale: 0.05 },
    },
    design: { count: 20 },
  });
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  for (const [period, simple_return] of [[1, 0.01], [2, -0.03]])
    await call(ballast.url, "/observe", { session, period, simple_return, executed_allocation: 0.5, date: `2008-0${period}-28` });
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

const plain = (text) => text.replaceAll("\u202f", " ").replaceAll("\u2212", "-");
const main = async () => plain(await page.locator("main").innerText());
const form = () => page.locator("form", { has: page.getByRole("button", { name: "Put it right" }) });

test("the last period comes first, and the fields are those of their own form", async () => {
  await page.goto(`${ballast.url}/#/sessions/${session}`);
  await page.getByText("Put a period right").click();
  assert.deepEqual(await form().getByLabel("Period").locator("option").allInnerTexts(), ["2, to 2008-02-28", "1, to 2008-01-28"]);
  await form().getByText("Return, %").click();
  assert.equal(await page.evaluate(() => document.activeElement.form.textContent.includes("Put it right")), true);
});

test("a return most likely mistyped is asked about, and a right one stands beside the wrong one", async () => {
  const questions = [];
  page.on("dialog", async (dialog) => {
    questions.push(dialog.message());
    await dialog.dismiss();
  });
  await form().getByLabel("Return, %").fill("110");
  await form().getByLabel("Why").fill("the index was revised");
  await form().getByRole("button", { name: "Put it right" }).click();
  await page.waitForFunction(() => !document.querySelector(".observe button[disabled]"));
  assert.match(questions.join(), /standard deviations from the record[^]*Is it meant\?/);
  await form().getByLabel("Return, %").fill("-2");
  await form().getByText("It went differently").click();
  await form().getByLabel("Share held, %").fill("50");
  await form().getByRole("button", { name: "Put it right" }).click();
  await page.getByText(/Period 2 was put right on .*: the index was revised/).waitFor();
  const row = plain(await page.getByRole("row", { name: /^2 / }).innerText());
  assert.match(row, /-2\.00 %\s+-3\.00 %/);
  const { corrections, wealth } = await call(ballast.url, `/sessions/${session}`);
  assert.equal(corrections, 1);
  assert.ok((await main()).includes(wealth.toFixed(2)));
});

test("a period of which no return is known is reported as missing", async () => {
  await page.getByLabel("Given as").first().selectOption("missing");
  await page.getByText("No return; wealth").waitFor();
  await page.getByRole("button", { name: "Report period 3" }).click();
  await page.getByRole("heading", { name: "Period 4 of 4" }).waitFor();
  assert.match(plain(await page.getByRole("row", { name: /^3 / }).innerText()), /missing/);
});
