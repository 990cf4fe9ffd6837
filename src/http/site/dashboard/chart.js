// Charts of a few hundred points, as SVG: drawn at their actual width, and read by pointer, by keyboard and as a table.

import { disclosure, h, s, table } from "./dom.js";
import { pictureButtons } from "./picture.js";

/** Returns round numbers that span `[low, high]` in about `wanted` steps; at least one. */
export function ticks(low, high, wanted) {
  const rough = (high - low) / Math.max(1, wanted);
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) values.push(k * step + 0); // never \u22120
  return values.length > 0 ? values : ticks(low, high, 2 * Math.max(1, wanted));
}

/** Digits of the label if an axis has only one tick, which need not be round. */
const DIGITS = 3;
/** Most digits that tell the ticks of an axis apart. */
const MOST_DIGITS = 12;

/** Returns the power of ten of which all `places` of an axis are multiples, so that labels differ from each other and from 0. */
export function grain(places) {
  const top = Math.floor(Math.log10(Math.max(...places.map(Math.abs))) + 1e-9);
  if (!Number.isFinite(top)) return 1;
  const whole = (unit) => places.every((place) => Math.abs(place / unit - Math.round(place / unit)) < 1e-4);
  const least = top + 1 - (places.length > 1 ? MOST_DIGITS : DIGITS);
  let power = top;
  while (power > least && !whole(10 ** power)) power -= 1;
  return 10 ** power;
}

/** Returns round numbers that span `[low, high]`, both above 0, on a logarithmic axis. */
function logTicks(low, high) {
  const decades = Array.from({ length: Math.ceil(Math.log10(high)) - Math.floor(Math.log10(low)) + 1 }, (_, k) => 10 ** (Math.floor(Math.log10(low)) + k));
  const within = (factors) => decades.flatMap((decade) => factors.map((factor) => factor * decade)).filter((value) => value >= low && value <= high);
  const [few, some] = [within([1]), within([1, 2, 5])];
  if (few.length >= 4) return few;
  return some.length >= 3 ? some : ticks(low, high, 4);
}

/** Returns the linear map from `[low, high]` onto `[from, to]`. */
export function scale([low, high], [from, to]) {
  const slope = high > low ? (to - from) / (high - low) : 0;
  const map = (value) => from + slope * (value - low);
  map.inverse = (pixel) => (slope === 0 ? low : low + (pixel - from) / slope);
  return map;
}

/** A smaller relative difference is rounding: drawn apart, such numbers would have labels of twelve digits. */
const ROUNDING = 1e-9;

/** Returns the range of the finite `values`, widened by a twentieth and to include `also`. */
export function extent(values, also = []) {
  const finite = [...values, ...also].filter(Number.isFinite);
  if (finite.length === 0) return [0, 1];
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  const size = Math.max(Math.abs(low), Math.abs(high));
  const isOne = high - low <= ROUNDING * size;
  const room = isOne ? 0.05 * size || 0.5 : 0.05 * (high - low);
  if (isOne) return [also.includes(low) ? low : low - room, high + room];
  return [also.includes(low) ? low : low - room, also.includes(high) ? high : high + room];
}

/** The least width of a drawing, in pixels. */
const LEAST_WIDTH = 180;

/** Returns an element whose drawing follows its width: `draw(width)` gives the SVG's children; `height` may be a function of the width. */
export function plot(height, draw) {
  const tall = (width) => (typeof height === "function" ? height(width) : height);
  const holder = h("div", { class: "plot" });
  // Reserves the height before the drawing, so that nothing below moves.
  holder.style.minHeight = `${tall(Infinity)}px`;
  const drawn = (width) => {
    const picture = s(
      "svg",
      { width, height: tall(width), viewBox: `0 0 ${width} ${tall(width)}`, "aria-hidden": "true", focusable: "false" },
      draw(width),
    );
    holder.replaceChildren(picture);
  };
  holder.redraw = (width = holder.clientWidth) => holder.clientWidth > 0 && drawn(Math.max(LEAST_WIDTH, width));
  new ResizeObserver(() => holder.redraw()).observe(holder);
  return holder;
}

