// A histogram over wealth, drawn on scales that others share, with places that are marked in all of them.

import { axes, figure, plot, scale, ticks, walkable } from "./chart.js";
import { h, s, table } from "./dom.js";
import { percent, percentTick, tick, wealth } from "./format.js";

const HEIGHT = 130;

/** `shares` of even bins over `domain`; `top`: the largest share of all that are drawn alike; `marks`: `[{name, at}]`; `of` is what is
 * counted, told by `format`. */
export function histogram({ title, shares, domain, top, colour, marks, of = "Wealth", format = wealth }) {
  const width = (domain[1] - domain[0]) / shares.length;
  const from = (bin) => domain[0] + bin * width;
  const output = h("b", {});
  const here = h("span", { class: "here" });
  const legend = h("span", { class: "legend" }, here, output);
  let [x, cursor, position] = [scale(domain, [0, 1]), null, 0];
  const mark = () => {
    cursor?.setAttribute("x", x(from(position)));
    cursor?.setAttribute("width", x(from(position + 1)) - x(from(position)));
  };
  const holder = plot(HEIGHT, (room) => {
    const [left, right, bottom] = [44, room - 10, HEIGHT - 30];
    x = scale(domain, [left, right]);
    const y = scale([0, top], [bottom, 14]);
    cursor = s("rect", { class: "cursor bin", y: 8, height: bottom - 8 });
    mark();
    const bars = shares.map((share, bin) =>
      share > 0
        ? s("rect", { class: `bar s${colour}`, x: x(from(bin)) + 0.5, width: Math.max(0.5, x(from(bin + 1)) - x(from(bin)) - 1), y: y(share), height: bottom - y(share) })
        : null,
    );
    const rules = marks
      .filter(({ at }) => at > domain[0] && at < domain[1])
      .map(({ at }) => s("line", { class: "marked", x1: x(at), x2: x(at), y1: 8, y2: bottom }));
    const frame = { x, y, left, right, bottom };
    return [axes({ ...frame, xTicks: ticks(...domain, room / 90), yTicks: ticks(0, top, 3), xFormat: tick, yFormat: percentTick }), cursor, bars, rules];
  });
  const read = (at) => {
    position = at;
    here.textContent = `${of} ${format(from(at))} to ${format(from(at + 1))}`;
    output.textContent = percent(shares[at]);
    mark();
    return `${here.textContent}: ${output.textContent}`;
  };
  const start = shares.indexOf(Math.max(...shares));
  walkable(holder, { label: title, count: shares.length, start, read, at: (pixel) => Math.floor((x.inverse(pixel) - domain[0]) / width) });
  const columns = [
    { name: of, cell: (bin) => `${format(from(bin))} to ${format(from(bin + 1))}` },
    { name: "How often", numeric: true, cell: (bin) => percent(shares[bin]) },
  ];
  const seen = shares.map((_, bin) => bin).filter((bin) => shares[bin] > 0);
  return figure({ title, legend, holder, rows: () => table(title, columns, seen) });
}
