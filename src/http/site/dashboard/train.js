// A training request, from a form, a file of returns or JSON; all three show the same request.

import { get, post } from "./api.js";
import { announce, h } from "./dom.js";
import { draft } from "./draft.js";
import { fieldset, refusal, sending } from "./form.js";
import { labelFields, policyLink } from "./naming.js";
import { byDate, returnsField } from "./returns_field.js";
import { hasBall, investorsOnly, meant } from "./specification.js";
import { put, radiusFor, RATE, trainFields, UTILITY } from "./train_fields.js";

/** The form's initial request; null fields are to be filled in or may be left out. */
export const initial = () => ({
  problem: {
    framework: "adaptive",
    horizon: 12,
    rate_per_step: null,
    periods_per_year: null,
    initial_wealth: 100,
    trading_cost: 0,
    contributions: 0,
    utility: { ...UTILITY.power },
    radius: { rule: "bridge", alpha: 0.1, scale: 1 },
    caution: "balanced",
    history: [],
  },
  design: { count: 500 },
  seed: 1,
});

/** Paths whose change alters which fields are shown, or their labels. */
const REDRAWN = ["problem.framework", "problem.periods_per_year"];

/** Returns the request that trained a policy; for several assets with their names. */
export function requestOf(specification) {
  const { levels, ...asked } = specification.problem;
  if (!specification.fund) return structuredClone({ ...specification, problem: asked });
  const { radius_factor, ...named } = specification.fund;
  const { framework, learning, centre, radius, ...problem } = asked;
  const scale = radius.scale === undefined ? {} : { scale: Number((radius.scale / radius_factor).toPrecision(12)) };
  const { accuracy, count } = specification.design;
  return structuredClone({ problem: { ...problem, ...named, radius: { ...radius, ...scale } }, design: { accuracy, count }, seed: specification.seed });
}

/** Puts returns into a training request; several columns are assets with the columns' names. Without a reading there are none. */
export function withRecord({ problem }, series) {
  problem.history = [];
  if (series.length === 0) return;
  if (series.length === 1) {
    problem.history = series[0].log_returns;
    if (!problem.assets) return;
    for (const name of ["assets", "composition", "ground_norm"]) delete problem[name];
    problem.framework = "adaptive";
    return;
  }
  problem.assets = series.map(({ column }) => column);
  problem.history = byDate(series);
  for (const name of ["framework", "learning", "centre"]) delete problem[name];
  problem.composition ??= "one_step";
  if (problem.radius?.rule === "chi_square") problem.radius = radiusFor("adaptive", problem.radius);
}

/** `query`: `from=POLICY` fills the form with the request that trained the policy, and so does `newer=POLICY`, for newer returns. `follow` goes
 * on with the record and the settings of an advice, which are kept as a draft. */
