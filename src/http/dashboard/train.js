// A training request, from a form, a file of returns or JSON; the three show the same request.

import { post } from "./api.js";
import { announce, h } from "./dom.js";
import { fieldset, input, select, showProblem } from "./form.js";
import { typed } from "./number_text.js";
import { returnsField } from "./returns_field.js";
import { isParametric, warningList } from "./specification.js";

const UTILITIES = { exponential: "Exponential", power: "Power", log: "Log" };
/** Each kind with a usual risk aversion, in multiples of one over the initial wealth where that is meant. */
const UTILITY = {
  exponential: { kind: "exponential", risk_aversion_relative: 3 },
  power: { kind: "power", risk_aversion: 3 },
  log: { kind: "log" },
};
const FRAMEWORKS = {
  adaptive: "Adaptive robust",
  static: "Static robust",
  plug_in: "Plug-in",
  parametric_adaptive: "Parametric adaptive",
  parametric_static: "Parametric static",
};

/** Fields that are parts of one, and may be given in percent. */
const SHARES = ["problem.rate_per_step", "problem.trading_cost", "problem.radius.alpha"];

/** What the form starts from; what is null is to be filled in, or may be left out. */
const initial = () => ({
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
    history: [],
  },
  design: { count: 500 },
  seed: 1,
});

/** What weighs less with age, if anything does. */
const HALF_LIFE = "problem.learning.half_life";

const at = (object, path) => path.split(".").reduce((value, key) => value?.[key], object);

function put(object, path, value) {
  const keys = path.split(".");
  const last = keys.pop();
  const parent = keys.reduce((value, key) => (value[key] ??= {}), object);
  parent[last] = value;
}

