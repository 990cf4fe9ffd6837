// What policies and sessions are called: given where they are made, changed where they stand, and said wherever they are meant.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let policy, session;

before(async () => {
  policy = await trained(ballast.url, { problem: { horizon: 3, rate_per_step: 0.002, history: HISTORY }, design: { count: 10 } });
});

const go = (hash) => visitQuiet(page, `${ballast.url}/${hash}`);
const heading = (name) => page.getByRole("heading", { level: 1, name, exact: true }).waitFor();
const short = (id) => id.replace(/^[a-z]+_/, "").slice(0, 10);

test("a training is named, and so is what it gives", async () => {
  await go("#/train");
  await page.getByLabel("Returns or prices").fill(HISTORY.map((value) => 100 * value).join("\n"));
  await page.getByLabel("Periods a year").selectOption("none");
  await page.getByLabel("Bank return per period, %").fill("0.2");
  await page.getByLabel("Periods ahead").fill("1");
  await page.getByLabel("Name", { exact: true }).fill("World & bills");
  await page.getByLabel("Tags").fill("equity, monthly,");
  const sent = page.waitForRequest((request) => request.url().endsWith("/train"));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  const { name, tags, notes } = (await sent).postDataJSON();
  assert.deepEqual([name, tags, notes], ["World & bills", ["equity", "monthly"], undefined]);
});

test("a training is listed by the name of its policy, and says where that is gone", async () => {
  await go("#/jobs");
  await page.getByRole("heading", { level: 2, name: /^Training of World & bills$/ }).waitFor();
  await page.getByRole("heading", { level: 2, name: /^Training, \d+ \w+ \d{4}/ }).waitFor();
  const other = await trained(ballast.url, { problem: { horizon: 1, rate_per_step: 0.003, history: HISTORY }, design: { count: 10 }, name: "Short-lived" });
  await go("#/jobs");
  await page.getByRole("heading", { level: 2, name: /^Training of Short-lived$/ }).waitFor();
  await fetch(`${ballast.url}/policies/${other}`, { method: "DELETE" });
  await go("#/jobs");
  await page.getByText("Its policy was deleted.").waitFor();
  assert.equal(await page.getByRole("link", { name: "See the policy" }).count(), 2);
});

test("a policy is named in place, and a session by it is opened under a name", async () => {
  await go(`#/policies/${policy}`);
  await heading(`Policy ${short(policy)}`);
  await page.getByRole("button", { name: "Give it a name" }).click();
  await page.getByLabel("Name", { exact: true }).fill("x".repeat(101));
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.locator(".field .error").waitFor();
  await page.getByLabel("Name", { exact: true }).fill("Careful");
  await page.getByLabel("Notes").fill("Since March.\nAsk before May.");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await heading("Careful");
  assert.match(await page.title(), /^Careful/);
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Edit");
  const now = await call(ballast.url, `/policies/${policy}`);
  assert.deepEqual([now.name, now.notes, now.tags], ["Careful", "Since March.\nAsk before May.", []]);
  await page.getByRole("link", { name: "Open a session" }).click();
  await heading("Open a session");
  assert.match(await page.getByLabel("Policy", { exact: true }).locator("option:checked").innerText(), new RegExp(`^Careful \\(${short(policy)}\\)`));
  await page.getByLabel("Name", { exact: true }).fill("Ada");
  await page.getByText("Tags and notes").click();
  await page.getByLabel("Tags").fill("pension");
  await page.getByRole("button", { name: "Open", exact: true }).click();
  await heading("Ada");
  session = page.url().split("/").pop();
  const opened = await call(ballast.url, `/sessions/${session}`);
  assert.deepEqual([opened.name, opened.notes, opened.tags], ["Ada", "", ["pension"]]);
});

