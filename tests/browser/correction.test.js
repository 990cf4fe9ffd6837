// A period put right on the page of its session: what was reported and told stays beside what stands.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, visit } from "./page.js";
import { ballast, page } from "./scene.js";

let session;

before(async () => {
  const policy = await trained(ballast.url, {
    problem: {
      horizon: 4,
      rate_per_step: 0.002,
      history: [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002],
      radius: { rule: "bridge", alpha: 0.5, scale: 0.05 },
    },
    design: { count: 10 },
  });
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  for (const [period, simple_return] of [[1, 0.01], [2, -0.03]])
    await call(ballast.url, "/observe", { session, period, simple_return, executed_allocation: 0.5, date: `2008-0${period}-28` });
});

const main = async () => plain(await page.locator("main").innerText());
const form = () => page.locator("form", { has: page.getByRole("button", { name: "Correct it" }) });

test("the last period comes first, and the fields are those of their own form", async () => {
  await visit(page, `${ballast.url}/#/sessions/${session}`);
  await page.getByText("Correct a period").click();
  const periods = form().getByLabel("Period").locator("option");
  await periods.first().waitFor({ state: "attached" });
  assert.deepEqual(await periods.allInnerTexts(), ["February 2008", "January 2008"]);
  await form().getByText("Return, %").click();
  assert.equal(await page.evaluate(() => document.activeElement.form.textContent.includes("Correct it")), true);
});

test("a correction says why, or is not sent", async () => {
  const { corrections } = await call(ballast.url, `/sessions/${session}`);
  for (const change of ["The report is wrong", "The period should be removed"]) {
    await form().getByLabel("What is wrong").selectOption(change);
    await form().getByRole("button", { name: "Correct it" }).click();
    await form().getByText("Say why.").waitFor();
    assert.equal(await form().getByLabel("Why").evaluate((field) => field === document.activeElement), true);
  }
  await form().getByLabel("What is wrong").selectOption("The report is wrong");
  assert.equal((await call(ballast.url, `/sessions/${session}`)).corrections, corrections);
  const { problemWords } = await dashboardModule("problem_words.js");
  assert.equal(problemWords({ value: "0 letters", rule: "must have 1 to 200 letters" }, "Why"), "Why is blank; it must have 1 to 200 letters.");
});

test("the link below the last report opens the form at the first press, by mouse and by keyboard", async () => {
  const link = page.getByRole("button", { name: "Correct it" }).first();
  for (const press of [() => link.click(), () => link.press("Enter")]) {
    await visit(page, `${ballast.url}/#/sessions/${session}`);
    await link.waitFor();
    await press();
    await form().getByLabel("Period").waitFor();
    assert.equal(await form().evaluate((form) => form.contains(document.activeElement)), true);
    const seen = await form().evaluate((form) => form.getBoundingClientRect().top);
    assert.ok(seen >= 0 && seen < 900, `the form begins at ${seen}`);
  }
});

test("a return most likely mistyped is asked about, and a right one stands beside the wrong one", async () => {
  await form().getByLabel("Return, %").fill("110");
  await form().getByLabel("Why").fill("the index was revised");
  await form().getByRole("button", { name: "Correct it" }).click();
  await form().getByText(/^A return of 110\.00 % lies [\d.]+ standard deviations from the record\.$/).waitFor();
  await form().getByRole("button", { name: "It is right: record it" }).waitFor();
  await form().getByLabel("Return, %").fill("-2");
  await form().getByText("I held another share").click();
  assert.equal(await form().getByLabel("Share held, %").inputValue(), "50");
  await form().getByRole("button", { name: "Correct it" }).click();
  await page.getByText(/February 2008 was corrected on .*: the index was revised/).waitFor();
  const row = plain(await page.getByRole("row", { name: /^February 2008/ }).innerText());
  assert.match(row, /-2\.00 %\s+-3\.00 %/);
  const { corrections, wealth } = await call(ballast.url, `/sessions/${session}`);
  assert.equal(corrections, 1);
  // Only the return was typed: the day of the period stays.
  assert.equal((await call(ballast.url, `/sessions/${session}/history`)).observations[1].now.reported.date, "2008-02-28");
  assert.ok((await main()).includes(wealth.toFixed(2)));
});

test("a period of which no return is known is reported as missing", async () => {
  await page.getByLabel("Given as").first().selectOption("missing");
  await page.getByText("No return; wealth").waitFor();
  assert.equal(await page.getByLabel("Last day").first().inputValue(), "2008-03-28");
  await page.getByLabel("Last day").first().fill("28.3.2008");
  await page.getByRole("button", { name: "Report March 2008" }).click();
  await page.getByRole("heading", { name: "April 2008, period 4 of 4" }).waitFor();
  assert.match(plain(await page.getByRole("row", { name: /^March 2008/ }).innerText()), /28 Mar 2008[^]*missing/);
});

test("what was put right is undone, and what was there before stands again", async () => {
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 1 was undone/).waitFor();
  const { observations, corrections } = await call(ballast.url, `/sessions/${session}/history`);
  assert.ok(Math.abs(observations[1].now.log_return - Math.log(0.97)) < 1e-12);
  assert.equal(observations[1].now.executed_allocation, 0.5);
  assert.equal(corrections.length, 2);
});

test("the last report is taken back, and what it was stays on record", async () => {
  const { session } = await call(ballast.url, "/sessions", { policy: (await call(ballast.url, "/policies")).policies[0].policy });
  await call(ballast.url, "/observe", { session, period: 1, simple_return: 0.05, date: "2008-01-31" });
  await visit(page, `${ballast.url}/#/sessions/${session}`);
  page.on("dialog", (dialog) => dialog.accept());
  await page.getByRole("button", { name: "take it back" }).click();
  await page.getByText("The report was taken back").waitFor();
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.deepEqual([observations[0].now.log_return ?? null, observations[0].now.reported.date], [null, "2008-01-31"]);
  assert.ok(Math.abs(observations[0].log_return - Math.log(1.05)) < 1e-12);
  await page.getByRole("button", { name: "Undo", exact: true }).click();
  await page.getByText(/: Correction 1 was undone/).waitFor();
  const now = (await call(ballast.url, `/sessions/${session}/history`)).observations[0].now;
  assert.ok(Math.abs(now.log_return - Math.log(1.05)) < 1e-12);
});
