// A plan for years: what to spend and what to hold, how likely it lasts, and what must be true for that.
// Nothing is trained and nothing is stored, until the plan is followed.

import { post } from "./api.js";
import { announce, h } from "./dom.js";
import { draft, OPENING, PLANNING } from "./draft.js";
import { currencyField } from "./firm.js";
import { fieldset, input, pressed, refusal, select, sending } from "./form.js";
import { count } from "./format.js";
import { marketTerms } from "./market_terms.js";
import { fraction, typed } from "./number_text.js";
import { unitOf } from "./periods.js";
import { planView } from "./plan_answer.js";
import { returnsField } from "./returns_field.js";
import { investorChoices, investorNote, INVESTORS, meant } from "./specification.js";
import { CAUTIONS } from "./train_fields.js";

/** Most periods of a plan. */
const MOST = 520;
/** Simulated paths, and the seed of their returns. */
const [PATHS, SEED] = [4000, 1];
/** The least weight of what is left at the end, which the service accepts in place of none. */
const LEAST = 1e-6;
const [HORIZON, INFLATION, BEQUEST] = ["problem.horizon", "problem.spending.inflation", "problem.spending.bequest"];
const SECURED = ["problem.spending.secured", "problem.spending.secured_left"];
const AIMS = { spending: "Spending through the years", goal: "The wealth wanted at the end" };

export async function view(_, leaving) {
  const trail = h("p", { class: "trail" }, h("a", { href: "#/" }, "Overview"), " \u203a Plan for years");
  return { title: "Will it last, and how much may I spend?", trail, body: planning(leaving) };
}

/** Returns the introduction, the form and the place of the answer. */
function planning(leaving) {
  const kept = draft(PLANNING).read();
  let series = [];
  const source = returnsField({
    name: "problem.history",
    label: "Returns or prices",
    example: { latest: 240 },
    changed: (read, reading) => {
      series = read;
      if (reading) terms.take(reading);
      tellPeriods();
      setTimeout(keep);
    },
  });
  const terms = marketTerms(() => tellPeriods());
  const fields = planFields(() => tellPeriods());
  const tellPeriods = () => fields.tell(terms.periods());
  const message = refusal();
  const send = h("button", { type: "submit" }, "Make the plan");
  const status = h("span", { class: "note" }, "Takes some seconds, up to half a minute with an aim or a limit. Nothing is stored.");
  const answer = h("div", { class: "planned" });
  let shown = null;
  const show = () => shown && answer.replaceChildren(...planView(...shown));
  const more = h("details", {}, h("summary", {}, "More: caution and the investor"), fieldset("What to guard against", [...fields.more, currencyField(show)]));
  const form = h(
    "form",
    { novalidate: true },
    h("fieldset", {}, h("legend", {}, "The returns seen so far"), source.element),
    fieldset("The money and the years", [...fields.main, ...terms.parts]),
    more,
    message,
    h("p", { class: "send" }, send, status),
  );
  const ask = async () => {
    answer.replaceChildren();
    shown = null;
    const trouble = await source.trouble();
    if (trouble) throw { field: "problem.history", message: trouble };
    const rate = terms.rate();
    const question = fields.question(terms.periods(), { rate_per_step: rate, history: series[0].log_returns });
    const words = status.textContent;
    status.textContent = `Planning ${count(question.problem.horizon)} ${unitOf(terms.periods())}s on ${count(PATHS)} paths\u2026`;
    try {
      const plan = await post("/plan", question, leaving).catch((error) => Promise.reject(fields.worded(error)));
      shown = [plan, question, following(question)];
      show();
      announce("The plan is made.");
      answer.querySelector("#plan").focus({ preventScroll: true });
      answer.scrollIntoView();
    } finally {
      status.textContent = words;
    }
  };
  sending(form, send, () => ask().catch((error) => leaving.aborted || Promise.reject(error)));
  const content = () => ({ fields: fields.keep(), terms: terms.keep(), record: source.typed() });
  const untouched = JSON.stringify(content());
  const keep = () => {
    if (leaving.aborted) return;
    if (JSON.stringify(content()) === untouched) draft(PLANNING).drop();
    else draft(PLANNING).keep(content());
  };
  for (const happened of ["input", "change"]) form.addEventListener(happened, () => setTimeout(keep));
  if (kept) {
    fields.restore(kept.fields);
    terms.restore(kept.terms);
    source.restore(kept.record);
  }
  tellPeriods();
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  const lead = kept?.from ? "The record and the settings are those of the advice. Say how many years, and what is wanted." : LEAD;
  return [h("p", { class: "lead asked-for" }, lead), kept && !kept.from ? draft(PLANNING).note(again) : "", form, answer];
}

