// Reports that stand in a file of their own: opened from the disk, drawn by the dashboard's modules, asking for nothing.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtemp, rm, symlink, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { promisify } from "node:util";
import { BINARY, LAB, browser } from "./ballast.js";
import { accessible, plain, usable } from "./page.js";

const run = promisify(execFile);
const back = (index) => 0.02 + 0.03 * Math.sin(1.7 * index);
const quarter = (index) => `${2000 + Math.floor(index / 4)}-${String(3 * (index % 4) + 3).padStart(2, "0")}`;
const rows = (fields) => Array.from({ length: 32 }, (_, index) => [quarter(index), ...fields(index)].join(",")).join("\n");

let folder, chromium, page;
const faults = [];

before(async () => {
  [folder, chromium] = await Promise.all([mkdtemp(join(tmpdir(), "ballast-report-")), browser()]);
  await writeFile(join(folder, "one.csv"), `date,return\n${rows((index) => [back(index)])}\n`);
  await writeFile(join(folder, "two.csv"), `date,energy,health\n${rows((index) => [back(index), back(index + 3) / 2])}\n`);
  const asked = ["--rate", "0.006", "--window", "24"];
  await run(BINARY, ["backtest", join(folder, "one.csv"), "--out", join(folder, "one"), "--count", "10", "--every", "2", "--horizon", "3", "--alpha", "0.5", ...asked]);
  await run(BINARY, ["backtest", join(folder, "two.csv"), "--out", join(folder, "two"), ...asked]);
  // One that is there already, of the same program, spares a minute.
  if (process.env.BALLAST_REPRODUCTION) await symlink(process.env.BALLAST_REPRODUCTION, join(folder, "paper"));
  else await run(LAB, ["reproduce", "--quick", "--out", join(folder, "paper")]);
  page = await (await chromium.newContext({ viewport: { width: 1280, height: 900 } })).newPage();
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("request", (request) => /^https?:/.test(request.url()) && faults.push(`asked for ${request.url()}`));
});

after(async () => {
  await chromium?.close();
  if (folder) await rm(folder, { recursive: true });
});

const open = async (file) => {
  await page.goto(pathToFileURL(join(folder, file)).href);
  await page.locator("main h1").waitFor();
};

test("a backtest tells what was read and how it was walked through, in its own periods", async () => {
  await open("one/report.html");
  assert.equal(await page.locator("h1").textContent(), "Backtest, 2006-03 to 2007-12");
  const words = plain(await page.locator("main").innerText());
  assert.match(words, /32 quarterly returns, 2000-03 to 2007-12/);
  assert.match(words, /Every 2 quarters policies are trained on the 24 quarters before, looking 3 quarters ahead/);
  assert.doesNotMatch(words, /month/);
});

test("a chart is walked by keyboard, has a table and is saved as a picture", async () => {
  const chart = page.locator("figure", { hasText: "Growth of 100" });
  const before = await chart.getByRole("slider").getAttribute("aria-valuetext");
  await chart.getByRole("slider").press("ArrowLeft");
  assert.notEqual(await chart.getByRole("slider").getAttribute("aria-valuetext"), before);
  await chart.getByText("As a table").click();
  await chart.getByRole("table").waitFor();
  assert.equal(await chart.getByRole("row").count(), 1 + 9);
  for (const kind of ["SVG", "PNG"]) {
    const [file] = await Promise.all([page.waitForEvent("download"), chart.getByRole("button", { name: kind }).click()]);
    assert.match(file.suggestedFilename(), new RegExp(`\\.${kind.toLowerCase()}$`));
  }
});

test("several assets are told by the same charts, and by what was held of each", async () => {
  await open("two/report.html");
  await page.locator("figure", { hasText: "Share held in all assets" }).waitFor();
});

test("the quick reproduction gives no verdict, and says so of every statement", async () => {
  await open("paper/reproduction.html");
  const [agrees, differs, undecided, small] = await Promise.all(["agrees", "differs", "undecided", "too_small"].map((name) => page.locator(`.verdicts.${name} li`).count()));
  assert.ok(agrees + differs + undecided === 0 && small > 5, `${agrees}, ${differs}, ${undecided} and ${small}`);
  await page.getByRole("heading", { name: `Too small a run to tell: ${small}` }).waitFor();
  const colours = await page.evaluate(() => [".verdicts.too_small li", "p.note", ".words p"].map((selector) => getComputedStyle(document.querySelector(selector)).color));
  assert.ok(colours[0] === colours[1] && colours[0] !== colours[2], `${colours}`);
  assert.doesNotMatch((await page.locator(".verdicts").allInnerTexts()).join(" "), /[\s[(]-\d/);
  for (const name of ["Figure 1", /Table 1 and Figure 2/, /Table 2 and Figure 2/, /frontier/, "Static with a smaller radius", "Larger t0 and T", "A wrong first guess", /Convergence/]) await page.getByRole("heading", { name }).waitFor();
  // A band has its colour beside the line in the legend.
  const banded = page.locator("figure", { has: page.locator("path.band") });
  assert.equal(await banded.locator(".legend rect.band").count(), await banded.locator("path.band").count());
  await accessible(page, "reproduction");
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels", () => usable(page, open, ["one/report.html", "two/report.html", "paper/reproduction.html"]));

test("the pages and the console held no fault", () => assert.deepEqual(faults, []));
