// What was held of each of several assets through time, stacked; the rest of the whole is in the bank.

import { axes, block, figure, plot, scale, ticks, walkable } from "./chart.js";
import { h, s, table } from "./dom.js";
import { allocation, percentTick } from "./format.js";

const [HEIGHT, FOOT, TOP] = [190, 30, 10];
/** The colours of assets, chosen so that neighbours differ; further assets are shown together. */
const COLOURS = [0, 1, 3, 6, 4, 7];
const OTHERS = 2;
const QUARTERS = [0, 0.25, 0.5, 0.75, 1];

/** Columns narrower than this, in pixels, are drawn as the average of several periods. */
const NARROWEST = 4;

/** `shares`: for each period, from the first, the share of wealth in each of `assets` by its name. `x`: `{name(period), tick(period)}`. */
export function stackedChart({ title, assets, shares, x }) {
  const own = assets.length > COLOURS.length ? assets.slice(0, COLOURS.length - 1) : assets;
  const others = assets.slice(own.length);
  const layers = own.map((name, index) => ({ name, colour: COLOURS[index], of: (held) => held[name] }));
  if (others.length > 0) layers.push({ name: "Others", colour: OTHERS, of: (held) => others.reduce((sum, name) => sum + held[name], 0) });
  const told = [...layers, { name: "Bank", of: (held) => 1 - assets.reduce((sum, name) => sum + held[name], 0) }];
  const here = h("span", { class: "here" });
  const outputs = told.map(() => h("b", {}));
  const legend = h("span", { class: "legend" }, here, told.map(({ name, colour }, index) => h("span", {}, index < layers.length ? block(colour) : null, `${name} `, outputs[index])));
  let [across, cursor, position] = [scale([0, 1], [0, 1]), null, shares.length - 1];
  const mark = () => {
    for (const end of ["x1", "x2"]) cursor?.setAttribute(end, across(position + 0.5));
  };
  const holder = plot(HEIGHT, (width) => {
    const [left, right, bottom] = [64, width - 4, HEIGHT - FOOT];
    across = scale([0, shares.length], [left, width - 14]);
    const y = scale([0, 1], [bottom, TOP]);
    const xTicks = ticks(1, shares.length, width / 80).filter(Number.isInteger);
    const every = Math.ceil(NARROWEST / (across(1) - across(0)));
    const stacked = Array.from({ length: Math.ceil(shares.length / every) }, (_, column) => {
      const [start, within] = [column * every, shares.slice(column * every, (column + 1) * every)];
      const held = layers.map(({ of }) => within.reduce((sum, one) => sum + of(one), 0) / within.length);
      return { start, end: start + within.length, tops: held.map((_, layer) => held.slice(0, layer + 1).reduce((sum, share) => sum + share, 0)) };
    });
    // Narrow columns stand close, on whole pixels: gaps between them would be stripes.
    const gap = across(1) - across(0) >= 2 * NARROWEST ? 1 : 0;
    const box = ({ start, end, tops }, layer) => `M${Math.round(across(start)) + gap} ${y(tops[layer]).toFixed(1)}H${Math.round(across(end)) - gap}V${y(tops[layer - 1] ?? 0).toFixed(1)}H${Math.round(across(start)) + gap}Z`;
    const areas = layers.map(({ colour }, layer) => s("path", { class: `bar s${colour}`, d: stacked.map((one) => box(one, layer)).join("") }));
    cursor = s("line", { class: "cursor", y1: 6, y2: bottom });
    mark();
    return [axes({ x: (period) => across(period - 0.5), y, xTicks, yTicks: QUARTERS, xFormat: x.tick, yFormat: percentTick, left, right, bottom }), areas, cursor];
  });
  const read = (at) => {
    position = at;
    here.textContent = x.name(at + 1);
    const words = told.map(({ of }, index) => (outputs[index].textContent = allocation(of(shares[at]))));
    mark();
    return `${here.textContent}: ${told.map(({ name }, index) => `${name} ${words[index]}`).join(", ")}`;
  };
  walkable(holder, { label: title, count: shares.length, start: shares.length - 1, at: (pixel) => Math.floor(across.inverse(pixel)), read });
  const columns = [{ name: "Period", cell: (index) => x.name(index + 1) }, ...[...assets.map((name) => ({ name, of: (held) => held[name] })), told.at(-1)].map(({ name, of }) => ({ name, numeric: true, cell: (index) => allocation(of(shares[index])) }))];
  return figure({ title, legend, holder, rows: () => table(title, columns, shares.map((_, index) => index)) });
}
