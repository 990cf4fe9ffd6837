// A training request in words.

import { h } from "./dom.js";
import * as flows from "./flows.js";
import { count, counted, percent, significant, wealth } from "./format.js";

export const FRAMEWORKS = {
  adaptive: "Adaptive robust",
  static: "Static robust",
  known_law: "Known law",
  plug_in: "Plug-in",
  parametric_static: "Parametric static",
  parametric_adaptive: "Parametric adaptive",
};

const MEANINGS = {
  adaptive: "It guards against the worst law near the returns seen, and learns from every new one.",
  static: "It guards against the worst law near the history, and does not learn.",
  known_law: "It takes the law as known and guards against nothing.",
  plug_in: "It takes the returns seen for the whole truth, and learns.",
  parametric_static: "It takes returns as normal, guards against every mean and variance near the history's, and does not learn.",
  parametric_adaptive:
    "It takes returns as normal, guards against every mean and variance near those of the returns seen, and learns.",
};

/** Utility in a few words. */
export function utility({ kind, risk_aversion }) {
  if (kind === "log") return "log utility";
  return `${kind} utility, risk aversion ${significant(risk_aversion)}${kind === "exponential" ? " per unit of wealth" : ""}`;
}

/** What trading costs, in a sentence. */
const trading = ({ trading_cost: cost }) =>
  cost > 0 ? `Trading costs ${percent(cost, 2)} of what is traded.` : "Trading is free.";

/** The wealth whose utility is `value`. */
export function worth({ kind, risk_aversion: aversion }, value) {
  if (kind === "log") return Math.exp(value);
  if (kind === "power") return (1 + (1 - aversion) * value) ** (1 / (1 - aversion));
  return -Math.log1p(-aversion * value) / aversion;
}

/** The rule of the radius in a few words. */
export function radiusRule(radius) {
  switch (radius.rule) {
    case "bridge":
    case "calibrated": {
      const times = radius.scale === 1 ? "" : `${significant(radius.scale)} times `;
      const factor = radius.rule === "bridge" ? "" : ", times the factor that the history asks for";
      return `${times}the ${percent(1 - radius.alpha, 0)} quantile of the bridge statistic over \u221an${factor}`;
    }
    case "concentration":
      return `the concentration bound at ${percent(1 - radius.alpha, 0)} (C ${significant(radius.C)}, c ${significant(radius.c)})`;
    case "root_n":
      return `${significant(radius.kappa)} / \u221an`;
    case "chi_square":
      return `the ${percent(1 - radius.alpha, 0)} confidence region of mean and variance`;
    case "fixed":
      return `${significant(radius.radius)} at every sample size`;
    default:
      return radius.rule;
  }
}

/** Mean and standard deviation of log-returns. */
export function moments(values) {
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const variance = values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length;
  return { mean, deviation: Math.sqrt(variance) };
}

/** True where the uncertainty set is a ball of laws. */
export const hasBall = ({ framework }) => framework === "adaptive" || framework === "static";

/** True where the uncertainty set is a confidence region of a normal law. */
export const isParametric = (framework) => framework.startsWith("parametric");

/** What may be a mistake in a request. */
export function warningList(warnings) {
  return warnings.map(({ message }) => h("p", { class: "note wrong" }, message));
}

/** The whole specification, a sentence a choice; `annualised` is what the service says by the year, where it does. */
export function inWords({ problem, design, surrogate, seed }, annualised) {
  const { mean, deviation } = moments(problem.history);
  const limit = problem.action_interval[1];
  const ball = hasBall(problem) ? ` The radius of the ball is ${radiusRule(problem.radius)}.` : "";
  const { learning } = problem;
  const forgets =
    learning.kind === "decay" ? ` Returns weigh less the older they are: half after ${significant(learning.half_life)} of the periods.` : "";
  const laws = design.initial_laws === "resampled" ? "starting from resampled histories" : "starting from this history";
  return [
    `${MEANINGS[problem.framework]}${ball}${forgets}`,
    `${counted(problem.horizon, "decision")} with ${utility(problem.utility)}; the bank pays ${percent(problem.rate_per_step, 2)} a period${annualised ? ` (${percent(annualised.rate, 2)} a year)` : ""}, and up to ${percent(limit, 0)} of wealth may be at risk. It starts with ${wealth(problem.initial_wealth)}. ${trading(problem)} ${flows.inWords(problem)}`.trim(),
    `The history holds ${counted(problem.history.length, "log-return")}: mean ${percent(mean, 2)}, standard deviation ${percent(deviation, 2)} a period.${annualised ? ` By the year the asset returned ${percent(annualised.mean_return)} on average, with a standard deviation of ${percent(annualised.deviation)}.` : ""}`,
    `Each step was solved at ${counted(design.count, "state")} simulated under ${law(design.sampling_law)}, ${laws}; surrogates of the ${surrogate.target === "value" ? "value" : "gain over the floor"} on ${surrogate.features === "raw_moments" ? "raw" : "standardised"} features. Seed ${count(seed)}.`,
  ];
}

function law(sampling) {
  if (sampling.kind === "gaussian_mixture") return `a mixture of ${counted(sampling.components.length, "normal law")}`;
  if (sampling.kind === "student_t")
    return `a Student law with ${significant(sampling.degrees_of_freedom)} degrees of freedom`;
  return "a smoothed bootstrap of the history";
}
