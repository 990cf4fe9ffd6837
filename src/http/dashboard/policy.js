// One policy: what it was asked, what it does, how well it was solved.

import { download, get, offers, remove } from "./api.js";
import { lineChart } from "./chart.js";
import { announce, disclosure, h, section, table } from "./dom.js";
import { basisPoints, count, moment, percent, percentTick, short, significant, tick, wealth } from "./format.js";
import { heatmap } from "./heatmap.js";
import { FRAMEWORKS, inWords } from "./specification.js";
import { stepSurface } from "./surface.js";

/** Documents larger than this, in bytes, are fetched for the surface when asked only. */
const READY_BYTES = 15e6;
/** Digits of one number in the document. */
const NUMBER_BYTES = 20;
const [COLUMNS, ROWS] = [41, 29];

export async function view(id, leaving) {
  const policy = await get(`/policies/${id}`, leaving);
  const { specification, diagnostics } = policy;
  const body = [
    h(
      "div",
      { class: "words" },
      inWords(specification).map((sentence) => h("p", {}, sentence)),
    ),
    disclosure("The whole specification", () => h("pre", { tabindex: 0 }, JSON.stringify(specification, null, 1))),
    surface(policy),
    steps(diagnostics),
  ];
  const evaluate = (await offers("/evaluate"))
    ? h("a", { class: "button quiet", href: `#/evaluations?policy=${id}` }, "Evaluate")
    : null;
  const actions = h(
    "div",
    { class: "actions" },
    h("a", { class: "button", href: `#/sessions?policy=${id}` }, "Open a session"),
    evaluate,
    h(
      "a",
      { class: "button quiet", href: `/policies/${id}/export`, download: `policy-${short(id)}.json`, onclick: download },
      "Export",
    ),
    deletion(id),
  );
  const trail = h(
    "p",
    { class: "trail" },
    h("a", { href: "#/policies" }, "Policies"),
    ` \u203a ${FRAMEWORKS[policy.framework]}, stored ${moment(policy.created_ms)}`,
  );
  return { title: `Policy ${short(id)}`, trail, actions, body };
}

function deletion(id) {
  const button = h("button", { class: "quiet danger" }, "Delete");
  button.addEventListener("click", async () => {
    if (!confirm("Delete this policy for good?")) return;
    try {
      await remove(`/policies/${id}`);
      location.hash = "#/policies";
    } catch (error) {
      announce(error.message);
      button.after(h("p", { class: "error" }, error.message));
    }
  });
  return button;
}

function surface({ policy: id, specification, diagnostics }) {
  const size = diagnostics.reduce(
    (sum, step) => sum + NUMBER_BYTES * step.design_count * (2 + (step.policy?.features.length ?? 0)),
    0,
  );
  const holder = h("div", {});
  const load = async () => {
    holder.replaceChildren(h("p", { role: "status" }, "Reading the policy\u2026"));
    try {
      holder.replaceChildren(explorer(await get(`/policies/${id}/export`)));
    } catch (error) {
      holder.replaceChildren(h("p", { class: "error", role: "alert" }, error.message));
    }
  };
  if (size <= READY_BYTES) load();
  else holder.append(h("button", { onclick: load }, `Read the policy (about ${count(size / 1e6)} MB) and draw it`));
  return section("What it holds", holder);
}

const AXES = {
  wealth: { label: "Wealth", format: wealth, tick },
  mean: { label: "Mean log-return", format: (value) => percent(value, 2), tick: percentTick },
  radius: { label: "Radius", format: (value) => significant(value, 3), tick },
  deviation: { label: "Standard deviation", format: (value) => percent(value, 2), tick: percentTick },
};

