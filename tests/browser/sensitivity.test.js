// What the session's page says of how near the advice is to changing: words from an answer, and on the page by themselves.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, call, service, trained } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { plain } from "./page.js";

const { sentences, headline } = await dashboardModule("sensitivity.js");
const said = (answer) => plain(sentences(answer).join(" "));

const at = (simple_return, allocation) => ({ simple_return, allocation });
const near = {
  allocation: 0.43,
  sensitivity: {
    without_one: { lowest: at(0.03, 0.4304), highest: at(-0.086, 1) },
    next_return: { to_bank: at(-0.062), to_highest: null, low: at(-0.07, 0), high: at(0.06, 0.612) },
    premium: { present: 0.0051, needed: 0.0044, periods_more: 0 },
  },
};

test("the sentences say what differs, in percent", () => {
  assert.equal(
    said(near),
    "Without its return of -8.6 % the advice would be 100 %. " +
      "After a return of -7.0 % the advice would be 0 %; after one of 6.0 % it would be 61.2 %. " +
      "A return of -6.2 % next period would move the advice fully into the bank. " +
      "The record has paid 0.51 % a period more than the bank pays now; the advice leaves the bank at 0.44 %.",
  );
});

test("a premium has the digits that decide", () => {
  const premium = { present: 0.00021, needed: 0.000198, periods_more: 0 };
  assert.match(said({ ...near, sensitivity: { ...near.sensitivity, premium } }), /paid 0\.0210 % a period more than the bank pays now; the advice leaves the bank at 0\.0198 %\.$/);
});

test("who is in the bank is told what it would take, and what never would", () => {
  const { next_return } = near.sensitivity;
  const banked = (periods_more, needed = 0.0061) =>
    said({
      allocation: 0,
      sensitivity: {
        without_one: { lowest: at(0.03, 0), highest: at(0.03, 0) },
        next_return: { ...next_return, to_bank: null, high: at(0.06, 0) },
        premium: { present: 0.0051, needed, periods_more },
      },
    });
  assert.match(banked(37), /leaves the bank at 0.61 %. About 37 more periods like those seen would also be enough.$/);
  assert.match(banked(1), /About 1 more period like/);
  assert.match(banked(null), /No number of periods like those seen, up to 10,000, would be enough.$/);
  assert.match(banked(null, null), /at no similar average/);
  assert.match(banked(37), /^No single return of the record matters/);
  const held = (allocation, next) => said({ allocation, sensitivity: { ...near.sensitivity, next_return: { ...next_return, ...next } } });
  assert.match(held(0, { to_bank: at(0.103) }), /The advice leaves the bank only if the next period returns more than 10\.3 %\. The record/);
  assert.match(held(1, { to_bank: null, to_highest: at(-0.02) }), /It stays there unless the next period returns less than -2\.0 %\./);
  assert.match(banked(37), /After a return of -7\.0 % or of 6\.0 % it would stay at 0 %\./);
});

test("how near is said first, by what an unusual period would do", () => {
  const moved = (low, high) => plain(headline({ allocation: 0.43, sensitivity: { next_return: { low: at(-0.07, low), high: at(0.06, high) } } }, "month"));
  assert.equal(moved(0, 0.612), "It is close to changing: an unusual month would move it by 43 points.");
  assert.equal(moved(0.4, 0.48), "It moves a little: an unusual month would move it by up to 5.0 points.");
  assert.equal(moved(0.425, 0.44), "It is steady: nine in ten months would move it by less than 2 points.");
});

test("the page asks by itself, and says it", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    page.setDefaultTimeout(20_000);
    const history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
    const problem = { horizon: 2, rate_per_step: 0.002, history, radius: { rule: "bridge", alpha: 0.1, scale: 0.2 } };
    const policy = await trained(ballast.url, { problem, design: { count: 50 } });
    const { session } = await call(ballast.url, "/sessions", { policy });
    await page.goto(`${ballast.url}/#/sessions/${session}`);
    await page.getByText(/The record has paid/).waitFor();
    const told = sentences(await call(ballast.url, `/action?session=${session}&sensitivity=true`));
    const shown = plain(await page.locator("main").innerText());
    const first = headline(await call(ballast.url, `/action?session=${session}&sensitivity=true`));
    for (const words of [first, ...told]) assert.ok(shown.includes(plain(words)), words);
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