const LEAD = "Give the returns of what you hold, your wealth and the years ahead. The answer says what to spend and what to hold, how likely it lasts, and what must be true for that.";

/** Returns `{main, more, tell(periods), question(periods, market), worded(error), keep(), restore(kept)}`: the fields of a plan. `tell` says how many periods the
 * years are, `question` gives the request, with what is meant for a year counted per period. */
function planFields(changed) {
  const wealth = input({ name: "problem.initial_wealth", label: "Wealth now", note: "In any currency.", value: "100000" });
  const years = input({ name: HORIZON, label: "Years", note: " ", value: "30", changed });
  const wanted = input({ name: "wanted", label: "Amount wanted a year", note: "In money of now. Blank: what the plan spends first." });
  const goal = input({ name: "goal", label: "Wealth wanted at the end", note: "In money of now. Blank: none." });
  const aim = select({ name: "aim", label: "The plan aims at", note: "With the wealth at the end as its aim, a plan spends the amount wanted and makes what is missing on average least.", choices: AIMS });
  const saved = input({ name: "saved", label: "Put in a year", note: "Until the end, in money of now, if the plan aims at the wealth there. Blank: nothing." });
  const limit = input({ name: "drawdown_limit", label: "Greatest fall, %", note: "Of money that stays invested, below its highest value so far. Blank: any.", unit: "percent" });
  const fallen = input({ name: "drawdown", label: "Fallen by now, %", note: "How far it is below its highest value today, if the greatest fall is limited.", unit: "percent", value: "0" });
  const prices = input({ name: INFLATION, label: "Prices rise a year, %", note: "Assumed until you change it.", unit: "percent", value: "2" });
  const left = input({ name: BEQUEST, label: "Years of spending at the end", note: "What is left counts as so many; 0 if nothing need be left.", value: "1" });
  const [secured, securedLeft] = [
    input({ name: SECURED[0], label: "Secured a year", note: "Spent whatever returns do, in money of now. The bank holds what pays for it. Blank: nothing." }),
    input({ name: SECURED[1], label: "Secured at the end", note: "Left whatever returns do, in money of now. Blank: nothing." }),
  ];
  const caution = select({ name: "problem.caution", label: "Caution", note: "How much of the uncertainty about the record is guarded against.", choices: CAUTIONS });
  const investor = select({ name: "investor", label: "Investor", note: investorNote, choices: investorChoices() });
  investor.control.value = "balanced";
  const certainty = input({ name: "certainty", label: "Certainty, %", note: "How sure an amount is to last, 50 to 99.9.", unit: "percent", value: "90" });
  const [main, more] = [[wealth, years, wanted, goal, aim, saved, limit, secured, securedLeft, prices, left], [caution, investor, certainty, fallen]];
  const note = years.element.querySelector(".note");
  const tell = (periods) => {
    const horizon = Math.round(typed(years.control.value) * periods);
    note.textContent = periods && horizon > 0 ? `${count(horizon)} ${unitOf(periods)}s; at most ${longest(periods)} years.` : `At most ${MOST} periods.`;
  };
  const value = ({ control }) => typed(control.value);
  const share = ({ control }) => fraction(control.value) ?? value({ control });
  const question = (periods, market) => {
    const isAimed = aim.control.value === "goal";
    const spending = { inflation: perPeriod(bounded(prices, share, -1), periods), ...(isAimed ? {} : { bequest: weight(bounded(left, value, null), periods) }) };
    const floor = bounded(secured, value, null);
    const floors = { secured: typeof floor === "number" ? floor / periods : floor, secured_left: bounded(securedLeft, value, null) };
    Object.assign(spending, given(floors));
    const utility = { kind: "power", risk_aversion: INVESTORS[investor.control.value] };
    const problem = { ...market, periods_per_year: periods, horizon: horizonOf(years, periods), initial_wealth: value(wealth), utility, caution: caution.control.value, spending };
    const amount = bounded(wanted, value, 0);
    const added = bounded(saved, value, 0);
    const each = (yearly) => (typeof yearly === "number" ? yearly / periods : yearly);
    const optional = { wanted: each(amount), goal: value(goal), saved: each(added) };
    if (isAimed) optional.aim = "goal";
    const most = share(limit);
    const limits = most === null ? {} : { drawdown_limit: most, drawdown: share(fallen) };
    return { problem, ...given(optional), ...limits, certainty: share(certainty), paths: PATHS, seed: SEED };
  };
  /** Returns a refusal in the unit that was typed. */
  const worded = (error) => {
    if (error.field !== SECURED[0]) return error;
    return { field: error.field, message: `Secured a year is ${secured.control.value.trim()}; the wealth, left in the bank, does not pay for so much.` };
  };
  const all = [...main, ...more];
  const keep = () => Object.fromEntries(all.map(({ name, control }) => [name, control.value]));
  const restore = (kept) => all.filter(({ name }) => name in kept).forEach(({ name, control }) => (control.value = kept[name]));
  return { main, more, tell, question, worded, keep, restore };
}

