// One view of a policy's surface: a single state, a line along one feature, or a field over two.

import { stepSurface } from "./surface.js";

const [COLUMNS, ROWS, ALONG] = [41, 29, 61];
/** More dots than this would hide the field. */
const DOTS = 300;
const AXES = ["wealth", "mean", "deviation", "radius"];

/**
 * Returns the picture of `step`: `across` is the axis wanted besides the mean, `radius` a share of the way from the least radius of the design
 * to the largest. `surfaces` caches the surface of a step for the next picture.
 */
export function picture(policy, shape, surfaces, { step, across, radius }) {
  if (!surfaces.has(step)) surfaces.set(step, stepSurface(policy, shape, step));
  const found = surfaces.get(step);
  if (found === null) {
    const { band, floor_gains } = policy.steps[step].solution;
    return { kind: "single", band, floor_gain: floor_gains[0] };
  }
  const axes = AXES.filter((axis) => axis in found.ranges);
  if (axes.length === 1) return along(found, axes[0]);
  const choices = axes.filter((axis) => axis !== "mean");
  const itself = { wealth: policy.specification.problem.initial_wealth, mean: shape.mean, deviation: shape.deviation };
  return over(found, choices, choices.includes(across) ? across : choices[0], radius, itself);
}

/** Returns what a session with the policy's own record and wealth holds at the start: `{band, isExact}`, exact if the first step has a single state. */
export function heldNow(policy, shape) {
  const { solution } = policy.steps[0];
  if (solution.kind === "single") return { band: solution.band, isExact: true };
  const { initial_wealth } = policy.specification.problem;
  const held = stepSurface(policy, shape, 0).at({ wealth: initial_wealth, mean: shape.mean, deviation: shape.deviation });
  return { band: [held, held], isExact: false };
}

/** Returns what is held after `step` periods at each of `means`, with everything else in the middle of the design. */
export function curve(policy, shape, { step, means }) {
  const found = stepSurface(policy, shape, step);
  if (found === null) return means.map(() => policy.steps[step].solution.band[0]);
  return means.map((mean) => found.at({ mean }));
}

function along(found, axis) {
  const values = spread(found.ranges[axis], ALONG);
  return { kind: "line", axis, values, allocations: values.map((value) => found.at({ [axis]: value })) };
}

function over(found, choices, across, share, itself) {
  const range = across === "radius" ? undefined : found.ranges.radius;
  const radius = range ? range[0] * (range[1] / range[0]) ** share : found.middle.radius;
  const [xs, ys] = [spread(found.ranges[across], COLUMNS), spread(found.ranges.mean, ROWS)];
  // Goes column by column, because all laws of a column share one standard deviation.
  const columns = xs.map((value) => ys.map((mean) => found.at({ radius, mean, [across]: value })));
  return {
    kind: "field",
    across,
    choices,
    xs,
    ys,
    cells: ys.map((_, row) => columns.map((column) => column[row])),
    dots: thinned(found.dots(across), found.dots("mean")),
    own: across in itself ? [itself[across], itself.mean] : null,
    radius: range ? radius : null,
    rest: ["wealth", "deviation", "radius"]
      .filter((axis) => axis !== across && axis in found.ranges)
      .map((axis) => [axis, axis === "radius" ? radius : found.middle[axis]]),
  };
}

const spread = ([low, high], count) => Array.from({ length: count }, (_, k) => low + ((high - low) * k) / (count - 1));

/** Returns evenly spaced pairs, `DOTS` at most. */
function thinned(xs, ys) {
  const stride = Math.max(1, Math.ceil(xs.length / DOTS));
  return xs.flatMap((x, index) => (index % stride === 0 ? [[x, ys[index]]] : []));
}