test("the name is said in the trail, the lists and beside another, with the identifier behind it", async () => {
  await go(`#/sessions/${session}`);
  assert.match(await page.locator(".trail").innerText(), /^Overview \u203a Careful,/);
  assert.match(await page.locator(".labels").innerText(), new RegExp(`Session ${short(session)}\\s+pension\\s+Edit`));
  for (const [hash, name, id] of [["#/", "Ada", session], ["#/policies", "Careful", policy]]) {
    await go(hash);
    const row = page.getByRole("row", { name });
    assert.equal(await row.getByRole("link", { name, exact: true }).count(), 1);
    const [seen, title] = [await row.innerText(), await row.getByRole("link", { name, exact: true }).getAttribute("title")];
    // In the overview it is seen only if two have one name.
    assert.ok(hash === "#/" ? title === short(id) && !seen.includes(short(id)) : seen.includes(short(id)), seen);
  }
  const twin = (await call(ballast.url, "/sessions", { policy, name: "Ada" })).session;
  await go("#/");
  const texts = await page.getByRole("row", { name: "Ada" }).allInnerTexts();
  assert.ok([session, twin].every((id) => texts.some((text) => text.includes(short(id)))), `${texts}`);
  await fetch(`${ballast.url}/sessions/${twin}`, { method: "DELETE" });
  const other = (await call(ballast.url, "/sessions", { policy })).session;
  await go(`#/compare?sessions=${session},${other}`);
  await page.getByRole("link", { name: "Ada", exact: true }).waitFor();
  await page.getByRole("link", { name: `Session ${short(other)}`, exact: true }).waitFor();
  assert.match(await page.getByRole("row", { name: /^Policy/ }).innerText(), /Careful\s+Careful/);
  await go(`#/train?from=${policy}`);
  await page.locator(".trail").getByRole("link", { name: "Careful" }).waitFor();
});

test("a name is taken away, and what was typed is left", async () => {
  await go(`#/sessions/${session}`);
  await page.getByRole("button", { name: "Edit" }).click();
  await page.getByLabel("Name", { exact: true }).fill("Nobody");
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: "Edit" }).click();
  assert.equal(await page.getByLabel("Name", { exact: true }).inputValue(), "Ada");
  await page.getByLabel("Name", { exact: true }).fill("");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await heading(`Session ${short(session)}`);
  const { name, tags } = await call(ballast.url, `/sessions/${session}`);
  assert.deepEqual([name, tags], ["", ["pension"]]);
});

test("what is changed goes out alone, and a tag with a comma stays whole", async () => {
  const labelled = (body) => fetch(`${ballast.url}/sessions/${session}`, { method: "PATCH", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
  await labelled({ name: "Ada", tags: ["Leeds, UK", 'the "old"', '"first'] });
  await go(`#/sessions/${session}`);
  await page.getByRole("button", { name: "Edit" }).click();
  assert.equal(await page.getByLabel("Tags").inputValue(), '"Leeds, UK", the "old", """first"');
  // Somebody else writes notes meanwhile.
  await labelled({ notes: "Reports by post." });
  await page.getByLabel("Tags").fill('"Leeds, UK", the "old", """first", monthly');
  const sent = page.waitForRequest((request) => request.method() === "PATCH");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  assert.deepEqual((await sent).postDataJSON(), { tags: ["Leeds, UK", 'the "old"', '"first', "monthly"] });
  await page.getByText("Reports by post.").waitFor();
  const { name, notes } = await call(ballast.url, `/sessions/${session}`);
  assert.deepEqual([name, notes], ["Ada", "Reports by post."]);
  const patches = [];
  page.on("request", (request) => request.method() === "PATCH" && patches.push(request.url()));
  await page.getByRole("button", { name: "Edit" }).click();
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByRole("button", { name: "Edit" }).waitFor();
  assert.deepEqual(patches, []);
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  const places = [`#/sessions/${session}`, `#/policies/${policy}`, "#/sessions/new", "#/train"];
  await usable(page, async (hash) => {
    await go(hash);
    if (hash.includes("_") || hash.includes("policies")) await page.locator(".labels button").click();
  }, places);
});
