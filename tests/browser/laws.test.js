// Laws of one shape against the plain sums that define them, and the time a whole field takes at 5,000 returns.

import assert from "node:assert/strict";
import { test } from "node:test";
import { dashboardModule } from "./modules.js";

const { Shape, effectiveSize } = await dashboardModule("laws.js");
const { feature } = await dashboardModule("surface.js");

const RATE = 0.002;
/** Returns with a skew and ties, the same at every run. */
const sample = (count) =>
  Array.from({ length: count }, (_, k) => Math.round(1e4 * (0.006 + 0.04 * Math.sin(7 * k) - 0.03 * Math.cos(3 * k) ** 4)) / 1e4);

const average = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/** e^Z / (1 + r) of every atom under the law of the ball with the least mean, filling from the top one atom at a time. */
function worstGrowths(atoms, radius) {
  const sorted = [...atoms].sort((a, b) => b - a);
  const n = sorted.length;
  let [above, cut] = [0, 0];
  for (let used = 0; used < n; used++) {
    above += sorted[used];
    cut = (above - n * radius) / (used + 1);
    if (used + 1 === n || cut >= sorted[used + 1]) break;
  }
  return sorted.map((atom) => Math.exp(Math.min(atom, cut)) / (1 + RATE));
}

const central = (values, order) => average(values.map((value) => (value - average(values)) ** order));

test("a law of a shape has the moments of its atoms", () => {
  const history = sample(37);
  const shape = new Shape(history);
  for (const [mean, deviation] of [[shape.mean, shape.deviation], [0.02, 0.01], [-0.01, 0.09]]) {
    const atoms = history.map((atom) => mean + (deviation * (atom - shape.mean)) / shape.deviation);
    const law = shape.law(mean, deviation);
    const near = (found, expected, words) => assert.ok(Math.abs(found - expected) <= 1e-12 + 1e-10 * Math.abs(expected), `${words}: ${found} is not ${expected}`);
    for (const order of [1, 2, 3, 4, 5]) near(law.raw(order), average(atoms.map((atom) => atom ** order)), `moment ${order}`);
    for (const order of [3, 4, 5]) near(law.standardised(order), central(atoms, order) / central(atoms, 2) ** (order / 2), `standardised ${order}`);
    for (const radius of [0, 1e-6, 0.003, 0.02, 0.5]) {
      const growths = worstGrowths(atoms, radius);
      const worst = law.worst(radius, RATE);
      near(worst.mean, average(growths), `worst mean at ${radius}`);
      assert.ok(Math.abs(worst.variance - central(growths, 2)) <= 1e-14, `worst variance at ${radius}`);
    }
  }
});

test("a return of twice the weight is two returns", () => {
  // At a retention of 1/2 the weights are 1, 2 and 4 quarters.
  const [weighted, repeated] = [new Shape([0.03, -0.02, 0.01], 0.5).law(), new Shape([0.03, -0.02, -0.02, 0.01, 0.01, 0.01, 0.01]).law()];
  const near = (found, expected) => assert.ok(Math.abs(found - expected) <= 1e-14, `${found} is not ${expected}`);
  near(weighted.mean, repeated.mean);
  near(weighted.deviation, repeated.deviation);
  near(weighted.standardised(3), repeated.standardised(3));
  for (const radius of [0, 0.001, 0.02, 0.5]) {
    near(weighted.worst(radius, RATE).mean, repeated.worst(radius, RATE).mean);
    near(weighted.worst(radius, RATE).variance, repeated.worst(radius, RATE).variance);
  }
});

test("the effective size is one over the sum of the squared masses", () => {
  for (const [half_life, count] of [[1, 4], [24, 240]]) {
    const weights = Array.from({ length: count }, (_, age) => 0.5 ** (age / half_life));
    const expected = weights.reduce((sum, weight) => sum + weight) ** 2 / weights.reduce((sum, weight) => sum + weight ** 2, 0);
    const found = effectiveSize({ kind: "decay", half_life }, count);
    assert.ok(Math.abs(found / expected - 1) < 1e-12, `${found} is not ${expected}`);
  }
  assert.equal(effectiveSize({ kind: "equal" }, 17), 17);
});

test("features of a state are those of its law", () => {
  const history = sample(50);
  const state = { wealth: 120, radius: 0.004, rate: RATE, riskAversion: 3, law: new Shape(history).law() };
  const variance = central(history, 2);
  const excess = average(worstGrowths(history, 0.004)) - 1;
  const expected = {
    wealth: 120,
    log_wealth: Math.log(120),
    mean: average(history),
    log_standard_deviation: Math.log(variance) / 2,
    log_radius: Math.log(0.004),
    robust_merton_ratio: Math.asinh(excess / (3 * variance)),
    moment_2: average(history.map((atom) => atom ** 2)),
  };
  for (const [name, value] of Object.entries(expected)) {
    assert.ok(Math.abs(feature(name, state) - value) <= 1e-9 * Math.max(1, Math.abs(value)), `${name}: ${feature(name, state)} is not ${value}`);
  }
});

test("twelve hundred laws of 5,000 returns take less than a quarter of a second", () => {
  const shape = new Shape(sample(5000));
  const started = process.cpuUsage();
  for (let column = 0; column < 41; column++) {
    for (let row = 0; row < 29; row++) shape.law(0.001 * row, 0.03 + 0.001 * column).worst(0.004, RATE);
  }
  const { user, system } = process.cpuUsage(started);
  assert.ok((user + system) / 1e6 < 0.25, `${(user + system) / 1e6} s of a processor`);
});