export async function view(_, leaving) {
  let request = initial();
  const message = h("p", { class: "error", role: "alert", hidden: true });
  const json = h("textarea", { id: "json", rows: 18, spellcheck: "false", "aria-describedby": "json-note json-error" });
  const jsonError = h("p", { id: "json-error", class: "error", hidden: true });
  const source = returnsField({
    name: "problem.history",
    label: "Returns or prices",
    example: true,
    changed: (returns) => {
      put(request, "problem.history", returns);
      written();
    },
    bank: (rate, periods) => {
      put(request, "problem.rate_per_step", rate);
      if (periods) put(request, "problem.periods_per_year", periods);
      fields.show(request);
      written();
    },
  });
  const fields = mainFields((path, value) => {
    if (path === "problem.utility.kind") put(request, "problem.utility", { ...UTILITY[value] });
    else put(request, path, value);
    if (path === "problem.framework") {
      const { alpha = 0.1 } = request.problem.radius ?? {};
      request.problem.radius = isParametric(value)
        ? { rule: "chi_square", alpha }
        : { rule: "bridge", alpha, scale: 1 };
    }
    if (path === "problem.utility.kind" || path === "problem.framework") fields.show(request);
    written();
  });
  const written = () => {
    json.value = compact(request);
    jsonError.hidden = true;
  };
  json.addEventListener("input", () => {
    try {
      request = JSON.parse(json.value);
      jsonError.hidden = true;
      fields.show(request);
      source.show([request.problem?.history ?? []].flat());
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
      "The request as it will be sent. What is edited here changes the form and the other way round; ",
      h("a", { href: "/docs" }, "the interface"),
      " names every field.",
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
    advanced,
    message,
    h(
      "p",
      { class: "send" },
      send,
      h("span", { class: "note" }, "Trains in the background; the job list shows how far it is."),
    ),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const trouble = await source.trouble();
    if (trouble) return showProblem(form, message, { field: "problem.history", message: trouble });
    send.disabled = true;
    try {
      const job = await post("/train", json.value);
      announce(`Training ${job.job} is queued.`);
      if (job.warnings.length > 0) form.replaceWith(warned(job.warnings));
      else location.hash = "#/jobs";
    } catch (error) {
      if (error.field === "body") advanced.open = true;
      showProblem(form, message, error, json);
    }
    send.disabled = false;
  });
  fields.show(request);
  written();
  const trail = h("p", { class: "trail" }, h("a", { href: "#/jobs" }, "Jobs"));
  return { title: "Train a policy", trail, body: form };
}

/** What stands in the place of the form once a training is queued whose request may be a mistake. */
function warned(warnings) {
  return h(
    "div",
    { class: "words", role: "status" },
    h("p", {}, "The training is queued. Is this meant?"),
    warningList(warnings),
    h("p", {}, "If not, cancel it among the ", h("a", { href: "#/jobs" }, "jobs"), " and train anew."),
  );
}

/** JSON with a line a field, numbers of the history side by side. */
function compact(request) {
  return JSON.stringify(request, null, 2).replace(
    /\[\s*([-\d.e+,\s]*?)\s*\]/g,
    (_, inside) => `[${inside.replace(/\s+/g, " ")}]`,
  );
}

/** One number, or several that semicolons keep apart. */
function amounts(text) {
  const each = text.split(";").map((part) => typed(part)).filter((part) => part !== null);
  return each.length > 1 ? each : (each[0] ?? 0);
}

function mainFields(changed) {
  const number = (path, label, note, options = {}) =>
    input({
      name: path,
      label,
      note,
      changed: (text) => changed(path, typed(text, { shares: SHARES.includes(path) })),
      ...options,
    });
  const parts = [
    select({
      name: "problem.framework",
      label: "Framework",
      note: "Adaptive guards and learns, static only guards, plug-in only learns; the parametric ones take returns as normal.",
      choices: FRAMEWORKS,
      changed: (value) => changed("problem.framework", value),
    }),
    number("problem.horizon", "Decisions", "Periods to live through, 1 to 520."),
    number(
      "problem.rate_per_step",
      "Bank return per period",
      "Of one period of the returns: 3 % a year are 0.247 % a month, or 0.00247.",
    ),
    number("problem.periods_per_year", "Periods a year", "May be blank. 12 of months; rates are then told a year, too."),
    number("problem.initial_wealth", "Initial wealth", "In any unit."),
    number("problem.trading_cost", "Trading cost", "Of what is traded: 0.002 or 0.2 %; 0 is free."),
    input({
      name: "problem.contributions",
      label: "Added each period",
      note: "At its end; negative is withdrawn. One number, or one for each period, apart by semicolons.",
      changed: (text) => changed("problem.contributions", amounts(text)),
    }),
    input({
      name: HALF_LIFE,
      label: "Half-life of returns",
      note: "In periods: one so old weighs half. Blank: all weigh the same.",
      changed: (text) => {
        const half_life = typed(text);
        changed("problem.learning", half_life === null ? { kind: "equal" } : { kind: "decay", half_life });
      },
    }),
    select({
      name: "problem.utility.kind",
      label: "Utility",
      choices: UTILITIES,
      changed: (value) => changed("problem.utility.kind", value),
    }),
    number("problem.utility.risk_aversion", "Risk aversion", "Exponential: per unit of wealth. Power: above 1."),
    number(
      "problem.utility.risk_aversion_relative",
      "Relative risk aversion",
      "Over the initial wealth: of one who starts with 100, 3 is 0.03 per unit of wealth.",
    ),
    number("problem.radius.alpha", "Miscoverage alpha", "Smaller guards against more: 0.1 takes the 90 % quantile."),
    number("problem.radius.scale", "Radius scale", "Multiplies the radius; 0 trusts the returns seen."),
    number("design.count", "Design points", "States solved per step: more is finer and slower, 10 to 10,000."),
    number("seed", "Seed", "The same request and seed give the same policy."),
  ];
  const show = (request) => {
    for (const part of parts) {
      const found = at(request, part.name);
      const value = found === undefined && part.name === HALF_LIFE ? "" : found;
      if (part.control !== document.activeElement) part.control.value = [value ?? ""].flat().join("; ");
      part.element.hidden = value === undefined;
    }
  };
  const elements = [
    fieldset("The investor", [...parts.slice(1, 7), ...parts.slice(8, 11)]),
    fieldset("What he guards against", [parts[0], parts[7], parts[11], parts[12]]),
    fieldset("Precision", parts.slice(13)),
  ];
  return { elements, show };
}
