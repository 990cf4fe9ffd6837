// Advice for the coming period from a record, as soon as the record is read: nothing is trained, and nothing is stored.
// The same record and settings can then train a policy that is followed for a client.

import { adviceView } from "./advice.js";
import { post } from "./api.js";
import { h, section, table } from "./dom.js";
import { ADVISING, draft, FOLLOWING, OPENING, PLANNING } from "./draft.js";
import { clear, fieldset, input, refusal, select, showProblem } from "./form.js";
import { allocation, percent } from "./format.js";
import { marketTerms, yearlyWords } from "./market_terms.js";
import { fraction, typed } from "./number_text.js";
import { unitOf } from "./periods.js";
import { returnsField } from "./returns_field.js";
import { severalAdvice } from "./several.js";
import { limitFields, limitWords } from "./share_limits.js";
import { investorChoices, investorNote, INVESTORS, warningList } from "./specification.js";
import { compact, initial, withRecord } from "./train.js";
import { CAUTIONS } from "./train_fields.js";
import { assumed } from "./worst_market.js";

/** Pause in typing before the advice is requested, in milliseconds. */
const PAUSE = 200;

export async function view(_, leaving) {
  const trail = h("p", { class: "trail" }, h("a", { href: "#/" }, "Overview"));
  return { title: "Advice now", trail, body: advising(leaving) };
}

/** Returns the form and the advice, which follows every change, after a note if it was filled in before. */
export function advising(leaving) {
  const kept = draft(ADVISING).read();
  // What was typed before, for fields that are only there once the record is read.
  let known = {};
  let [series, waiting, asking, shares] = [[], 0, new AbortController(), []];
  const answer = h("div", { class: "answered", role: "status" }, h("p", { class: "note" }, "The advice stands here as soon as there is a record."));
  const soon = () => {
    clearTimeout(waiting);
    waiting = setTimeout(ask, PAUSE);
  };
  const source = returnsField({
    name: "problem.history",
    label: "Returns or prices",
    example: { latest: 240 },
    several: true,
    changed: (read, reading) => {
      series = read;
      if (reading) take(reading);
      setTimeout(keep);
      soon();
    },
  });
  /** Takes over the periods a year, the bank's rate and the assets of a record. */
  const take = (reading) => {
    terms.take(reading);
    const names = series.length > 1 ? series.map(({ column }) => column) : [""];
    if (shares.map(({ column }) => column).join() !== names.join()) drawShares();
  };
  const terms = marketTerms(soon);
  const investor = select({ name: "investor", label: "Investor", note: investorNote, choices: investorChoices(), changed: soon });
  investor.control.value = "balanced";
  const caution = select({ name: "problem.caution", label: "Caution", note: "How much of the uncertainty about the record is guarded against.", choices: CAUTIONS, changed: soon });
  const wealth = input({ name: "wealth", label: "Wealth now", note: "In any currency.", value: "100000", changed: soon });
  const held = h("div", { class: "fields" });
  const limited = h("div", {});
  let limits = null;
  const drawShares = () => {
    const isSeveral = series.length > 1;
    const one = ({ column }, index) => ({ column, field: input({ within: `held-${index}-`, name: isSeveral ? `holdings.${column}` : "holding", label: isSeveral ? `${column} held now, %` : "Held now, %", note: "Of wealth. Blank: nothing.", unit: "percent", changed: soon }) });
    shares = (isSeveral ? series : [{ column: "" }]).map(one);
    held.replaceChildren(...shares.map(({ field }) => field.element));
    limits = isSeveral ? limitFields(series.map(({ column }) => column), soon) : null;
    limited.replaceChildren(...(limits ? [h("fieldset", {}, h("legend", {}, "Limits"), limits.element)] : []));
    fill();
  };
  const fields = () => [wealth, investor, caution, ...shares.map(({ field }) => field), ...(limits?.fields ?? [])];
  const fill = () => {
    for (const { name, control } of fields().filter(({ name }) => name in known)) control.value = known[name];
    if (limits?.fields.some(({ control }) => control.value !== "")) limits.element.open = true;
  };
  const content = () => ({ fields: Object.fromEntries(fields().map(({ name, control }) => [name, control.value])), terms: terms.keep(), record: source.typed() });
  const keep = () => {
    if (leaving.aborted) return;
    if (JSON.stringify(content()) === untouched) draft(ADVISING).drop();
    else draft(ADVISING).keep(content());
  };
  /** Returns the training request with the record and the settings; `{field, message}` is thrown if one is missing. */
  const compose = () => {
    const rate = terms.rate();
    const request = initial();
    Object.assign(request.problem, { rate_per_step: rate, periods_per_year: terms.periods(), initial_wealth: typed(wealth.control.value) ?? 100, caution: caution.control.value });
    request.problem.utility = { kind: "power", risk_aversion: INVESTORS[investor.control.value] };
    withRecord(request, series);
    request.problem.limits = limits?.limits();
    return request;
  };
  const ask = async () => {
    asking.abort();
    if (series.length === 0) return answer.replaceChildren(h("p", { class: "note" }, "The advice stands here as soon as there is a record."));
    asking = new AbortController();
    const { signal } = asking;
    clear(form);
    try {
      const request = compose();
      const { problem, seed } = request;
      const part = ({ field }) => (field.control.value.trim() === "" ? 0 : (fraction(field.control.value) ?? field.control.value.trim()));
      const holds = problem.assets ? { holdings: Object.fromEntries(shares.map((one) => [one.column, part(one)])) } : { holding: part(shares[0]) };
      const advice = await post("/advise", { problem: { ...problem, horizon: 1 }, wealth: problem.initial_wealth, ...holds, seed }, signal);
      answer.replaceChildren(...advised(advice, request, holds), followed(request, holds));
    } catch (error) {
      if (error.name === "AbortError") return;
      const at = document.activeElement;
      showProblem(form, message, error);
      answer.replaceChildren(h("p", { class: "note" }, `No advice yet. ${form.querySelector(".error:not([hidden])")?.textContent ?? error.message}`));
      // Who types elsewhere stays there.
      if (form.contains(at)) at.focus();
    }
  };
  /** Returns what leads from the advice to a policy and a session of it. */
  const followed = (request, holds) => {
    const keep = () => {
      draft(FOLLOWING).keep({ json: compact(request), record: source.typed(), choices: terms.choices() });
      draft(OPENING).keep({ wealth: wealth.control.value, ...Object.fromEntries(shares.map(({ field }) => [field.name, field.control.value])) });
    };
    const plan = () => draft(PLANNING).keep({ from: "advice", fields: { "problem.initial_wealth": wealth.control.value, investor: investor.control.value, "problem.caution": caution.control.value }, terms: terms.keep(), record: source.typed() });
    const ahead = request.problem.assets ? "" : h("a", { class: "button quiet", href: PLANNING, onclick: plan }, "Plan for years");
    return h("p", { class: "send" }, h("a", { class: "button", href: FOLLOWING, onclick: keep }, "Follow this for a client"), ahead, h("span", { class: "note" }, "Trains a policy on this record, then opens a session that learns from every new return."));
  };
  const message = refusal();
  const form = h("form", { class: "advising", novalidate: true, onsubmit: (event) => event.preventDefault() },
    h("fieldset", {}, h("legend", {}, "The returns seen so far"), source.element),
    answer,
    fieldset("The investor", [wealth, held, ...terms.parts, investor, caution]), limited, message);
  const typing = () => {
    known = {};
    setTimeout(keep);
  };
  for (const happened of ["input", "change"]) form.addEventListener(happened, typing);
  drawShares();
  const untouched = JSON.stringify(content());
  leaving.addEventListener("abort", () => (asking.abort(), clearTimeout(waiting)));
  if (kept) {
    known = kept.fields;
    fill();
    terms.restore(kept.terms);
    source.restore(kept.record);
  }
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  return [kept ? draft(ADVISING).note(again) : "", form];
}

