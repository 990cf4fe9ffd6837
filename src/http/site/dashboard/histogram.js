// A histogram of wealth, drawn on scales that several histograms share, with marks at the same values in all of them.

import { axes, figure, plot, scale, ticks, walkable } from "./chart.js";
import { h, s, table } from "./dom.js";
import { percent, percentTick, tick, wealth } from "./format.js";

const HEIGHT = 130;
/** Width of the bar of a point mass, in pixels. */
const POINT = 5;

/** Draws the `shares` of equal bins over `domain`. `point` is `{at, share, name}` of the paths that end at one value: it is in no bin and has a
 * bar of its own. `top` is the largest share of all histograms on the same scale; `marks` are `[{name, at}]`; `of` names the quantity, which
 * `format` formats. */
export function histogram({ title, shares, domain, point = null, top, colour, marks, of = "Wealth", format = wealth }) {
  const width = (domain[1] - domain[0]) / shares.length;
  const from = (bin) => domain[0] + bin * width;
  const bins = shares.map((share, bin) => ({ from: from(bin), to: from(bin + 1), share, name: `${format(from(bin))} to ${format(from(bin + 1))}` }));
  const isDrawn = point !== null && point.share > 0;
  const place = isDrawn ? bins.filter(({ from }) => from <= point.at).length : 0;
  const bars = isDrawn ? bins.toSpliced(place, 0, { from: point.at, to: point.at, share: point.share, name: `${format(point.at)}, ${point.name}` }) : bins;
  const output = h("b", {});
  const here = h("span", { class: "here" });
  const legend = h("span", { class: "legend" }, here, output);
  let [x, cursor, position] = [scale(domain, [0, 1]), null, 0];
  const span = ({ from, to }) => (from === to ? [x(from) - POINT / 2, POINT] : [x(from) + 0.5, Math.max(0.5, x(to) - x(from) - 1)]);
  const mark = () => {
    const [left, wide] = span(bars[position]);
    cursor?.setAttribute("x", left - 0.5);
    cursor?.setAttribute("width", wide + 1);
  };
  const holder = plot(HEIGHT, (room) => {
    const [left, right, bottom] = [44, room - 10, HEIGHT - 30];
    x = scale(domain, [left, right]);
    const y = scale([0, top], [bottom, 14]);
    cursor = s("rect", { class: "cursor bin", y: 8, height: bottom - 8 });
    mark();
    const drawn = [...bars].sort((one, other) => Number(one.from === one.to) - Number(other.from === other.to)).map((bar) => {
      const [from, wide] = span(bar);
      return bar.share > 0 ? s("rect", { class: `bar s${colour}`, x: from, width: wide, y: y(bar.share), height: bottom - y(bar.share) }) : null;
    });
    const rules = marks
      .filter(({ at }) => at > domain[0] && at < domain[1])
      .map(({ at }) => s("line", { class: "marked", x1: x(at), x2: x(at), y1: 8, y2: bottom }));
    const frame = { x, y, left, right, bottom };
    return [axes({ ...frame, xTicks: ticks(...domain, room / 90), yTicks: ticks(0, top, 3), xFormat: tick, yFormat: percentTick }), cursor, drawn, rules];
  });
  const read = (at) => {
    position = at;
    here.textContent = `${of} ${bars[at].name}`;
    output.textContent = percent(bars[at].share);
    mark();
    return `${here.textContent}: ${output.textContent}`;
  };
  const start = bars.reduce((most, { share }, index) => (share > bars[most].share ? index : most), 0);
  const at = (pixel) => {
    if (isDrawn && Math.abs(pixel - x(point.at)) <= POINT) return place;
    const bin = Math.floor((x.inverse(pixel) - domain[0]) / width);
    return isDrawn && bin >= place ? bin + 1 : bin;
  };
  walkable(holder, { label: title, count: bars.length, start, read, at });
  const columns = [
    { name: of, cell: ({ name }) => name },
    { name: "How often", numeric: true, cell: ({ share }) => percent(share) },
  ];
  return figure({ title, legend, holder, rows: () => table(title, columns, bars.filter(({ share }) => share > 0)) });
}
