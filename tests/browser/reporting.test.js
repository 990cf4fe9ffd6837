// A month for many clients at once: pasted by name, looked over, recorded, and what was refused kept for another try.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
const NAMES = ["Ada", "Grace Hopper", "Twin", "Twin", ""];

let sessions;

before(async () => {
  const policy = await trained(ballast.url, { problem: { horizon: 3, rate_per_step: 0.002, history: HISTORY }, design: { count: 10 } });
  sessions = [];
  for (const name of NAMES) sessions.push((await call(ballast.url, "/sessions", { policy, name })).session);
});

const short = (id) => id.replace(/^[a-z]+_/, "").slice(0, 10);
const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const rows = async (name) => (await page.getByRole("table", { name }).locator("tbody tr").allInnerTexts()).map((text) => plain(text).replace(/\s+/g, " "));
const lines = () => page.getByLabel("Sessions and their returns, %");
const observed = async (index) => (await call(ballast.url, `/sessions/${sessions[index]}/history`)).observations;

/** Presses the button for so many; the service records them, its answer is lost, and the same are sent again until the page says `words`. */
async function sendTwice(times, words) {
  let lost = 0;
  await page.route("**/observe", async (route) => {
    if (lost++ > 0) return route.continue();
    await route.fetch();
    await route.abort();
  });
  const button = page.getByRole("button", { name: `Report for ${times}` });
  await button.click();
  await page.getByText("Sending it again is safe: a period counts once.", { exact: false }).waitFor();
  await button.click();
  await page.getByText(words).first().waitFor();
  await page.unrouteAll();
}

/** What the module makes of a text: the sessions, what is said of each, and what is wrong. */
async function readBy(known, { assets = () => null, all = {}, lately = () => false } = {}) {
  const { finder, lineReader } = await dashboardModule("report_lines.js");
  return (text, terms = all) => lineReader(finder(known), { assetsOf: assets, lately }).read(text, terms);
}

test("a line is a name and a number however they stand apart", async () => {
  const known = [{ session: "session_00aa11bb22cc33", name: "Fund 60", state: "active" }, { session: "session_ffaa11bb22cc33", name: "Ada Lovelace", state: "active" }];
  const readAll = await readBy(known);
  const read = (line, common) => {
    const [{ entry, report, trouble }] = readAll(line, { simple_return: common }).rows;
    return [entry?.name, report.simple_return ?? null, trouble];
  };
  assert.deepEqual(read("ada lovelace 1.2"), ["Ada Lovelace", 0.012, null]);
  assert.deepEqual(read("Ada Lovelace\t1,2 %"), ["Ada Lovelace", 0.012, null]);
  assert.deepEqual(read("Ada Lovelace,-2.5"), ["Ada Lovelace", -0.025, null]);
  assert.deepEqual(read("Fund 60;\u22120.5"), ["Fund 60", -0.005, null]);
  // The number at its end is part of the name.
  assert.deepEqual(read("Fund 60"), ["Fund 60", null, "has no return"]);
  assert.deepEqual(read("Fund 60", 0.01), ["Fund 60", 0.01, null]);
  assert.deepEqual(read("ffaa11bb22 3"), ["Ada Lovelace", 0.03, null]);
  assert.deepEqual(read("Ada Lovelace much"), ["Ada Lovelace", null, "\u201cmuch\u201d is not a percentage"]);
  assert.equal(read("Nobody 1")[2], "no session is called \u201cNobody\u201d");
});

