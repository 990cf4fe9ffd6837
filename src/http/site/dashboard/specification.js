// A training request in words.

import { post, Problem } from "./api.js";
import { h } from "./dom.js";
import * as flows from "./flows.js";
import { pressed } from "./form.js";
import { count, counted, minus, percent, significant, wealth } from "./format.js";
import { unitOf } from "./periods.js";

/** The kinds of policy in a manager's words; `PAPER` has the paper's. */
export const FRAMEWORKS = {
  adaptive: "Cautious, learns",
  static: "Cautious, fixed",
  known_law: "Knows the market",
  plug_in: "Trusts the record",
  parametric_static: "Cautious, fixed, bell curve",
  parametric_adaptive: "Cautious, learns, bell curve",
};
export const PAPER = {
  adaptive: "Adaptive robust",
  static: "Static robust",
  known_law: "Known law",
  plug_in: "Plug-in",
  parametric_static: "Parametric static robust",
  parametric_adaptive: "Parametric adaptive robust",
};

const MEANINGS = {
  adaptive: "It guards against the worst market that the returns seen still allow, and learns from every new return.",
  static: "It guards against the worst market within its caution, which the history sets, and does not learn.",
  known_law: "It takes the market as known and guards against nothing.",
  plug_in: "It trusts the returns seen completely, and learns from every new return.",
  parametric_static:
    "It assumes that returns follow a bell curve. It guards against every average and spread near those of the history, and does not learn.",
  parametric_adaptive:
    "It assumes that returns follow a bell curve. It guards against every average and spread near those of the returns seen, and learns from every new return.",
};

/** Investors by their relative risk aversion, of power utility. */
export const INVESTORS = { cautious: 6, balanced: 3, bold: 1.5 };

/** Returns the presets to choose from. */
export const investorChoices = () => Object.keys(INVESTORS).map((name) => [name, `${name[0].toUpperCase()}${name.slice(1)}`]);
export const investorNote = `How much a loss hurts: risk aversion ${Object.values(INVESTORS).join(", ").replace(/, (?=[^,]*$)/, " and ")}.`;

/** Returns the preset of a utility, if it is one. */
export const presetOf = ({ kind, risk_aversion }) =>
  kind === "power" ? Object.keys(INVESTORS).find((name) => INVESTORS[name] === risk_aversion) : undefined;

/** Describes the investor of a policy, as the text after "for". */
export const investorWords = (asked) =>
  presetOf(asked) ? `a ${presetOf(asked)} investor (risk aversion ${significant(asked.risk_aversion)})` : `an investor with ${utility(asked)}`;

/** Formats a share that is part of a name, with its own digits: 95 %, 97.5 %. */
export const percentName = (share) => `${Number((100 * share).toPrecision(6))}\u202f%`;

/** Describes a utility in a few words. */
export function utility({ kind, risk_aversion }) {
  if (kind === "log") return "log utility";
  const preset = presetOf({ kind, risk_aversion });
  if (preset) return `${preset}, risk aversion ${significant(risk_aversion)}`;
  return `${kind} utility, risk aversion ${significant(risk_aversion)}${kind === "exponential" ? " per unit of wealth" : ""}`;
}

/** Says what trading costs. */
const trading = ({ trading_cost: cost }) =>
  cost > 0 ? `Trading costs ${percent(cost, 2)} of what is traded.` : "Trading is free.";

/** Returns the wealth whose utility is `value`. */
export function worth({ kind, risk_aversion: aversion }, value, floor) {
  if (kind === "log") return floor * Math.exp(value);
  if (kind === "power") return floor * (1 + (1 - aversion) * value) ** (1 / (1 - aversion));
  return floor - Math.log1p(-aversion * floor * value) / aversion;
}

