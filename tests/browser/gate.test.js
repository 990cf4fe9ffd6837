// What is reported is asked about before it is recorded wrongly, and what was not recorded says so.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, chromium, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let policy;

before(async () => {
  policy = await trained(ballast.url, { problem: { horizon: 12, rate_per_step: 0.002, periods_per_year: 12, history: HISTORY }, design: { count: 12 } });
});

const open = async (name) => (await call(ballast.url, "/sessions", { policy, name })).session;
const report = (session, period, more) => call(ballast.url, "/observe", { session, period, ...more });
const observed = async (session) => (await call(ballast.url, `/sessions/${session}/history`)).observations;
const go = (hash, on = page) => visitQuiet(on, `${ballast.url}/${hash}`);
const main = async (on = page) => plain(await on.locator("main").innerText());

test("a skipped month is asked about, and reported as missing in one click", async () => {
  const session = await open("Quentin");
  await report(session, 1, { simple_return: 0.01, date: "2019-05-31" });
  await go(`#/sessions/${session}`);
  assert.equal(await page.getByLabel("Last day").first().inputValue(), "2019-06-30");
  await page.getByLabel("Return in June 2019, %").fill("2");
  await page.getByLabel("Last day").first().fill("2019-11-30");
  await page.getByRole("button", { name: "Report June 2019" }).click();
  await page.getByText("5 periods are missing before 30 Nov 2019: the first ends on 30 Jun 2019, the last on 31 Oct 2019.").waitFor();
  assert.equal((await observed(session)).length, 1);
  await page.getByRole("button", { name: "Report 5 periods as missing, then this one" }).click();
  await page.getByRole("heading", { name: "December 2019, period 8 of 12" }).waitFor();
  assert.match(await main(), /November 2019 is recorded\. Wealth [\d.,]+\./);
  const rows = await observed(session);
  assert.deepEqual(rows.map(({ log_return, date }) => [log_return === null, date.slice(0, 7)]), [[false, "2019-05"], ...["06", "07", "08", "09", "10"].map((month) => [true, `2019-${month}`]), [false, "2019-11"]]);
});

test("a report that somebody else was faster with stays on the page, beside what was typed, and is put right by a press", async () => {
  const session = await open("Ada");
  await report(session, 1, { simple_return: 0.01, date: "2019-05-31" });
  const other = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  await go(`#/sessions/${session}`, other);
  await report(session, 2, { simple_return: 0.017, date: "2019-06-30" });
  await other.getByLabel("Return in June 2019, %").fill("-5");
  await other.getByRole("button", { name: "Report June 2019" }).click();
  const alert = other.getByRole("alert").filter({ hasText: "Not recorded" });
  await alert.waitFor();
  assert.match(plain(await alert.innerText()), /^Not recorded: June 2019 was reported as 1\.70 % a moment ago\. You typed -5\.00 %\./);
  await alert.getByRole("button", { name: "Correct it" }).click();
  await other.getByText("The period is corrected.", { exact: false }).first().waitFor();
  const [, june] = await observed(session);
  assert.ok(Math.abs(june.now.log_return - Math.log(0.95)) < 1e-12);
  await other.close();
});

test("a period is put in by the form for corrections, and the last one is taken out", async () => {
  const session = await open("Ida");
  await report(session, 1, { simple_return: 0.01, date: "2019-05-31" });
  await report(session, 2, { simple_return: 0.02, date: "2019-07-31", confirm: true });
  await go(`#/sessions/${session}`);
  const fold = page.getByText("Correct a period");
  await fold.click();
  const form = page.locator("form", { has: page.getByLabel("What is wrong") });
  await form.getByLabel("What is wrong").selectOption("A period before it was skipped");
  await form.getByLabel("Why").fill("June was skipped");
  await form.getByRole("button", { name: "Correct it" }).click();
  await page.getByText(/June 2019 was inserted on .*: June was skipped/).waitFor();
  assert.deepEqual((await observed(session)).map(({ date }) => date), ["2019-05-31", "2019-06-30", "2019-07-31"]);
  page.once("dialog", (dialog) => dialog.accept());
  await page.getByRole("button", { name: "remove the period" }).click();
  await page.getByRole("heading", { name: "July 2019, period 3 of 12" }).waitFor();
  assert.equal((await observed(session)).length, 2);
});