test("a line that two sessions or two numbers fit names both readings, and a decimal comma and a sign apart are one number", async () => {
  const known = ["Ada", "Ada 1", "Fund 60", "Sample 8: two reports are late"].map((name, index) => ({ session: `session_${index}${"0123456789".repeat(3)}`, name, state: "active" }));
  const readAll = await readBy(known);
  const read = (line) => {
    const [{ entry, report, trouble }] = readAll(line).rows;
    return [entry?.name ?? null, report.simple_return ?? null, trouble];
  };
  const either = (one, other) => [null, null, `may be ${one[0]} or ${other[0]}: write \u201c${one[1]}\u201d or \u201c${other[1]}\u201d`];
  const ada = (back, text) => [`${back}\u202f% for \u201cAda\u201d`, `Ada; ${text}`];
  const ada1 = (back, text) => [`${back}\u202f% for \u201cAda 1\u201d`, `Ada 1; ${text}`];
  assert.deepEqual(read("Ada 1,5 %"), either(ada("1.50", "1,5 %"), ada1("5.00", "5 %")));
  assert.deepEqual(read("Ada 1,87\u202f%"), either(ada("1.87", "1,87\u202f%"), ada1("87.00", "87\u202f%")));
  assert.deepEqual(read("Ada 1,87"), either(ada("1.87", "1,87"), ada1("87.00", "87")));
  assert.deepEqual(read("Ada 1,234"), either(["\u201c1,234\u201d for \u201cAda\u201d", "Ada; 1,234"], ada1("234.00", "234")));
  assert.deepEqual(read("Ada 1"), either(ada("1.00", "1"), ["no return for \u201cAda 1\u201d", "Ada 1;"]));
  assert.deepEqual(read("Ada 1 234,5"), either(ada("1234.50", "1 234,5"), ada1("234.50", "234,5")));
  // Nobody is called Fund, but who wrote 60,5 may have meant it.
  assert.match(read("Fund 60,5 %")[2], /^may be 60\.50\u202f% for \u201cFund\u201d or 5\.00\u202f% for \u201cFund 60\u201d: write /);
  for (const line of ["Ada; 1,5 %", "Ada\t1,5", "Ada; 1.5\u00a0%", "Ada 1.5 %", "Ada 1.5\u202f%"]) assert.deepEqual(read(line), ["Ada", 0.015, null], line);
  for (const line of ["Ada 1; 5 %", "Ada 1\t5", "Ada 1 5\u00a0%", "Ada 1 5,0 %", "Ada 1, 5 %"]) assert.deepEqual(read(line), ["Ada 1", 0.05, null], line);
  assert.deepEqual(read("Ada 1,07 %"), ["Ada", 0.0107, null]);
  for (const line of ["Ada 1;", "Ada 1\t"]) assert.deepEqual(read(line), ["Ada 1", null, "has no return"], line);
  for (const text of ["1,87 %", "1.87\u202f%", "1,87"]) assert.deepEqual(read(`Sample 8: two reports are late ${text}`), ["Sample 8: two reports are late", 0.0187, null], text);
  assert.equal(read("Nobody at all 1,87 %")[2], "no session is called \u201cNobody at all\u201d");
  // The lines that the page writes itself name their sessions for certain.
  const { finder, written } = await dashboardModule("report_lines.js");
  assert.deepEqual(known.map((entry) => written(finder(known), entry)), ["Ada", "Ada 1;", "Fund 60", "Sample 8: two reports are late"]);
});

test("the cells of a line without a header are read by what they are, or a header is asked for", async () => {
  const known = ["Ada", "Ada 1", "Smith; John"].map((name, index) => ({ session: `session_${index}${"0123456789".repeat(3)}`, name, state: "active" }));
  const readAll = await readBy(known);
  const read = (line, terms) => {
    const [{ entry, report, trouble }] = readAll(line, terms).rows;
    return [entry?.name ?? null, trouble ?? report];
  };
  const wanted = { simple_return: 0.0187, date: "2026-10-31" };
  for (const line of ["Ada 1;1,87;31.10.2026", "Ada 1\t2026-10-31\t1.87 %", "1,87;Ada 1;2026-10-31;", "Ada 1,1.87,2026-10-31"]) assert.deepEqual(read(line), ["Ada 1", wanted], line);
  assert.deepEqual(read('"Smith; John";1,87;31.10.2026'), ["Smith; John", wanted]);
  assert.deepEqual(read("Ada;2026-10-31", { simple_return: 0.0187 }), ["Ada", wanted]);
  assert.deepEqual(read("Ada 1;1,87;3/10/2026"), ["Ada 1", "\u201c3/10/2026\u201d may be 3 Oct 2026 or 10 Mar 2026: write 2026-10-03 or 2026-03-10"]);
  const header = (count) => `has ${count} cells: give a header above, such as \u201cclient;return;date\u201d, with the names client, return, held, rate, flow, wealth, date, period`;
  for (const line of ["Ada 1;1,87;60;2026-10-31", "Ada,1,87,2026-10-31"]) assert.deepEqual(read(line), [line.slice(0, line.search(/[,;]/)), header(4)], line);
  assert.deepEqual(read("Kunde;Rendite;Datum"), [null, header(3)]);
  assert.deepEqual(read("Nobody;1,87;2026-10-31"), [null, "no session is called \u201cNobody\u201d"]);
  assert.deepEqual(read("Ada;much"), ["Ada", "\u201cmuch\u201d is not a percentage"]);
});

