// How much of a strategy: the share of the capital that its record supports, beside the Kelly share, which takes the record
// as the truth. Nothing is trained and nothing is stored.

import { post } from "./api.js";
import { announce, h } from "./dom.js";
import { draft, SIZING } from "./draft.js";
import { fieldset, refusal, select, sending } from "./form.js";
import { marketTerms } from "./market_terms.js";
import { returnsField } from "./returns_field.js";
import { sleeveView } from "./sleeve_answer.js";
import { withRecord } from "./train.js";
import { CAUTIONS } from "./train_fields.js";

const UNITS = { periods: "The return of a period", trades: "The outcome of a trade" };
const LEAD = "Give the record of a strategy, or of several: returns, or the profit or loss of each trade as a share of its stake. The answer says how much of the capital it supports, and what would refute that.";

export async function view(_, leaving) {
  const trail = h("p", { class: "trail" }, h("a", { href: "#/" }, "Overview"), " \u203a How much of a strategy");
  return { title: "How much of this strategy?", trail, body: sizing(leaving) };
}

/** Returns the introduction, the form and the place of the answer. */
function sizing(leaving) {
  const kept = draft(SIZING).read();
  let series = [];
  const source = returnsField({
    name: "problem.history",
    label: "Returns, prices or trades",
    example: { latest: 240 },
    several: true,
    changed: (read, reading) => {
      series = read;
      if (reading) terms.take(reading);
      setTimeout(keep);
    },
  });
  const terms = marketTerms(() => {});
  const market = h("div", { class: "fields" }, terms.parts.map((part) => part.element ?? part));
  const isTrades = () => unit.control.value === "trades";
  const showTerms = () => (market.hidden = isTrades());
  const unit = select({ name: "record_of", label: "Each value is", note: "A trade earns nothing in the bank, and each is as a share of its stake.", choices: UNITS, changed: showTerms });
  const caution = select({ name: "problem.caution", label: "Caution", note: "How much of the uncertainty about the record is guarded against.", choices: CAUTIONS });
  // The question is what the record supports, so the whole doubt counts unless another level is chosen.
  caution.control.value = "paper";
  const message = refusal();
  const send = h("button", { type: "submit" }, "Size the strategy");
  const status = h("span", { class: "note" }, "Takes a moment; some seconds for several strategies. Nothing is stored.");
  const answer = h("div", { class: "sized" });
  const form = h(
    "form",
    { novalidate: true },
    h("fieldset", {}, h("legend", {}, "The record"), source.element),
    fieldset("The capital", [unit, market, caution]),
    message,
    h("p", { class: "send" }, send, status),
  );
  const ask = async () => {
    answer.replaceChildren();
    const trouble = await source.trouble();
    if (trouble) throw { field: "problem.history", message: trouble };
    const known = isTrades() ? { rate_per_step: 0 } : { rate_per_step: terms.rate(), periods_per_year: terms.periods() ?? undefined };
    const request = { problem: { ...known, caution: caution.control.value }, record_of: unit.control.value, seed: 1 };
    withRecord(request, series);
    delete request.problem.composition;
    const found = await post("/sleeve", request, leaving);
    answer.replaceChildren(...sleeveView(found, request));
    announce("The strategy is sized.");
    answer.querySelector("#sleeve").focus({ preventScroll: true });
    answer.scrollIntoView();
  };
  sending(form, send, () => ask().catch((error) => leaving.aborted || Promise.reject(error)));
  const content = () => ({ fields: { unit: unit.control.value, caution: caution.control.value }, terms: terms.keep(), record: source.typed() });
  const untouched = JSON.stringify(content());
  const keep = () => {
    if (leaving.aborted) return;
    if (JSON.stringify(content()) === untouched) draft(SIZING).drop();
    else draft(SIZING).keep(content());
  };
  for (const happened of ["input", "change"]) form.addEventListener(happened, () => setTimeout(keep));
  if (kept) {
    unit.control.value = kept.fields.unit;
    caution.control.value = kept.fields.caution;
    terms.restore(kept.terms);
    source.restore(kept.record);
    showTerms();
  }
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  return [h("p", { class: "lead asked-for" }, LEAD), kept ? draft(SIZING).note(again) : "", form, answer];
}
