// What comes if every period is as bad as the data allow, beside periods like those of the record. Every step is solved, so it is played
// only when it is opened.

import { get } from "./api.js";
import { lineChart } from "./chart.js";
import { disclosure, h, section } from "./dom.js";
import { count, minus, tick } from "./format.js";

/** The worlds, with their names and colours. */
const WORLDS = [
  { world: "worst", name: "Worst case every period", colour: 3 },
  { world: "record", name: "Periods like the record\u2019s", colour: 0 },
];

/** Returns the section for the policy or session at `path`. `format` writes an amount, `shown(name)` tells which courses are drawn. */
export function futuresOf(path, leaving, { format, shown = () => true, x = { label: "Period", format: String, whole: true } }) {
  const build = () => {
    const place = h("div", { class: "later" }, h("p", { class: "note" }, "Playing some hundred futures\u2026"));
    const fill = (...nodes) => (place.classList.remove("later"), place.replaceChildren(...nodes));
    get(`${path}/futures`, leaving).then(
      (found) => fill(h("p", { class: "sentence" }, minus(found.sentence)), ...found.courses.filter(({ name }) => shown(name)).map((course) => drawn(course, found, format, x)), checked(found, format)),
      (error) => leaving.aborted || fill(h("p", { class: "error" }, error.message)),
    );
    return place;
  };
  return section("If the worst came every time", disclosure("Play this policy against the worst case of every period", build));
}

/** Draws the course of a figure in both worlds: the median, and the range of the middle eight of ten paths. */
function drawn(course, { period, paths }, format, x) {
  const values = course.worst.map((_, time) => period - 1 + time);
  const series = WORLDS.map(({ world, name, colour }) => ({
    name,
    colour,
    kind: "line",
    bare: true,
    values: course[world].map(({ median }) => median),
    band: course[world].map(({ low, high }) => [low, high]),
  }));
  const title = course.name[0].toUpperCase() + course.name.slice(1);
  const note = `The median of ${count(paths)} paths, and the range of the middle 80 %.`;
  return lineChart({ title, height: 230, note, x: { ...x, values, domain: [values[0], values.at(-1)] }, y: { format, tick }, series });
}

/** Returns the check of a whole horizon: what the policy says it is worth, and what playing it brings. */
function checked({ promised, stated_error, played: { value, low, high } }, format) {
  const within = stated_error === null ? "" : `, to about ${format(stated_error)}`;
  const words = `The policy says that it is worth ${format(promised)} for certain against these laws${within}. Playing them finds ${format(value)}, between ${format(low)} and ${format(high)} with 90 % confidence.`;
  return disclosure("For the quant", () => h("p", { class: "sentence" }, words));
}