/** The width of an A4 page between the margins of print.css, in pixels: drawings of this width keep their letter size on paper. */
const PAPER_WIDTH = 672;

const redrawAll = (width) => document.querySelectorAll(".plot").forEach((holder) => holder.redraw(width));
globalThis.addEventListener?.("beforeprint", () => redrawAll(PAPER_WIDTH));
globalThis.addEventListener?.("afterprint", () => redrawAll());

/**
 * Lets a reader move along `count` positions of a plot by pointer or arrow keys.
 * `at(x)` is the position under a pixel; `read(position)` marks it and returns its text.
 */
export function walkable(holder, { label, count, start, at, read }) {
  const go = (position) => {
    const now = Math.max(0, Math.min(count - 1, position));
    holder.setAttribute("aria-valuenow", now);
    holder.setAttribute("aria-valuetext", read(now));
  };
  const attributes = {
    tabindex: 0,
    role: "slider",
    "aria-label": label,
    "aria-valuemin": 0,
    "aria-valuemax": count - 1,
  };
  for (const [name, value] of Object.entries(attributes)) holder.setAttribute(name, value);
  const now = () => Number(holder.getAttribute("aria-valuenow"));
  const moves = {
    ArrowLeft: () => now() - 1,
    ArrowDown: () => now() - 1,
    ArrowRight: () => now() + 1,
    ArrowUp: () => now() + 1,
    Home: () => 0,
    End: () => count - 1,
    PageUp: () => now() + 10,
    PageDown: () => now() - 10,
  };
  holder.addEventListener("keydown", (event) => {
    if (!(event.key in moves)) return;
    event.preventDefault();
    go(moves[event.key]());
  });
  holder.addEventListener("pointermove", (event) => go(at(event.clientX - holder.getBoundingClientRect().left)));
  holder.addEventListener("pointerleave", () => go(start));
  go(start);
}

/** Half the width of a letter of a label, in pixels. */
const LETTER_HALF = 3.4;

/** Draws horizontal rules with their values, and the labels below. */
export function axes({ x, y, xTicks, yTicks, xFormat, yFormat, left, right, bottom }) {
  const [across, up] = [grain(xTicks), grain(yTicks)];
  return [
    yTicks.map((tick) => [
      s("line", { class: "rule", x1: left, x2: right, y1: y(tick), y2: y(tick) }),
      s(
        "text",
        { class: "tick", x: left - 8, y: y(tick), dy: "0.32em", "text-anchor": "end" },
        yFormat(tick, up),
      ),
    ]),
    xTicks.map((tick) => {
      const words = xFormat(tick, across);
      const beyond = x(tick) + LETTER_HALF * words.length > right;
      return s("text", { class: "tick", x: beyond ? right : x(tick), y: bottom + 18, "text-anchor": beyond ? "end" : "middle" }, words);
    }),
  ];
}

const swatch = (index) =>
  s(
    "svg",
    { class: "swatch", width: 22, height: 8, "aria-hidden": "true" },
    s("line", { class: `line s${index}`, x1: 1, x2: 21, y1: 4, y2: 4 }),
  );
export const block = (index, shape = "bar") =>
  s(
    "svg",
    { class: "swatch", width: 12, height: 12, "aria-hidden": "true" },
    s("rect", { class: `${shape} s${index}`, width: 12, height: 12 }),
  );

/** Returns a figure: its title, its legend with the values read, the plot, and the same data as a table. */
export function figure({ title, legend, holder, rows, note }) {
  const element = h(
    "figure",
    { class: "chart" },
    h("figcaption", {}, h("span", { class: "title" }, title), legend),
    holder,
    note ? h("p", { class: "note" }, note) : null,
    rows ? disclosure("As a table", rows) : null,
  );
  const saving = pictureButtons(element);
  element.append(saving);
  return element;
}