/** Returns the entries that are not blank. */
const given = (entries) => Object.fromEntries(Object.entries(entries).filter(([, value]) => value !== null));

/** Returns the value of a field, which must be above `least`, or at least 0 if that is null. */
function bounded(field, read, least) {
  const value = read(field);
  const isLess = least === null ? value < 0 : value <= least;
  if (typeof value === "number" && isLess) throw { field: field.name, value, rule: least === null ? "must be 0 or more" : least === 0 ? "must be above 0" : "must be above \u2212100\u202f%" };
  return value;
}

const perPeriod = (yearly, periods) => (typeof yearly === "number" ? Number(Math.expm1(Math.log1p(yearly) / periods).toPrecision(12)) : yearly);
const weight = (years, periods) => (typeof years === "number" ? Math.max(LEAST, years * periods) : years);

/** Returns the most years of a plan, to a tenth. */
const longest = (periods) => Math.floor((10 * MOST) / periods) / 10;

/** Returns the periods of the years that are typed. */
function horizonOf({ name, control }, periods) {
  const years = typed(control.value);
  if (typeof years !== "number") return years;
  const horizon = Math.round(years * periods);
  if (horizon >= 1 && horizon <= MOST) return horizon;
  const unit = unitOf(periods);
  const words = horizon < 1 ? `it must be at least one ${unit}` : `a plan looks at most ${MOST} ${unit}s ahead, which is ${longest(periods)} years`;
  throw { field: name, message: `Years is ${control.value.trim()}; ${words}.` };
}

/** Returns what leads from a plan to a policy that keeps to it, and to a session of that. */
function following({ problem, aim, drawdown_limit }) {
  // What such a plan holds depends on wealth, or on how far it has fallen, so no policy of a session keeps to it.
  if (aim || drawdown_limit) return h("p", { class: "note asked-for" }, "To follow this plan, make it again each period with the wealth and the years left by then.");
  const start = h("button", { type: "button", "data-needs": "train" }, "Follow this plan");
  const line = h("p", { class: "send" }, start, h("span", { class: "note" }, "Trains a policy that keeps to this plan, then opens a session that says what to spend and hold each period."));
  const place = h("div", { class: "asked-for" }, line);
  const follow = async () => {
    const request = { problem: { ...problem, framework: "static" }, seed: SEED };
    const { job, warnings } = await post("/train", request);
    draft(OPENING).keep({ wealth: String(problem.initial_wealth) });
    announce(`Training ${job} is queued.`);
    meant(place, { noun: "training", job, warnings, problem }, () => (location.hash = `#/jobs?follow=${job}`));
  };
  start.addEventListener("click", () => pressed(start, follow));
  return place;
}
