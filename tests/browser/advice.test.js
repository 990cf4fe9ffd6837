// A session's page gives one advice: what is read off the policy, or the step solved anew where the two are apart.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";

const HISTORY = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];

let ballast, chromium, page, session;

before(async () => {
  [ballast, chromium] = await Promise.all([service(), browser()]);
  page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(20_000);
  const radius = { rule: "bridge", alpha: 0.1, scale: 0.2 };
  const policy = await trained(ballast.url, {
    problem: { horizon: 4, rate_per_step: 0.002, utility: { kind: "exponential", risk_aversion: 0.01 }, history: HISTORY, radius },
    design: { count: 100 },
  });
  ({ session } = await call(ballast.url, "/sessions", { policy }));
  await call(ballast.url, "/observe", { session, period: 1, simple_return: 0.004 });
});

after(async () => {
  await chromium?.close();
  await ballast?.stop();
});

/** The page where the policy advises `read` and the step solved anew `anew`. */
async function shown(read, anew) {
  await page.unrouteAll({ behavior: "ignoreErrors" });
  await page.route("**/action?*", async (route) => {
    const response = await route.fetch();
    const answer = await response.json();
    const solved = route.request().url().includes("explain");
    Object.assign(answer, { allocation: solved ? anew : read, source: solved ? "resolved" : "policy_surrogate" });
    await route.fulfill({ response, json: answer });
  });
  await page.route("**/what-if", async (route) => {
    const response = await route.fetch();
    const answer = await response.json();
    for (const point of answer.points) if (Math.abs(point.radius_scale - 1) < 1e-9) point.allocation = anew;
    await route.fulfill({ response, json: answer });
  });
  await page.goto("about:blank");
  await page.goto(`${ballast.url}/#/sessions/${session}`);
  await page.getByRole("slider", { name: "Worth for certain by radius" }).waitFor();
  await page.getByRole("slider", { name: "Returns seen and the worst law" }).waitFor();
}

const plain = (text) => text.replaceAll("\u202f", " ");
const big = async () => plain(await page.locator(".big").innerText());
const main = async () => plain(await page.locator("main").innerText());
const atOne = async () =>
  plain(await page.getByRole("slider", { name: "Allocation by radius" }).getAttribute("aria-valuetext"));

test("a step solved anew that says the same is the check of the advice", async () => {
  await shown(0.336, 0.3352);
  assert.match(await big(), /Hold\s+33\.6 %/);
  assert.match(await main(), /Checked: the step solved anew is within 0\.1 points of it\./);
  assert.doesNotMatch(await main(), /33\.5 %/);
  assert.match(await atOne(), /× 1: +33\.6 %/);
});

test("a step solved anew that is apart takes the place of the advice, and of what is reported as held", async () => {
  await shown(0.336, 0.302);
  assert.match(await big(), /Hold\s+30\.2 %/);
  assert.match(await main(), /Solved anew: what was read off the policy, 33\.6 %, is 3\.4 points away from it\./);
  assert.match(await atOne(), /× 1: +30\.2 %/);
  await page.getByText("It went differently").click();
  await page.getByText("Blank: the 30.2\u202f% advised.").waitFor();
  const reported = page.waitForRequest((request) => request.url().endsWith("/observe"));
  await page.getByLabel("Return in period 2").fill("0,4");
  await page.getByRole("button", { name: "Report period 2" }).click();
  const { executed_allocation, simple_return } = (await reported).postDataJSON();
  assert.deepEqual([executed_allocation, simple_return], [0.302, 0.004]);
  await page.getByRole("heading", { name: "Period 3 of 4" }).waitFor();
});

test("an advice that nothing was changed in is the service's own", async () => {
  await page.unrouteAll({ behavior: "ignoreErrors" });
  await page.goto("about:blank");
  await page.goto(`${ballast.url}/#/sessions/${session}`);
  const { allocation } = await call(ballast.url, `/action?session=${session}`);
  await page.getByText(/Checked: the step solved anew|Solved anew: what was read|solved anew, because/).waitFor();
  const told = Number.parseFloat(/Hold\s+([\d.]+)/.exec(await big())[1]) / 100;
  const { allocation: anew } = await call(ballast.url, `/action?session=${session}&explain=worst_case`);
  assert.ok(
    Math.min(Math.abs(told - allocation), Math.abs(told - anew)) < 0.0006,
    `${told} is neither ${allocation} nor ${anew}`,
  );
});

test("a return that cannot be read is refused in its own words", async () => {
  const field = page.getByLabel("Return in period 3");
  await page.getByRole("button", { name: "Report period 3" }).click();
  await page.getByText("The return is blank.").waitFor();
  await field.fill("2,5 or so");
  await page.getByRole("button", { name: "Report period 3" }).click();
  await page.getByText("\u201c2,5 or so\u201d is not a number of percent.").waitFor();
  await field.fill("-100");
  await page.getByRole("button", { name: "Report period 3" }).click();
  await page
    .getByText(/^Return in period 3 is \u2212100.%; it must be from \u221299\.32.% to 14,741\.31.%\.$/)
    .waitFor();
});
