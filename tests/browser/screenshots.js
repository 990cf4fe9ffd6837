// Takes two pictures of the documentation, from the real binary on the bundled returns:
// a session in the first year of the crisis in light (README.md), its policy in dark (docs/choosing.md).
//   cd tests/browser && npm ci && node screenshots.js

import { readFile, stat } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { browser, call, service } from "./ballast.js";

const root = (path) => fileURLToPath(new URL(`../../${path}`, import.meta.url));
const rows = (await readFile(root("data/us_market_monthly.csv"), "utf8"))
  .trim()
  .split("\n")
  .map((line) => line.split(","));
const start = rows.findIndex(([month]) => month === "2008-01");
const returns = rows.map(([, market]) => Number(market));
const bank = rows.slice(start - 12, start).reduce((sum, [, , bill]) => sum + Number(bill), 0) / 12;

/** Twenty years of months before 2008, and how many of its months have been lived. */
const [MONTHS, LIVED, HORIZON] = [240, 7, 12];

const ballast = await service();
const chromium = await browser();
try {
  const { url } = ballast;
  const { job } = await call(url, "/train", {
    problem: {
      horizon: HORIZON,
      rate_per_step: Number(bank.toFixed(4)),
      periods_per_year: 12,
      utility: { kind: "power", risk_aversion: 3 },
      history: returns.slice(start - MONTHS, start).map(Math.log1p),
    },
    design: { count: 500, initial_laws: "resampled" },
    name: "Balanced, by twenty years of months",
  });
  let policy = null;
  while (policy === null) {
    await new Promise((resolve) => setTimeout(resolve, 200));
    const now = await call(url, `/jobs/${job}`);
    if (now.finished_ms !== null && now.state !== "succeeded")
      throw new Error(`the training ${now.state}: ${now.error}`);
    policy = now.policy;
  }
  const { session } = await call(url, "/sessions", { policy, name: "Ada" });
  for (let period = 1; period <= LIVED; period++) {
    // The last day of a month is the one before the first of the next.
    const date = new Date(Date.UTC(2008, period, 0)).toISOString().slice(0, 10);
    await call(url, "/observe", { session, period, simple_return: returns[start + period - 1], date, confirm: true });
  }
  await shot(`#/sessions/${session}`, "light", "slider", "docs/images/session.png", 1080);
  await shot(`#/policies/${policy}`, "dark", "application", "docs/images/policy.png");
} finally {
  await chromium.close();
  await ballast.stop();
}

/** A picture of a view, 1280 pixels wide, once its last chart stands; as high as the view where no `height` is given. */
async function shot(hash, colorScheme, role, file, height) {
  const page = await chromium.newPage({ viewport: { width: 1280, height: height ?? 900 }, colorScheme });
  await page.goto(`${ballast.url}/${hash}`);
  await page.getByRole(role).last().waitFor();
  await page.waitForLoadState("networkidle");
  await page.evaluate(() => document.fonts.ready);
  await page.screenshot({ path: root(file), fullPage: height === undefined });
  await page.close();
  console.log(`${file}: ${(await stat(root(file))).size} bytes`);
}
