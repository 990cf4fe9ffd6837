// A month for many clients at once: pasted by name, looked over, recorded, and what was refused kept for another try.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
const NAMES = ["Ada", "Grace Hopper", "Twin", "Twin", ""];

let ballast, chromium, page, sessions;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(20_000);
  const policy = await trained(ballast.url, { problem: { horizon: 3, rate_per_step: 0.002, history: HISTORY }, design: { count: 20 } });
  sessions = [];
  for (const name of NAMES) sessions.push((await call(ballast.url, "/sessions", { policy, name })).session);
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

const short = (id) => id.replace(/^[a-z]+_/, "").slice(0, 10);
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const rows = async (name) => (await page.getByRole("table", { name }).locator("tbody tr").allInnerTexts()).map((text) => plain(text).replace(/\s+/g, " "));
const lines = () => page.getByLabel("Sessions and their returns, %");
const observed = async (index) => (await call(ballast.url, `/sessions/${sessions[index]}/history`)).observations;

test("a line is a name and a number however they stand apart", async () => {
  const { readLine } = await dashboardModule("reporting.js");
  const known = [{ session: "session_00aa11bb22cc33", name: "Fund 60", state: "active" }, { session: "session_ffaa11bb22cc33", name: "Ada Lovelace", state: "active" }];
  const read = (line, common = null) => {
    const { entry, back, trouble } = readLine(line, known, common);
    return [entry?.name, back, trouble];
  };
  assert.deepEqual(read("ada lovelace 1.2"), ["Ada Lovelace", 0.012, null]);
  assert.deepEqual(read("Ada Lovelace\t1,2 %"), ["Ada Lovelace", 0.012, null]);
  assert.deepEqual(read("Ada Lovelace,-2.5"), ["Ada Lovelace", -0.025, null]);
  assert.deepEqual(read("Fund 60;\u22120.5"), ["Fund 60", -0.005, null]);
  // The number at its end is part of the name.
  assert.deepEqual(read("Fund 60"), ["Fund 60", null, "has no return"]);
  assert.deepEqual(read("Fund 60", 0.01), ["Fund 60", 0.01, null]);
  assert.deepEqual(read("ffaa11bb22 3"), ["Ada Lovelace", 0.03, null]);
  assert.deepEqual(read("Ada Lovelace much"), ["Ada Lovelace", null, "\u201cmuch\u201d is not a number of percent"]);
  assert.equal(read("Nobody 1")[2], "no session is called \u201cNobody\u201d");
});

test("who gets what is shown before, and what came of it after", async () => {
  await go("#/");
  await page.getByRole("link", { name: "Report for several" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  // Of a session that is named twice nothing is sent: nobody can know which is meant.
  await lines().fill("Ada 1.2\nAda 3");
  assert.deepEqual((await rows("Returns to report")).map((row) => /is named twice$/.test(row)), [true, true]);
  assert.equal(await page.getByRole("button", { name: "Report" }).isDisabled(), true);
  await lines().fill(`Ada\t1.2\nGrace Hopper 90\nTwin 1\nNobody 2\n${short(sessions[4])}`);
  await page.getByLabel("Return of the others, %").fill("-0,5");
  await page.getByLabel("Last day").fill("2026-10-31");
  const before = await rows("Returns to report");
  assert.match(before[0], /^Ada \w+ 1 1\.20 % yes$/);
  assert.match(before[2], /^Twin 1 – 1\.00 % 2 sessions are called so/);
  assert.match(before[3], /no session is called “Nobody”/);
  assert.match(before[4], new RegExp(`^${short(sessions[4])} 1 -0\\.50 % yes$`));
  await page.getByRole("button", { name: "Report for 3" }).click();
  await page.getByRole("heading", { name: "What came of it" }).waitFor();
  const told = await rows("Outcomes");
  assert.match(told[0], /^Ada \w+ 1\.20 % recorded as period 1$/);
  assert.match(told[1], /^Grace Hopper \w+ 90\.00 % A return of 90\.0 % lies [\d.]+ standard deviations from the record\.$/);
  await page.getByText("2 returns are recorded, and 3 left above for another try.").first().waitFor();
  assert.equal(await lines().inputValue(), "Grace Hopper 90\nTwin 1\nNobody 2");
  const [ada] = await observed(0);
  assert.deepEqual([ada.reported.simple_return, ada.date], [0.012, "2026-10-31"]);
  assert.equal((await observed(4))[0].reported.simple_return, -0.005);
  assert.equal((await observed(1)).length, 0);
});

test("an unusual return is recorded once it is said to be meant, and no other with it", async () => {
  // Another that is as unusual was not asked about yet.
  await lines().fill(`Grace Hopper 90\n${short(sessions[4])} 120`);
  await page.getByLabel("The returns are meant").check();
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("1 return is recorded, and 1 left above for another try.").first().waitFor();
  assert.equal((await observed(1))[0].reported.simple_return, 0.9);
  assert.equal((await observed(4)).length, 1);
  assert.equal(await lines().inputValue(), `${short(sessions[4])} 120`);
});

test("a return that cannot be is refused in percent", async () => {
  await page.getByLabel("Last day").fill("");
  await lines().fill("Ada 50000");
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 left above for another try", { exact: false }).first().waitFor();
  const [told] = await rows("Outcomes");
  assert.match(told, /The return is 50,000 %; it must be from -99\.32 % to 14,741\.31 %\.$/);
  await page.getByLabel("Last day").fill("2026-10-31");
  await lines().fill("Ada 1");
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("The last day is \u201c2026-10-31\u201d; it must be later than 2026-10-31, that of a period before.").waitFor();
  await page.getByLabel("Last day").fill("");
});

test("those ticked get one return, and an answer that is lost is asked for again without harm", async () => {
  await go("#/");
  for (const id of [sessions[2], sessions[3]]) await page.getByRole("row", { name: short(id) }).getByRole("checkbox").check();
  await page.getByRole("link", { name: "Report for the 2" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  await page.getByLabel("Return of the others, %").fill("1");
  let lost = 0;
  await page.route("**/observe", async (route) => {
    if (lost++ > 0) return route.continue();
    await route.fetch();
    await route.abort();
  });
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("Sending it again is safe: a period counts once.", { exact: false }).waitFor();
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("2 returns are recorded.").first().waitFor();
  await page.unrouteAll();
  for (const index of [2, 3]) assert.equal((await observed(index)).length, 1);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async () => {
    await go("#/report");
    await lines().fill("Ada 500\nNobody 2");
    await page.getByRole("button", { name: "Report for 1" }).click();
    await page.getByRole("heading", { name: "What came of it" }).waitFor();
  });
});