/**
 * Draws lines over common positions.
 * x: `{values, domain, label, here, format, tick, whole, between, log}`. `between` means that x names the unit before it; `here` gives the
 * text of a position, if it is not label and format. y: `{format, tick, also, log}`; `log` means a logarithmic axis.
 * series: `[{name, values, band, kind: "line" | "bars" | "levels", bare, joined, apart, colour}]`; a missing value is null. Bars and levels
 * span the unit before their x. A `bare` line has no dots, a `joined` line skips missing values, and an `apart` series is dots alone. `band`
 * holds a low and a high end for each value; a series whose `values` are null is its band alone. `colour` defaults to the index of the series. The first position read is `start`, or the last
 * value of the first series. `gutter` aligns charts that stand above each other.
 */
export function lineChart({ title, x, y, series: given, height = 190, note, start: first, gutter = 0 }) {
  const series = given.map((one, index) => ({ colour: index, ...one, isBand: one.values === null, values: one.values ?? x.values.map(() => null) }));
  const shown = x.values
    .map((_, index) => index)
    .filter((index) => series.some(({ values }) => Number.isFinite(values[index])));
  const here = h("span", { class: "here" });
  const outputs = series.map(() => h("b", {}));
  const legend = h(
    "span",
    { class: "legend" },
    here,
    series.map(({ name, kind, colour, band, isBand }, index) =>
      h("span", {}, name ? [kind === "bars" ? block(colour) : isBand ? null : swatch(colour), band && block(colour, "band"), `${name} `] : null, outputs[index]),
    ),
  );
  const same = (value) => value;
  const [size, sized] = y.log ? [Math.log, Math.exp] : [same, same];
  const along = x.log ? Math.log : same;
  const said = ({ values, band, isBand }, index) => {
    const ends = band?.[index].map(y.format).join(" to ");
    if (isBand) return ends;
    return band && Number.isFinite(values[index]) ? `${y.format(values[index])} (${ends})` : y.format(values[index]);
  };
  const yDomain = extent(
    series.flatMap(({ values, band }) => [...values, ...(band ?? []).flat()].map((value) => (value === null ? null : size(value)))),
    y.also,
  );
  const ends = x.domain ?? [x.values[0], x.values.at(-1)];
  const xDomain = ends.map(along);
  let cursor,
    xScale = scale(xDomain, [0, 1]);
  const start =
    first >= 0
      ? shown.indexOf(first)
      : Math.max(
          0,
          shown.findLastIndex((index) => Number.isFinite(series[0].values[index])),
        );
  let position = start;
  const shift = x.between ? 0.5 : 0;
  const holder = plot(height, (width) => {
    const yTicks = y.log ? logTicks(...yDomain.map(sized)) : ticks(...yDomain, height / 38);
    const left = Math.max(
      gutter,
      16 + 6.6 * Math.max(...yTicks.map((tick) => y.tick(tick, grain(yTicks)).length)),
    );
    xScale = scale(xDomain, [left, width - 14]);
    const up = scale(yDomain, [height - 30, 10]);
    const frame = { x: (value) => xScale(along(value)), y: (value) => up(size(value)), left, right: width - 4, bottom: height - 30 };
    const xTicks = (x.log ? logTicks(...ends) : ticks(...ends, Math.min(12, width / 70))).filter(
      (tick) => (!x.whole || Number.isInteger(tick)) && !(x.between && tick === 0),
    );
    cursor = s("line", { class: "cursor", y1: 6, y2: frame.bottom });
    mark();
    return [
      axes({
        ...frame,
        x: (value) => xScale(along(value - shift)),
        xTicks,
        yTicks,
        xFormat: x.tick ?? x.format,
        yFormat: y.tick,
      }),
      cursor,
      series.map((one) => drawn(one, x.values, frame)),
    ];
  });
  const mark = () => {
    const pixel = xScale(along((x.values[shown[position]] ?? 0) - shift));
    cursor?.setAttribute("x1", pixel);
    cursor?.setAttribute("x2", pixel);
  };
  const read = (at) => {
    position = at;
    const index = shown[at];
    here.textContent = x.here ? x.here(x.values[index]) : `${x.label} ${x.format(x.values[index])}`;
    const words = series.map((one) => said(one, index));
    // Series of dots have values at few positions: a missing one is left blank beside its name.
    series.forEach(({ apart, values }, k) => (outputs[k].textContent = apart && !Number.isFinite(values[index]) ? "" : words[k]));
    mark();
    return `${here.textContent}: ${series.map(({ name }, k) => `${name} ${words[k]}`).join(", ")}`;
  };
  const nearest = (pixel) => {
    const value = xScale.inverse(pixel) + shift;
    return shown.reduce(
      (best, index, at) => (Math.abs(along(x.values[index]) - value) < Math.abs(along(x.values[shown[best]]) - value) ? at : best),
      0,
    );
  };
  if (shown.length > 0) walkable(holder, { label: title, count: shown.length, start, at: nearest, read });
  const columns = [{ name: x.label, cell: (index) => x.format(x.values[index]) }];
  columns.push(
    ...series.map((one) => ({ name: one.name, numeric: true, cell: (index) => said(one, index) })),
  );
  return figure({ title, legend, holder, note, rows: () => table(title, columns, shown) });
}