test("a header puts the columns in any order, and a column that means nothing is named", async () => {
  const known = ["Ada", "Smith, John", "Trust"].map((name, index) => ({ session: `session_${index}${"0123456789".repeat(3)}`, name, policy: name, state: "active", period: 1 }));
  const read = await readBy(known, { assets: (policy) => (policy === "Trust" ? ["World", "Bonds A/B"] : null) });
  const one = read('Flow,Return %,"Last day",Client,Held\r\n-100,1.5,2026-10-31,"Smith, John",30\r\n\r\n,-2,,Ada,\r\n', { date: "2026-11-30" });
  assert.deepEqual(one.rows.map(({ line, entry, report, trouble }) => [line, entry.name, report, trouble]), [
    [2, "Smith, John", { flow: -100, simple_return: 0.015, date: "2026-10-31", executed_allocation: 0.3 }, null],
    [4, "Ada", { simple_return: -0.02, date: "2026-11-30" }, null],
  ]);
  assert.deepEqual([one.header, one.unread], ['Flow,Return %,"Last day",Client,Held', []]);
  const two = read("adviser;Bonds A/B;client;world;World held;Bonds A/B held;return\nEve;0,2;Trust;1,5;40;10;\nEve;;Ada;;;;1\nEve;;Ada;1;;;1");
  assert.deepEqual(two.rows[0].report, { simple_returns: { "Bonds A/B": 0.002, World: 0.015 }, executed_allocations: { World: 0.4, "Bonds A/B": 0.1 } });
  assert.deepEqual([two.rows[0].trouble, two.unread], [null, ["adviser"]]);
  const wrong = (text) => read(text).rows.map(({ trouble }) => trouble);
  assert.deepEqual(wrong("client;return;world\nAda;1;2\nTrust;;1"), ["has no asset called \u201cworld\u201d", "holds several assets: give a header, and a return in each of the columns \u201cWorld\u201d, \u201cBonds A/B\u201d"]);
  assert.deepEqual(wrong("client;return;date\nAda;much;\nSmith, John;1;3/10/2026"), ["\u201cmuch\u201d in the column \u201creturn\u201d is not a percentage", "\u201c3/10/2026\u201d in the column \u201cdate\u201d may be 3 Oct 2026 or 10 Mar 2026: write 2026-10-03 or 2026-03-10"]);
  const dates = read("client;return;date\nAda;1;31.01.2020\nSmith, John;1;1.2.2020").rows.map(({ report }) => report.date);
  assert.deepEqual(dates, ["2020-01-31", "2020-02-01"]);
  assert.deepEqual(wrong("client;return;date\nAda;1;31.02.2020"), ["\u201c31.02.2020\u201d in the column \u201cdate\u201d is not a date such as 2008-09-30"]);
  assert.deepEqual(wrong("client,return\nAda,1,2"), ["has 3 cells, but the header has 2"]);
  assert.deepEqual(wrong("client;world;bonds a/b;world held\nTrust;1;1;30"), ["gives the share held of some assets, but not of Bonds A/B"]);
  // Of two columns of one meaning the second is not read.
  assert.deepEqual(read("client,return,return\nAda,1,2").unread, ["return"]);
});

test("a column of fractions, and one a hundred times too large, are told by the records of the sessions", async () => {
  const { finder, lineReader, otherUnit } = await dashboardModule("report_lines.js");
  const known = ["Ada", "Eve", "Ida"].map((name, index) => ({ session: `session_${index}${"0123456789".repeat(3)}`, name, policy: "P", state: "active", period: 1, deviation: 0.045 }));
  const terms = { assetsOf: () => null, lately: () => false };
  const read = (text, unit) => lineReader(finder(known), { ...terms, unit }).read(text, {}).rows;
  const seems = (text) => otherUnit(read(text), ({ deviation }) => deviation);
  const table = (returns, head = "return") => `client;${head};held\n${["Ada", "Eve", "Ida"].map((name, index) => `${name};${returns[index]};0.6`).join("\n")}`;
  assert.equal(seems(table([0.012, -0.031, 0.008])), "fraction");
  assert.equal(seems("Ada 0.012\nEve -0.02"), "fraction");
  assert.equal(seems(table([1.2, -3.1, 0.8])), null);
  // One of a percent and more is enough for the others to be percent too.
  assert.equal(seems(table([0.01, 0.02, 1.1])), null);
  assert.equal(seems(table([120, -310, 80])), "hundredth");
  assert.equal(seems("Ada 120"), null);
  // Whoever writes percent means it.
  assert.equal(seems(table(["0.012 %", "-0.031 %", "0.008 %"])), null);
  assert.equal(seems(table([0.012, -0.031, 0.008], "return, %")), null);
  assert.equal(otherUnit(read(table([0.012, -0.031, 0.008])), () => undefined), null);
  const [ada] = read(table([0.012, -0.031, 0.008]), "fraction");
  assert.deepEqual(ada.report, { simple_return: 0.012, executed_allocation: 0.6 });
  assert.deepEqual(read("Ada 120", "hundredth")[0].report, { simple_return: 0.012 });
});

