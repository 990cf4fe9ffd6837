// A book of invented clients on an empty server: filled by one press, seen as real ones, and deleted again.

import assert from "node:assert/strict";
import { test } from "node:test";
import { call } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

page.setDefaultTimeout(90_000);
const { monthEnd } = await dashboardModule("sample_book.js");

/** Waits until the overview lists so many sessions. */
const rows = (many) => page.waitForFunction((many) => document.querySelectorAll("tbody th a").length === many, many);

test("the end of a month some months ago", () => {
  assert.deepEqual([["2026-11-30", 0], ["2026-11-30", 1], ["2026-03-31", 1], ["2028-03-31", 1], ["2026-01-31", 1], ["2026-01-31", 13]].map(([day, ago]) => monthEnd(day, ago)), ["2026-11-30", "2026-10-31", "2026-02-28", "2028-02-29", "2025-12-31", "2024-12-31"]);
});

test("an empty server is filled by one press, and shows what an adviser's morning has", async () => {
  await visitQuiet(page, `${ballast.url}/`);
  await page.getByRole("button", { name: "Explore a sample book" }).click();
  await rows(11);
  const { sessions, care } = await call(ballast.url, "/sessions?tag=sample&count=care");
  const of = (name) => sessions.find((row) => row.name.endsWith(name));
  assert.deepEqual(sessions.map(({ name, tags }) => [/^Sample \d+: /.test(name), tags.join()]), Array(11).fill([true, "sample"]));
  assert.deepEqual([of("new client").period, of("up to date").period, of("completed").state, of("in the last month").period], [1, 7, "completed", 12]);
  assert.ok(of("two reports are late").care.includes("overdue") && !of("up to date").care.includes("overdue"), JSON.stringify(care));
  assert.equal(of("a large trade").holding, 0);
  assert.ok(of("money came").wealth > 60_000);
  const { observations } = await call(ballast.url, `/sessions/${of("two markets").session}/history`);
  assert.deepEqual(observations.map(({ assets, date }) => [Object.keys(assets.log_returns).sort().join(), date]), ["2", "1", "0"].map((ago) => ["Market A,Market B", monthEnd(of("up to date").date, Number(ago))]));
  // Clients who report one month report one return, but for the slip, which the page finds.
  const seen = sessions.filter(({ date, policy, name }) => date === of("up to date").date && policy === of("up to date").policy && !name.includes("ten times"));
  assert.ok(seen.length >= 3 && new Set(seen.map(({ log_return }) => log_return.toFixed(9))).size === 1);
  await page.getByText("Clients tagged \u201csample\u201d are invented", { exact: false }).waitFor();
  await page.getByText("Sample 4: reported ten times the return reported", { exact: false }).waitFor();
  await usable(page, () => visitQuiet(page, `${ballast.url}/#/?tag=sample`));
});

test("a return unlike that of the others with the policy and the day is asked about before it is recorded", async () => {
  const { sessions } = await call(ballast.url, "/sessions?tag=sample");
  const due = sessions.find(({ name }) => name.endsWith("report is due"));
  const peers = sessions.filter(({ policy, date, session }) => policy === due.policy && date > due.date && session !== due.session);
  const { date } = peers[0];
  assert.ok(peers.length >= 2 && peers.every((one) => one.date === date && one.log_return === peers[0].log_return), JSON.stringify(peers));
  const period = async () => (await call(ballast.url, `/sessions/${due.session}`)).period;
  await visitQuiet(page, `${ballast.url}/#/report`);
  await page.getByLabel("Sessions and their returns, %").fill(`${due.name}; 0.5`);
  await page.getByLabel("Last day").fill(date);
  const send = page.getByRole("button", { name: "Report for 1" });
  await send.click();
  const theirs = `${(100 * Math.expm1(peers[0].log_return)).toFixed(2)} %`;
  const words = `${peers.length} of ${peers.length + 1} sessions with its policy reported ${theirs} for `;
  await page.getByText(words, { exact: false }).first().waitFor();
  assert.equal(await period(), due.period, "nothing is recorded");
  await page.getByLabel("It is right").check();
  await send.click();
  await page.locator("#status").getByText("1 return is recorded.").waitFor();
  assert.equal(await period(), due.period + 1);
});

test("it is not offered beside sessions", async () => {
  await visitQuiet(page, `${ballast.url}/#/`);
  await rows(11);
  assert.equal(await page.getByRole("button", { name: "Explore a sample book" }).count(), 0);
});

test("one press deletes the book after a question, and nothing that only has its tag", async () => {
  const { sessions } = await call(ballast.url, "/sessions");
  const { policy } = sessions.find(({ name }) => name === "Sample 1: new client");
  const { session: own } = await call(ballast.url, "/sessions", { policy, name: "Sample of mine", tags: ["sample"] });
  await visitQuiet(page, `${ballast.url}/#/`);
  const names = async () => (await call(ballast.url, "/sessions")).sessions.map(({ name }) => name);
  for (const [answer, left] of [["dismiss", 12], ["accept", 1]]) {
    const question = page.waitForEvent("dialog");
    const pressed = page.getByRole("button", { name: "Delete the sample book" }).click();
    const dialog = await question;
    assert.match(dialog.message(), /^Delete the 11 invented clients/);
    await dialog[answer]();
    await pressed;
    await rows(left);
    assert.equal((await names()).length, left, answer);
  }
  assert.deepEqual(await names(), ["Sample of mine"]);
  assert.deepEqual((await call(ballast.url, "/policies")).policies.map((entry) => entry.policy), [policy], "the policy that is in use stays");
  assert.equal(await page.getByRole("button", { name: "Delete the sample book" }).isVisible(), false);
  await fetch(`${ballast.url}/sessions/${own}`, { method: "DELETE" });
});

test("it is offered again once the server is empty, and refused if somebody opened a session meanwhile", async () => {
  await visitQuiet(page, `${ballast.url}/#/`);
  const offer = page.getByRole("button", { name: "Explore a sample book" });
  await offer.waitFor();
  const { policies: [{ policy }], ...rest } = await call(ballast.url, "/policies");
  await call(ballast.url, "/sessions", { policy, name: "Meanwhile" });
  await offer.click();
  await page.getByText("There are sessions now: the sample book is for an empty server.").waitFor();
  assert.deepEqual([(await call(ballast.url, "/sessions")).sessions.map(({ name }) => name), (await call(ballast.url, "/policies")).policies.length, rest.next], [["Meanwhile"], 1, null]);
});
