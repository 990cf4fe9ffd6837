// The dashboard of a service that asks for keys: nothing without one, everything with it, its streams and files too.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, before, test } from "node:test";
import { browser, service } from "./ballast.js";
import { usable, visitQuiet } from "./page.js";

let ballast, chromium, page, key;
const faults = [];

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  key = await ballast.key("read", "operate", "train");
  page = await chromium.newPage();
  page.setDefaultTimeout(60_000);
  page.on("pageerror", (error) => faults.push(error.message));
  // The door closes within half a second.
  while ((await fetch(`${ballast.url}/jobs`)).status !== 401) await new Promise((resolve) => setTimeout(resolve, 50));
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

test("a key is asked for, and a wrong one is refused", async () => {
  await page.goto(ballast.url);
  await page.getByRole("heading", { level: 1, name: "A key is needed" }).waitFor();
  await page.getByLabel("Key", { exact: true }).fill("ballast_wrong");
  await page.getByRole("button", { name: "Use this key" }).click();
  await page.getByText("The key is not valid here").waitFor();
});

test("with the key the page works, and its streams and files show it too", async () => {
  await page.getByLabel("Key", { exact: true }).fill(key);
  await page.getByRole("button", { name: "Use this key" }).click();
  await page.getByText("Nothing has been trained here yet").waitFor();
  const authorization = { authorization: `Bearer ${key}`, "content-type": "application/json" };
  const history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
  const body = JSON.stringify({ problem: { horizon: 40, rate_per_step: 0.002, history }, design: { count: 10 } });
  const queued = await (await fetch(`${ballast.url}/train`, { method: "POST", headers: authorization, body })).json();
  const stream = page.waitForRequest((request) => request.url().endsWith(`/jobs/${queued.job}/events`));
  await page.reload();
  assert.equal((await (await stream).allHeaders()).authorization, `Bearer ${key}`);
  await page.getByRole("link", { name: "See the policy" }).waitFor();
  const { policies } = await (await fetch(`${ballast.url}/policies`, { headers: authorization })).json();
  await page.goto(`${ballast.url}/#/policies/${policies[0].policy}`);
  const saving = page.waitForEvent("download");
  await page.getByRole("link", { name: "Export" }).click();
  const saved = JSON.parse(await readFile(await (await saving).path(), "utf8"));
  assert.equal(saved.format, "ballast-policy-1");
});

test("the page says who the key is, and what it may do", async () => {
  await page.getByRole("link", { name: "Key", exact: true }).click();
  const words = page.getByText("You are the tenant default");
  await words.waitFor();
  const { key: name } = await (await fetch(`${ballast.url}/key`, { headers: { authorization: `Bearer ${key}` } })).json();
  assert.match(await words.innerText(), new RegExp(`with the key ${name.split("_")[1].slice(0, 10)} \\(read, operate and train\\)\\. You may see policies, sessions and jobs, open sessions and report their returns and train policies`));
  assert.doesNotMatch(await words.innerText(), /audit/);
  const reader = await ballast.key("read");
  await page.getByLabel("Key", { exact: true }).fill(reader);
  while ((await fetch(`${ballast.url}/key`, { headers: { authorization: `Bearer ${reader}` } })).status !== 200) await new Promise((resolve) => setTimeout(resolve, 50));
  await page.getByRole("button", { name: "Use this key" }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
  await usable(page, () => visitQuiet(page, `${ballast.url}/#/key`));
  await page.getByText("and not open sessions and report their returns, nor train policies and compare strategies").waitFor();
});

/** Signs in with a key of these roles, once it is in force. */
async function withKey(...roles) {
  const other = await ballast.key(...roles);
  while ((await fetch(`${ballast.url}/key`, { headers: { authorization: `Bearer ${other}` } })).status !== 200) await new Promise((resolve) => setTimeout(resolve, 50));
  await visitQuiet(page, `${ballast.url}/#/key`);
  await page.getByLabel("Key", { exact: true }).fill(other);
  await page.getByRole("button", { name: "Use this key" }).click();
  await page.getByRole("heading", { level: 1, name: "Overview" }).waitFor();
}

test("what a key may not do is not there to be pressed, and the page says why", async () => {
  const headers = { authorization: `Bearer ${key}`, "content-type": "application/json" };
  const { policies: [{ policy }] } = await (await fetch(`${ballast.url}/policies`, { headers })).json();
  const post = async (path, body) => (await fetch(ballast.url + path, { method: "POST", headers, body: JSON.stringify(body) })).json();
  const { session } = await post("/sessions", { policy });
  await post("/observe", { session, period: 1, simple_return: 0.01 });
  const reports = "The key in use may not open sessions or report their returns: it lacks the role operate.";
  const trains = "The key in use may not train policies or compare strategies: it lacks the role train.";
  /** What can be pressed and what is said at an address. */
  const at = async (hash) => {
    await visitQuiet(page, `${ballast.url}/${hash}`);
    const text = await page.locator("main").innerText();
    const pressed = await page.locator("main").locator("button, a.button, label.button").filter({ visible: true }).allInnerTexts();
    return { reports: text.includes(reports), trains: text.includes(trains), pressed: pressed.map((name) => name.trim()) };
  };
  const WRITES = /Delete|Report|Correct it|take it back|Open a session|Give it a name|Train|Import|Evaluate|How much caution|Backtest|Compare out of sample/;
  const pages = { "#/": [true, false], [`#/sessions/${session}`]: [true, true], [`#/policies/${policy}`]: [true, true], "#/policies": [false, true], "#/jobs": [false, true], "#/evaluations": [false, true], "#/key": [false, false] };
  // With all that it takes every page has something that a reader lacks, and says nothing.
  await withKey("read", "operate", "train");
  for (const [hash, [lacksOperate, lacksTrain]] of Object.entries(pages)) {
    const { reports, trains, pressed } = await at(hash);
    assert.deepEqual([reports, trains, pressed.some((name) => WRITES.test(name))], [false, false, lacksOperate || lacksTrain], `${hash}: ${pressed}`);
  }
  await withKey("read");
  for (const [hash, [lacksOperate, lacksTrain]] of Object.entries(pages)) {
    const { reports, trains, pressed } = await at(hash);
    assert.deepEqual([reports, trains, pressed.filter((name) => WRITES.test(name))], [lacksOperate, lacksTrain, []], hash);
  }
  for (const [hash, words] of [["#/train", trains], ["#/sessions/new", reports], ["#/report", reports], ["#/evaluations/new", trains], ["#/backtests/new", trains]]) {
    await visitQuiet(page, `${ballast.url}/${hash}`);
    await page.getByRole("heading", { level: 1, name: "Not allowed with this key" }).waitFor();
    await page.getByText(words).waitFor();
    assert.equal(await page.locator("main form").count(), 0);
  }
  await usable(page, (place) => visitQuiet(page, `${ballast.url}/${place}`), [`#/sessions/${session}`, "#/train"]);
  await withKey("read", "operate");
  const { pressed, trains: told } = await at(`#/sessions/${session}`);
  assert.ok(told && pressed.includes("Delete") && pressed.includes("Report period 2") && !pressed.some((name) => /caution/.test(name)), `${pressed}`);
});

test("a key that is given up is gone", async () => {
  await page.getByRole("link", { name: "Key", exact: true }).click();
  await page.getByRole("button", { name: "Forget the current key" }).click();
  await page.getByRole("heading", { level: 1, name: "A key is needed" }).waitFor();
  assert.equal(await page.evaluate(() => sessionStorage.length), 0);
  assert.deepEqual(faults, []);
});