test("what is reported up to a day already, or was within the hour, is not reported again by mistake", async () => {
  const known = [{ session: "session_00aa11bb22cc33", name: "Ada", state: "active", period: 2, date: "2026-10-31", last_report_ms: 1 }];
  const read = await readBy(known, { lately: () => true });
  const trouble = (text) => read(text).rows[0].trouble;
  assert.equal(trouble("client,return,date\nAda,1,2026-10-31"), "is already reported up to 31 Oct 2026");
  assert.equal(trouble("client,return,date\nAda,1,2026-11-30"), null);
  assert.match(trouble("Ada 1"), /^was reported within the last hour/);
  // Whoever says the period cannot count it twice.
  assert.equal(trouble("client,return,period\nAda,1,1"), null);
});

test("a letter typed into five thousand lines has one line parsed, and the rows are those of a text read anew", async () => {
  const { finder, lineReader } = await dashboardModule("report_lines.js");
  const clients = Array.from({ length: 5000 }, (_, k) => ({ session: `session_${String(k).padStart(6, "0")}${"0".repeat(26)}`, name: `Client ${k + 1}`, policy: k % 9 === 0 ? "Trust" : "P", state: "active", period: 2 }));
  const [find, assets] = [finder(clients), new Map([["P", null]])];
  const circumstances = { assetsOf: (policy) => assets.get(policy), lately: ({ name }) => name === "Client 7" };
  let parsed = 0;
  const reader = lineReader((text) => ((parsed += 1), find(text)), circumstances);
  let [lines, terms] = [["client,return,date", ...clients.map(({ name }, k) => `${name},${k % 9 === 0 ? "" : (k % 60) / 10},`)], {}];
  const looked = () => {
    parsed = 0;
    const text = lines.join("\n");
    const read = reader.read(text, terms);
    assert.deepEqual(read, lineReader(find, circumstances).read(text, terms));
    return [parsed, read.rows.filter(({ trouble }) => trouble === null).length];
  };
  assert.deepEqual(looked(), [5000, 5000 - 556 - 1], "pasted");
  const act = (change, wanted, words) => {
    change();
    assert.deepEqual(looked(), wanted, words);
  };
  act(() => (lines[2501] = "Client 2501,4.45,"), [1, 4443], "a letter");
  act(() => (lines[2501] = "Client 2500,4.45,"), [1, 4441], "a client named twice");
  act(() => (lines[2501] = "Client 2501,4.45,"), [1, 4443], "and no more");
  act(() => lines.splice(3, 0, "", "Nobody,1,"), [1, 4443], "a line put in");
  act(() => lines.splice(4, 1), [0, 4443], "a line taken out");
  act(() => (terms = { date: "2026-11-30" }), [0, 4444], "a day for all");
  act(() => ((clients[1].date = "2026-11-30"), reader.forget()), [0, 4443], "a session that went on");
  act(() => (assets.set("Trust", ["World"]), reader.forget()), [556, 4443], "a policy that was read");
  act(() => (lines[0] = "client,world,date"), [5000, 0], "another header");
});