export async function view(query, leaving) {
  const asked = new URLSearchParams(query ?? "");
  const origin = asked.get("from") ?? asked.get("newer");
  const isFollowing = asked.has("follow");
  const drafts = draft(`#/train?${query ?? ""}`);
  const kept = drafts.read();
  const { specification } = origin ? await get(`/policies/${origin}`, leaving) : {};
  if (specification) investorsOnly(specification);
  let request = origin ? requestOf(specification) : initial();
  const json = h("textarea", { id: "json", rows: 18, spellcheck: "false", "aria-describedby": "json-note json-error" });
  const jsonError = h("p", { id: "json-error", class: "error", hidden: true });
  // Whether the periods a year in the form come from the dates of a record, and the bank's rate that comes from a column of it.
  let [isOfDates, ofColumn] = [false, null];
  const source = returnsField({
    name: "problem.history",
    label: "Returns or prices",
    example: { latest: 240 },
    several: true,
    changed: (series, answer) => {
      withRecord(request, series);
      if (answer) take(answer);
      fields.show(request);
      written();
    },
    bank: (rate) => {
      fillRate(rate);
      fields.show(request);
      written();
    },
  });
  const fillRate = (rate) => {
    put(request, RATE, rate);
    ofColumn = rate;
  };
  /** Takes over the periods a year of a record, and empties what an earlier record filled in and this one does not say. */
  const take = ({ periods_per_year, rate }) => {
    if (ofColumn !== null && rate?.rates.at(-1) !== ofColumn) {
      fillRate(null);
      fields.show(request);
    }
    const filled = ofColumn;
    fields.periods(periods_per_year ?? (isOfDates ? null : request.problem.periods_per_year));
    [isOfDates, ofColumn] = [Boolean(periods_per_year), filled];
  };
  const fields = trainFields((path, value) => {
    put(request, path, value);
    if (path === RATE) ofColumn = null;
    if (path === "problem.framework") {
      request.problem.radius = radiusFor(value, request.problem.radius);
      request.problem.caution = hasBall({ framework: value }) ? (request.problem.caution ?? "balanced") : undefined;
    }
    if (REDRAWN.includes(path) || path.startsWith("problem.utility")) fields.show(request);
    written();
  });
  const labels = labelFields({
    changed: () => {
      const { name, notes, tags } = labels.read();
      Object.assign(request, { name, notes, tags });
      written();
    },
  });
  const written = () => {
    json.value = compact(request);
    jsonError.hidden = true;
    keep();
  };
  let untouched = null;
  const keep = () => {
    const content = { json: json.value, record: source.typed(), choices: fields.choices() };
    if (untouched === null) return;
    if (JSON.stringify(content) === untouched) drafts.drop();
    else drafts.keep(content);
  };
  const restore = ({ json: text, record, choices }) => {
    json.value = text;
    try {
      request = JSON.parse(text);
    } catch {
      // The JSON was left half edited.
      advanced.open = true;
    }
    fields.choose(choices);
    fields.show(request);
    labels.show(request);
    source.restore(record);
  };
  const showRecord = () => source.show([request.problem?.history ?? []].flat(), request.problem?.assets);
  json.addEventListener("input", () => {
    keep();
    try {
      request = JSON.parse(json.value);
      jsonError.hidden = true;
      fields.show(request);
      labels.show(request);
      showRecord();
    } catch (error) {
      jsonError.textContent = error.message;
      jsonError.hidden = false;
    }
  });
  const advanced = h(
    "details",
    { class: "advanced" },
    h("summary", {}, "Every field, as JSON"),
    h(
      "p",
      { class: "note", id: "json-note" },
      "The request as it will be sent. Edits here change the form, and edits of the form change the request. See ",
      h("a", { href: "/docs" }, "the API description"),
      " for every field.",
    ),
    h("label", { for: "json", class: "unseen" }, "Training request as JSON"),
    json,
    jsonError,
  );
  const send = h("button", { type: "submit" }, "Train");
  const form = h(
    "form",
    { novalidate: true },
    h("fieldset", {}, h("legend", {}, "The returns seen so far"), source.element),
    fields.elements,
    fieldset("Labels", labels.parts),
    advanced,
    refusal(),
    h(
      "p",
      { class: "send" },
      send,
      h("span", { class: "note" }, "Trains in the background; the job list shows the progress. What you type here is kept while this tab is open."),
    ),
  );
  const ask = async () => {
    const trouble = await source.trouble();
    if (trouble) throw { field: "problem.history", message: trouble };
    const open = fields.trouble();
    if (open) throw open;
    const { job, warnings } = await post("/train", json.value);
    announce(`Training ${job} is queued.`);
    meant(form, { noun: "training", job, warnings, problem: request.problem }, () => {
      drafts.drop();
      location.hash = isFollowing ? `#/jobs?follow=${job}` : "#/jobs";
    });
  };
  sending(form, send, ask, { otherwise: json, told: (error) => error.field === "body" && (advanced.open = true) });
  // A policy without a calendar is cloned without one.
  if (origin && !request.problem.periods_per_year) fields.choose({ told: "period", periods: "none" });
  fields.show(request);
  if (origin) showRecord();
  written();
  untouched = JSON.stringify({ json: json.value, record: source.typed(), choices: fields.choices() });
  if (kept) restore(kept);
  const trail = h("p", { class: "trail" }, origin ? ["Like ", policyLink(origin)] : h("a", { href: "#/jobs" }, "Jobs"));
  const newer = asked.has("newer");
  const again = () => dispatchEvent(new HashChangeEvent("hashchange"));
  const actions = h("a", { class: "button quiet", href: "#/declare" }, "Declare a problem");
  return { title: newer ? "Train on newer returns" : "Train a policy", trail, actions, body: [origin ? told(newer) : "", kept && isFollowing ? h("p", { class: "lead" }, FOLLOWED) : kept ? drafts.note(again) : "", form] };
}

const FOLLOWED = "The record and the settings are those of the advice. Say how far ahead to look, then train. The form that opens the session follows by itself.";

/** Says what to do with a form that is filled from a policy. */
function told(newer) {
  const words = newer
    ? "Everything is as that policy was trained, including its returns. Replace them with newer ones, then train."
    : "Everything is as that policy was trained. Change one thing, train, and compare the two.";
  return h("p", { class: "lead" }, words);
}

/** Returns JSON with one field a line and the numbers of the history side by side. */
export function compact(request) {
  return JSON.stringify(request, null, 2).replace(
    /\[\s*([-\d.e+,\s]*?)\s*\]/g,
    (_, inside) => `[${inside.replace(/\s+/g, " ")}]`,
  );
}
