// Evaluates a policy from its exported document, as docs/policy-format.md says.
//
// A point of the surface is a real law, not a free choice of features: the policy's own history, shifted to another
// mean and scaled to another standard deviation. All its features follow, including the robust excess return. What the
// history's shape does not determine (skewness, kurtosis, the level of the rest) stays at the centre of the step's
// design.

import { flowsAfter } from "./flows.js";
import { effectiveSize, shareSeen } from "./laws.js";

/** Returns a named feature of a state `{wealth, law, radius, share, rate, riskAversion}`: `wealth` is total wealth, `share` that of the returns
 * seen in the centre, and `riskAversion` is relative. */
export function feature(name, { wealth, law, radius, share = 1, rate, riskAversion }) {
  const mertonRatio = (excess, variance) => Math.asinh(excess / (riskAversion * variance));
  switch (name) {
    case "wealth":
      return wealth;
    case "log_wealth":
      return Math.log(wealth);
    case "mean":
      return law.mean;
    case "log_standard_deviation":
      return Math.log(law.deviation);
    case "skewness":
      return law.standardised(3);
    case "log_kurtosis":
      return Math.log(law.standardised(4));
    case "log_radius":
      return Math.log(Math.max(radius, 1e-12));
    case "robust_merton_ratio":
      return mertonRatio(law.worst(radius / share, rate).mean - 1, Math.max(law.variance, 1e-16));
    case "worst_law_merton_ratio": {
      const { mean, variance } = law.worst(radius / share, rate);
      return mertonRatio(mean - 1, Math.max(variance, law.variance / 100, 1e-18));
    }
    case "radius_trend":
      // This needs the simulated bridges, which a policy does not contain: it stays at the centre of the design.
      return 0;
  }
  const order = Number(name.split("_")[1]);
  if (name.startsWith("moment_")) return law.raw(order);
  return order % 2 === 0 ? Math.log(law.standardised(order)) : law.standardised(order);
}

/** Returns the mean of a stored process' first function at scaled inputs. */
export function predicted({ hyperparameters, weights: [weights], offset, scale }, inputs, x) {
  const lengths = hyperparameters.lengthscales;
  let sum = 0;
  for (let j = 0; j < weights.length; j++) {
    let square = 0;
    for (let i = 0; i < lengths.length; i++) square += ((x[i] - inputs[i][j]) / lengths[i]) ** 2;
    const r = Math.sqrt(5 * square);
    sum += weights[j] * (1 + r + (r * r) / 3) * Math.exp(-r);
  }
  return offset + scale * hyperparameters.signal_variance * sum;
}

/** Returns the allocation for an investor who holds nothing yet, at unscaled features in the order of `names`; with trading costs, the lower
 * end of the band. Processes predict it as a share of total wealth, of which the share `inHand` can be held. */
export function allocation(solution, features, highest, inHand = 1) {
  const { centre, spread } = solution.scaling;
  const x = features.map((value, index) => (value - centre[index]) / spread[index]);
  return Math.max(0, Math.min(highest, predicted(solution.policy, solution.inputs, x) / inHand));
}

/** Returns one step of an exported policy over laws of its history's `shape`; null if the step has a single state. */
export function stepSurface(policy, shape, step) {
  const { solution, diagnostics } = policy.steps[step];
  if (solution.kind === "single") return null;
  const { problem } = policy.specification;
  const names = diagnostics.policy.features;
  const { centre, spread } = solution.scaling;
  const level = Object.fromEntries(
    names.map((name, index) => [name, { centre: centre[index], spread: spread[index] }]),
  );
  const middle = centres(level, problem, step, shape);
  const { toCome, reserve } = flowsAfter(problem, step);
  const state = ({ wealth, mean, deviation, radius }) => ({
    wealth: wealth + toCome,
    radius,
    share: shareSeen(problem.centre, problem.history.length + step),
    rate: problem.rate_per_step,
    riskAversion: relativeRiskAversion(problem),
    law: shape.law(mean, deviation),
  });
  const base = features(names, state(middle));
  const at = (place) => {
    const there = { ...middle, ...place };
    const moved = features(names, state(there));
    const free = 1 - reserve / (there.wealth * (1 - problem.trading_cost));
    return allocation(
      solution,
      moved.map((value, index) => centre[index] + value - base[index]),
      Math.min(problem.action_interval[1], free),
      there.wealth / (there.wealth + toCome),
    );
  };
  const dots = (axis) => designValues(axis, solution, names).map((value) => (axis === "wealth" ? value - toCome : value));
  return { at, middle, ranges: ranges(level, middle, toCome), dots };
}