/** Describes the rule of the radius in a few words. */
function radiusRule(radius) {
  switch (radius.rule) {
    case "bridge":
    case "calibrated": {
      const times = radius.scale === 1 ? "" : `${significant(radius.scale)} times `;
      const factor = radius.rule === "bridge" ? "" : ", times the factor calibrated from the history";
      return `${times}the ${percent(1 - radius.alpha, 0)} quantile of the bridge statistic over \u221an${factor}`;
    }
    case "joint":
      return `the ${percent(1 - radius.alpha, 0)} quantile of the bridge statistic over \u221an, times the factor for all periods together`;
    case "concentration":
      return `the concentration bound at ${percent(1 - radius.alpha, 0)} for laws on the support`;
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

/** Returns the mean and the standard deviation of returns. */
export function moments(values) {
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const variance = values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length;
  return { mean, deviation: Math.sqrt(variance) };
}

/** Tells whether a policy is of a problem that was declared in formulas. */
export const isDeclared = ({ problem }) => problem.states !== undefined;

/** Refuses a policy that has no investor. */
export function investorsOnly(specification) {
  if (isDeclared(specification)) throw new Problem({ title: "Not for this policy", field: "policy", detail: "This policy is of a declared problem, without an investor. Its own page says what to do." });
}

/** Refuses a session that has no investor; otherwise returns it. */
export function investorsSession(session) {
  if (session.states) throw new Problem({ title: "Not for this session", field: "session", detail: "This session is of a declared problem, without an investor. Its own page says what to do." });
  return session;
}

/** Tells whether the uncertainty set is a ball of laws. */
export const hasBall = ({ framework }) => framework === "adaptive" || framework === "static";

/** Tells whether the uncertainty set is a confidence region of a normal law. */
export const isParametric = (framework) => framework.startsWith("parametric");

/** Tells whether a policy guards against markets worse than the record. */
export const isCautious = (problem) => hasBall(problem) || isParametric(problem.framework);

/** Says what the bank pays in a problem; without the number if the rates differ by period. */
function banks({ rate_per_step, periods_per_year }) {
  if (typeof rate_per_step !== "number") return "The bank pays";
  const a_year = periods_per_year > 1 ? `, ${percent(Math.expm1(periods_per_year * Math.log1p(rate_per_step)), 1)} a year` : "";
  return `The bank pays ${percent(rate_per_step, 2)} a ${unitOf(periods_per_year)}${a_year},`;
}

/** The texts of warnings by their codes, in the words and the units of the form; `field` is the field in doubt, `message` the service's text. */
export const WARNED = {
  rate_high: (problem) => `${banks(problem)} more than banks usually do. Is that what it pays in one ${unitOf(problem.periods_per_year)}, or in a year?`,
  rate_above_record: (problem) => `${banks(problem)} more than the average return of the record. Is that what it pays in one ${unitOf(problem.periods_per_year)}?`,
  record_in_percent: (_, field) =>
    `The ${field.includes("centre") ? "assumed " : ""}returns vary more than those of any market. Are they percentages that were read as fractions?`,
  trading_cost_high: ({ trading_cost }) => `Trading costs ${percent(trading_cost, 2)} of what is traded. Is that right?`,
  inflation_high: ({ spending, periods_per_year }) => `Prices rise ${percent(spending.inflation, 1)} a ${unitOf(periods_per_year)}, more than is usual. Is that the rise of one ${unitOf(periods_per_year)}, or of a year?`,
  tail_heavy: () => "A few returns of the record lie so far out that its uncertainty cannot be measured. Give bounds on the returns.",
  lone_return: (_, field, message) => `One return of the record, ${minus(/[-\d.]+ %/.exec(message)[0])}, lies far beyond all others. Is it right?`,
  estimated_returns: (_, field, message) => `The record holds ${/holds (.*?);/.exec(message)[1]}. What came before is estimated from the assets with longer records. Is that meant?`,
  few_alike: () => "Hardly any return of the record came after a figure like the present one, so others count too. Is the present figure meant?",
  jumps: (_, field, message) => minus(message),
};

/** Lists the warnings about a problem. */
export function warningList(warnings, problem) {
  return warnings.map(({ code, field, message }) => h("p", { class: "note wrong" }, WARNED[code](problem, field, message)));
}

/** Asks in the form whether the warnings about a queued job are right, if there are any; `yes()` continues. The other answer cancels the job
 * and leaves the form as it was. */
export function meant(form, { noun, job, warnings, problem }, yes) {
  form.querySelector(".meant")?.remove();
  if (warnings.length === 0) return yes();
  const go = h("button", { type: "button", onclick: yes }, "Yes, continue");
  const change = h("button", { type: "button", class: "quiet" }, "No, change it");
  change.addEventListener("click", () =>
    pressed(change, async () => {
      await post(`/jobs/${job}/cancel`);
      question.remove();
      form.querySelector(`[name="${CSS.escape(warnings[0].field)}"]`)?.focus();
    }),
  );
  const question = h("div", { class: "words meant", role: "group", "aria-label": "Is this right?", tabindex: -1 }, h("p", {}, `The ${noun} is queued. Is this right?`), warningList(warnings, problem), h("p", { class: "actions" }, go, change));
  form.querySelector(":scope > .send").before(question);
  question.focus();
}

/** Returns the share of the radius that is used. */
export const shareOf = ({ caution, levels }) => caution?.scale ?? levels?.[caution]?.scale ?? 1;

/** Returns the level of caution as the forms name it: the paper's is full. */
export const cautionName = (level) => (level === "paper" ? "full" : level);

/** Describes the level of caution and its share of the radius, if it is not the paper's. */
function levelInWords(problem) {
  const { caution } = problem;
  if (caution === undefined || caution === "paper") return "";
  const level = typeof caution === "string" ? `${caution}, ` : "";
  return `${level}${percent(shareOf(problem), 0)} of `;
}

/** Says how cautious a policy is, in a few words. */
export function caution(problem) {
  const { radius } = problem;
  if (!isCautious(problem)) return "none";
  const { alpha, scale = 1 } = radius;
  const by = { calibrated: ", calibrated", joint: " over all periods together", concentration: " by the concentration bound" }[radius.rule] ?? "";
  const confidence = alpha === undefined ? radiusRule(radius) : `${percentName(1 - alpha)} confidence${by}`;
  const acted = levelInWords(problem);
  return `${acted}${scale === 1 ? confidence : `${confidence}, \u00d7 ${significant(scale)}`}`;
}

/** Says what the ball is centred on, if that is not the law of the returns seen. */
export function centreInWords({ kind, bandwidth, half_life, on, weight } = {}, unit = "period") {
  switch (kind) {
    case "smoothed":
      return `Every return seen is spread out as a normal distribution around it, with deviation ${percent(bandwidth, 2)}.`;
    case "volatility_scaled":
      return `Every return seen is rescaled to the current volatility, in which squared returns count half after ${counted(half_life, unit)}.`;
    case "conditional":
      return `Returns count the more, the more the ${on.kind === "column" ? "given figure" : on.kind} before each was like that of today.`;
    case "mixed":
      return `Besides the returns seen, it uses an assumed law that counts as much as ${significant(weight)} more returns.`;
    default:
      return "";
  }
}

/** Describes the request, one sentence for each choice; `annualised` are the service's yearly figures, if it gives them. */
export function inWords({ problem }, annualised) {
  const { mean, deviation: ofAll } = moments(problem.history.map(Math.expm1));
  // The sample's standard deviation, divided by n - 1, as shown where the record is read.
  const deviation = ofAll * Math.sqrt(problem.history.length / (problem.history.length - 1));
  const limit = problem.action_interval[1];
  const unit = unitOf(problem.periods_per_year);
  const guarded = caution(problem) === "none" ? "" : ` Its caution: ${caution(problem)}.`;
  const { learning } = problem;
  const forgets =
    learning.kind === "decay" ? ` Older returns count less: half after ${counted(learning.half_life, unit)}.` : "";
  const centred = centreInWords(problem.centre, unit);
  const all = limit === 1 ? "all" : `up to ${percent(limit, 0)}`;
  return [
    `${MEANINGS[problem.framework]}${guarded}${forgets}${centred && ` ${centred}`}`,
    `It looks ${counted(problem.horizon, unit)} ahead for ${investorWords(problem.utility)}; the bank pays ${percent(problem.rate_per_step, 2)} a ${unit}${annualised ? ` (${percent(annualised.rate, 2)} a year)` : ""}, and ${all} of wealth may be in stocks. It starts with ${wealth(problem.initial_wealth)}. ${trading(problem)} ${flows.inWords(problem)}${problem.spending ? `It says what to spend before each ${unit}.` : ""}`.trim(),
    `The record holds ${counted(problem.history.length, "return")}: mean ${percent(mean, 2)}, standard deviation ${percent(deviation, 2)} a ${unit}.${annualised ? ` That is ${percent(annualised.mean_return, 2)} a year, compounded, with a deviation of ${percent(annualised.deviation, 2)}.` : ""}`,
  ];
}

/** Describes the request and its solution, in the paper's terms. */
export function inPaperWords({ problem, design, surrogate, seed }) {
  const ball = hasBall(problem) ? `the radius of the ball is ${radiusRule(problem.radius)}` : isParametric(problem.framework) ? `the uncertainty set is ${radiusRule(problem.radius)}` : "there is no uncertainty set";
  const laws = design.initial_laws === "resampled" ? "starting from resampled histories" : "starting from this history";
  return [
    `${PAPER[problem.framework]}: ${ball}. The utility is ${problem.utility.kind}; mean and standard deviation above are of simple returns.`,
    `Each step was solved at ${counted(design.count, "state")} simulated under ${law(design.sampling_law)}, ${laws}; surrogates of the ${surrogate.target === "value" ? "value" : "gain over the floor"} on ${surrogate.features === "raw_moments" ? "raw" : "standardised"} features. Seed ${count(seed)}.`,
  ];
}

function law(sampling) {
  if (sampling.kind === "gaussian_mixture") return `a mixture of ${counted(sampling.components.length, "normal law")}`;
  if (sampling.kind === "student_t")
    return `a Student law with ${significant(sampling.degrees_of_freedom)} degrees of freedom`;
  return "a smoothed bootstrap of the history";
}
