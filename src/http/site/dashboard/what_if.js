// What the session's advice would be with more or less caution.

import { post } from "./api.js";
import { lineChart } from "./chart.js";
import { h, section } from "./dom.js";
import { allocation, percentTick, points, significant, tick } from "./format.js";
import { inCurrency } from "./money.js";
import { colourOf } from "./strategies.js";

/** From no caution to twice the caution; every point needs a robust step. */
const SWEEP = { from: 0, to: 2, points: 21 };

/** Returns `{element, ask()}`: the section that draws what is held and its worth by the amount of caution, and the function that loads it. */
export function conservatism({ id, leaving, calendar, cautionScale }, action) {
  const holder = h("div", {}, h("p", { class: "note" }, "Solving the step for other amounts of caution\u2026"));
  const ask = () =>
    post("/what-if", { session: id, sweep: { radius_scale: SWEEP } }, leaving).then(
      ({ points }) => holder.replaceChildren(...charts(points, action, cautionScale, calendar.unit)),
      (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error" }, error.message)),
    );
  const element = section("With more or less caution", holder);
  element.classList.add("caution-choice");
  return { element, ask };
}

function charts(solved, { radius, allocation: advised }, cautionScale, unit) {
  const times = (value) => `\u00d7 ${significant(value, 2)}`;
  const x = { values: solved.map(({ radius_scale }) => radius_scale), label: "Caution", format: times, tick };
  const own = solved.findIndex(({ radius_scale }) => Math.abs(radius_scale - 1) < 1e-9);
  // The page gives one advice: at the session's own caution the chart repeats it.
  const held = (point, index) => (index === own ? advised : point.allocation);
  const line = (name, read, more) => ({ name, kind: "line", values: solved.map(read), ...more });
  return [
    h(
      "p",
      { class: "note" },
      `At \u00d7 1, the caution of this session, the average return may really be ${points(radius * cautionScale, 2)} a ${unit} lower than seen. At \u00d7 0 the record is fully trusted. Later periods keep their own caution.`,
    ),
    h(
      "div",
      { class: "duo" },
      lineChart({
        title: "Share in stocks by caution",
        height: 170,
        start: own,
        x,
        y: { format: allocation, tick: percentTick, also: [0] },
        series: [line("", held)],
      }),
      lineChart({
        title: "Worth as much as a sure, by caution",
        height: 170,
        start: own,
        x,
        y: { format: inCurrency, tick },
        series: [line("", (point) => point.certainty_equivalent), line("All in the bank", ({ floor }) => floor, { bare: true, colour: colourOf("all_bank") })],
      }),
    ),
  ];
}
