// Another program is told of events from the page: a real receiver verifies the signature, and what is given up is shown.

import assert from "node:assert/strict";
import { createHmac } from "node:crypto";
import { createServer } from "node:http";
import { after, test } from "node:test";
import { call, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain, usable, visitQuiet } from "./page.js";

process.env.BALLAST_WEBHOOK_ALLOW = "127.0.0.1";
// A mail server that is not there: nothing is sent before a job ends.
Object.assign(process.env, { BALLAST_SMTP: "smtp://127.0.0.1:9", BALLAST_MAIL_FROM: "ballast@example.com" });
const { ballast, page } = await import("./scene.js");
const { EVENTS } = await dashboardModule("subscriptions.js");

const received = [];
const receiver = createServer((request, response) => {
  let body = "";
  request.on("data", (part) => (body += part));
  request.on("end", () => {
    received.push({ headers: request.headers, body });
    response.writeHead(204).end();
  });
});
await new Promise((resolve) => receiver.listen(0, "127.0.0.1", resolve));
const url = `http://127.0.0.1:${receiver.address().port}/hook`;
after(() => receiver.close());

const visit = () => visitQuiet(page, `${ballast.url}/#/subscriptions`);
const until = async (reached) => {
  while (!reached()) await new Promise((resolve) => setTimeout(resolve, 50));
};

test("every event of the interface has words", async () => {
  const description = await call(ballast.url, "/openapi.json");
  const { EventKind: events } = description.components.schemas;
  assert.deepEqual(Object.keys(EVENTS).sort(), (events.enum ?? events.oneOf.flatMap((one) => one.enum)).sort());
});

test("a program is subscribed from the page, and a fault stands at its field", async () => {
  await page.goto(`${ballast.url}/#/key`);
  await page.getByRole("link", { name: "Tell another program of events" }).click();
  await page.getByText("No program is told of anything yet.").waitFor();
  await page.getByLabel("Address").fill("https://10.0.0.1/hook");
  await page.getByRole("button", { name: "Subscribe" }).click();
  await page.locator(".error").getByText("public address", { exact: false }).waitFor();
  assert.equal(await page.getByLabel("Address").getAttribute("aria-invalid"), "true");
  await page.getByLabel("Address").fill(url);
  await page.getByLabel("A job ended").check();
  const asked = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/subscriptions"));
  await page.getByRole("button", { name: "Subscribe" }).click();
  assert.deepEqual((await asked).postDataJSON(), { url, events: Object.keys(EVENTS), least_change: 0.05 });
  await page.getByText("Keep this secret", { exact: false }).waitFor();
});

test("what is received is signed with the secret that was shown", async () => {
  const secret = await page.locator("form code").innerText();
  assert.match(secret, /^whsec_[A-Za-z0-9+/=]+$/);
  const problem = { horizon: 2, rate_per_step: 0.002, history: Array.from({ length: 24 }, (_, k) => 0.01 + 0.05 * Math.sin(1.7 * k)) };
  const policy = await trained(ballast.url, { problem, design: { count: 10 } });
  await until(() => received.length > 0);
  const [{ headers, body }] = received;
  const signed = createHmac("sha256", Buffer.from(secret.slice(6), "base64")).update(`${headers["webhook-id"]}.${headers["webhook-timestamp"]}.${body}`).digest("base64");
  assert.equal(headers["webhook-signature"], `v1,${signed}`);
  const { type, data } = JSON.parse(body);
  assert.deepEqual([type, data.state, data.policy], ["job_ended", "succeeded", policy]);
  await visit();
  const card = page.getByRole("region", { name: url });
  for (let words = ""; !words.includes("1 event accepted"); words = plain(await card.innerText())) await visit();
  assert.match(plain(await card.innerText()), /The advice of a session changed by more than 5 %/);
});

test("a secret is replaced, and the page serves everybody", async () => {
  const card = page.getByRole("region", { name: url });
  await card.getByRole("button", { name: "New secret" }).click();
  await card.getByText("For a day the secret before signs too.").waitFor();
  await usable(page, visit, ["#/subscriptions"]);
});

test("a person is told by e-mail, which has no secret", async () => {
  await visit();
  await page.getByLabel("Address").fill("mailto:one@example.com,two@example.com");
  await page.getByRole("button", { name: "Subscribe" }).click();
  await page.locator(".error").getByText("one address", { exact: false }).waitFor();
  await page.getByLabel("Address").fill("mailto:someone@example.com");
  await page.getByRole("button", { name: "Subscribe" }).click();
  const card = page.getByRole("region", { name: "mailto:someone@example.com" });
  await card.waitFor();
  assert.equal(await card.getByRole("button", { name: "New secret" }).count(), 0);
  assert.equal(await page.getByText("Keep this secret", { exact: false }).count(), 0);
  page.once("dialog", (dialog) => dialog.accept());
  await card.getByRole("button", { name: "Delete" }).click();
  await card.waitFor({ state: "detached" });
});

test("a subscription is deleted", async () => {
  await visit();
  page.once("dialog", (dialog) => dialog.accept());
  await page.getByRole("region", { name: url }).getByRole("button", { name: "Delete" }).click();
  await page.getByText("No program is told of anything yet.").waitFor();
  assert.deepEqual((await call(ballast.url, "/subscriptions")).subscriptions, []);
});
