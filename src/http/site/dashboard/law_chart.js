// Two laws of the coming log-return, back to back: the returns seen above the line, the worst case below it.

import { axes, figure, grain, plot, scale, ticks, walkable } from "./chart.js";
import { h, s, table } from "./dom.js";
import { percent, percentTick } from "./format.js";

const HEIGHT = 260;
const BINS = 36;
/** Width of a label with the space around it, in pixels. */
const LABEL = 56;

const simple = (logReturn) => percent(Math.expm1(logReturn));

/** Returns the masses of both laws over common bins: the empirical law, the worst law, and the part of the worst that was moved there. */
function binned(transport) {
  const places = transport.flatMap(({ atom, moved_to }) => [atom, moved_to]);
  const [low, high] = [Math.min(...places), Math.max(...places)];
  const width = (high - low) / BINS || 1e-3;
  const bins = Array.from({ length: BINS }, (_, k) => ({
    from: low + k * width,
    to: low + (k + 1) * width,
    seen: 0,
    worst: 0,
    moved: 0,
  }));
  const bin = (place) => bins[Math.min(BINS - 1, Math.floor((place - low) / width))];
  for (const { atom, moved_to, mass } of transport) {
    bin(atom).seen += mass;
    bin(moved_to).worst += mass;
    if (moved_to !== atom) bin(moved_to).moved += mass;
  }
  return bins;
}

/** Draws the worst case from an answer of `/action?explain=worst_case`. */
export function lawChart({ transport }) {
  const bins = binned(transport);
  const tallest = Math.max(...bins.map(({ seen, worst }) => Math.max(seen, worst)));
  const domain = [bins[0].from, bins.at(-1).to];
  const here = h("span", { class: "here" });
  const [seen, worst, moved] = ["seen", "kept", "moved"].map((name) => ({
    key: s(
      "svg",
      { class: "swatch", width: 12, height: 12, "aria-hidden": "true" },
      s("rect", { class: `mass ${name}`, width: 12, height: 12 }),
    ),
    value: h("b", {}),
  }));
  const legend = h(
    "span",
    { class: "legend" },
    here,
    h("span", {}, seen.key, "Seen ", seen.value),
    h("span", {}, worst.key, "Worst market ", worst.value),
    h("span", { class: "inside" }, moved.key, "of that, moved here ", moved.value),
  );
  let x = scale(domain, [0, 1]),
    cursor,
    position = 0;
  const mark = () => {
    cursor?.setAttribute("x", x(bins[position].from));
    cursor?.setAttribute("width", x(bins[position].to) - x(bins[position].from));
  };
  const holder = plot(HEIGHT, (width) => {
    const [left, right, middle] = [54, width - 8, (HEIGHT - 24) / 2];
    x = scale(domain, [left, right]);
    const y = scale([0, tallest], [0, middle - 12]);
    const both = scale([-tallest, tallest], [HEIGHT - 36, 12]);
    const levels =
      [2, 4].map((wanted) => ticks(0, tallest, wanted).filter((level) => level > 0)).find(({ length }) => length > 0) ??
      [];
    const round = ticks(...domain.map(Math.expm1), width / 90).filter(roomy((tick) => x(Math.log1p(tick))));
    const frame = axes({
      x,
      y: both,
      left,
      right,
      bottom: HEIGHT - 30,
      xTicks: round.map(Math.log1p),
      yTicks: [...levels.map((level) => -level), 0, ...levels],
      xFormat: (tick) => percentTick(Math.expm1(tick), grain(round)),
      yFormat: (tick, step) => percentTick(Math.abs(tick), step),
    });
    const bar = (bin, name, top, height) =>
      s("rect", {
        class: `mass ${name}`,
        x: x(bin.from) + 0.5,
        width: Math.max(1, x(bin.to) - x(bin.from) - 1),
        y: top,
        height,
      });
    cursor = s("rect", { class: "cursor bin", y: 6, height: HEIGHT - 36 });
    mark();
    const zero = both(0);
    return [
      cursor,
      frame,
      bins.map((bin) => [
        bar(bin, "seen", zero - y(bin.seen), y(bin.seen)),
        bar(bin, "kept", zero, y(bin.worst - bin.moved)),
        bin.moved > 0 ? bar(bin, "moved", zero + y(bin.worst - bin.moved), y(bin.moved)) : null,
      ]),
      s("line", { class: "zero", x1: left, x2: right, y1: zero, y2: zero }),
    ];
  });
  const read = (at) => {
    position = at;
    const bin = bins[at];
    here.textContent = `Return ${simple(bin.from)} to ${simple(bin.to)}`;
    [seen.value.textContent, worst.value.textContent, moved.value.textContent] = [bin.seen, bin.worst, bin.moved].map(
      (mass) => percent(mass),
    );
    mark();
    return `${here.textContent}: seen ${seen.value.textContent}, worst market ${worst.value.textContent}, of that, moved here ${moved.value.textContent}`;
  };
  const start = bins.reduce((best, bin, at) => (bin.moved > bins[best].moved ? at : best), 0);
  walkable(holder, {
    label: "Returns seen and the worst market",
    count: BINS,
    start,
    read,
    at: (pixel) => Math.floor((BINS * (x.inverse(pixel) - domain[0])) / (domain[1] - domain[0])),
  });
  return figure({
    title: "How often each return occurs: as seen above the line, in the worst market below it",
    legend,
    holder,
    rows: () => movesTable(transport),
  });
}

/** Keeps a label only if it is clear of the one kept before: equal steps of return lie closer as log-returns grow. */
function roomy(place) {
  let last = -Infinity;
  return (value) => {
    if (place(value) - last < LABEL) return false;
    last = place(value);
    return true;
  };
}

function movesTable(transport) {
  const moves = transport.filter(({ atom, moved_to }) => atom !== moved_to);
  if (moves.length === 0) return h("p", {}, "Nothing is moved.");
  return table(
    "Returns that the worst market moves",
    [
      { name: "Return seen", cell: ({ atom }) => simple(atom) },
      { name: "Moved to", numeric: true, cell: ({ moved_to }) => simple(moved_to) },
      { name: "How often", numeric: true, cell: ({ mass }) => percent(mass, 2) },
    ],
    moves.sort((a, b) => b.mass - a.mass),
  );
}
