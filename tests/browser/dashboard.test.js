// A person's way through the dashboard: from an empty service to a session that has lived.
// The tests follow each other on one page, as that person would.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call } from "./ballast.js";
import { quiet, visit } from "./page.js";
import { ballast, page } from "./scene.js";

/** Nothing that is waited for takes longer, in milliseconds. */
const PATIENCE = 60_000;
const RETURNS = [1.31, -4.42, 2.1, 3.3, -1.2, 0.8, 4.5, -2.7, 1.6, 0.2, 2.4, -0.9];
const FILE = `month;market return\n${RETURNS.map((value, index) => `2020-${index + 1};${String(value).replace(".", ",")}`).join("\n")}\n`;

let policy, session, twin, evaluation;
const faults = [];

before(async () => {
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("dialog", (dialog) => dialog.accept());
  page.on(
    "request",
    (request) =>
      request.url().startsWith(ballast.url) ||
      request.url() === "about:blank" ||
      faults.push(`asked for ${request.url()}`),
  );
});

const heading = (text) => page.getByRole("heading", { level: 1, name: text });
const go = (hash) => visit(page, `${ballast.url}/${hash}`);

test("a first visit takes few requests and little to load", { skip: process.env.BALLAST_DASHBOARD && "files that are read from a folder are not joined" }, async () => {
  const answers = [];
  const heard = (response) => answers.push(response);
  page.on("response", heard);
  await go("");
  await page.getByText("Nothing has been trained here yet").waitFor();
  page.off("response", heard);
  const sizes = await Promise.all(answers.map(async (response) => (await response.request().sizes()).responseBodySize));
  assert.ok(answers.length <= 15, answers.map((response) => response.url()).join(" "));
  assert.ok(sizes.reduce((sum, size) => sum + size, 0) < 300_000, sizes.join(" "));
});

test("an empty service says what to do first", async () => {
  await go("");
  await page.getByText("Nothing has been trained here yet").waitFor();
  await page.getByRole("link", { name: "Train the first policy" }).click();
  await heading("Train a policy").waitFor();
  assert.equal(
    await page.evaluate(() => document.activeElement.textContent),
    "Train a policy",
    "focus goes to the new view",
  );
});

test("a refusal is told at the field it names", async () => {
  await page.getByLabel("Returns or prices").fill("0.01 -0.02 0.03");
  await page.getByLabel("Periods a year").selectOption("none");
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByText(/^Bank return per period is blank; it must be a number/).waitFor();
  await page.getByLabel("Bank return per period").fill("0,2 %");
  await page.getByLabel("Periods ahead").fill("0");
  await page.getByRole("button", { name: "Train", exact: true }).click();
  const field = page.getByLabel("Periods ahead");
  await page.getByText("Periods ahead is 0; it must be from 1 to 520.").waitFor();
  assert.equal(await field.getAttribute("aria-invalid"), "true");
  assert.ok(await field.evaluate((element) => element === document.activeElement), "focus goes to the field");
  await page.getByLabel("Returns or prices").fill("0.01 -0.02 nine");
  await field.fill("4");
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.locator(".error").getByText('Line 1: column 3 is "nine": must be a number').waitFor();
  await page.getByRole("button", { name: "Show the place" }).click();
  const selected = await page
    .getByLabel("Returns or prices")
    .evaluate((area) => area.value.slice(area.selectionStart, area.selectionEnd));
  assert.equal(selected, "nine");
});

test("a training from a file, watched to its end", async () => {
  await page
    .getByLabel("Choose a CSV file")
    .setInputFiles({ name: "returns.csv", mimeType: "text/csv", buffer: Buffer.from(FILE) });
  await page
    .getByText("12 monthly simple returns in percent, January 2020 to December 2020, as in column market return.")
    .waitFor();
  assert.equal(await page.getByLabel("They are").inputValue(), "simple");
  assert.equal(await page.getByLabel("In", { exact: true }).inputValue(), "percent");
  await page.getByLabel("Investor").selectOption("own");
  await page.getByLabel("Utility", { exact: true }).selectOption("exponential");
  await page.getByLabel("Relative risk aversion").fill("1");
  await page.getByLabel("Radius, times").fill("0.2");
  await page.getByLabel("Design points").fill("100");
  await page.getByText("Every field, as JSON").click();
  const request = JSON.parse(await page.getByLabel("Training request as JSON").inputValue());
  assert.equal(request.problem.radius.scale, 0.2);
  assert.deepEqual(request.problem.utility, { kind: "exponential", risk_aversion_relative: 1 });
  assert.ok(Math.abs(request.problem.history[1] - Math.log(1 - 0.0442)) < 1e-12);
  request.design.sampling_law = { kind: "student_t", location: 0.005, scale: 0.02, degrees_of_freedom: 5 };
  await page.getByLabel("Training request as JSON").fill(JSON.stringify(request));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await page.getByRole("progressbar").waitFor();
  await page
    .getByText(/\d of 4 steps done/)
    .first()
    .waitFor();
  await page.getByRole("link", { name: "See the policy" }).click();
  await heading(/^Policy [0-9a-f]/).waitFor();
  policy = decodeURIComponent(page.url().split("/").pop());
});

