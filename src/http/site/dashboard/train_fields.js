// The fields of a training: the investor and their caution in a manager's words and in percent, the paper's behind a
// fold.

import { bankRate } from "./bank_rate.js";
import { h } from "./dom.js";
import { fieldset, input, select } from "./form.js";
import { fraction, typed } from "./number_text.js";
import { unitOf } from "./periods.js";
import { FRAMEWORKS, INVESTORS, investorChoices, investorNote, isParametric, presetOf } from "./specification.js";

/** Each kind of utility with a usual risk aversion; that of the exponential is relative to the initial wealth. */
export const UTILITY = {
  exponential: { kind: "exponential", risk_aversion_relative: 3 },
  power: { kind: "power", risk_aversion: 3 },
  log: { kind: "log" },
};
const UTILITIES = { exponential: "Exponential", power: "Power", log: "Log" };
/** The frameworks offered; a known law must be given as JSON. */
const OFFERED = Object.fromEntries(Object.entries(FRAMEWORKS).filter(([framework]) => framework !== "known_law"));
/** The path of the half-life of returns. */
const HALF_LIFE = "problem.learning.half_life";
/** The path of the rule that splits the total between assets. */
const COMPOSITION = "problem.composition";
const COMPOSITIONS = { one_step: "Chosen each period, against the worst market", inverse_volatility: "Less of what varies more", equal: "Equal shares" };
/** The path of the level of caution. */
const CAUTION = "problem.caution";
export const CAUTIONS = {
  balanced: "Balanced: least regret, whatever the premium is",
  bold: "Bold: closer to the record",
  cautious: "Cautious: closer to no premium",
  paper: "Full: everything that the confidence implies",
};
/** The choice of an investor that is not a preset. */
const OWN = "own";

export const at = (object, path) => path.split(".").reduce((value, key) => value?.[key], object);

export function put(object, path, value) {
  const keys = path.split(".");
  const last = keys.pop();
  const parent = keys.reduce((value, key) => (value[key] ??= {}), object);
  parent[last] = value;
}

/** Reads one number, or several separated by semicolons. */
function amounts(text) {
  const each = text.split(";").map((part) => typed(part)).filter((part) => part !== null);
  return each.length > 1 ? each : (each[0] ?? 0);
}

const short = (value) => String(Number(value.toPrecision(12)));
/** How a field shows and reads a value of the request: as it is, in percent, or as 100 % minus it. */
const READING = {
  plain: { read: typed, show: (value) => value },
  percent: { read: (text) => fraction(text) ?? typed(text), show: (value) => (typeof value === "number" ? short(100 * value) : value) },
  confidence: {
    read: (text) => {
      const given = fraction(text);
      return given === null ? typed(text) : Number((1 - given).toPrecision(12));
    },
    show: (value) => (typeof value === "number" ? short(100 * (1 - value)) : value),
  },
};

const capital = (word) => word[0].toUpperCase() + word.slice(1);

const PERIODS = "problem.periods_per_year";
export const RATE = "problem.rate_per_step";
/** The choices of periods a year. */
export const CALENDARS = [["", "Choose one"], ["12", "12: months"], ["52", "52: weeks"], ["252", "252: trading days"], ["4", "4: quarters"], ["1", "1: years"], ["none", "None: other periods"]];

/** Returns `{elements, show(request), periods(count), trouble(), choices(), choose(choices)}`; `changed(path, value)` is called at every edit.
 * `periods` takes the periods a year from the dates of a record, or null. `trouble()` returns a missing choice as a refusal, or null.
 * `choices()` returns the choices that the request does not contain. */
