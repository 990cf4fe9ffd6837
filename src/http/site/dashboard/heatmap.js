// A function over a rectangle, drawn as cells: read by pointer and arrow keys, with its scale beside it.

import { axes, figure, grain, plot, scale, ticks } from "./chart.js";
import { h, s, table } from "./dom.js";

const HEIGHT = 340;
const LEGEND = 26;
/** The ramp in the stylesheet has this many colours, `.c0` to `.c10`. */
const COLOURS = 11;

/**
 * `x`, `y`: `{name, values, format, tick}`, values ascending; `field[row][column]` over y and x; `solved` has the same shape, and is false for
 * faded cells;
 * `range`: the field's own range, for the colours; `dots`: positions of design points; `own`: the position of the record itself. The
 * cell read first is that of the record, or the middle.
 */
export function heatmap({ title, x, y, field, solved, range, format, dots, own, note, name }) {
  const [columns, rows] = [x.values.length, y.values.length];
  const output = h("output", { class: "here", "aria-live": "polite" });
  const legend = h(
    "span",
    { class: "legend" },
    output,
    dots.length > 0
      ? h(
          "span",
          {},
          s(
            "svg",
            { class: "swatch", width: 10, height: 10, "aria-hidden": "true" },
            s("circle", { class: "sample", cx: 5, cy: 5, r: 2.5 }),
          ),
          "situations solved",
        )
      : null,
  );
  const half = (values) => (values[1] - values[0]) / 2;
  const [dx, dy] = [half(x.values), half(y.values)];
  const colour = (value) =>
    `c${Math.round((COLOURS - 1) * Math.max(0, Math.min(1, (value - range[0]) / (range[1] - range[0] || 1))))}`;
  const near = (axis, d, value) => Math.round((value - axis.values[0]) / (2 * d));
  const first = inside(own, x.values, y.values) ? [near(x, dx, own[0]), near(y, dy, own[1])] : [columns >> 1, rows >> 1];
  let [column, row] = first,
    place,
    cursor;
  const holder = plot(HEIGHT, (width) => {
    const yTicks = ticks(y.values[0], y.values.at(-1), 6);
    const left = 14 + 6.6 * Math.max(...yTicks.map((tick) => y.tick(tick, grain(yTicks)).length));
    const right = width - 70;
    const [across, up] = [
      scale([x.values[0] - dx, x.values.at(-1) + dx], [left, right]),
      scale([y.values[0] - dy, y.values.at(-1) + dy], [HEIGHT - 46, 22]),
    ];
    place = { across, up };
    const [wide, high] = [across(2 * dx) - across(0), up(0) - up(2 * dy)];
    const cells = paths(
      field,
      (value, c, r) => (solved[r][c] ? colour(value) : `${colour(value)} beyond`),
      (c, r) => [across(x.values[c] - dx), up(y.values[r] + dy)],
      wide + 0.6,
      high + 0.6,
    );
    cursor = s("rect", { class: "cursor", width: wide, height: high });
    mark();
    return [
      axes({
        x: across,
        y: up,
        left,
        right,
        bottom: HEIGHT - 46,
        xTicks: ticks(x.values[0], x.values.at(-1), width / 100),
        yTicks,
        xFormat: x.tick,
        yFormat: y.tick,
      }),
      cells,
      dots
        .filter(([px, py]) => px >= x.values[0] && px <= x.values.at(-1) && py >= y.values[0] && py <= y.values.at(-1))
        .map(([px, py]) => s("circle", { class: "sample", cx: across(px), cy: up(py), r: 2 })),
      s("text", { class: "axis", x: (left + right) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, x.name),
      s("text", { class: "axis", x: 0, y: 11 }, y.name),
      ramp(right + 14, range, format),
      cursor,
      inside(own, x.values, y.values) ? cross(across(own[0]), up(own[1])) : null,
    ];
  });
  const mark = () => {
    cursor?.setAttribute("x", place.across(x.values[column] - dx));
    cursor?.setAttribute("y", place.up(y.values[row] + dy));
  };
  const read = () => {
    output.textContent = `${x.name} ${x.format(x.values[column])}, ${y.name.toLowerCase()} ${y.format(y.values[row])}: ${name} ${format(field[row][column])}`;
    if (place) mark();
  };
  const go = (c, r) => {
    [column, row] = [Math.max(0, Math.min(columns - 1, c)), Math.max(0, Math.min(rows - 1, r))];
    read();
  };
  const keys = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  for (const [attribute, value] of Object.entries({
    tabindex: 0,
    role: "application",
    "aria-label": `${title}. Arrow keys move over the cells.`,
  }))
    holder.setAttribute(attribute, value);
  holder.addEventListener("keydown", (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    go(column + keys[event.key][0], row + keys[event.key][1]);
  });
  holder.addEventListener("pointermove", (event) => {
    const box = holder.getBoundingClientRect();
    go(near(x, dx, place.across.inverse(event.clientX - box.left)), near(y, dy, place.up.inverse(event.clientY - box.top)));
  });
  read();
  return figure({ title, legend, holder, note, rows: () => fieldTable({ title, x, y, field, format }) });
}

const inside = ([px, py], xs, ys) => px >= xs[0] && px <= xs.at(-1) && py >= ys[0] && py <= ys.at(-1);

/** Draws a cross that stands out on every colour. */
const cross = (x, y) => {
  const d = `M${x - 7} ${y}H${x + 7}M${x} ${y - 7}V${y + 7}`;
  return [s("path", { class: "own under", d }), s("path", { class: "own", d })];
};

/** Draws one path for each colour, because making a thousand elements would take a frame. */
function paths(field, colour, corner, wide, high) {
  const drawn = new Map();
  const box = `h${wide.toFixed(2)}v${high.toFixed(2)}h${(-wide).toFixed(2)}z`;
  for (const [r, values] of field.entries()) {
    for (const [c, value] of values.entries()) {
      const [left, top] = corner(c, r);
      const name = colour(value, c, r);
      drawn.set(name, `${drawn.get(name) ?? ""}M${left.toFixed(2)} ${top.toFixed(2)}${box}`);
    }
  }
  return [...drawn].map(([name, d]) => s("path", { class: `cell ${name}`, d }));
}

function ramp(left, [low, high], format) {
  const [top, bottom] = [22, HEIGHT - 46];
  const step = (bottom - top) / COLOURS;
  const blocks = Array.from({ length: COLOURS }, (_, k) =>
    s("rect", { class: `cell c${k}`, x: left, width: LEGEND / 2, y: bottom - (k + 1) * step, height: step + 0.5 }),
  );
  const label = (value, y) => s("text", { class: "tick", x: left + LEGEND / 2 + 5, y, dy: "0.32em" }, format(value));
  return [blocks, [0, 0.5, 1].map((share) => label(low + share * (high - low), bottom - share * (bottom - top)))];
}

/** Returns a table of every third column and row: enough to see the shape, few enough to read. */
function fieldTable({ title, x, y, field, format }) {
  const thin = (values) => values.map((_, index) => index).filter((index) => index % 3 === 1);
  const columns = [{ name: `${y.name} \\ ${x.name}`, cell: (r) => y.format(y.values[r]) }];
  columns.push(
    ...thin(x.values).map((c) => ({ name: x.format(x.values[c]), numeric: true, cell: (r) => format(field[r][c]) })),
  );
  return table(title, columns, thin(y.values).reverse());
}