test("a policy is told in words, drawn, and read by keyboard", async () => {
  await page.getByText("It looks 4 months ahead for an investor with exponential utility").waitFor();
  const map = page.getByRole("application", { name: /Share held in stocks/ });
  await map.focus();
  const read = page.locator("figure output").first();
  const before = await read.textContent();
  await page.keyboard.press("ArrowUp");
  assert.notEqual(await read.textContent(), before);
  assert.match(before, /Wealth .* average return .*: hold \d+/);
  assert.equal(await page.getByRole("table", { name: "Diagnostics of every step" }).count(), 0);
  await page.getByText(/^Every step was solved with an error of (less than )?[\d.]+.% of its worth/).waitFor();
  await page.getByText("For the quant").click();
  await page.getByRole("table", { name: "Diagnostics of every step" }).waitFor();
});

test("a session is opened, observed, and the same after a reload", async () => {
  await page.getByRole("link", { name: "Open a session" }).click();
  await page.getByLabel("Wealth", { exact: true }).fill("-5");
  await page.getByRole("button", { name: "Open" }).click();
  await page.getByText(/^Wealth is \u22125; it must be/).waitFor();
  await page.getByLabel("Wealth", { exact: true }).fill("100");
  await page.getByRole("button", { name: "Open" }).click();
  await heading(/^Session [0-9a-f]/).waitFor();
  session = page.url().split("/").pop();
  await page.getByText("returns seen", { exact: false }).first().waitFor();
  await page.getByLabel(/Return in period 1/).fill("1.2");
  await page.getByText(/Wealth 100\.00 \u2192 /).waitFor();
  await page.getByRole("button", { name: "Report period 1" }).click();
  await page.getByRole("heading", { name: "Period 2 of 4" }).waitFor();
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.equal(observations.length, 1);
  assert.ok(Math.abs(observations[0].log_return - Math.log1p(0.012)) < 1e-15);
  const shown = async () => {
    await page.getByRole("slider", { name: "Returns seen and the worst market" }).waitFor();
    await page.getByRole("slider", { name: "Worth as much as a sure, by caution" }).waitFor();
    // The receipt of the report is told once.
    return (await page.locator("main").innerText()).replace(/.* is recorded\. Wealth .*\n+/, "").replace(/\n+/g, "\n");
  };
  const before = await shown();
  await page.reload();
  assert.equal(await shown(), before);
});

test("a report whose answer is lost is sent again and counts once", async () => {
  await page.route(
    "**/observe",
    async (route) => {
      await route.fetch();
      await route.abort();
    },
    { times: 1 },
  );
  await page.getByLabel(/Return in period 2/).fill("\u22122.5");
  await page.getByText("I held another share").click();
  await page.getByLabel("Share held, %").fill("50");
  await page.getByRole("button", { name: "Report period 2" }).click();
  await page.getByText("Sending it again is safe").waitFor();
  await page.getByRole("button", { name: "Send again" }).click();
  await page.getByRole("heading", { name: "Period 3 of 4" }).waitFor();
  const { observations } = await call(ballast.url, `/sessions/${session}/history`);
  assert.deepEqual(observations.map(({ executed_allocation }) => executed_allocation)[1], 0.5);
  assert.equal(observations.length, 2);
});

test("a long training is cancelled", async () => {
  await call(ballast.url, "/train", {
    problem: { horizon: 60, rate_per_step: 0.002, history: RETURNS.map((value) => value / 100) },
    design: { count: 3000 },
  });
  await go("#/jobs");
  await page.getByText(/^Step 1, solving: \d+ of 3000 situations/).waitFor();
  await page.getByText("0 of 60 steps done").waitFor();
  await page.getByRole("button", { name: /^Cancel/ }).click();
  await page.locator(".state.cancelled").waitFor();
});

