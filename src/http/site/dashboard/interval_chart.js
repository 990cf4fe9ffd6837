// Estimates with their intervals, a line each, on one scale.

import { extent, figure, grain, plot, scale, ticks } from "./chart.js";
import { s, table } from "./dom.js";

const LINE = 26;
/** Height of a row whose name has a line of its own. */
const TWO = 42;

/** Draws `rows`, `{name, value, low, high, colour, isMain}`; without `low` and `high` there are estimates alone. `noun` heads the column of names. */
export function intervalChart({ title, noun = "Strategy", rows, format, tick }) {
  const domain = extent(rows.flatMap(({ value, low = value, high = value }) => [low, high]));
  const names = 20 + 7.2 * Math.max(...rows.map(({ name }) => name.length));
  /** Tells whether the names leave too little room for the ranges beside them. */
  const narrow = (width) => names > 0.55 * width;
  const line = (width) => (narrow(width) ? TWO : LINE);
  const holder = plot((width) => line(width) * rows.length + 34, (width) => {
    const left = narrow(width) ? 8 : names;
    const bottom = line(width) * rows.length + 4;
    const x = scale(domain, [left, width - 24]);
    const places = ticks(...domain, (width - left) / 110);
    return [
      places.map((place) => [
        s("line", { class: "rule", x1: x(place), x2: x(place), y1: 0, y2: bottom }),
        s(
          "text",
          { class: "tick", x: x(place), y: bottom + 18, "text-anchor": "middle" },
          tick(place, grain(places)),
        ),
      ]),
      rows.map(({ name, value, low, high, colour = 0, isMain = false }, index) => {
        const y = line(width) * (index + (narrow(width) ? 0.75 : 0.5)) + 2;
        return [
          s("text", { class: `tick name${isMain ? " main" : ""}`, x: 0, y: narrow(width) ? y - 16 : y, dy: "0.32em" }, name),
          low === undefined ? null : s("line", { class: `range s${colour}`, x1: x(low), x2: Math.max(x(high), x(low) + 1), y1: y, y2: y }),
          s("circle", { class: `dot s${colour}`, cx: x(value), cy: y, r: 4.5 }),
        ];
      }),
    ];
  });
  return figure({
    title,
    holder,
    rows: () =>
      table(
        title,
        [
          { name: noun, cell: ({ name }) => name },
          { name: "Estimate", numeric: true, cell: ({ value }) => format(value) },
          ...(rows[0].low === undefined ? [] : [{ name: "From", numeric: true, cell: ({ low }) => format(low) }, { name: "To", numeric: true, cell: ({ high }) => format(high) }]),
        ],
        rows,
      ),
  });
}
