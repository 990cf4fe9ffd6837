// A session of 500 periods: its page stands within a second, and stays short.

import assert from "node:assert/strict";
import { before, test } from "node:test";
import { call, trained } from "./ballast.js";
import { usable, visitQuiet } from "./page.js";
import { ballast, page } from "./scene.js";

const PERIODS = 500;
/** From the address until the last part of the page stands, in milliseconds; what other programs do, only some rounds wait for. */
const DRAWN = 1000;
const ROUNDS = 20;

let session;

before(async () => {
  const history = Array.from({ length: 40 }, (_, k) => 0.005 + 0.04 * Math.sin(1.7 * k));
  // One that rolls needs no horizon of 500 periods to be trained.
  const problem = { horizon: 2, rate_per_step: 0.001, periods_per_year: 252, history, learning: { kind: "decay", half_life: 4 }, radius: { rule: "bridge", alpha: 0.5, scale: 0.1 } };
  const policy = await trained(ballast.url, { problem, design: { count: 20, initial_laws: "resampled" } });
  ({ session } = await call(ballast.url, "/sessions", { policy, rolling: true }));
  const first = Date.UTC(2020, 0, 1);
  for (let period = 1; period <= PERIODS; period++) {
    const date = new Date(first + 86_400_000 * period).toISOString().slice(0, 10);
    await call(ballast.url, "/observe", { session, period, simple_return: 0.01 * Math.sin(3 * period), date });
  }
});

const address = () => `${ballast.url}/#/sessions/${session}`;

test("the page stands within a second", async (t) => {
  const rounds = [];
  while (rounds.length < ROUNDS && !(Math.min(...rounds) < DRAWN)) {
    await page.goto("about:blank");
    await page.goto(address());
    rounds.push(await page.evaluate(async () => {
      const stands = () => document.querySelector("#h-periods-so-far") && document.querySelectorAll("main svg path.line").length >= 4;
      while (!stands()) await new Promise(requestAnimationFrame);
      return performance.now();
    }));
    t.diagnostic(`${rounds.at(-1).toFixed(0)} ms`);
  }
  assert.ok(Math.min(...rounds) < DRAWN, `it stood after ${rounds} ms`);
});

test("its newest periods stand, and all where they are asked for, with no chart of stripes", async () => {
  await visitQuiet(page, address());
  const rows = page.getByRole("table", { name: "Observed periods, newest first" }).locator("tbody tr");
  assert.equal(await rows.count(), 24);
  assert.ok((await page.evaluate(() => document.documentElement.scrollHeight)) < 6000);
  assert.equal(await page.locator("main .plot rect.bar").count(), 0);
  await page.getByRole("button", { name: `Show all ${PERIODS}` }).click();
  assert.equal(await rows.count(), PERIODS);
});

test("so many periods of several assets are drawn as areas without gaps, of no more columns than can be told apart", async () => {
  await visitQuiet(page, address());
  const drawn = await page.evaluate(async (periods) => {
    const { stackedChart } = await import("/dashboard/stacked.js");
    const shares = Array.from({ length: periods }, (_, k) => ({ One: 0.5 + 0.3 * Math.sin(k), Two: 0.1 }));
    document.querySelector("main").prepend(stackedChart({ title: "Held", assets: ["One", "Two"], shares, x: { name: String, tick: String } }));
    const holder = document.querySelector("main .plot");
    while (!holder.querySelector("path")) await new Promise(requestAnimationFrame);
    const boxes = (path) => [...path.getAttribute("d").matchAll(/M(\S+) [^H]+H([^V]+)/g)].map(([, from, to]) => [Number(from), Number(to)]);
    return { width: holder.clientWidth, areas: [...holder.querySelectorAll("path.bar")].map(boxes) };
  }, PERIODS);
  assert.equal(drawn.areas.length, 2);
  for (const boxes of drawn.areas) {
    assert.ok(boxes.length > 100 && boxes.length <= drawn.width / 4, `${boxes.length} columns of ${drawn.width} pixels`);
    boxes.forEach(([from, to], k) => assert.ok((to - from >= 3 || k + 1 === boxes.length) && (k === 0 || from === boxes[k - 1][1]), `${from} to ${to}`));
  }
});

test("of a long record too it is said what leaving one return out would change", async () => {
  await page.getByText(/^(No single return of the record matters: |Without its return of )/).first().waitFor();
});

test("axe finds nothing, in light, in dark, at 200 % and at 320 pixels, and nothing scrolls sideways", async () => {
  await usable(page, () => visitQuiet(page, address()));
});