/** Step and radius to choose, and the allocation over two of the features. */
function explorer(policy) {
  const { horizon, action_interval } = policy.specification.problem;
  const surfaces = new Map();
  const at = (step) => surfaces.get(step) ?? surfaces.set(step, stepSurface(policy, step)).get(step);
  const step = h("input", { type: "range", id: "surface-step", min: 0, max: horizon - 1, value: horizon - 1, step: 1 });
  const across = h("select", { id: "surface-across" });
  const radius = h("input", { type: "range", id: "surface-radius", min: 0, max: 20, value: 10, step: 1 });
  const outputs = { step: h("output", { for: "surface-step" }), radius: h("output", { for: "surface-radius" }) };
  const field = (label, control, output) =>
    h("p", { class: "field" }, h("label", { for: control.id }, label), control, output);
  const fields = {
    step: field("Period", step, outputs.step),
    across: field("Across", across, null),
    radius: field("Radius", radius, outputs.radius),
  };
  const drawing = h("div", {});
  const draw = () => {
    const found = at(Number(step.value));
    outputs.step.textContent = `${Number(step.value) + 1} of ${horizon}`;
    step.setAttribute("aria-valuetext", `period ${outputs.step.textContent}`);
    const axes = found ? Object.keys(AXES).filter((axis) => axis in found.ranges) : [];
    const choices = axes.filter((axis) => axis !== "mean");
    const chosen = choices.includes(across.value) ? across.value : choices[0];
    across.replaceChildren(
      ...choices.map((axis) => h("option", { value: axis, selected: axis === chosen }, AXES[axis].label)),
    );
    fields.across.hidden = choices.length < 2 || !axes.includes("mean");
    fields.radius.hidden = !axes.includes("radius") || chosen === "radius";
    drawing.replaceChildren(
      !found
        ? single(policy.steps[Number(step.value)])
        : axes.length === 1
          ? alongOne(found, axes[0])
          : over(found, chosen),
    );
  };
  const chosenRadius = (found) => {
    if (fields.radius.hidden) return found.middle.radius;
    const [low, high] = found.ranges.radius;
    const value = low * (high / low) ** (Number(radius.value) / 20);
    outputs.radius.textContent = AXES.radius.format(value);
    radius.setAttribute("aria-valuetext", outputs.radius.textContent);
    return value;
  };
  const over = (found, across) => {
    const place = { radius: chosenRadius(found) };
    const [xs, ys] = [spread(found.ranges[across], COLUMNS), spread(found.ranges.mean, ROWS)];
    const cells = ys.map((mean) => xs.map((value) => found.at({ ...place, mean, [across]: value })));
    const dots = thinned(found.dots(across), found.dots("mean"));
    const axis = (name, values) => ({
      name: AXES[name].label,
      values,
      format: AXES[name].format,
      tick: AXES[name].tick,
    });
    const rest = ["wealth", "deviation", "radius"]
      .filter((axis) => axis !== across && axis in found.ranges)
      .map((axis) => `${AXES[axis].label.toLowerCase()} ${AXES[axis].format(place[axis] ?? found.middle[axis])}`);
    const note = `Each cell is the history, moved to that mean${across === "deviation" ? " and standard deviation" : ""}${rest.length > 0 ? `; ${rest.join(", ")}` : ""}. Where no design point lies, Ballast solves the step anew instead of reading this surface.`;
    return heatmap({
      title: "Allocation",
      name: "allocation",
      x: axis(across, xs),
      y: axis("mean", ys),
      field: cells,
      range: rounded(cells, action_interval[1]),
      format: (value) => percent(value, 0),
      dots,
      note,
    });
  };
  const alongOne = (found, name) => {
    const values = spread(found.ranges[name], 61);
    return lineChart({
      title: "Allocation",
      x: { values, label: AXES[name].label, format: AXES[name].format, tick: AXES[name].tick },
      y: { format: percent, tick: percentTick, also: [0] },
      series: [{ name: "Allocation", kind: "line", values: values.map((value) => found.at({ [name]: value })) }],
    });
  };
  for (const control of [step, across, radius]) control.addEventListener("input", draw);
  draw();
  return h("div", {}, h("div", { class: "controls" }, Object.values(fields)), drawing);
}