/** Returns the relative risk aversion at the initial wealth plus the present value of later contributions. */
function relativeRiskAversion(problem) {
  const { utility, initial_wealth } = problem;
  if (utility.kind === "log") return 1;
  if (utility.kind === "power") return utility.risk_aversion;
  return utility.risk_aversion * (initial_wealth + flowsAfter(problem, 0).toCome);
}

const features = (names, state) => names.map((name) => feature(name, state));

/** Returns the design's centre, as wealth, mean, standard deviation and radius. */
function centres(level, problem, step, own) {
  const of = (name) => level[name]?.centre;
  const mean = of("mean") ?? of("moment_1") ?? own.mean;
  const logDeviation = of("log_standard_deviation");
  const variance = of("moment_2") === undefined ? undefined : of("moment_2") - mean ** 2;
  const deviation =
    logDeviation !== undefined ? Math.exp(logDeviation) : variance > 0 ? Math.sqrt(variance) : own.deviation;
  const { toCome } = flowsAfter(problem, step);
  const total = of("log_wealth") !== undefined ? Math.exp(of("log_wealth")) : of("wealth");
  return {
    wealth: total === undefined ? problem.initial_wealth : total - toCome,
    mean,
    deviation,
    radius: of("log_radius") !== undefined ? Math.exp(of("log_radius")) : ruledRadius(problem, step),
  };
}

/** Returns the radius if it follows from the effective sample size alone, otherwise 0. */
function ruledRadius({ framework, learning, centre, radius, history }, step) {
  const n = effectiveSize(learning, history.length + step);
  const share = shareSeen(centre, n);
  if (framework === "plug_in" || framework === "known_law") return 0;
  switch (radius.rule) {
    case "fixed":
      return radius.radius;
    case "root_n":
      return (share * radius.kappa) / Math.sqrt(n);
    case "chi_square":
      return Math.sqrt((-2 * Math.log(radius.alpha)) / n);
    case "concentration":
      return share * Math.sqrt(Math.log(radius.C / radius.alpha) / (radius.c * n));
    default:
      return 0;
  }
}

/** Returns two and a half standard deviations of the design around its centre, for each axis that the step depends on. */
function ranges(level, middle, toCome) {
  const WIDE = 2.5;
  const plain = (name, lowest = -Infinity) =>
    level[name] && [
      Math.max(lowest, level[name].centre - WIDE * level[name].spread),
      level[name].centre + WIDE * level[name].spread,
    ];
  const logarithmic = (name) => plain(name)?.map(Math.exp);
  const total = logarithmic("log_wealth") ?? plain("wealth");
  const found = {
    wealth: total?.map((value) => Math.max(value - toCome, 0.01 * middle.wealth)),
    mean: plain("mean") ?? plain("moment_1"),
    radius: logarithmic("log_radius"),
    deviation: logarithmic("log_standard_deviation"),
  };
  return Object.fromEntries(Object.entries(found).filter(([, range]) => range));
}

/** Returns the values of one axis at the design points. */
function designValues(axis, { scaling, inputs }, names) {
  const choices = {
    wealth: ["log_wealth", "wealth"],
    mean: ["mean", "moment_1"],
    radius: ["log_radius"],
    deviation: ["log_standard_deviation"],
  }[axis];
  const index = names.findIndex((name) => choices.includes(name));
  const straight = (value) => (names[index].startsWith("log_") ? Math.exp(value) : value);
  return inputs[index].map((value) => straight(scaling.centre[index] + scaling.spread[index] * value));
}