export function trainFields(changed) {
  const readings = {};
  const field = (path, label, note, unit = "plain") => {
    readings[path] = READING[unit];
    const edited = (text) => changed(path, READING[unit].read(text));
    return input({ name: path, label, note, changed: edited, unit: unit === "plain" ? null : unit });
  };
  const investor = select({
    name: "investor",
    label: "Investor",
    note: investorNote,
    choices: [...investorChoices(), [OWN, "Own settings, for the quant"]],
    changed: (name) => {
      if (name === OWN) quant.open = true;
      else changed("problem.utility", { kind: "power", risk_aversion: INVESTORS[name] });
    },
  });
  const horizon = field("problem.horizon", "Periods ahead", "Until the money is needed: 1 to 520.");
  const known = () => Number(yearly.control.value) || null;
  const paid = () => {
    const value = bank.read(known());
    changed(RATE, value === undefined ? null : value);
  };
  const bank = bankRate({ name: RATE, note: "For example 0.25, or \u201c3 % a year\u201d.", changed: paid });
  const yearly = select({
    name: PERIODS,
    label: "Periods a year",
    note: "Yearly figures and the date of the next report depend on it.",
    choices: CALENDARS,
    changed: () => periods(known()),
  });
  const offer = (count) => {
    const value = String(count);
    if (![...yearly.control.options].some((option) => option.value === value)) yearly.control.append(h("option", { value }, `${value} periods`));
    yearly.control.value = value;
  };
  const periods = (count) => {
    if (count) offer(count);
    else if (yearly.control.value !== "none") yearly.control.value = "";
    changed(PERIODS, count);
    if (bank.isYearly()) paid();
  };
  const trouble = () => {
    if (yearly.element.hidden) return null;
    if (yearly.control.value === "") return { field: PERIODS, message: "The record has no dates that show it: choose how many periods make a year." };
    if (bank.isYearly() && bank.read(known()) === undefined) return { field: RATE, message: "A bank return per year needs the periods a year: choose them, or give the return per period." };
    return null;
  };
  const start = field("problem.initial_wealth", "Wealth at the start", "In any currency.");
  const cost = field("problem.trading_cost", "Trading cost, %", "Share of what is traded; 0 is free.", "percent");
  const flow = input({
    name: "problem.contributions",
    label: "Added each period",
    note: "At the end of the period; negative is a withdrawal. One number, or one for each period, separated by semicolons.",
    changed: (text) => changed("problem.contributions", amounts(text)),
  });
  const framework = select({
    name: "problem.framework",
    label: "Framework",
    note: "A cautious one guards against markets worse than the record; one that learns takes every new return into account.",
    choices: OFFERED,
    changed: (value) => changed("problem.framework", value),
  });
  const confidence = field("problem.radius.alpha", "Confidence, %", "More confidence guards against more. 90 % is usual.", "confidence");
  const caution = select({
    name: CAUTION,
    label: "Caution",
    note: "How much of the uncertainty about the record is guarded against.",
    choices: CAUTIONS,
    changed: (value) => changed(CAUTION, value),
  });
  const composition = select({
    name: COMPOSITION,
    label: "How the assets are mixed",
    note: "How the total held is split between the assets.",
    choices: COMPOSITIONS,
    changed: (value) => changed(COMPOSITION, value),
  });
  composition.element.classList.add("broad");
  const halfLife = input({
    name: HALF_LIFE,
    label: "Half-life of returns",
    note: "In periods: a return this old counts half. Blank: all count the same.",
    changed: (text) => {
      const half_life = typed(text);
      changed("problem.learning", half_life === null ? { kind: "equal" } : { kind: "decay", half_life });
    },
  });
  const kind = select({ name: "problem.utility.kind", label: "Utility", choices: UTILITIES, changed: (value) => changed("problem.utility", { ...UTILITY[value] }) });
  const paper = [
    kind,
    field("problem.radius.scale", "Radius, times", "A factor on all caution; 0 trusts the record."),
    field("problem.utility.risk_aversion", "Risk aversion", "Exponential: per unit of wealth. Power: above 1."),
    field(
      "problem.utility.risk_aversion_relative",
      "Relative risk aversion",
      "Divided by the initial wealth: 3 at a wealth of 100 is 0.03 per unit of wealth.",
    ),
    field("design.accuracy", "Accuracy", "Largest error of the value, in basis points. Design points are added until it is reached."),
    field("design.count", "Design points", "States solved per step: 10 to 10,000. With an accuracy this is the most."),
    field("seed", "Seed", "The same request and seed give the same policy."),
  ];
  const quant = h("details", {}, h("summary", {}, "For the quant"), fieldset("Utility and precision", paper));
  const parts = [horizon, start, cost, flow, framework, composition, confidence, caution, halfLife, ...paper];
  const show = (request) => {
    for (const part of parts) {
      const found = at(request, part.name);
      const value = found === undefined && part.name === HALF_LIFE && !request.problem?.assets ? "" : found;
      // The caution may be a share instead of a level.
      const share = part === caution ? value?.scale : undefined;
      if (share !== undefined) caution.control.append(h("option", { value: share }, `${short(100 * share)} % of what the confidence implies`));
      const shown = [share ?? value ?? ""].flat().map(readings[part.name]?.show ?? ((each) => each));
      if (part.control !== document.activeElement) part.control.value = shown.join("; ");
      part.element.hidden = value === undefined;
    }
    const a_year = at(request, PERIODS);
    yearly.element.hidden = a_year === undefined;
    if (a_year) offer(a_year);
    else if (yearly.control.value !== "none") yearly.control.value = "";
    for (const { element } of bank.parts) element.hidden = at(request, RATE) === undefined;
    const given = request.problem?.framework;
    if (given in FRAMEWORKS && !(given in OFFERED) && framework.control.value !== given) {
      framework.control.append(h("option", { value: given }, FRAMEWORKS[given]));
      framework.control.value = given;
    }
    investor.control.value = presetOf(request.problem?.utility ?? {}) ?? OWN;
    const unit = unitOf(request.problem?.periods_per_year);
    horizon.element.querySelector("label").textContent = `${capital(unit)}s ahead`;
    bank.named(unit);
    bank.show(at(request, RATE), a_year);
  };
  const elements = [
    fieldset("The investor", [investor, horizon, yearly, ...bank.parts, start, cost, flow]),
    fieldset("What to guard against", [framework, composition, confidence, caution, halfLife]),
    quant,
  ];
  const choices = () => ({ told: bank.per.control.value, periods: yearly.control.value });
  const choose = ({ told, periods }) => {
    bank.per.control.value = told;
    if (periods === "none") yearly.control.value = periods;
  };
  return { elements, show, periods, trouble, choices, choose };
}

/** Returns the default radius of a kind of policy. */
export function radiusFor(framework, radius) {
  const { alpha = 0.1 } = radius ?? {};
  return isParametric(framework) ? { rule: "chi_square", alpha } : { rule: "bridge", alpha, scale: 1 };
}
