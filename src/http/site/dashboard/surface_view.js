// The view of a policy's surface: the user chooses a period and a radius, and sees the allocation over two features.

import { lineChart } from "./chart.js";
import { h } from "./dom.js";
import { allocation, percent, percentFigures, percentTick, tick, wealth } from "./format.js";
import { heatmap } from "./heatmap.js";
import { shown } from "./key.js";
import { unitOf } from "./periods.js";

const WORKER = "/dashboard/surface_worker.js";
/** Steps of the slider from the least radius of the design to the largest. */
const RADII = 20;

const AXES = {
  wealth: { label: "Wealth", format: wealth, tick },
  mean: { label: "Average return", format: (value) => percent(value, 2), tick: percentTick },
  radius: { label: "Caution", format: (value) => percentFigures(value, 4), tick: percentTick },
  deviation: { label: "Standard deviation", format: (value) => percent(value, 2), tick: percentTick },
};

let trusted;

/** Returns the address of the page's only worker script, as a trusted type if the browser needs one; every other address is refused. */
function workerAddress() {
  if (!globalThis.trustedTypes) return WORKER;
  trusted ??= trustedTypes.createPolicy("ballast-worker", {
    createScriptURL: (address) => {
      if (address !== WORKER) throw new TypeError(`${address} is not a worker of this page`);
      return address;
    },
  });
  return trusted.createScriptURL(WORKER);
}

/** Shows the surface of policy `id`, computed in a worker that lives until `leaving`; `told({band, isExact})` is called with what the policy holds now. */
export function surfaceView({ id, problem, leaving, told }) {
  const status = h("p", { role: "status" }, "Reading the policy\u2026");
  const holder = h("div", {}, status);
  const worker = new Worker(workerAddress(), { type: "module" });
  leaving.addEventListener("abort", () => worker.terminate());
  const fail = (words) => holder.replaceChildren(h("p", { class: "error", role: "alert" }, words));
  const { element, show, next } = explorer(problem, (wish) => worker.postMessage(wish));
  worker.addEventListener("error", () => fail("The surface could not be computed."));
  worker.addEventListener("message", ({ data }) => {
    if (data.failed) return fail(data.failed);
    if (data.ready) {
      told(data.ready);
      return next();
    }
    if (holder.firstChild === status) holder.replaceChildren(element);
    show(data.picture);
  });
  worker.postMessage({ address: `/policies/${id}/export`, headers: shown() });
  return holder;
}

/** Resolves to what policy `id` holds after `step` periods at each of `means`, with everything else in the middle of its design. */
export function surfaceCurve(id, { step, means }, leaving) {
  const worker = new Worker(workerAddress(), { type: "module" });
  leaving.addEventListener("abort", () => worker.terminate());
  return new Promise((resolve, reject) => {
    const end = (settle, value) => (worker.terminate(), settle(value));
    worker.addEventListener("error", () => end(reject, new Error("The policy could not be read.")));
    worker.addEventListener("message", ({ data }) => {
      if (data.failed) end(reject, new Error(data.failed));
      else if (data.ready) worker.postMessage({ step, means });
      else end(resolve, data.curve);
    });
    worker.postMessage({ address: `/policies/${id}/export`, headers: shown() });
  });
}

