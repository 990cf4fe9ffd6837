// The form that requests a backtest of a history, on a page of its own.

import { post } from "./api.js";
import { bankRate } from "./bank_rate.js";
import { announce, h } from "./dom.js";
import { fieldset, input, refusal, select, sending } from "./form.js";
import { fraction, typed } from "./number_text.js";
import { OWN_FIELD, ownFormula } from "./own_formula.js";
import { unitOf } from "./periods.js";
import { byDate, returnsField } from "./returns_field.js";
import { INVESTORS, investorChoices, investorNote, meant } from "./specification.js";
import { CAUTIONS } from "./train_fields.js";

/** Reads the windows of several assets: numbers of periods, or "all". */
const windowsOf = (text) => text.split(";").map((part) => (part.trim() === "all" ? null : typed(part.trim())));
const OWN = "own";
/** Strategies of several assets that are compared with the rules that people use, as the request names them. */
const FAMILIES = { one_step: "The one-step rule", policy: "The trained policy of a session", "policy,one_step": "Both" };
/** Twenty years for the first training, and ten to backtest. */
const EXAMPLE = { latest: 360 };

export async function view() {
  const trail = h("p", { class: "trail" }, h("a", { href: "#/evaluations" }, "Evaluations"));
  const lead = "A backtest goes through a record of returns: again and again, policies are trained on the years before and then followed. No holding uses later returns.";
  return { title: "Backtest a record", trail, body: [h("p", { class: "lead" }, lead), asking()] };
}