/** Bars narrower than this, in pixels, are drawn as one shape. */
const NARROWEST = 5;

function drawn({ values, band, kind, bare, joined, apart, colour }, positions, { x, y, bottom }) {
  const points = values.map((value, k) => [x(positions[k]), y(value), value]);
  const seen = points.filter(([, , value]) => Number.isFinite(value));
  const wide = x(1) - x(0);
  if (kind === "bars" && wide < NARROWEST) return s("path", { class: `bar s${colour}`, d: steps(seen, wide, bottom) });
  if (kind === "bars") {
    const zero = Math.min(bottom, Math.max(10, y(0)));
    return seen.map(([right, top]) =>
      s("rect", {
        class: `bar s${colour}`,
        x: right - wide + 1,
        width: Math.max(1, wide - 2),
        y: Math.min(top, zero, bottom - 1),
        height: Math.max(1, Math.abs(zero - top)),
      }),
    );
  }
  if (kind === "levels" && wide < NARROWEST) return s("path", { class: `line s${colour}`, d: steps(seen, wide) });
  if (kind === "levels")
    return seen.map(([right, py]) =>
      s("line", { class: `level s${colour}`, x1: right - wide + 1, x2: right - 1, y1: py, y2: py }),
    );
  const run = joined ? seen : points;
  const path = run.map(([px, py, value], k) => {
    if (!Number.isFinite(value)) return "";
    return `${k > 0 && Number.isFinite(run[k - 1][2]) ? "L" : "M"}${px.toFixed(1)} ${py.toFixed(1)}`;
  });
  const ends =
    !bare && seen.length <= 40 ? seen.map(([cx, cy]) => s("circle", { class: `dot s${colour}`, cx, cy, r: 2.5 })) : null;
  const outline = band && [...band.map(([low], k) => [k, low]), ...band.map(([, high], k) => [k, high]).reverse()].map(([k, end]) => `${x(positions[k]).toFixed(1)} ${y(end).toFixed(1)}`);
  return [
    band ? s("path", { class: `band s${colour}`, d: `M${outline.join("L")}Z` }) : null,
    apart ? null : s("path", { class: `line s${colour}`, d: path.join("") }),
    ends,
  ];
}

/** Returns the path of a staircase over positions that each end a unit, closed along `bottom` if it is given. */
function steps(seen, wide, bottom) {
  if (seen.length === 0) return "";
  const stairs = seen.map(([right, top]) => `V${top.toFixed(1)}H${right.toFixed(1)}`).join("");
  const [left, top] = [(seen[0][0] - wide).toFixed(1), seen[0][1].toFixed(1)];
  return bottom === undefined ? `M${left} ${top}${stairs}` : `M${left} ${bottom}${stairs}V${bottom}Z`;
}