function single({ solution }) {
  return h(
    "p",
    { class: "single" },
    "At this step every session of this policy is in one and the same state: hold ",
    h("strong", {}, percent(solution.action)),
    ", worth ",
    h("strong", {}, basisPoints(solution.floor_gain)),
    " more than the bank.",
  );
}

/** The range of the allocations shown, out to the next tenth, so that noise stays pale. */
function rounded(cells, highest) {
  const values = cells.flat();
  const low = Math.floor(10 * Math.min(...values)) / 10;
  const high = Math.ceil(10 * Math.max(...values)) / 10;
  return high > low ? [low, high] : [Math.max(0, low - 0.1), Math.min(highest, low + 0.1)];
}

const spread = ([low, high], count) => Array.from({ length: count }, (_, k) => low + ((high - low) * k) / (count - 1));

/** At most 300 pairs, evenly taken. */
function thinned(xs, ys) {
  const stride = Math.max(1, Math.ceil(xs.length / 300));
  return xs.flatMap((x, index) => (index % stride === 0 ? [[x, ys[index]]] : []));
}

function steps(diagnostics) {
  const periods = diagnostics.map(({ step }) => step + 1);
  const chart = (title, read, format, tick) =>
    lineChart({
      title,
      height: 130,
      x: { values: periods, label: "Period", format: String, whole: true },
      y: { format, tick, also: [0] },
      series: [{ name: "", kind: "line", values: diagnostics.map(read) }],
    });
  const names = [...new Set(diagnostics.flatMap(({ policy }) => policy?.features ?? []))];
  const length = (side, name) => (step) => {
    const index = step[side]?.features.indexOf(name) ?? -1;
    return index < 0 ? "\u2013" : significant(step[side].lengthscales[index], 2);
  };
  const period = { name: "Period", cell: ({ step }) => count(step + 1) };
  const figure = (name, cell) => ({ name, cell, numeric: true });
  const quality = [
    period,
    figure("Design points", ({ design_count }) => count(design_count)),
    figure("All in the bank", ({ all_bank_share }) => percent(all_bank_share)),
    figure("Uncertified", ({ uncertified_share }) => percent(uncertified_share)),
    figure("Duality gap", ({ duality_gap }) => basisPoints(duality_gap)),
    figure("Value, left out", ({ value }) => basisPoints(value?.leave_one_out_error)),
    figure("Policy, left out", ({ policy }) => significant(policy?.leave_one_out_error, 2)),
    figure("Value noise", ({ value }) => significant(value?.noise_variance, 2)),
    figure("Policy noise", ({ policy }) => significant(policy?.noise_variance, 2)),
  ];
  const lengthscales = (side) =>
    disclosure(
      `Lengthscales of the ${side} surrogate`,
      () =>
        [
          table(
            `Lengthscales of the ${side} surrogate, in standard deviations of each feature over the design`,
            [period, ...names.map((name) => figure(name.replace(/_/g, " "), length(side, name)))],
            diagnostics,
          ),
        ][0],
    );
  return section(
    "How well it was solved",
    h(
      "div",
      { class: "trio" },
      chart("Design states all in the bank", ({ all_bank_share }) => all_bank_share, percent, percentTick),
      chart("Value surrogate, error left out", ({ value }) => value?.leave_one_out_error, basisPoints, basisPoints),
      chart("Largest duality gap", ({ duality_gap }) => duality_gap, basisPoints, basisPoints),
    ),
    h(
      "p",
      { class: "note" },
      "Errors are root mean squares of leave-one-out predictions; those of the value and the gap are in basis points (1/100 %) of the certainty equivalent, that of the policy is in allocation. Noise is a share of the target\u2019s variance.",
    ),
    table("Diagnostics of every step", quality, diagnostics),
    lengthscales("value"),
    lengthscales("policy"),
  );
}
