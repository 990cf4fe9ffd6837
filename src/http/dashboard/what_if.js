// What the session's advice would be, were it guarded more or less.

import { agrees } from "./advice.js";
import { post } from "./api.js";
import { lineChart } from "./chart.js";
import { h, section } from "./dom.js";
import { allocation, percentTick, significant, tick, wealth } from "./format.js";

/** From trusting the returns seen to twice the caution; every point is a robust step solved. */
const SWEEP = { from: 0, to: 2, points: 21 };

/** Allocation and certainty equivalent against the scale of the radius; asked for after the rest of the page stands. */
export function conservatism({ id, leaving }, action) {
  const holder = h("div", {}, h("p", { class: "note" }, "Solving the step for other radii\u2026"));
  post("/what-if", { session: id, sweep: { radius_scale: SWEEP } }, leaving).then(
    ({ points }) => holder.replaceChildren(...charts(points, action)),
    (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error" }, error.message)),
  );
  return section("More or less guarded", holder);
}

function charts(points, { radius, allocation: advised }) {
  const times = (value) => `\u00d7 ${significant(value, 2)}`;
  const x = { values: points.map(({ radius_scale }) => radius_scale), label: "Radius", format: times, tick };
  const own = points.findIndex(({ radius_scale }) => Math.abs(radius_scale - 1) < 1e-9);
  // One advice on the page: the step solved anew at its own radius is told by its check.
  const held = (point, index) => (index === own && agrees(point.allocation, advised) ? advised : point.allocation);
  const line = (name, read, bare) => ({ name, kind: "line", bare, values: points.map(read) });
  return [
    h(
      "p",
      { class: "note" },
      `The coming period solved again with its radius of ${significant(radius, 3)} multiplied. At 0 the returns seen are the whole truth; later periods keep their own radius.`,
    ),
    h(
      "div",
      { class: "duo" },
      lineChart({
        title: "Allocation by radius",
        height: 170,
        start: own,
        x,
        y: { format: allocation, tick: percentTick, also: [0] },
        series: [line("", held)],
      }),
      lineChart({
        title: "Worth for certain by radius",
        height: 170,
        start: own,
        x,
        y: { format: wealth, tick },
        series: [line("", (point) => point.certainty_equivalent), line("Bank", ({ floor }) => floor, true)],
      }),
    ),
  ];
}