/** Returns the sections of an advice. */
function advised(advice, { problem }, holds) {
  const unit = unitOf(problem.periods_per_year);
  const place = { heading: `The coming ${unit}`, end: `at the end of the ${unit}`, cautious: true, price: null, prices: {}, cost: problem.trading_cost, wealth: problem.initial_wealth };
  const doubts = warningList(advice.warnings, problem);
  const yearly = yearlyWords(advice, problem.assets ? ", for a mix of the assets by their volatility" : "");
  if (problem.assets) return [severalAdvice({ ...advice, ...holds, contribution: 0 }, place, problem.assets, [limitWords(problem.limits, advice), yearly, ...doubts]), levels(advice)];
  const worst = advice.worst_case.transport.length > 0 && advice.allocation > 0 ? h("p", { class: "sentence" }, `The worst case that the record allows sets it. ${assumed(advice.worst_case, unit)}`) : "";
  return [adviceView(advice, place, [nothingWords(advice, unit), worst, yearly, ...doubts]).element, levels(advice)];
}

/** Says why nothing is held, if nothing is. */
function nothingWords({ why_nothing: why }, unit) {
  if (!why) return "";
  const half = why.at_half_the_caution > 0 ? ` With half the caution it would be ${allocation(why.at_half_the_caution)}.` : "";
  return h("p", { class: "sentence" }, `The record paid ${percent(why.premium_seen, 2)} a ${unit} beyond the bank, with a standard error of ${percent(why.standard_error, 2)}: too little to be sure of.${half}`);
}

/** Shows what each level of caution would hold. */
function levels({ levels: found }) {
  if (!found) return "";
  const named = (level) => CAUTIONS[level].split(":")[0];
  const rows = found.levels.filter(({ allocation }) => allocation !== null && allocation !== undefined);
  return section("With more or less caution", table("What each level of caution would hold", [
    { name: "Caution", cell: ({ level }) => (level === found.followed ? h("b", {}, `${named(level)}, chosen`) : named(level)) },
    { name: "To hold", numeric: true, cell: ({ allocation: share }) => allocation(share) },
  ], rows));
}