test("a batch proposes the day, asks about what differs, fills gaps and says what is to be done", async () => {
  const names = ["Alma", "Bo", "Cleo", "Dina"];
  const sessions = [];
  for (const name of names) sessions.push(await open(name));
  for (const [index, session] of sessions.entries()) await report(session, 1, { simple_return: 0.01, date: index === 3 ? "2019-04-30" : "2019-05-31" });
  await go(`#/report?sessions=${sessions.join(",")}`);
  const day = page.getByLabel("Last day");
  assert.equal(await day.inputValue(), "2019-06-30");
  await page.getByLabel("Sessions and their returns, %").fill("Alma 2.13\nBo 2.13\nCleo 5\nDina 2.13");
  await page.getByRole("button", { name: "Report for 4" }).click();
  const outcomes = page.getByRole("table", { name: "Outcomes" });
  await outcomes.getByText(/3 of the 4 reports for this policy and day give 2\.13 %, but this one gives 5\.00 %/).waitFor();
  await outcomes.getByText("The period that ends on 31 May 2019 is missing before 30 Jun 2019.", { exact: false }).waitFor();
  await outcomes.getByText(/^(Buy|Sell) [\d.]+$|^Nothing$/).first().waitFor();
  await page.getByRole("button", { name: "Report the 1 missing period of 1 session as missing, then the rest" }).click();
  await page.getByText("1 return is recorded, and 1 left above to try again.").first().waitFor();
  assert.deepEqual((await observed(sessions[3])).map(({ log_return }) => log_return === null), [false, true, false]);
  // Neither a press nor a list without the others makes it pass.
  assert.equal(await page.getByRole("button", { name: "Report", exact: true }).isDisabled(), true);
  await page.getByLabel("It is right: Cleo").check();
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 return is recorded.").first().waitFor();
  assert.equal((await observed(sessions[2])).length, 2);
});

test("no day is filled in before it has come, but the day that is due is named", async () => {
  const [late, early] = [await open("Nora"), await open("Olga")];
  await report(late, 1, { simple_return: 0.01, date: "2019-05-31" });
  const now = new Date();
  await report(early, 1, { simple_return: 0.01, date: new Date(now - now.getTimezoneOffset() * 60_000).toISOString().slice(0, 10) });
  await go(`#/sessions/${late}`);
  assert.equal(await page.getByLabel("Last day").first().inputValue(), "2019-06-30");
  await go(`#/sessions/${early}`);
  const { next } = await call(ballast.url, `/sessions/${early}`);
  assert.equal(await page.getByLabel("Last day").first().inputValue(), "");
  await page.getByText(`Due on ${next}. May be blank.`).waitFor();
});

test("a session that was deleted in another tab leaves no advice on its page", async () => {
  const session = await open("Gone");
  await go(`#/sessions/${session}`);
  await page.getByLabel("Return in period 1, %").fill("1");
  await fetch(`${ballast.url}/sessions/${session}`, { method: "DELETE" });
  await page.getByRole("button", { name: "Report period 1" }).click();
  await page.getByRole("heading", { level: 1, name: "Session deleted" }).waitFor();
  assert.equal(await main(), "Session deleted\n\nThis session was deleted. See the sessions.");
  await page.getByRole("link", { name: "See the sessions" }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
});

test("the day proposed is the end of the last period", async () => {
  const { lastEnd } = await dashboardModule("periods.js");
  const ends = [[12, "2026-11-25", "2026-10-31"], [12, "2026-11-30", "2026-11-30"], [4, "2026-11-25", "2026-09-30"], [4, "2026-12-31", "2026-12-31"], [1, "2026-11-25", "2025-12-31"], [52, "2026-11-25", "2026-11-20"], [252, "2026-11-22", "2026-11-20"], [null, "2026-11-25", null]];
  for (const [periods, today, end] of ends) assert.equal(lastEnd(periods, today), end, `${periods} ${today}`);
});

test("axe finds nothing in what is asked", async () => {
  const session = await open("Eve");
  await report(session, 1, { simple_return: 0.01, date: "2019-05-31" });
  await usable(page, async () => {
    await go(`#/sessions/${session}`);
    await page.getByLabel("Return in June 2019, %").fill("50");
    await page.getByRole("button", { name: "Report June 2019" }).click();
    await page.getByText("Not recorded yet.").waitFor();
  });
});

test("a day with slashes is read where it can be read in one way", async () => {
  const { dayOf } = await dashboardModule("periods.js");
  const days = { "31/12/2026": "2026-12-31", "12/31/2026": "2026-12-31", "5/5/2026": "2026-05-05", "30.9.2008": "2008-09-30", "2008-9-3": "2008-09-03" };
  for (const [text, day] of Object.entries(days)) assert.equal(dayOf(text), day, text);
  for (const text of ["1/2/2026", "31/13/2026", "13/13/2026", "2/30/2026", "2026"]) assert.equal(dayOf(text), null, text);
});
