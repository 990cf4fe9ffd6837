// The form of a training: the calendar and the bank rate as people know them, what may be a mistake, and what is kept of it half filled.

import assert from "node:assert/strict";
import { test } from "node:test";
import { call, ended } from "./ballast.js";
import { accessible, plain, sentTraining, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const RETURNS = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002, 0.03, -0.02];
const DATED = RETURNS.map((value, k) => `2024-${String(k + 1).padStart(2, "0")}-28,${value}`).join("\n");

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const record = () => page.getByLabel("Returns or prices");
const yearly = () => page.getByLabel("Periods a year");
/** Few situations: what is asked for is not what takes long. */
const small = async () => {
  await page.getByText("For the quant", { exact: true }).click();
  await page.getByLabel("Design points").fill("20");
};
const train = () => page.getByRole("button", { name: "Train", exact: true });
const sent = () => sentTraining(page, ballast.url);

test("the dates of a record tell the periods a year, and without dates they are a choice that must be made", async () => {
  await go("#/train");
  await record().fill(DATED);
  await page.getByText(/^12 monthly/).first().waitFor();
  assert.equal(await yearly().inputValue(), "12");
  await page.getByLabel("Bank return per month, %").waitFor();
  await record().fill(RETURNS.join("\n"));
  await page.getByText(/^12 simple returns/).first().waitFor();
  assert.equal(await yearly().inputValue(), "");
  await page.getByLabel("Bank return per period, %").fill("0.2");
  await train().click();
  await page.getByText("The record has no dates that show it: choose how many periods make a year.").waitFor();
  assert.equal(await yearly().evaluate((control) => control === document.activeElement), true);
  await yearly().selectOption("52: weeks");
  assert.equal((await sent()).problem.periods_per_year, 52);
});

test("what the bank pays in a year is taken, by the unit chosen or typed", async () => {
  await go("#/train");
  await record().fill(DATED);
  await page.getByLabel("Months ahead").fill("2");
  await small();
  await page.getByLabel("Bank return per month, %").fill("2 % a year");
  assert.equal(await page.getByLabel("The bank return is").inputValue(), "year");
  assert.ok(Math.abs((await sent()).problem.rate_per_step - (1.02 ** (1 / 12) - 1)) < 1e-12);
  await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
});

test("what may be a mistake is asked before the form is left, and the form stays as it was", async () => {
  await go("#/train");
  await record().fill(DATED);
  await page.getByLabel("Months ahead").fill("2");
  const rate = page.getByLabel("Bank return per month, %");
  await small();
  await rate.fill("2");
  await train().click();
  const question = page.getByRole("group", { name: "Is this right?" });
  await question.getByText(/The bank pays 2\.00.% a month/).first().waitFor();
  assert.equal(await rate.inputValue(), "2");
  await question.getByRole("button", { name: "No, change it" }).click();
  await question.waitFor({ state: "detached" });
  const { jobs } = await call(ballast.url, "/jobs?limit=1");
  assert.ok(jobs[0].state === "cancelled" || jobs[0].cancel_requested || jobs[0].state === "succeeded", JSON.stringify(jobs[0]));
  assert.equal(await record().inputValue(), DATED);
  await train().click();
  await question.getByRole("button", { name: "Yes, continue" }).click();
  await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
});

test("a form half filled survives a reload, Back and the navigation, says so, and starts anew where that is wanted", async () => {
  await go("#/train");
  await record().fill(DATED);
  await page.getByText(/^12 monthly/).first().waitFor();
  await page.getByLabel("Months ahead").fill("7");
  await page.getByLabel("Name").fill("Half done");
  const stands = async () => {
    await page.getByText("This is what you typed here before.").waitFor();
    await page.getByText(/^12 monthly/).first().waitFor();
    assert.deepEqual([await record().inputValue(), await page.getByLabel("Months ahead").inputValue(), await page.getByLabel("Name").inputValue()], [DATED, "7", "Half done"]);
  };
  await page.reload();
  await stands();
  await page.getByRole("link", { name: "Policies", exact: true }).click();
  await page.getByRole("heading", { level: 1, name: "Policies" }).waitFor();
  await page.goBack();
  await stands();
  await usable(page, () => {});
  await page.getByRole("button", { name: "Start again" }).click();
  await page.getByText("This is what you typed here before.").waitFor({ state: "detached" });
  assert.equal(await record().inputValue(), "");
  await go("#/train");
  assert.equal(await page.getByText("This is what you typed here before.").count(), 0);
});

test("a key that expires is told so over the page, and what was typed is kept while another is pasted", async () => {
  await go("#/train");
  await record().fill(DATED);
  await page.getByLabel("Months ahead").fill("2");
  await small();
  await page.getByLabel("Bank return per month, %").fill("0.2");
  await page.evaluate(() => sessionStorage.setItem("ballast-key", "ballast_old"));
  const expired = { type: "/problems/unauthenticated", title: "A key is needed", status: 401, detail: "the key expired", field: "Authorization", value: "a key that expired at 2026-11-25T18:06:00Z", rule: "must be a key" };
  await page.route("**/train", (route) => route.fulfill({ status: 401, contentType: "application/problem+json", body: JSON.stringify(expired) }));
  await train().click();
  const dialog = page.getByRole("dialog", { name: "Another key is needed" });
  await dialog.getByText(/^Your key expired at 25 Nov 2026, \d\d:\d\d .*\. Paste a new one: what you typed is kept\.$/).waitFor();
  await accessible(page, "the dialog");
  await page.unrouteAll();
  await dialog.getByLabel("Key", { exact: true }).fill("ballast_new");
  await dialog.getByRole("button", { name: "Use this key" }).click();
  await dialog.waitFor({ state: "detached" });
  assert.deepEqual([await record().inputValue(), await page.getByLabel("Months ahead").inputValue()], [DATED, "2"]);
  const again = page.waitForRequest((request) => request.url().endsWith("/train"));
  await train().click();
  assert.equal((await (await again).allHeaders()).authorization, "Bearer ballast_new");
  await page.getByRole("heading", { level: 1, name: "Jobs" }).waitFor();
  await page.evaluate(() => sessionStorage.removeItem("ballast-key"));
});

test("one record has one mean and one deviation, of a month and of a year, from its reading to its policy", async () => {
  await go("#/train");
  await record().fill(DATED);
  const read = plain(await page.getByText(/^12 monthly/).first().innerText());
  const [, mean, deviation, ofYear, deviationOfYear] = /Mean ([\d.]+) % and deviation ([\d.]+) % a month, ([\d.]+) % and ([\d.]+) % a year/.exec(read);
  await page.getByLabel("Months ahead").fill("2");
  await small();
  await page.getByLabel("Bank return per month, %").fill("0.2");
  const answered = page.waitForResponse((response) => response.url().endsWith("/train"));
  await train().click();
  const { job } = await (await answered).json();
  const now = await ended(ballast.url, job);
  await go(`#/policies/${now.policy}`);
  const told = page.getByText(/^The record holds 12 returns/);
  await told.waitFor();
  const words = plain(await told.innerText());
  assert.ok(words.includes(`mean ${mean} %, standard deviation ${deviation} % a month. That is ${ofYear} % a year, compounded, with a deviation of ${deviationOfYear} %.`), `${words} for ${read}`);
});