test("who gets what is shown before, and what came of it after", async () => {
  await go("#/");
  await page.getByRole("link", { name: "Report for several" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  // Of a session that is named twice nothing is sent: nobody can know which is meant.
  await lines().fill("Ada 1.2\nAda 3");
  await page.getByText("Line 2: is named twice").waitFor();
  assert.deepEqual((await rows("Returns to report")).map((row) => /is named twice /.test(row)), [true, true]);
  assert.equal(await page.getByRole("button", { name: "Report" }).isDisabled(), true);
  await lines().fill(`Ada\t1.2\nGrace Hopper 90\nTwin 1\nNobody 2\n${short(sessions[4])}`);
  await page.getByLabel("Return of lines without one, %").fill("-0,5");
  await page.getByLabel("Last day").fill("31.10.2020");
  const before = await rows("Returns to report");
  // Lines that cannot be sent stand first, with the reason below the name; who has no line is told.
  assert.match(before[0], /^Twin 1 Line 3: 2 sessions have this name: use the identifier – 1\.00 % to 2020-10-31$/);
  assert.match(before[1], /Line 4: no session is called “Nobody”/);
  assert.match(before[2], /^Ada \w+ 1 1\.20 % to 2020-10-31$/);
  assert.match(before[4], new RegExp(`^${short(sessions[4])} 1 -0\\.50 % to 2020-10-31$`));
  await page.getByText("2 active sessions have no line").click();
  // A list is built once it is unfolded, and stays so while the lines change.
  const left = page.locator("details[open] a");
  await left.nth(1).waitFor();
  assert.equal(await left.count(), 2);
  for (const [typed, shown] of [["-0,75", "\u22120.75 %"], ["-0,5", "\u22120.50 %"]]) {
    await page.getByLabel("Return of lines without one, %").fill(typed);
    await page.getByRole("table", { name: "Returns to report" }).getByText(shown).waitFor();
    await left.nth(1).waitFor();
  }
  await page.getByRole("button", { name: "Report for 3" }).click();
  await page.getByRole("heading", { name: "Results" }).waitFor();
  const told = await rows("Outcomes");
  assert.match(told[1], /^Ada \w+ 1\.20 % recorded as period 1 /);
  // What is to be done now stands beside each name.
  await page.getByRole("table", { name: "Outcomes" }).getByText(/^(Buy|Sell) [\d.]+$|^Nothing$/).first().waitFor();
  assert.match(told[0], /^Grace Hopper \w+ 90\.00 % Line 2: A return of 90\.00 % lies [\d.]+ standard deviations from the record\. – –$/);
  await page.getByText("2 returns are recorded, and 3 left above to try again.").first().waitFor();
  assert.equal(await lines().inputValue(), "Grace Hopper 90\nTwin 1\nNobody 2");
  const [ada] = await observed(0);
  assert.deepEqual([ada.reported.simple_return, ada.date], [0.012, "2020-10-31"]);
  assert.equal((await observed(4))[0].reported.simple_return, -0.005);
  assert.equal((await observed(1)).length, 0);
});

test("an unusual return is recorded once it is said to be meant, and no other with it", async () => {
  // As it is it is not sent again by a press alone.
  const reasons = page.getByRole("table", { name: "Returns to report" }).getByText(/Line [12]: A return of 90.00 % lies /);
  await reasons.waitFor();
  // Another that is as unusual was not asked about yet.
  await lines().fill(`client,return,date\nGrace Hopper,90,2020-10-31\n${short(sessions[4])},120,2020-11-30`);
  const right = (name) => page.getByLabel(`It is right: ${name}`);
  const ticked = right("Grace Hopper");
  await ticked.press("Space");
  await page.getByRole("button", { name: "Report for 2" }).waitFor();
  // The reasons stay, and so does the tick under the finger.
  assert.match(await reasons.innerText(), /standard deviations from the record\.$/);
  assert.equal(await ticked.evaluate((box) => box.checked && box === document.activeElement), true);
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("1 return is recorded, and 1 left above to try again.").first().waitFor();
  assert.equal((await observed(1))[0].reported.simple_return, 0.9);
  assert.equal((await observed(4)).length, 1);
  assert.equal(await lines().inputValue(), `client,return,date\n${short(sessions[4])},120,2020-11-30`);
});

test("of two doubted returns only the one ticked is confirmed, and a changed one is asked about anew", async () => {
  const { policy } = await call(ballast.url, `/sessions/${sessions[0]}`);
  const [one, other] = await Promise.all(["Zoe", "Yves"].map(async (name) => (await call(ballast.url, "/sessions", { policy, name })).session));
  const times = async () => Promise.all([one, other].map(async (session) => (await call(ballast.url, `/sessions/${session}/history`)).observations.length));
  await go("#/report");
  await lines().fill("client,return,date\nZoe,90,2020-10-31\nYves,1.2,2999-10-31");
  await page.getByRole("button", { name: "Report for 2" }).click();
  await page.getByText("0 returns are recorded, and 2 left above to try again.").first().waitFor();
  const waiting = page.getByRole("table", { name: "Returns to report" });
  await waiting.getByText(/The day 2999-10-31 is in the future/).waitFor();
  await page.getByLabel("It is right: Zoe").check();
  const sent = page.waitForRequest("**/observe");
  await page.getByRole("button", { name: "Report for 1" }).click();
  assert.deepEqual((await sent).postDataJSON().map(({ session, confirm }) => [session, confirm]), [[one, true]]);
  await page.getByText("1 return is recorded, and 1 left above to try again.").first().waitFor();
  assert.deepEqual(await times(), [1, 0]);
  await waiting.getByText(/The day 2999-10-31 is in the future/).waitFor();
  await page.getByLabel("It is right: Yves").check();
  await lines().fill("client,return,date\nYves,1.2,2998-10-31");
  await page.getByLabel("It is right: Yves").waitFor({ state: "detached" });
  await page.getByRole("button", { name: "Report for 1" }).click();
  await waiting.getByText(/The day 2998-10-31 is in the future/).waitFor();
  assert.deepEqual(await times(), [1, 0]);
});

test("nothing is sent before the lines are seen as they were read", async () => {
  const many = ["client,return,date", "Ada,1.2,2999-10-31", ...Array.from({ length: 40 }, (_, k) => `Nobody${k},1,`)].join("\n");
  const button = page.getByRole("button", { name: "Report for 1" });
  const inSight = (some) => some.evaluate((element) => element.getBoundingClientRect().top >= 0 && element.getBoundingClientRect().bottom <= innerHeight);
  const [before, first] = [page.viewportSize(), page.getByRole("table", { name: "Returns to report" }).locator("tbody tr").first()];
  for (const size of [{ width: 1280, height: 900 }, { width: 390, height: 844 }]) {
    await page.setViewportSize(size);
    await go("#/report");
    await lines().fill(many);
    await page.getByText("1 return is ready, and 40 lines are not.").waitFor();
    const both = () => Promise.all([inSight(first), inSight(button)]);
    // Wherever the page is scrolled to, the button comes with the first line or after it.
    const seen = [];
    for (let top = 0; top <= 1400; top += 100) {
      await page.evaluate((top) => scrollTo(0, top), top);
      seen.push((await both()).join());
    }
    assert.ok(seen.includes("true,true"), seen.join(" "));
    assert.ok(!seen.slice(0, seen.indexOf("true,true")).includes("false,true"), seen.join(" "));
    // A press of Enter in a field shows the lines first.
    await page.evaluate(() => scrollTo(0, 0));
    let sent = 0;
    const counted = (request) => (sent += Number(request.url().endsWith("/observe")));
    page.on("request", counted);
    await page.getByLabel("Last day").press("Enter");
    await page.waitForFunction(() => document.querySelector("form tbody tr").getBoundingClientRect().top < innerHeight / 2);
    assert.deepEqual([await both(), sent], [[true, true], 0]);
    page.off("request", counted);
  }
  await page.setViewportSize(before);
});

test("a session that was deleted meanwhile is said to be, and is not sent again", async () => {
  const { policy } = await call(ballast.url, `/sessions/${sessions[0]}`);
  const { session } = await call(ballast.url, "/sessions", { policy, name: "Gone" });
  await go("#/report");
  await lines().fill("Gone 1");
  await page.getByRole("button", { name: "Report for 1" }).waitFor();
  await fetch(`${ballast.url}/sessions/${session}`, { method: "DELETE" });
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("0 returns are recorded, and 1 left above to try again.").first().waitFor();
  assert.match((await rows("Outcomes"))[0], /Line 1: This session was deleted\./);
  assert.match((await rows("Returns to report"))[0], /Line 1: this session was deleted/);
  assert.equal(await page.getByRole("button", { name: "Report", exact: true }).isDisabled(), true);
});

test("a return that cannot be is refused in percent", async () => {
  await page.getByLabel("Last day").fill("");
  await lines().fill("Ada 50000");
  // What is typed is looked over a moment later.
  await page.getByRole("button", { name: "Report", exact: true, disabled: true }).waitFor();
  await page.getByLabel("the next period", { exact: false }).check();
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 left above to try again", { exact: false }).first().waitFor();
  await page.getByText("Line 1: The return is 50,000", { exact: false }).waitFor();
  const [told] = await rows("Outcomes");
  assert.match(told, /Line 1: The return is 50,000 %; it must be from -100 % to 14,741\.31 %\. – –$/);
  await page.getByLabel("Last day").fill("2020-10-31");
  await lines().fill("Ada 1");
  await page.getByText("Line 1: is already reported up to 31 Oct 2020").waitFor();
  await page.getByLabel("Last day").fill("");
  await page.getByText("Line 1: was reported within the last hour", { exact: false }).waitFor();
});

test("those ticked get one return, and an answer that is lost is asked for again without harm", async () => {
  await go("#/");
  for (const id of [sessions[2], sessions[3]]) await page.getByRole("row", { name: short(id) }).getByRole("checkbox").check();
  await page.getByRole("link", { name: "Report for the 2" }).click();
  await page.getByRole("heading", { level: 1, name: "Report for several" }).waitFor();
  await page.getByLabel("Return of lines without one, %").fill("1");
  await sendTwice(2, "2 returns are recorded.");
  for (const index of [2, 3]) assert.equal((await observed(index)).length, 1);
});

test("forty clients are reported by one file, a bad row is named by its line, and nothing is lost or counted twice", async () => {
  const { policy } = await call(ballast.url, `/sessions/${sessions[0]}`);
  const several = await trained(ballast.url, {
    problem: { assets: ["World", "Gold"], horizon: 3, rate_per_step: 0.001, history: HISTORY.map((value, k) => [value, HISTORY[HISTORY.length - 1 - k] / 2]) },
    design: { count: 10 },
  });
  const clients = [];
  for (let k = 0; k < 40; k++) clients.push((await call(ballast.url, "/sessions", { policy: k < 36 ? policy : several, name: `Client ${k + 1}`, wealth: 100 })).session);
  const back = (k) => (k - 20) / 10;
  const row = (k, name = `Client ${k + 1}`) => (k < 36 ? `${back(k)};;${name};;${k === 0 ? 50 : ""}` : `;${back(k)};${name};0,5;`);
  const csv = (names) => ["Return, %;World;Client;Gold;Money added", ...clients.map((_, k) => row(k, names(k)))].join("\r\n");
  await go("#/report");
  // One row of the file names nobody; it is chosen first, and dropped once it is mended.
  await page.locator("input[type=file]").setInputFiles({ name: "october.csv", mimeType: "text/csv", buffer: Buffer.from(csv((k) => (k === 16 ? "Cleint 17" : `Client ${k + 1}`))) });
  await page.getByText("39 returns are ready, and 1 line is not.").waitFor();
  await page.getByText("Line 18: no session is called \u201cCleint 17\u201d").waitFor();
  assert.match((await rows("Returns to report"))[0], /^.*Cleint 17.* Line 18: no session/);
  // The button is in view below the first of forty rows.
  await page.getByRole("heading", { name: "What will be reported" }).evaluate((heading) => heading.scrollIntoView());
  assert.equal(await page.getByRole("button", { name: "Report for 39" }).evaluate((button) => button.getBoundingClientRect().bottom <= innerHeight), true);
  assert.match((await rows("Returns to report"))[39], /^Client 40 \w+ 1 World 1\.90 % Gold 0\.50 % ?$/);
  await sendTwice(39, "39 returns are recorded, and 1 left above to try again.");
  assert.equal((await lines().inputValue()).split("\n").length, 2);
  // The whole file again, on a page that has forgotten the first: the one row that was bad is all that is ready.
  await go("#/report");
  await page.locator(".drop").dispatchEvent("drop", { dataTransfer: await page.evaluateHandle((text) => {
    const files = new DataTransfer();
    files.items.add(new File([text], "october.csv", { type: "text/csv" }));
    return files;
  }, csv((k) => `Client ${k + 1}`)) });
  await page.getByText("1 return is ready, and 39 lines are not.").waitFor();
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 return is recorded, and 39 left above to try again.").first().waitFor();
  for (const [k, session] of clients.entries()) {
    const { observations } = await call(ballast.url, `/sessions/${session}/history`);
    assert.equal(observations.length, 1, `client ${k + 1}`);
    const [{ reported }] = observations;
    if (k < 36) assert.ok(Math.abs(reported.simple_return - back(k) / 100) < 1e-15, `client ${k + 1}`);
    else assert.deepEqual(reported.simple_returns, { World: Number((back(k) / 100).toPrecision(12)), Gold: 0.005 });
    assert.equal(reported.flow ?? null, k === 0 ? 50 : null);
  }
});

test("returns that seem to be fractions are not recorded before it is said what they are", async () => {
  const { policy } = await call(ballast.url, `/sessions/${sessions[0]}`);
  const session = (await call(ballast.url, "/sessions", { policy, name: "Fractions" })).session;
  const recorded = async () => (await call(ballast.url, `/sessions/${session}/history`)).observations.map(({ reported }) => reported.simple_return);
  await go("#/report");
  await lines().fill("Fractions 0.012");
  await page.getByText("Are they fractions?", { exact: false }).waitFor();
  assert.equal(await page.getByRole("button", { name: "Report for 1" }).isDisabled(), true);
  await page.getByLabel("These returns are").selectOption("Fractions: 0.012 is 1.2 %");
  assert.match((await rows("Returns to report"))[0], /^Fractions \w+ 1 1\.20 %$/);
  await page.getByRole("button", { name: "Report for 1" }).click();
  await page.getByText("1 return is recorded.").first().waitFor();
  assert.deepEqual(await recorded(), [0.012]);
  await page.getByLabel("These returns are").waitFor({ state: "hidden" });
  // Now the session's own record tells; and a very calm month in percent is taken where that is said.
  await page.getByLabel("Last day").fill("2020-10-31");
  await lines().fill("Fractions 0.02");
  await page.getByText("Are they fractions?", { exact: false }).waitFor();
  await page.getByLabel("These returns are").selectOption("Percent: 1.2 is 1.2 %");
  await page.getByRole("button", { name: "Report for 1" }).click();
  // What came of the first return stands there until the second has come, so it is the record that is waited for.
  for (let k = 0; (await recorded()).length < 2 && k < 200; k += 1) await page.waitForTimeout(50);
  assert.deepEqual(await recorded(), [0.012, 0.0002]);
});

test("a column that is not understood is named, with those that are", async () => {
  await lines().fill("client,return,colour\nAda,1,red");
  await page.getByText(/^Nothing is read from the column “colour”\. Use the names client, return, held, rate, flow, wealth, date, period or the name of an asset/).waitFor();
});

test("of a long list the first hundred lines are drawn, those that cannot be sent before the others, and all where that is wanted", async () => {
  await go("#/report");
  const drawn = page.getByRole("table", { name: "Returns to report" }).locator("tbody tr");
  await lines().fill(["Ada 1.2", ...Array.from({ length: 499 }, (_, k) => `Nobody${k} 1`)].join("\n"));
  await page.getByLabel("the next period", { exact: false }).check();
  await page.getByRole("button", { name: "Report for 1" }).waitFor();
  assert.equal(await drawn.count(), 100);
  assert.match(await drawn.first().innerText(), /^Nobody0/);
  assert.match(await drawn.last().innerText(), /^Nobody99/);
  await page.getByRole("button", { name: "Show all 500" }).click();
  assert.equal(await drawn.count(), 500);
  assert.match(await drawn.last().innerText(), /^Ada/);
  // A letter in a line out of sight draws nothing, and the line is as it was typed once it is in sight.
  await lines().fill(["Ada 1.2", ...Array.from({ length: 499 }, (_, k) => `Nobody${k} 1`)].join("\n"));
  await page.getByRole("button", { name: "Show all 500" }).waitFor();
  const first = await drawn.first().elementHandle();
  await lines().evaluate((area) => area.setSelectionRange(7, 7));
  await page.keyboard.press("5");
  await page.waitForTimeout(400);
  assert.equal(await first.evaluate((row) => row.isConnected), true);
  await page.getByRole("button", { name: "Show all 500" }).click();
  assert.match(plain(await drawn.last().innerText()), /1\.25 %/);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, async () => {
    await go("#/report");
    await lines().fill("Ada 500\nNobody 2");
    await page.getByLabel("the next period", { exact: false }).check();
    await page.getByRole("button", { name: "Report for 1" }).click();
    await page.getByRole("heading", { name: "Results" }).waitFor();
  });
});
