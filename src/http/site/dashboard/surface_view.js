// The view of a policy's surface: the user chooses a period, and sees the allocation over two features.

import { get } from "./api.js";
import { lineChart } from "./chart.js";
import { h } from "./dom.js";
import { allocation, percent, percentFigures, percentTick, tick, wealth } from "./format.js";
import { heatmap } from "./heatmap.js";
import { unitOf } from "./periods.js";

const AXES = {
  wealth: { label: "Wealth", format: wealth, tick },
  mean: { label: "Average return", format: (value) => percent(value, 2), tick: percentTick },
  observed: { label: "Average return since the start", format: (value) => percent(value, 2), tick: percentTick },
  deviation: { label: "Standard deviation", format: (value) => percent(value, 2), tick: percentTick },
};

/** Resolves to the surface of policy `id` after `step` periods. */
const surface = (id, { step, across = "" }, leaving) => get(`/policies/${id}/surface?step=${step}${across && `&across=${across}`}`, leaving);

/** Tells whether a step has one state. */
const isSingle = ({ columns, means }) => columns.length * means.length === 1;

/** Shows the surface of policy `id`; `told({band, isExact})` is called with what the policy holds now. */
export function surfaceView({ id, problem, leaving, told }) {
  const holder = h("div", {}, h("p", { role: "status" }, "Reading the policy\u2026"));
  const fail = (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error", role: "alert" }, error.message));
  const ask = (wish) => surface(id, wish, leaving);
  ask({ step: 0 }).then((first) => {
    const { advice } = first;
    told({ band: advice.band, isExact: isSingle(first) || advice.source !== "policy_surrogate" });
    const { element, show, next } = explorer(problem, isSingle(first) ? Math.min(1, problem.horizon - 1) : 0, ask, leaving);
    holder.replaceChildren(element);
    if (isSingle(first) && problem.horizon > 1) next();
    else show(first);
  }, fail);
  return holder;
}

/** Resolves to what policy `id` holds after `step` periods by the mean of the record, with wealth or deviation in the middle of its design: `range`
 * is that of the design, null if the mean changes nothing; `at(mean)` is null beyond it. */
export async function surfaceCurve(id, step, leaving) {
  const { across, columns, means, allocations, middle } = await surface(id, { step }, leaving);
  const held = allocations.map((row) => between(columns, row, middle[across]));
  if (means.length === 1) return { range: null, at: () => held[0] };
  const range = [means[0], means.at(-1)];
  return { range, at: (mean) => (mean < range[0] || mean > range[1] ? null : between(means, held, mean)) };
}

/** Returns a function that is known at even `places`, between them. */
function between(places, values, at) {
  if (places.length === 1) return values[0];
  const position = (at - places[0]) / (places[1] - places[0]);
  const below = Math.min(Math.max(0, Math.floor(position)), places.length - 2);
  const share = Math.min(Math.max(0, position - below), 1);
  return values[below] + share * (values[below + 1] - values[below]);
}

/** Returns the controls and the drawing. One request is pending at a time; the latest one made meanwhile follows it. */
function explorer({ horizon, periods_per_year }, start, ask, leaving) {
  const unit = unitOf(periods_per_year);
  const step = h("input", { type: "range", id: "surface-step", min: 0, max: horizon - 1, value: start, step: 1 });
  const across = h("select", { id: "surface-across" });
  const output = h("output", { for: step.id });
  const field = (label, control, output) =>
    h("p", { class: "field" }, h("label", { for: control.id }, label), control, output);
  const choice = field("Across", across, null);
  const drawing = h("div", {});
  let [out, stale] = [false, false];
  const say = () => {
    output.textContent = `${Number(step.value) + 1} of ${horizon}`;
    step.setAttribute("aria-valuetext", `${unit} ${output.textContent}`);
  };
  const next = () => {
    say();
    stale = out;
    if (out) return;
    out = true;
    const fail = (error) => leaving.aborted || drawing.replaceChildren(h("p", { class: "error", role: "alert" }, error.message));
    ask({ step: Number(step.value), across: across.value }).then(show, fail).then(() => {
      out = false;
      if (stale) next();
    });
  };
  const show = (found) => {
    say();
    choice.hidden = found.axes.length < 2;
    if ([...across.options].map(({ value }) => value).join() !== found.axes.join()) {
      across.replaceChildren(...found.axes.map((axis) => h("option", { value: axis }, AXES[axis].label)));
    }
    if (found.across) across.value = found.across;
    drawing.replaceChildren(drawn(found));
  };
  for (const control of [step, across]) control.addEventListener("input", next);
  const element = h("div", {}, h("div", { class: "controls" }, field(unit[0].toUpperCase() + unit.slice(1), step, output), choice), drawing);
  return { element, show, next };
}

function drawn(found) {
  const { across, columns, means, observed_means, allocations } = found;
  if (isSingle(found)) return single(found.advice);
  if (means.length === 1) return alongOne(across, columns, allocations[0]);
  if (across === null) return alongOne(observed_means ? "observed" : "mean", observed_means ?? means, allocations.map(([only]) => only));
  return overTwo(found);
}

function single({ band: [low, high], certainty_equivalent, floor }) {
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
    h("strong", {}, percentFigures(certainty_equivalent / floor - 1, 2)),
    " more than the bank even in the worst market, if you start in the bank.",
  );
}

function alongOne(axis, values, allocations) {
  const { label, format, tick } = AXES[axis];
  return lineChart({
    title: "Share held in stocks",
    x: { values, label, format, tick },
    y: { format: percent, tick: percentTick, also: [0] },
    series: [{ name: "Hold", kind: "line", values: allocations }],
    start: values.length >> 1,
    note: { observed: "At each point the history is followed by returns of that average, here log-returns.", mean: "At each point the history is shifted to that average log-return." }[axis],
  });
}

function overTwo({ axes, across, columns, means, observed_means, allocations, in_design, design, middle, own }) {
  const axis = (name, values) => ({ name: AXES[name].label, values, format: AXES[name].format, tick: AXES[name].tick });
  const rest = axes.filter((name) => name !== across);
  const fixed = rest.map((name) => `${AXES[name].label.toLowerCase()} ${AXES[name].format(middle[name])}`);
  const others = fixed.length > 0 ? `; ${fixed.join(", ")}` : "";
  // The rows are even in both.
  const rows = observed_means ?? means;
  const shown = (mean) => rows[0] + ((mean - means[0]) * (rows[1] - rows[0])) / (means[1] - means[0]);
  const cell = observed_means
    ? `Each cell is the history followed by returns of that average${others}. The cross is the history followed by its own oldest returns.`
    : `Each cell is the history, shifted to that average${across === "deviation" ? " and standard deviation" : ""}${others}. The cross is the history itself.`;
  const note = `${cell} Faded cells lie beyond the situations solved; there Ballast solves the step again. Returns here are log-returns.`;
  return heatmap({
    title: "Share held in stocks",
    name: "hold",
    x: axis(across, columns),
    y: axis(observed_means ? "observed" : "mean", rows),
    field: allocations,
    solved: in_design,
    range: rounded(allocations.flat()),
    format: (value) => percent(value, 0),
    dots: design.map(([value, mean]) => [value, shown(mean)]),
    own: [own[across], shown(own.mean)],
    note,
  });
}

/** Returns the range of the allocations shown, widened to full tenths, so that noise stays pale. */
function rounded(values) {
  const low = Math.floor(10 * Math.min(...values)) / 10;
  const high = Math.ceil(10 * Math.max(...values)) / 10;
  return high > low ? [low, high] : [Math.max(0, low - 0.1), low + 0.1];
}