function asking() {
  let record = null;
  const source = returnsField({
    name: "log_returns",
    label: "Returns or prices",
    example: EXAMPLE,
    several: true,
    changed: (_, answer) => {
      record = answer;
      shown();
    },
  });
  const percentField = (name, label, note, value) => input({ name, label, note, value, unit: "percent" });
  const bank = bankRate({ name: "rate", note: "The same in every period." });
  const { rate } = bank;
  const yearly = input({ name: "periods_per_year", label: "Periods a year", note: "12 for monthly returns. The record has no dates that show it." });
  const cost = percentField("trading_cost", "Trading cost, %", "Share of what is traded; 0 is free.", "0.1");
  const investor = select({
    name: "investor",
    label: "Investor",
    note: investorNote,
    choices: [...investorChoices(), [OWN, "By risk aversion"]],
    changed: () => (aversion.element.hidden = investor.control.value !== OWN),
  });
  investor.control.value = "balanced";
  const aversion = input({ name: "risk_aversion", label: "Risk aversion", note: "Relative risk aversion, 1 to 100.", value: "3" });
  aversion.element.hidden = true;
  const caution = select({ name: "caution", label: "Caution", note: "As in an advice. Found again for every training.", choices: CAUTIONS });
  caution.control.value = "balanced";
  const families = select({
    name: "strategies",
    label: "Strategies",
    note: "Compared with rules that people use. A policy takes several times as long as the one-step rule.",
    choices: FAMILIES,
    changed: () => shown(),
  });
  const window = input({ name: "window", label: "Window", note: "Periods that a policy is trained on. Blank: 20 years, or half of a shorter record." });
  const every = input({ name: "every", label: "Train every", note: "Number of periods. Blank: a year." });
  const horizon = input({ name: "horizon", label: "Periods ahead", note: "Number of periods. Blank: until the next training." });
  const levels = input({ name: "alpha", label: "Confidence, %", note: "One to three, separated by semicolons. The report says most about the second.", value: "90", unit: "confidence" });
  const points = input({ name: "count", label: "Design points", note: "10 to 10,000. More is more precise and slower.", value: "100" });
  const seed = input({ name: "seed", label: "Seed", value: "1" });
  const blind = select({ name: "cost_blind", label: "Policies take the trading cost into account", choices: { false: "Yes", true: "No" } });
  const own = ownFormula("A share of wealth from the returns before each period, or of each asset from its own.");
  const isSeveral = () => (record?.series.length ?? 0) > 1;
  const isTrained = () => !isSeveral() || families.control.value.includes("policy");
  const shown = () => {
    families.element.hidden = !isSeveral();
    for (const { element } of [blind, caution]) element.hidden = isSeveral();
    for (const { element } of [horizon, points]) element.hidden = !isTrained();
    const asked = isSeveral()
      ? { window: ["Windows", "Number of periods, or \u201call\u201d; separate several by semicolons. Blank: 10 years, 20 years and all, as far as the record allows."], alpha: ["Confidence, %", "One level."] }
      : { window: ["Window", "Periods that a policy is trained on. Blank: 20 years, or half of a shorter record."], alpha: ["Confidence, %", "One to three, separated by semicolons. The report says most about the second."] };
    for (const field of [window, levels]) {
      const [label, note] = asked[field.name];
      field.element.querySelector("label").textContent = label;
      field.element.querySelector(".note").textContent = note;
    }
    const unit = unitOf(record?.periods_per_year);
    bank.named(unit);
    rate.element.querySelector(".note").textContent = record?.rate ? `Blank: the rates in the column ${record.rate.column}, ${unit} by ${unit}.` : "The same in every period, such as 0.25, or \u201c3 % a year\u201d.";
    yearly.element.hidden = record === null || Boolean(record.periods_per_year);
  };
  shown();
  const send = h("button", { type: "submit" }, "Backtest");
  const more = h("details", {}, h("summary", {}, "How the backtest works, and for the quant"), fieldset("How the backtest works", [families, own.field, window, every, horizon, levels, blind, points, seed]));
  const form = h(
    "form",
    { novalidate: true },
    h("fieldset", {}, h("legend", {}, "The record"), source.element),
    fieldset("The investor", [investor, aversion, caution, yearly, ...bank.parts, cost]),
    more,
    refusal(),
    h("p", { class: "send" }, send, h("span", { class: "note" }, "Runs in the background. Ten years of monthly returns take a minute or two.")),
  );
  const text = ({ control }) => control.value.trim();
  const a_year = () => record.periods_per_year ?? typed(text(yearly));
  const compose = () => {
    const { series, dates } = record;
    const request = isSeveral()
      ? { assets: series.map(({ column }) => column), log_returns: byDate(series), dates }
      : { log_returns: series[0].log_returns, dates };
    request.rate = bank.read(a_year()) ?? record.rate?.rates;
    request.risk_aversion = investor.control.value === OWN ? typed(text(aversion)) : INVESTORS[investor.control.value];
    request.trading_cost = fraction(text(cost)) ?? text(cost);
    request.alpha = text(levels).split(";").map((part) => (fraction(part) === null ? part : Number((1 - fraction(part)).toPrecision(12))));
    if (isSeveral()) {
      if (request.alpha.length === 1) [request.alpha] = request.alpha;
      if (text(window) !== "") request.windows = windowsOf(text(window));
      request.strategies = families.control.value.split(",");
    } else {
      Object.assign(request, { cost_blind: blind.control.value === "true", caution: caution.control.value });
      // As a policy has it, unless the whole radius is used.
      if (caution.control.value !== "paper") request.support = { rule: "worst_seen" };
    }
    Object.assign(request, own.weights());
    if (!yearly.element.hidden) request.periods_per_year = typed(text(yearly));
    for (const field of [...(isSeveral() ? [] : [window]), every, ...(isTrained() ? [horizon, points] : []), seed]) if (text(field) !== "") request[field.name] = typed(text(field));
    return request;
  };
  const ask = async () => {
    const trouble = await source.trouble();
    if (trouble) throw { field: "log_returns", message: trouble };
    if (text(rate) === "" && !record.rate) throw { field: "rate", message: "The bank return is missing: type a number here, or give a column of the record." };
    if (bank.read(a_year()) === undefined) throw { field: yearly.name, message: "A bank return per year needs the periods a year: type how many." };
    const request = compose();
    const { job, warnings } = await post("/backtest", request);
    announce("The backtest is queued.");
    const problem = { ...request, rate_per_step: request.rate, periods_per_year: a_year() };
    meant(form, { noun: "backtest", job, warnings, problem }, () => (location.hash = `#/backtests/${job}`));
  };
  sending(form, send, ask, { told: (error) => (error.field = { windows: window.name, [OWN_FIELD]: own.field.name }[error.field] ?? error.field) });
  return form;
}