/** Returns the controls and the drawing. One request is pending at a time; the latest one made meanwhile follows it. */
function explorer({ horizon, periods_per_year }, ask) {
  const unit = unitOf(periods_per_year);
  const step = h("input", { type: "range", id: "surface-step", min: 0, max: horizon - 1, value: Math.min(1, horizon - 1), step: 1 });
  const across = h("select", { id: "surface-across" });
  const radius = h("input", { type: "range", id: "surface-radius", min: 0, max: RADII, value: RADII / 2, step: 1 });
  const outputs = { step: h("output", { for: step.id }), radius: h("output", { for: radius.id }) };
  const field = (label, control, output) =>
    h("p", { class: "field" }, h("label", { for: control.id }, label), control, output);
  const fields = {
    step: field(unit[0].toUpperCase() + unit.slice(1), step, outputs.step),
    across: field("Across", across, null),
    radius: field("Caution", radius, outputs.radius),
  };
  const drawing = h("div", {});
  let [out, stale] = [false, false];
  const next = () => {
    outputs.step.textContent = `${Number(step.value) + 1} of ${horizon}`;
    step.setAttribute("aria-valuetext", `${unit} ${outputs.step.textContent}`);
    stale = out;
    if (out) return;
    out = true;
    ask({ step: Number(step.value), across: across.value, radius: Number(radius.value) / RADII });
  };
  const show = (picture) => {
    out = false;
    offer(picture);
    drawing.replaceChildren(DRAWN[picture.kind](picture));
    if (stale) next();
  };
  const offer = ({ choices = [], across: chosen, radius: value = null }) => {
    fields.across.hidden = choices.length < 2;
    fields.radius.hidden = value === null;
    if ([...across.options].map(({ value }) => value).join() !== choices.join()) {
      across.replaceChildren(...choices.map((axis) => h("option", { value: axis }, AXES[axis].label)));
    }
    if (chosen) across.value = chosen;
    if (value === null) return;
    outputs.radius.textContent = AXES.radius.format(value);
    radius.setAttribute("aria-valuetext", outputs.radius.textContent);
  };
  for (const control of [step, across, radius]) control.addEventListener("input", next);
  const element = h("div", {}, h("div", { class: "controls" }, Object.values(fields)), drawing);
  return { element, show, next };
}

const DRAWN = { single, line: alongOne, field: overTwo };

function single({ band: [low, high], floor_gain }) {
  const here = "Here every session of this policy knows the same record: ";
  const [least, most] = [low, high].map(allocation);
  if (most === allocation(0)) return h("p", { class: "single" }, here, "hold ", h("strong", {}, "nothing"), " in stocks, because in the worst market nothing beats the bank.");
  return h(
    "p",
    { class: "single" },
    here,
    "hold ",
    h("strong", {}, least === most ? least : [least, " to ", most]),
    " in stocks, worth ",
    h("strong", {}, percentFigures(Math.expm1(floor_gain), 2)),
    " more than the bank even in the worst market, if you start in the bank.",
  );
}

function alongOne({ axis, values, allocations }) {
  const { label, format, tick } = AXES[axis];
  return lineChart({
    title: "Share held in stocks",
    x: { values, label, format, tick },
    y: { format: percent, tick: percentTick, also: [0] },
    series: [{ name: "Hold", kind: "line", values: allocations }],
  });
}

function overTwo({ across, xs, ys, cells, dots, own, rest }) {
  const axis = (name, values) => ({ name: AXES[name].label, values, format: AXES[name].format, tick: AXES[name].tick });
  const fixed = rest.map(([name, value]) => `${AXES[name].label.toLowerCase()} ${AXES[name].format(value)}`);
  const stretched = across === "deviation" ? " and standard deviation" : "";
  const marked = own ? " The cross is the history itself." : "";
  const note = `Each cell is the history, shifted to that average${stretched}${fixed.length > 0 ? `; ${fixed.join(", ")}` : ""}.${marked} Beyond the situations solved, Ballast solves the step again. Returns here are log-returns.`;
  return heatmap({
    title: "Share held in stocks",
    name: "hold",
    x: axis(across, xs),
    y: axis("mean", ys),
    field: cells,
    range: rounded(cells.flat()),
    format: (value) => percent(value, 0),
    dots,
    own,
    note,
  });
}

/** Returns the range of the allocations shown, widened to full tenths, so that noise stays pale. */
function rounded(values) {
  const low = Math.floor(10 * Math.min(...values)) / 10;
  const high = Math.ceil(10 * Math.max(...values)) / 10;
  return high > low ? [low, high] : [Math.max(0, low - 0.1), low + 0.1];
}