test("what if is asked of a session", async (t) => {
  const { paths } = await call(ballast.url, "/openapi.json");
  await go(`#/sessions/${session}`);
  const curve = page.getByRole("slider", { name: /by caution/ });
  if (!("/what-if" in paths)) {
    assert.equal(await curve.count(), 0);
    return t.skip("this service has no /what-if");
  }
  await curve.first().waitFor();
  const sweep = { radius_scale: { from: 0, to: 2, points: 3 } };
  const { points } = await call(ballast.url, "/what-if", { session, sweep });
  for (const [key, { allocation }] of [
    ["Home", points[0]],
    ["End", points[2]],
  ]) {
    await curve.first().press(key);
    const told = await curve.first().getAttribute("aria-valuetext");
    assert.ok(
      Math.abs(Number.parseFloat(/: +([\d.]+)/.exec(told)[1]) - 100 * allocation) <= 0.05,
      `${told} for ${allocation}`,
    );
  }
});

test("a session lives to its end", async () => {
  twin = (await call(ballast.url, "/sessions", { policy })).session;
  await call(ballast.url, "/observe", { session: twin, period: 1, simple_return: 0.01 });
  await go(`#/sessions/${session}`);
  for (const period of [3, 4]) {
    await page.getByLabel(`Return in period ${period}`).fill("0.5");
    await page.getByRole("button", { name: `Report period ${period}` }).click();
    await page.getByText(`${period} periods observed of 4`).waitFor();
  }
  await page.getByRole("heading", { name: "Completed" }).waitFor();
  assert.equal((await call(ballast.url, `/sessions/${session}`)).state, "completed");
});

test("an evaluation is asked for and reported", async (t) => {
  const { paths } = await call(ballast.url, "/openapi.json");
  await go(`#/evaluations/new?policy=${policy}`);
  const entry = page.getByRole("link", { name: "Evaluations" });
  if (!("/evaluate" in paths)) {
    assert.equal(await entry.count(), 0);
    return t.skip("this service has no /evaluate");
  }
  await page.getByLabel("Futures per record").fill("200");
  await page.getByRole("button", { name: "Evaluate" }).click();
  await page.getByRole("table", { name: "How wealth ended, by what it is worth" }).waitFor();
  evaluation = page.url().split("/").pop();
});

test("every view fits, at 390 and 1600 pixels", async () => {
  for (const width of [390, 1600]) {
    await page.setViewportSize({ width, height: 900 });
    for (const hash of views()) {
      await go(hash);
      await settled();
      const beyond = await page.evaluate(
        () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
      );
      assert.equal(beyond, 0, `${hash} at ${width} pixels`);
    }
  }
});

test("a policy in use is not deleted, a session is", async () => {
  await go(`#/policies/${policy}`);
  await page.getByRole("button", { name: "Delete" }).click();
  await page.getByText("Sessions use this policy. Delete those first.", { exact: false }).first().waitFor();
  await page.getByRole("link", { name: "Show them" }).click();
  await page.locator(`main a[href="#/sessions/${session}"]`).first().waitFor();
  await go(`#/sessions/${session}`);
  await page.getByRole("button", { name: "Delete" }).click();
  await heading("Overview").waitFor();
  assert.equal(await page.locator(`a[href="#/sessions/${session}"]`).count(), 0);
});

test("the console held no error but the refusals that were asked for", () => {
  const refused = /^Failed to load resource: (the server responded with a status of (422|409)|net::ERR_FAILED)/;
  assert.deepEqual(
    faults.filter((fault) => !refused.test(fault)),
    [],
  );
});

function views() {
  const reports = evaluation ? ["#/evaluations", `#/evaluations/${evaluation}`] : [];
  const things = [`#/policies/${policy}`, `#/sessions/${session}`, `#/sessions/${twin}`];
  return [
    "#/jobs",
    "#/train",
    "#/policies",
    "#/sessions",
    "#/sessions/new",
    "#/evaluations/new",
    ...things,
    ...reports,
    "#/nowhere",
  ];
}

/** What is fetched after the view stands has arrived. */
async function settled() {
  await quiet(page);
}
